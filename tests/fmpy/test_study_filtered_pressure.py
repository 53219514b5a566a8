"""`airloop refine` on a hydraulic axis with a leak past the piston, constants that are off by more than their tolerances, a pressure sensor
whose noise is not white, and a position that is rounded. The records are made here, by other code."""

import json

import numpy as np
from scipy.signal import lfilter

from held import simulated
from test_study import named, refine
from third_party_fmu import System, build

EQUATIONS = """const double flow = K_q * y;
der_y = (u - y) / tau;
der_p = (flow - A * v) / C_h;
der_v = (A * p - b * v - k * x) / m;
der_x = v;
"""
DECLARED = {
    "tau": (0.012, "s", 0.01),
    "K_q": (3e-5, "m3/(s.V)", 0.01),
    "A": (1e-3, "m2", 0.01),
    "C_h": (6e-13, "m3/Pa", 0.01),
    "m": (100.0, "kg", 0.01),
    "b": (1500.0, "N.s/m", 0.03),
    "k": (2e4, "N/m", 0.01),
}
OFF = {"tau": -0.019, "K_q": 0.03, "A": -0.015, "C_h": 0.017, "m": 0.012, "b": -0.025, "k": 0.03}
AXIS = System(
    "axis",
    0.002,
    1.0,
    1,
    states={"y": ("V", 5.0, ""), "p": ("Pa", 1e6, ""), "v": ("m/s", 0.1, ""), "x": ("m", 0.05, "")},
    inputs={"u": ("V", 0.0)},
    parameters=DECLARED,
    measured={},
    ports={},
    excite=None,
    start={"y": 0.0, "p": 0.0, "v": 0.0, "x": 0.0},
)
STUDY = """system = "axis.fmu"
[inputs]
u = { column = "u", hold = true }
[outputs]
p = { column = "p" }
x = { column = "x" }
"""
LEAK = 8e-12
STEP, SAMPLES = 0.002, 2000


def command(draw):
    t = STEP * np.arange(SAMPLES)
    waves = sum(np.sin(2 * np.pi * f * t + draw.uniform(0, 6.28)) / np.sqrt(f) for f in draw.uniform(0.4, 6, 8))
    steps = np.repeat(draw.uniform(-1, 1, SAMPLES // 100), 100)
    return np.round(3 * waves / np.abs(waves).max() + 4 * steps, 3) * np.minimum(t / 0.1, 1)


def test_an_effect_beside_corrections_that_leaves_filtered_noise_is_a_whole_answer(tmp_path):
    build(AXIS, EQUATIONS, tmp_path)
    true = {name: own[0] * (1 + OFF[name]) for name, own in DECLARED.items()}
    tau, gain, area, capacity, mass, damping, stiffness = true.values()

    def rate(state, u):
        y, p, v, x = state
        flow = gain * y - area * v - LEAK * p
        return np.array([(u - y) / tau, flow / capacity, (area * p - damping * v - stiffness * x) / mass, v])

    text = STUDY
    for k in range(5):
        draw = np.random.default_rng([45, k])
        u = command(draw)
        states = simulated(rate, np.zeros(4), u, STEP, 6)
        noise = lfilter([np.sqrt(0.75)], [1.0, -0.5], draw.normal(0, 8e3, SAMPLES))
        position = np.round(states[:, 3] + draw.normal(0, 2e-5, SAMPLES), 6)
        rows = np.column_stack([STEP * np.arange(SAMPLES), u, states[:, 1] + noise, position])
        np.savetxt(tmp_path / f"r{k}.csv", rows, fmt="%.8g", delimiter=",", header="time,u,p,x", comments="")
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{"estimation" if k < 3 else "validation"}"\n'
    (tmp_path / "study.toml").write_text(text)
    result = refine(tmp_path / "study.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == ["linear_leakage@der(p)"] and report["complete"], result.stdout
    [leak] = [effect["params"]["coef"] for effect in report["effects"] if effect["selected"]]
    low, high = leak["ci95"]
    assert low - 0.5 * (high - low) < LEAK / capacity < high + 0.5 * (high - low), leak
