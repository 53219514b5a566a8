"""Reference fit of eq. 2 for orchestrator/ident/src/friction/tests.rs: scipy.optimize.curve_fit on data typed here again.

    python tests/reference/make_friction_reference.py

prints the parameters and their standard deviations.
"""

import numpy as np
from scipy.optimize import curve_fit


def friction(v, c1, c2, c3, c4, c5):
    return c1 * np.tanh(c2 * (v - c3)) + c4 * v + c5  # eq. 2


k = np.arange(600)
v = 0.12 * np.sin(0.05 * k) + 0.05 * np.sin(0.013 * k)
force = friction(v, 5.7910, 63.7045, 0.0064, 3.0, -2.3170) + 0.3 * np.sin(0.7 * k * k)
found, covariance = curve_fit(friction, v, force, p0=[4, 40, 0, 1, 0], xtol=1e-15, ftol=1e-15, gtol=1e-15)
print("parameters", [f"{value:.10g}" for value in found])
print("deviations", [f"{value:.8g}" for value in np.sqrt(np.diag(covariance))])
