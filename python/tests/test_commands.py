"""Commands that write folders, through Python: same files, answers as objects, texts of failures."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np
import pandas
import pytest

import airloop
from pendulum import study as pendulum_study
from airloop import program


@pytest.fixture(scope="module")
def actuator():
    """A record of y(k) = 0.9 y(k-1) + 0.2 u(k-1), and its columns."""
    random = np.random.default_rng(1)
    u = np.repeat(random.normal(size=40), 10)
    y = np.zeros_like(u)
    for k in range(1, len(u)):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1]
    return {"time": 0.01 * np.arange(len(u)), "u": u, "y": y}


def test_arx_finds_the_coefficients_of_noise_free_data(actuator, tmp_path):
    model = airloop.identify.arx(actuator, ["u"], ["y"], na=1, nb=1, nk=1, no_plots=True, output=tmp_path / "arx")
    text = (tmp_path / "arx" / "model.toml").read_text()
    numbers = airloop.identify.arx(pandas.DataFrame(actuator), ["u"], ["y"], na=1, nb=1, nk=1, no_plots=True)
    assert (numbers.folder / "model.toml").read_text() == text
    assert model.model and model.summary
    found = list(_numbers(model.model))
    assert any(abs(abs(one) - 0.9) < 1e-9 for one in found) and any(abs(one - 0.2) < 1e-9 for one in found), found


def _numbers(value):
    if isinstance(value, dict):
        for one in value.values():
            yield from _numbers(one)
    elif isinstance(value, list):
        for one in value:
            yield from _numbers(one)
    elif isinstance(value, float):
        yield value


def test_state_space_and_comparison_run_on_frames(actuator):
    options = {"validate": actuator, "no_plots": True}
    found = airloop.identify.state_space(actuator, ["u"], ["y"], order=1, **options)
    assert found.summary and found.model
    table = airloop.identify.compare(actuator, ["u"], ["y"], arx="1..2", state_space="1..2", **options).table("compare")
    assert len(table) == 4


def test_friction_is_found_and_written_as_fmu():
    time_s = np.arange(0, 4, 0.002)
    v = 0.3 * np.sin(2 * np.pi * time_s)
    record = {"time": time_s, "v": v, "F": 2.0 * np.tanh(200 * v) + 5.0 * v}
    found = airloop.identify.friction(record, "F", velocity="v", no_plots=True, no_smoothing=True, fmu="cart")
    assert found.fmu is not None and airloop.Fmu(found.fmu).check(run=False) == []
    assert any(abs(one - 5.0) < 0.05 for one in _numbers(found.model))


def test_excite_gives_a_command_that_a_run_takes(system):
    command = airloop.excite("multisine", band="1..10Hz", amplitude=2, duration="1s")
    assert list(command) == ["time", "u [N]"] and np.abs(command["u [N]"]).max() == pytest.approx(2.0)
    assert system.run(inputs=command).status == "completed"


def test_wrong_words_and_failures_have_the_text_of_the_program(actuator, tmp_path):
    with pytest.raises(airloop.SettingError, match="--no-such-option"):
        airloop.identify.arx(actuator, ["u"], ["y"], no_such_option=1)
    with pytest.raises(airloop.CommandError, match="there is no column `z`") as caught:
        airloop.identify.arx(actuator, ["z"], ["y"])
    assert caught.value.exit_code == 1
    with pytest.raises(airloop.CommandError, match="none.toml"):
        airloop.refine(tmp_path / "none.toml")
    with pytest.raises(airloop.RecordError, match="validation 1: line 2, column `y`: `NaN`"):
        airloop.identify.arx(actuator, ["u"], ["y"], validate={"time": [0.0], "u": [1.0], "y": [np.nan]})


def test_a_study_as_dictionary_finds_the_effect_and_leaves_no_file(tmp_path):
    """A pendulum with dry friction, integrated by SciPy; the declared model has none."""
    from scipy.integrate import solve_ivp

    t = np.arange(0, 6, 0.01)
    pendulum = airloop.System("airloop:pendulum")
    rhs = pendulum.rhs(set={"m": 0.15, "l": 0.15})
    zero = [0.0] * len(rhs.inputs)
    lever = rhs.jac(0.0, [0.0, 0.0], zero)[1][1, 0]

    def true(_, x):
        value = rhs(0.0, x, zero)
        return [value[0], value[1] - lever * 0.002 * np.tanh(x[1] / 0.05)]

    noise = np.random.default_rng(2)
    files = {}
    for name, angle in (("a", 1.2), ("b", 0.8), ("c", 1.0)):
        x = solve_ivp(true, (0, 6), [angle, 0.0], t_eval=t, rtol=1e-9, atol=1e-10).y[0]
        files[name] = {"time": t, "angle": x + 1e-4 * noise.normal(size=len(t))}
        pandas.DataFrame(files[name]).to_csv(tmp_path / f"{name}.csv", index=False)
    study = pendulum_study({"m": 0.15, "l": 0.15})
    before = sorted(os.listdir(tmp_path))
    report = airloop.refine(study, folder=tmp_path)
    assert sorted(os.listdir(tmp_path)) == before
    assert report.verdict == "effect" and report.selected == ["pole.coulomb"], report
    row = report.effects.query("selected").iloc[0]
    assert row["low"] < row["value"] < row["high"] and abs(row["value"] - 0.002) < 2e-4
    assert "<html" in report.html.lower() and report._repr_html_().startswith("<iframe")
    assert report.system is not None and report.system.inputs
    kept = report.save(tmp_path / "kept")
    assert airloop.Report.read(kept).selected == report.selected


def test_ctrl_c_ends_a_command_and_its_process(examples, tmp_path):
    threading.Thread(target=lambda: (time.sleep(1.0), os.kill(os.getpid(), signal.SIGINT))).start()
    began = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        airloop.refine(examples / "study.toml", output=tmp_path / "out")
    assert time.perf_counter() - began < 15


def test_the_console_script_is_the_program(tmp_path):
    for command in ([sys.executable, "-m", "airloop"], [os.path.join(os.path.dirname(sys.executable), "airloop")]):
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, cwd=tmp_path)
        assert done.stdout == f"airloop {airloop.__version__}\n", done
        wrong = subprocess.run([*command, "run"], capture_output=True, text=True, cwd=tmp_path)
        assert wrong.returncode == 2
        derived = subprocess.run(
            [*command, "derive", "friction", "--name", "own", "-o", "own.fmu"], capture_output=True, text=True, cwd=tmp_path
        )
        assert derived.returncode == 0, derived.stderr


def test_an_fmu_is_shown_and_checked(tmp_path):
    fmu = airloop.Fmu("airloop:cart-pole")
    assert fmu.name and any(one["name"] == "theta" for one in fmu.variables)
    assert fmu.check() == []
    with pytest.raises(airloop.CommandError, match="none.fmu"):
        airloop.Fmu(tmp_path / "none.fmu")


def test_import_is_fast_and_needs_no_numpy():
    code = "import sys, airloop; airloop.__version__; print('numpy' in sys.modules)"
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tempfile.gettempdir())
    assert done.stdout == "False\n" and time.perf_counter() - began < 1.0


def test_the_program_of_the_environment_wins(monkeypatch):
    monkeypatch.setenv("AIRLOOP", "/no/such/program")
    assert program.path() == "/no/such/program"


def test_a_new_study_is_written_from_columns_and_can_be_searched(tmp_path, command, examples):
    swing = examples / "swing.csv"
    file = airloop.new_study(tmp_path / "one", swing, system="airloop:pendulum", signals={"theta": "angle"})
    text = file.read_text()
    assert 'theta = { column = "angle", unit = "rad" }' in text and 'omega = { derivative_of = "angle"' in text
    assert (tmp_path / "one" / "swing.csv").read_text() == swing.read_text() and text.count("[[segment]]") == 2
    planned = command("refine", "--plan", tmp_path / "one")
    assert planned.returncode == 0 and "tau_ext" in planned.stdout, planned.stderr
    frame = pandas.read_csv(swing).rename(columns={"angle": "theta [deg]"})
    frame["theta [deg]"] = np.degrees(frame["theta [deg]"])
    second = airloop.new_study(tmp_path / "two", [frame, frame], system=airloop.Fmu("airloop:pendulum").path)
    assert 'theta = { column = "theta" }' in second.read_text()
    assert command("refine", "--plan", tmp_path / "two").returncode == 0
    bad = [
        ({"system": "airloop:pendulum"}, "none of its columns (angle) is an output of the system"),
        ({"system": "airloop:pendulum", "signals": {"phi": "angle"}}, "no input or output `phi`; it has:"),
        ({"system": "airloop:pendulum", "signals": {"theta": "x"}}, "has no column `x`; it has: angle"),
        ({"system": "airloop:none"}, "none.fmu"),
    ]
    for options, expected in bad:
        with pytest.raises(airloop.CommandError, match="(?s)" + expected.replace("(", r"\(").replace(")", r"\)")):
            airloop.new_study(tmp_path / "bad", swing, **options)
    assert not (tmp_path / "bad").exists()
    with pytest.raises(airloop.CommandError, match="is there already"):
        airloop.new_study(tmp_path / "one", swing, system="airloop:pendulum", signals={"theta": "angle"})


def test_commands_and_choices_are_logged(actuator, caplog, tmp_path, examples):
    caplog.set_level("DEBUG", logger="airloop")
    airloop.identify.arx(actuator, ["u"], ["y"], na=1, nb=1, no_plots=True, output=tmp_path / "arx")
    commands = [record.getMessage() for record in caplog.records if record.levelname == "DEBUG"]
    assert any("identify arx" in command for command in commands)
    result = airloop.System(str(examples / "system.ssd")).run(stop="10ms", step="1ms")
    told = [record.getMessage() for record in caplog.records if record.levelname == "INFO"]
    assert [any(note in line for line in told) for note in result.notes] == [True] * len(result.notes)


def test_notes_of_commands_are_of_level_info(caplog):
    from airloop import _log

    caplog.set_level("INFO", logger="airloop")
    _log.lines("found\nnote: one\nwarning: two\n")
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [("INFO", "one"), ("WARNING", "two")]


def test_a_new_study_says_what_is_missing_in_it(actuator, tmp_path, caplog):
    record = {"time": actuator["time"], "x": actuator["y"], "force": actuator["u"]}
    with caplog.at_level("INFO", logger="airloop"):
        airloop.new_study(tmp_path / "undriven", record, system="airloop:rigid-mass")
    assert "no input of the system has a column (F, F_ext), so nothing drives it" in caplog.text
    caplog.clear()
    with caplog.at_level("INFO", logger="airloop"):
        airloop.new_study(tmp_path / "driven", record, system="airloop:rigid-mass", signals={"F": "force"})
    assert "nothing drives it" not in caplog.text
