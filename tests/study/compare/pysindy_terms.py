"""The missing torque of the pendulum by PySINDy, from the measured angle, against `airloop refine`.

    .venv/bin/python -m pip install pysindy==2.0.0 scikit-learn==1.6.1
    .venv/bin/python tests/study/compare/pysindy_terms.py

Twice: as SINDy is meant, the whole acceleration over a library of terms; and helped, the acceleration that the known equations leave
over the terms that may be missing, each divided by its size. Derivatives are those of a local polynomial of 9 and of 25 samples.
"""

import warnings

import numpy as np
import pysindy
from scipy.signal import savgol_filter

import pendulum as work

INERTIA, DAMPING = 3.6e-3, 1e-4
TERMS = {
    "sin(theta)": lambda x, v: np.sin(x),
    "viscous": lambda x, v: v,
    "coulomb": lambda x, v: np.tanh(v / 0.05),
    "quadratic drag": lambda x, v: np.abs(v) * v,
    "spring": lambda x, v: x,
    "cubic spring": lambda x, v: x**3,
    "offset": lambda x, v: np.ones_like(x),
}
TRUTH = {"sin(theta)": work.M * work.G * work.L, "viscous": DAMPING, **work.TRUTH}
THRESHOLDS = np.logspace(-4, 0, 17)


def motion(records, points):
    """Angle, velocity and acceleration of all records, one after the other; 2 s at the ends of each are left out."""
    found = []
    for y in records:
        smooth = [savgol_filter(y, points, 4, order, delta=work.STEP)[200:-200] for order in range(3)]
        found.append(np.array(smooth))
    return np.concatenate(found, axis=1)


def sparse(features, target, threshold):
    optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-8)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer.fit(features, target[:, None])
    return optimizer.coef_.ravel()


def best(names, estimation, validation):
    """Torques by name, for the threshold with the least error on the validation records; the largest such threshold."""
    columns = [np.array([TERMS[name](x, v) for name in names]).T for x, v, _ in (estimation, validation)]
    size = np.sqrt(np.mean(columns[0] ** 2, axis=0))
    tried = []
    for threshold in THRESHOLDS:
        scale = np.std(estimation[2])
        factors = sparse(columns[0] / size, estimation[2] / scale, threshold) * scale / size
        tried.append((np.sqrt(np.mean((columns[1] @ factors - validation[2]) ** 2)), factors))
    least = min(error for error, _ in tried)
    error, factors = [one for one in tried if one[0] <= 1.01 * least][-1]
    return {name: -INERTIA * factor for name, factor in zip(names, factors) if factor != 0}, error


def main():
    known = [name for name in TERMS if name in ("sin(theta)", "viscous")]
    for points in (9, 25):
        with work.Timer() as timer:
            data = [motion(records, points) for records in work.segments()]
            whole, error = best(list(TERMS), *data)
            # Sum of the declared torques, with the true inertia and damping as a gift.
            rest = [np.array([x, v, a + sum(TRUTH[name] * TERMS[name](x, v) for name in known) / INERTIA]) for x, v, a in data]
            helped, _ = best([name for name in TERMS if name not in known], *rest)
        for title, torques in (("whole", whole), ("helped", helped)):
            words = ", ".join(f"{name} {torque:.2e}" for name, torque in torques.items())
            print(f"PySINDy, {points} points, {title}: {words or 'nothing'}")
        print(f"  rms acceleration left {error:.3f} rad/s2, {timer.seconds:.1f} s of processor time")
    print("truth: " + ", ".join(f"{name} {torque:.2e}" for name, torque in TRUTH.items()))
    work.print_refine()


if __name__ == "__main__":
    main()
