"""The gait of example 10, which repeats itself: it closes, its multipliers are those of the FMU's own motion, and twenty steps are held.

The motion here goes through Co-Simulation of the walker alone, with its events; torque and forces are what the plan says, as functions of time.
States of double support are given by eight numbers: the hip ahead of foot 1 and above it, the way between the feet, the velocity of the hip (both
feet are at rest, so it gives all others), and what torque and forces are off the plan."""

import json
import math

import numpy as np
import pytest

import raw
from command import ROOT, airloop
from test_half_step import SCALE, columns
from test_walker import STATES, Walker

FOLDER = ROOT / "examples" / "10_cycle"
EXPECTED = json.loads((FOLDER / "expected.json").read_text())
FORCES = ["forces.x[1]", "forces.x[2]", "forces.x[3]"]
RATES = ["tau_rate", "F1_rate", "F2_rate"]


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cycle")
    airloop("optimize", FOLDER / "problem.toml", "--no-plots", "-q", "-o", folder)
    table = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True, deletechars="")
    return json.loads((folder / "summary.json").read_text()), table, folder


@pytest.fixture(scope="module")
def held(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("cycle_held")
    airloop("stabilize", plan[2], FOLDER / "stabilize.toml", "--no-plots", "-q", "-o", folder)
    return json.loads((folder / "summary.json").read_text()), folder


def exchanged(forces):
    """Torque and forces of the legs in each other's place."""
    return np.array([-forces[0], forces[2], forces[1]])


class Turn:
    """From the middle of double support to that of the next step."""

    def __init__(self, shipped, table):
        self.fmu = shipped("compass-gait")
        # Rows at the knots; those between them are the middles of the intervals.
        phases = [np.flatnonzero(table["phase"] == k)[::2] for k in (1, 2)]
        middle = len(phases[0]) // 2
        self.start = table["time"][phases[0][middle]]
        period = table["time"][-1]
        force, rate = SCALE * columns(table, *FORCES), SCALE * columns(table, *RATES)
        state = columns(table, *(f"walker.{name}" for name in STATES))
        self.planned = np.concatenate([self.of_state(state[phases[0][middle]], 0), np.zeros(3)])
        self.pieces = []
        for part, next_turn in ((phases[0][middle:], False), (phases[1], False), (phases[0][: middle + 1], True)):
            for a, b in zip(part, part[1:]):
                ends = [force[a], force[b], rate[a], rate[b]]
                ends = [exchanged(end) for end in ends] if next_turn else ends
                at = [table["time"][i] + (period if next_turn else 0) for i in (a, b)]
                self.pieces.append((*at, *ends))

    @staticmethod
    def of_state(state, front):
        x, y, th, length, v = state[0], state[1], state[2:4], state[4:6], state[6:8]
        foot = x + length * np.sin(th)
        return np.array([x - foot[front], y, foot[front] - foot[1 - front], *v])

    @staticmethod
    def state(numbers):
        x, y, way, vx, vy = numbers[:5]
        th = [math.atan2(foot - x, y) for foot in (0, -way)]
        length = [math.hypot(foot - x, y) for foot in (0, -way)]
        omega = [-(vx * math.cos(a) + vy * math.sin(a)) / b for a, b in zip(th, length)]
        rate = [-vx * math.sin(a) + vy * math.cos(a) for a in th]
        return [x, y, *th, *length, vx, vy, *omega, *rate]

    def __call__(self, numbers):
        """The eight numbers one step later, where the legs have exchanged their places."""
        off = SCALE * numbers[5:]
        names = [self.fmu.variable(name) for name in ("tau", "F1", "F2")]
        with self.fmu.instantiate(raw.CO_SIMULATION) as instance:
            w = Walker(instance)
            w.set(solver__method=2, **dict(zip(STATES, map(float, self.state(numbers)))))
            instance.set(names, list(self.pieces[0][2] + off))
            instance.setup(self.start, None, 1e-13)
            instance.must("EnterInitializationMode")
            instance.must("ExitInitializationMode")
            now = self.start
            for _, end, u, v, first, last in self.pieces:
                h = end - now
                slope = (v - u) / h
                second, third = (6 * slope - 4 * first - 2 * last) / h, (6 * (first + last) - 12 * slope) / h**2
                instance.set(names, list(u + off))
                references = (raw.c_uint * 9)(*[n.reference for n in names] * 3)
                orders = (raw.c_int * 9)(*[1] * 3, *[2] * 3, *[3] * 3)
                instance.must("SetRealInputDerivatives", references, 9, orders, (raw.c_double * 9)(*first, *second, *third))
                instance.must("DoStep", now, h, 0)
                now = end
            assert w.get("mode") == 4
            self.hops = any("foot 1 lifted off" in text for *_, text in instance.messages)
            return np.concatenate([self.of_state(w.state(), 1), exchanged(off) / SCALE])


def test_the_orbit_closes(plan, shipped):
    summary, table, _ = plan
    assert summary["status"] == "solved"
    assert summary["objective"] == pytest.approx(EXPECTED["objective"]["value"], abs=EXPECTED["objective"]["tolerance"])
    cycle = summary["cycle"]
    assert cycle["plan"] < 1e-10
    assert cycle["advance"]["walker.x"] == pytest.approx(0.25, abs=1e-9)
    # The roll-out of the tool, and one through Co-Simulation: 9e-10 on this mesh.
    assert set(cycle["rollout"]) == {f"walker.{name}" for name in STATES[1:]} | set(FORCES)
    assert max(map(abs, cycle["rollout"].values())) < 1e-8
    turn = Turn(shipped, table)
    assert np.abs(turn(turn.planned) - turn.planned).max() < 1e-8


def test_multipliers_are_those_of_finite_differences_through_the_events_of_the_fmu(plan, held, shipped):
    turn = Turn(shipped, plan[1])
    here, slopes = turn(turn.planned), []
    # Hip in m and m/s, forces in parts of the largest ones.
    for direction in np.diag([1e-6] * 5 + [1e-8] * 3):
        # The plan gives foot 1 no impulse at touch-down. To one side foot 2 comes down alone, and foot 1 hops for some nanoseconds and is back
        # without an impact; the regulator assumes that both feet hold. So differences are one-sided, of the second order.
        for side in (direction, -direction):
            near, hops = turn(turn.planned + side), turn.hops
            far = turn(turn.planned + 2 * side)
            if not (hops or turn.hops):
                slopes.append((4 * near - 3 * here - far) / (2 * side.sum()))
                break
    assert len(slopes) == 8
    found = np.linalg.eigvals(np.array(slopes).T)
    own = np.array([complex(*one) for one in held[0]["cycle"]["open_loop"]["multipliers"]])
    # Eight numbers give all states: beyond them are motions of feet that stand.
    assert np.abs(own[8:]).max() < 1e-6
    # The regulator holds torque and forces over samples of 1 ms: 1e-5.
    left = list(found)
    for one in own[:8]:
        nearest = left.pop(np.abs(np.array(left) - one).argmin())
        assert abs(nearest - one) < EXPECTED["multipliers"]["tolerance"], (own[:8], found)
    assert abs(own[0]) == pytest.approx(EXPECTED["multipliers"]["largest"], abs=1e-4)


def test_twenty_steps_are_held_under_perturbation(held, tmp_path):
    summary, folder = held
    assert summary["cycle"]["turns"] == 20
    assert summary["cycle"]["closed_loop"]["radius"] < 0.5
    airloop("trials", folder, "--master", "monolithic", "--count", "4", "--no-plots", "-q", "-o", tmp_path)
    trials = json.loads((tmp_path / "summary.json").read_text())
    for criterion in trials["criteria"]:
        assert (criterion["closed_loop"], criterion["open_loop"]) == (4, 0), criterion
