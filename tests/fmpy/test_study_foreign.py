"""`airloop refine` on machines of other systems that no model fits to the noise, made by tests/study/foreign."""

import json
import subprocess
import sys

import pytest

from command import ROOT, start
from test_study import named, refine

MAKE = ROOT / "tests" / "study" / "foreign" / "make_foreign.py"


def machine(tmp_path, name):
    """A case of the bench with what is true of it."""
    made = subprocess.run(
        [sys.executable, MAKE, tmp_path / "cases", "--only", f"^{name}$"], capture_output=True, text=True, timeout=100
    )
    assert made.returncode == 0, made.stderr
    folder = tmp_path / "cases" / name
    return folder, json.loads((folder / "truth.json").read_text())


def test_the_dominant_effect_of_a_machine_that_nothing_fits_stands_alone_beside_corrections(tmp_path):
    folder, truth = machine(tmp_path, "servo_m_coulomb_tau_l")
    result = refine(folder / "study.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    true, effect = truth["effects"][0], found["effects"][0]
    assert named(found) == [true["id"]] and effect["port"] == true["port"]
    main = true["main"]
    assert effect["params"][main]["value"] == pytest.approx(true["params"][main]["value"], rel=0.1)
    assert effect["share"] == pytest.approx(truth["share"], abs=0.1)
    assert found["corrections"] and not found["complete"]
    # The amended system, run on the records of the study, has the errors that are printed.
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", folder / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    for role in ("estimation", "validation"):
        assert summary[role]["rms"] == pytest.approx(found["residual"][role]["rms_after"], rel=1e-3)


def test_small_forces_and_parameters_within_their_tolerance_are_no_effect(tmp_path):
    folder, _ = machine(tmp_path, "furuta_m_none_1")
    result = refine(folder / "study.toml", tmp_path / "out")
    assert result.returncode in (10, 11), result.stdout + result.stderr
    assert named(json.loads((tmp_path / "out" / "report.json").read_text())) == []
