"""`airloop refine` of a mass whose command comes late: the time constant of a lag and the limit of a rate are right although the command
moves between the samples, where records show nothing. The records are made here, by other code."""

import json

import numpy as np
import pytest

from test_study import named, refine

STEP, SAMPLES, MASS, NOISE, PARTS = 0.02, 1501, 2.0, 5e-4, 400
FINE = STEP / PARTS
STUDY = """system = "airloop:rigid-mass"

[parameters]
m = 2.0

[inputs]
F = { column = "u", hold = true }

[outputs]
x = { column = "x" }
"""


def lag(tau):
    return lambda late, u: u + (late - u) * np.exp(-FINE / tau)


def limited(rate):
    return lambda late, u: late + max(-rate * FINE, min(u - late, rate * FINE))


def position(follow, commands):
    """Position at the samples of a mass that the command drives behind `follow`, in steps so fine that it goes in lines."""
    late = [0.0]
    for u in np.repeat(commands, PARTS):
        late.append(follow(late[-1], u))
    begin, end = np.array(late[:-1]) / MASS, np.array(late[1:]) / MASS
    v = np.concatenate([[0.0], np.cumsum(FINE * (begin + end) / 2)])
    x = np.cumsum(FINE * v[:-1] + FINE**2 * (2 * begin + end) / 6)
    return np.concatenate([[0.0], x])[:-1:PARTS]


def write(folder, follow):
    folder.mkdir()
    text = STUDY
    for k, role in enumerate(["estimation", "estimation", "validation"]):
        draw = np.random.default_rng(70 + k)
        commands = np.repeat(draw.uniform(-1, 1, SAMPLES // 25 + 1), 25)[:SAMPLES]
        commands[:10] = 0.0
        x = position(follow, commands) + draw.normal(0, NOISE, SAMPLES)
        columns = np.column_stack([np.arange(SAMPLES) * STEP, commands, x])
        np.savetxt(folder / f"r{k}.csv", columns, fmt="%.9g", delimiter=",", header="time,u,x", comments="")
        text += f'\n[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ x = 0.0, v = 0.0 }}\n'
    (folder / "study.toml").write_text(text)
    return folder


@pytest.mark.parametrize("follow, kind, name, truth", [(lag(0.05), "lag@F", "tau", 0.05), (limited(6.0), "rate_limit@F", "rate", 6.0)])
def test_a_command_that_moves_between_samples_has_the_right_value(tmp_path, follow, kind, name, truth):
    study = write(tmp_path / "study", follow)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    # A lag of the command and one of the sensor are the same to a mass without friction, and are told as such.
    alike = {e["id"]: e for e in found["effects"] if e["selected"] or e["group"] is not None}
    assert len(named(found)) == 1 and found["complete"] and kind in alike, result.stdout
    own = alike[kind]["params"][name]
    low, high = own["ci95"]
    # Intervals of 95 %; twice as wide ones hold the truth in all but one of ten thousand.
    assert abs(own["value"] - truth) < high - low < 0.01 * truth
