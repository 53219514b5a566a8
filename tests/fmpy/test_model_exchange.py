"""Model Exchange: events, time events, continuous states, and agreement with Co-Simulation."""

import ctypes

import pytest

import raw
import scenario


def test_event_iteration_converges_and_next_event_time_lies_ahead(fmu):
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        scenario.start(instance)
        info, rounds = instance.update_discrete_states()
        assert rounds <= 10
        assert not info.terminateSimulation
        assert not info.nextEventTimeDefined or info.nextEventTime > 0.0


def test_states_and_nominals_can_be_read_and_states_set(fmu):
    if not fmu.states:
        pytest.skip("no continuous states")
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        scenario.enter_model_exchange(instance)
        assert raw.bits(instance.states()) == raw.bits(instance.get(fmu.states))
        assert all(x > 0 for x in instance.nominals())
        declared = [v.number("nominal") or 1.0 for v in fmu.states]
        assert instance.nominals() == declared
        wanted = [0.1 * (i + 1) for i in range(len(fmu.states))]
        instance.set_states(wanted)
        assert instance.states() == wanted
        assert instance.get(fmu.states) == wanted
        assert raw.bits(instance.derivatives()) == raw.bits(instance.get(fmu.derivatives))


def test_a_vector_of_the_wrong_length_is_refused(fmu):
    n = len(fmu.states)
    calls = ["SetContinuousStates", "GetContinuousStates", "GetDerivatives", "GetNominalsOfContinuousStates"]
    for call in calls:
        with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
            scenario.enter_model_exchange(instance)
            assert instance.call(call, (ctypes.c_double * (n + 1))(), n + 1) == raw.ERROR, call
            assert any("fmi2" + call in text for _, _, _, text in instance.messages)
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        scenario.enter_model_exchange(instance)
        m = fmu.event_indicators + 1
        assert instance.call("GetEventIndicators", (ctypes.c_double * m)(), m) == raw.ERROR


def test_non_finite_states_and_times_are_refused(fmu):
    for bad in (float("nan"), float("inf")):
        with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
            scenario.enter_model_exchange(instance)
            assert instance.call("SetTime", bad) >= raw.DISCARD
        if fmu.states:
            with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
                scenario.enter_model_exchange(instance)
                before = instance.states()
                values = [*before[:-1], bad]
                assert instance.call("SetContinuousStates", (ctypes.c_double * len(values))(*values), len(values)) == raw.DISCARD
                assert instance.states() == before


# Starts from which some events follow soon, for FMUs whose start values have none.
EVENTFUL = {"compass-gait": {"y": 1.06, "on_slide": 2, "on_fall": 2}}


def test_event_indicators_change_sign_at_an_event_and_are_clear_of_zero_behind_it(fmu):
    if not fmu.event_indicators:
        pytest.skip("no event indicators")
    seen, time = 0, 0.0
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        scenario.enter_model_exchange(instance, parameters=EVENTFUL.get(fmu.name, {}))
        while time < 0.4 * fmu.stop_time:
            before = scenario._signs(instance)
            time, hit = scenario._step_to_event(instance, time, time + 1e-3)
            if hit:
                seen += 1
                assert scenario._signs(instance) != before
                scenario.event(instance)
                assert scenario._signs(instance) == before, "the event is not over"
    assert seen >= 2


def test_time_events_are_taken_at_their_time_and_nowhere_else(fmu):
    """Passing the announced time without an event changes no held value; the event moves the next one on."""
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        info = scenario.enter_model_exchange(instance)
        if not info.nextEventTimeDefined:
            pytest.skip("no time events")
        held = [v for v in fmu.of("output") if v.variability == "discrete"]
        continuous = [v for v in fmu.of("input") if v.variability == "continuous"]
        instance.set(continuous, [scenario.input_value(v, 0.3) for v in continuous])
        for k in range(1, 6):
            expected = info.nextEventTime
            before = raw.bits(instance.get(held))
            instance.must("SetTime", expected)
            assert raw.bits(instance.get(held)) == before
            info = scenario.event(instance)
            assert info.nextEventTimeDefined and info.nextEventTime > expected
        if fmu.name == "arx-actuator":
            assert info.nextEventTime == pytest.approx(6e-3, abs=1e-12)
            assert raw.bits(instance.get(held)) != before


def test_completed_integrator_step_is_not_needed_where_that_is_declared(fmu, monkeypatch):
    if not fmu.flag(raw.MODEL_EXCHANGE, "completedIntegratorStepNotNeeded"):
        pytest.skip("does not declare it")
    step = fmu.step_size
    expected = scenario.model_exchange(fmu, 6, step, substep=step / 4)
    monkeypatch.setattr(raw.Instance, "completed_step", lambda self: (False, False))
    assert [raw.bits(r) for r in scenario.model_exchange(fmu, 6, step, substep=step / 4)] == [raw.bits(r) for r in expected]


def test_both_interfaces_give_the_same_trajectory(fmu):
    """Co-Simulation against the same model under an integrator of this suite (RK4, 0.1 ms, events by bisection)."""
    step = fmu.step_size
    count = 60
    record = [v for v in fmu.readable if v.causality in ("output", "local")]
    parameters = {"solver.max_step": 1e-4} if any(v.name == "solver.max_step" for v in fmu.variables) else {}
    one = scenario.co_simulation(fmu, count, step, record, parameters=parameters)
    other = scenario.model_exchange(fmu, count, step, record, parameters=parameters)
    for k, (a, b) in enumerate(zip(one, other)):
        for v, x, y in zip(record, a, b):
            if v.is_real:
                scale = max(abs(x), abs(y), v.number("nominal") or 1e-2)
                assert abs(x - y) <= 1e-7 * scale, f"{v.name} at step {k}: {x!r} and {y!r}"
            else:
                assert x == y, f"{v.name} at step {k}"
