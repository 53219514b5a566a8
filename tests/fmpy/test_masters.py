"""Masters for stiff coupling through `airloop run`, against SciPy, and what they do with FMUs that lack a capability.

The problem is that of tests/reference: pneumatic cart-pole, 20 N at 1 Hz, 3 s. At 2 and 5 ms the actuator takes its own
samples inside the communication step, the command held (tests/reference/make_held_reference.py).
"""

import csv
import json
import os
import zipfile

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from command import ROOT, start
from test_reference import load_reference, reference, relative_rms_error

import make_held_reference as held  # test_reference put tests/reference on the path

SYSTEM = ROOT / "examples" / "01_run" / "system.ssd"
FMUS = ROOT / "target" / "fmu"
ROW = 10e-3  # s between the rows of the stored references


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    """{step in ms: CSV file with the command held over the longer of step and sample}"""
    folder = tmp_path_factory.mktemp("input")
    files = {}
    for step in (0.5, 1, 2, 5):
        hold = max(1, round(step))
        files[step] = folder / f"hold_{hold}.csv"
        with open(files[step], "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time", "u"])
            writer.writerows([f"{k * 1e-3:.3f}", repr(float(held.held_command(k, hold)))] for k in range(3001))
    return files


def expected(step):
    """Table with x, theta, v, omega of the reference, one row each 10 ms."""
    if step <= 1:
        return load_reference()
    table = np.genfromtxt(held.DATA, delimiter=",", names=True)
    return {name: table[f"{name}_{step}ms"] for name in ("x", "theta", "v", "omega")}


@pytest.mark.parametrize("hold", held.HOLDS)
def test_stored_held_reference_is_what_its_script_computes(hold):
    states = held.trajectory(hold, stop_time=0.1)[:: held.STORED_EVERY]
    stored = expected(hold)
    for column, name in enumerate(("x", "theta", "v", "omega")):
        assert stored[name][: len(states)] == pytest.approx(states[:, column], rel=1e-9, abs=1e-12)


class Outcome:
    """Results that a run wrote, with its errors [%] against the reference."""

    def __init__(self, folder, step):
        result = np.genfromtxt(folder / "result.csv", delimiter=",", names=True, deletechars="")
        self.summary = json.loads((folder / "summary.json").read_text())
        stride = round(ROW / (step * 1e-3))
        self.errors = {
            name: relative_rms_error(result[name][::stride], expected(step)[name])
            for name in ("x", "theta", "v", "omega")
        }
        friction = result["piston_friction.f"] + result["cart_friction.f"]
        self.chatter = float(np.sqrt(np.mean(np.diff(friction, 2) ** 2))) / 4
        self.result = result
        serial = len(self.summary["fmus"]) * self.summary["outcome"]["steps"]
        self.effort = self.summary["effort"]["fmu_steps"] / serial
        print(f"{step} ms: {self.errors}, chatter {self.chatter:.4f} N, FMU steps {self.effort:.2f} of Gauss-Seidel")


def run(commands, step, folder, *options, system=SYSTEM):
    words = ["--stop", "3", "--step", f"{step}ms", "--input", commands[step], "--interpolation", "hold"]
    outcome = start("run", system, *words, *options, "--no-plots", "-o", folder)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    return Outcome(folder, step)


ONE = {0.5: (0.001, 0.004), 1: (0.004, 0.015), 2: (0.012, 0.06), 5: (0.12, 0.7)}
ITERATED = {0.5: (0.001, 0.004), 1: (0.004, 0.015), 2: (0.010, 0.04), 5: (0.07, 0.25)}


@pytest.mark.parametrize("step", ONE)
@pytest.mark.parametrize("options, limits", [((), ONE), (("--iterate", "1e-6"), ITERATED)], ids=["one", "iterated"])
def test_interface_jacobian_meets_its_error_limits(commands, tmp_path, step, options, limits):
    outcome = run(commands, step, tmp_path, "--master", "interface-jacobian", *options)
    assert outcome.errors["x"] <= limits[step][0]
    assert outcome.errors["v"] <= limits[step][1]
    assert outcome.chatter <= 0.1
    assert outcome.effort <= 2.6


def test_interface_jacobian_with_held_inputs_and_without_correction(commands, tmp_path):
    held_inputs = run(commands, 5, tmp_path / "held", "--master", "interface-jacobian", "--inputs", "held")
    assert 1e-3 < held_inputs.errors["x"] <= 0.12  # a held force misses the first moment
    predicted = run(commands, 5, tmp_path / "predicted", "--master", "interface-jacobian", "--corrections", "0")
    assert predicted.errors["x"] <= 0.12
    # 5 actuator steps and one of each of the other three, where a correction repeats the cart-pole's.
    assert predicted.effort == pytest.approx(8 / 4)


def test_forces_are_consistent_at_the_communication_points(commands, tmp_path):
    result = run(commands, 2, tmp_path, "--master", "interface-jacobian").result
    # F_p is the left limit: the force of the last sample before the communication point, less the friction there.
    forces = reference.actuator_forces(held.held_command(np.arange(3001), 2))[:, 1]
    friction = reference.piston_friction(result["v"][1:])
    assert np.max(np.abs(result["F_p"][1:] - (forces[1:3000:2] - friction))) < 1e-6


def test_extrapolated_inputs_remove_the_error_of_first_order_below_the_stability_limit(commands, tmp_path):
    first = run(commands, 0.5, tmp_path / "1", "--master", "gauss-seidel", "--extrapolation", "1")
    second = run(commands, 0.5, tmp_path / "2", "--master", "gauss-seidel", "--extrapolation", "2")
    # Held inputs: 0.041 % and 0.18 %. The limits are those of an independent prototype in Python, and a little.
    assert first.errors["x"] <= 0.0009 and first.errors["v"] <= 0.014
    assert second.errors["x"] <= 0.0010 and second.errors["v"] <= 0.028
    parallel = run(commands, 0.5, tmp_path / "3", "--master", "jacobi", "--extrapolation", "1")
    assert 0.25 <= parallel.errors["x"] <= 0.35  # every connection is late: near its stability limit here
    assert parallel.effort == pytest.approx(1.0)


# ---------------------------------------------------------------------------------- estimated coupling error


def estimated(commands, step, folder, *options):
    outcome = run(commands, step, folder, *options, "--estimate-coupling-error")
    record = outcome.summary["coupling_error"]
    return outcome, record, {signal["name"]: signal for signal in record["signals"]}


@pytest.mark.parametrize("master, asymptotic", [("gauss-seidel", True), ("jacobi", False)])
def test_the_estimated_coupling_error_is_the_true_one_within_a_factor_of_two(commands, tmp_path, master, asymptotic):
    outcome, record, signals = estimated(commands, 1, tmp_path, "--master", master)
    # Gauss-Seidel 0.083 % in x. Jacobi, 0.184 %, is near its stability limit here, and the estimate says so.
    for name in ("x", "theta", "v", "omega"):
        assert 0.5 < signals[name]["relative_percent"] / outcome.errors[name] < 2, (name, signals[name], outcome.errors)
        assert signals[name]["standing"] == ("asymptotic" if asymptotic else "not_asymptotic")
    if asymptotic:
        assert signals["x"]["order"] == pytest.approx(1, abs=0.1)
    assert signals["F_act"]["standing"] == "negligible"  # nothing acts back on the actuator
    assert signals["cart_friction.F_out"]["kind"] == "connection"
    assert len(record["masters"]) >= 4 and record["masters"][0]["options"] == f"--master {master}"


@pytest.mark.parametrize("goal, master", [(0.01, "interface-jacobian"), (0.1, "gauss-seidel")])
def test_the_recommended_master_and_step_reach_the_goal(commands, tmp_path, goal, master):
    options = ["--coupling-goal", goal, "--coupling-signal", "x"]
    _, record, _ = estimated(commands, 1, tmp_path / "one", *options)
    best = record["recommendation"]
    assert best["options"] == f"--master {master}"
    assert best["step_size"] == 1e-3
    outcome = run(commands, 1, tmp_path / "two", *best["options"].split())
    assert outcome.errors["x"] <= goal
    assert outcome.summary["effort"]["fmu_steps"] == best["fmu_steps"]


def test_the_step_for_the_goal_reaches_it_with_the_same_master(commands, tmp_path):
    _, record, _ = estimated(commands, 1, tmp_path / "one", "--coupling-goal", "0.05", "--coupling-signal", "x")
    assert record["masters"][0]["step_for_goal"] == 0.5e-3
    assert run(commands, 0.5, tmp_path / "two").errors["x"] <= 0.05


def test_no_estimate_is_refused_or_explained(commands, tmp_path):
    words = ["--stop", "0.1", "--input", commands[1], "--no-plots", "-o", tmp_path, "--estimate-coupling-error"]
    refused = start("run", SYSTEM, *words, "--master", "monolithic")
    assert refused.returncode == 1 and "has no coupling error to estimate" in refused.stderr
    refused = start("run", SYSTEM, *words, "--coupling-signal", "y")
    assert refused.returncode == 1 and "--coupling-signal y" in refused.stderr and "theta" in refused.stderr
    refused = start("run", SYSTEM, *words, "--coupling-goal", "0")
    assert refused.returncode == 2 and "coupling-goal = 0 is not possible" in refused.stderr
    failed = start("run", SYSTEM, *words, "--set", "cart_friction.c2=1e300", "--master", "interface-jacobian")
    assert failed.returncode == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert "coupling_error" not in summary
    assert any("no estimate of the coupling error" in note for note in summary["fallbacks"])


# ---------------------------------------------------------------------------------- FMUs that lack a capability


def weakened(tmp_path, changes):
    """The example with changed model descriptions; `changes` is {FMU: functions from text to text}."""
    for path in FMUS.glob("*.fmu"):
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(tmp_path / path.name, "w") as new:
            for name in old.namelist():
                content = old.read(name)
                if name == "modelDescription.xml":
                    text = content.decode()
                    for change in changes.get(path.stem, []):
                        text = change(text)
                    content = text.encode()
                new.writestr(old.getinfo(name), content)
    system = tmp_path / "system.ssd"
    system.write_text(SYSTEM.read_text().replace("../../target/fmu/", ""))
    (tmp_path / "cart.ssv").write_text((SYSTEM.parent / "cart.ssv").read_text())
    return system


def lacking(attribute):
    return lambda text: text.replace(f'{attribute}="true"', f'{attribute}="false"')


def no_output_derivatives(text):
    return text.replace('maxOutputDerivativeOrder="1"', 'maxOutputDerivativeOrder="0"')


def no_model_exchange(text):
    begin = text.index("<ModelExchange")
    return text[:begin] + text[text.index("/>", begin) + 2 :]


NO_DIRECTIONAL = lacking("providesDirectionalDerivative")
NO_STATE = lacking("canGetAndSetFMUstate")
NO_RAMPS = lacking("canInterpolateInputs")


@pytest.mark.parametrize(
    "changes, note, limits",
    [
        ({"cart-pole": [NO_DIRECTIONAL]}, "`cart_pole` has no directional derivatives", (0.001, 0.004)),
        ({"cart-pole": [no_output_derivatives]}, "`cart_pole` gives no output derivatives", (0.02, 0.1)),
        ({"cart-pole": [NO_RAMPS]}, "`cart_pole` takes no input derivatives", (0.12, 0.7)),
        ({"cart-pole": [NO_STATE]}, "no correction, as `cart_pole` cannot save", (0.12, 0.7)),
        ({"cart-pole": [NO_STATE, NO_DIRECTIONAL]}, "learned from step to step (Broyden)", (0.25, 0.7)),
        ({"friction": [NO_DIRECTIONAL]}, "slopes are difference quotients", (0.001, 0.004)),
        ({"friction": [no_model_exchange]}, "approximated by its secant", (0.12, 0.7)),
        ({"friction": [no_model_exchange, NO_DIRECTIONAL]}, "approximated by its secant", (0.12, 0.7)),
        ({"friction": [no_model_exchange, NO_STATE]}, "approximated by its tangent", (0.12, 0.7)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_fallback_is_named_and_stays_accurate(commands, tmp_path, changes, note, limits):
    system = weakened(tmp_path, changes)
    outcome = run(commands, 5, tmp_path / "out", "--master", "interface-jacobian", system=system)
    assert any(note in line for line in outcome.summary["fallbacks"]), outcome.summary["fallbacks"]
    assert outcome.errors["x"] <= limits[0]
    assert outcome.errors["v"] <= limits[1]


@pytest.mark.parametrize(
    "changes, options",
    [
        ({"cart-pole": [NO_STATE, NO_DIRECTIONAL, no_output_derivatives]}, ()),
        ({"cart-pole": [NO_STATE]}, ("--iterate", "1e-6")),
        ({"cart-pole": [NO_DIRECTIONAL, no_output_derivatives]}, ("--corrections", "0")),
        ({"friction": [no_model_exchange, NO_STATE, NO_DIRECTIONAL]}, ()),
        ({"cart-pole": [lambda text: text.replace('numberOfEventIndicators="0"', 'numberOfEventIndicators="1"')]}, ()),
    ],
)
def test_what_cannot_run_is_refused_with_the_master_that_can(commands, tmp_path, changes, options):
    system = weakened(tmp_path, changes)
    words = ["--stop", "0.1", "--input", commands[1], "--no-plots", "-o", tmp_path / "out"]
    refused = start("run", system, *words, "--master", "interface-jacobian", *options)
    assert refused.returncode == 1
    component = "piston_friction" if "friction" in changes else "cart_pole"
    assert f"component `{component}`" in refused.stderr
    assert "--master gauss-seidel" in refused.stderr
    assert start("run", system, *words, "--master", "gauss-seidel").returncode == 0


def test_extrapolation_names_what_it_cannot_extrapolate(commands, tmp_path):
    system = weakened(tmp_path, {"friction": [no_output_derivatives], "cart-pole": [NO_RAMPS]})
    options = ["--master", "gauss-seidel", "--extrapolation", "1"]
    notes = run(commands, 0.5, tmp_path / "out", *options, system=system).summary["fallbacks"]
    for note in ("`cart_pole` takes no input derivatives", "`piston_friction` gives no output derivatives"):
        assert any(note in line for line in notes), notes


def test_a_coupling_that_cannot_be_solved_names_components_and_time_and_keeps_the_result(commands, tmp_path):
    words = ["--stop", "1", "--input", commands[1], "--set", "cart_friction.c2=1e300", "--no-plots", "-o", tmp_path]
    outcome = start("run", SYSTEM, *words, "--master", "interface-jacobian")
    assert outcome.returncode == 1
    assert "the coupling of piston_friction, cart_friction, cart_pole has no solution" in outcome.stderr
    assert "t = " in outcome.stderr and (tmp_path / "result.csv").exists()


def test_options_of_another_master_are_refused(commands, tmp_path):
    words = ["--stop", "1", "--master", "interface-jacobian", "--extrapolation", "1", "-o", tmp_path]
    assert "--extrapolation is an option of" in start("run", SYSTEM, *words).stderr
    outcome = start("run", SYSTEM, "--stop", "1", "--inputs", "held", "-o", tmp_path)
    assert outcome.returncode == 1
    assert "--inputs is an option of `--master interface-jacobian`" in outcome.stderr


# ---------------------------------------------------------------------------------- other graphs


def system_of(tmp_path, components, connections):
    """A system without connectors of its own; `connections` as "a.y > b.u"."""
    elements, links = "", ""
    for name, fmu in components.items():
        ports = {end for pair in connections for end in pair.split(" > ") if end.startswith(f"{name}.")}
        inputs = {pair.split(" > ")[1] for pair in connections}
        rows = "".join(
            f'<ssd:Connector name="{port.split(".", 1)[1]}" kind="{"input" if port in inputs else "output"}"/>'
            for port in sorted(ports)
        )
        source = os.path.relpath(FMUS / fmu, tmp_path)
        elements += f'<ssd:Component name="{name}" source="{source}"><ssd:Connectors>{rows}</ssd:Connectors></ssd:Component>'
    for pair in connections:
        (a, y), (b, u) = (end.split(".", 1) for end in pair.split(" > "))
        links += f'<ssd:Connection startElement="{a}" startConnector="{y}" endElement="{b}" endConnector="{u}"/>'
    names = "http://ssp-standard.org/SSP1/SystemStructure"
    path = tmp_path / "system.ssd"
    path.write_text(
        f'<ssd:SystemStructureDescription version="1.0" name="s" xmlns:ssd="{names}Description" xmlns:ssc="{names}Common">'
        f'<ssd:System name="s"><ssd:Elements>{elements}</ssd:Elements><ssd:Connections>{links}</ssd:Connections></ssd:System>'
        "</ssd:SystemStructureDescription>"
    )
    return path


def last_row(system, folder, *options):
    outcome = start("run", system, *options, "--no-plots", "-o", folder)
    assert outcome.returncode == 0, outcome.stderr
    return np.genfromtxt(folder / "result.csv", delimiter=",", names=True, deletechars="")[-1]


def test_direct_feed_through_of_a_dynamic_fmu_inside_a_cycle(tmp_path):
    # Two cart-poles: the acceleration of one drives the other, whose position pushes the first.
    connections = ["one.a > pass.u", "pass.y > two.F", "two.x > back.u", "back.y > one.F_ext"]
    components = {"one": "cart-pole.fmu", "two": "cart-pole.fmu", "pass": "test/test-copy.fmu", "back": "test/test-copy.fmu"}
    system = system_of(tmp_path, components, connections)

    def coupled(_, s):
        first = reference.mechanics(s[:4], 2.0 + s[4])
        return np.concatenate([first, reference.mechanics(s[4:], first[2])])

    truth = solve_ivp(coupled, (0.0, 1.0), np.zeros(8), method="Radau", rtol=1e-10, atol=1e-13).y[:, -1]
    errors = []
    for step in ("20ms", "10ms"):
        row = last_row(system, tmp_path / step, "--stop", "1", "--step", step, "--set", "one.F=2", "--master", "interface-jacobian")
        found = [row[f"{name}.{state}"] for name in ("one", "two") for state in ("x", "theta", "v", "omega")]
        errors.append(np.max(np.abs(np.array(found) - truth)))
    print(errors)
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 4  # order 2 at least


def test_a_sampled_fmu_in_the_loop_takes_its_input_at_its_samples(tmp_path):
    # The position drives the actuator, its force the cart: the loop is closed by the samples.
    connections = ["cart.x > pass.u", "pass.y > act.u", "act.F_act > friction.F_in", "friction.F_out > cart.F", "cart.v > friction.v"]
    components = {"act": "arx-actuator.fmu", "friction": "friction.fmu", "cart": "cart-pole.fmu", "pass": "test/test-copy.fmu"}
    system = system_of(tmp_path, components, connections)
    options = ["--stop", "0.5", "--set", "cart.x=1"]
    fine = last_row(system, tmp_path / "fine", *options, "--step", "0.005ms")
    row = last_row(system, tmp_path / "coarse", *options, "--step", "1ms", "--master", "interface-jacobian")
    for name in ("cart.x", "cart.theta", "cart.v"):
        assert row[name] == pytest.approx(fine[name], rel=2e-4), name
    note = json.loads((tmp_path / "coarse" / "summary.json").read_text())["fallbacks"]
    assert any("`act` is sampled" in line for line in note)
