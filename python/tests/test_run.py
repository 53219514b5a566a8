"""Runs: the numbers of the command line bit for bit, its texts for bad data, and what Python adds."""

import gc
import json
import os
import pickle
import signal
import threading
import time

import numpy as np
import pandas
import pytest

import airloop


def read(file):
    """A result file; the numbers are read exactly."""
    header, *rows = file.read_text().splitlines()
    return header.split(","), np.array([[float(cell) for cell in row.split(",")] for row in rows])


def same_as_command(result, folder):
    names, numbers = read(folder / "result.csv")
    assert names == ["time", *result]
    for index, name in enumerate(names):
        assert np.array_equal(numbers[:, index].view(np.uint64), result[name].view(np.uint64)), name


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi", "interface-jacobian", "monolithic"])
def test_every_master_gives_the_numbers_of_the_command_line_bit_for_bit(system, examples, command, tmp_path, master):
    record = examples / "record.csv"
    done = command("run", system.path, "--measured", record, "--stop", "1", "--master", master, "-o", "out", "--no-plots")
    assert done.returncode == 0, done.stderr
    result = system.run(measured=record, stop=1, master=master)
    same_as_command(result, tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    fits = {one["name"]: (one["fit_percent"], one["rms_error"], one["samples"]) for one in summary["signals"]}
    assert fits == {fit.name: (fit.fit_percent, fit.rms_error, fit.samples) for fit in result.fits.values()}


def test_options_mean_what_they_mean_on_the_command_line(system, examples, command, tmp_path):
    words = ["--input", "u.csv", "--interpolation", "hold", "--stop", "500ms", "--step", "2ms", "--set", "cart_pole.m_p=0.12"]
    (tmp_path / "u.csv").write_text("time [ms],u [N]\n0,1.5\n100,-2\n300,0.25\n")
    done = command("run", system.path, *words, "--extrapolation", "1", "-o", "out", "--no-plots")
    assert done.returncode == 0, done.stderr
    inputs = {"time [ms]": [0, 100, 300], "u [N]": [1.5, -2, 0.25]}
    options = {"interpolation": "hold", "stop": "500ms", "step": 0.002, "extrapolation": 1}
    same_as_command(system.run(inputs=inputs, set={"cart_pole.m_p": 0.12}, **options), tmp_path / "out")


def test_records_come_as_file_frame_index_or_dictionary(system, examples):
    file = examples / "record.csv"
    frame = pandas.read_csv(file)
    by_index = frame.set_index("time")
    by_delta = frame.set_index(pandas.to_timedelta(frame["time"], unit="s")).drop(columns="time")
    results = [system.run(measured=one, stop=0.2) for one in (file, frame, by_index, dict(frame.items()), by_delta)]
    for other in results[1:]:
        assert all(np.array_equal(results[0][name], other[name]) for name in results[0])
    assert results[0].fit(frame) == results[0].fits


def test_arrays_are_the_memory_of_the_simulation(system):
    result = system.run(stop=0.1)
    assert result["x"].base is not None and not result["x"].flags.owndata
    frame = result.to_pandas()
    assert frame.index.name == "time" and list(frame) == list(result) and frame["x"].iloc[-1] == result["x"][-1]


def test_a_result_survives_pickling_and_files(system, examples, tmp_path):
    result = system.run(measured=examples / "record.csv", stop=0.3)
    again = pickle.loads(pickle.dumps(result))
    assert all(np.array_equal(result[name], again[name]) for name in result)
    assert again.fit(examples / "record.csv") == result.fits
    result.to_csv(tmp_path / "result.csv")
    assert np.array_equal(read(tmp_path / "result.csv")[1][:, 1], result["u"])
    # A result is a record, too.
    replay = system.run(inputs={"time": result.time, "u": result["u"]}, stop=0.3, master="jacobi")
    assert replay.fit({"time": result.time, "F_hat": result["F_hat"]})["F_hat"].fit_percent > 99.9


BAD = [
    ({"inputs": {"time": [0, 1], "u": [0, np.nan]}}, airloop.RecordError, "line 3, column `u`: `NaN` is not finite"),
    ({"inputs": {"time": [0, 1], "v": [0, 1]}}, airloop.RecordError, "column `v`: no such signal; known are: u"),
    ({"inputs": {"time": [0, 0], "u": [0, 1]}}, airloop.RecordError, "0 s does not come after 0 s"),
    ({"inputs": {"u": [0, 1]}}, airloop.RecordError, "there is no column `time`; it has: u"),
    ({"inputs": {"time": [0, 1], "u": [[0, 1]]}}, airloop.RecordError, "column `u` has the shape (1, 2)"),
    ({"inputs": {"time": [0, 1], "u": ["a", "b"]}}, airloop.RecordError, "no numbers"),
    ({"inputs": {"time": [0, 1], "u": [0]}}, airloop.RecordError, "cells, but the header has 2"),
    ({"inputs": {"time": [0, 1], "u [m]": [0, 1]}}, airloop.RecordError, "its unit [m] cannot be converted to [N]"),
    ({"inputs": pandas.DataFrame({"u": [1.0]})}, airloop.RecordError, "index is a plain row number"),
    ({"inputs": pandas.DataFrame({"u": [1.0]}, index=["a"])}, airloop.RecordError, "there is no column `time`"),
    ({"inputs": 3.0}, airloop.RecordError, "not float"),
    ({"measured": {"time": [0, 1], "y": [0, 1]}}, airloop.RecordError, "is an output of the system"),
    ({"measured": "none.csv"}, airloop.RecordError, "none.csv: "),
    ({"step": -1}, airloop.SettingError, "step = -1 is not possible"),
    ({"step": "1 lightyear"}, airloop.SettingError, "the unit is none of"),
    ({"master": "none"}, airloop.SettingError, "no master `none`; known are: gauss-seidel"),
    ({"corrections": 2}, airloop.SettingError, "--corrections is an option of"),
    ({"set": {"cart_pole.mass": 1}}, airloop.SystemFileError, "there is no variable `mass`"),
    ({"set": {"cart_pole.m_p": -1}}, airloop.SystemFileError, "cannot be set to `-1`"),
    ({"set": {"cart_pole.F": 1}}, airloop.SystemFileError, "cart_pole.F"),
]


@pytest.mark.parametrize(("options", "kind", "text"), BAD, ids=[text for *_, text in BAD])
def test_bad_input_has_the_text_of_the_command_line(system, options, kind, text):
    with pytest.raises(kind) as caught:
        system.run(**{"stop": 1, **options})
    assert text in str(caught.value)


def test_a_file_that_is_no_system_is_refused(tmp_path):
    (tmp_path / "broken.fmu").write_text("no archive")
    for path in ("none.ssd", tmp_path / "record.csv", tmp_path / "broken.fmu"):
        with pytest.raises(airloop.SystemFileError, match=str(path)):
            airloop.System(path)


def test_a_failure_inside_a_run_keeps_the_result_so_far(system):
    inputs = {"time": [0.0, 0.1, 0.2], "u": [0.0, 0.0, 1e300]}
    with pytest.raises(airloop.AirloopError) as caught:
        system.run(inputs=inputs, stop=1)
    assert 0 < len(caught.value.result.time) < 1001
    assert caught.value.result.status == "failed"
    assert system.run(stop=0.1).status == "completed"


def test_ctrl_c_ends_a_run_and_the_lock_is_released_meanwhile(system):
    counted = []

    def interrupt():
        counted.extend(range(1000))
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    began = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        thread.start()
        system.run(stop=10_000, step="1ms")
    thread.join()
    assert time.perf_counter() - began < 5.0 and len(counted) == 1000


def test_progress_is_told_and_its_exceptions_come_through(system):
    told = []
    system.run(stop=200, progress=lambda done, total: told.append((done, total)))
    assert told and all(done < total == 200_000 for done, total in told)
    with pytest.raises(ZeroDivisionError):
        system.run(stop=200, progress=lambda done, total: 1 / 0)


def test_runs_in_threads_give_the_same_numbers(system):
    expected = system.run(stop=0.5, set={"u": 2.0})
    results = [None] * 4

    def work(index):
        results[index] = system.run(stop=0.5, set={"u": 2.0})

    threads = [threading.Thread(target=work, args=(index,)) for index in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(expected["x"], result["x"]) for result in results)


def test_ten_thousand_runs_do_not_grow():
    system = airloop.System("airloop:friction")

    def resident():
        gc.collect()
        with open("/proc/self/statm") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    if not os.path.exists("/proc/self/statm"):
        pytest.skip("the memory of the process is read from /proc")
    for _ in range(1000):
        system.run(stop=0.002, step=0.001)
    before = resident()
    for _ in range(9000):
        system.run(stop=0.002, step=0.001)
    assert resident() - before < 4e6
