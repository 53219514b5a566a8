"""The kept solver: same optimum as the command, and what it says to wrong words."""

import gc
import re
import threading
import time

import numpy as np
import pytest

import airloop


@pytest.fixture(scope="module")
def problem(examples):
    """The swing-up of example 03, coarse."""
    content = airloop.read_toml(examples / "swing_up.toml")
    content["settings"]["intervals"] = 40
    return content


@pytest.fixture
def solver(problem, examples):
    return airloop.Solver(problem, folder=examples)


def test_the_first_motion_is_that_of_the_command(solver, problem, examples):
    # The command writes the trajectory of its last solve; the solver starts there and stays.
    plan = airloop.optimize(problem, folder=examples, no_plots=True, no_verification=True)
    assert plan.exit_code == 0
    solution = solver.solve()
    assert solution.is_solved and solution.violation < 1e-6 and solution.seconds > 0
    said = float(re.search(r"^objective (\S+),", plan.text, re.MULTILINE)[1])
    assert solution.objective == pytest.approx(said, rel=1e-8)
    motion, table = solver.motion(), plan.table("trajectory")
    assert [column.split(" [")[0] for column in table.columns] == ["time", *motion]
    assert motion.units["x"] == "m" and solver.states[:2] == ["x", "theta"] and solver.inputs == ["u"]
    # The optimum is flat along the command: its error is the root of that of the objective.
    largest = np.abs(motion["u"]).max()
    assert np.abs(motion["u"] - table["u"]).max() < 1e-3 * largest
    assert list(motion.to_pandas().columns) == list(motion)


def test_another_start_other_bounds_and_parameters(solver):
    before = solver.solve().objective
    solver.set_initial({"theta": 0.02})
    assert solver.initial[1] == 0.02
    moved = solver.solve()
    assert moved.is_solved and moved.objective != pytest.approx(before, rel=1e-4)
    assert solver.motion()["theta"][0] == pytest.approx(0.02, abs=1e-12)
    assert sorted(solver.bounds) == ["force command", "stroke"]
    solver.set_bounds({"force command": (-40, 40)})
    bounded = solver.solve()
    assert bounded.is_solved and bounded.objective >= moved.objective
    assert np.abs(solver.motion()["u"]).max() <= 40 + 1e-6
    solver.set_parameters({"cart_pole.m_p": 0.1001})
    assert solver.solve().is_solved
    motion = solver.motion()
    assert np.abs(motion["u"]).max() <= 40 + 1e-6 and motion["theta"][0] == pytest.approx(0.02, abs=1e-12)
    # The same numbers in the same order give the same bits.
    states = solver.initial
    solver.set_initial(states)
    solver.set_initial(list(states))
    assert np.array_equal(solver.initial, states)


def test_wrong_words_leave_the_solver_as_it_was(solver, problem, examples):
    before, objective = solver.initial, solver.solve().objective
    cases = [
        (lambda: solver.set_initial({"thetta": 1.0}), "there is no state `thetta`; known are: x, theta"),
        (lambda: solver.set_initial([0.0]), "1 values for 6 states"),
        (lambda: solver.set_initial({"theta": np.nan}), "`theta` = NaN is not possible: it must be finite"),
        (lambda: solver.set_bounds({"strok": (0, 1)}), "no bound `strok`; the problem has `force command`, `stroke`"),
        (lambda: solver.set_bounds({"stroke": (1, 0)}), "stroke"),
        (lambda: solver.set_parameters({"cart_pole.m_q": 1.0}), "m_q"),
        (lambda: solver.set_parameters({"cart_pole.m_p": -1.0}), "m_p"),
        (lambda: solver.shift(np.nan), "NaN"),
    ]
    for work, text in cases:
        with pytest.raises(airloop.AirloopError, match=text):
            work()
    assert np.array_equal(solver.initial, before)
    assert solver.solve().objective == pytest.approx(objective, rel=1e-8)
    with pytest.raises(airloop.SettingError, match="nothing"):
        airloop.Solver(problem | {"cost": [{"integral": "nothing"}]}, folder=examples)
    with pytest.raises(airloop.AirloopError, match="no first motion"):
        airloop.Solver(problem | {"duration": "0.1 s"}, folder=examples)


def test_threads_wait_for_each_other(solver):
    """Another thread runs while a solve does: the interpreter's lock is released."""
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-4)

    thread = threading.Thread(target=tick)
    thread.start()
    objectives = []

    def solve():
        objectives.extend(solver.solve().objective for _ in range(3))

    others = [threading.Thread(target=solve) for _ in range(4)]
    for one in others:
        one.start()
    for one in others:
        one.join()
    stop.set()
    thread.join()
    assert len(objectives) == 12 and np.ptp(objectives) <= 1e-8 * abs(objectives[0]) and ticks


def test_a_plan_of_a_dictionary_is_stabilized_and_leaves_no_file(problem, examples):
    before = sorted(examples.iterdir())
    sampled = problem | {"settings": {"transcription": "multiple-shooting", "intervals": 200, "guess": "pump"}}
    plan = airloop.optimize(sampled, folder=examples, no_plots=True, no_verification=True)
    closed = airloop.stabilize(plan, {"sensors": {"x": "0.2 mm", "theta": "0.002 rad"}}, no_plots=True)
    assert airloop.System(closed.folder / "closed_loop.ssd").run(stop=0.1).status == "completed"
    del plan, closed
    gc.collect()
    assert sorted(examples.iterdir()) == before
