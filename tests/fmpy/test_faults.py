"""Faults that the test FMUs can be asked for: discard, fail, panic, give a NaN, end the simulation; resources; all types."""

import math

import pytest

import raw
import scenario
from processes import in_process

STEP = 0.01


@pytest.fixture
def all_types(shipped):
    return shipped("test-all-types")


@pytest.fixture
def ball(shipped):
    return shipped("test-bouncing-ball")


def fault(fmu, name):
    """Value of the enumeration item."""
    items = fmu.xml.find("TypeDefinitions/SimpleType[@name='Fault']/Enumeration")
    return next(int(item.get("value")) for item in items if item.get("name") == name)


def run_into(fmu, name, steps=60, **options):
    """(instance, status and index of the first step that is not fmi2OK); the fault begins at 0.255 s."""
    instance = fmu.instantiate(raw.CO_SIMULATION, **options)
    scenario.start(instance, parameters={"fault": fault(fmu, name), "fault_time": 0.255})
    for k in range(steps):
        status = instance.do_step(k * STEP, STEP)
        if status != raw.OK:
            return instance, status, k
    return instance, raw.OK, steps


def test_discard_reports_the_last_successful_time_and_can_be_undone(all_types):
    instance, status, k = run_into(all_types, "discard")
    with instance:
        assert (status, k) == (raw.DISCARD, 25)
        assert 0.25 <= instance.real_status() < 0.26
        assert instance.boolean_status() is False
        assert any("fault `discard`" in text for _, _, _, text in instance.messages), instance.messages
        # After a discarded step the slave waits for a decision: not for another step.
        assert instance.do_step(0.25, STEP / 10) == raw.ERROR


def test_discard_is_undone_by_setting_an_earlier_state(all_types):
    with all_types.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance, parameters={"fault": fault(all_types, "discard"), "fault_time": 0.255})
        scenario.step_co_simulation(instance, 0, 25, STEP)
        state = instance.get_state()
        assert instance.do_step(0.25, STEP) == raw.DISCARD
        instance.set_state(state)
        assert instance.do_step(0.25, 0.4 * STEP) == raw.OK
        instance.free_state(state)


def test_an_error_ends_the_run_and_reset_begins_it_anew(all_types):
    instance, status, k = run_into(all_types, "error")
    with instance:
        assert (status, k) == (raw.ERROR, 25)
        assert any("fault `error`" in text for _, _, _, text in instance.messages)
        assert instance.do_step(0.25, STEP) == raw.ERROR
        instance.must("Reset")
        scenario.start(instance)
        scenario.step_co_simulation(instance, 0, 60, STEP)


def _panic(fmu, kind):
    if kind == raw.CO_SIMULATION:
        instance, status, _ = run_into(fmu, "panic")
    else:
        instance = fmu.instantiate(kind)
        scenario.enter_model_exchange(instance, parameters={"fault": fault(fmu, "panic"), "fault_time": 0.255})
        instance.must("SetTime", 0.3)
        status = instance.try_get(fmu.variable("y_real"))
    after = instance.do_step(0.0, STEP)
    return status, after, [m[1:] for m in instance.messages]


@pytest.mark.parametrize("kind", [raw.CO_SIMULATION, raw.MODEL_EXCHANGE], ids=["cs", "me"])
def test_a_panic_becomes_fatal_with_a_message_and_the_importer_lives_on(all_types, kind):
    status, after, messages = in_process(_panic, all_types, kind)
    assert status == raw.FATAL
    assert after in (raw.ERROR, raw.FATAL)
    assert any("fault `panic`" in text for _, _, text in messages), messages


def test_a_panic_in_one_instance_leaves_the_others_alone(all_types):
    assert in_process(_panic_beside, all_types)


def _panic_beside(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as other:
        scenario.start(other)
        _panic(fmu, raw.CO_SIMULATION)
        scenario.step_co_simulation(other, 0, 5, STEP)
    return True


def test_a_nan_output_is_handed_out_not_hidden(all_types):
    """It is the importer's part to stop there."""
    instance, _, _ = run_into(all_types, "nan_output", steps=30)
    with instance:
        assert math.isnan(instance.get([all_types.variable("y_real")])[0])


def test_a_model_can_end_the_simulation(all_types):
    instance, status, _ = run_into(all_types, "terminate")
    with instance:
        assert status == raw.DISCARD
        assert instance.boolean_status() is True
        assert instance.real_status() == pytest.approx(0.255, abs=STEP)
        instance.must("Terminate")


def test_the_ball_ends_the_simulation_when_it_lies(ball):
    with ball.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance, parameters={"stop_at_rest": True})
        for k in range(1000):
            if instance.do_step(k * STEP, STEP) != raw.OK:
                break
        # Falling 1 m, then bounces shortened by e = 0.7 until slower than 0.1 m/s: a geometric series.
        fall = math.sqrt(2 / 9.81)
        speed, end = 9.81 * fall, fall
        while speed * 0.7 >= 0.1:
            speed *= 0.7
            end += 2 * speed / 9.81
        assert instance.boolean_status() is True
        assert instance.real_status() == pytest.approx(end, abs=1e-6)


def test_the_ball_agrees_with_the_closed_form_after_two_bounces(ball):
    fall = math.sqrt(2 / 9.81)
    v1 = 0.7 * 9.81 * fall
    v2 = 0.7 * v1
    begin = fall + 2 * v1 / 9.81
    with ball.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        k = math.ceil(begin / STEP) + 5
        scenario.step_co_simulation(instance, 0, k, STEP)
        t = k * STEP - begin
        h, v = instance.get([ball.variable("h"), ball.variable("v")])
    assert h == pytest.approx(v2 * t - 9.81 * t * t / 2, abs=1e-9)
    assert v == pytest.approx(v2 - 9.81 * t, abs=1e-9)


def test_every_type_is_passed_on(all_types):
    with all_types.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance, parameters={"gain": -2.0, "offset": 3.0, "shift": 40, "invert": True, "prefix": 'ä<&">'})
        names = ["u_real", "u_discrete", "u_integer", "u_boolean", "u_string", "u_enumeration"]
        instance.set([all_types.variable(n) for n in names], [1.5, 2.5, -7, True, "ü", 3])
        instance.must("DoStep", 0.0, STEP, 0)
        names = ["y_real", "y_discrete", "y_integer", "y_boolean", "y_string", "y_enumeration"]
        values = instance.get([all_types.variable(n) for n in names])
        assert values == [0.0, 5.0, 33, False, 'ä<&">ü', 3]


def test_a_tunable_parameter_can_be_changed_during_a_run(all_types):
    with all_types.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        instance.must("DoStep", 0.0, STEP, 0)
        instance.set([all_types.variable("gain"), all_types.variable("u_real")], [4.0, 0.5])
        instance.must("DoStep", STEP, STEP, 0)
        assert instance.get([all_types.variable("y_real")]) == [2.0]


def test_the_resource_file_is_read(all_types):
    expected = (all_types.resources / "message.txt").read_text(encoding="utf-8").splitlines()[0]
    with all_types.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        assert instance.get([all_types.variable("message")]) == [expected]


def test_a_missing_resource_file_is_named(all_types, tmp_path):
    instance = all_types.instantiate(raw.CO_SIMULATION, resources=tmp_path.as_uri())
    failed = not instance.component
    if not failed:
        with instance:
            instance.setup()
            failed = instance.call("EnterInitializationMode") >= raw.ERROR
    assert failed
    assert any("message.txt" in text for _, _, _, text in instance.messages), instance.messages
