"""FMU state: get, set, free, serialize; a replay is equal bit for bit, in any instance and in any process."""

import ctypes
from ctypes import byref, c_size_t, c_void_p

import pytest

import raw
import scenario
from fmu import Fmu
from processes import in_process


@pytest.fixture(autouse=True)
def _has_states(fmu):
    flags = ("canGetAndSetFMUstate", "canSerializeFMUstate")
    missing = [name for name in flags for kind in (0, 1) if not fmu.flag(kind, name)]
    assert not missing, missing


STEPS_BEFORE, STEPS_AFTER = 7, 13


def run(instance, first, count):
    return [raw.bits(row) for row in scenario.step_co_simulation(instance, first, count, instance.fmu.step_size)]


def test_setting_a_state_replays_the_run_bit_for_bit(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        run(instance, 0, STEPS_BEFORE)
        at_once = raw.bits(instance.get(fmu.readable))
        state = instance.get_state()
        expected = run(instance, STEPS_BEFORE, STEPS_AFTER)
        for _ in range(3):
            instance.set_state(state)
            assert raw.bits(instance.get(fmu.readable)) == at_once
            assert run(instance, STEPS_BEFORE, STEPS_AFTER) == expected
        instance.free_state(state)


def test_a_state_can_be_overwritten_and_several_can_be_held(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        early = instance.get_state()
        kept = instance.get_state()
        expected = run(instance, 0, 5)
        address = kept.value
        instance.get_state(kept)
        assert kept.value == address, "a state that is passed in again is used again"
        late = run(instance, 5, 5)
        instance.set_state(early)
        assert run(instance, 0, 5) == expected
        instance.set_state(kept)
        assert run(instance, 5, 5) == late
        instance.free_state(early)
        instance.free_state(kept)


def test_freeing_no_state_is_allowed_and_freeing_clears_the_handle(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        nothing = c_void_p(None)
        instance.must("FreeFMUstate", byref(nothing))
        instance.must("FreeFMUstate", None)
        state = instance.get_state()
        instance.free_state(state)
        assert state.value is None


def test_serialized_state_goes_into_another_instance(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as one:
        scenario.start(one)
        run(one, 0, STEPS_BEFORE)
        state = one.get_state()
        data = one.serialize(state)
        one.free_state(state)
        expected = run(one, STEPS_BEFORE, STEPS_AFTER)
    with fmu.instantiate(raw.CO_SIMULATION, name="other") as two:
        scenario.start(two)
        run(two, 0, 2)
        state = two.deserialize(data)
        two.set_state(state)
        assert run(two, STEPS_BEFORE, STEPS_AFTER) == expected
        assert two.serialize(state) == data
        two.free_state(state)


def _continue(path, folder, data):
    fmu = Fmu(path, folder)
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        state = instance.deserialize(data)
        instance.set_state(state)
        rows = run(instance, STEPS_BEFORE, STEPS_AFTER)
        instance.free_state(state)
        return rows


def test_serialized_state_goes_into_another_process(fmu, tmp_path):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        run(instance, 0, STEPS_BEFORE)
        state = instance.get_state()
        data = instance.serialize(state)
        instance.free_state(state)
        expected = run(instance, STEPS_BEFORE, STEPS_AFTER)
    assert in_process(_continue, fmu.path, tmp_path, data, fresh=True) == expected


def test_damaged_bytes_and_those_of_another_fmu_are_refused(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        state = instance.get_state()
        data = instance.serialize(state)
        instance.free_state(state)
    spoiled = [b"", b"x", b"\0" * len(data), data[:-1], data + b"\0", data[:4], b"GARB" + data[4:]]
    for damaged in spoiled:
        with fmu.instantiate(raw.CO_SIMULATION) as instance:
            scenario.start(instance)
            handle = c_void_p(None)
            buffer = ctypes.create_string_buffer(damaged, max(1, len(damaged)))
            status = instance.call("DeSerializeFMUstate", buffer, len(damaged), byref(handle))
            assert status >= raw.DISCARD, damaged[:16]
            assert handle.value is None
            assert instance.messages


def test_a_buffer_that_is_too_small_is_refused(fmu):
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        state = instance.get_state()
        size = c_size_t(0)
        instance.must("SerializedFMUstateSize", state, byref(size))
        guard = ctypes.create_string_buffer(b"\xaa" * size.value, size.value)
        status = instance.call("SerializeFMUstate", state, guard, size.value - 1)
        assert status >= raw.DISCARD
        assert guard.raw[size.value - 1] == 0xAA


def test_model_exchange_state_restores_states_time_and_events(fmu):
    step = fmu.step_size
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        info = scenario.enter_model_exchange(instance)
        info, time = scenario._integrate(instance, 0.0, step, step / 4, info)
        state = instance.get_state()

        def go_on():
            rows = []
            now, at = scenario.event(instance, step), step
            for k in (2, 3, 4):
                now, at = scenario._integrate(instance, at, k * step, step / 4, now)
                rows.append(raw.bits(instance.get(fmu.readable)))
            return rows

        expected = go_on()
        instance.set_state(state)
        assert go_on() == expected
        instance.free_state(state)
