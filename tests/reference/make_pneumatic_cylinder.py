"""Reference of the first-principles actuator: `python make_pneumatic_cylinder.py` writes tests/data/reference_pneumatic_cylinder.csv.

The equations are typed again from the description of the plant, with the names used there. Integration as in the rig:
RK4 with 0.1 ms, flow of the tube delayed by whole steps, play and seal once per sample of 1 ms. `one_step_scipy` takes
the same step with LSODA of SciPy, which shows how far RK4 is from the solution.
"""

import csv
import math
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

DATA = Path(__file__).resolve().parents[1] / "data" / "reference_pneumatic_cylinder.csv"

bore, rod, stroke, dead = 0.020, 0.008, 0.300, 2.0e-6
psup, patm, T, R = 0.5e6, 101325.0, 293.0, 287.0
kin, kout, kv = 1.4, 1.0, 1.2
Cd, Avmax, overlap = 0.8, 3.0e-6, 0.02
ws, zs = 2 * math.pi * 70, 0.7
Kp, Ki, tau_cmd, vhys = 8.0e-6, 1.0e-4, 0.0015, 1500.0
Vt, At, tdelay = 9.0e-6, 1.4e-6, 0.003
leak, eta = 0.010e-6, 0.955
seal, sealx, klc = 1.2, 8e-6, 4e5

S = (math.pi / 4 * bore**2, math.pi / 4 * (bore**2 - rod**2))
Feq = 0.25e6 * (S[0] + S[1]) / 2
STEP, SAMPLE, DELAY = 1e-4, 10, 30  # s, steps, steps


def psi(a, b):
    if a < b:
        return -psi(b, a)
    r = b / a

    def subsonic(r):
        return 0.156174 * r ** (1 / 1.4) * math.sqrt(1 - r ** (0.4 / 1.4))

    if r <= 0.528:
        part = 0.040418
    elif r < 0.995:
        part = subsonic(r)
    else:
        part = subsonic(0.995) * (1 - r) / (1 - 0.995)
    return a / math.sqrt(T) * part


def valve_flow(s, pv):
    if s > overlap:
        return Cd * Avmax * min(1.0, s - overlap) * psi(psup + patm, pv)
    if s < -overlap:
        return -Cd * Avmax * abs(max(-1.0, s + overlap)) * psi(pv, patm)
    return 0.0


def tube_flow(pv, p):
    return Cd * At * psi(pv, p)


def rates(y, pic, md, x, v):
    """State of a side: c, q, s, s', pv, p."""
    out = []
    p = (y[5], y[11])
    volumes = (dead + S[0] * (stroke / 2 + x), dead + S[1] * (stroke / 2 - x))
    volume_rates = (S[0] * v, -S[1] * v)
    for i in (0, 1):
        c, q, s, ds, pv, _ = y[6 * i : 6 * i + 6]
        e = c - pv
        w = min(1.0, max(-1.0, Kp * e + q))
        dq = 0.0 if abs(q + Ki * e * 1e-3) >= 0.3 else Ki * e
        a = kin if md[i] > 0 else kout
        dp = (R * T * (a * md[i] - kout * leak * psi(p[i], p[1 - i])) - kv * p[i] * volume_rates[i]) / volumes[i]
        dpv = 1.2 * R * T * (valve_flow(s, pv) - tube_flow(pv, p[i])) / Vt
        out += [(pic[i] - c) / tau_cmd, dq, ds, ws**2 * (w - s) - 2 * zs * ws * ds, dpv, dp]
    return np.array(out)


def one_step_rk4(y, t, f):
    h = STEP
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k2)
    k4 = f(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def one_step_scipy(y, t, f):
    return solve_ivp(f, (t, t + STEP), y, method="LSODA", rtol=1e-8, atol=1e-9).y[:, -1]


def simulate(command, motion, rod_fixed, stop, one_step=one_step_rk4):
    """Rows (u, x, v, F_hat, F_act, p1, p2, pv1, pv2) at every step.

    `command(k)` [N] of sample k; `motion(n)` (x, v) at step n, held over the step. Row n stands at the end of step n, as
    a slave has its outputs after it, with the inputs of that step.
    """
    rest = [Feq / area + patm for area in S]
    y = np.array([z for p in rest for z in (p, 0.0, 0.0, 0.0, p, p)])
    pic, line = list(rest), [[0.0] * DELAY, [0.0] * DELAY]
    z = f_last = 0.0

    def chamber_force(y):
        return eta * (S[0] * (y[5] - patm) - S[1] * (y[11] - patm))

    rows = []
    for n in range(round(stop / STEP)):
        u, (x, v) = command(n // SAMPLE), motion(n)
        if n % SAMPLE == 0:
            for i, sign in ((0, 0.5), (1, -0.5)):
                wanted = min(psup + patm, max(patm, (Feq + sign * u) / S[i] + patm))
                pic[i] = min(wanted + vhys, max(wanted - vhys, pic[i]))
            dx = (chamber_force(y) - f_last) / klc
            f_last = chamber_force(y)
            z += dx - abs(dx) * z / sealx
        md = []
        for i in (0, 1):
            md.append(line[i].pop())
            line[i].insert(0, tube_flow(y[6 * i + 4], y[6 * i + 5]))
        y = one_step(y, n * STEP, lambda _, y: rates(y, pic, md, x, v))
        f_hat = S[0] * (y[4] - patm) - S[1] * (y[10] - patm)
        f_act = chamber_force(y) - (seal * z / sealx if rod_fixed else 0.0)
        rows.append([u, x, v, f_hat, f_act, y[5], y[11], y[4], y[10]])
    return np.array(rows)


SCENARIOS = {  # name: (command, motion, rod_fixed)
    "rod fixed": (
        lambda k: 40.0 * math.sin(2 * math.pi * (0.5 + 10 * k * 1e-3) * k * 1e-3) + (15.0 if k % 100 < 50 else -10.0),
        lambda n: (0.03, 0.0),
        True,
    ),
    "moving": (
        lambda k: 50.0 * math.sin(2 * math.pi * 3 * k * 1e-3),
        lambda n: (0.1 * math.sin(15 * n * STEP), 1.5 * math.cos(15 * n * STEP)),
        False,
    ),
    "saturated": (lambda k: 250.0 if k // 80 % 2 == 0 else -250.0, lambda n: (-0.05, 0.0), False),
}
STOP, STORED_EVERY = 0.4, 40
COLUMNS = ["time", "u", "x", "v", "F_hat", "F_act", "p1", "p2", "pv1", "pv2"]


def main():
    with open(DATA, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["scenario", *COLUMNS])
        for name, (command, motion, rod_fixed) in SCENARIOS.items():
            rows = simulate(command, motion, rod_fixed, STOP)
            for n in range(STORED_EVERY - 1, len(rows), STORED_EVERY):
                writer.writerow([name, repr(round((n + 1) * STEP, 6)), *(repr(float(v)) for v in rows[n])])


if __name__ == "__main__":
    main()
