"""Numbers quoted in the tests of ident::diagnostics, from SciPy and from formulas typed independently."""

import numpy as np
from scipy import signal, stats

print("chi2.sf", [float(stats.chi2.sf(x, k)) for x, k in [(3.841458820694124, 1), (44.31410489621915, 25), (20, 25), (150, 100)]])
print("norm.isf", float(stats.norm.isf(0.005)))

k = np.arange(400)
e = np.sin(0.7 * k * k) + 0.3 * np.cos(1.1 * k)
e -= e.mean()
r = np.array([e[lag:] @ e[: len(e) - lag] for lag in range(11)]) / (e @ e)
q = len(e) * (len(e) + 2) * sum(r[lag] ** 2 / (len(e) - lag) for lag in range(1, 11))
print("autocorrelation", [float(value) for value in r[:4]])
print("Ljung-Box", float(q), "p", float(stats.chi2.sf(q, 10)))

# eq. 8 as x(k+1) = A x + (B1 + A B0) u, y = x + B0 u
a = -np.array([[-1.0144, 0.0216], [-0.0527, -0.9537]])
b0, b1 = np.array([[0.6619], [0.0764]]), np.array([[-0.6557], [-0.0847]])
for row in range(2):
    system = signal.dlti(a, b1 + a @ b0, np.eye(2)[[row]], b0[[row]], dt=1e-3)
    _, g = system.freqresp(2 * np.pi * np.array([1.0, 30.0]) * 1e-3)
    print("frequency response of y", row + 1, [complex(value) for value in g])
