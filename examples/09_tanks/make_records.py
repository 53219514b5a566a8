"""Makes the records of this example: the tanks of tanks.c, whose upper tank runs over a weir that tanks.c does not know.

The weir is one of rectangular shape, whose flow grows as the level above its edge to the power of 1.5.
"""

import pathlib

import numpy as np

STEP, SAMPLES, SUBSTEPS = 1.0, 900, 20
SECTION, OUTLET, PUMP, GRAVITY = np.array([0.012, 0.010]), np.array([5e-5, 5.5e-5]), 2.4e-5, 9.81
EDGE, WEIR = 0.32, 6e-3  # m; m^1.5/s
NOISE, QUANTUM = 4e-4, 1e-4  # m


def rates(level, voltage):
    through = OUTLET * np.sqrt(2 * GRAVITY * np.maximum(level, 0.0))
    over = WEIR * max(level[0] - EDGE, 0.0) ** 1.5
    return np.array([PUMP * voltage - through[0] - over, through[0] - through[1]]) / SECTION


def simulate(voltage, level):
    h, shown = STEP / SUBSTEPS, []
    for u in voltage:
        shown.append(level)
        for _ in range(SUBSTEPS):
            middle = level + h / 2 * rates(level, u)
            level = level + h * rates(middle, u)
    return np.array(shown)


def main(folder):
    t = STEP * np.arange(SAMPLES)
    for number in range(1, 6):
        rng = np.random.default_rng(number)
        lengths = rng.integers(30, 120, 40)
        voltage = np.round(np.repeat(rng.uniform(1.0, 8.0, 40), lengths)[:SAMPLES], 3)
        levels = simulate(voltage, rng.uniform(0.1, 0.25, 2)) + NOISE * rng.standard_normal((SAMPLES, 2))
        columns = np.column_stack([t, voltage, QUANTUM * np.round(levels / QUANTUM)])
        header = "time [s],u [V],h_1 [m],h_2 [m]"
        np.savetxt(folder / f"run_{number}.csv", columns, delimiter=",", header=header, comments="", fmt=["%.0f", "%.3f", "%.4f", "%.4f"])


if __name__ == "__main__":
    main(pathlib.Path(__file__).parent)
