"""`airloop refine` on an FMU that has no input where something is missing: a cylinder whose only input is its command. Friction of its
piston is found at the rate of the velocity, and the amended system has an FMU with an input there, which any tool runs."""

import json
import shutil

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from command import ROOT, start
from held import simulated
from segments import write_segments
from test_study import amended_has_printed_errors, named, refine
from test_system_fmu import Unit
from third_party_fmu import System, build

STEP, COUNT, FINE, NOISE = 0.005, 2000, 10, 2e-4
MASS, DAMPING, GAIN, LAG, SPRING = 2.0, 20.0, 15.0, 0.05, 120.0
EQUATIONS = "der_F = (gain * u - F) / lag;\nder_x = v;\nder_v = (F - damping * v - spring * x) / mass;\n"


def write_fmu(folder, short):
    states = {"F": ("N", 10.0, ""), "x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x")}
    values = {
        "mass": (MASS, "kg", 0.01),
        "damping": (DAMPING, "N.s/m", 0.03),
        "gain": (GAIN, "N/V", 0.01),
        "lag": (LAG, "s", 0.01),
        "spring": (SPRING, "N/m", 0.01),
    }
    build(System("press", STEP, 1.0, 1, states, {"u": ("V", 1.0)}, values, {}, {}, None, short=short, hidden=("v",)), EQUATIONS, folder)


def write_study(folder, friction, short=True, seed=3, accelerometer=False):
    """The position of a press with Coulomb friction, solved by a Runge-Kutta method of fourth order."""
    folder.mkdir(parents=True)
    write_fmu(folder, short)

    def rate(state, u):
        force, x, v = state
        pull = force - DAMPING * v - SPRING * x - friction * np.tanh(v / 0.005)
        return np.array([(GAIN * u - force) / LAG, v, pull / MASS])

    rng, t, records = np.random.default_rng(seed), STEP * np.arange(COUNT), []
    for _ in range(4):
        sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.2, 0.5, 0.9))
        command = np.round(0.6 * sines + np.repeat(rng.uniform(-1, 1, COUNT // 100), 100), 3)
        command[0] = 0.0
        states = simulated(rate, np.zeros(3), command, STEP, FINE)
        shown = [states[:, 1] + NOISE * rng.standard_normal(COUNT)]
        if accelerometer:
            rates = np.array([rate(own, u)[2] for own, u in zip(states, command, strict=True)])
            shown.append(rates + 0.02 * rng.standard_normal(COUNT))
        records.append(np.column_stack([t, command, *shown]))
    text = 'system = "press.fmu"\n[inputs]\nu = { column = "u", hold = true }\n[outputs]\nx = { column = "x" }\n'
    text += '"der(v)" = { column = "a" }\n' if accelerometer else ""
    text += write_segments(folder, records, "time,u,x,a" if accelerometer else "time,u,x", len(records) * ["{ F = 0.0, x = 0.0, v = 0.0 }"])
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def test_friction_is_found_where_the_fmu_has_no_input(tmp_path):
    study, friction = write_study(tmp_path / "case", 1.5), 1.5
    result = refine(study, tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == ["coulomb@der(v)"], result.stdout
    own = report["effects"][0]["params"]["force"]
    assert own["value"] == pytest.approx(friction / MASS, rel=0.03)
    assert own["unit"] == "m/s2"
    amended_has_printed_errors(study, tmp_path / "out", report, rel=0.01)
    check_fmu(tmp_path / "out" / "system" / "press_with_rates.fmu", tmp_path)


def check_fmu(path, tmp_path):
    """Both interfaces against SciPy, with a value at the new input."""
    assert validate_fmu(str(path)) == []
    name = "added_to_der(v)"

    def rate(_, state):
        force, x, v = state
        return [(GAIN * 0.8 - force) / LAG, v, (force - DAMPING * v - SPRING * x) / MASS + 0.3]

    truth = solve_ivp(rate, (0, 0.5), np.zeros(3), rtol=1e-11, atol=1e-13).y[:, -1]
    for interface in ("ModelExchange", "CoSimulation"):
        found = fmpy.simulate_fmu(
            str(path), fmi_type=interface, stop_time=0.5, output_interval=0.01, start_values={"u": 0.8, name: 0.3}, relative_tolerance=1e-10
        )
        assert found["x"][-1] == pytest.approx(truth[1], rel=1e-6), interface


def test_an_accelerometer_sees_what_acts_at_the_rate(tmp_path):
    study = write_study(tmp_path / "case", 1.5, short=False, accelerometer=True)
    result = refine(study, tmp_path / "out")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == ["coulomb@der(v)"], result.stdout + result.stderr
    assert report["effects"][0]["params"]["force"]["value"] == pytest.approx(1.5 / MASS, rel=0.03)
    amended_has_printed_errors(study, tmp_path / "out", report, rel=0.01)


@pytest.mark.slow
def test_an_fmu_of_this_project_gets_an_input_at_a_rate_and_keeps_its_state(tmp_path):
    folder = shutil.copytree(ROOT / "examples" / "06_study", tmp_path / "case")
    text = (folder / "study.toml").read_text().split("[[attachment]]")[0]
    (folder / "study.toml").write_text(text + '[[attachment]]\ninput = "der(omega)"\n')
    result = refine(folder, tmp_path / "out")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert result.returncode == 0 and all(name.endswith("@der(omega)") for name in named(report)), result.stdout
    amended_has_printed_errors(folder / "study.toml", tmp_path / "out", report, rel=0.01)
    unit = Unit(next((tmp_path / "out" / "system").glob("*_with_rates.fmu")), tmp_path / "unpacked")
    unit.start(theta=0.3)

    def on(first):
        for k in range(first, first + 25):
            unit.set(**{"added_to_der(omega)": 0.3 + 0.01 * (k % 3)})
            unit.fmu.doStep(currentCommunicationPoint=0.01 * k, communicationStepSize=0.01)
        return unit.get(["theta", "omega", "added_to_der(omega)"])

    before = on(0)
    saved = unit.fmu.getFMUstate()
    first = on(25)
    assert first != before
    unit.fmu.setFMUstate(saved)
    assert on(25) == first
    unit.fmu.freeFMUstate(saved)
    unit.free()


@pytest.mark.parametrize("short", [True, False])
def test_ports_at_rates_are_those_that_no_input_moves(tmp_path, short):
    # The command moves the force, and the rate of the position is the velocity whatever else happens.
    study = write_study(tmp_path / "case", 0.0, short)
    shown = start("refine", study, "--plan").stdout
    ports = [line.split()[0] for line in shown.split("output  ")[0].splitlines()[1:] if line.strip()]
    assert ports == ["u", "der(v)"]


def test_a_press_that_lacks_nothing_stays_as_it_is(tmp_path):
    result = refine(write_study(tmp_path / "case", 0.0), tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
