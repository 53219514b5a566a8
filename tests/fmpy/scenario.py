"""Runs that fit any FMU: test signals for every input, a Co-Simulation run, and a Model Exchange run with events.

Both runs use the same convention: at a communication point the inputs are set, then the interval is integrated with
inputs held, then every variable is recorded as it stands at the end of the interval (in Model Exchange: before the
event at that time is handled).
"""

import math

import raw


def input_value(variable, time):
    """A deterministic signal of a kind that suits the variable: smooth for continuous Reals, stairs for the rest."""
    phase = 0.7 * variable.index
    stair = int(10 * time) + variable.index
    if variable.type == "Real":
        scale = variable.number("nominal") or 1.0
        wave = math.sin(2 * math.pi * time + phase) + 0.3 * math.cos(5 * time)
        if variable.variability == "discrete":
            wave = math.sin(stair)
        value = (variable.start or 0.0) + scale * wave
        low, high = variable.number("min"), variable.number("max")
        value = value if low is None else max(value, low)
        return value if high is None else min(value, high)
    if variable.type == "Boolean":
        return stair % 2 == 1
    if variable.type == "String":
        return f"text {stair} ä"
    low, high = variable.number("min"), variable.number("max")
    low = 0 if low is None else low
    return low + stair % ((low + 9 if high is None else high) - low + 1)


def set_inputs(instance, time):
    inputs = instance.fmu.of("input")
    instance.set(inputs, [input_value(v, time) for v in inputs])


def set_parameters(instance, given):
    """Sets {name: value}."""
    instance.set([instance.fmu.variable(n) for n in given], list(given.values()))


def start(instance, start=0.0, stop=None, parameters=(), tolerance=None):
    """Initializes with the inputs of time `start` and optional parameters {name: value}."""
    instance.setup(start, stop, tolerance)
    set_parameters(instance, dict(parameters))
    set_inputs(instance, start)
    instance.must("EnterInitializationMode")
    instance.must("ExitInitializationMode")


def step_co_simulation(instance, first, count, step, record=None):
    """Steps `first`, ..., `first + count - 1`; the exact images of all variables after each."""
    record = instance.fmu.readable if record is None else record
    rows = []
    for k in range(first, first + count):
        set_inputs(instance, k * step)
        instance.must("DoStep", k * step, step, 0)
        rows.append(instance.get(record))
    return rows


def co_simulation(fmu, count, step, record=None, **options):
    """A fresh Co-Simulation run: values of `record` at the end of each step."""
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        start(instance, **options)
        return step_co_simulation(instance, 0, count, step, record)


def enter_model_exchange(instance, **options):
    """To Continuous-Time Mode at the start time; the event info."""
    start(instance, **options)
    info, _ = instance.update_discrete_states()
    instance.must("EnterContinuousTimeMode")
    return info


def event(instance, time=None):
    """Handles an event at the present time, with new inputs when `time` is given; the event info."""
    instance.must("EnterEventMode")
    if time is not None:
        set_inputs(instance, time)
    info, _ = instance.update_discrete_states()
    instance.must("EnterContinuousTimeMode")
    return info


def model_exchange(fmu, count, step, record=None, substep=1e-4, **options):
    """A fresh Model Exchange run: RK4 with steps of `substep`, state events found by bisection."""
    record = fmu.readable if record is None else record
    rows = []
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        info = enter_model_exchange(instance, **options)
        time = 0.0
        for k in range(count):
            if k > 0:
                info = event(instance, k * step)
            info, time = _integrate(instance, time, (k + 1) * step, substep, info)
            rows.append(instance.get(record))
    return rows


def _integrate(instance, time, end, substep, info):
    """To `end`, through all events before it; not through one at `end`."""
    while time < end:
        target = end
        if info.nextEventTimeDefined and time < info.nextEventTime < end - 1e-12:
            target = info.nextEventTime
        n = max(1, math.ceil((target - time) / substep - 1e-9))
        begin, hit = time, False
        for i in range(n):
            new = target if i == n - 1 else begin + (target - begin) * (i + 1) / n
            time, hit = _step_to_event(instance, time, new)
            wants_event, _ = instance.completed_step()
            if hit or wants_event:
                hit = True
                break
        if hit or (target < end):
            info = event(instance)
    return info, end


def _step_to_event(instance, time, new):
    """One RK4 step, or the part of it up to just behind the first change of sign of an indicator."""
    state = instance.states() if instance.fmu.states else []
    signs = _signs(instance)
    _rk4(instance, time, new, state)
    if _signs(instance) == signs:
        return new, False
    low, high = time, new
    while high - low > 1e-14 * max(1.0, high):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        _rk4(instance, time, middle, state)
        low, high = (middle, high) if _signs(instance) == signs else (low, middle)
    _rk4(instance, time, high, state)
    return high, True


def _signs(instance):
    return [z > 0 for z in instance.indicators()] if instance.fmu.event_indicators else []


def _rk4(instance, time, new, state):
    h = new - time

    def slope(t, x):
        instance.must("SetTime", t)
        instance.set_states(x)
        return instance.derivatives()

    if state:
        k1 = slope(time, state)
        k2 = slope(time + h / 2, [x + h / 2 * k for x, k in zip(state, k1)])
        k3 = slope(time + h / 2, [x + h / 2 * k for x, k in zip(state, k2)])
        k4 = slope(new, [x + h * k for x, k in zip(state, k3)])
        final = [x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip(state, k1, k2, k3, k4)]
        instance.must("SetTime", new)
        instance.set_states(final)
    else:
        instance.must("SetTime", new)
