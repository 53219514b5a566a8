"""The half step of example 04 under feedback: a leg that leans at the start, a heavier and a lighter trunk."""

import math

import numpy as np
import pytest

from command import airloop
from test_half_step import FOLDER, plan  # noqa: F401  (a fixture)

# Where the plan ends: the roles of the legs are exchanged, 0.25 m ahead.
END = {"x": 0.25, "y": 1.045, "th1": 0.0, "th2": 0.0, "l1": 1.0, "l2": 1.045}


def lean(angle):
    """Leg 1 leans, foot 1 stays where it is."""
    return {"walker.th1": angle, "walker.x": -1.045 * math.sin(angle), "walker.y": 1.045 * math.cos(angle)}


@pytest.fixture(scope="module")
def end(plan, tmp_path_factory):  # noqa: F811
    """Time and largest error of a coordinate where a run of the closed loop ends."""
    summary, _, folder = plan()
    held = tmp_path_factory.mktemp("held")
    airloop("stabilize", folder, FOLDER / "stabilize.toml", "--no-plots", "-q", "-o", held / "held")

    def of(values, feedback=True):
        out = tmp_path_factory.mktemp("run")
        words = ["--stop", str(sum(summary["durations"])), "--step", "0.001", "--master", "monolithic"]
        for name, value in {**values, "controller.feedback": str(feedback).lower()}.items():
            words += ["--set", f"{name}={value}"]
        airloop("run", held / "held" / "closed_loop.ssd", *words, "--no-plots", "-q", "-o", out)
        last = np.genfromtxt(out / "result.csv", delimiter=",", names=True, deletechars="")[-1]
        complete = math.isclose(last["time"], sum(summary["durations"]), abs_tol=1e-6)
        return complete, max(abs(last[f"walker.{name}"] - value) for name, value in END.items())

    return of


@pytest.mark.parametrize(
    "values, largest",
    [
        ({}, 1e-4),
        (lean(0.003), 1e-3),
        (lean(-0.003), 1e-3),
        ({"walker.m3": 6.0 * 1.05}, 1e-2),
        ({"walker.m3": 6.0 * 0.95}, 1e-2),
    ],
    ids=["as planned", "leans ahead", "leans back", "heavier", "lighter"],
)
def test_the_step_is_completed_under_feedback(end, values, largest):
    complete, error = end(values)
    assert complete and error <= largest


@pytest.mark.parametrize("values", [lean(0.003), {"walker.m3": 6.3}], ids=["leans", "heavier"])
def test_the_planned_rates_alone_do_not_recover(end, values):
    complete, error = end(values, feedback=False)
    assert not complete or error > 0.1
