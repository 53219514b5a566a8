"""`airloop refine` on a position loop of two FMUs: a controller sends a voltage to an axis that has an input for forces, too,
which nothing drives. Signals and forces that move the same state are told apart, in whatever order the axis declares them."""

import json

import numpy as np
import pytest

from test_study import amended_has_printed_errors, named, refine
from third_party_fmu import System, build

STEP, COUNT, FINE, NOISE = 0.005, 2000, 10, (3e-4, 0.03)
MASS, DAMPING, FORCE = 2.0, 25.0, 12.0
STIFF, SLOW, FILTER = 60.0, 40.0, 0.01
AXIS = "der_x = v;\nder_v = (force * u + f - damping * v) / mass;\n"
CONTROLLER = "der_z = r - y;\nder_w = (stiff * (r - y) + slow * z - w) / late;\n"
TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="loop"><ssd:System name="loop">
  <ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>
  <ssd:Elements>
    <ssd:Component name="controller" source="controller.fmu"><ssd:Connectors>
      <ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="y" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="w" kind="output"><ssc:Real/></ssd:Connector>
    </ssd:Connectors></ssd:Component>
    <ssd:Component name="axis" source="axis.fmu"><ssd:Connectors>
      <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="x" kind="output"><ssc:Real/></ssd:Connector>
    </ssd:Connectors></ssd:Component>
  </ssd:Elements>
  <ssd:Connections>
    <ssd:Connection startConnector="r" endElement="controller" endConnector="r"/>
    <ssd:Connection startElement="controller" startConnector="w" endElement="axis" endConnector="u"/>
    <ssd:Connection startElement="axis" startConnector="x" endElement="controller" endConnector="y"/>
  </ssd:Connections>
</ssd:System></ssd:SystemStructureDescription>
"""


def fmus(folder, force_first):
    """Both FMUs; the axis declares its force before its voltage or behind it."""
    inputs = {"u": ("V", 1.0), "f": ("N", 0.0)}
    inputs = dict(reversed(inputs.items())) if force_first else inputs
    states = {"x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x")}
    values = {"mass": (MASS, "kg", 0.01), "damping": (DAMPING, "N.s/m", 0.03), "force": (FORCE, "N/V", 0.01)}
    build(System("axis", STEP, 1.0, 1, states, inputs, values, {}, {}, None), AXIS, folder / "a")
    states = {"z": ("m.s", 0.1, ""), "w": ("V", 1.0, "")}
    values = {"stiff": (STIFF, "V/m", 0.0), "slow": (SLOW, "V/(m.s)", 0.0), "late": (FILTER, "s", 0.0)}
    inputs = {"r": ("m", 1.0), "y": ("m", 0.0)}
    build(System("controller", STEP, 1.0, 1, states, inputs, values, {}, {}, None, short=False), CONTROLLER, folder / "c")
    for part, name in (("a", "axis"), ("c", "controller")):
        (folder / part / f"{name}.fmu").rename(folder / f"{name}.fmu")
    (folder / "system.ssd").write_text(TEXT)


def record(wanted, kind, value):
    """Position and voltage of the loop, solved by a Runge-Kutta method of fourth order."""

    def rate(state, r, late):
        x, v, z, w, sent = state
        u = sent if kind == "lag" else w
        if kind == "saturation":
            u = np.clip(u, -value, value)
        if kind == "deadband":
            u = np.sign(u) * max(abs(u) - value, 0.0)
        pull = FORCE * u - DAMPING * v - (value * np.tanh(v / 0.005) if kind == "coulomb" else 0.0)
        return np.array([v, pull / MASS, r - x, (STIFF * (r - x) + SLOW * z - w) / FILTER, (w - sent) / late])

    state, shown, h, late = np.zeros(5), [], STEP / FINE, value if kind == "lag" else 1.0
    for r in wanted:
        shown.append((state[0], state[3]))
        for _ in range(FINE):
            a = rate(state, r, late)
            b = rate(state + h / 2 * a, r, late)
            c = rate(state + h / 2 * b, r, late)
            state = state + h / 6 * (a + 2 * b + 2 * c + rate(state + h * c, r, late))
    return np.array(shown)


def write_study(folder, kind, value, force_first, seed):
    folder.mkdir(parents=True)
    fmus(folder, force_first)
    text = 'system = "system.ssd"\n[inputs]\nr = { column = "r", hold = true }\n[outputs]\n"axis.x" = { column = "x" }\n"controller.w" = { column = "w" }\n'
    rng, t = np.random.default_rng(seed), STEP * np.arange(COUNT)
    for k in range(4):
        sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.2, 0.6, 1.1))
        wanted = np.round(0.03 * sines + np.repeat(rng.uniform(-0.1, 0.1, COUNT // 100), 100), 4)
        wanted[0] = 0.0
        shown = record(wanted, kind, value) + np.array(NOISE) * rng.standard_normal((COUNT, 2))
        np.savetxt(folder / f"r{k}.csv", np.column_stack([t, wanted, shown]), delimiter=",", header="time,r,x,w", comments="", fmt="%.9g")
        role = "estimation" if k < 3 else "validation"
        begin = '"axis.x" = 0.0, "axis.v" = 0.0, "controller.z" = 0.0, "controller.w" = 0.0'
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ {begin} }}\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.mark.parametrize("force_first", [False, True])
@pytest.mark.parametrize(
    ("kind", "name", "key", "value"),
    [
        ("coulomb", "coulomb@axis.f", "force", 3.0),
        ("saturation", "saturation@axis.u", "limit", 3.0),
        ("deadband", "deadband@axis.u", "width", 0.4),
        ("lag", "lag@axis.u", "tau", 0.03),
    ],
)
def test_what_the_loop_lacks_is_named_at_its_port(tmp_path, kind, name, key, value, force_first):
    study = write_study(tmp_path / "case", kind, value, force_first, 5)
    result = refine(study, tmp_path / "out")
    # A lag is no lag with two times, and no mode with much damping.
    assert result.returncode == 0, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == [name], result.stdout
    assert report["effects"][0]["params"][key]["value"] == pytest.approx(value, rel=0.03)
    amended_has_printed_errors(study, tmp_path / "out", report, rel=0.01)


@pytest.mark.parametrize("force_first", [False, True])
def test_a_loop_that_lacks_nothing_stays_as_it_is(tmp_path, force_first):
    result = refine(write_study(tmp_path / "case", "none", 0.0, force_first, 6), tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
