"""`airloop refine` on records whose sensor loses samples: spikes of twenty times the noise, and cells that say NaN. A mass with
viscous friction under held commands, whose motion is known in closed form."""

import numpy as np
import pytest

from segments import write_mass_study
from test_study import named, report

STEP, COUNT, NOISE, DAMPING = 0.01, 1500, 1e-4, 1.5


def command(rng):
    return np.round(np.repeat(rng.uniform(-6, 6, -(-COUNT // 40)), 40)[:COUNT], 3)


def moved(u, dry=0.0):
    """Positions; dry friction by exact steps between which it keeps its sign and value."""
    fine = 50
    h = STEP / fine
    decay = np.exp(-DAMPING * h)
    x, v, shown = 0.0, 0.0, []
    for force in u:
        shown.append(x)
        for _ in range(fine):
            end = (force - dry * np.tanh(v / 0.05)) / DAMPING
            x, v = x + end * h + (v - end) * (1 - decay) / DAMPING, end + (v - end) * decay
    return np.array(shown)


def write_study(folder, seed, dry, spoil):
    rng, records = np.random.default_rng(seed), []
    for _ in range(3):
        u = command(rng)
        x = moved(u, dry) + NOISE * rng.standard_normal(COUNT)
        spoil(x, rng.choice(np.arange(5, COUNT - 5, 7), 8, replace=False), rng)
        records.append(np.column_stack([STEP * np.arange(COUNT), u, x]))
    return write_mass_study(folder, records, DAMPING)


def spikes(x, places, rng):
    x[places] += 20 * NOISE * rng.choice([-1.0, 1.0], len(places))


def lost(x, places, _):
    x[places] = np.nan


@pytest.mark.parametrize("spoil, note", [pytest.param(spikes, "leaves its neighbors for one sample", marks=pytest.mark.slow), (lost, "empty cells or NaN in x")], ids=["spikes", "nan"])
def test_spoiled_samples_are_no_effect_and_hide_none(tmp_path, spoil, note):
    found = report(write_study(tmp_path / "control", 4, 0.0, spoil), tmp_path / "out_control")
    assert found["verdict"] == "none", found["notes"]
    assert {k for k in range(3) for own in found["notes"] if f"r{k}.csv" in own and note in own} == {0, 1, 2}, found["notes"]
    found = report(write_study(tmp_path / "dry", 5, 0.8, spoil), tmp_path / "out_dry")
    assert named(found)[0].startswith("coulomb@"), found["notes"]
    force = next(e for e in found["effects"] if e["selected"])["params"]["force"]
    assert abs(force["value"] - 0.8) < 0.008, force
