"""`airloop refine` where the effect acts on a signal that one FMU gives another and no record shows: a drive that follows its
command late moves a cart on a spring. The machine is typed here, the FMUs are made of the same declared equations in C.

And a cart whose velocity is a local variable of its FMU, alone."""

import json

import fmpy
import fmpy.validation
import numpy as np
import pytest

from command import start
from test_study import named, refine
from third_party_fmu import System, make

STEP, COUNT, FINE, NOISE = 0.01, 1200, 10, 2e-4
LATE, FORCE, MASS, DAMPING, STIFFNESS = 0.06, 20.0, 1.5, 6.0, 120.0
EQUATIONS = {
    "drive": "der_w = (u - w) / late;\n",
    "cart": "der_x = v;\nder_v = (force * s - damping * v - stiffness * x) / mass;\n",
}
TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="slide"><ssd:System name="slide">
  <ssd:Connectors>
    <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
    <ssd:Connector name="x" kind="output"><ssc:Real/></ssd:Connector>
  </ssd:Connectors>
  <ssd:Elements>
    <ssd:Component name="drive" source="drive.fmu"><ssd:Connectors>
      <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="w" kind="output"><ssc:Real/></ssd:Connector>
    </ssd:Connectors></ssd:Component>
    <ssd:Component name="cart" source="cart.fmu"><ssd:Connectors>
      <ssd:Connector name="s" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="x" kind="output"><ssc:Real/></ssd:Connector>
    </ssd:Connectors></ssd:Component>
  </ssd:Elements>
  <ssd:Connections>
    <ssd:Connection startConnector="u" endElement="drive" endConnector="u"/>
    <ssd:Connection startElement="drive" startConnector="w" endElement="cart" endConnector="s"/>
    <ssd:Connection startElement="cart" startConnector="x" endConnector="x"/>
  </ssd:Connections>
</ssd:System></ssd:SystemStructureDescription>
"""


def declared(name, states, inputs, parameters):
    ones = {key: (value, "1", 0.0) for key, value in parameters.items()}
    return System(name, STEP, 1.0, 1, states, inputs, ones, {}, {}, None, short=False)


def command(rng):
    """Slow sines, and steps that are held."""
    t = STEP * np.arange(COUNT)
    sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.13, 0.31, 0.7, 1.3))
    return np.round(0.3 * sines + np.repeat(rng.uniform(-0.8, 0.8, COUNT // 80), 80), 4)


class Passed:
    """What comes out of an effect for what goes in, over fine steps of h."""

    def __init__(self, kind, values):
        self.kind, self.values, self.out, self.last = kind, values, None, None

    def __call__(self, value, h):
        q, kind = self.values, self.kind
        if self.out is None:
            self.out = self.last = value
        middle, self.last = 0.5 * (self.last + value), value
        if kind == "deadband":
            self.out = np.sign(value) * max(abs(value) - q[0], 0.0)
        elif kind == "saturation":
            self.out = min(max(value, -q[0]), q[0])
        elif kind == "limits":
            self.out = min(max(value, q[0]), q[1])
        elif kind == "hysteresis":
            self.out = max(value - q[0], min(self.out, value + q[0]))
        elif kind == "fill":
            self.out += (middle - self.out) * (1 - np.exp(-h / (q[0] if middle > self.out else q[1])))
        elif kind == "rate_limit":
            self.out += min(max(value - self.out, -q[0] * h), q[0] * h)
        else:
            self.out = value
        return self.out


def measured(u, effect):
    """Positions of the cart; the drive is solved exactly, the cart by the midpoint rule."""
    w, x, v, h, shown, passed = 0.0, 0.0, 0.0, STEP / FINE, [], Passed(*effect)
    s = passed(w, h)
    for sent in u:
        shown.append(x)
        for _ in range(FINE):
            w = sent + (w - sent) * np.exp(-h / LATE)
            before, s = s, passed(w, h)
            pull = 0.5 * FORCE * (before + s)
            xm, vm = x + 0.5 * h * v, v + 0.5 * h * (pull - DAMPING * v - STIFFNESS * x) / MASS
            x, v = x + h * vm, v + h * (pull - DAMPING * vm - STIFFNESS * xm) / MASS
    return np.array(shown)


def write_study(folder, effect, seed):
    (folder / "equations").mkdir(parents=True)
    for name, text in EQUATIONS.items():
        (folder / "equations" / f"{name}.h").write_text(text)
    drive = declared("drive", {"w": ("1", 1.0, "")}, {"u": ("1", 1.0)}, {"late": LATE})
    cart = declared(
        "cart",
        {"x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x")},
        {"s": ("1", 1.0)},
        {"force": FORCE, "mass": MASS, "damping": DAMPING, "stiffness": STIFFNESS},
    )
    for system in (drive, cart):
        make(system, folder / f"{system.name}.fmu", home=folder)
    (folder / "system.ssd").write_text(TEXT)
    text = 'system = "system.ssd"\n[inputs]\nu = { column = "u", hold = true }\n[outputs]\nx = { column = "x", unit = "m" }\n'
    rng = np.random.default_rng(seed)
    for k in range(4):
        u = command(rng)
        x = measured(u, effect) + NOISE * rng.standard_normal(COUNT)
        np.savetxt(
            folder / f"r{k}.csv", np.column_stack([STEP * np.arange(COUNT), u, x]), delimiter=",", header="time,u,x", comments="", fmt="%.8g"
        )
        role = "estimation" if k < 3 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ "drive.w" = 0.0, "cart.x" = 0.0, "cart.v" = 0.0 }}\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.mark.parametrize(
    ("kind", "values", "names"),
    [
        ("deadband", [0.12], ["width"]),
        ("saturation", [0.7], ["limit"]),
        ("hysteresis", [0.06], ["width"]),
        ("limits", [-0.5, 0.8], ["low", "high"]),
        ("fill", [0.03, 0.12], ["up", "down"]),
        ("rate_limit", [2.5], ["rate"]),
    ],
)
def test_what_a_signal_between_fmus_lacks_is_named_there_and_runs(tmp_path, kind, values, names):
    study = write_study(tmp_path / "case", (kind, values), 5)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == [f"{kind}@cart.s"], result.stdout
    for name, value in zip(names, values):
        assert report["effects"][0]["params"][name]["value"] == pytest.approx(value, rel=0.05)
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    before, after = (report["residual"]["validation"][key]["x"] for key in ("rms_before", "rms_after"))
    # What is left of the error is the noise of the sensor; the block of a play works at samples.
    assert after < 2 * NOISE < 0.1 * before
    assert summary["validation"]["rms"]["x"] == pytest.approx(after, abs=0.02 * before)


def test_a_signal_between_fmus_that_lacks_nothing_is_not_named(tmp_path):
    study = write_study(tmp_path / "case", ("none", []), 6)
    plan = start("refine", study, "--plan")
    assert plan.returncode == 0, plan.stderr
    here = next(line for line in plan.stdout.splitlines() if line.startswith("cart.s") or " cart.s" in line)
    assert all(kind in plan.stdout for kind in ("rate_limit", "hysteresis", "deadband")), here
    result = refine(study, tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr


@pytest.mark.parametrize("shown", ["x", "v"])
def test_a_local_variable_of_an_fmu_becomes_an_output_of_the_amended_system(tmp_path, shown):
    dry, vt = 4.0, 0.05
    (tmp_path / "equations").mkdir()
    (tmp_path / "equations" / "cart.h").write_text("der_x = v;\nder_v = (s - damping * v - stiffness * x) / mass;\n")
    values = {"mass": (MASS, "kg", 0.0), "damping": (DAMPING, "N.s/m", 0.0), "stiffness": (STIFFNESS, "N/m", 0.0)}
    states = {"x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x")}
    cart = System("cart", STEP, 1.0, 1, states, {"s": ("N", 20.0)}, values, {}, {}, None, short=False, hidden=("v",))
    make(cart, tmp_path / "cart.fmu", home=tmp_path)
    unit = {"x": "m", "v": "m/s"}[shown]
    text = f'system = "cart.fmu"\n[inputs]\ns = {{ column = "s", hold = true }}\n[outputs]\n{shown} = {{ column = "{shown}", unit = "{unit}" }}\n'
    rng = np.random.default_rng(3)
    for k in range(3):
        s, h, x, v, rows = 20.0 * command(rng), STEP / 50, 0.0, 0.0, []
        for t, force in zip(STEP * np.arange(COUNT), s):
            rows.append((t, force, {"x": x, "v": v}[shown] + NOISE * rng.standard_normal()))
            for _ in range(50):
                rate = lambda x, v: (force - DAMPING * v - STIFFNESS * x - dry * np.tanh(v / vt)) / MASS
                xm, vm = x + 0.5 * h * v, v + 0.5 * h * rate(x, v)
                x, v = x + h * vm, v + h * rate(xm, vm)
        np.savetxt(tmp_path / f"r{k}.csv", rows, delimiter=",", header=f"time,s,{shown}", comments="", fmt="%.8g")
        role = "estimation" if k < 2 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ x = 0.0, v = 0.0 }}\n'
    (tmp_path / "study.toml").write_text(text)
    result = refine(tmp_path / "study.toml", tmp_path / "out")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == ["coulomb@s"], result.stdout + result.stderr
    amended = tmp_path / "out" / "system"
    assert fmpy.validation.validate_fmu(str(amended / "cart.fmu")) == []
    description = fmpy.read_model_description(str(amended / "cart.fmu"))
    assert {v.name for v in description.modelVariables if v.causality == "output"} == {"x", "v"}
    run = start("run", amended / "system.ssd", "--study", tmp_path / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    before, after = (report["residual"]["validation"][key][shown] for key in ("rms_before", "rms_after"))
    assert after < 2 * NOISE < 0.1 * before
    assert summary["validation"]["rms"][shown] == pytest.approx(after, abs=0.01 * before)
