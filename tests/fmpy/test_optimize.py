"""`airloop optimize` on the pneumatic cart-pole: defects and roll-outs recomputed from the files with equations typed here.

The equations are those of the benchmark (paper eq. 4, 8, 10, 11); nothing of the solver or of the FMUs is used.
"""

import json
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm, logm

from command import ROOT, airloop

PROBLEM = ROOT / "examples" / "03_swing_up" / "problem.toml"
DURATION, SAMPLE, FEED = 2.0, 1e-3, 0.0764
AD = np.array([[1.0144, -0.0216], [0.0527, 0.9537]])
BD = AD @ [0.6619, FEED] + [-0.6557, -0.0847]
AC = logm(AD).real / SAMPLE
BC = AC @ np.linalg.solve(AD - np.eye(2), BD)
STATES = ["x", "theta", "v", "omega", "actuator.z[1]", "actuator.z[2]"]
# Local minima known at 100 intervals from the guess `pump`, by CasADi with IPOPT.
EXPECTED = json.loads((PROBLEM.parent / "expected.json").read_text())
MINIMA = EXPECTED["minima"]


def mechanics(s, force):
    """Rates of x, theta, v, omega under the force of the actuator."""
    _, theta, v, w = s
    f = force - 1.5145 * np.tanh(40.8926 * v) - 49.2734 * v - 5.7910 * np.tanh(63.7045 * (v - 0.0064)) + 2.3170
    mc, mp, length, g, b = 0.399, 0.1, 0.2, 9.81, 0.0006
    coupling = mp * length * np.cos(theta)
    matrix = [[mc + mp, coupling], [coupling, mp * length**2]]
    right = [f + mp * length * w**2 * np.sin(theta), -b * w - mp * g * length * np.sin(theta)]
    return np.concatenate([[v, w], np.linalg.solve(matrix, right)])


def rates(y, u):
    return np.concatenate([mechanics(y[:4], y[5] + FEED * u), AC @ y[4:] + BC * u])


def runge_kutta(f, y, h):
    a = f(y)
    b = f(y + h / 2 * a)
    c = f(y + h / 2 * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(y + h * c))


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    @cache
    def of(transcription, intervals=100):
        folder = tmp_path_factory.mktemp("plan")
        words = ("--transcription", transcription, "--intervals", intervals, "-q", "-o", folder)
        airloop("optimize", PROBLEM, *words)
        table = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True, deletechars="")
        command = np.genfromtxt(folder / "command.csv", delimiter=",", names=True, deletechars="")
        states = np.array([table[name] for name in STATES]).T
        return json.loads((folder / "summary.json").read_text()), table["time"], states, table["u"], command

    return of


def defects(transcription, y, u, n):
    """Defects of every interval, as the benchmark states them."""
    h = DURATION / n
    if transcription == "hermite-simpson":
        y, um, u = y[::2], u[1::2], u[::2]
    for k in range(n):
        a, b = y[k], y[k + 1]
        if transcription == "hermite-simpson":
            fa, fb = rates(a, u[k]), rates(b, u[k + 1])
            middle = (a + b) / 2 + h / 8 * (fa - fb)
            yield b - a - h / 6 * (fa + 4 * rates(middle, um[k]) + fb)
        elif transcription == "trapezoidal":
            yield b - a - h / 2 * (rates(a, u[k]) + rates(b, u[k + 1]))
        elif transcription == "multiple-shooting":
            s, z = a[:4], a[4:]
            for _ in range(round(h / SAMPLE)):
                force = z[1] + FEED * u[k]
                s = runge_kutta(lambda s, force=force: mechanics(s, force), s, SAMPLE)
                z = AD @ z + BD * u[k]
            yield b - np.concatenate([s, z])
        else:
            block = np.zeros((3, 3))
            block[:2, :2], block[:2, 2] = AC, BC
            z = [(expm(block * t) @ [*a[4:], u[k]])[:2] for t in (0.0, h / 2, h)]
            force = [one[1] + FEED * u[k] for one in z]
            fa, fb = mechanics(a[:4], force[0]), mechanics(b[:4], force[2])
            middle = (a[:4] + b[:4]) / 2 + h / 8 * (fa - fb)
            yield np.concatenate(
                [b[:4] - a[:4] - h / 6 * (fa + 4 * mechanics(middle, force[1]) + fb), b[4:] - z[2]]
            )


@pytest.mark.parametrize("transcription", MINIMA)
def test_a_reference_minimum_is_reached_and_the_defects_vanish(plan, transcription):
    summary, time, y, u, _ = plan(transcription)
    assert min(abs(summary["objective"] / known - 1) for known in MINIMA[transcription]) < EXPECTED["objective_tolerance"]
    assert max(np.abs(defect).max() for defect in defects(transcription, y, u, 100)) <= 1e-8
    assert summary["max_defect"] <= 1e-8 and summary["max_bound_violation"] <= 1e-8
    assert np.abs(y[0]).max() <= 1e-9
    assert np.abs(y[-1, :4] - [0, np.pi, 0, 0]).max() <= 1e-9
    assert np.abs(u).max() <= 157.07963267948966 + 1e-8 and np.abs(y[:, 0]).max() <= 0.15 + 1e-8
    assert (time[0], time[-1]) == (0.0, DURATION)


def continuous(transcription, y, u, n):
    """Final state with everything in continuous time, 20 Runge-Kutta steps per millisecond."""
    h, steps = DURATION / n, round(DURATION / n / SAMPLE) * 20
    if transcription == "hermite-simpson":
        um, u = u[1::2], u[::2]
    state = y[0]
    for k in range(n):

        def command(s, k=k):
            if transcription == "hermite-simpson":
                return (1 - s) * (1 - 2 * s) * u[k] + 4 * s * (1 - s) * um[k] + s * (2 * s - 1) * u[k + 1]
            if transcription == "trapezoidal":
                return (1 - s) * u[k] + s * u[k + 1]
            return u[k]

        d = h / steps
        for i in range(steps):
            start = i / steps
            a = rates(state, command(start))
            b = rates(state + d / 2 * a, command(start + 0.5 / steps))
            c = rates(state + d / 2 * b, command(start + 0.5 / steps))
            state = state + d / 6 * (a + 2 * b + 2 * c + rates(state + d * c, command(start + 1 / steps)))
    return state


def sampled(command):
    """Final state with the actuator sampled and the command held over every millisecond."""
    s, z = np.zeros(4), np.zeros(2)
    for u in command["u"][:-1]:
        force = z[1] + FEED * u
        for _ in range(20):
            s = runge_kutta(lambda s, force=force: mechanics(s, force), s, SAMPLE / 20)
        z = AD @ z + BD * u
    return s


@pytest.mark.parametrize("transcription", ["hermite-simpson", "multiple-shooting"])
def test_the_roll_outs_end_where_an_integration_of_the_equations_ends(plan, transcription):
    summary, _, y, u, command = plan(transcription)
    reported = summary["open_loop_final_state_error"]
    own = dict(zip(STATES, continuous(transcription, y, u, 100) - y[-1]))
    # An unstable motion amplifies what straight pieces of a parabola leave; a ten-thousandth of a radian is little
    # in addition to the error of the mesh.
    for name in STATES[:4]:
        assert abs(reported["continuous"][name] - own[name]) < 1e-4 * (10 if name == "omega" else 1), name
    own = dict(zip(STATES, sampled(command) - y[-1, :4]))
    for name in STATES[:4]:
        assert abs(reported["sampled"][name] - own[name]) < 1e-6, name
