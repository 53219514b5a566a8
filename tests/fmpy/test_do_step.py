"""fmi2DoStep: what it refuses, what it reports, and that the result does not hang on the step size."""

import ctypes
import math

import pytest

import raw
import scenario

REFUSED = (raw.DISCARD, raw.ERROR)


@pytest.mark.parametrize(
    "time, step",
    [(0.5, 1.0), (-0.5, 1.0), (math.nan, 1.0), (math.inf, 1.0)],
    ids=["ahead", "behind", "nan", "inf"],
)
def test_a_wrong_communication_point_is_refused(fmu, time, step):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        before = raw.bits(instance.get(fmu.readable))
        h = fmu.step_size * step
        assert instance.do_step(time, h) in REFUSED
        assert any("fmi2DoStep" in text for _, _, _, text in instance.messages), instance.messages
        assert raw.bits(instance.get(fmu.readable)) == before


@pytest.mark.parametrize("step", [0.0, -1e-3, math.nan, math.inf], ids=str)
def test_a_step_that_is_not_positive_is_refused(fmu, step):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        assert instance.do_step(0.0, step) in REFUSED
        assert any("fmi2DoStep" in text for _, _, _, text in instance.messages), instance.messages


def test_a_step_past_the_stop_time_is_refused(fmu):
    h = fmu.step_size
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance, stop=2 * h)
        instance.must("DoStep", 0.0, h, 0)
        assert instance.do_step(h, 1.5 * h) in REFUSED
        assert any("stop" in text.lower() for _, _, _, text in instance.messages), instance.messages
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance, stop=2 * h)
        instance.must("DoStep", 0.0, h, 0)
        instance.must("DoStep", h, h, 0)


def test_last_successful_time_follows_the_steps(fmu):
    h = fmu.step_size
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        for k in range(3):
            instance.must("DoStep", k * h, h, 0)
            assert instance.real_status() == pytest.approx((k + 1) * h, abs=1e-12)
            assert instance.boolean_status() is False


def test_rounding_in_the_communication_point_is_tolerated(fmu):
    """A master that adds up its steps is off by some 1e-13."""
    h = fmu.step_size
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        time = 0.0
        for k in range(30):
            instance.must("DoStep", time * (1 + 3e-16) if k % 2 else k * h, h, 0)
            time += h


def constant_inputs_run(fmu, steps):
    """All numeric variables after a list of steps under constant inputs."""
    numeric = [v for v in fmu.readable if v.is_real and v.variability != "discrete"]
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        tighten(instance)
        scenario.start(instance, tolerance=1e-10)
        time = 0.0
        for h in steps:
            instance.must("DoStep", time, h, 0)
            time += h
        return numeric, instance.get(numeric)


def tighten(instance):
    """Smaller inner steps, where the FMU has an inner integrator of ours."""
    for v in instance.fmu.of("parameter"):
        if v.name == "solver.max_step":
            instance.set([v], [1e-4])


def assert_close(numeric, one, other, relative=1e-6):
    for v, a, b in zip(numeric, one, other):
        scale = max(abs(a), abs(b), v.number("nominal") or 1e-3)
        assert abs(a - b) <= relative * scale, f"{v.name}: {a!r} and {b!r}"


def test_half_the_step_gives_the_same_trajectory(fmu):
    h = fmu.step_size
    numeric, whole = constant_inputs_run(fmu, [h] * 20)
    _, half = constant_inputs_run(fmu, [h / 2] * 40)
    assert_close(numeric, whole, half)


def test_the_step_may_vary_from_one_to_the_next(fmu):
    if not fmu.flag(raw.CO_SIMULATION, "canHandleVariableCommunicationStepSize"):
        pytest.skip("does not declare it")
    h = fmu.step_size
    numeric, even = constant_inputs_run(fmu, [h] * 12)
    # Not multiples of a sample time, and much longer and much shorter than it.
    _, uneven = constant_inputs_run(fmu, [0.37 * h, 1.63 * h, 0.01 * h, 2.99 * h, 4.5 * h, 2.5 * h])
    assert_close(numeric, even, uneven)


def test_both_values_of_no_set_fmu_state_prior_give_the_same_run(fmu):
    rows = []
    for flag in (False, True):
        with fmu.instantiate(raw.CO_SIMULATION) as instance:
            scenario.start(instance)
            for k in range(10):
                scenario.set_inputs(instance, k * fmu.step_size)
                assert instance.do_step(k * fmu.step_size, fmu.step_size, flag) == raw.OK
            rows.append(raw.bits(instance.get(fmu.readable)))
    assert rows[0] == rows[1]


@pytest.mark.parametrize("bad", [math.nan, math.inf], ids=["nan", "inf"])
def test_a_non_finite_input_during_a_run_changes_nothing(fmu, bad):
    inputs = [v for v in fmu.of("input") if v.is_real]
    if not inputs:
        pytest.skip("no Real input")
    h, rows = fmu.step_size, []
    for spoil in (False, True):
        with fmu.instantiate(raw.CO_SIMULATION) as instance:
            scenario.start(instance)
            for k in range(5):
                scenario.set_inputs(instance, k * h)
                if spoil:
                    for v in inputs:
                        assert instance.try_set(v, bad) == raw.DISCARD
                instance.must("DoStep", k * h, h, 0)
            rows.append(raw.bits(instance.get(fmu.readable)))
    assert rows[0] == rows[1]


def test_step_is_not_asynchronous(fmu):
    """The status functions of a slave that always finishes its step at once."""
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        instance.must("DoStep", 0.0, fmu.step_size, 0)
        assert instance.call("CancelStep") == raw.ERROR
    for name, buffer in (("GetStatus", ctypes.c_int()), ("GetStringStatus", ctypes.c_char_p())):
        with fmu.instantiate(raw.CO_SIMULATION) as instance:
            scenario.start(instance)
            instance.must("DoStep", 0.0, fmu.step_size, 0)
            assert instance.call(name, 0, ctypes.byref(buffer)) in (raw.OK, *REFUSED)
