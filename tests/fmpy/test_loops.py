"""Algebraic loops at communication points through `airloop run`, against SciPy, with the shipped FMUs."""

import json
import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from test_masters import FMUS, start
from test_reference import reference

MASTERS = ["monolithic", "gauss-seidel", "jacobi", "interface-jacobian"]
STEPPING = MASTERS[1:]


def system_of(tmp_path, components, connections, port="F"):
    """A system of `components` {name: FMU}; `connections` as (from, to, factor, offset), the system input as `port`."""
    ends = [end for link in connections for end in link[:2] if "." in end]
    inputs = {link[1] for link in connections}
    elements = ""
    for name, fmu in components.items():
        rows = "".join(
            f'<ssd:Connector name="{end.split(".")[1]}" kind="{"input" if end in inputs else "output"}"/>'
            for end in sorted(set(ends))
            if end.startswith(f"{name}.")
        )
        source = os.path.relpath(FMUS / fmu, tmp_path)
        elements += f'<ssd:Component name="{name}" source="{source}"><ssd:Connectors>{rows}</ssd:Connectors></ssd:Component>'

    def side(which, end):
        if "." not in end:
            return f'{which}Connector="{end}"'
        element, connector = end.split(".")
        return f'{which}Element="{element}" {which}Connector="{connector}"'

    links = "".join(
        f'<ssd:Connection {side("start", a)} {side("end", b)} suppressUnitConversion="true">'
        f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/></ssd:Connection>'
        for a, b, factor, offset in connections
    )
    outside = any("." not in link[0] for link in connections)
    connectors = f'<ssd:Connectors><ssd:Connector name="{port}" kind="input"/></ssd:Connectors>' if outside else ""
    names = "http://ssp-standard.org/SSP1/SystemStructure"
    path = tmp_path / "system.ssd"
    path.write_text(
        f'<ssd:SystemStructureDescription version="1.0" name="s" xmlns:ssd="{names}Description" xmlns:ssc="{names}Common">'
        f'<ssd:System name="s">{connectors}<ssd:Elements>{elements}</ssd:Elements>'
        f"<ssd:Connections>{links}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"
    )
    return path


def run(system, folder, *options):
    outcome = start("run", system, *options, "--no-plots", "-q", "-o", folder)
    assert outcome.returncode == 0, outcome.stderr
    result = np.genfromtxt(folder / "result.csv", delimiter=",", names=True, deletechars="")
    return result, json.loads((folder / "summary.json").read_text())


@pytest.mark.parametrize("master", MASTERS)
def test_two_static_frictions_in_a_loop_agree_with_fsolve_in_every_row(tmp_path, master):
    links = [("a.f", "b.v", 0.01, 0.02), ("b.f", "a.v", -0.02, 0.1)]
    system = system_of(tmp_path, {"a": "friction.fmu", "b": "friction.fmu"}, links)

    def rest(forces):
        a, b = forces
        return a - reference.piston_friction(-0.02 * b + 0.1), b - reference.piston_friction(0.01 * a + 0.02)

    expected = fsolve(rest, (2.0, 3.0), xtol=1e-13)
    assert expected[0] == pytest.approx(2.519, abs=1e-3)
    result, summary = run(system, tmp_path / "out", "--stop", "0.1", "--step", "10ms", "--master", master)
    assert len(result) == 11
    for name, value in zip(("a.f", "b.f"), expected):
        assert np.max(np.abs(result[name] - value)) < 1e-10
    assert any(note.startswith("an algebraic loop is solved for a.v, b.v") for note in summary["fallbacks"])


# Two cart-poles that push each other with their accelerations; the second is held by a spring.
PUSH = [("one.a", "two.F", 0.3, 0.0), ("two.a", "one.F_ext", -0.2, 0.5), ("two.x", "two.F_ext", -3.0, 0.0)]


def coupled(_, s):
    one, two = s[:4], s[4:]

    def forces(a):
        return 2.5 - 0.2 * a[1], 0.3 * a[0] - 3.0 * two[0]

    def accelerations(a):
        first, second = forces(a)
        return np.array([reference.mechanics(one, first)[2], reference.mechanics(two, second)[2]])

    # Accelerations are affine in the forces: a = p + Q a.
    p = accelerations(np.zeros(2))
    q = np.column_stack([accelerations(unit) - p for unit in np.eye(2)])
    first, second = forces(np.linalg.solve(np.eye(2) - q, p))
    return np.concatenate([reference.mechanics(one, first), reference.mechanics(two, second)])


@pytest.fixture(scope="module")
def truth():
    return solve_ivp(coupled, (0.0, 1.0), np.zeros(8), method="Radau", rtol=1e-11, atol=1e-13).y[:, -1]


def state_error(row, truth):
    found = [row[f"{name}.{state}"] for name in ("one", "two") for state in ("x", "theta", "v", "omega")]
    return np.max(np.abs(np.array(found) - truth)) / np.max(np.abs(truth))


def push(tmp_path, folder, *options):
    system = system_of(tmp_path, {"one": "cart-pole.fmu", "two": "cart-pole.fmu"}, PUSH)
    result, summary = run(system, tmp_path / folder, "--stop", "1", "--set", "one.F=2", *options)
    # The loop holds in every row.
    first = [
        reference.mechanics([row[f"one.{name}"] for name in ("x", "theta", "v", "omega")], 2.5 - 0.2 * row["two.a"])[2]
        for row in result
    ]
    assert np.max(np.abs(result["one.a"] - first)) < 1e-9 * np.max(np.abs(first))
    return result, summary


@pytest.mark.parametrize(
    "options, limit, order",
    [
        (("gauss-seidel",), 2e-2, 1),
        (("jacobi",), 2e-2, 1),
        (("gauss-seidel", "--extrapolation", "1"), 5e-3, 2),
        (("jacobi", "--extrapolation", "2"), 1e-3, 2.6),
        (("interface-jacobian", "--inputs", "held"), 5e-4, 2),
        (("interface-jacobian",), 1e-6, 3),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_loop_through_states_converges_with_the_order_of_its_master(tmp_path, truth, options, limit, order):
    errors = [
        state_error(push(tmp_path, step, "--step", step, "--master", *options)[0][-1], truth) for step in ("20ms", "10ms")
    ]
    print(errors)
    assert errors[0] < limit
    assert np.log2(errors[0] / errors[1]) > order - 0.15


def test_the_monolithic_master_is_the_reference(tmp_path, truth):
    result, _ = push(tmp_path, "out", "--step", "50ms", "--master", "monolithic")
    assert state_error(result[-1], truth) < 1e-8


@pytest.mark.parametrize("master", STEPPING)
def test_adaptive_steps_solve_loops_and_take_them_back(tmp_path, truth, master):
    options = ("--step", "10ms", "--master", master, "--adaptive")
    result, summary = push(tmp_path, "out", *options, "--step-tolerance", "1e-5")
    assert state_error(result[-1], truth) < 1e-3
    assert summary["adaptive"]["accepted"] == len(result) - 1


def test_the_coupling_error_of_a_loop_is_estimated(tmp_path, truth):
    options = ("--step", "10ms", "--estimate-coupling-error", "--coupling-signal", "one.a")
    result, summary = push(tmp_path, "out", *options)
    signal = next(signal for signal in summary["coupling_error"]["signals"] if signal["name"] == "one.a")
    fine, _ = push(tmp_path, "fine", "--step", "10ms", "--master", "monolithic")
    true = np.sqrt(np.mean((result["one.a"] - fine["one.a"]) ** 2))
    assert 0.5 < signal["rms_error"] / true < 2
