"""Swing-up of the pneumatic cart-pole by CasADi with fatrop, whose linear algebra goes along the stages of optimal control:
objective, iterations and time of the solve alone.

    python tests/reference/swing_up_fatrop.py [hs|trap|ms|sc ...] [INTERVALS ...]      default: all, 100 200 400

The program is that of `swing_up_ipopt.py`, in the form that fatrop asks for: next states as explicit functions of a stage. Where
a defect holds the next node, a copy of that node is a control of the stage and the defect one of its constraints; commands
of nodes are states then. Bounds that leave no room (initial and final states) are constraints, too.
"""

import sys

import casadi as ca
import numpy as np
from swing_up_ipopt import PUMP, STROKE, T, U_MAX, asked, interval, timed

FREE = np.inf


class Stages:
    """Variables, constraints and their bounds, stage after stage."""

    def __init__(self):
        self.x, self.low, self.high, self.guess = [], [], [], []
        self.g, self.least, self.most, self.cost = [], [], [], 0
        self.sizes = {"nx": [], "nu": [], "ng": []}

    def variable(self, name, bound, guess):
        """A vector of variables between minus and plus `bound`."""
        self.x.append(ca.MX.sym(name, len(bound)))
        self.low.extend(-np.array(bound))
        self.high.extend(bound)
        self.guess.extend(guess)
        return self.x[-1]

    def zero(self, expression):
        self.g.append(expression)
        self.least.extend([0.0] * expression.numel())
        self.most.extend([0.0] * expression.numel())


def transcribe(kind, count):
    """The nonlinear program stage by stage."""
    h, held, s = T / count, kind in ("ms", "sc"), Stages()
    defect = interval(kind, h)
    theta = np.interp(np.linspace(0, 1, count + 1), *PUMP)
    node = [STROKE, *[FREE] * 5]
    at_node = lambda k: [0, theta[k], 0, 0, 0, 0]  # noqa: E731
    # A command of a node is a state, one that is held is a control.
    state = node if held else [*node, U_MAX]
    nx = len(state)
    stages = []
    for k in range(count + 1):
        x = s.variable("x", state, [*at_node(k), *[0] * (nx - 6)])
        if k == count:
            stages.append((x, None))
            break
        controls = []
        if held:
            controls.append(s.variable("u", [U_MAX], [0]))
        if kind == "hs":
            controls.append(s.variable("um", [U_MAX], [0]))
        if kind != "ms":
            controls.append(s.variable("n", [FREE] * nx, [*at_node(k + 1), *[0] * (nx - 6)]))
        stages.append((x, controls))
    for k, (x, controls) in enumerate(stages):
        y, dynamics = x[:6], 0
        before = len(s.least)
        if controls is not None:
            u = controls[0] if held else x[6]
            um = controls[0] if kind == "hs" else 0
            next_state, copy = stages[k + 1][0], controls[-1]
            if kind == "ms":
                s.zero(defect(y, u, um, next_state, 0))
            else:
                s.zero(next_state - copy)
                s.zero(defect(y, u, um, copy[:6], 0 if held else copy[6]))
            dynamics = nx
            if held:
                s.cost += h * u**2
            elif kind == "trap":
                s.cost += h / 2 * (u**2 + copy[6] ** 2)
            else:
                s.cost += h / 6 * (u**2 + 4 * um**2 + copy[6] ** 2)
        if k == 0:
            s.zero(y)
        if k == count:
            s.zero(y[:4] - ca.DM([0, np.pi, 0, 0]))
        s.sizes["nx"].append(nx)
        s.sizes["nu"].append(0 if controls is None else sum(own.numel() for own in controls))
        s.sizes["ng"].append(len(s.least) - before - dynamics)
    problem = {"x": ca.vertcat(*s.x), "f": s.cost, "g": ca.vertcat(*s.g)}
    bounds = {"x0": s.guess, "lbx": s.low, "ubx": s.high, "lbg": s.least, "ubg": s.most}
    return problem, bounds, s.sizes


def solve(kind, count, expand=True, repetitions=1):
    """Iterations, objective, CPU time [s] of the fastest solve and of the set-up, and whether it succeeded."""
    problem, arguments, sizes = transcribe(kind, count)
    structure = {"structure_detection": "manual", "N": count, **sizes, "equality": [True] * len(arguments["lbg"])}
    options = {"fatrop.print_level": 0, "expand": expand, **structure}
    *found, stats = timed("fatrop", problem, arguments, options, repetitions)
    return *found, stats["success"]


def main():
    kinds, counts = asked(sys.argv[1:])
    print("kind  count  iterations         objective  solve, ms  setup, ms  (CPU)")
    for kind in kinds:
        for count in counts:
            iterations, objective, best, setup, success = solve(kind, count, repetitions=3)
            end = "" if success else "  not solved"
            print(f"{kind:5} {count:5} {iterations:11} {objective:17.9f} {1e3 * best:10.2f} {1e3 * setup:10.2f}{end}", flush=True)


if __name__ == "__main__":
    main()
