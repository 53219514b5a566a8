"""A rotor whose declared parameters are off by more than their tolerances say, besides something that the FMU does not know: the drag that a
declared friction stands for, or a slow sensor. The records are made here, by other code, with colored noise."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from held import simulated
from test_study import named, refine
from third_party_fmu import System, build

TORQUE, INERTIA, THRUST = 0.0082, 3.9e-5, 1.47e-5
DECLARED_FRICTION = 6e-5
ROTOR = System(
    "rotor",
    0.005,
    1.0,
    1,
    states={"w": ("rad/s", 500.0, ""), "T": ("N", 5.0, "")},
    inputs={"i": ("A", 0.0)},
    parameters={
        "K_t": (0.008, "N.m/A", 0.01),
        "J": (4e-5, "kg.m2", 0.01),
        "b": (DECLARED_FRICTION, "N.m.s/rad", 0.01),
        "c_T": (1.5e-5, "N.s2/rad2", 0.01),
    },
    measured={},
    ports={},
    excite=None,
    start={"w": 0.0, "T": 0.0},
)
# The air column follows within milliseconds.
EQUATIONS = "der_w = (K_t * i - b * w) / J;\nder_T = (c_T * w * fabs(w) - T) / 0.01;\n"
STUDY = """system = "rotor.fmu"
[inputs]
i = { column = "i", hold = true }
[outputs]
w = { column = "w" }
T = { column = "T" }
"""


def rotor(folder, friction, drag, sensor=0.0):
    """A study of five records; `sensor`: time constant of the sensor of thrust [s]."""
    build(ROTOR, EQUATIONS, folder)
    text = STUDY

    def rate(x, current):
        w, thrust, shown = x
        away = friction * w + drag * w * abs(w)
        return np.array([(TORQUE * current - away) / INERTIA, (THRUST * w * abs(w) - thrust) / 0.01, (thrust - shown) / (sensor or 1.0)])

    for k in range(5):
        draw = np.random.default_rng([31, k])
        current = np.round(np.repeat(draw.uniform(0.2, 8.0, 40), 45), 3)
        states = simulated(rate, np.zeros(3), current, 0.005, 8)
        colored = lfilter([0.8], [1.0, -0.6], draw.normal(0, 0.03, len(states)))
        thrust = np.round(states[:, 2 if sensor else 1] + colored, 3)
        rows = np.column_stack([0.005 * np.arange(len(states)), current, states[:, 0] + draw.normal(0, 1.0, len(states)), thrust])
        np.savetxt(folder / f"r{k}.csv", rows, fmt="%.7g", delimiter=",", header="time,i,w,T", comments="")
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{"estimation" if k < 3 else "validation"}"\ninitial = "fit"\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def answer(study, out):
    result = refine(study, out)
    return json.loads((out / "report.json").read_text()), result.stdout + result.stderr


@pytest.mark.slow
def test_a_drag_that_the_declared_friction_stands_for_is_a_law_over_the_speed_alone(tmp_path):
    friction, drag = 1e-5, 1.1e-7
    report, told = answer(rotor(tmp_path, friction, drag), tmp_path / "out")
    law = report["law"]
    # The rotor never turns backwards: the square of its speed with the sign or without.
    assert law["formula"] in ("f - (a1*|x|*x + a2*x)", "f - (a1*x^2 + a2*x)"), told
    assert law["params"]["a1"]["value"] == pytest.approx(drag / TORQUE, rel=2e-3), told
    assert law["params"]["a2"]["value"] == pytest.approx((friction - DECLARED_FRICTION) / TORQUE, rel=0.02), told
    assert report["complete"], told


def test_a_slow_sensor_is_named_beside_parameters_that_are_off(tmp_path):
    report, told = answer(rotor(tmp_path, DECLARED_FRICTION, 0.0, sensor=0.04), tmp_path / "out")
    assert named(report) == ["sensor.lag"], told
    [lag] = [e for e in report["effects"] if e["selected"]]
    assert lag["params"]["tau"]["value"] == pytest.approx(0.04, rel=0.03), told
