"""Step by step: the numbers of a run, one instance or many, and what happens to wrong calls."""

import threading

import numpy as np
import pandas
import pytest

import airloop


def test_steps_give_the_numbers_of_a_run_bit_for_bit(system, examples):
    record = pandas.read_csv(examples / "record.csv")
    time, u = record["time"].to_numpy(), record["u"].to_numpy()
    run = system.run(inputs={"time": time, "u": u}, stop=0.5, step="1ms")
    names = ["F_p", "x", "theta", "cart_pole.x"]
    with system.instantiate(step="1ms") as sim:
        rows = []
        for k in range(500):
            sim.set(u=u[k])
            sim.step()
            rows.append([sim.get(name) for name in names])
            assert sim.time == run.time[k + 1]
    for column, name in enumerate(names):
        assert np.array_equal([row[column] for row in rows], run[name][1:]), name


def test_other_step_sizes_and_many_steps_in_one_call(system):
    with system.instantiate(step="1ms", set={"u": 1.0}) as sim, system.instantiate(set={"u": 1.0}) as other:
        assert sim.step(count=100) == pytest.approx(0.1, abs=1e-15)
        assert sim.step(0.002, count=5) == pytest.approx(0.11, abs=1e-15)
        for _ in range(100):
            other.step(0.001)
        for _ in range(5):
            other.step(0.002)
        assert other.get("x") == sim.get("x")


def test_a_state_can_be_saved_and_restored(system):
    with system.instantiate(step="1ms", set={"u": 1.0}) as sim:
        sim.step(count=50)
        saved = sim.save()
        sim.step(count=50)
        after = (sim.time, sim.get("x"))
        sim.restore(saved)
        assert sim.time == saved[0]
        sim.step(count=50)
        assert (sim.time, sim.get("x")) == (pytest.approx(after[0]), after[1])
        with pytest.raises(airloop.SettingError, match="save"):
            sim.restore((0.0, b"nothing"))


def test_wrong_calls_are_exceptions_and_the_simulation_goes_on(system):
    with system.instantiate(step="1ms") as sim:
        for values, text in [({"v": 1.0}, "known are: u"), ({"u": float("nan")}, "finite")]:
            with pytest.raises(airloop.SettingError, match=text):
                sim.set(**values)
        with pytest.raises(airloop.SettingError, match="no value `y`"):
            sim.get("y")
        for step in (0.0, -1.0, float("nan")):
            with pytest.raises(airloop.SettingError, match="step = "):
                sim.step(step)
        with pytest.raises(TypeError):
            sim.set(u="text")
        sim.step()
        assert sim.time == 0.001 and not sim.closed
    assert sim.closed
    for call in (sim.step, lambda: sim.get("x"), lambda: sim.set(u=1.0), lambda: sim.time, sim.save):
        with pytest.raises(airloop.ClosedError, match="closed"):
            call()
    sim.close()


def test_the_stop_time_is_the_end(system):
    with system.instantiate(step="1ms", stop=0.002) as sim:
        sim.step(count=2)
        with pytest.raises(airloop.ClosedError, match="stop time"):
            sim.step()


def test_an_fmu_that_fails_leaves_an_exception_behind(system):
    with system.instantiate(step="1ms") as sim, pytest.raises(airloop.AirloopError):
        sim.set(u=1e300)
        sim.step(count=1000)
    with system.instantiate(step="1ms", batch=4) as batch, pytest.raises(airloop.AirloopError, match="instance 2: "):
        batch.set(u=[0.0, 0.0, 1e300, 0.0])
        batch.step(count=1000)


def test_a_batch_has_the_numbers_of_single_instances(system):
    u = np.linspace(-2, 2, 5)
    with system.instantiate(step="1ms", batch=5, threads=3) as batch:
        batch.set(u=u)
        batch.step(count=200)
        x, both = batch.get("x"), batch.get("x", "theta")
        assert both.shape == (5, 2) and np.array_equal(both[:, 0], x) and batch.size == 5 and batch.threads == 3
        assert np.all(batch.time == 0.2) and not batch.ended.any()
        table = batch.rollout({"u": u}, steps=100, read=["x"])["x"]
        assert table.shape == (101, 5) and np.array_equal(table[0], x) and np.array_equal(table[-1], batch.get("x"))
    for index, value in enumerate(u):
        with system.instantiate(step="1ms") as sim:
            sim.set(u=value)
            sim.step(count=200)
            assert sim.get("x") == x[index]
            sim.step(count=100)
            assert sim.get("x") == table[-1][index]


def test_wrong_shapes_in_a_batch_are_named(system):
    with pytest.raises(airloop.SettingError, match="at least 1"):
        system.instantiate(batch=0)
    with system.instantiate(batch=3) as batch:
        for values in ([1.0, 2.0], [[1.0, 2.0, 3.0]]):
            with pytest.raises(airloop.SettingError, match="`u` has"):
                batch.set(u=values)
        with pytest.raises(airloop.SettingError, match=r"it must be \(4, 3\)"):
            batch.rollout({"u": np.ones((2, 3))}, steps=4, read=["x"])
    with pytest.raises(airloop.ClosedError, match="closed"):
        batch.step()


def test_one_simulation_may_be_used_by_several_threads(system):
    with system.instantiate(step="1ms", set={"u": 1.0}) as sim, system.instantiate(step="1ms", set={"u": 1.0}) as alone:
        threads = [threading.Thread(target=lambda: sim.step(count=500)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        alone.step(count=2000)
        assert sim.get("x") == alone.get("x")


def test_instances_of_a_batch_are_saved_restored_and_begin_again(system):
    u = np.array([-1.0, 0.5, 2.0])
    with system.instantiate(step="1ms", batch=3, threads=2) as batch:
        batch.set(u=u)
        begin = batch.get("x", "theta")
        batch.step(count=50)
        saved, then = batch.save(), batch.get("x", "theta")
        batch.step(count=50)
        later = batch.get("x", "theta")
        # One alone, then all; a state of one instance is put into another one.
        batch.restore(saved[1:2], where=1)
        assert np.array_equal(batch.get("x", "theta")[1], then[1]) and np.array_equal(batch.get("x")[[0, 2]], later[[0, 2], 0])
        batch.restore(saved)
        assert np.array_equal(batch.get("x", "theta"), then) and np.all(batch.time == 0.05)
        batch.step(count=50)
        assert np.array_equal(batch.get("x", "theta"), later)
        batch.restore(batch.save(where=[0]), where=[2])
        assert batch.get("x")[2] == later[0, 0]
        # An episode that is over begins again; the others go on.
        batch.reset(where=np.array([False, True, False]))
        assert np.array_equal(batch.get("x", "theta")[1], begin[1]) and batch.time.tolist() == [0.1, 0.0, 0.1]
        batch.set(u=u)
        batch.step(count=100)
        assert np.array_equal(batch.get("x", "theta")[1], later[1])
        batch.reset(set={"cart_pole.theta": [0.1, 0.2, 0.3], "cart_pole.m_c": 1.5})
        assert batch.get("theta").tolist() == [0.1, 0.2, 0.3] and np.all(batch.get("cart_pole.m_c") == 1.5)
        batch.reset(where=[])
        for wrong, text in [({"where": [3]}, "3 instances"), ({"set": {"cart_pole.theta": [1.0, 2.0]}}, "shape")]:
            with pytest.raises(airloop.SettingError, match=text):
                batch.reset(**wrong)
        with pytest.raises(airloop.SystemFileError, match="there is no variable `no`"):
            batch.reset(set={"no": 1.0})
        with pytest.raises(airloop.SettingError, match="2 states are given for 3"):
            batch.restore(saved[:2])
        with pytest.raises(airloop.SettingError, match="save"):
            batch.restore([(0.0, b"nothing")], where=0)
        assert batch.get("theta").tolist() == [0.1, 0.2, 0.3]


def test_one_instance_begins_again(system):
    with system.instantiate(step="1ms", set={"cart_pole.m_c": 1.5}) as sim:
        sim.set(u=1.0)
        sim.step(count=50)
        x = sim.get("x")
        sim.reset()
        assert sim.time == 0.0 and sim.get("cart_pole.m_c") == 1.5
        sim.set(u=1.0)
        sim.step(count=50)
        assert sim.get("x") == x
        sim.reset({"cart_pole.theta": 0.25})
        assert sim.get("theta") == 0.25
        with pytest.raises(airloop.SystemFileError, match="there is no variable `none`"):
            sim.reset({"cart_pole.none": 1.0})
        sim.step()
    with pytest.raises(airloop.ClosedError, match="closed"):
        sim.reset()
