"""Instantiation, wrong calls, reset, independence of instances, logging, leaks."""

import ctypes
import os
import shutil
import subprocess
import sys
import threading
from ctypes import byref, c_double, c_int, c_void_p
from pathlib import Path

import pytest

import raw
import scenario
from processes import in_process

KINDS = pytest.mark.parametrize("kind", [raw.CO_SIMULATION, raw.MODEL_EXCHANGE], ids=["cs", "me"])


def short_run(instance, kind):
    """Images of all variables of a short run of a fresh or reset instance."""
    step = instance.fmu.step_size
    if kind == raw.CO_SIMULATION:
        scenario.start(instance)
        rows = scenario.step_co_simulation(instance, 0, 20, step)
    else:
        info = scenario.enter_model_exchange(instance)
        rows, time = [], 0.0
        for k in range(5):
            if k:
                info = scenario.event(instance, k * step)
            info, time = scenario._integrate(instance, time, (k + 1) * step, step / 3, info)
            rows.append(instance.get(instance.fmu.readable))
    return [raw.bits(row) for row in rows]


@KINDS
def test_wrong_guid_gives_null_and_a_log_line(fmu, kind):
    instance = fmu.instantiate(kind, guid="{00000000-0000-0000-0000-000000000000}")
    assert not instance.component
    assert any("guid" in text.lower() for _, _, _, text in instance.messages), instance.messages
    assert all(status >= raw.ERROR for _, status, _, _ in instance.messages)


def _survives(fmu, kind, options):
    instance = fmu.instantiate(kind, **options)
    created = bool(instance.component)
    if created:
        # A refused call makes the instance want to log.
        instance.call("Terminate")
        instance.free()
    return created


@KINDS
@pytest.mark.parametrize(
    "options",
    [
        {"callbacks": "null"},
        {"callbacks": "no logger"},
        {"callbacks": "all null"},
        {"name": ""},
        {"name": None},
        {"resources": ""},
        {"resources": "file:///no/such/folder/"},
        {"callbacks": "no logger", "guid": "wrong"},
        {"callbacks": "null", "guid": "wrong"},
    ],
    ids=str,
)
def test_survives_missing_callbacks_names_and_folders(fmu, kind, options):
    created = in_process(_survives, fmu, kind, options)
    if options.get("guid") == "wrong":
        assert not created
    if options == {"callbacks": "no logger"}:
        assert created, "memory functions are given: the logger may be missing"
    if options == {"callbacks": "all null"} and fmu.flag(kind, "canNotUseMemoryManagementFunctions"):
        assert created, "has its own memory functions"


# Calls that the standard forbids in the state "instantiated" (FMI 2.0.4, tables of 3.2.3 and 4.2.4).
FORBIDDEN_AT_ONCE = {
    raw.CO_SIMULATION: [
        ("ExitInitializationMode",),
        ("Terminate",),
        ("DoStep", 0.0, 0.01, 0),
        ("CancelStep",),
        ("GetRealStatus", raw.LAST_SUCCESSFUL_TIME, byref(c_double())),
        ("EnterEventMode",),
        ("SetTime", 0.0),
    ],
    raw.MODEL_EXCHANGE: [
        ("ExitInitializationMode",),
        ("Terminate",),
        ("EnterEventMode",),
        ("EnterContinuousTimeMode",),
        ("NewDiscreteStates", byref(raw.EventInfo())),
        ("CompletedIntegratorStep", 1, byref(c_int()), byref(c_int())),
        ("DoStep", 0.0, 0.01, 0),
    ],
}


@pytest.mark.parametrize(
    "kind, call",
    [(kind, call) for kind, calls in FORBIDDEN_AT_ONCE.items() for call in calls],
    ids=lambda value: value[0] if isinstance(value, tuple) else ("me", "cs")[value],
)
def test_a_call_before_initialization_gives_error_and_a_log_line(fmu, kind, call):
    with fmu.instantiate(kind) as instance:
        before = len(instance.messages)
        assert instance.call(*call) == raw.ERROR
        messages = instance.messages[before:]
        assert any("fmi2" + call[0] in text for _, _, _, text in messages), messages


# Calls that the standard forbids once a run has begun.
FORBIDDEN_WHEN_RUNNING = [
    ("SetupExperiment", 0, 0.0, 0.0, 0, 0.0),
    ("EnterInitializationMode",),
    ("ExitInitializationMode",),
]


@KINDS
@pytest.mark.parametrize("call", FORBIDDEN_WHEN_RUNNING, ids=lambda call: call[0])
def test_a_call_after_initialization_gives_error_and_a_log_line(fmu, kind, call):
    with fmu.instantiate(kind) as instance:
        scenario.start(instance)
        before = len(instance.messages)
        assert instance.call(*call) == raw.ERROR
        messages = instance.messages[before:]
        assert any("fmi2" + call[0] in text for _, _, _, text in messages), messages


@KINDS
def test_parameters_cannot_be_changed_during_a_run(fmu, kind):
    fixed = fmu.of("parameter", variability="fixed")
    if not fixed:
        pytest.skip("no fixed parameter")
    for parameter in fixed:
        with fmu.instantiate(kind) as instance:
            scenario.start(instance)
            assert instance.try_set(parameter, parameter.start) >= raw.DISCARD, parameter.name
            assert any(parameter.name in text for _, _, _, text in instance.messages), instance.messages


@KINDS
def test_what_the_model_computes_cannot_be_set(fmu, kind):
    computed = [v for v in fmu.of("output", "calculatedParameter") if v.initial == "calculated"]
    for v in computed:
        with fmu.instantiate(kind) as instance:
            value = {"String": "text", "Boolean": True}.get(v.type, 1)
            assert instance.try_set(v, value) >= raw.DISCARD, v.name


@KINDS
def test_an_unknown_value_reference_is_refused(fmu, kind):
    for name, buffer in (("Real", c_double), ("Integer", c_int), ("Boolean", c_int), ("String", ctypes.c_char_p)):
        for access in ("Get", "Set"):
            with fmu.instantiate(kind) as instance:
                instance.setup()
                instance.must("EnterInitializationMode")
                reference = (ctypes.c_uint * 1)(4_000_000_000)
                assert instance.call(access + name, reference, 1, (buffer * 1)()) >= raw.DISCARD
                assert any("4000000000" in text for _, _, _, text in instance.messages), instance.messages


@KINDS
def test_null_pointers_are_refused_not_followed(fmu, kind):
    in_process(_pass_null_pointers, fmu, kind)


def _pass_null_pointers(fmu, kind):
    calls = [
        ("GetReal", None, 1, None),
        ("SetReal", None, 1, None),
        ("GetString", None, 1, None),
        ("GetFMUstate", None),
        ("SetFMUstate", None),
        ("SerializedFMUstateSize", None, None),
        ("GetDirectionalDerivative", None, 1, None, 1, None, None),
    ]
    for call in calls:
        with fmu.instantiate(kind) as instance:
            scenario.start(instance)
            assert instance.call(*call) >= raw.DISCARD, call
    for name in raw.FUNCTIONS:
        if name in ("fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate"):
            continue
        function = getattr(fmu.library, name)
        arguments = [argument() for argument in function.argtypes]
        arguments[0] = None
        status = function(*arguments)
        assert name == "fmi2FreeInstance" or status == raw.ERROR, name


@KINDS
def test_reset_equals_a_fresh_instance_bit_for_bit(fmu, kind):
    with fmu.instantiate(kind) as fresh:
        expected = short_run(fresh, kind)
    with fmu.instantiate(kind) as instance:
        short_run(instance, kind)
        instance.must("Reset")
        assert short_run(instance, kind) == expected
        instance.must("Terminate")
        instance.must("Reset")
        assert short_run(instance, kind) == expected


@KINDS
def test_reset_gives_changed_parameters_their_start_values_back(fmu, kind):
    def parameters(instance):
        instance.setup()
        instance.must("EnterInitializationMode")
        return raw.bits(instance.get(fmu.of("parameter")))

    with fmu.instantiate(kind) as fresh:
        start_values = parameters(fresh)
    with fmu.instantiate(kind) as instance:
        for v in fmu.of("parameter"):
            if v.is_real:
                low, high = v.number("min"), v.number("max")
                changed = v.start * 1.01 if v.start else (0.001 if high is None or high >= 0.001 else low)
                if high is None or changed <= high:
                    instance.set([v], [changed])
        instance.must("Reset")
        assert parameters(instance) == start_values


@KINDS
def test_instances_do_not_know_of_each_other(fmu, kind):
    if kind == raw.MODEL_EXCHANGE:
        with fmu.instantiate(kind) as one, fmu.instantiate(kind) as two:
            expected = short_run(one, kind)
            assert short_run(two, kind) == expected
        return
    step = fmu.step_size
    expected = [raw.bits(row) for row in scenario.co_simulation(fmu, 20, step)]
    with fmu.instantiate(kind) as one, fmu.instantiate(kind) as two:
        scenario.start(one)
        scenario.start(two)
        seen = []
        for k in range(20):
            seen += scenario.step_co_simulation(one, k, 1, step)
            if k % 3 == 0:
                scenario.step_co_simulation(two, k // 3, 1, step)
        assert [raw.bits(row) for row in seen] == expected


@KINDS
def test_instances_in_different_threads_give_the_same_results(fmu, kind):
    with fmu.instantiate(kind) as alone:
        expected = short_run(alone, kind)
    results = [None] * 4

    def work(i):
        for _ in range(3):
            with fmu.instantiate(kind, name=f"thread {i}") as instance:
                results[i] = short_run(instance, kind)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(results))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [expected] * len(results)


@KINDS
def test_an_instance_can_move_to_another_thread(fmu, kind):
    with fmu.instantiate(kind) as alone:
        expected = short_run(alone, kind)
    outcome = []
    with fmu.instantiate(kind) as instance:
        thread = threading.Thread(target=lambda: outcome.append(short_run(instance, kind)))
        thread.start()
        thread.join()
    assert outcome == [expected]


@KINDS
def test_can_be_freed_in_every_legal_state(fmu, kind):
    def initialized(instance):
        scenario.start(instance)

    def terminated(instance):
        scenario.start(instance)
        instance.must("Terminate")

    def in_initialization(instance):
        instance.setup()
        instance.must("EnterInitializationMode")

    def after_an_error(instance):
        instance.call("ExitInitializationMode")

    for prepare in (lambda instance: None, in_initialization, initialized, terminated, after_an_error):
        with fmu.instantiate(kind) as instance:
            prepare(instance)


@KINDS
def test_messages_carry_the_instance_name_and_a_declared_category(fmu, kind):
    declared = {c.get("name") for c in fmu.xml.iterfind("LogCategories/Category")}
    with fmu.instantiate(kind, name="nämé of it") as instance:
        instance.call("ExitInitializationMode")
        assert instance.messages
        for name, status, category, text in instance.messages:
            assert name == "nämé of it"
            assert status == raw.ERROR
            assert category in declared
            assert text.strip()


@KINDS
def test_set_debug_logging_chooses_the_categories(fmu, kind):
    def refused(instance):
        instance.call("ExitInitializationMode")

    def categories(*names):
        return len(names), (ctypes.c_char_p * max(1, len(names)))(*[n.encode() for n in names])

    with fmu.instantiate(kind, logging=False) as instance:
        instance.must("SetDebugLogging", 1, *categories("logStatusError"))
        assert instance.log_of(lambda: refused(instance))
    with fmu.instantiate(kind) as instance:
        instance.must("SetDebugLogging", 1, *categories("logStatusWarning"))
        assert not instance.log_of(lambda: refused(instance))
    with fmu.instantiate(kind) as instance:
        assert instance.call("SetDebugLogging", 1, *categories("no such category")) >= raw.WARNING


@KINDS
def test_strings_stay_valid_until_the_next_call(fmu, kind):
    strings = [v for v in fmu.readable if v.type == "String"]
    if not strings:
        pytest.skip("no String variable")
    with fmu.instantiate(kind) as instance:
        scenario.start(instance)
        references = (ctypes.c_uint * len(strings))(*[v.reference for v in strings])
        buffer = (ctypes.c_char_p * len(strings))()
        instance.must("GetString", references, len(strings), buffer)
        pointers = [ctypes.cast(buffer, ctypes.POINTER(c_void_p))[i] for i in range(len(strings))]
        first = [ctypes.string_at(p) for p in pointers]
        # Work elsewhere in the process must not disturb them.
        with fmu.instantiate(kind) as other:
            scenario.start(other)
            other.get(strings)
        assert [ctypes.string_at(p) for p in pointers] == first
        for v, text in zip(strings, first):
            text.decode("utf-8")


@KINDS
def test_a_string_is_copied_when_it_is_set(fmu, kind):
    inputs = [v for v in fmu.of("input", "parameter") if v.type == "String"]
    if not inputs:
        pytest.skip("no String to set")
    # A formula has to be one.
    text = "x*v" if inputs[0].name == "formula" else "first ü"
    with fmu.instantiate(kind) as instance:
        buffer = ctypes.create_string_buffer(text.encode())
        array = (ctypes.c_char_p * 1)(ctypes.addressof(buffer))
        instance.must("SetString", (ctypes.c_uint * 1)(inputs[0].reference), 1, array)
        buffer.value = b"gone"
        instance.setup()
        instance.must("EnterInitializationMode")
        assert instance.get(inputs[:1]) == [text]


def _resident_kilobytes():
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1])


def _life_cycles(fmu, kind, count):
    def cycle():
        with fmu.instantiate(kind) as instance:
            scenario.start(instance)
            if kind == raw.CO_SIMULATION:
                instance.must("DoStep", 0.0, fmu.step_size, 0)
            state = instance.get_state()
            instance.get_state(state)
            data = instance.serialize(state)
            other = instance.deserialize(data)
            instance.free_state(state)
            instance.free_state(other)
            instance.call("ExitInitializationMode")  # refused: also the path of an error must not leak

    for _ in range(200):
        cycle()
    before = _resident_kilobytes()
    for _ in range(count):
        cycle()
    return _resident_kilobytes() - before


@KINDS
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc/self/status")
def test_does_not_grow_over_ten_thousand_life_cycles(fmu, kind):
    # AIRLOOP_LIFE_CYCLES=100000 is the long form; the bound does not grow with it.
    count = int(os.environ.get("AIRLOOP_LIFE_CYCLES", "10000"))
    # A leak of 40 bytes per cycle would show; the allocator's own unrest stays below.
    assert in_process(_life_cycles, fmu, kind, count) < 400


@KINDS
def test_valgrind_finds_no_error_in_a_short_life_cycle(fmu, kind, tmp_path):
    if shutil.which("valgrind") is None or shutil.which("cc") is None:
        pytest.skip("valgrind or cc is not installed (Debian: apt-get install valgrind gcc)")
    program = tmp_path / "life_cycle"
    source = Path(__file__).parent / "life_cycle.c"
    subprocess.run(["cc", "-g", "-o", program, source, "-ldl"], check=True)
    result = subprocess.run(
        ["valgrind", "--quiet", "--leak-check=full", "--errors-for-leak-kinds=definite", "--error-exitcode=9"]
        + [program, fmu.binary, str(kind), fmu.guid, fmu.resources.as_uri(), str(fmu.step_size), str(len(fmu.states))],
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stdout + result.stderr
