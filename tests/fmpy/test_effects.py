"""The effect FMUs in Co-Simulation and Model Exchange, against their equations written with NumPy and SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, dlsim

import raw
from test_derived import derive
from fmu import Fmu

TS = 1e-3
TIME = np.arange(400) * TS
# A motion through standstill in both directions, with its rate.
X = 0.05 * np.sin(9 * TIME) + 0.01
V = 0.45 * np.cos(9 * TIME)
F_HAT = 20 * np.sin(13 * TIME + 0.4)
S = np.tanh(60 * (V - 0.01))

FORCES = {
    "viscous": ({"viscous_coef": 3.0, "offset_value": 0.7}, 3.0 * V + 0.7),
    "coulomb": ({"coulomb_force": 2.0}, 2.0 * S),
    "pressure": ({"pressure_coef": 0.05}, 0.05 * np.abs(F_HAT) * S),
    "poscoulomb": ({"poscoulomb_slope": 12.0}, 12.0 * X * S),
    "stribeck": ({"stribeck_force": 1.5, "stribeck_vs": 0.08}, 1.5 * np.exp(-(((V - 0.01) / 0.08) ** 2)) * S),
    "asymmetry": ({"asymmetry_force": 0.8, "asymmetry_coef": 2.0}, np.where(V > 0, 0.8 * S + 2.0 * V, 0.0)),
    "area": ({"area_coef": 1e-5}, -1e-5 * (2e5 + 1e4 * X)),
    "spring": ({"spring_stiffness": 25.0, "spring_rest": 0.01}, 25.0 * (X - 0.01)),
    "endstop": (
        {"endstop_pos": 0.02, "endstop_stiffness": 800.0, "endstop_damping": 30.0},
        np.where(X > 0.02, np.maximum(0.0, 800.0 * (X - 0.02) + 30.0 * V), 0.0),
    ),
    "cogging": (
        {"cogging_amp": 0.6, "cogging_period": 0.02, "cogging_phase": 0.3},
        0.6 * np.sin(2 * np.pi * X / 0.02 + 0.3),
    ),
    "tilt": ({"tilt_angle": 0.03, "tilt_weight": 4.9}, np.full_like(X, 4.9 * np.sin(0.03))),
}

SIGN = np.tanh(V / 0.02)
AT_PORTS = {
    "viscous": ({"viscous_coef": 3.0, "drag_coef": 2.0}, 3.0 * V + 2.0 * np.abs(V) * V),
    "coulomb": ({"coulomb_level": 2.0, "load_coef": 0.05, "poscoulomb_slope": 9.0}, (2.0 + 0.05 * np.abs(F_HAT) + 9.0 * X) * SIGN),
    "stribeck": ({"stribeck_level": 1.5, "stribeck_vs": 0.08}, 1.5 * np.exp(-((V / 0.08) ** 2)) * SIGN),
    "asymmetry": ({"asymmetry_level": 0.8, "asymmetry_coef": 2.0}, np.where(V > 0, 0.8 * SIGN + 2.0 * V, 0.0)),
    "cubic": ({"cubic_stiffness": 9e3, "cubic_rest": 0.01, "offset_value": 0.3}, 9e3 * (X - 0.01) ** 3 + 0.3),
    "outlet": ({"outlet_coef": 4.0}, 4.0 * np.sqrt(np.maximum(X, 0.0))),
    "overflow": ({"endstop_pos": 0.02, "endstop_stiffness": 800.0}, np.maximum(0.0, 800.0 * (X - 0.02))),
    "added": ({"spring_stiffness": 25.0, "sign": -1.0}, 25.0 * X),
}


@pytest.fixture(scope="module")
def derived(shipped, tmp_path_factory):
    """(template, start values) -> an FMU derived as `airloop refine` does."""

    def make(template, values):
        folder = tmp_path_factory.mktemp("effect")
        return Fmu(derive(shipped(template), folder / "effect.fmu", values), folder / "unpacked")

    return make


def co_simulation(fmu, inputs, outputs):
    """Inputs of sample k are set before the step that begins at it; outputs at the end of each step."""
    rows = []
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        instance.setup()
        names = [fmu.variable(name) for name in inputs]
        instance.set(names, [float(values[0]) for values in inputs.values()])
        instance.must("EnterInitializationMode")
        instance.must("ExitInitializationMode")
        for k in range(len(TIME)):
            instance.set(names, [float(values[k]) for values in inputs.values()])
            instance.must("DoStep", k * TS, TS, 0)
            rows.append(instance.get([fmu.variable(name) for name in outputs]))
    return np.array(rows)


@pytest.mark.parametrize("effect", FORCES)
def test_forces_are_their_equations(derived, effect):
    values, expected = FORCES[effect]
    fmu = derived("force-effect", {"c2": 60.0, "c3": 0.01, **values})
    inputs = {"F_in": 10 * X, "x": X, "v": V, "F_hat": F_HAT, "p": 2e5 + 1e4 * X}
    found = co_simulation(fmu, inputs, ["F_out", "f"])
    assert np.max(np.abs(found[:, 1] - expected)) < 1e-12
    assert np.max(np.abs(found[:, 0] - (10 * X - expected))) < 1e-12
    assert np.max(np.abs(expected)) > 0.1


@pytest.mark.parametrize("effect", AT_PORTS)
def test_effects_at_ports_are_their_equations(derived, effect):
    values, expected = AT_PORTS[effect]
    fmu = derived("port-effect", {"vt": 0.02, **values})
    inputs = {"u": 10 * X, "x": X, "v": V, "load": F_HAT, "p": 2e5 + 1e4 * X}
    found = co_simulation(fmu, inputs, ["y", "f"])
    assert np.max(np.abs(found[:, 1] - expected)) < 1e-12
    assert np.max(np.abs(found[:, 0] - (10 * X - values.get("sign", 1.0) * expected))) < 1e-12
    assert np.max(np.abs(expected)) > 0.1


def test_presliding_is_the_dahl_model(derived):
    disp, c1 = 0.002, 5.8
    fmu = derived("force-effect", {"presliding_disp": disp, "c1": c1, "c2": 60.0, "c3": 0.01})
    found = co_simulation(fmu, {"v": V}, ["f"])[:, 0]
    # The velocity is held over each step, as in Co-Simulation.
    z, expected = 0.0, []
    for v in V:
        w = v - 0.01
        step = solve_ivp(lambda _, z: w - abs(w) * z / disp, (0, TS), [z], rtol=1e-10, atol=1e-15)
        z = step.y[0, -1]
        expected.append(c1 * (z / disp - np.tanh(60 * w)))
    # The FMU's own integrator has a tolerance of 1e-6.
    assert np.max(np.abs(found - expected)) < 2e-5 * c1


def test_torques_are_their_equations(derived):
    theta, omega = 0.4 * np.sin(8 * TIME), 3.2 * np.cos(8 * TIME)
    values = {"viscous_coef": 2e-4, "coulomb_torque": 3e-3, "quaddrag_coef": 2e-4, "tilt_angle": 0.03, "tilt_moment": 0.196}
    found = co_simulation(derived("torque-effect", values), {"tau_in": theta, "theta": theta, "omega": omega}, ["tau_out"])
    tau = 2e-4 * omega + 3e-3 * np.tanh(omega / 0.05) + 2e-4 * np.abs(omega) * omega
    tau += 0.196 * (np.sin(theta + 0.03) - np.sin(theta))
    assert np.max(np.abs(found[:, 0] - (theta - tau))) < 1e-14


def test_command_effects_act_in_their_order(derived):
    u = 15 * np.sin(11 * TIME) + 6 * np.sign(np.sin(70 * TIME))
    values = {
        "delay": 0.0024,
        "hysteresis_width": 0.8,
        "deadband_width": 1.1,
        "saturation_limit": 12.0,
        "gain": 0.05,
        "posgain_slope": 0.9,
        "droop_depth": 0.2,
        "droop_tau": 0.1,
    }
    found = co_simulation(derived("signal-effect", values), {"u": u, "x": X}, ["y"])[:, 0]
    late = np.interp(TIME - 0.0024, np.concatenate([[-TS], TIME]), np.concatenate([[0.0], u]), left=0.0)
    play, h = np.empty_like(u), 0.0
    for k, value in enumerate(late):
        h = min(max(h, value - 0.8), value + 0.8)
        play[k] = h
    expected = np.clip(play - np.clip(play, -1.1, 1.1), -12.0, 12.0)
    expected *= 1.05 * (1 + 0.9 * X) * (1 - 0.2 * (1 - np.exp(-TIME / 0.1)))
    assert np.max(np.abs(found - expected)) < 1e-11


def test_the_mode_is_the_held_second_order_system_of_scipy(derived):
    u, freq, zeta = 15 * np.sin(11 * TIME) + 6 * np.sign(np.sin(70 * TIME)), 18.0, 0.35
    w = 2 * np.pi * freq
    system = (np.array([[0, 1], [-w * w, -2 * zeta * w]]), np.array([[0], [w * w]]), np.array([[1.0, 0]]), np.zeros((1, 1)))
    _, expected, _ = dlsim(cont2discrete(system, TS), u)
    fmu = derived("signal-effect", {"mode_freq": freq, "mode_zeta": zeta, "backpressure_coef": 2.0})
    found = co_simulation(fmu, {"u": u, "v": V}, ["y"])[:, 0]
    assert np.max(np.abs(found - (expected[:, 0] - 2.0 * V))) < 1e-9


@pytest.mark.parametrize("delay", [0.0, 0.0006, 0.001, 0.0043])
def test_a_sensor_shows_the_past_of_the_signal_that_a_master_hands_on(derived, delay):
    fmu = derived("sensor-effect", {"delay": delay, "gain": 0.02, "offset_value": -0.3})
    # Gauss-Seidel sets the value of the end of the step; the first value held before the start.
    ahead = np.append(X[1:], X[-1])
    found = co_simulation(fmu, {"u": ahead}, ["y"])[:, 0]
    expected = 1.02 * np.interp(TIME + TS - delay, TIME, X, left=ahead[0]) - 0.3
    settled = TIME > delay + 2 * TS
    settled[-1] = False
    assert np.max(np.abs(found - expected)[settled]) < 1e-12
