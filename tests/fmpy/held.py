"""Simulations of machines that the tests type themselves."""

import numpy as np


def advanced(rate, x, u, step, fine):
    """State a `step` [s] later under an input that is held: `rate(x, u)`, classical Runge-Kutta with `fine` steps."""
    h = step / fine
    for _ in range(fine):
        a = rate(x, u)
        b = rate(x + h / 2 * a, u)
        c = rate(x + h / 2 * b, u)
        x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c, u))
    return x


def simulated(rate, x, inputs, step, fine):
    """States at the samples `[n, ...]` under inputs that are held, as [advanced]."""
    found = []
    for u in inputs:
        found.append(x)
        x = advanced(rate, x, u, step, fine)
    return np.array(found)
