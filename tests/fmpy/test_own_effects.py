"""Effects of one's own: a formula in a TOML file is found by `airloop refine`, written into the amended system, and runs in FMPy."""

import json

import fmpy.validation
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from scipy.integrate import solve_ivp
from scipy.interpolate import interp1d

from command import airloop, start
from fmu import Fmu
from held import simulated
from segments import write_segments
from test_derived import derive
import raw

MASS, DAMPING, STIFFNESS, REACH = 1.3, 0.9, 800.0, 0.002
STEP, COUNT = 0.002, 2000

BRISTLE = """kind = "bristle"
port = "force"
formula = "k*z"
words = "elastic bristles of the seal"
[states]
z = "v - abs(v)*z/d"
[parameters]
k = { unit = "N/m", bounds = [0, 1e6] }
d = { unit = "m", bounds = [1e-6, 1e-1], start = [1e-4, 1e-3, 1e-2] }
"""

BAD = {  # file, what is said of it
    "name.toml": (BRISTLE.replace('"k*z"', '"k*y"').replace("bristle", "name"), "there is no `y`"),
    "unit.toml": (BRISTLE.replace("N/m", "N").replace("bristle", "unit"), "unit"),
}
NO_VALUE = {  # effects that are well formed, but not on the data
    "inverse": ('kind = "inverse"\nport = "force"\nformula = "k/x"\nparameters.k.unit = "N.m"\n', "has no value at x = 0"),
    "runaway": (
        'kind = "runaway"\nport = "force"\nformula = "k*z"\nstates.z = "v + g*z"\n'
        'parameters.k.unit = "N/m"\nparameters.g = { unit = "1/s", start = 100 }\n',
        "runs away",
    ),
    "torque": ('kind = "torque"\nport = "torque"\nformula = "c*v"\nparameters.c.unit = "N.m.s/rad"\n', "is in N, the effect takes N.m"),
}

STUDY = """name = "mass with bristles"
system = "airloop:rigid-mass"
[parameters]
m = 1.3
b = 0.9
[inputs]
F = { column = "force", unit = "N", hold = true }
[outputs]
x = { column = "position", unit = "m" }
[[attachment]]
input = "F"
channels = ["cart_friction"]
velocity = "v"
position = "x"
"""


def drive(seed):
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(COUNT)
    return sum(rng.uniform(1, 3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.4, 0.9, 1.7))


def motion(u):
    """Position of a mass on bristles under a held force, by an integrator of SciPy."""

    def rate(_, y, force):
        return [y[1], (force - DAMPING * y[1] - STIFFNESS * y[2]) / MASS, y[1] - abs(y[1]) * y[2] / REACH]

    y, found = [0.0, 0.0, 0.0], []
    for force in u:
        found.append(y[0])
        y = solve_ivp(rate, (0, STEP), y, args=(force,), rtol=1e-8, atol=1e-12).y[:, -1]
    return np.array(found)


def write_study(folder, position, noise=2e-5, seed=100):
    """Four records of the driven mass, the last one for validation, and their study; `position` by the force."""
    times = STEP * np.arange(COUNT)
    records = []
    for k in range(4):
        u = drive(k)
        x = position(u) + noise * np.random.default_rng(seed + k).standard_normal(COUNT)
        records.append(np.column_stack([times, u, x]))
    segments = write_segments(folder, records, "time,force,position", 4 * ["{ x = 0.0, v = 0.0 }"])
    (folder / "study.toml").write_text(STUDY + segments)


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    write_study(folder, motion)
    effects = folder / "effects"
    effects.mkdir()
    (effects / "bristle.toml").write_text(BRISTLE)
    for name, (text, _) in {**BAD, **{f"{k}.toml": v for k, v in NO_VALUE.items()}}.items():
        (effects / name).write_text(text)
    result = start("refine", folder / "study.toml", "--effects", effects, "-o", folder / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    return folder, result, json.loads((folder / "out" / "report.json").read_text())


def test_ten_lines_are_found_with_their_parameters(refined):
    _, result, report = refined
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [effect["id"].split("@")[0] for effect in selected] == ["bristle"]
    values = {name: p["value"] for name, p in selected[0]["params"].items()}
    assert values["k"] == pytest.approx(STIFFNESS, rel=0.02) and values["d"] == pytest.approx(REACH, rel=0.02)
    assert "elastic bristles of the seal" in result.stdout
    residual = report["residual"]["validation"]
    assert residual["rms_after"]["position"] < 0.1 * residual["rms_before"]["position"]


def test_what_is_no_effect_is_named_and_the_rest_goes_on(refined):
    _, result, report = refined
    for name, (_, words) in BAD.items():
        assert name in result.stderr and words in result.stderr
        assert any(name in note for note in report["notes"])
    for name, (_, words) in NO_VALUE.items():
        assert words in report["not_testable"][name]


def test_the_amended_system_runs_in_fmpy_as_the_truth_does(refined):
    folder = refined[0] / "out" / "system"
    for path in folder.glob("*.fmu"):
        assert fmpy.validation.validate_fmu(str(path)) == [], path
    u = drive(3)
    held = {"F": lambda time: u[min(round(time / STEP), COUNT - 1)]}
    found = simulate_ssp(str(folder / "system.ssp"), stop_time=2.0, step_size=STEP / 4, input=held)
    name = next(n for n in found.dtype.names if n.endswith(".x") and "effect" not in n)
    truth = interp1d(STEP * np.arange(COUNT), motion(u), fill_value="extrapolate")(found["time"])
    assert np.sqrt(np.mean((found[name] - truth) ** 2)) < 0.05 * np.ptp(truth)


def test_the_command_explains_and_checks(refined, tmp_path):
    effects = refined[0] / "effects"
    result = start("effects", "check", effects)
    assert result.returncode == 1 and "bristle at a force port" in result.stdout and "name.toml" in result.stderr
    figure = tmp_path / "bristle.svg"
    assert "dz/dt = v - abs(v)*z/d" in airloop("effects", "show", effects / "bristle.toml", "--figure", figure)
    assert figure.read_text().startswith("<svg")
    assert "quaddrag" in airloop("effects", "list")


PUSH = """kind = "push"
port = "force"
formula = "c*v^3/(w^2 + v^2)"
parameters.c.unit = "N.s/m"
parameters.w = { unit = "m/s", start = [0.1, 1.0], bounds = [1e-3, 1e2] }
"""


@pytest.mark.parametrize("dissipative", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_an_effect_that_must_take_energy_is_not_one_that_gives_some(tmp_path, dissipative):
    def rate(y, force):
        return np.array([y[1], (force - DAMPING * y[1] + 0.4 * y[1] ** 3 / (0.09 + y[1] ** 2)) / MASS])

    def pushed(u):
        return simulated(rate, np.zeros(2), u, STEP, 4)[:, 0]

    write_study(tmp_path, pushed, seed=70)
    (tmp_path / "push.toml").write_text(PUSH + "signs.dissipative = true\n" * dissipative)
    result = start("refine", tmp_path / "study.toml", "--effects", tmp_path / "push.toml", "-o", tmp_path / "out")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    selected = [effect for effect in report["effects"] if effect["selected"]]
    names = [effect["id"].split("@")[0] for effect in selected]
    assert ("push" in names) is not dissipative, result.stdout
    if not dissipative:
        assert names == ["push"] and selected[0]["params"]["c"]["value"] == pytest.approx(-0.4, rel=0.02)


CREEP = """kind = "creep"
port = "sensor"
formula = "f + k*z"
words = "creep of the sensor"
variables.f = "m"
[states]
z = "(f - z)/tau"
[parameters]
k = { unit = "1" }
tau = { unit = "s", bounds = [1e-2, 1e2], start = [0.1, 1.0] }
"""


def test_a_sensor_that_creeps_is_found_and_stands_behind_the_output(tmp_path):
    k, tau = 0.08, 0.4
    records, times = [], STEP * np.arange(COUNT)

    def rate(y, force):
        return np.array([y[1], (force - DAMPING * y[1]) / MASS, (y[0] - y[2]) / tau])

    for number in range(4):
        u = drive(number)
        x, v, z = simulated(rate, np.zeros(3), u, STEP, 4).T
        noise = 1e-4 * np.random.default_rng(50 + number).standard_normal((2, COUNT))
        records.append(np.column_stack([times, u, x + k * z + noise[0], v + noise[1]]))
    segments = write_segments(tmp_path, records, "time,force,position,speed", 4 * ["{ x = 0.0, v = 0.0 }"])
    speed = 'v = { column = "speed", unit = "m/s" }\n[[attachment]]'
    (tmp_path / "study.toml").write_text(STUDY.replace("[[attachment]]", speed) + segments)
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "creep.toml").write_text(CREEP)
    (tmp_path / "effects" / "moving.toml").write_text(CREEP.replace('"f + k*z"', '"f + k*z + k*x"').replace("creep", "moving"))
    (tmp_path / "effects" / "plain.toml").write_text(CREEP.replace('variables.f = "m"', "").replace("creep", "plain"))
    result = start("refine", tmp_path / "study.toml", "--effects", tmp_path / "effects", "-o", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "a sensor has f, the output that it shows, and t, but no x" in result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert "is in m, the effect takes 1" in report["not_testable"]["plain"]
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [(effect["id"], effect["signal"]) for effect in selected] == [("creep", "position")]
    values = {name: p["value"] for name, p in selected[0]["params"].items()}
    assert values["k"] == pytest.approx(k, rel=0.05) and values["tau"] == pytest.approx(tau, rel=0.1)
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", tmp_path / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(report["residual"]["validation"]["rms_after"], rel=1e-3)


def test_formulas_have_their_values_and_exact_derivatives(shipped, tmp_path):
    values = {
        "formula": "k*z + c*abs(v)*v + curve(x, -1, 2, 0, h, 1, -1) - f*tanh(x/w)",
        "states": "z",
        "rate[1]": "(v - z)/tau",
        "parameters": "k c w tau h",
        **{f"p[{i + 1}]": value for i, value in enumerate((3.0, 0.7, 0.4, 0.2, 0.5))},
    }
    fmu = Fmu(derive(shipped("expression-effect"), tmp_path / "law.fmu", values), tmp_path / "unpacked")
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        instance.setup()
        names = [fmu.variable(name) for name in ("f_in", "x", "v", "z[1]")]
        instance.must("EnterInitializationMode")
        instance.must("ExitInitializationMode")

        def value(at):
            instance.set(names, list(map(float, at)))
            return instance.get([fmu.variable(name) for name in ("f", "f_out", "der(z[1])")])

        at = np.array([2.0, 0.3, -0.8, 0.1])
        f, out, rate = value(at)
        line = 0.5 + 0.3 * (-1.5) + 0.3 * 0.3 * 0.0
        expected = 3.0 * 0.1 - 0.7 * 0.64 + line - 2.0 * np.tanh(0.75)
        assert f == pytest.approx(expected, abs=1e-12) and out == pytest.approx(2.0 - f, abs=1e-12)
        assert rate == pytest.approx((-0.8 - 0.1) / 0.2, abs=1e-12)


def test_the_effects_of_the_program_are_shown_and_begin_own_ones(tmp_path):
    assert "exp(-(v/vs)^2)" in airloop("effects", "show", "stribeck", "--figure", tmp_path / "new" / "stribeck.svg")
    assert (tmp_path / "new" / "stribeck.svg").read_text().startswith("<svg")
    (tmp_path / "own.toml").write_text(airloop("effects", "show", "coulomb", "--toml"))
    assert "own_coulomb at a force port, 0 states, 2 parameters" in airloop("effects", "check", tmp_path / "own.toml")
    listed = airloop("effects", "list")
    assert all(kind in listed for kind in ("rate_limit", "overflow", "cubic_spring", "sensor.lag"))
    (tmp_path / "power.toml").write_text(CREEP + "[signs]\ndissipative = true\n")
    result = start("effects", "check", tmp_path / "power.toml")
    assert result.returncode == 1 and "a sensor has no power" in result.stderr
    for effect, problem in (("delay", "is no formula"), ("nix", "there is no such file or folder")):
        result = start("effects", "show", effect, "--toml")
        assert result.returncode != 0 and problem in result.stderr
