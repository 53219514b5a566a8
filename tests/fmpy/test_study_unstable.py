"""`airloop refine` on an inverted pendulum that a regulator holds: its records are predicted over windows that start from
measured states, whose noise an unstable plant makes grow. The machine is typed here, the FMU is made of the same declared
equations in C."""

import json

import numpy as np
import pytest

from command import start
from held import advanced
from test_study import amended_has_printed_errors, named, refine
from third_party_fmu import System, build

STEP, COUNT, FINE = 0.005, 2000, 10
CART, POLE, LENGTH, DRAG, JOINT, GRAVITY = 1.0, 0.2, 0.3, 2.0, 0.002, 9.81
NOISE = (2e-4, 5e-4)
GAINS = (-6.32, -9.32, -48.6, -9.33)
EQUATIONS = """double s = sin(th), c = cos(th);
double a11 = cart + pole, a12 = pole * length * c, a22 = pole * length * length * 4.0 / 3.0;
double r1 = F - drag * v + pole * length * om * om * s, r2 = pole * gravity * length * s - joint * om + tau;
double det = a11 * a22 - a12 * a12;
der_x = v; der_th = om; der_v = (a22 * r1 - a12 * r2) / det; der_om = (a11 * r2 - a12 * r1) / det;
"""
SYSTEM = System(
    "pendulum",
    STEP,
    1.0,
    1,
    {"x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x"), "th": ("rad", 0.1, ""), "om": ("rad/s", 0.1, "th")},
    {"F": ("N", 5.0), "tau": ("N.m", 0.0)},
    {
        "cart": (CART, "kg", 0.01),
        "pole": (POLE, "kg", 0.01),
        "length": (LENGTH, "m", 0.01),
        "drag": (DRAG, "N.s/m", 0.03),
        "joint": (JOINT, "N.m.s/rad", 0.03),
        "gravity": (GRAVITY, "m/s2", 0.0),
    },
    {},
    {},
    None,
)
OUTPUTS = 'system = "pendulum.fmu"\n[inputs]\nF = { column = "F", hold = true }\n[outputs]\nx = { column = "x" }\nth = { column = "th" }\n'
WINDOWS = """[states]
x = { column = "x" }
v = { derivative_of = "x", low_pass_hz = 20.0 }
th = { column = "th" }
om = { derivative_of = "th", low_pass_hz = 20.0 }
[error]
windows_s = 0.5
"""


def record(rng, kind, value, off):
    """Rows of time, command and both measured positions of a machine that lacks an effect and whose declared values are off."""
    cart, pole, length, drag, joint = np.array([CART, POLE, LENGTH, DRAG, JOINT]) * (1 + off)

    def rate(state, force):
        x, v, th, om = state
        s, c = np.sin(th), np.cos(th)
        if kind == "coulomb":
            force = force - value * np.tanh(v / 0.005)
        torque = -value * np.tanh(om / 0.02) if kind == "joint" else 0.0
        a11, a12, a22 = cart + pole, pole * length * c, pole * length**2 * 4 / 3
        r1 = force - drag * v + pole * length * om**2 * s
        r2 = pole * GRAVITY * length * s - joint * om + torque
        det = a11 * a22 - a12**2
        return np.array([v, (a22 * r1 - a12 * r2) / det, om, (a11 * r2 - a12 * r1) / det])

    wanted = np.repeat(rng.uniform(-0.3, 0.3, COUNT // 250), 250)
    state, seen, speed, sent, rows = np.array([0.0, 0.0, 0.02 * rng.standard_normal(), 0.0]), None, np.zeros(2), [], []
    for k in range(COUNT):
        y = np.array([state[0], state[2]]) + np.array(NOISE) * rng.standard_normal(2)
        if seen is not None:
            speed = 0.7 * speed + 0.3 * (y - seen) / STEP
        seen = y
        sent.append(float(np.clip(-np.dot(GAINS, [y[0] - wanted[k], speed[0], y[1], speed[1]]), -15.0, 15.0)))
        rows.append([k * STEP, sent[-1], *y])
        force = sent[max(0, k - round(value / STEP))] if kind == "delay" else sent[-1]
        if kind == "deadband":
            force = np.sign(force) * max(abs(force) - value, 0.0)
        state = advanced(rate, state, force, STEP, FINE)
    return np.array(rows)


def write_study(folder, kind, value, seed, windows=True):
    build(SYSTEM, EQUATIONS, folder)
    rng = np.random.default_rng(seed)
    off = 0.005 * rng.uniform(-1, 1, 5)
    text = OUTPUTS + (WINDOWS if windows else "")
    for k in range(4):
        np.savetxt(folder / f"r{k}.csv", record(rng, kind, value, off), delimiter=",", header="time,F,x,th", comments="", fmt="%.9g")
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{"estimation" if k < 3 else "validation"}"\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.mark.parametrize(
    ("kind", "name", "key", "value"),
    [
        ("delay", "delay@F", "delay", 0.015),
        pytest.param("coulomb", "coulomb@F", "force", 0.5, marks=pytest.mark.slow),
        ("deadband", "deadband@F", "width", 0.4),
        pytest.param("joint", "coulomb@tau", "force", 0.01, marks=pytest.mark.slow),
    ],
)
def test_what_it_lacks_is_named_and_not_what_brakes_the_growth_of_noise(tmp_path, kind, name, key, value):
    study = write_study(tmp_path / "case", kind, value, 7)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == [name], result.stdout
    assert report["effects"][0]["params"][key]["value"] == pytest.approx(value, rel=0.05)
    assert all(own["floors"] < 2.0 for own in report["remaining"]["signals"].values())
    # Steps of integration show where stiff friction meets an unstable plant.
    stiff = kind in ("coulomb", "joint")
    amended_has_printed_errors(study, tmp_path / "out", report, rel=0.03 if stiff else 1e-3)


def test_it_lacks_nothing_where_it_lacks_nothing(tmp_path):
    result = refine(write_study(tmp_path / "case", "none", 0.0, 8), tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert all(0.8 < own["floors"] < 1.25 for own in report["remaining"]["signals"].values())


def test_without_windows_it_says_what_to_write(tmp_path):
    study = write_study(tmp_path / "case", "coulomb", 0.5, 9, windows=False)
    result = start("refine", study, "-o", tmp_path / "out")
    assert result.returncode == 1
    for words in ("study.toml", "unstable", "windows_s = 0.", "[states]", "`om`"):
        assert words in result.stderr, result.stderr
    assert not (tmp_path / "out").exists()
