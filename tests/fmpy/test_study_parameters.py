"""`airloop refine` where a declared parameter is off by far more than its tolerance: that is an effect of its own, named by
the parameter. A pendulum driven by a torque; its equation is typed here."""

import json

import numpy as np
import pytest

from command import ROOT, start

STEP, COUNT, NOISE = 0.01, 600, 2e-4
DECLARED = {"I": 0.02, "m": 0.4, "l": 0.2, "b": 0.01}
GRAVITY = 9.81


def torque(seed):
    """A sum of sines, held over each sample."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(COUNT)
    return sum(0.25 * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.4, 1.1, 1.9, 3.1))


def record(path, seed, true, dry):
    """`dry`: level of a dry friction that changes its sign over 0.05 rad/s."""
    rng, u = np.random.default_rng(100 + seed), torque(seed)

    def rate(y, tau):
        gravity = true["m"] * GRAVITY * true["l"] * np.sin(y[0])
        return np.array([y[1], (tau - gravity - true["b"] * y[1] - dry * np.tanh(y[1] / 0.05)) / true["I"]])

    y, h, angles = np.array([0.3 * (-1) ** seed, 0.0]), STEP / 20, []
    for tau in u:
        angles.append(y[0])
        for _ in range(20):
            a = rate(y, tau)
            b = rate(y + h / 2 * a, tau)
            c = rate(y + h / 2 * b, tau)
            y = y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c, tau))
    rows = np.column_stack([STEP * np.arange(COUNT), u, np.array(angles) + NOISE * rng.standard_normal(COUNT)])
    np.savetxt(path, rows, delimiter=",", header="time [s],torque [N.m],angle [rad]", comments="", fmt="%.9g")


def refined(folder, true, dry=0.0):
    values = "".join(f"{name} = {value}\n" for name, value in DECLARED.items())
    text = f'system = "{ROOT / "target/fmu/pendulum.fmu"}"\n[parameters]\n{values}'
    text += '[inputs]\ntau_ext = { column = "torque", hold = true }\n[outputs]\n'
    text += f'theta = {{ column = "angle", noise = {NOISE} }}\n'
    for k in range(5):
        record(folder / f"r{k}.csv", k, DECLARED | true, dry)
        role = "estimation" if k < 4 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = "fit"\n'
    (folder / "study.toml").write_text(text)
    result = start("refine", folder / "study.toml", "-o", folder / "out")
    report = json.loads((folder / "out" / "report.json").read_text())
    return result, {effect["id"]: effect for effect in report["effects"] if effect["selected"]}, report


def test_an_inertia_that_is_off_is_an_effect_with_its_value(tmp_path):
    result, effects, report = refined(tmp_path, {"I": 0.023})
    assert result.returncode == 0, result.stdout + result.stderr
    assert list(effects) == ["parameter@I"]
    delta = effects["parameter@I"]["params"]["delta"]
    assert delta["value"] == pytest.approx(0.003, rel=0.01) and delta["unit"] == "kg.m2"
    assert delta["ci95"][0] < 0.003 < delta["ci95"][1]
    assert report["complete"] and report["corrections"] == []
    assert effects["parameter@I"]["share"] > 0.98
    # The amended system has the value.
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", tmp_path / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"]["angle"] == pytest.approx(NOISE, rel=0.1)


def test_parameters_that_act_together_cannot_be_told_apart(tmp_path):
    # Gravity acts through the product of mass and distance alone.
    result, effects, report = refined(tmp_path, {"l": 0.215})
    assert result.returncode == 12, result.stdout + result.stderr
    [name] = effects
    group = {effect["id"] for effect in report["effects"] if effect["group"] == effects[name]["group"]}
    assert group == {"parameter@l", "parameter@m"}
    declared = DECLARED[name.split("@")[1]]
    assert effects[name]["params"]["delta"]["value"] / declared == pytest.approx(0.075, rel=0.02)


@pytest.mark.slow
def test_it_stands_beside_an_effect_of_the_list(tmp_path):
    result, effects, _ = refined(tmp_path, {"I": 0.023}, dry=0.02)
    assert result.returncode == 0, result.stdout + result.stderr
    assert set(effects) == {"parameter@I", "coulomb@tau_ext"}
    assert effects["parameter@I"]["params"]["delta"]["value"] == pytest.approx(0.003, rel=0.02)
    assert effects["coulomb@tau_ext"]["params"]["force"]["value"] == pytest.approx(0.02, rel=0.03)


def test_what_is_off_by_less_than_its_tolerance_is_a_correction(tmp_path):
    result, effects, report = refined(tmp_path, {"I": 0.02 * 1.015})
    assert result.returncode == 10, result.stdout + result.stderr
    assert effects == {}
    moved = {own["parameter"]: own["value"] / own["declared"] - 1 for own in report["corrections"]}
    assert moved["I"] == pytest.approx(0.015, abs=0.003)
