"""Gain of the Kalman predictor by SciPy, for the test of the Riccati equation in orchestrator/ident/src/subspace/riccati.rs.

    python tests/reference/kalman_gain.py      prints the gain
"""

import numpy as np
from scipy.linalg import solve_discrete_are

A = np.array([[1.1, 0.3, 0], [-0.2, 0.7, 0.4], [0, 0.1, -0.5]])  # one pole outside the unit circle
C = np.array([[1, 0, 0.5], [0, 1, -1.0]])
Q = np.array([[0.5, 0.1, 0], [0.1, 0.4, 0.05], [0, 0.05, 0.3]])
S = np.array([[0.1, 0.02], [0.03, -0.05], [0, 0.04]])
R = np.array([[0.3, 0.05], [0.05, 0.2]])

P = solve_discrete_are(A.T, C.T, Q, R, s=S)
K = (A @ P @ C.T + S) @ np.linalg.inv(C @ P @ C.T + R)
np.set_printoptions(precision=15)
print(K)
