"""Slips of a study that an effect would explain well: a column of another unit, records that begin elsewhere, a sign that a
command and a sensor share; and effects that what is left does not tell apart."""

import json

import numpy as np
import pytest

from command import start

STEP, COUNT, GAIN, TAU, NOISE = 0.005, 2000, 0.8, 0.1, 0.008

SIGNALS = (
    '[inputs]\nF = { column = "command", hold = true, unit = "N" }\n'
    '[outputs]\nv = { column = "pressure", unit = "UNIT" }\n'
)


def record(path, seed, up=TAU, down=TAU, delay=0, still=False, first=None, leak=0.0):
    """Pressure behind a lag, which may fill and empty at rates of its own, after a delay [samples]; `leak`: amplitude of
    a loss that comes and goes, which follows no law."""
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(1, 8, COUNT // 50), 50)
    if still:
        command[:] = command[0]
    # What comes at parts of samples acts for its part of the step.
    whole, part = int(delay), delay % 1
    late = [np.concatenate([np.full(own, command[0]), command])[:COUNT] for own in (whole, whole + 1)]
    late = (1 - part) * late[0] + part * late[1]
    pressure = np.empty(COUNT)
    pressure[0] = GAIN * command[0] if first is None else first
    for k in range(COUNT - 1):
        wanted = GAIN * late[k]
        wanted -= leak * np.sin(0.011 * k + seed) * np.sin(0.0037 * k)
        tau = up if wanted > pressure[k] else down
        pressure[k + 1] = wanted + (pressure[k] - wanted) * np.exp(-STEP / tau)
    rows = np.column_stack([STEP * np.arange(COUNT), command, pressure + NOISE * rng.standard_normal(COUNT)])
    np.savetxt(path, rows, delimiter=",", header="time,command,pressure", comments="", fmt="%.8g")


def study(folder, signals=SIGNALS, mass=TAU / GAIN, b=1 / GAIN, initial='initial = "fit"\n', count=5, **plant):
    """The lag by the mass of `airloop:rigid-mass`: m dv/dt = F - b v, with v for the pressure."""
    damping = "" if b is None else f"b = {b}\n"
    text = f'system = "airloop:rigid-mass"\n[parameters]\nm = {mass}\n{damping}' + signals.replace("UNIT", "m/s")
    for k in range(count):
        record(folder / f"r{k}.csv", 40 + k, **plant)
        role = "estimation" if k < count - 1 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\n{initial}'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def run(path):
    result = start("refine", path, "-o", path.parent / "out")
    report = path.parent / "out" / "report.json"
    return result, json.loads(report.read_text()) if report.exists() else None


def refused(path, *words):
    result, report = run(path)
    assert result.returncode == 1 and report is None, result.stdout + result.stderr
    for word in words:
        assert word in result.stderr, result.stderr


def test_a_mass_with_a_unit_is_that_mass(tmp_path):
    refused(study(tmp_path, mass='"125 mm"'), "line 3", "`m`", "kg", "125 mm")
    result, _ = run(study(tmp_path, mass=f'"{1e3 * TAU / GAIN} g"'))
    assert result.returncode == 10, result.stdout + result.stderr


def test_a_column_of_another_unit_is_no_gain(tmp_path):
    path = study(tmp_path, SIGNALS.replace("UNIT", "mm/s"))
    refused(path, "line", "`pressure`", "e-3 times", "another unit", "outputs.v")


def test_records_that_begin_where_nothing_says_lack_no_effect(tmp_path):
    refused(study(tmp_path, initial=""), "r0.csv", "begins with `pressure`", 'initial = "fit"', "[states]")
    # They begin where the FMU does.
    result, _ = run(study(tmp_path, initial="", first=0.0))
    assert result.returncode == 10, result.stdout + result.stderr


def test_a_sign_that_command_and_sensor_share_is_told_of_both(tmp_path):
    path = study(tmp_path, SIGNALS.replace('unit = "UNIT"', 'unit = "m/s", scale = -1'))
    refused(path, "`command`", " or `", "`pressure`", "inputs.F", "`scale = 1` at outputs.v")


def test_a_command_that_stands_still_is_told(tmp_path):
    path = study(tmp_path)
    for k in range(4):
        record(tmp_path / f"r{k}.csv", 60 + k, still=True, first=0.5)
    refused(path, "`command` does not move in the estimation records")


@pytest.mark.slow
def test_what_is_left_does_not_tell_a_delay_from_a_mode(tmp_path):
    """A lag of fixed time constant cannot fill and empty at rates of its own: what stands in the series leaves much."""
    few = SIGNALS + '[[attachment]]\ninput = "F"\neffects = ["fill", "delay", "mode", "lag"]\n'
    result, report = run(study(tmp_path, few, up=0.085, down=0.13, delay=10))
    chosen = {effect["id"]: effect["group"] for effect in report["effects"] if effect["selected"]}
    assert "fill@F" in chosen, result.stdout
    groups = set(chosen.values()) - {None}
    others = {own["id"] for own in report["effects"] if not own["selected"] and own["group"] in groups}
    late = {"delay@F", "mode@F", "sensor.delay"}
    assert not report["complete"] and result.returncode == 12, result.stdout
    assert late & set(chosen) and late & others, (chosen, others)
    # Beside another effect, `it` would not say which of the two is meant.
    told = [line.split(" from: ") for line in result.stdout.splitlines() if line.startswith("These records cannot tell")]
    assert len(told) == len(groups), result.stdout
    for (own, rivals), group in zip(told, sorted(groups), strict=True):
        assert [name for name in chosen if f"({name})" in own] == [name for name in chosen if chosen[name] == group], own
        assert any(f"({name})" in rivals for name in others), rivals


def test_a_late_command_and_a_late_sensor_of_a_linear_system_are_not_told_apart(tmp_path):
    """Beside what follows no law, that one of them does better by a little says nothing, however significant it is."""
    few = SIGNALS + '[[attachment]]\ninput = "F"\neffects = ["delay", "gain", "rate_limit"]\n'
    result, report = run(study(tmp_path, few, delay=7.4, leak=0.3))
    own = {effect["id"]: effect for effect in report["effects"]}
    (chosen,) = [name for name in own if own[name]["selected"]]
    assert chosen in ("delay@F", "sensor.delay") and result.returncode == 12, result.stdout
    (delay,) = own[chosen]["params"].values()
    assert abs(delay["value"] - 7.4 * STEP) < 0.05 * 7.4 * STEP
    (rival,) = {"delay@F", "sensor.delay"} - {chosen}
    assert own[rival]["group"] == own[chosen]["group"] is not None, result.stdout


def times(path, column, factor):
    """Multiplies a column of a record."""
    head = path.read_text().splitlines()[0]
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, head.split(",").index(column)] *= factor
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.8g")


@pytest.mark.parametrize(
    ("file", "column", "factor", "cause"),
    [
        ("r2.csv", "pressure", -1, "`pressure` has the other sign"),
        ("r4.csv", "command", -1, "`command` has the other sign"),
        ("r0.csv", "command", 1e-3, "`command` is 1000 times too small"),
        ("r3.csv", "pressure", 1e3, "times larger in r3.csv"),
        ("r1.csv", "pressure", 1 / 60, "times smaller in r1.csv"),
        ("r4.csv", "time", 1e3, "those of the other records 0.005 s"),
    ],
)
def test_one_record_in_another_unit_or_of_another_sign_is_told(tmp_path, file, column, factor, cause):
    """Also where the declared model lacks a delay, which leaves 40 % of every record."""
    path = study(tmp_path, delay=10)
    times(tmp_path / file, column, factor)
    refused(path, f"`{column}`" if column != "time" else "`time [ms]`", file, cause)


def test_free_parameters_that_one_record_spoils_tell_of_that_record(tmp_path):
    free = '[[free]]\nparameter = "b"\nstart = 1.0\nmin = 0.0\n'
    path = study(tmp_path, SIGNALS + free, b=None)
    times(tmp_path / "r1.csv", "pressure", -1)
    refused(path, "r1.csv", "`pressure` has the other sign")
