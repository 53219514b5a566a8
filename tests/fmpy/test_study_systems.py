"""`airloop refine` of systems other than the rig, on sets with known truth made by tests/study/systems: one of each kind."""

import json
import re
import sys
import tomllib

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet
from fmpy.validation import validate_fmu
from lxml import etree

from command import ROOT, start
from test_examples import SCHEMAS
from test_study import named, refine

sys.path.insert(0, str(ROOT / "tests" / "study" / "systems"))
import make_systems  # noqa: E402

CASES = [  # family, kind, strength, exit code, effects
    ("pendulum", "none", 1.0, 10, set()),
    ("pendulum", "drag", 1.0, 0, {"pole.quaddrag"}),
    ("pendulum", "cable", 1.0, 13, set()),
    ("axis", "none", 1.0, 10, set()),
    pytest.param("axis", "spring", 1.0, 0, {"cart.spring"}, marks=pytest.mark.slow),
    ("seal", "area", 2.5, 0, {"act.area"}),
    ("actuator", "none", 1.0, 10, set()),
    ("actuator", "deadband", 1.0, 0, {"act.deadband"}),
    ("actuator", "play", 3.0, 0, {"act.hysteresis"}),
    ("actuator", "offset", 3.0, 0, {"sensor.offset"}),
]


@pytest.mark.parametrize("family, kind, strength, code, effects", CASES)
def test_what_is_missing_is_named_and_nothing_else(tmp_path, family, kind, strength, code, effects):
    folder = tmp_path / "set"
    folder.mkdir()
    make_systems.FAMILIES[family][0](folder, np.random.default_rng(7), kind, strength)
    result = refine(folder, tmp_path / "out")
    assert result.returncode == code, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert set(named(found)) == effects
    if kind == "cable":
        assert (found["unexplained"]["channel"], found["unexplained"]["variables"]) == ("pole", ["theta"])
    if family == "actuator" and effects:
        # The amended system runs as it stands.
        system = tmp_path / "out" / "system" / "system.ssd"
        run = start("run", system, "--measured", folder / "trial_5.csv", "-o", tmp_path / "run")
        assert run.returncode == 0, run.stderr


@pytest.mark.slow
def test_a_periodic_force_is_found_where_it_throws_the_declared_model_far_off(tmp_path):
    # In windows of 1 s the declared model ends millimeters away, a good part of the period.
    make_systems.axis(tmp_path, np.random.default_rng(2), "cogging", 1.0)
    result = refine(tmp_path, tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    assert named(json.loads((tmp_path / "out" / "report.json").read_text())) == ["cart.cogging"]


def rewritten(folder, target, units, factors):
    """The set of a folder with columns in other units: unit and factor by column."""
    target.mkdir()
    text = (folder / "dataset.toml").read_text()
    for column, unit in units.items():
        text = re.sub(rf'(?m)^{column} = {{ unit = "[^"]*" }}', f'{column} = {{ unit = "{unit}" }}', text)
    (target / "dataset.toml").write_text(text)
    for path in folder.glob("*.csv"):
        names = path.read_text().split("\n", 1)[0].split(",")
        values = np.loadtxt(path, delimiter=",", skiprows=1) * [factors.get(name, 1.0) for name in names]
        np.savetxt(target / path.name, values, "%.12g", delimiter=",", header=",".join(names), comments="")


@pytest.mark.parametrize(
    "family, kind, strength, signal, units, factors",
    [
        ("pendulum", "drag", 1.0, "angle", {"angle": "deg"}, {"angle": 180 / np.pi}),
        pytest.param("axis", "spring", 1.0, "position", {"position": "mm"}, {"position": -1e3}, marks=pytest.mark.slow),
        ("seal", "area", 2.5, "force", {"position": "mm", "pressure": "bar"}, {"position": -1e3, "pressure": 1e-5}),
    ],
)
def test_units_and_directions_of_the_columns_change_nothing(tmp_path, family, kind, strength, signal, units, factors):
    (tmp_path / "set").mkdir()
    make_systems.FAMILIES[family][0](tmp_path / "set", np.random.default_rng(7), kind, strength)
    rewritten(tmp_path / "set", tmp_path / "other", units, factors)
    found = []
    for name in ("set", "other"):
        result = refine(tmp_path / name, tmp_path / f"{name}_out")
        assert result.returncode in (0, 12), result.stdout + result.stderr
        found.append(json.loads((tmp_path / f"{name}_out" / "report.json").read_text()))
    assert named(found[0]) == named(found[1])
    one, other = (report["residual"]["validation"]["rms_after"][signal] for report in found)
    # Rms in the unit of the system; the simulation of the search is the same up to rounding of the columns.
    assert other == pytest.approx(one, rel=0.02)


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    """Report of an axis with friction that differs by direction, and its folder."""
    folder = tmp_path_factory.mktemp("axis")
    make_systems.axis(folder, np.random.default_rng(7), "direction", 1.0)
    result = refine(folder, folder / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    return folder, json.loads((folder / "out" / "report.json").read_text())


@pytest.mark.slow
def test_friction_that_differs_by_direction_is_not_taken_for_a_spring(axis):
    found = axis[1]
    names = named(found)
    beside = {effect["id"] for effect in found["effects"] if effect["group"] is not None}
    # Where an axis moves or stands, a force for one direction is half of it for both and half of it as a bias.
    assert "cf.coulomb" in names and {"cf.asymmetry", "cf.offset"} & set(names) and len(names) == 2
    assert "cf.asymmetry" in {*names, *beside}


@pytest.mark.slow
def test_the_error_of_the_true_model_is_what_the_sensors_give(axis):
    found = axis[1]
    floor, residual = found["error_floor"]["validation"], found["residual"]["validation"]
    for signal in ("position", "force"):
        # Pulses at the beginning of windows are sharper than the filter of the velocity, which the floor has to know.
        assert 0.5 < residual["rms_after"][signal] / floor[signal] < 1.5, (signal, floor, residual)
        assert residual["rms_before"][signal] > 1.5 * floor[signal]


@pytest.mark.slow
def test_effects_hold_on_parts_of_the_records(axis):
    for effect in axis[1]["effects"]:
        if effect["selected"]:
            own = effect["stability"]
            assert own["parts"] == 4 and 3 <= own["better"] <= 4
            assert own["ranges"].keys() == effect["params"].keys()
            for name, (low, high) in own["ranges"].items():
                # Fits without one quarter scatter around the fit to all.
                assert low - (high - low) <= effect["params"][name]["value"] <= high + (high - low)


@pytest.mark.slow
def test_the_amended_system_of_a_study_runs_here_and_in_fmpy_alike(axis):
    folder, _ = axis
    system, record = folder / "out" / "system", np.genfromtxt(folder / "estimation.csv", delimiter=",", names=True)
    xsd = etree.XMLSchema(etree.parse(str(SCHEMAS / "SystemStructureDescription.xsd")))
    xsd.assertValid(etree.parse(str(system / "system.ssd")))
    for path in system.glob("*.fmu"):
        assert validate_fmu(str(path)) == [], path
    table = tomllib.loads((system / "signals.toml").read_text())["signals"]
    assert table == {"F": "force", "x": "position"}
    run = ["run", system / "system.ssd", "--measured", folder / "estimation.csv", "--signals", system / "signals.toml", "--stop", "1.5", "--no-plots"]
    step = record["time"][1]
    run = [*run, "--step", str(step), "--master", "gauss-seidel", "-o", folder / "run"]
    result = start(*run)
    assert result.returncode == 0, result.stdout + result.stderr
    ours = np.genfromtxt(next((folder / "run").glob("*.csv")), delimiter=",", names=True)
    held = {"F": lambda time: record["force"][min(round(time / step), len(record) - 1)]}
    # FMPy leaves parameter bindings to its caller.
    values = ParameterSet()
    for component in etree.parse(str(system / "system.ssd")).iterfind(".//{*}Component"):
        for parameter in component.iterfind(".//{*}Parameter"):
            value = parameter.find("{*}Real").get("value")
            values.parameters.append(Parameter(name=f"{component.get('name')}.{parameter.get('name')}", type="Real", value=value))
    theirs = simulate_ssp(str(system / "system.ssp"), stop_time=1.5, step_size=step, parameter_set=values, input=held)
    position = np.interp(ours["time"], theirs["time"], theirs["x"])
    # Both step the same FMUs; FMPy passes on what a block gives one step later.
    assert np.ptp(ours["x"]) > 0.02 and np.abs(ours["x"] - position).max() < 0.002 * np.ptp(ours["x"])


def test_an_enumeration_of_the_system_is_set_by_its_item_and_checked(tmp_path):
    make_systems.actuator(tmp_path, np.random.default_rng(7), "none", 1.0)
    study = tmp_path / "study.toml"
    study.write_text(study.read_text().replace('"sampled"', '"smooth"'))
    result = refine(tmp_path, tmp_path / "out")
    assert result.returncode == 1
    for word in ["line 5", "realization", "smooth", "sampled", "continuous"]:
        assert word in result.stderr, result.stderr
