"""Van der Pol's oscillator by Hermite-Simpson (midpoint state eliminated), solved by CasADi with IPOPT.

    .venv/bin/python tests/reference/van_der_pol_ipopt.py

Prints the objective of examples/03_swing_up/third_party/problem.toml, which orchestrator/cli/tests/optimize_command.rs and
tests/fmpy/test_optimize.py expect.
"""

import casadi as ca

N, T = 50, 10.0
h = T / N


def f(x, u):
    return ca.vertcat((1 - x[1] ** 2) * x[0] - x[1] + u, x[0])


def running(x, u):
    return x[0] ** 2 + x[1] ** 2 + u**2


X, U, M = ca.MX.sym("X", 2, N + 1), ca.MX.sym("U", 1, N + 1), ca.MX.sym("M", 1, N)
cost, defects = 0, []
for k in range(N):
    xa, xb, ua, ub, um = X[:, k], X[:, k + 1], U[:, k], U[:, k + 1], M[:, k]
    fa, fb = f(xa, ua), f(xb, ub)
    xm = (xa + xb) / 2 + h / 8 * (fa - fb)
    defects.append(xb - xa - h / 6 * (fa + 4 * f(xm, um) + fb))
    cost += h / 6 * (running(xa, ua) + 4 * running(xm, um) + running(xb, ub))
z = ca.vertcat(ca.vec(X), ca.vec(U), ca.vec(M))
low, high = ca.vertcat(ca.repmat(ca.DM([-0.25, -ca.inf]), N + 1), ca.repmat(-1, 2 * N + 1)), None
high = ca.vertcat(ca.repmat(ca.inf, 2 * (N + 1)), ca.repmat(1, 2 * N + 1))
low, high = ca.DM(low), ca.DM(high)
low[0:2] = high[0:2] = ca.DM([0, 1])
solver = ca.nlpsol("s", "ipopt", {"x": z, "f": cost, "g": ca.vertcat(*defects)}, {"ipopt.tol": 1e-10})
guess = ca.DM.zeros(z.shape)
for k in range(N + 1):
    guess[2 * k + 1] = 1.0
found = solver(x0=guess, lbx=low, ubx=high, lbg=0, ubg=0)
print(f"objective {float(found['f']):.12f}")
