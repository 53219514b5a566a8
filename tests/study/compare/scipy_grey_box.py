"""Grey box by hand: SciPy's least squares over candidates of a missing torque, forward selection, against `airloop refine`.

    .venv/bin/python tests/study/compare/scipy_grey_box.py
"""

import numpy as np
from scipy.optimize import least_squares

import pendulum as work

# What may be missing, as somebody who knows pendulums writes it down: torque by angle and velocity, for a factor of 1.
CANDIDATES = {
    "coulomb": lambda theta, omega: np.tanh(omega / 0.05),
    "quadratic drag": lambda theta, omega: np.abs(omega) * omega,
    "spring": lambda theta, omega: theta,
    "cubic spring": lambda theta, omega: theta**3,
    "offset": lambda theta, omega: np.ones_like(theta),
}
# Typical sizes, which the factors are divided by.
SIZES = {"coulomb": 1e-4, "quadratic drag": 1e-5, "spring": 1e-3, "cubic spring": 1e-3, "offset": 1e-4}
SUBSTEPS = 2


def simulate(plant, chosen, start, samples):
    """Angles of several parameter sets at once, `[samples, sets]`: Runge-Kutta of order 4."""
    inertia, damping, factors = plant[0], plant[1], plant[2:]

    def rate(theta, omega):
        torque = -work.M * work.G * work.L * np.sin(theta) - damping * omega
        for factor, name in zip(factors, chosen):
            torque = torque - factor * SIZES[name] * CANDIDATES[name](theta, omega)
        return omega, torque / inertia

    theta, omega = start
    h, found = work.STEP / SUBSTEPS, [theta]
    for _ in range(samples - 1):
        for _ in range(SUBSTEPS):
            a1, b1 = rate(theta, omega)
            a2, b2 = rate(theta + h / 2 * a1, omega + h / 2 * b1)
            a3, b3 = rate(theta + h / 2 * a2, omega + h / 2 * b2)
            a4, b4 = rate(theta + h * a3, omega + h * b3)
            theta, omega = theta + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), omega + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
        found.append(theta)
    return np.array(found)


class Fit:
    """Plant, factors of the chosen torques, offset of the encoder, and a start for every record."""

    def __init__(self, records, chosen, plant=None):
        self.records, self.chosen, self.plant = records, chosen, plant
        free = [3.4e-3, 1e-4] + [0.0] * len(chosen) + [0.0] if plant is None else []
        self.scale = np.array(([1e-3, 1e-4] + [1.0] * len(chosen) + [1e-2] if plant is None else []) + [1e-2, 1e-1] * len(records))
        start = np.array(free + [value for y in records for value in (y[0], (y[2] - y[0]) / (2 * work.STEP))])
        solved = least_squares(lambda p: self.residual(p[:, None])[:, 0], start / self.scale, self.jacobian, x_scale="jac", method="lm")
        self.solution, self.cost = solved.x * self.scale, 2 * solved.cost
        self.samples = sum(map(len, records))

    def residual(self, scaled):
        p = scaled * self.scale[:, None]
        count = 3 + len(self.chosen) if self.plant is None else 0
        plant = p[:count] if self.plant is None else np.repeat(self.plant[:, None], p.shape[1], 1)
        found = []
        for k, y in enumerate(self.records):
            start = p[count + 2 * k], p[count + 2 * k + 1]
            found.append((simulate(plant[:-1], self.chosen, start, len(y)) + plant[-1] - y[:, None]) / work.NOISE)
        return np.concatenate(found)

    def jacobian(self, scaled):
        step = 1e-5
        moved = np.repeat(scaled[:, None], len(scaled), 1) + step * np.eye(len(scaled))
        back = np.repeat(scaled[:, None], len(scaled), 1) - step * np.eye(len(scaled))
        return (self.residual(moved) - self.residual(back)) / (2 * step)


def main():
    estimation, validation = work.segments()

    def validated(fit, chosen):
        """Rms error on the validation records in mrad; their first states are fitted."""
        own = Fit(validation, chosen, fit.solution[: 3 + len(chosen)])
        return 1e3 * np.sqrt(own.cost / own.samples) * work.NOISE

    with work.Timer() as timer:
        chosen, fits = [], 1
        best = Fit(estimation, chosen)
        print(f"declared: rms on validation {validated(best, chosen):.2f} mrad")
        while len(chosen) < len(CANDIDATES):
            tried = {name: Fit(estimation, [*chosen, name]) for name in CANDIDATES if name not in chosen}
            fits += len(tried)
            for name, fit in tried.items():
                print(f"  {' + '.join([*chosen, name])}: chi2 per sample {fit.cost / fit.samples:.3f}")
            name = min(tried, key=lambda name: tried[name].cost)
            # Bayesian information criterion: one more factor has to be worth log(samples).
            if best.cost - tried[name].cost < np.log(best.samples):
                break
            best, chosen = tried[name], [*chosen, name]
    for name, factor in zip(chosen, best.solution[2:]):
        truth = f" (truth {work.TRUTH[name]:.3g})" if name in work.TRUTH else " (not there)"
        print(f"SciPy: {name}: {factor * SIZES[name]:.3g}{truth}")
    print(f"SciPy: rms on validation {validated(best, chosen):.2f} mrad, {fits} fits, {timer.seconds:.1f} s of processor time")
    work.print_refine()


if __name__ == "__main__":
    main()
