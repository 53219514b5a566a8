"""The right-hand side: against closed forms, differences, and the tools that use it."""

import numpy as np
import pytest

import airloop


@pytest.fixture(scope="module")
def pendulum():
    return airloop.System("airloop:pendulum").rhs(outputs=["theta"], set={"m": 0.2, "l": 0.3, "I": 0.02, "b": 0.001})


def test_the_pendulum_is_its_equation(pendulum):
    m, l, inertia, b, g = 0.2, 0.3, 0.02, 0.001, 9.81
    x, u = [0.4, -1.5], [0.05]
    rates = pendulum(0.0, x, u)
    accelerations = [
        (u[0] - b * x[1] - m * g * l * np.sin(x[0])) / own for own in (inertia, inertia + m * l**2)
    ]
    assert rates[0] == x[1] and min(abs(rates[1] - one) for one in accelerations) < 1e-3
    assert pendulum.output(0.0, x, u) == [0.4]
    assert pendulum.states == ["pendulum.theta", "pendulum.omega"] and pendulum.units["pendulum.theta"] == "rad"


def test_derivatives_agree_with_differences(system):
    rhs = system.rhs(outputs=["x"])
    random = np.random.default_rng(3)
    x, u, h = 0.1 * random.normal(size=len(rhs.states)), np.array([0.7]), 1e-6
    by_x, by_u = rhs.jac(0.0, x, u)
    differences = np.array([(rhs(0, x + h * e, u) - rhs(0, x - h * e, u)) / (2 * h) for e in np.eye(len(x))]).T
    assert np.allclose(by_x, differences, rtol=1e-5, atol=1e-4 * np.abs(by_x).max())
    assert np.allclose(by_u[:, 0], (rhs(0, x, u + h) - rhs(0, x, u - h)) / (2 * h), rtol=1e-5, atol=1e-5)
    a, b, c, d = rhs.linearize(x, u)
    assert np.array_equal(a, by_x) and np.array_equal(b, by_u) and c.shape == (1, len(x)) and d.shape == (1, 1)


def test_scipy_integrates_it_to_the_run_of_the_monolithic_master(pendulum):
    from scipy.integrate import solve_ivp

    start = [0.5, 0.0]
    done = solve_ivp(pendulum.scipy([0.0]), (0, 1), start, method="Radau", jac=pendulum.scipy_jac([0.0]), rtol=1e-9, atol=1e-11)
    values = {"m": 0.2, "l": 0.3, "I": 0.02, "b": 0.001, "theta": 0.5}
    run = airloop.System("airloop:pendulum").run(stop=1, master="monolithic", set=values)
    assert done.y[0, -1] == pytest.approx(run["theta"][-1], abs=1e-7)


def test_wrong_arguments_are_named(pendulum):
    with pytest.raises(airloop.SettingError, match="`x` has 1 values; the system has 2"):
        pendulum(0.0, [0.1], [0.0])
    with pytest.raises(airloop.SimulationError, match="no finite number"):
        pendulum(0.0, [np.nan, 0.0], [0.0])
    with pytest.raises(airloop.SystemFileError, match="nothing"):
        airloop.System("airloop:pendulum").rhs(outputs=["nothing"])


def test_casadi_differentiates_it(pendulum):
    casadi = pytest.importorskip("casadi")
    f = pendulum.casadi()
    t, x, u = casadi.MX.sym("t"), casadi.MX.sym("x", 2), casadi.MX.sym("u")
    jacobian = casadi.Function("J", [t, x, u], [casadi.jacobian(f(t, x, u), x), casadi.jacobian(f(t, x, u), u)])
    by_x, by_u = jacobian(0.0, [0.4, -1.5], 0.05)
    expected = pendulum.jac(0.0, [0.4, -1.5], [0.05])
    assert np.array_equal(np.array(by_x), expected[0]) and np.array_equal(np.array(by_u), expected[1])


def test_jax_differentiates_it(pendulum):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    f = jax.jit(pendulum.jax())
    x, u = jax.numpy.array([0.4, -1.5]), jax.numpy.array([0.05])
    assert np.array_equal(np.array(f(0.0, x, u)), pendulum(0.0, x, u))
    assert np.allclose(np.array(jax.jacfwd(f, argnums=1)(0.0, x, u)), pendulum.jac(0.0, x, u)[0], atol=1e-12)
