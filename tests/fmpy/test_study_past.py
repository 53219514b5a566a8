"""Segments in the middle of a file: a delay of the command begins with what the file shows before them."""

import json

import numpy as np
import pytest

from command import start

STEP, DELAY, MASS, DAMPING, NOISE = 0.01, 0.137, 1.3, 0.8, 1e-4
SEGMENTS = [(3.07, 7.0), (9.11, 13.0), (15.23, 19.0), (21.09, 25.0), (27.31, 31.0)]


def record(path):
    """A mass behind a force that arrives late, exactly from step to step: in one step the late force changes once."""
    rng = np.random.default_rng(3)
    command = np.repeat(rng.uniform(-3, 3, 400), 8)[: int(32.0 / STEP)]
    whole, part = int(DELAY // STEP), DELAY / STEP - DELAY // STEP
    late = lambda k: command[max(k, 0)]
    state, rows = np.zeros(2), []

    def move(state, force, time):
        x, v = state
        rest, decay = force / DAMPING, np.exp(-DAMPING / MASS * time)
        return np.array([x + rest * time + (v - rest) * MASS / DAMPING * (1 - decay), rest + (v - rest) * decay])

    for k, u in enumerate(command):
        rows.append([k * STEP, u, state[0], state[1]])
        state = move(state, late(k - whole - 1), part * STEP)
        state = move(state, late(k - whole), (1 - part) * STEP)
    rows = np.array(rows)
    rows[:, 2] += NOISE * rng.standard_normal(len(rows))
    np.savetxt(path, rows, delimiter=",", header="time [s],u [N],x [m],v [m/s]", comments="", fmt="%.9g")


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("past")
    record(folder / "long.csv")
    text = f'system = "airloop:rigid-mass"\n[parameters]\nm = {MASS}\nb = {DAMPING}\n[inputs]\nF = {{ column = "u", hold = true }}\n'
    text += '[outputs]\nx = { column = "x" }\n[states]\nx = { column = "x" }\nv = { column = "v" }\n'
    for k, (begin, end) in enumerate(SEGMENTS):
        role = "validation" if k == 3 else "estimation"
        text += f'[[segment]]\nfile = "long.csv"\nrole = "{role}"\nfrom_s = {begin}\nto_s = {end}\n'
    (folder / "study.toml").write_text(text)
    result = start("refine", folder / "study.toml", "-o", folder / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    return folder, json.loads((folder / "out" / "report.json").read_text())


def test_a_delay_takes_what_came_before_the_segment(refined):
    _, report = refined
    [effect] = [effect for effect in report["effects"] if effect["selected"]]
    assert effect["kind"] == "delay", effect["id"]
    assert effect["params"]["delay"]["value"] == pytest.approx(DELAY, abs=0.001)
    # From the first value of a segment on, the force would be wrong by some newtons in its first 0.14 s: millimeters.
    assert report["residual"]["validation"]["rms_after"]["x"] < 3 * NOISE
    assert any("before" in note for note in report["notes"])


def test_the_amended_system_does_so_too(refined):
    folder, report = refined
    result = start("run", folder / "out" / "system" / "system.ssd", "--study", folder / "study.toml", "-o", folder / "run")
    assert result.returncode == 0, result.stderr
    summary = json.loads((folder / "run" / "summary.json").read_text())
    for role in ("estimation", "validation"):
        # The search puts a mean between two values of a late command, the FMU changes within the step.
        assert summary[role]["rms"] == pytest.approx(report["residual"][role]["rms_after"], rel=2e-2)
