"""Adaptive communication steps through `airloop run --adaptive`, against SciPy and against fixed steps.

The problem is that of tests/reference: pneumatic cart-pole, 20 N at 1 Hz, 3 s, the command held over each sample of 1 ms.
"""

import csv
import json

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from test_masters import FMUS, SYSTEM, commands, expected, no_output_derivatives, start, weakened  # noqa: F401 (fixture)
from test_reference import relative_rms_error

GOAL = 0.01  # % in x


def simulate(commands, folder, *options, system=SYSTEM):
    words = ["--stop", "3", "--input", commands[1], "--interpolation", "hold", "--no-plots", "-o", folder]
    outcome = start("run", system, *words, *options)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    result = np.genfromtxt(folder / "result.csv", delimiter=",", names=True, deletechars="")
    summary = json.loads((folder / "summary.json").read_text())
    reference = expected(1)
    # Communication points of adaptive runs are not those of the reference; v is the derivative of x.
    x = CubicHermiteSpline(result["time"], result["x"], result["v"])(reference["time"])
    error = relative_rms_error(x, reference["x"])
    print(f"{options}: {error:.5f} % in x, {summary['effort']['fmu_steps']} FMU steps, {summary.get('adaptive')}")
    return error, summary["effort"]["fmu_steps"], summary, result


# Fixed steps that just miss the goal: the best fixed step takes more FMU steps than these. For interface-Jacobian the
# cheapest that reaches it (longer ones do not end at the samples).
# The tolerances are those that reach the goal. Gauss-Seidel repeats each step, which costs 8 FMU steps per sample at least:
# that cannot beat fixed steps of 0.5 ms with `--extrapolation 1` (24000 FMU steps).
TOLERANCES = {"gauss-seidel": "1e-3", "jacobi": "1e-4", "interface-jacobian": "1e-4"}
FIXED = {
    "gauss-seidel": [(["--step", "0.125ms"], False)],
    "jacobi": [(["--step", "0.1ms"], False)],
    "interface-jacobian": [(["--step", "1ms", "--corrections", "0"], True)],
}


@pytest.mark.parametrize("master", FIXED)
def test_adaptive_steps_reach_the_goal_with_fewer_fmu_steps_than_the_best_fixed_step(commands, tmp_path, master):
    error, steps, summary, result = simulate(commands, tmp_path / "adaptive", "--master", master, "--adaptive", "--step-tolerance", TOLERANCES[master])
    assert error <= GOAL
    for options, reaches in FIXED[master]:
        fixed_error, fixed_steps, *_ = simulate(commands, tmp_path / "fixed", "--master", master, *options)
        assert (fixed_error <= GOAL) == reaches
        assert steps < fixed_steps
    adaptive, lengths = summary["adaptive"], np.diff(result["time"])
    assert adaptive["accepted"] == len(lengths) == summary["outcome"]["steps"]
    assert adaptive["smallest_step"] == pytest.approx(lengths.min(), abs=1e-12)
    assert adaptive["largest_step"] == pytest.approx(lengths.max(), abs=1e-12)
    assert result["time"][-1] == 3.0
    if master == "interface-jacobian":
        assert adaptive["largest_step"] > 1.5e-3  # whole samples are spanned
        samples = result["time"][:-1][lengths > 1.5e-3] * 1e3
        assert np.max(np.abs(samples - np.round(samples))) < 1e-9
    else:
        # Every sample ends a step.
        assert set(np.round(np.arange(3001) * 1e-3, 9)) <= set(np.round(result["time"], 9))


@pytest.mark.parametrize("master", FIXED)
def test_a_smaller_tolerance_gives_a_smaller_error(commands, tmp_path, master):
    options = ["--master", master, "--adaptive", "--max-step", "50ms", "--step-tolerance"]
    loose = simulate(commands, tmp_path / "loose", *options, "1e-2")
    tight = simulate(commands, tmp_path / "tight", *options, "1e-4")
    assert tight[0] < loose[0] and tight[1] > loose[1]


def test_fmus_without_input_and_output_derivatives_are_held_at_their_mean(commands, tmp_path):
    no_ramps = lambda text: text.replace('canInterpolateInputs="true"', 'canInterpolateInputs="false"')  # noqa: E731
    changes = {"friction": [no_output_derivatives, no_ramps], "cart-pole": [no_ramps]}
    options = ["--master", "gauss-seidel", "--adaptive"]
    error, _, summary, _ = simulate(commands, tmp_path / "out", *options, system=weakened(tmp_path, changes))
    assert error <= 0.05
    assert any("takes no input derivatives" in note for note in summary["fallbacks"])


def test_a_step_that_an_fmu_discards_is_tried_shorter_down_to_the_shortest(tmp_path):
    fmu = FMUS / "test" / "test-all-types.fmu"
    options = ["--set", "fault=discard", "--set", "fault_time=0.37", "--stop", "1", "--step", "10ms"]
    for name, limits in {"long": ["--min-step", "5ms"], "short": ["--min-step", "10us"]}.items():
        outcome = start("run", fmu, *options, "--adaptive", *limits, "--no-plots", "-o", tmp_path / name)
        assert outcome.returncode == 1
        assert "fmi2DoStep returned fmi2Discard at t = 0.3" in outcome.stderr
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        with open(tmp_path / name / "result.csv", newline="") as file:
            last = float(list(csv.DictReader(file))[-1]["time"])
        # The result so far is kept, and shorter steps come closer to the fault.
        assert last == summary["outcome"]["end_time"] <= 0.37 + 1e-9
        assert 0.37 - last < 2 * {"long": 5e-3, "short": 10e-6}[name]
        assert summary["adaptive"]["rejected"] >= 1


def test_a_component_that_ends_the_simulation_is_followed_to_that_time(tmp_path):
    fmu = FMUS / "test" / "test-all-types.fmu"
    options = ["--set", "fault=terminate", "--set", "fault_time=0.37", "--stop", "1", "--step", "10ms", "--min-step", "10us"]
    outcome = start("run", fmu, *options, "--adaptive", "--no-plots", "-o", tmp_path)
    assert outcome.returncode == 0, outcome.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["outcome"]["status"] == "terminated"
    assert abs(summary["outcome"]["end_time"] - 0.37) < 1e-4


def test_an_error_that_no_step_can_meet_names_component_variable_and_time(commands, tmp_path):
    words = ["--stop", "3", "--input", commands[1], "--interpolation", "hold", "--no-plots", "-o", tmp_path]
    limits = ["--step-tolerance", "1e-9", "--min-step", "0.2ms"]
    outcome = start("run", SYSTEM, *words, "--adaptive", *limits)
    assert outcome.returncode == 1
    assert "component `cart_pole`: the error of `" in outcome.stderr
    assert "with the shortest communication step" in outcome.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["outcome"]["status"] == "failed" and (tmp_path / "result.csv").exists()


def test_what_cannot_adapt_is_refused(tmp_path):
    lacking = lambda text: text.replace('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"')  # noqa: E731
    outcome = start("run", weakened(tmp_path, {"friction": [lacking]}), "--stop", "1", "--adaptive", "-o", tmp_path / "out")
    assert outcome.returncode == 1
    assert "_friction` cannot save and restore its state" in outcome.stderr and "--step" in outcome.stderr
    outcome = start("run", SYSTEM, "--stop", "1", "--adaptive", "--master", "monolithic", "-o", tmp_path / "out")
    assert outcome.returncode == 1 and "--adaptive is an option of" in outcome.stderr
    for wrong, message in {"--min-step=1": "min-step = 1", "--step-tolerance=2": "step-tolerance = 2"}.items():
        words = ["--max-step", "10ms", wrong]
        outcome = start("run", SYSTEM, "--stop", "1", "--adaptive", *words, "-o", tmp_path / "out")
        assert outcome.returncode == 2 and message in outcome.stderr  # a setting out of range is wrong usage
    assert start("run", SYSTEM, "--stop", "1", "--max-step", "1ms", "-o", tmp_path / "out").returncode == 2
