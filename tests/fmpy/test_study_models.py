"""The models of studies through FMPy, in both interfaces, against SciPy and closed forms."""

import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

INTERFACES = ["CoSimulation", "ModelExchange"]


def simulate(fmu, interface, stop, step, start, inputs=None, outputs=None):
    return fmpy.simulate_fmu(
        str(fmu.path),
        fmi_type=interface,
        stop_time=stop,
        output_interval=step,
        relative_tolerance=1e-10,
        start_values=start,
        input=inputs,
        output=outputs,
    )


@pytest.mark.parametrize("interface", INTERFACES)
def test_pendulum_swings_as_scipy_says(shipped, interface):
    inertia, m, l, g, b = 0.0034, 0.148, 0.15, 9.81, 2e-4
    start = {"I": inertia, "m": m, "l": l, "g": g, "b": b, "theta": 1.6, "omega": -0.5}
    result = simulate(shipped("pendulum"), interface, 5.0, 0.01, start, outputs=["theta", "omega"])

    def rate(_, y):
        return [y[1], (-b * y[1] - m * g * l * np.sin(y[0])) / inertia]

    truth = solve_ivp(rate, (0, 5), [1.6, -0.5], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=result["time"]).y
    # FMPy's CVode and the inner Runge-Kutta steps of 1 ms are good to some 1e-7.
    assert np.abs(result["theta"] - truth[0]).max() < 1e-5
    assert np.abs(result["omega"] - truth[1]).max() < 1e-4


@pytest.mark.parametrize("interface", INTERFACES)
def test_rigid_mass_approaches_its_final_speed(shipped, interface):
    m, b, force = 95.0, 200.0, 30.0
    start = {"m": m, "b": b, "F": force, "F_ext": -10.0}
    result = simulate(shipped("rigid-mass"), interface, 2.0, 0.01, start, outputs=["x", "v"])
    t, rate = result["time"], b / m
    speed = (force - 10.0) / b
    assert np.abs(result["v"] - speed * (1 - np.exp(-rate * t))).max() < 1e-7
    assert np.abs(result["x"] - speed * (t - (1 - np.exp(-rate * t)) / rate)).max() < 1e-7


@pytest.mark.parametrize("interface", INTERFACES)
def test_piston_force_is_the_difference_of_both_chambers(shipped, interface):
    t = np.array([0.0, 0.5, 1.0])
    pressures = np.array(list(zip(t, [1e5, 3e5, 3e5], [0.0, 1e5, 1e5])), dtype=[("time", float), ("p1", float), ("p2", float)])
    start = {"S1": 5.2e-4, "S2": 4.1e-4}
    result = simulate(shipped("piston-force"), interface, 1.0, 0.5, start, inputs=pressures, outputs=["F"])
    assert result["F"][-1] == pytest.approx(5.2e-4 * 3e5 - 4.1e-4 * 1e5, rel=1e-12)
