"""CasADi imports the cart-pole as Model Exchange: derivatives, Jacobians and an integration of its own."""

import casadi
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fmpy
from fmpy.fmi2 import FMU2Model
from test_reference import reference

STATES, INPUTS = ["x", "theta", "v", "omega"], ["F", "F_ext", "tau_ext"]
# States and inputs of about the size of a swing-up.
POINTS = [
    ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ([0.1, 0.5, 0.3, -1.0], [1.0, 0.0, 0.0]),
    ([-0.2, 3.0, -1.1, 9.0], [-25.0, 2.0, 0.05]),
    ([0.4, -2.2, 0.7, -14.0], [40.0, -3.0, -0.1]),
]


@pytest.fixture
def cart_pole(shipped):
    return shipped("cart-pole")


@pytest.fixture
def builder(cart_pole):
    """CasADi wants the unpacked folder."""
    return casadi.DaeBuilder("cart_pole", str(cart_pole.folder))


def test_the_interface_is_found(builder):
    assert (builder.x(), builder.u()) == (STATES, INPUTS)
    assert builder.y() == [*STATES, "a", "alpha", "energy"]


def test_derivatives_are_those_of_the_paper(builder):
    """Against equation 4 as typed in the reference script."""
    derivatives = builder.create("f", ["x", "u"], ["ode"])
    for state, inputs in POINTS:
        if inputs[2] == 0.0:
            expected = reference.mechanics(np.array(state), inputs[0] + inputs[1])
            assert np.allclose(np.array(derivatives(state, inputs)).ravel(), expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("unknowns", ["ode", "y"])
def test_jacobian_equals_the_directional_derivatives(builder, cart_pole, unknowns):
    function = builder.create("f", ["x", "u"], [unknowns])
    jacobian = function.factory("J", ["x", "u"], [f"jac:{unknowns}:x", f"jac:{unknowns}:u"])
    description = fmpy.read_model_description(str(cart_pole.path))
    reference_of = {v.name: v.valueReference for v in description.modelVariables}
    names = {"ode": ["der(x)", "der(theta)", "a", "alpha"], "y": builder.y()}[unknowns]
    known, unknown = [reference_of[n] for n in STATES + INPUTS], [reference_of[n] for n in names]
    model = FMU2Model(
        guid=description.guid,
        unzipDirectory=str(cart_pole.folder),
        modelIdentifier=description.modelExchange.modelIdentifier,
        instanceName="cart_pole",
    )
    model.instantiate()
    model.setupExperiment()
    model.enterInitializationMode()
    model.exitInitializationMode()
    model.enterContinuousTimeMode()
    try:
        for state, inputs in POINTS:
            model.setReal(known, [*state, *inputs])
            ours = np.column_stack(
                [model.getDirectionalDerivative(unknown, [reference], [1.0]) for reference in known]
            )
            theirs = np.hstack([np.array(casadi.DM.full(block)) for block in jacobian(state, inputs)])
            assert theirs.shape == ours.shape
            assert np.max(np.abs(theirs - ours)) <= 1e-12 * max(1.0, np.max(np.abs(ours)))
            # And neither is far from differences of CasADi's own function values.
            moved = lambda k, h: np.array(  # noqa: E731
                function(*np.split(np.array([*state, *inputs]) + h * np.eye(7)[k], [4]))
            ).ravel()
            differences = np.column_stack([(moved(k, 1e-6) - moved(k, -1e-6)) / 2e-6 for k in range(7)])
            assert np.max(np.abs(theirs - differences)) <= 1e-7 * max(1.0, np.max(np.abs(ours)))
    finally:
        model.terminate()
        # Without FMPy's unloading of the library, which other tests of this process use.
        model.fmi2FreeInstance(model.component)


def test_cvodes_in_casadi_follows_the_reference_equations(builder):
    """A swing of the free pole with a push, integrated by CasADi through the FMU, against SciPy on typed equations."""
    start, force, stop = [0.0, 2.5, 0.0, 0.0], 1.5, 2.0
    options = {"abstol": 1e-12, "reltol": 1e-12}
    integrate = casadi.integrator("F", "cvodes", builder.create(), 0.0, stop, options)
    found = np.array(integrate(x0=start, u=[force, 0.0, 0.0])["xf"]).ravel()
    expected = solve_ivp(
        lambda _, y: reference.mechanics(y, force), (0.0, stop), start, method="DOP853", rtol=1e-12, atol=1e-12
    ).y[:, -1]
    assert np.max(np.abs(found - expected)) < 1e-8


@pytest.mark.parametrize("name", ["cart-pole", "compass-gait", "pendulum", "rigid-mass"])
def test_outputs_that_are_rates_of_states_are_evaluated_with_the_derivatives(shipped, name):
    """An output with the attribute `derivative` is no output to CasADi; `create` with both then failed."""
    fmu = shipped(name)
    builder = casadi.DaeBuilder(name, str(fmu.folder))
    function = builder.create("f", ["x", "u"], ["ode", "y"])
    state = np.ravel([builder.start(x) for x in builder.x()])
    inputs = np.ravel([builder.start(u) for u in builder.u()]) + 0.01
    ode, y = (np.array(values).ravel() for values in function(state, inputs))
    outputs = dict(zip(builder.y(), y, strict=True))
    description = fmpy.read_model_description(str(fmu.path))
    rates = {d.variable.valueReference: value for d, value in zip(description.derivatives, ode, strict=True)}
    reals = [v for v in description.modelVariables if v.type == "Real"]
    compared = [v for v in reals if v.causality == "output" and v.valueReference in rates]
    assert compared
    for variable in compared:
        assert outputs[variable.name] == rates[variable.valueReference]
