"""fmi2SetRealInputDerivatives and fmi2GetRealOutputDerivatives."""

import ctypes
import math

import pytest

import raw
import scenario
from test_do_step import assert_close, tighten


def continuous_inputs(fmu):
    if not fmu.flag(raw.CO_SIMULATION, "canInterpolateInputs"):
        pytest.skip("does not declare canInterpolateInputs")
    return [v for v in fmu.of("input") if v.is_real and v.variability == "continuous"]


def set_derivatives(instance, variables, values, order=1):
    """Status of setting the derivatives of one order."""
    n = len(variables)
    references = (ctypes.c_uint * n)(*[v.reference for v in variables])
    orders, numbers = (ctypes.c_int * n)(*[order] * n), (ctypes.c_double * n)(*values)
    return instance.call("SetRealInputDerivatives", references, n, orders, numbers)


def output_derivatives(instance, variables, order=1):
    n = len(variables)
    references = (ctypes.c_uint * n)(*[v.reference for v in variables])
    orders, numbers = (ctypes.c_int * n)(*[order] * n), (ctypes.c_double * n)()
    instance.must("GetRealOutputDerivatives", references, n, orders, numbers)
    return list(numbers)


def ramp_run(fmu, step, count, slopes):
    """Continuous variables after `count` steps of `step` under ramps that are set anew at each step."""
    inputs = continuous_inputs(fmu)
    numeric = [v for v in fmu.readable if v.is_real]
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        tighten(instance)
        instance.initialize(tolerance=1e-10)
        for k in range(count):
            instance.set(inputs, [v.start + s * k * step for v, s in zip(inputs, slopes)])
            assert set_derivatives(instance, inputs, slopes) == raw.OK
            instance.must("DoStep", k * step, step, 0)
        return numeric, instance.get(numeric)


def test_a_ramp_gives_the_same_run_in_long_and_in_short_steps(fmu):
    inputs = continuous_inputs(fmu)
    if not inputs:
        pytest.skip("no continuous Real input")
    slopes = [(v.number("nominal") or 1.0) * (1.0 + 0.3 * i) for i, v in enumerate(inputs)]
    step = 8 * fmu.step_size
    numeric, long = ramp_run(fmu, step, 2, slopes)
    _, short = ramp_run(fmu, step / 8, 16, slopes)
    assert_close(numeric, long, short)
    # The ramp did something: held inputs end elsewhere.
    _, held = ramp_run(fmu, step, 2, [0.0] * len(inputs))
    assert raw.bits(held) != raw.bits(long)


def test_derivatives_hold_for_one_step_only(fmu):
    inputs = continuous_inputs(fmu)
    if not inputs:
        pytest.skip("no continuous Real input")
    with fmu.instantiate(raw.CO_SIMULATION) as one, fmu.instantiate(raw.CO_SIMULATION) as two:
        for instance in (one, two):
            instance.initialize()
            scenario.set_inputs(instance, 0.3)
        assert set_derivatives(one, inputs, [1.0] * len(inputs)) == raw.OK
        for instance in (one, two):
            instance.must("DoStep", 0.0, fmu.step_size, 0)
            scenario.set_inputs(instance, 0.4)
        if not fmu.states:
            # Nothing remembers the ramp: the second step sees equal inputs.
            one.must("DoStep", fmu.step_size, fmu.step_size, 0)
            two.must("DoStep", fmu.step_size, fmu.step_size, 0)
            assert raw.bits(one.get(fmu.readable)) == raw.bits(two.get(fmu.readable))


@pytest.mark.parametrize("value, order", [(math.nan, 1), (math.inf, 1), (1.0, 0), (1.0, -1)])
def test_a_bad_derivative_or_order_is_refused(fmu, value, order):
    inputs = continuous_inputs(fmu)
    if not inputs:
        pytest.skip("no continuous Real input")
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        instance.initialize()
        assert set_derivatives(instance, inputs[:1], [value], order) >= raw.DISCARD
        assert instance.messages


def test_derivatives_are_for_real_inputs_only(fmu):
    others = [v for v in fmu.of("output") if v.is_real]
    if not others:
        pytest.skip("no Real output")
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        instance.initialize()
        assert set_derivatives(instance, others[:1], [1.0]) >= raw.DISCARD


def test_output_derivatives_equal_differences_over_a_tiny_step(fmu):
    outputs = [v for v in fmu.of("output") if v.is_real and v.variability == "continuous"]
    element = fmu.interface("CoSimulation")
    if not outputs or element.get("maxOutputDerivativeOrder", "0") == "0":
        pytest.skip("no continuous outputs or no output derivatives")
    inputs = continuous_inputs(fmu)
    slopes = [0.5 * (v.number("nominal") or 1.0) for v in inputs]
    step, tiny = fmu.step_size, 1e-6
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        scenario.start(instance)
        scenario.step_co_simulation(instance, 0, 3, step)
        scenario.set_inputs(instance, 3 * step)
        values = instance.get(inputs)
        set_derivatives(instance, inputs, slopes)
        # A little past the end of the step: a sample that falls on it changes rates.
        instance.must("DoStep", 3 * step, step + tiny, 0)
        rates, before = output_derivatives(instance, outputs), instance.get(outputs)
        instance.set(inputs, [u + s * (step + tiny) for u, s in zip(values, slopes)])
        set_derivatives(instance, inputs, slopes)
        instance.must("DoStep", 4 * step + tiny, tiny, 0)
        after = instance.get(outputs)
    for v, rate, a, b in zip(outputs, rates, before, after):
        # One-sided difference: its error is half the second derivative times 1e-6, and rounding over 1e-6.
        scale = max(1.0, abs(rate), 100 * abs(a))
        assert abs((b - a) / tiny - rate) <= 1e-3 * scale, f"{v.name}: {rate!r}, differences {(b - a) / tiny!r}"


def cart_position(cart_pole, step, orders):
    """x at 1 s under F = 2 sin(7 t), with input derivatives up to `orders`."""
    force = cart_pole.variable("F")
    with cart_pole.instantiate(raw.CO_SIMULATION) as instance:
        tighten(instance)
        instance.initialize()
        for k in range(round(1.0 / step)):
            t = k * step
            instance.set([force], [2 * math.sin(7 * t)])
            for order in range(1, orders + 1):
                # The derivatives of sin are sin, a quarter of a turn ahead each time.
                value = 2 * 7**order * math.sin(7 * t + order * math.pi / 2)
                assert set_derivatives(instance, [force], [value], order) == raw.OK
            instance.must("DoStep", t, step, 0)
        return instance.get([cart_pole.variable("x")])[0]


@pytest.mark.parametrize("orders", [0, 1, 2, 3])
def test_order_of_convergence_of_the_cart_pole(shipped, orders):
    """Held inputs: first order in the communication step; each derivative that is given gains one."""
    cart_pole = shipped("cart-pole")
    exact = cart_position(cart_pole, 1 / 2048, 3)
    coarse, fine = (abs(cart_position(cart_pole, h, orders) - exact) for h in (1 / 64, 1 / 128))
    measured = math.log2(coarse / fine)
    print(f"input derivatives up to order {orders}: convergence order {measured:.2f}")
    assert measured == pytest.approx(orders + 1, abs=0.25)
