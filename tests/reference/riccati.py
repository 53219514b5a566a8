"""Discrete Riccati equations solved by SciPy: the numbers in orchestrator/ocp/src/control/tests.rs.

    python tests/reference/riccati.py
"""

import numpy as np
from scipy.linalg import solve_discrete_are

a = np.array([[1.1, 0.3, 0.0], [-0.2, 0.9, 0.4], [0.0, 0.1, 1.05]])
b = np.array([[0.0, 0.1], [0.2, 0.0], [0.05, 1.0]])
q = np.array([[2.0, 0.1, 0.0], [0.1, 1.0, 0.2], [0.0, 0.2, 0.5]])
r = np.array([[0.5, 0.1], [0.1, 0.8]])

p = solve_discrete_are(a, b, q, r)
print("steady", p.tolist())
print("gain", np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a).tolist())

# Five samples before a cost of I, in the textbook's form with the inverse.
p = np.eye(3)
for _ in range(5):
    k = np.linalg.inv(r + b.T @ p @ b) @ b.T @ p @ a
    p = q + a.T @ p @ a - a.T @ p @ b @ k
print("five", p.tolist())

# Kalman filter of the transposed system: steady gain of the measurement update.
c = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]])
p = solve_discrete_are(a.T, c.T, q, r)
print("correction", (p @ c.T @ np.linalg.inv(c @ p @ c.T + r)).tolist())
