"""The half step of example 04: cost and durations against the reference, forces recomputed from equations typed here, the plan
rolled out through the FMU with its events, and the toes."""

import json
import math

import numpy as np
import pytest

import raw
from command import ROOT, airloop
from test_walker import STATES, Walker

FOLDER = ROOT / "examples" / "04_half_step"
# Variant B on (30, 10, 30) intervals, and the variants A and J.
EXPECTED = json.loads((FOLDER / "expected.json").read_text())
OBJECTIVE_B = EXPECTED["objective"]["value"]
SCALE = np.array([60.0, 1055.5751, 1055.5751])
M3, D, I3, MU, A, IU, MT, C, IT, IR, G = 6.0, 0.1, 0.1, 3.7, 0.35, 0.2, 0.8, 0.1, 0.005, 0.05, 9.81


def terms(q, v):
    """H, C q' + G, Jacobians of both feet, and the part of their accelerations other than J q''."""
    h, bias = np.zeros((6, 6)), np.zeros(6)
    th3, w3 = (q[2] + q[3]) / 2, (v[2] + v[3]) / 2
    total, k3 = M3 + 2 * (MU + MT), (M3 * D**2 + I3) / 4
    h[0, 0] = h[1, 1] = total
    bias[:2] = [M3 * D * math.sin(th3) * w3**2, -M3 * D * math.cos(th3) * w3**2 + total * G]
    jacobians, drifts = [], []
    for i in (0, 1):
        s, c, w, r, length = math.sin(q[2 + i]), math.cos(q[2 + i]), v[2 + i], v[4 + i], q[4 + i]
        moment = MU * A + MT * (length - C)
        h[0, 2 + i] = h[2 + i, 0] = moment * c - M3 * D / 2 * math.cos(th3)
        h[1, 2 + i] = h[2 + i, 1] = moment * s - M3 * D / 2 * math.sin(th3)
        h[0, 4 + i] = h[4 + i, 0] = MT * s
        h[1, 4 + i] = h[4 + i, 1] = -MT * c
        h[2 + i, 2 + i] = MU * A**2 + MT * (length - C) ** 2 + IU + IT + k3 + IR
        h[4 + i, 4 + i] = MT
        bias[0] += -moment * s * w**2 + 2 * MT * c * w * r
        bias[1] += moment * c * w**2 + 2 * MT * s * w * r
        bias[2 + i] = 2 * MT * (length - C) * r * w + moment * G * s - M3 * D * G / 2 * math.sin(th3)
        bias[4 + i] = -MT * (length - C) * w**2 - MT * G * c
        j = np.zeros((2, 6))
        j[:, :2] = np.eye(2)
        j[:, 2 + i], j[:, 4 + i] = [length * c, length * s], [s, -c]
        jacobians.append(j)
        drifts.append(np.array([2 * r * w * c - length * s * w**2, 2 * r * w * s + length * c * w**2]))
    h[2, 3] = h[3, 2] = k3 - IR
    return h, bias, jacobians, drifts


def contact_forces(state, u, feet):
    q, v = state[:6], state[6:12]
    h, bias, jacobians, drifts = terms(q, v)
    j, drift = np.vstack([jacobians[i] for i in feet]), np.concatenate([drifts[i] for i in feet])
    push = np.array([0, 0, -u[0], u[0], u[1], u[2]]) - bias
    n = len(drift)
    matrix = np.block([[h, -j.T], [j, np.zeros((n, n))]])
    return np.linalg.solve(matrix, np.concatenate([push, -drift]))[6:].reshape(-1, 2)


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    made = {}

    def of(*words):
        if words not in made:
            folder = tmp_path_factory.mktemp("half_step")
            airloop("optimize", FOLDER / "problem.toml", *words, "-q", "-o", folder)
            table = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True, deletechars="")
            made[words] = json.loads((folder / "summary.json").read_text()), table, folder
        return made[words]

    return of


def columns(table, *names):
    return np.array([table[name] for name in names]).T


def test_variant_b_has_the_reference_cost_and_durations(plan):
    summary, _, _ = plan()
    assert summary["status"] == "solved"
    assert summary["objective"] == pytest.approx(OBJECTIVE_B, abs=EXPECTED["objective"]["tolerance"])
    durations = EXPECTED["durations"]
    np.testing.assert_allclose(summary["durations"], durations["value"], atol=durations["tolerance"])
    assert summary["max_defect"] < 1e-8 and summary["max_bound_violation"] < 1e-8


def test_forces_of_the_ground_are_those_of_the_equations(plan):
    _, table, _ = plan()
    states = columns(table, *(f"walker.{name}" for name in STATES))
    inputs = SCALE * columns(table, "forces.x[1]", "forces.x[2]", "forces.x[3]")
    given = columns(table, "walker.foot1.ft", "walker.foot1.fn", "walker.foot2.ft", "walker.foot2.fn").reshape(-1, 2, 2)
    feet = {1: [0], 2: [0, 1], 3: [1]}
    for state, u, force, phase in zip(states, inputs, given, table["phase"]):
        down = feet[int(phase)]
        np.testing.assert_allclose(force[down], contact_forces(state, u, down), atol=1e-8)
        if phase == 2 or len(down) == 1:
            assert (np.abs(force[down, 0]) <= 0.6 * force[down, 1] + 1e-6).all()


@pytest.mark.parametrize("words", [(), ("--variant", "A"), ("--variant", "J")], ids=["B", "A", "joint"])
def test_forces_follow_from_the_energy_by_lagranges_equations(plan, words):
    summary, _, _ = plan(*words)
    forces = summary["recheck"]["forces"]
    assert forces["largest_difference"] <= 1e-8
    # That they were looked at: the weight is 147 N.
    assert forces["largest_force"] == pytest.approx(155, abs=2)


def test_every_limit_of_the_task_holds_at_the_nodes(plan):
    _, table, _ = plan()
    slack = 1e-7
    for i in (1, 2):
        assert (np.abs(table[f"walker.th{i}"]) <= 0.6 + slack).all()
        assert (np.abs(table[f"walker.omega{i}"]) <= 8 + slack).all()
        assert (np.abs(table[f"walker.dl{i}"]) <= 1 + slack).all()
        assert (table[f"walker.l{i}"] >= 0.9 - slack).all() and (table[f"walker.l{i}"] <= 1.05 + slack).all()
    times = [table["time"][table["phase"] == k] for k in (1, 2, 3)]
    for k, foot in ((1, 2), (3, 1)):
        own = table["phase"] == k
        s = (table["time"][own] - times[k - 1][0]) / (times[k - 1][-1] - times[k - 1][0])
        height = table[f"walker.foot{foot}.y"][own]
        assert (height[(s > 0.201) & (s < 0.799)] >= 0.02 - slack).all()
        assert (height >= -1e-7).all()
    assert table["walker.foot2.x"][table["phase"] == 1][-1] == pytest.approx(0.25, abs=1e-8)


def roll_out(shipped, table):
    """Through the events of the FMU, torque and forces as the plan has them: cubics between the knots."""
    fmu = shipped("compass-gait")
    time, rows = [], []
    for k in (1, 2, 3):
        own = np.flatnonzero(table["phase"] == k)[::2]
        time += [table["time"][i] for i in own[:-1]] if k < 3 else [table["time"][i] for i in own]
        rows += list(own[:-1]) if k < 3 else list(own)
    time, rows = np.array(time), np.array(rows)
    u = SCALE * columns(table, "forces.x[1]", "forces.x[2]", "forces.x[3]")[rows]
    r = SCALE * columns(table, "tau_rate", "F1_rate", "F2_rate")
    names = [fmu.variable(name) for name in ("tau", "F1", "F2")]
    with fmu.instantiate(raw.CO_SIMULATION) as instance:
        w = Walker(instance)
        w.set(solver__method=2)
        instance.setup(0.0, None, 1e-12)
        instance.must("EnterInitializationMode")
        instance.must("ExitInitializationMode")
        for k in range(len(time) - 1):
            h = time[k + 1] - time[k]
            first, last = r[rows[k]], r[rows[k + 1] if table["phase"][rows[k + 1]] == table["phase"][rows[k]] else rows[k] + 2]
            slope = (u[k + 1] - u[k]) / h
            second, third = (6 * slope - 4 * first - 2 * last) / h, (6 * (first + last) - 12 * slope) / h**2
            instance.set(names, list(u[k]))
            references = (raw.c_uint * 9)(*[n.reference for n in names] * 3)
            orders = (raw.c_int * 9)(*[1] * 3, *[2] * 3, *[3] * 3)
            values = (raw.c_double * 9)(*first, *second, *third)
            instance.must("SetRealInputDerivatives", references, 9, orders, values)
            instance.must("DoStep", time[k], h, 0)
        return w.state(), w.get("impact.time", "impact.count", "mode")


def assert_runs_through(plan, shipped, time, position):
    summary, table, _ = plan
    state, (touch_down, count, mode) = roll_out(shipped, table)
    end = columns(table, *(f"walker.{name}" for name in STATES))[-1]
    assert (count, mode) == (1, 3)
    assert touch_down == pytest.approx(summary["durations"][0], abs=time)
    assert np.abs(state[:6] - end[:6]).max() <= position


def test_plan_runs_through_the_events_of_the_fmu(plan, shipped):
    # Order 4: on (60, 20, 60) and (120, 40, 120) intervals these are 1e-7 s and 3e-6, 8e-9 s and 1.3e-7.
    assert_runs_through(plan(), shipped, time=2e-6, position=1e-4)


def test_the_roll_out_of_the_tool_is_that_through_co_simulation(plan, shipped):
    summary, table, folder = plan()
    state, (touch_down, _, _) = roll_out(shipped, table)
    own = np.genfromtxt(folder / "rollout_continuous.csv", delimiter=",", names=True, deletechars="")[-1]
    np.testing.assert_allclose([own[f"walker.{name}"] for name in STATES], state, atol=1e-7)
    ends = summary["recheck"]["phase_ends"]
    assert [end["phase"] for end in ends] == ["swing of leg 2", "double support"]
    assert ends[0]["event"] == pytest.approx(touch_down, abs=1e-9)
    assert abs(ends[1]["late"]) < 1e-6


def test_every_limit_is_kept_between_the_nodes_of_the_plan(plan):
    jumping, _, _ = plan("--variant", "A")
    assert min(limit["margin"] for limit in jumping["recheck"]["limits"]) > -1e-6
    summary, _, folder = plan()
    limits = summary["recheck"]["limits"]
    assert {limit["limit"] for limit in limits} >= {"clearance", "angle between the legs"}
    assert min(limit["margin"] for limit in limits) > -1e-6
    # One of them from the columns of the roll-out.
    rolled = np.genfromtxt(folder / "rollout_continuous.csv", delimiter=",", names=True, deletechars="")
    first = rolled["time"] < summary["durations"][0] - 1e-5
    least = np.minimum(rolled["walker.l1"] - 0.9, 1.05 - rolled["walker.l1"])[first & (rolled["time"] > 1e-5)].min()
    own = next(limit for limit in limits if limit["limit"] == "walker.l1" and limit["phase"] == "swing of leg 2")
    assert own["margin"] == pytest.approx(least, abs=1e-12)


def test_toes_deliver_the_planned_force_with_commands_that_know_them_only(plan):
    summary, _, _ = plan()
    for toe in ("toe1", "toe2"):
        assert summary["stage2"]["fit"][toe]["optimized"] >= 99.9
        assert summary["stage2"]["fit"][toe]["naive"] == pytest.approx(92, abs=1)
        assert summary["stage2"]["late"][toe]["naive"] == pytest.approx(18, abs=3)
        assert summary["stage2"]["max_command"][toe]["optimized"] <= 527.7876
    chain = summary["closed_chain"]
    assert chain["optimized"]["completed"] and chain["optimized"]["max_final_error"] <= 1e-3
    assert not chain["naive"]["completed"] and chain["naive"]["end"] < summary["durations"][0]


def test_variant_a_needs_less_effort_than_b(plan):
    a, table, _ = plan("--variant", "A")
    assert a["status"] == "solved"
    expected = EXPECTED["variants"]["A"]["objective"]
    assert a["objective"] == pytest.approx(expected["value"], abs=expected["tolerance"]) and a["objective"] < OBJECTIVE_B
    assert table["foot1.ay"][table["phase"] == 3][0] >= -1e-7
