"""Simulations of machines that the tests type themselves."""

import numpy as np


def simulated(rate, x, inputs, step, fine):
    """States at the samples `[n, ...]` under inputs that are held: `rate(x, u)`, classical Runge-Kutta with `fine` steps per `step` [s]."""
    found, h = [], step / fine
    for u in inputs:
        found.append(x)
        for _ in range(fine):
            a = rate(x, u)
            b = rate(x + h / 2 * a, u)
            c = rate(x + h / 2 * b, u)
            x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c, u))
    return np.array(found)
