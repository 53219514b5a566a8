"""Start values, and outputs that fit the inputs as soon as initialization is over."""

import ctypes
import math

import pytest

import raw
import scenario

KINDS = pytest.mark.parametrize("kind", [raw.CO_SIMULATION, raw.MODEL_EXCHANGE], ids=["cs", "me"])


@KINDS
def test_variables_have_their_declared_start_values(fmu, kind):
    declared = [v for v in fmu.variables if v.start is not None]
    with fmu.instantiate(kind) as instance:
        instance.setup()
        instance.must("EnterInitializationMode")
        assert raw.bits(instance.get(declared)) == raw.bits([v.start for v in declared])


@KINDS
def test_outputs_right_after_initialization_fit_the_inputs(fmu, kind):
    """Set before or during initialization, read before or after its end: always the same values."""
    readings = []
    for set_in_mode in (False, True):
        with fmu.instantiate(kind) as instance:
            instance.setup()
            if not set_in_mode:
                scenario.set_inputs(instance, 0.3)
            instance.must("EnterInitializationMode")
            if set_in_mode:
                scenario.set_inputs(instance, 0.7)
                instance.get(fmu.readable)
                scenario.set_inputs(instance, 0.3)
            readings.append(raw.bits(instance.get(fmu.readable)))
            instance.must("ExitInitializationMode")
            readings.append(raw.bits(instance.get(fmu.readable)))
    for later in readings[1:]:
        assert later == readings[0]


def test_both_interfaces_agree_after_initialization(fmu):
    readings = []
    for kind in (raw.CO_SIMULATION, raw.MODEL_EXCHANGE):
        with fmu.instantiate(kind) as instance:
            scenario.start(instance)
            readings.append(raw.bits(instance.get(fmu.readable)))
    assert readings[0] == readings[1]


@KINDS
def test_a_start_time_other_than_zero_is_taken(fmu, kind):
    with fmu.instantiate(kind) as instance:
        scenario.start(instance, start=2.5, stop=4.0)
        if kind == raw.CO_SIMULATION:
            instance.must("DoStep", 2.5, fmu.step_size, 0)
            # Time at the last successful step.
            assert instance.do_step(2.5 + fmu.step_size, fmu.step_size) == raw.OK
        else:
            info, _ = instance.update_discrete_states()
            assert not info.nextEventTimeDefined or info.nextEventTime > 2.5


@KINDS
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf], ids=["nan", "inf", "-inf"])
def test_a_non_finite_value_is_refused_named_and_the_old_value_kept(fmu, kind, bad):
    settable = [v for v in [*fmu.of("input", "parameter"), *fmu.states] if v.is_real and v.start is not None]
    if not settable:
        pytest.skip("no Real to set")
    for v in settable:
        with fmu.instantiate(kind) as instance:
            assert instance.try_set(v, bad) == raw.DISCARD, v.name
            assert any(v.name in text for _, _, _, text in instance.messages), instance.messages
            instance.setup()
            instance.must("EnterInitializationMode")
            assert instance.get([v]) == [v.start]


@KINDS
def test_a_parameter_outside_its_range_is_refused_named_and_the_old_value_kept(fmu, kind):
    for v in fmu.of("parameter"):
        if v.type in ("Boolean", "String"):
            continue
        outside = []
        if v.number("min") is not None:
            outside.append(v.number("min") - (max(1.0, abs(v.number("min"))) if v.is_real else 1))
        if v.number("max") is not None:
            outside.append(v.number("max") + (max(1.0, abs(v.number("max"))) if v.is_real else 1))
        for value in outside:
            with fmu.instantiate(kind) as instance:
                assert instance.try_set(v, value) == raw.DISCARD, (v.name, value)
                assert any(v.name in text for _, _, _, text in instance.messages), instance.messages
                instance.setup()
                instance.must("EnterInitializationMode")
                assert instance.get([v]) == [v.start]


@KINDS
def test_one_bad_value_in_a_list_changes_nothing(fmu, kind):
    inputs = [v for v in fmu.of("input") if v.is_real]
    if len(inputs) < 2:
        pytest.skip("needs two Real inputs")
    with fmu.instantiate(kind) as instance:
        references = (ctypes.c_uint * len(inputs))(*[v.reference for v in inputs])
        values = [v.start + 1.0 for v in inputs]
        values[-1] = math.nan
        assert instance.call("SetReal", references, len(inputs), (ctypes.c_double * len(inputs))(*values)) == raw.DISCARD
        instance.setup()
        instance.must("EnterInitializationMode")
        assert instance.get(inputs) == [v.start for v in inputs]
