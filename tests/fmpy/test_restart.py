"""`airloop run --restart-from`: a run that goes on from saved states is the unbroken run, bit for bit."""

import json
import os
import shutil
import signal
import subprocess
import time

import pytest

from command import BINARY, ROOT, start
from test_loops import system_of

STOP = "2"
MASTERS = ["gauss-seidel", "jacobi", "interface-jacobian"]
EXAMPLE = "examples/01_run/system.ssd"
FMI3 = sorted((ROOT / "target/fmu/test/fmi3").glob("*.fmu"))  # all types, events, a copy; the models are coupled below


def run(system, out, *options, code=0):
    outcome = start("run", system, *options, "--no-plots", "-q", "-o", out)
    assert outcome.returncode == code, outcome.stderr
    return outcome.stderr


def result(folder):
    return (folder / "result.csv").read_bytes()


def killed_while_it_saves(system, out, *options):
    """A run that is killed by the system after it saved states inside of the time span; the time of the last."""
    command = [BINARY, "run", system, "--no-plots", "-q", "-o", out, "--save-states", "1us", *options]
    environment = {"AIRLOOP_FMUS": str(ROOT / "target" / "fmu"), **os.environ}
    states, kept = out / "result.partial.states.json", out.with_name(out.name + "-kept")
    before = json.loads(states.read_text())["time"] if states.exists() else 0.0
    shutil.rmtree(kept, ignore_errors=True)
    if out.exists():
        shutil.copytree(out, kept)
    # On a busy computer a run may be through before it is killed; then once more from the same folder.
    for _ in range(10):
        process, began = subprocess.Popen([*map(str, command)], cwd=ROOT, env=environment), time.monotonic()
        at = before
        while at == before and process.poll() is None and time.monotonic() - began < 60:
            at = json.loads(states.read_text())["time"] if states.exists() else before
        process.send_signal(signal.SIGKILL)
        if process.wait() == -signal.SIGKILL:
            break
        shutil.rmtree(out)
        if kept.exists():
            shutil.copytree(kept, out)
    else:
        raise AssertionError("the run was through before it could be killed")
    return json.loads(states.read_text())["time"]


def check(system, tmp_path, *options):
    """The unbroken run is that which was killed and goes on, in another folder and its own."""
    options = ["--stop", STOP, *options]
    unbroken, killed, other = (tmp_path / name for name in ("unbroken", "killed", "other"))
    run(system, unbroken, *options)
    assert 0 < killed_while_it_saves(system, killed, *options) < float(STOP)
    assert len((killed / "result.partial.csv").read_bytes()) < len(result(unbroken))
    run(system, other, "--restart-from", killed, *options)
    assert result(other) == result(unbroken)
    run(system, killed, "--restart-from", killed, *options)
    assert result(killed) == result(unbroken)
    assert sorted(path.name for path in killed.iterdir()) == ["result.csv", "summary.json"]
    return json.loads((other / "summary.json").read_text())


def test_every_fmu_goes_on(fmu, tmp_path):
    interface = fmu.xml.find("CoSimulation")
    if interface is None:
        pytest.skip("no Co-Simulation")
    options = ["--step", "1ms"]
    if interface.get("canSerializeFMUstate") != "true":
        message = run(fmu.path, tmp_path / "out", "--stop", STOP, "--save-states", "1s", *options, code=1)
        assert "cannot save its state" in message
        assert not (tmp_path / "out").exists()
        return
    summary = check(fmu.path, tmp_path, *options)
    assert summary["outcome"]["steps"] == 2000
    assert any("continued at t = " in note for note in summary["fallbacks"])


@pytest.mark.parametrize("path", FMI3, ids=lambda path: path.stem)
def test_fmus_of_fmi_3_go_on(path, tmp_path):
    summary = check(path, tmp_path, "--step", "1ms")
    assert summary["outcome"]["steps"] == 2000


@pytest.mark.parametrize("isolate", [[], ["--isolate"]], ids=["direct", "isolated"])
@pytest.mark.parametrize("master", MASTERS)
def test_coupled_components_of_fmi_3_go_on(tmp_path, master, isolate):
    system = tmp_path / "system.ssd"
    text = (ROOT / EXAMPLE).read_text().replace("../../target/fmu/", f"{ROOT}/target/fmu/fmi3/")
    system.write_text(text)
    for beside in (ROOT / EXAMPLE).parent.glob("*.ssv"):
        shutil.copy(beside, tmp_path)
    check(system, tmp_path, "--master", master, "--set", "cart_pole.theta=0.3", *isolate)


@pytest.mark.parametrize("master", MASTERS)
def test_coupled_components_go_on(tmp_path, master):
    check(EXAMPLE, tmp_path, "--master", master, "--set", "cart_pole.theta=0.3")


@pytest.mark.parametrize("options", [["--extrapolation", "2"], ["--output-step", "7ms"], ["--isolate"], ["--corrections", "2", "--master", "interface-jacobian"]])
def test_options_go_on(tmp_path, options):
    check(EXAMPLE, tmp_path, "--set", "cart_pole.theta=0.3", *options)


@pytest.mark.parametrize("master", MASTERS)
def test_algebraic_loops_go_on(tmp_path, master):
    """The solution of a loop at one point is the guess of the next: it is a part of the state."""
    links = [("a.f", "b.v", 0.01, 0.02), ("b.f", "a.v", -0.02, 0.1)]
    system = system_of(tmp_path, {"a": "friction.fmu", "b": "friction.fmu"}, links)
    check(system, tmp_path, "--master", master)


def test_a_killed_run_goes_on_again_and_again(tmp_path):
    options = ["--stop", "20", "--set", "cart_pole.theta=0.3"]
    run(EXAMPLE, tmp_path / "unbroken", *options)
    out = tmp_path / "killed"
    at = killed_while_it_saves(EXAMPLE, out, *options)
    for _ in range(3):
        before = at
        at = killed_while_it_saves(EXAMPLE, out, *options, "--restart-from", out)
        assert at > before
    run(EXAMPLE, out, *options, "--restart-from", out)
    assert result(out) == result(tmp_path / "unbroken")


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The folder of a run over 2 s that was interrupted by the user."""
    folder = tmp_path_factory.mktemp("saved") / "run"
    killed_while_it_saves(EXAMPLE, folder, "--stop", STOP)
    for name in ("csv", "states.json"):
        (folder / f"result.partial.{name}").rename(folder / f"result.{name}")
    return folder


def test_ctrl_c_saves_the_last_point(tmp_path):
    options = ["run", EXAMPLE, "--stop", "200", "--no-plots", "-q", "-o", tmp_path / "out", "--save-states", "60s"]
    environment = {"AIRLOOP_FMUS": str(ROOT / "target" / "fmu"), **os.environ}
    process = subprocess.Popen([BINARY, *map(str, options)], cwd=ROOT, env=environment, stderr=subprocess.DEVNULL)
    while process.poll() is None and not (tmp_path / "out" / "result.partial.states.json").exists():
        time.sleep(0.01)
    time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert process.wait() == 130
    outcome = json.loads((tmp_path / "out" / "summary.json").read_text())["outcome"]
    states = json.loads((tmp_path / "out" / "result.states.json").read_text())
    assert outcome["status"] == "interrupted" and states["time"] == pytest.approx(outcome["end_time"], rel=1e-15)
    assert 0 < states["steps"] == outcome["steps"]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--step", "2ms"], "--step was `0.001` where the states were saved and is `0.002` now"),
        (["--master", "jacobi"], "--master was `gauss-seidel`"),
        (["--set", "cart_pole.m_p=0.2"], "the start value of `cart_pole.m_p` was"),
        (["--stop", "3"], "--stop was `2` where the states were saved and is `3` now"),
        (["--output-step", "10ms"], "--output-step was `none`"),
        (["--adaptive"], "without --adaptive"),
        (["--master", "monolithic"], "--master was"),
    ],
)
def test_another_run_is_refused_by_name(saved, tmp_path, options, expected):
    words = options if "--stop" in options else ["--stop", STOP, *options]
    message = run(EXAMPLE, tmp_path / "out", *words, "--restart-from", saved, code=1)
    assert expected in message
    assert not (tmp_path / "out").exists()


def test_other_systems_folders_and_files_are_refused(saved, shipped, tmp_path):
    def refused(path, system=EXAMPLE):
        message = run(system, tmp_path / "out", "--stop", STOP, "--restart-from", path, code=1)
        assert not (tmp_path / "out").exists()
        return message

    assert "no states were saved there" in refused(tmp_path)
    run(EXAMPLE, tmp_path / "whole", "--stop", "0.1", "--save-states", "10ms")
    assert "this run is complete: it reached its stop time, 0.1 s" in refused(tmp_path / "whole")
    assert "No such file" in refused(tmp_path / "none")
    assert "these are no saved states" in refused(ROOT / "examples/01_run/expected.json")
    assert "where the states were saved" in refused(saved, shipped("cart-pole").path)
    for damage, expected in [
        (lambda states: states.update(states_version=99), "the saved states have version 99"),
        (lambda states: states.update(master="00"), "the saved states are damaged"),
        (lambda states: states["components"].pop(), "the saved states are damaged"),
        (lambda states: states["components"][0].update(state="0"), "the saved state of component"),
        (lambda states: states["components"][0].update(state="00"), "fmi2DeSerializeFMUstate"),
    ]:
        states = json.loads((saved / "result.states.json").read_text())
        damage(states)
        (tmp_path / "result.states.json").write_text(json.dumps(states))
        assert expected in refused(tmp_path / "result.states.json")
    # Rows that were cut, and rows of something else.
    shutil.copy(saved / "result.states.json", tmp_path)
    rows = (saved / "result.csv").read_text().splitlines(keepends=True)
    (tmp_path / "result.csv").write_text("".join(rows[:10]) + rows[10][:5])
    assert "9 whole rows are there, but " in refused(tmp_path)
    (tmp_path / "result.csv").write_text("".join(["time,other\n", *rows[1:]]))
    assert "the columns of the rows so far are not those of this run" in refused(tmp_path)


def test_states_alone_begin_a_result_there(saved, tmp_path):
    shutil.copy(saved / "result.states.json", tmp_path)
    run(EXAMPLE, tmp_path / "out", "--stop", STOP, "--restart-from", tmp_path / "result.states.json")
    states = json.loads((saved / "result.states.json").read_text())
    rows = (tmp_path / "out" / "result.csv").read_text().splitlines()
    assert float(rows[1].split(",")[0]) == pytest.approx(states["time"], rel=1e-15)
    assert len(rows) == 1 + 2001 - states["steps"]


def test_a_run_without_saving_removes_states_of_a_killed_one(tmp_path):
    out = tmp_path / "out"
    killed_while_it_saves(EXAMPLE, out, "--stop", STOP)
    run(EXAMPLE, out, "--stop", "0.05")
    assert sorted(path.name for path in out.iterdir()) == ["result.csv", "summary.json"]
