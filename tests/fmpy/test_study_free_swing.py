"""`airloop refine` on the kinds of records that machines give: free swings with a free inertia and dry friction, and a limit that one
record of two shows in its first moments. The records are made by other code than the FMUs."""

import json

import numpy as np

from command import start
from test_study import amended_has_printed_errors, named

STEP, FINE = 0.01, 4


def simulated(rate, x, inputs):
    """States `[n, 2]` under inputs that are held over each sample: classical Runge-Kutta, four steps per sample."""
    found, h = [], STEP / FINE
    for u in inputs:
        found.append(x)
        for _ in range(FINE):
            a = rate(x, u)
            b = rate(x + h / 2 * a, u)
            c = rate(x + h / 2 * b, u)
            x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c, u))
    return np.array(found)


def save(path, names, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.7f")


# Pendulum of a rig: square of its frequency [1/s2], dry friction and drag over its inertia.
FREQUENCY2, DRY, DRAG = 33.3, 0.053, 0.0044
SWING = """name = "free swings"
system = "airloop:pendulum"
[parameters]
I = 0.0024
m = 0.04
l = 0.2
b = 5e-5
[outputs]
theta = { column = "angle", unit = "rad", offset = "fit" }
[states]
theta = { column = "angle", unit = "rad" }
omega = { derivative_of = "angle", savitzky_golay_points = 9 }
[[free]]
parameter = "I"
start = 0.0024
[[free]]
parameter = "b"
start = 5e-5
min = 0.0
"""


def test_dry_friction_and_drag_are_found_in_free_swings_with_a_free_inertia(tmp_path):
    rng = np.random.default_rng(3)

    def rate(x, _):
        # The last one is small and of no list: nothing fits to the noise.
        small = 0.01 * np.sin(4.0 * x[0] + 1.0)
        return np.array([x[1], -FREQUENCY2 * np.sin(x[0]) - DRY * np.tanh(x[1] / 0.02) - DRAG * x[1] * abs(x[1]) + small])

    text = SWING
    for k, (angle, role) in enumerate([(0.9, "estimation"), (0.5, "estimation"), (0.7, "validation"), (0.35, "validation")]):
        x = simulated(rate, np.array([angle, 0.0]), np.zeros(2001))
        save(tmp_path / f"r{k}.csv", "time,angle", STEP * np.arange(2001), x[:, 0] + 2e-4 * rng.standard_normal(2001))
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = "fit"\n'
    (tmp_path / "study.toml").write_text(text)
    out = tmp_path / "out"
    result = start("refine", tmp_path / "study.toml", "-o", out)
    report = json.loads((out / "report.json").read_text())
    effects = [effect for effect in report["effects"] if effect["selected"]]
    assert {"coulomb", "quaddrag"} <= {effect["id"].split("@")[0] for effect in effects}, result.stdout
    inertia = 0.04 * 0.2 * 9.81 / FREQUENCY2
    own = {effect["id"].split("@")[0]: effect["params"] for effect in effects}
    assert abs(own["coulomb"]["force"]["value"] / (DRY * inertia) - 1) < 0.1
    assert abs(own["quaddrag"]["coef"]["value"] / (DRAG * inertia) - 1) < 0.1
    residual = report["residual"]["validation"]
    assert residual["rms_after"]["angle"] < 0.2 * residual["rms_before"]["angle"]


CART = """name = "cart under proportional control"
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


def test_a_limit_that_one_part_of_the_records_shows_is_told_of(tmp_path):
    rng, text = np.random.default_rng(5), CART

    def rate(x, command):
        small = 0.003 * np.sin(60.0 * x[0])
        return np.array([x[1], (np.clip(command, -1.25, 3.05) - 1.3 * x[1] - small) / 0.25])

    for k, (gain, role) in enumerate([(5, "estimation"), (20, "estimation"), (10, "validation"), (2.5, "validation")]):
        x, positions, commands = np.zeros(2), [], []
        for _ in range(301):
            command = gain * (0.2 - x[0])
            positions.append(x[0])
            commands.append(command)
            x = simulated(rate, x, [command, command])[1]
        names, noise = "time,command,position", 2e-5 * rng.standard_normal(301)
        save(tmp_path / f"r{k}.csv", names, STEP * np.arange(301), commands, np.array(positions) + noise)
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\n'
    (tmp_path / "study.toml").write_text(text)
    out = tmp_path / "out"
    start("refine", tmp_path / "study.toml", "-o", out)
    report = json.loads((out / "report.json").read_text())
    limits = ("saturation@F", "limits@F")
    told = [note for note in report["notes"] if note.startswith("Only one part") and any(f"`{name}`" in note for name in limits)]
    assert told or any(name in limits for name in named(report)), report["notes"]
    if told:
        assert "r1.csv" in told[0]
    amended_has_printed_errors(tmp_path / "study.toml", out, report)
