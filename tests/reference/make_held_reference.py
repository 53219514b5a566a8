"""Reference trajectories for communication steps longer than a sample: as make_reference.py, the command held longer.

    python tests/reference/make_held_reference.py      writes tests/data/reference_held_command.csv

A master that communicates every 2 or 5 ms holds the command that long, while the actuator goes on taking its samples
each 1 ms. Everything else is the problem of make_reference.py.
"""

from pathlib import Path

import numpy as np

import make_reference as reference

HOLDS = (2, 5)  # samples
DATA = Path(__file__).resolve().parents[1] / "data" / "reference_held_command.csv"
STORED_EVERY = 10  # samples between stored rows: 10 ms


def held_command(k, hold):
    """Force command [N] of sample k, new every `hold` samples."""
    return reference.command(np.asarray(k) // hold * hold)


def trajectory(hold, stop_time=reference.STOP_TIME):
    """States (n+1, 4) at the samples 0..n."""
    n = round(stop_time / reference.SAMPLE_TIME)
    forces = reference.actuator_forces(held_command(np.arange(n + 1), hold))
    states = np.zeros((n + 1, 4))
    for k in range(n):
        states[k + 1] = reference.one_sample_radau(states[k], forces[k, 1])
    return states


def main():
    columns, names = [], ["time"]
    for hold in HOLDS:
        states = trajectory(hold)[::STORED_EVERY]
        columns.append(states)
        names += [f"{name}_{hold}ms" for name in ("x", "theta", "v", "omega")]
    time = np.arange(len(columns[0])) * STORED_EVERY * reference.SAMPLE_TIME
    rows = np.column_stack([time, *columns])
    np.savetxt(DATA, rows, delimiter=",", header=",".join(names), comments="", fmt=["%.3f"] + ["%.13g"] * 8)
    print(f"{DATA.name}: {len(rows)} rows")


if __name__ == "__main__":
    main()
