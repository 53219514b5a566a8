"""`airloop stabilize` and `airloop trials`: the controller FMU in FMPy against the master's closed loop and its own table."""

import csv
import json
import shutil
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from lxml import etree

from command import ROOT, start

EXAMPLE = ROOT / "examples" / "03_swing_up"
FMUS = ROOT / "target" / "fmu"
SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
STEP = 1e-3


def airloop(*arguments):
    result = start(*arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def table(path):
    return np.genfromtxt(path, delimiter=",", names=True, deletechars="")


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    ms = ["--transcription", "multiple-shooting", "--intervals", 100, "--no-verification", "--no-plots"]
    airloop("optimize", EXAMPLE / "problem.toml", *ms, "-o", folder)
    return folder


@pytest.fixture(scope="module")
def stabilized(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stabilized")
    airloop("stabilize", plan, EXAMPLE / "stabilize.toml", "-o", folder)
    return folder


@pytest.fixture(scope="module")
def closed_loop(stabilized, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    airloop("run", stabilized / "closed_loop.ssd", "--step", "1ms", "--stop", 4, "-o", folder, "--no-plots")
    return table(folder / "result.csv")


class Slave:
    """An FMU in FMPy with its variables by name."""

    def __init__(self, path, folder, start=None):
        self.description = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        identifier = self.description.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(
            guid=self.description.guid, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName=folder.name
        )
        self.fmu.instantiate()
        for name, value in (start or {}).items():
            self.fmu.setReal([self.references[name]], [value])
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def get(self, *names):
        return self.fmu.getReal([self.references[name] for name in names])

    def step(self, time, **inputs):
        names = [name.replace("__", "[") + "]" if "__" in name else name for name in inputs]
        self.fmu.setReal([self.references[name] for name in names], list(inputs.values()))
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=STEP)


def cart_friction():
    document = etree.parse(str(ROOT / "examples" / "01_run" / "cart.ssv"))
    parameters = document.iter("{*}Parameter")
    return {p.get("name"): float(p[0].get("value")) for p in parameters}


def in_fmpy(stabilized, tmp_path, duration):
    """All five FMUs stepped one after the other by hand, as the Gauss-Seidel master does; states and commands."""
    slaves = {
        "controller": Slave(stabilized / "controller.fmu", tmp_path / "controller"),
        "actuator": Slave(FMUS / "arx-actuator.fmu", tmp_path / "actuator"),
        "piston": Slave(FMUS / "friction.fmu", tmp_path / "piston"),
        "cart": Slave(FMUS / "friction.fmu", tmp_path / "cart", cart_friction()),
        "cart_pole": Slave(FMUS / "cart-pole.fmu", tmp_path / "cart_pole"),
    }
    rows = [slaves["cart_pole"].get("x", "theta")]
    commands = []
    for k in range(round(duration / STEP)):
        time = k * STEP
        x, theta, v = slaves["cart_pole"].get("x", "theta", "v")
        slaves["controller"].step(time, y__1=x, y__2=theta)
        commands.append(slaves["controller"].get("u[1]")[0])
        slaves["actuator"].step(time, u=commands[-1])
        slaves["piston"].step(time, F_in=slaves["actuator"].get("F_act")[0], v=v)
        slaves["cart"].step(time, F_in=slaves["piston"].get("F_out")[0], v=v)
        slaves["cart_pole"].step(time, F=slaves["cart"].get("F_out")[0])
        rows.append(slaves["cart_pole"].get("x", "theta"))
    return np.array(rows), np.array(commands)


def test_the_controller_in_fmpy_gives_the_closed_loop_of_the_master(stabilized, closed_loop, tmp_path):
    ours, commands = in_fmpy(stabilized, tmp_path, 4)
    # Rounding alone, which the upright pole under feedback does not let grow.
    assert ours[:, 0] == pytest.approx(closed_loop["x"], abs=1e-9)
    assert ours[:, 1] == pytest.approx(closed_loop["theta"], abs=1e-9)
    assert commands == pytest.approx(closed_loop["u"][:-1], abs=1e-6)
    assert abs(ours[-1, 1] - np.pi) < 1e-3 and abs(ours[-1, 0]) < 1e-3


@pytest.fixture(scope="module")
def predictive(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("predictive")
    airloop("stabilize", "--nmpc", plan, EXAMPLE / "stabilize.toml", "--no-plots", "-o", folder)
    return folder


def test_the_predictive_controller_in_fmpy_gives_the_closed_loop_of_the_master(predictive, tmp_path):
    airloop("run", predictive / "closed_loop.ssd", "--step", "1ms", "--stop", 3, "-o", tmp_path / "run", "--no-plots")
    closed_loop = table(tmp_path / "run" / "result.csv")
    ours, commands = in_fmpy(predictive, tmp_path, 3)
    # Rounding alone, as with the regulator.
    assert ours[:, 0] == pytest.approx(closed_loop["x"], abs=1e-9)
    assert ours[:, 1] == pytest.approx(closed_loop["theta"], abs=1e-9)
    assert commands == pytest.approx(closed_loop["u"][:-1], abs=1e-6)
    assert abs(ours[-1, 1] - np.pi) < 1e-3 and abs(ours[-1, 0]) < 1e-3
    assert closed_loop["controller.feasible"][100:].all() and closed_loop["controller.iterations"].max() >= 1
    assert closed_loop["controller.solve_time"].max() > 0


def test_the_predictive_controller_holds_what_the_regulator_loses(stabilized, predictive, tmp_path):
    kept = []
    for folder in (stabilized, predictive):
        out = tmp_path / folder.name
        airloop("trials", folder, "--count", 6, "--scale", 8, "--no-plots", "-o", out)
        rows = np.genfromtxt(out / "trials.csv", delimiter=",", names=True, dtype=None, encoding=None)
        kept.append([bool(row["held"]) and bool(row["bounds"]) for row in rows if row["loop"] == "closed"])
    assert not all(kept[0]) and all(kept[1])


def test_the_controller_follows_its_table(stabilized, tmp_path):
    """The equations of the README in NumPy, on measured signals with errors that also reach the limits."""
    folder = tmp_path / "controller"
    slave = Slave(stabilized / "controller.fmu", folder)
    with open(folder / "resources" / "controller.csv") as file:
        header, *rows = csv.reader(file)
    rows = np.array(rows, float)
    n, m, p = (sum(name.startswith(f"{letter}[") for name in header) for letter in "xuy")
    sizes = [n, m, p, m * n, n * p, n * n, n * m, n, p * n]
    limit = slave.get("u_max[1]")[0]
    assert limit == pytest.approx(0.5e6 * np.pi * 0.02**2 / 4)
    e, reached = np.zeros(n), 0
    for k in range(len(rows) + 20):
        x, u0, y0, gain, correction, a, b, c, output = np.split(rows[min(k, len(rows) - 1), 1:], np.cumsum(sizes)[:-1])
        measured = y0 + np.array([1e-3 * np.sin(0.1 * k), 0.05 * np.cos(0.07 * k) * (1 + 4 * (k % 500 > 450))])
        e = e + correction.reshape(n, p) @ (measured - y0 - output.reshape(p, n) @ e)
        u = np.clip(u0 - gain.reshape(m, n) @ e, -limit, limit)
        reached += abs(u[0]) == limit
        slave.step(k * STEP, y__1=measured[0], y__2=measured[1])
        assert slave.get("u[1]") == pytest.approx(u, rel=1e-12, abs=1e-9)
        names = [f"x_hat[{i + 1}]" for i in range(n)]
        assert slave.get(*names) == pytest.approx(x + e, rel=1e-12, abs=1e-9)
        e = a.reshape(n, n) @ e + b.reshape(n, m) @ (u - u0) + c
    assert reached > 10


def test_the_closed_loop_as_one_fmu_is_the_plan_where_the_feedback_is_off(plan, stabilized, closed_loop, tmp_path):
    def exported(name, *words):
        airloop("export-fmu", stabilized / "closed_loop.ssd", "--step", "1ms", *words, "-o", tmp_path / name)
        return fmpy.simulate_fmu(str(tmp_path / name), stop_time=2.0, output_interval=STEP)

    closed = exported("closed.fmu")
    for name in ("x", "theta"):
        assert np.array_equal(closed[name], closed_loop[name][: len(closed)]), name
    # After a step FMPy reads what was held over it.
    held = len(closed) - 1
    assert np.array_equal(closed["u"][1:], closed_loop["u"][:held])
    played = exported("plan.fmu", "--set", "controller.feedback=false")
    assert np.array_equal(played["u"][1:], table(plan / "command.csv")["u"][:held])


def test_the_closed_loop_is_valid_ssp(stabilized):
    schema = etree.XMLSchema(etree.parse(str(SCHEMAS / "SystemStructureDescription.xsd")))
    schema.assertValid(etree.parse(str(stabilized / "closed_loop.ssd")))


def test_the_summary_says_what_was_designed(stabilized):
    summary = json.loads((stabilized / "summary.json").read_text())
    assert summary["rests"] and summary["samples"] == 2000 and summary["sample_time"] == STEP
    measured = {s["name"]: s["noise"] for s in summary["signals"] if s["kind"] == "measured"}
    assert measured == pytest.approx({"x": 2e-4, "theta": 2e-3})
    assert summary["largest_error"]["theta"] < 0.05
    for name in summary["files"] + summary["figures"]:
        assert (stabilized / name).stat().st_size > 0


@pytest.fixture(scope="module")
def trials(stabilized, tmp_path_factory):
    """{(scale, threads): folder} of few trials; the figures of 200 are in the README of the example."""
    folders = {}
    for scale, threads in [(1, 1), (1, 2), (2, 2)]:
        folders[scale, threads] = tmp_path_factory.mktemp("trials")
        few = ["--count", 8, "--scale", scale, "--threads", threads]
        airloop("trials", stabilized, *few, "-o", folders[scale, threads])
    return folders


def test_perturbed_systems_reach_and_hold_the_upright_position_with_feedback_only(trials):
    for scale in (1, 2):
        summary = json.loads((trials[scale, 2] / "summary.json").read_text())
        kept = {c["name"]: (c["closed_loop"], c["open_loop"]) for c in summary["criteria"]}
        assert kept["reach"][0] == 8 and kept["held"][0] >= 7
        assert kept["reach"][1] <= 1 and kept["held"][1] == 0


def test_trials_do_not_depend_on_the_number_of_threads(trials):
    for name in ("trials.csv", "trajectories.csv"):
        assert (trials[1, 1] / name).read_bytes() == (trials[1, 2] / name).read_bytes()


def swept(folder, plan):
    """Merged rows of a sweep with the text of a plan."""
    (folder / "plan.toml").write_text(plan)
    airloop("sweep", "plan", folder / "plan.toml", "-o", folder / "sweep")
    for word in ("run", "merge"):
        airloop("sweep", word, folder / "sweep", "--quiet")
    with open(folder / "sweep" / "results.csv") as file:
        return list(csv.DictReader(file))


def test_a_sweep_of_trials_has_their_rows(stabilized, trials, tmp_path):
    rows = swept(tmp_path, f'kind = "trials"\nsystem = "{stabilized}"\ntime_limit = 60\n[trials]\ncount = 8\n')
    with open(trials[1, 1] / "trials.csv") as file:
        expected = list(csv.DictReader(file))
    names = [name for name in expected[0] if name in rows[0]]
    assert {"seed", "loop", "reach", "held", "bounds"} <= set(names) and len(rows) == 16
    assert [[row[name] for name in names] for row in rows] == [[row[name] for name in names] for row in expected]


def test_a_trial_of_a_sweep_that_lasts_too_long_is_a_row(stabilized, tmp_path):
    # 400 s of the closed loop in steps of 1 ms are some 0.7 s of an idle processor.
    settings = (stabilized / "settings.toml").read_text().replace('duration = "4 s"', 'duration = "400 s"')
    assert "400 s" in settings
    (tmp_path / "long.toml").write_text(settings)
    plan = f'kind = "trials"\nsystem = "{stabilized}"\ntime_limit = 0.1\n'
    rows = swept(tmp_path, plan + '[trials]\ncount = 1\nsettings = "long.toml"\n')
    assert [(row["loop"], row["status"], row["cause"]) for row in rows] == [
        ("closed", "timeout", "longer than 0.1 s"),
        ("open", "timeout", "longer than 0.1 s"),
    ]
    assert all(row["held"] == "" for row in rows)


def test_what_is_wrong_is_named_with_its_place(plan, tmp_path):
    cases = {
        "[sensors]\nthetta = 1e-3\n": ["line 2", "thetta", "theta"],
        '[sensors]\ntheta = "1 mm"\n': ["line 2, column 9", "`mm` is not a unit for `theta`"],
        "[sensors]\nu = 1\n": ["line 2", "neither a state nor an output"],
        "[sensors]\ntheta = 0\n": ["line 2, column 1", "`theta` is 0 here", "positive"],
        "sensors = 3\n": ["line 1", "a table is wanted"],
    }
    for text, expected in cases.items():
        (tmp_path / "s.toml").write_text(text)
        result = start("stabilize", plan, tmp_path / "s.toml", "-o", tmp_path / "out")
        assert result.returncode == 1
        for part in expected:
            assert part in result.stderr
        assert not (tmp_path / "out").exists()
    learned = '[sensors]\ntheta = "2 mrad"\nx = "0.2 mm"\n[nmpc]\n'
    parameter = '[[nmpc.parameter]]\nvariables = ["cart_pole.{}"]\nrelative = {}\n'
    cases = {
        learned + 'step = "1.5 ms"\n': ["line 4", "`step` of the prediction [s], in multiples of 0.001 s = 0.0015"],
        learned + "margin = 1\n": ["line 4", "below 0.5"],
        learned + parameter.format("m_x", 0.5): ["line 6", "cart_pole.m_x"],
        learned + parameter.format("m_p", 1.5): ["line 6", "would leave the range", "make the width smaller"],
    }
    for text, expected in cases.items():
        (tmp_path / "s.toml").write_text(text)
        result = start("stabilize", "--nmpc", plan, tmp_path / "s.toml", "-o", tmp_path / "out")
        assert result.returncode == 1
        for part in expected:
            assert part in result.stderr
        assert not (tmp_path / "out").exists()
    result = start("stabilize", plan / "trajectory.csv", EXAMPLE / "stabilize.toml")
    assert result.returncode == 1 and "--problem" in result.stderr
    result = start("trials", plan)
    assert result.returncode == 1 and "no closed loop" in result.stderr


def test_a_plan_is_found_with_its_problem_from_any_folder(tmp_path):
    lab = tmp_path / "lab"
    for example in (EXAMPLE, ROOT / "examples" / "01_run"):
        shutil.copytree(example, lab / "examples" / example.name)
    (lab / "target").symlink_to(ROOT / "target")
    ms = ["--transcription", "multiple-shooting", "--intervals", 100, "--no-verification", "--no-plots"]
    made = start("optimize", "examples/03_swing_up/problem.toml", *ms, "-o", "plans/first", cwd=lab)
    assert made.returncode == 0, made.stderr
    result = start("stabilize", lab / "plans" / "first", lab / "examples" / "03_swing_up" / "stabilize.toml", "-o", "out", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    # Moved away from its problem, and a folder without a plan.
    (lab / "plans" / "first").rename(tmp_path / "moved")
    for folder, words in [(tmp_path / "moved", ["examples/03_swing_up/problem.toml", "--problem FILE"]), (lab, ["no summary.json", "airloop optimize -o"])]:
        result = start("stabilize", folder, EXAMPLE / "stabilize.toml", "-o", "none", cwd=tmp_path)
        assert result.returncode == 1 and str(folder) in result.stderr, result.stderr
        assert all(word in result.stderr for word in words), result.stderr
        assert not (tmp_path / "none").exists()
