"""Optima of the cart-pole without friction (Kelly, SIAM Review 59(4), 2017) by CasADi with IPOPT, equations and
collocation typed anew: the numbers in `orchestrator/ocp/tests/transcription/kelly.rs`.

    python tests/reference/kelly_cart_pole.py
"""

import casadi as ca
import numpy as np

GRAVITY = 9.81
DURATION = 2.0
INTERVALS = 50
# Masses of cart and pole, length, distance, largest force, half track: tutorial and demo of OptimTraj.
CASES = {"tutorial": (1, 0.3, 0.5, 1, 20, 2), "demo": (2, 0.5, 0.5, 0.8, 100, 1.6)}


def optimum(m1, m2, length, distance, force, track, simpson):
    h = DURATION / INTERVALS

    def f(y, u):
        s, c = ca.sin(y[1]), ca.cos(y[1])
        below = m1 + m2 * (1 - c * c)
        dv = (length * m2 * s * y[3] ** 2 + u + m2 * GRAVITY * c * s) / below
        dw = -(length * m2 * c * s * y[3] ** 2 + u * c + (m1 + m2) * GRAVITY * s) / (length * below)
        return ca.vertcat(y[2], y[3], dv, dw)

    problem = ca.Opti()
    y, u = problem.variable(4, INTERVALS + 1), problem.variable(1, INTERVALS + 1)
    um = problem.variable(1, INTERVALS) if simpson else None
    cost = 0
    for k in range(INTERVALS):
        a, b = f(y[:, k], u[k]), f(y[:, k + 1], u[k + 1])
        if simpson:
            middle = f((y[:, k] + y[:, k + 1]) / 2 + h / 8 * (a - b), um[k])
            problem.subject_to(y[:, k + 1] == y[:, k] + h / 6 * (a + 4 * middle + b))
            cost += h / 6 * (u[k] ** 2 + 4 * um[k] ** 2 + u[k + 1] ** 2)
        else:
            problem.subject_to(y[:, k + 1] == y[:, k] + h / 2 * (a + b))
            cost += h / 2 * (u[k] ** 2 + u[k + 1] ** 2)
    end = np.array([distance, np.pi, 0, 0])
    problem.subject_to(y[:, 0] == 0)
    problem.subject_to(y[:, INTERVALS] == end)
    problem.subject_to(problem.bounded(-track, y[0, :], track))
    for inputs in [u] + ([um] if simpson else []):
        problem.subject_to(problem.bounded(-force, inputs, force))
    problem.set_initial(y, np.outer(end, np.linspace(0, 1, INTERVALS + 1)))
    problem.minimize(cost)
    problem.solver("ipopt", {"print_time": 0}, {"print_level": 0, "tol": 1e-11})
    return problem.solve().value(cost)


for name, case in CASES.items():
    for simpson in (True, False):
        print(name, "Hermite-Simpson" if simpson else "trapezoidal", repr(optimum(*case, simpson)))
