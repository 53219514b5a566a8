"""`airloop refine` on a cart under proportional control whose amplifier is limited, which one of two estimation records shows, and that
in its first moments. Simulations start from smoothed derivatives, as a record of a machine has them. The records are made by other
code than the FMUs."""

import json
import re

import numpy as np
import pytest

from command import start
from held import simulated
from test_study import amended_has_printed_errors, named

STEP, FINE, SAMPLES, NOISE = 0.01, 4, 301, 2e-5
MASS, DAMPING, LIMITS = 0.25, 1.3, (-1.25, 3.05)
STUDY = """name = "cart under proportional control"
system = "airloop:rigid-mass"
[parameters]
m = 0.25
b = 1.3
[inputs]
F = { column = "command", unit = "N", hold = true }
[outputs]
x = { column = "position", unit = "m" }
[states]
x = { column = "position", unit = "m" }
v = { derivative_of = "position", savitzky_golay_points = 9 }
[[free]]
parameter = "m"
[[free]]
parameter = "b"
min = 0.0
"""


def controlled(gain):
    """Commands [N] and positions [m] on the way to 0.2 m."""

    def rate(x, command):
        small = 0.003 * np.sin(60.0 * x[0])
        return np.array([x[1], (np.clip(command, *LIMITS) - DAMPING * x[1] - small) / MASS])

    x, commands, positions = np.zeros(2), [], []
    for _ in range(SAMPLES):
        positions.append(x[0])
        commands.append(gain * (0.2 - x[0]))
        x = simulated(rate, x, [commands[-1]] * 2, STEP, FINE)[1]
    return np.array(commands), np.array(positions)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder, rng, text = tmp_path_factory.mktemp("cart"), np.random.default_rng(5), STUDY
    for k, (gain, role) in enumerate([(5, "estimation"), (20, "estimation"), (10, "validation"), (2.5, "validation")]):
        commands, positions = controlled(gain)
        rows = np.column_stack([STEP * np.arange(SAMPLES), commands, positions + NOISE * rng.standard_normal(SAMPLES)])
        np.savetxt(folder / f"r{k}.csv", rows, delimiter=",", header="time,command,position", comments="", fmt="%.7f")
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\n'
    (folder / "study.toml").write_text(text)
    result = start("refine", folder / "study.toml", "-o", folder / "out")
    assert (folder / "out" / "report.json").exists(), result.stderr
    return folder, json.loads((folder / "out" / "report.json").read_text())


def test_the_limits_are_named_or_the_part_that_shows_them(found):
    _, report = found
    names = ("saturation@F", "limits@F")
    told = [note for note in report["notes"] if note.startswith("Only one part") and any(f"`{name}`" in note for name in names)]
    assert any("r1.csv" in note for note in told) or any(name in names for name in named(report)), report["notes"]


def test_notes_table_and_amended_system_are_of_one_fit(found):
    folder, report = found
    pattern = r"r\d\.csv .* \(validation\): position rms (\S+) before, (\S+) after\."
    rows = [[float(value) for value in own.groups()] for own in (re.fullmatch(pattern, note) for note in report["notes"]) if own]
    assert len(rows) == 2
    residual = report["residual"]["validation"]
    pooled = np.sqrt(np.mean(np.square(rows), axis=0))
    assert pooled == pytest.approx([residual["rms_before"]["position"], residual["rms_after"]["position"]], rel=2e-3)
    amended_has_printed_errors(folder / "study.toml", folder / "out", report)
