"""Example 02: the commands of its README, its numbers, and the targets for the virtual rig and for eq. 10 and 11."""

import json
import re
import subprocess

import fmpy
import numpy as np
import pytest

from command import BINARY, ROOT
from test_identify import fit

EXAMPLE = ROOT / "examples" / "02_identify"
EXPECTED = json.loads((EXAMPLE / "expected.json").read_text())


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Runs every command of the README, in its order, with `out/02` in a folder of the test."""
    base = tmp_path_factory.mktemp("example")
    folder = ROOT
    for line in (EXAMPLE / "README.md").read_text().splitlines():
        command = line.removeprefix("    ").split("#")[0].strip()
        if not line.startswith("    ") or not re.match(r"(airloop|cd) ", command):
            continue
        words = [str(base / word[len("out/02/") :]) if word.startswith("out/02/") else word for word in command.split()]
        if words[0] == "cd":
            folder = (folder / words[1]).resolve()
            continue
        subprocess.run([BINARY, *words[1:], "--quiet"], cwd=folder, check=True)
    return base


def summary(folder):
    return json.loads((folder / "summary.json").read_text())


@pytest.mark.parametrize("name", ["least-squares", "actuator", "state-space"])
def test_fits_are_those_of_the_readme(results, name):
    found = summary(results / name)["validation"]["fit_simulated"]
    assert found == pytest.approx(EXPECTED[name], abs=0.1)


@pytest.mark.parametrize("name", ["piston", "cart"])
def test_frictions_are_those_of_the_readme_and_within_two_percent_of_the_truth(results, name):
    true = {
        "piston": {"c1": 1.5145, "c2": 40.8926, "c4": 49.2734},
        "cart": {"c1": 5.7910, "c2": 63.7045, "c3": 0.0064, "c5": -2.3170},
    }[name]
    parameters = summary(results / name)["parameters"]
    for key, value in true.items():
        assert parameters[key]["value"] == pytest.approx(EXPECTED[name][key], rel=2e-3), key
        assert parameters[key]["value"] == pytest.approx(value, rel=0.02), key
    for key in {"c1", "c2", "c3", "c4", "c5"} - set(true):
        low, high = parameters[key]["ci95"]
        assert low <= 0 <= high, key


def test_the_identified_actuator_simulates_in_fmpy_to_its_fit(results):
    for number, name in [(1, "chirp_validation"), (2, "stairs_validation")]:
        data = np.genfromtxt(results / "rod" / f"{name}.csv", delimiter=",", names=True)
        signals = np.array(list(zip(data["time"], data["u"])), dtype=[("time", float), ("u", float)])
        run = fmpy.simulate_fmu(
            str(results / "actuator" / "actuator.fmu"),
            stop_time=float(data["time"][-1]),
            step_size=1e-3,
            output_interval=1e-3,
            input=signals,
            output=["F_hat", "F_act"],
        )
        scores = summary(results / "actuator")["validation"]["records"][number - 1]["fit_simulated"]
        for output, of in [("F_hat", "F_hat"), ("F_act", "F_p")]:
            # FMPy reads after each step, so that the sample of t_k stands in the row of t_k + 1 ms.
            simulated, measured = run[output][1:], data[of][: len(run) - 1]
            # The FMU starts at rest, the summary's simulation from the first measured sample.
            assert fit(measured, simulated) == pytest.approx(scores[of], abs=0.3), (name, of)


def test_the_comparison_names_an_order(results):
    rows = (results / "compare" / "compare.csv").read_text().splitlines()
    assert len(rows) == 1 + 16
