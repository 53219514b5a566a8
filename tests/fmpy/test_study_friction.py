"""`airloop refine` on a spindle whose dry friction changes along a revolution, and grows with the load. The records are made here, by other
code than the FMU."""

import json

import numpy as np
import pytest

from held import simulated
from test_study import amended_has_printed_errors, named, refine
from third_party_fmu import System, build

J, B, W_C = 0.02, 0.05, 0.3
SPINDLE = System(
    "spindle",
    0.005,
    1.0,
    1,
    states={"phi": ("rad", 1.0, ""), "w": ("rad/s", 1.0, "phi")},
    inputs={"tau": ("N.m", 1.0)},
    parameters={"J": (J, "kg.m2", 0.01), "b": (B, "N.m.s/rad", 0.03)},
    measured={},
    ports={},
    excite=None,
)
STEP, SAMPLES, FINE = 0.005, 2401, 4
NOISE = 2e-3


def motion(torque, friction):
    """Angle [rad] under a torque that is held over each sample; `friction`: over angle, speed and torque."""

    def rate(x, u):
        return np.array([x[1], (u - B * x[1] - friction(*x, u) * np.tanh(x[1] / W_C)) / J])

    return simulated(rate, np.zeros(2), torque, STEP, FINE)[:, 0]


def study(folder, friction, seed):
    rng = np.random.default_rng(seed)
    build(SPINDLE, "der_phi = w;\nder_w = (tau - b * w) / J;\n", folder)
    text = 'system = "spindle.fmu"\n\n[inputs]\ntau = { column = "tau", hold = true }\n\n[outputs]\nphi = { column = "phi" }\n'
    t = STEP * np.arange(SAMPLES)
    for k in range(4):
        torque = sum(a * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for a, f in [(0.5, 0.2), (0.35, rng.uniform(0.5, 0.9)), (0.2, 1.7)])
        torque = np.round(torque, 4)
        angle = motion(torque, friction) + rng.normal(scale=NOISE, size=SAMPLES)
        np.savetxt(folder / f"r{k}.csv", np.array([t, torque, angle]).T, delimiter=",", header="time,tau,phi", comments="", fmt="%.9g")
        role = "validation" if k == 3 else "estimation"
        text += f'\n[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ phi = 0.0, w = 0.0 }}\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def found_in(path, out, kinds):
    result = refine(path, out)
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((out / "report.json").read_text())
    assert sorted(named(found)) == sorted(f"{kind}@tau" for kind in kinds) and found["complete"]
    amended_has_printed_errors(path, out, found)
    return {own["id"].split("@")[0]: {name: p["value"] for name, p in own["params"].items()} for own in found["effects"] if own["selected"]}


def test_friction_that_repeats_along_a_revolution_is_found_beside_its_mean(tmp_path):
    path = study(tmp_path, lambda phi, w, tau: 0.15 + 0.03 * np.sin(phi + 0.5), seed=4)
    params = found_in(path, tmp_path / "out", ["coulomb", "periodic_friction"])
    assert params["coulomb"]["force"] == pytest.approx(0.15, rel=0.02)
    repeated = params["periodic_friction"]
    assert repeated["amp"] == pytest.approx(0.03, rel=0.02) and repeated["period"] == pytest.approx(2 * np.pi, rel=2e-3)


def test_friction_in_proportion_to_the_torque_that_passes_is_no_constant_one(tmp_path):
    path = study(tmp_path, lambda phi, w, tau: 0.25 * abs(tau), seed=5)
    params = found_in(path, tmp_path / "out", ["load_friction"])
    assert params["load_friction"]["coef"] == pytest.approx(0.25, rel=0.02)
