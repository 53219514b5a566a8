"""Swing-up of the pneumatic cart-pole by CasADi with IPOPT: objective, iterations and time of the solve alone.

    python tests/reference/swing_up_ipopt.py [hs|trap|ms|sc ...] [INTERVALS ...]      default: all, 100 200 400

The equations are typed here a second time on purpose: nothing of the project's own code is used. Prints one row per
transcription, number of intervals and form of the expressions (`expanded`: one graph of scalars; `mapped`: a function
per interval), from the pump guess, the fastest of three runs. `cargo bench --bench nlp` prints the same rows for the
optimiser of this project; time there includes building the problem.
"""

import os
import sys
import time

os.environ["OMP_NUM_THREADS"] = "1"

import casadi as ca
import numpy as np
from scipy.linalg import expm, logm

TS, T = 1e-3, 2.0
A_D = np.array([[1.0144, -0.0216], [0.0527, 0.9537]])
B0 = np.array([0.6619, 0.0764])
B_D = A_D @ B0 + np.array([-0.6557, -0.0847])
A_C = np.real(logm(A_D)) / TS
B_C = A_C @ np.linalg.solve(A_D - np.eye(2), B_D)
U_MAX = 0.5e6 * np.pi * 0.02**2 / 4
STROKE = 0.15
PUMP = ([0, 0.13, 0.30, 0.53, 0.75, 1], [0, -0.3, 0.7, -1.3, 2.0, np.pi])


def mechanics(s, force):
    theta, v, w = s[1], s[2], s[3]
    mc, mp, length, g, bp = 0.399, 0.1, 0.2, 9.81, 0.0006
    piston = 1.5145 * ca.tanh(40.8926 * v) + 49.2734 * v
    cart = 5.7910 * ca.tanh(63.7045 * (v - 0.0064)) - 2.3170
    sine, cosine = ca.sin(theta), ca.cos(theta)
    a, b, d = mc + mp, mp * length * cosine, mp * length**2
    p = force - piston - cart + mp * length * w**2 * sine
    q = -bp * w - mp * g * length * sine
    det = a * d - b * b
    return ca.vertcat(v, w, (d * p - b * q) / det, (a * q - b * p) / det)


def dynamics(y, u):
    return ca.vertcat(mechanics(y, y[5] + B0[1] * u), A_C @ y[4:6] + B_C * u)


def interval(kind, h):
    """Defects of one interval as a function of (y, u, um, next y, next u)."""
    y, n, u, um, nu = ca.SX.sym("y", 6), ca.SX.sym("n", 6), ca.SX.sym("u"), ca.SX.sym("um"), ca.SX.sym("nu")
    if kind in ("hs", "trap"):
        fa, fb = dynamics(y, u), dynamics(n, nu)
        if kind == "trap":
            defect = n - y - h / 2 * (fa + fb)
        else:
            fm = dynamics((y + n) / 2 + h / 8 * (fa - fb), um)
            defect = n - y - h / 6 * (fa + 4 * fm + fb)
    elif kind == "sc":
        generator = np.zeros((3, 3))
        generator[:2, :2], generator[:2, 2] = A_C, B_C
        z = ca.vertcat(y[4:6], u)
        half, full = expm(generator * h / 2) @ z, expm(generator * h) @ z
        s, t = y[:4], n[:4]
        fa, fb = mechanics(s, y[5] + B0[1] * u), mechanics(t, full[1] + B0[1] * u)
        fm = mechanics((s + t) / 2 + h / 8 * (fa - fb), half[1] + B0[1] * u)
        defect = ca.vertcat(t - s - h / 6 * (fa + 4 * fm + fb), n[4:6] - full[:2])
    else:
        s, z = y[:4], y[4:6]
        for _ in range(round(h / TS)):
            force = z[1] + B0[1] * u
            k1 = mechanics(s, force)
            k2 = mechanics(s + TS / 2 * k1, force)
            k3 = mechanics(s + TS / 2 * k2, force)
            k4 = mechanics(s + TS * k3, force)
            s = s + TS / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            z = A_D @ z + B_D * u
        defect = n - ca.vertcat(s, z)
    return ca.Function("interval", [y, u, um, n, nu], [defect])


def solve(kind, count, expand):
    h = T / count
    y, u, um = ca.MX.sym("y", 6, count + 1), ca.MX.sym("u", 1, count + 1), ca.MX.sym("um", 1, count)
    held = kind in ("ms", "sc")
    defects = interval(kind, h).map(count)(y[:, :-1], u[:, :-1], um, y[:, 1:], u[:, 1:])
    if held:
        cost = h * ca.sumsqr(u[:-1])
    elif kind == "trap":
        cost = h / 2 * (ca.sumsqr(u[:-1]) + ca.sumsqr(u[1:]))
    else:
        cost = h / 6 * (ca.sumsqr(u[:-1]) + 4 * ca.sumsqr(um) + ca.sumsqr(u[1:]))
    y_low, y_high = np.full((6, count + 1), -np.inf), np.full((6, count + 1), np.inf)
    y_low[0], y_high[0] = -STROKE, STROKE
    y_low[:, 0] = y_high[:, 0] = 0
    y_low[:4, -1] = y_high[:4, -1] = [0, np.pi, 0, 0]
    guess = np.zeros((6, count + 1))
    guess[1] = np.interp(np.linspace(0, 1, count + 1), *PUMP)
    free = count if held else count + 1
    middles = count if kind == "hs" else 0

    # Node by node, as in the statement of the problem.
    def stack(states, commands, middle, vertcat):
        parts = []
        for k in range(count + 1):
            parts.append(states[:, k])
            parts += [commands[k]] if k < free else []
            parts += [middle[k]] if k < middles else []
        return vertcat(*parts)

    def numbers(states, command):
        return stack(states, [command] * (count + 1), [command] * count, lambda *p: np.concatenate([np.atleast_1d(x) for x in p]))

    symbols = stack(y, u, um, ca.vertcat)
    constants = ca.MX.zeros(1, 1)
    if held:
        defects = ca.substitute([defects], [u[-1]], [constants])[0] if False else defects
    names = ca.symvar(ca.vertcat(ca.vec(defects), cost))
    problem = {"x": symbols, "f": cost, "g": ca.vec(defects)}
    # IPOPT's variables must be a vector of symbols: one vector, cut into y, u, um.
    size = symbols.shape[0]
    x = ca.MX.sym("x", size)
    at, ys, us, ums = 0, [], [], []
    for k in range(count + 1):
        ys.append(x[at : at + 6])
        at += 6
        if k < free:
            us.append(x[at])
            at += 1
        else:
            us.append(ca.MX(0))
        if k < middles:
            ums.append(x[at])
            at += 1
        elif k < count:
            ums.append(ca.MX(0))
    whole = ca.Function("whole", names, [cost, ca.vec(defects)])
    arguments = {"y": ca.horzcat(*ys), "u": ca.horzcat(*us), "um": ca.horzcat(*ums)}
    f, g = whole(*[arguments[name.name()] for name in names])
    problem = {"x": x, "f": f, "g": g}
    options = {"ipopt.print_level": 0, "print_time": False, "expand": expand, "ipopt.max_iter": 3000}
    solver = ca.nlpsol("solver", "ipopt", problem, options)
    best = np.inf
    for _ in range(3):
        begin, cpu = time.perf_counter(), time.process_time()
        found = solver(
            x0=numbers(guess, 0.0), lbx=numbers(y_low, -U_MAX), ubx=numbers(y_high, U_MAX), lbg=0, ubg=0
        )
        best = min(best, time.process_time() - cpu)
    stats = solver.stats()
    form = "expanded" if expand else "mapped"
    print(
        f"{kind:5} {count:5} {form:9} {stats['iter_count']:4}  {float(found['f']):.9f}  {1e3 * best:8.2f}  {stats['return_status']}",
        flush=True,
    )


def main():
    words = sys.argv[1:]
    kinds = [w for w in words if not w.isdigit()] or ["hs", "trap", "ms", "sc"]
    counts = [int(w) for w in words if w.isdigit()] or [100, 200, 400]
    print("kind  count form      iterations  objective  CPU ms of the solve")
    for kind in kinds:
        for count in counts:
            for expand in (True, False):
                solve(kind, count, expand)


if __name__ == "__main__":
    main()
