"""Records of a pendulum with dry friction and air drag that its declared model lacks; SciPy, equations typed here.

    I theta'' + b theta' + torque tanh(theta'/0.05) + coef |theta'| theta' + m g l sin(theta) = 0

python make_records.py writes swing.csv and tail.csv; seed 3, encoder step 0.0005 rad, noise 0.2 mrad.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

M, L, G, I, B = 0.15, 0.15, 9.81, 0.0036, 1.0e-4
TORQUE, DRAG = 4.0e-4, 3.0e-5


def rate(_, y):
    theta, omega = y
    friction = B * omega + TORQUE * np.tanh(omega / 0.05) + DRAG * abs(omega) * omega
    return [omega, (-friction - M * G * L * np.sin(theta)) / I]


def record(name, theta, stop, draw):
    t = np.arange(round(stop / 0.01) + 1) * 0.01
    y = solve_ivp(rate, (0, stop), [theta, 0.0], t_eval=t, rtol=1e-9, atol=1e-11, max_step=0.01).y[0]
    measured = np.round((y + 0.003 + 2e-4 * draw.standard_normal(len(t))) / 5e-4) * 5e-4
    rows = "".join(f"{time:.2f},{angle:.4f}\n" for time, angle in zip(t, measured))
    (Path(__file__).parent / name).write_text("time,angle\n" + rows)


if __name__ == "__main__":
    draw = np.random.default_rng(3)
    record("swing.csv", 1.5, 24.0, draw)
    record("tail.csv", 0.3, 8.0, draw)
