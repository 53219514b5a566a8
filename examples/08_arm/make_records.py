"""Makes the records of this example: the arm of arm.c with dry friction in both joints, which arm.c does not know.

The equations are typed here in another way (Lagrange, solved as a linear system) and integrated with steps of 0.25 ms.
"""

import pathlib

import numpy as np

STEP, SAMPLES, SUBSTEPS = 0.005, 1200, 20
LENGTH, CENTER, MASS, INERTIA, VISCOUS = 0.35, 0.16, 0.9, (0.12, 0.011), np.array([0.25, 0.08])
COULOMB, SIGN_CHANGE = np.array([0.30, 0.10]), 0.02  # N.m; rad/s
ENCODER, NOISE = 2 * np.pi / 16384, 2e-4  # rad


def acceleration(q, w, torque):
    c, s = np.cos(q[1]), np.sin(q[1])
    own = INERTIA[1] + MASS * CENTER**2
    cross = own + MASS * LENGTH * CENTER * c
    inertia = np.array([[INERTIA[0] + MASS * LENGTH**2 + own + 2 * MASS * LENGTH * CENTER * c, cross], [cross, own]])
    centrifugal = MASS * LENGTH * CENTER * s * np.array([-(2 * w[0] + w[1]) * w[1], w[0] ** 2])
    friction = VISCOUS * w + COULOMB * np.tanh(w / SIGN_CHANGE)
    return np.linalg.solve(inertia, torque - friction - centrifugal)


def simulate(torque):
    q, w, h, shown = np.zeros(2), np.zeros(2), STEP / SUBSTEPS, []
    rate = lambda y, u: np.concatenate([y[2:], acceleration(y[:2], y[2:], u)])
    y = np.concatenate([q, w])
    for u in torque:
        shown.append(y[:2].copy())
        for _ in range(SUBSTEPS):
            k1 = rate(y, u)
            k2 = rate(y + h / 2 * k1, u)
            k3 = rate(y + h / 2 * k2, u)
            k4 = rate(y + h * k3, u)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(shown)


def command(rng, t):
    """Sines of six frequencies, and steps, for each joint; starts at 0."""
    found = []
    for most in (2.0, 0.7):
        sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for f in rng.uniform(0.2, 2.0, 6))
        steps = np.repeat(rng.uniform(-1, 1, 9), len(t) // 8)[: len(t)]
        found.append(most * np.minimum(t / 0.3, 1.0) * (0.5 * sines / np.abs(sines).max() + 0.5 * steps))
    return np.column_stack(found)


def main(folder):
    t = STEP * np.arange(SAMPLES)
    for number in range(1, 6):
        rng = np.random.default_rng(number)
        # As the file has it.
        torque = np.round(command(rng, t), 3)
        angles = simulate(torque) + NOISE * rng.standard_normal((SAMPLES, 2))
        columns = np.column_stack([t, torque, ENCODER * np.round(angles / ENCODER)])
        header = "time [s],tau_1 [N.m],tau_2 [N.m],q_1 [rad],q_2 [rad]"
        formats = ["%.3f", "%.3f", "%.3f", "%.6f", "%.6f"]
        np.savetxt(folder / f"run_{number}.csv", columns, delimiter=",", header=header, comments="", fmt=formats)


if __name__ == "__main__":
    main(pathlib.Path(__file__).parent)
