"""Noise that `airloop refine` takes from the records of a study."""

import json

import numpy as np
import pytest

from command import start

MASS, DAMPING, STEP, COUNT = 1.3, 2.0, 0.004, 1500
NOISE = {"estimation": 2e-4, "validation": 5e-5}

STUDY = f"""name = "a quieter sensor in the validation record"
system = "airloop:rigid-mass"
[parameters]
m = {MASS}
b = {DAMPING}
[inputs]
F = {{ column = "force", unit = "N", hold = true }}
[outputs]
x = {{ column = "position", unit = "m" }}
"""


def motion(u):
    """Position of the mass under held forces, exactly."""
    x, v, found, decay = 0.0, 0.0, [], np.exp(-DAMPING / MASS * STEP)
    for force in u:
        found.append(x)
        end = force / DAMPING
        x += end * STEP + (v - end) * (1 - decay) * MASS / DAMPING
        v = end + (v - end) * decay
    return np.array(found)


def test_the_floor_of_validation_records_is_that_of_their_own_noise(tmp_path):
    text, t = STUDY, STEP * np.arange(COUNT)
    for k, role in enumerate(["estimation", "estimation", "validation"]):
        rng = np.random.default_rng(k)
        u = sum(rng.uniform(2, 4) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.35, 0.8, 1.6))
        x = motion(u) + NOISE[role] * rng.standard_normal(COUNT)
        np.savetxt(tmp_path / f"r{k}.csv", np.column_stack([t, u, x]), delimiter=",", header="time,force,position", comments="", fmt="%.8f")
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ x = 0.0, v = 0.0 }}\n'
    (tmp_path / "study.toml").write_text(text)
    result = start("refine", tmp_path, "-o", tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
    floor = json.loads((tmp_path / "out" / "report.json").read_text())["error_floor"]
    # The noise of 1500 samples, by differences of the third to seventh order and by 20 draws, is known to a few percent.
    for role, noise in NOISE.items():
        assert floor[role]["position"] == pytest.approx(noise, rel=0.1)
