"""`airloop refine` on a position loop of two FMUs: a controller sends a voltage to an axis that has an input for forces, too,
which nothing drives. Signals and forces that move the same state are told apart, in whatever order the axis declares them."""

import json

import numpy as np
import pytest

from held import simulated
from segments import write_segments
from test_loops import system_of
from test_study import amended_has_printed_errors, named, refine
from third_party_fmu import System, build

STEP, COUNT, FINE, NOISE = 0.005, 2000, 10, (3e-4, 0.03)
MASS, DAMPING, FORCE = 2.0, 25.0, 12.0
STIFF, SLOW, FILTER = 60.0, 40.0, 0.01
AXIS = "der_x = v;\nder_v = (force * u + f - damping * v) / mass;\n"
CONTROLLER = "der_z = r - y;\nder_w = (stiff * (r - y) + slow * z - w) / late;\n"
LINKS = [("r", "controller.r", 1.0, 0.0), ("controller.w", "axis.u", 1.0, 0.0), ("axis.x", "controller.y", 1.0, 0.0)]
BEGIN = '{ "axis.x" = 0.0, "axis.v" = 0.0, "controller.z" = 0.0, "controller.w" = 0.0 }'


def write_system(folder, force_first):
    """Both FMUs in their system; the axis declares its force before its voltage or behind it."""
    inputs = {"u": ("V", 1.0), "f": ("N", 0.0)}
    inputs = dict(reversed(inputs.items())) if force_first else inputs
    states = {"x": ("m", 0.1, ""), "v": ("m/s", 0.1, "x")}
    values = {"mass": (MASS, "kg", 0.01), "damping": (DAMPING, "N.s/m", 0.03), "force": (FORCE, "N/V", 0.01)}
    build(System("axis", STEP, 1.0, 1, states, inputs, values, {}, {}, None), AXIS, folder / "a")
    states = {"z": ("m.s", 0.1, ""), "w": ("V", 1.0, "")}
    values = {"stiff": (STIFF, "V/m", 0.0), "slow": (SLOW, "V/(m.s)", 0.0), "late": (FILTER, "s", 0.0)}
    inputs = {"r": ("m", 1.0), "y": ("m", 0.0)}
    build(System("controller", STEP, 1.0, 1, states, inputs, values, {}, {}, None, short=False), CONTROLLER, folder / "c")
    components = {"controller": folder / "c" / "controller.fmu", "axis": folder / "a" / "axis.fmu"}
    system_of(folder, components, LINKS, port="r")


def record(wanted, kind, value):
    """Position and voltage of the loop, solved by a Runge-Kutta method of fourth order."""

    late = value if kind == "lag" else 1.0

    def rate(state, r):
        x, v, z, w, sent = state
        u = sent if kind == "lag" else w
        if kind == "saturation":
            u = np.clip(u, -value, value)
        if kind == "deadband":
            u = np.sign(u) * max(abs(u) - value, 0.0)
        pull = FORCE * u - DAMPING * v - (value * np.tanh(v / 0.005) if kind == "coulomb" else 0.0)
        return np.array([v, pull / MASS, r - x, (STIFF * (r - x) + SLOW * z - w) / FILTER, (w - sent) / late])

    return simulated(rate, np.zeros(5), wanted, STEP, FINE)[:, [0, 3]]


def write_study(folder, kind, value, force_first, seed):
    folder.mkdir(parents=True)
    write_system(folder, force_first)
    text = 'system = "system.ssd"\n[inputs]\nr = { column = "r", hold = true }\n[outputs]\n"axis.x" = { column = "x" }\n"controller.w" = { column = "w" }\n'
    rng, t, records = np.random.default_rng(seed), STEP * np.arange(COUNT), []
    for _ in range(4):
        sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.2, 0.6, 1.1))
        wanted = np.round(0.03 * sines + np.repeat(rng.uniform(-0.1, 0.1, COUNT // 100), 100), 4)
        wanted[0] = 0.0
        shown = record(wanted, kind, value) + np.array(NOISE) * rng.standard_normal((COUNT, 2))
        records.append(np.column_stack([t, wanted, shown]))
    text += write_segments(folder, records, "time,r,x,w", len(records) * [BEGIN])
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.mark.parametrize(
    ("kind", "name", "key", "value", "force_first"),
    [
        pytest.param("coulomb", "coulomb@axis.f", "force", 3.0, False, marks=pytest.mark.slow),
        ("coulomb", "coulomb@axis.f", "force", 3.0, True),
        ("saturation", "saturation@axis.u", "limit", 3.0, False),
        pytest.param("saturation", "saturation@axis.u", "limit", 3.0, True, marks=pytest.mark.slow),
        ("deadband", "deadband@axis.u", "width", 0.4, False),
        pytest.param("deadband", "deadband@axis.u", "width", 0.4, True, marks=pytest.mark.slow),
        pytest.param("lag", "lag@axis.u", "tau", 0.03, False, marks=pytest.mark.slow),
        pytest.param("lag", "lag@axis.u", "tau", 0.03, True, marks=pytest.mark.slow),
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
    # Steps of integration show at a controller that is as fast as two samples.
    amended_has_printed_errors(study, tmp_path / "out", report, rel=0.01)


@pytest.mark.parametrize("force_first", [False, True])
def test_a_loop_that_lacks_nothing_stays_as_it_is(tmp_path, force_first):
    result = refine(write_study(tmp_path / "case", "none", 0.0, force_first, 6), tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
