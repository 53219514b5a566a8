"""Swing-up of the pneumatic cart-pole by CasADi with IPOPT: objective, iterations and time of the solve alone.

    python tests/reference/swing_up_ipopt.py [hs|trap|ms|sc ...] [INTERVALS ...]      default: all, 100 200 400

The equations are typed here a second time on purpose: nothing of the project's own code is used. Prints one row per
transcription, number of intervals and form of the expressions (`expanded`: one graph of scalars; `mapped`: a function
per interval), from the pump guess, the fastest of three runs, CPU time in one thread. `cargo bench --bench nlp` prints
the same rows for the optimizer of this project; time there includes building the problem.
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


def transcribe(kind, count):
    """The nonlinear program, and the pump guess with bounds as arguments of its solver."""
    h = T / count
    held = kind in ("ms", "sc")
    commands = count if held else count + 1
    middles = count if kind == "hs" else 0
    # Variables node by node, as in the statement of the problem: y, u, um.
    x = ca.MX.sym("x", 6 * (count + 1) + commands + middles)
    low, high, guess = [], [], []
    y, u, um = [], [], []
    theta = np.interp(np.linspace(0, 1, count + 1), *PUMP)
    at = 0
    for k in range(count + 1):
        y.append(x[at : at + 6])
        bound = np.array([STROKE, *[np.inf] * 5])
        lower, upper = -bound, bound.copy()
        if k == 0:
            lower = upper = np.zeros(6)
        if k == count:
            lower[:4] = upper[:4] = [0, np.pi, 0, 0]
        low.append(lower)
        high.append(upper)
        guess.append([0, theta[k], 0, 0, 0, 0])
        at += 6
        for there, list_ in ((k < commands, u), (k < middles, um)):
            if there:
                list_.append(x[at])
                low.append([-U_MAX])
                high.append([U_MAX])
                guess.append([0])
                at += 1
    y, u = ca.horzcat(*y), ca.horzcat(*u)
    um = ca.horzcat(*um) if middles else ca.MX.zeros(1, count)
    next_u = ca.MX.zeros(1, count) if held else u[:, 1:]
    defects = interval(kind, h).map(count)(y[:, :-1], u[:, :count], um, y[:, 1:], next_u)
    if held:
        cost = h * ca.sumsqr(u)
    elif kind == "trap":
        cost = h / 2 * (ca.sumsqr(u[:-1]) + ca.sumsqr(u[1:]))
    else:
        cost = h / 6 * (ca.sumsqr(u[:-1]) + 4 * ca.sumsqr(um) + ca.sumsqr(u[1:]))
    problem = {"x": x, "f": cost, "g": ca.vec(defects)}
    arguments = {"x0": np.concatenate(guess), "lbx": np.concatenate(low), "ubx": np.concatenate(high)}
    return problem, {**arguments, "lbg": 0, "ubg": 0}


def timed(name, problem, arguments, options, repetitions):
    """Iterations, objective, CPU time [s] of the fastest solve and of the set-up, and the statistics of a solver of CasADi."""
    begin = time.process_time()
    solver = ca.nlpsol("solver", name, problem, {"print_time": False, **options})
    setup = time.process_time() - begin
    best = np.inf
    for _ in range(repetitions):
        begin = time.process_time()
        found = solver(**arguments)
        best = min(best, time.process_time() - begin)
    stats = solver.stats()
    return stats["iter_count"], float(found["f"]), best, setup, stats


def asked(words):
    """Transcriptions and numbers of intervals of a command line, all where it has none."""
    kinds = [w for w in words if not w.isdigit()] or ["hs", "trap", "ms", "sc"]
    return kinds, [int(w) for w in words if w.isdigit()] or [100, 200, 400]


def solve(kind, count, expand, start=None, repetitions=3):
    """Iterations, objective, CPU time [s] of the fastest solve and of the set-up, and IPOPT's status."""
    problem, arguments = transcribe(kind, count)
    if start is not None:
        arguments["x0"] = start
    options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "expand": expand}
    *found, stats = timed("ipopt", problem, arguments, options, repetitions)
    return *found, stats["return_status"]


def main():
    kinds, counts = asked(sys.argv[1:])
    print("kind  count form      iterations         objective  solve, ms  setup, ms  (CPU)")
    for kind in kinds:
        for count in counts:
            for expand in (True, False):
                iterations, objective, best, setup, status = solve(kind, count, expand)
                form = "expanded" if expand else "mapped"
                print(
                    f"{kind:5} {count:5} {form:9} {iterations:10} {objective:17.9f} {1e3 * best:9.2f} "
                    f"{1e3 * setup:9.2f}  {status}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
