"""Reference trajectory of the pneumatic cart-pole: monolithic equations, SciPy Radau, restarted at every sample.

    python tests/reference/make_reference.py      writes tests/data/reference_cart_pole.csv

The equations are typed here a second time on purpose: nothing of the project's own models, FMUs or master is used, so
that agreement means something. Two independent integrators are in this file: Radau (the reference), and a fixed-step
RK4 with 100 sub-steps per sample (`--method rk4`, a fraction of a second) which agrees with it to about 1e-9.

Problem: the paper's pneumatic cart-pole (eq. 4, 8, 10, 11) from rest at zero; command u(t) = 20 sin(2 pi t) N, sampled
each 1 ms and held; F_act is held over each sample, friction and mechanics are continuous; 3 s.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

SAMPLE_TIME = 1e-3  # s
STOP_TIME = 3.0  # s
DATA = Path(__file__).resolve().parents[1] / "data" / "reference_cart_pole.csv"
STORED_EVERY = 10  # samples between stored rows: 10 ms

# Eq. 8: y(k) = -A1 y(k-1) + B0 u(k) + B1 u(k-1), y = [F_hat, F_act]
A1 = np.array([[-1.0144, 0.0216], [-0.0527, -0.9537]])
B0 = np.array([0.6619, 0.0764])
B1 = np.array([-0.6557, -0.0847])

# Eq. 4
M_C, M_P, LENGTH, GRAVITY, B_P = 0.399, 0.1, 0.2, 9.81, 0.0006


def command(k):
    """Force command [N] of sample k: 20 N, 1 Hz."""
    return 20.0 * np.sin(2.0 * np.pi * k * SAMPLE_TIME)


def actuator_forces(u):
    """[F_hat, F_act] [N] for each sample of the command `u` [N], from y(-1) = u(-1) = 0."""
    y, y_before, u_before = np.empty((len(u), 2)), np.zeros(2), 0.0
    for k, u_k in enumerate(u):
        y[k] = -A1 @ y_before + B0 * u_k + B1 * u_before
        y_before, u_before = y[k], u_k
    return y


def piston_friction(v):
    """Eq. 10 [N]."""
    return 1.5145 * np.tanh(40.8926 * v) + 49.2734 * v


def cart_friction(v):
    """Eq. 11 [N]."""
    return 5.7910 * np.tanh(63.7045 * (v - 0.0064)) - 2.3170


def mechanics(state, force):
    """Eq. 4: time derivative of [x, theta, v, omega] under the force [N] on the cart."""
    _, theta, v, omega = state
    sin, cos = np.sin(theta), np.cos(theta)
    mass = np.array([[M_C + M_P, M_P * LENGTH * cos], [M_P * LENGTH * cos, M_P * LENGTH**2]])
    right = np.array([force + M_P * LENGTH * omega**2 * sin, -B_P * omega - M_P * GRAVITY * LENGTH * sin])
    a, alpha = np.linalg.solve(mass, right)
    return np.array([v, omega, a, alpha])


def right_hand_side(state, f_act):
    """Mechanics and both frictions under the held actuator force [N]."""
    v = state[2]
    return mechanics(state, f_act - piston_friction(v) - cart_friction(v))


def one_sample_radau(state, f_act):
    """State one sample later, by Radau IIA(5)."""
    solution = solve_ivp(
        lambda _, y: right_hand_side(y, f_act), (0.0, SAMPLE_TIME), state, method="Radau", rtol=1e-10, atol=1e-13
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    return solution.y[:, -1]


def one_sample_rk4(state, f_act, substeps=100):
    """State one sample later, by the classical Runge-Kutta method."""
    h = SAMPLE_TIME / substeps
    for _ in range(substeps):
        k1 = right_hand_side(state, f_act)
        k2 = right_hand_side(state + h / 2 * k1, f_act)
        k3 = right_hand_side(state + h / 2 * k2, f_act)
        k4 = right_hand_side(state + h * k3, f_act)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state


def trajectory(stop_time=STOP_TIME, one_sample=one_sample_radau):
    """Time [s], states (n+1, 4) and actuator forces (n+1, 2) at the samples 0..n."""
    n = round(stop_time / SAMPLE_TIME)
    forces = actuator_forces(command(np.arange(n + 1)))
    states = np.zeros((n + 1, 4))
    for k in range(n):
        states[k + 1] = one_sample(states[k], forces[k, 1])
    return np.arange(n + 1) * SAMPLE_TIME, states, forces


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", choices=["radau", "rk4"], default="radau")
    parser.add_argument("-o", "--output", type=Path, default=DATA)
    arguments = parser.parse_args()
    integrator = {"radau": one_sample_radau, "rk4": one_sample_rk4}[arguments.method]
    time, states, forces = trajectory(one_sample=integrator)
    rows = np.column_stack([time, states, forces])[::STORED_EVERY]
    header = "time,x,theta,v,omega,F_hat,F_act"
    np.savetxt(arguments.output, rows, delimiter=",", header=header, comments="", fmt=["%.3f"] + ["%.13g"] * 6)
    print(f"{arguments.output}: {len(rows)} rows, RMS of x {np.sqrt(np.mean(states[:, 0] ** 2)):.6f} m")


if __name__ == "__main__":
    main()
