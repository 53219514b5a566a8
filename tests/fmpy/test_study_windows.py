"""`airloop refine` of a machine behind an actuator whose state has no sensor, in windows: restarts put the measured states to where they are,
and the others go on. The records are made here, by other code."""

import json

import numpy as np
import pytest

from held import simulated
from test_study import amended_has_printed_errors, named, refine
from third_party_fmu import System, build

EQUATIONS = """der_force = (gain * u - force) / lag;
der_v = (force + f_x - drag * v) / mass;
der_x = v;
"""
GAIN, LAG, DRAG, MASS = 20.0, 0.15, 4.0, 2.0
MACHINE = System(
    "machine",
    0.01,
    1.0,
    1,
    states={"force": ("N", 0.0, ""), "v": ("m/s", 0.0, "x"), "x": ("m", 0.0, "")},
    inputs={"u": ("V", 0.0), "f_x": ("N", 0.0)},
    parameters={"gain": (GAIN, "N/V", 0.01), "lag": (LAG, "s", 0.01), "drag": (DRAG, "N.s/m", 0.01), "mass": (MASS, "kg", 0.01)},
    measured={},
    ports={},
    excite=None,
    start={"force": 0.0, "v": 0.0, "x": 0.0},
    short=False,
)
STEP, SAMPLES = 0.01, 2001
# Friction that grows with the square of the position [N/m2].
ALONG = 1.5
STUDY = """system = "machine.fmu"

[inputs]
u = { column = "u", hold = true }

[outputs]
x = { column = "x" }
v = { column = "v" }

[states]
x = { column = "x" }
v = { column = "v" }

[error]
windows_s = 1.0
"""


def motion(commands, coulomb, off, along=0.0):
    """States of the true machine; friction: a level `coulomb` [N] and one that grows with the square of the position, `along` [N/m2]."""
    gain, mass = GAIN * (1 + off[0]), MASS * (1 + off[1])

    def rate(state, u):
        force, v, x = state
        friction = (coulomb + along * x**2) * np.tanh(v / 0.05)
        return np.array([(gain * u - force) / LAG, (force - DRAG * v - friction) / mass, v])

    return simulated(rate, np.zeros(3), commands, STEP, 10)


def write(folder, coulomb, off=(0.0, 0.0), along=0.0, samples=SAMPLES):
    build(MACHINE, EQUATIONS, folder)
    text = STUDY
    for k, role in enumerate(["estimation", "estimation", "validation"]):
        draw = np.random.default_rng(40 + k)
        commands = np.repeat(draw.uniform(-1, 1, samples // 40 + 1), 40)[:samples]
        _, v, x = motion(commands, coulomb, off, along).T
        columns = [np.arange(samples) * STEP, commands, x + draw.normal(0, 2e-4, samples), v + draw.normal(0, 2e-3, samples)]
        np.savetxt(folder / f"r{k}.csv", np.column_stack(columns), fmt="%.7g", delimiter=",", header="time,u,x,v", comments="")
        text += f'\n[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\n'
    (folder / "study.toml").write_text(text)
    return folder


@pytest.mark.parametrize("coulomb, expected, code", [(0.0, [], 10), (1.5, ["coulomb@f_x"], 0)])
def test_a_state_without_a_sensor_goes_on_where_a_window_restarts(tmp_path, coulomb, expected, code):
    study = write(tmp_path / "study", coulomb)
    result = refine(study, tmp_path / "out")
    assert result.returncode == code, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(found) == expected
    if expected:
        value = next(e for e in found["effects"] if e["selected"])["params"]["force"]
        assert value["value"] == pytest.approx(coulomb, rel=0.03)
        amended_has_printed_errors(study, tmp_path / "out", found)


@pytest.mark.slow
def test_a_law_is_found_where_windows_are_too_long_for_it_to_be_nearly_linear(tmp_path):
    study = write(tmp_path / "study", 0.0, along=ALONG, samples=1001)
    result = refine(study, tmp_path / "out")
    assert result.returncode == 13, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    law = found["law"]
    assert law["port"] == "f_x" and law["formula"] == "a*x^2*tanh(v/sb)"
    assert law["params"]["a"]["value"] == pytest.approx(ALONG, rel=0.03)


def test_declared_values_that_are_off_are_no_gain_of_the_command(tmp_path):
    # Alone a gain leaves noise, too.
    study = write(tmp_path / "study", 0.0, off=(0.013, 0.002))
    result = refine(study, tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
    assert json.loads((tmp_path / "out" / "report.json").read_text())["corrections"]


@pytest.mark.parametrize(
    ("records", "columns", "factor", "cause"),
    [
        ([0], [2], -1, "r0.csv 0-20 s does not go with the other records: column `x` has the other sign"),
        ([2], [1], -1, "r2.csv 0-20 s does not go with the other records: column `u` has the other sign"),
        ([0, 1, 2], [2, 3], 1e3, "columns `v` and `x` are 1000 times too large"),
        ([0, 1, 2], [2], 1e3, "column `x` is 1000 times too large"),
    ],
)
def test_another_sign_or_unit_is_told_though_windows_start_from_what_is_measured(tmp_path, records, columns, factor, cause):
    study = write(tmp_path / "study", 1.5)
    for k in records:
        path = study / f"r{k}.csv"
        head = path.read_text().splitlines()[0]
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        rows[:, columns] *= factor
        np.savetxt(path, rows, fmt="%.7g", delimiter=",", header=head, comments="")
    result = refine(study, tmp_path / "out")
    assert result.returncode == 1 and cause in result.stderr, result.stdout + result.stderr
    assert not (tmp_path / "out").exists()
