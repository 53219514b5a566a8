"""`airloop refine` on machines of one FMU: stops at the lower end, forces and sensors that drift, limits of one direction, a
leak of gas, curved sensors, values in steps. The machines are typed here, the FMUs are made of the same declared equations in C."""

import dataclasses
import json

import numpy as np
import pytest

from command import start
from test_study import named, refine
from test_study_inner_signals import COUNT, STEP, command, declared
from third_party_fmu import build

FINE, NOISE = 10, 2e-4
MASS, DAMPING, STIFFNESS = 1.5, 6.0, 120.0
GAIN, LOSS, OUTSIDE, BULK = 4e-5, 6e-11, 101300.0, 2e9
EQUATIONS = {
    "slide": "der_x = v;\nder_v = (u + F - damping * v - stiffness * x) / mass;\n",
    "vessel": "der_p = bulk * (gain * u + q - loss * (p - 101300.0));\n",
}
SYSTEMS = {
    "slide": declared(
        "slide",
        {"x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x")},
        {"u": ("N", 1.0), "F": ("N", 0.0)},
        {"mass": MASS, "damping": DAMPING, "stiffness": STIFFNESS},
    ),
    "vessel": dataclasses.replace(
        declared("vessel", {"p": ("Pa", 1e5, "")}, {"u": ("1", 1.0), "q": ("m3/s", 0.0)}, {"bulk": BULK, "gain": GAIN, "loss": LOSS}),
        start={"p": OUTSIDE},
    ),
}


def slide(u, effect):
    kind, q = effect

    def rates(t, x, v, sent):
        force = sent
        if kind == "limits":
            force = min(max(force, q[0]), q[1])
        if kind == "quantization":
            force = q[0] * np.rint(force / q[0])
        if kind == "drift":
            force -= q[0] * t
        if kind == "lower_endstop" and x < q[2]:
            force += max(0.0, q[0] * (q[2] - x) - q[1] * v)
        return v, (force - DAMPING * v - STIFFNESS * x) / MASS

    x, v, h, shown = 0.0, 0.0, STEP / FINE, []
    for k, sent in enumerate(u):
        shown.append(x)
        for j in range(FINE):
            t = k * STEP + j * h
            a = rates(t, x, v, sent)
            b = rates(t + h / 2, x + h / 2 * a[0], v + h / 2 * a[1], sent)
            x, v = x + h * b[0], v + h * b[1]
    shown, t = np.array(shown), STEP * np.arange(len(u))
    if kind == "sensor.drift":
        shown = shown + q[0] * t
    if kind == "sensor.nonlinearity":
        shown = shown + q[0] * shown**2
    return shown


def vessel(u, effect):
    kind, q = effect

    def rate(p, sent):
        lost = 0.0
        if kind == "choked_flow":
            ratio = q[1] / p
            lost = q[0] * p * (1.0 if ratio < 0.528 else np.sqrt(max(0.0, 1 - ((ratio - 0.528) / 0.472) ** 2)))
        return BULK * (GAIN * sent - LOSS * (p - 101300.0) - lost)

    p, h, shown = OUTSIDE, STEP / FINE, []
    for sent in u:
        shown.append(p)
        for _ in range(FINE):
            p += h * rate(p + h / 2 * rate(p, sent), sent)
    return np.array(shown)


def write_study(folder, machine, effect, seed):
    build(SYSTEMS[machine], EQUATIONS[machine], folder)
    shown, unit = ("x", "m") if machine == "slide" else ("p", "Pa")
    begin = "x = 0.0, v = 0.0" if machine == "slide" else f"p = {OUTSIDE}"
    text = f'system = "{machine}.fmu"\n[inputs]\nu = {{ column = "u", hold = true }}\n'
    text += f'[outputs]\n{shown} = {{ column = "y", unit = "{unit}" }}\n'
    rng = np.random.default_rng(seed)
    for k in range(4):
        sent = 12.0 * command(rng) if machine == "slide" else 0.6 * np.abs(command(rng))
        y = (slide if machine == "slide" else vessel)(sent, effect)
        y = y + (NOISE if machine == "slide" else 300.0) * rng.standard_normal(COUNT)
        if effect[0] == "sensor.quantization":
            y = effect[1][0] * np.rint(y / effect[1][0])
        columns = np.column_stack([STEP * np.arange(COUNT), sent, y])
        np.savetxt(folder / f"r{k}.csv", columns, delimiter=",", header="time,u,y", comments="", fmt="%.9g")
        role = "estimation" if k < 3 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ {begin} }}\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.mark.parametrize(
    ("machine", "kind", "places", "values"),
    [
        ("slide", "lower_endstop", ["F"], {"stiffness": 3000.0, "damping": 15.0, "pos": -0.06}),
        ("slide", "drift", ["u", "F"], {"slope": 0.2}),
        ("slide", "limits", ["u"], {"low": -6.0, "high": 9.0}),
        ("slide", "sensor.drift", ["x"], {"slope": 1e-3}),
        ("slide", "sensor.nonlinearity", ["x"], {"coef": 0.8}),
        ("slide", "quantization", ["u"], {"step": 1.7}),
        ("slide", "sensor.quantization", ["x"], {"step": 8e-3}),
        ("vessel", "choked_flow", ["q"], {"coef": 3e-11, "outside": OUTSIDE}),
    ],
)
def test_what_a_machine_lacks_is_named_with_its_values_and_runs(tmp_path, machine, kind, places, values):
    study = write_study(tmp_path / "case", machine, (kind, list(values.values())), 3)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    ids = [kind] if kind.startswith("sensor.") else [f"{kind}@{place}" for place in places]
    assert len(named(report)) == 1 and named(report)[0] in ids, result.stdout
    for name, value in values.items():
        if name != "damping":
            assert report["effects"][0]["params"][name]["value"] == pytest.approx(value, rel=0.1)
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    before, after = (report["residual"]["validation"][key] for key in ("rms_before", "rms_after"))
    assert summary["validation"]["rms"]["y"] == pytest.approx(after["y"], abs=0.01 * before["y"])
    least = 0.0
    if kind == "sensor.quantization":
        # Noise before the rounding moves samples near an edge to the next step: that is left of any prediction.
        least = np.sqrt(values["step"] * NOISE * np.sqrt(2 / np.pi))
    assert after["y"] < max(0.3 * before["y"], 1.25 * least)


@pytest.mark.parametrize("machine", ["slide", "vessel"])
def test_a_machine_that_lacks_nothing_stays_as_it_is(tmp_path, machine):
    result = refine(write_study(tmp_path / "case", machine, ("none", []), 4), tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
