"""Examples 08 and 09: FMUs in C made by their scripts, and what their records show that they lack."""

import json
import shutil
import subprocess

import pytest

from command import ROOT, airloop


def refined(name, tmp_path):
    """The report of an example whose FMU is made in a copy of its folder."""
    folder = shutil.copytree(ROOT / "examples" / name, tmp_path / name)
    subprocess.run(["sh", ROOT / "examples" / "make_fmu.sh", ROOT / "examples" / name, folder], check=True, capture_output=True)
    airloop("refine", folder, "-q", "-o", tmp_path / "out")
    return json.loads((tmp_path / "out" / "report.json").read_text()), folder, tmp_path / "out"


def selected(report):
    return {effect["id"]: effect["params"] for effect in report["effects"] if effect["selected"]}


@pytest.mark.slow
def test_dry_friction_is_found_in_both_joints_of_the_arm(tmp_path):
    report, folder, out = refined("08_arm", tmp_path)
    found = selected(report)
    assert set(found) == {"coulomb@tau_1", "coulomb@tau_2"}
    for name, level in (("coulomb@tau_1", 0.3), ("coulomb@tau_2", 0.1)):
        assert found[name]["force"]["value"] == pytest.approx(level, rel=1e-3)
        assert found[name]["vt"]["value"] == pytest.approx(0.02, rel=1e-2)
    after, noise = report["residual"]["validation"]["rms_after"], report["noise_floor"]
    assert all(after[signal] < 1.1 * noise[signal] for signal in ("q_1", "q_2"))
    # The amended system in a run of its own, with the errors of the report.
    run = tmp_path / "run"
    airloop("run", out / "system" / "system.ssd", "--study", folder / "study.toml", "-o", run)
    assert json.loads((run / "summary.json").read_text())["validation"]["rms"] == pytest.approx(after, rel=1e-3)


def test_the_upper_tank_runs_over(tmp_path):
    report, *_ = refined("09_tanks", tmp_path)
    found = selected(report)
    assert list(found) == ["overflow@q_1"]
    # The edge of the weir is at 0.32 m; a straight line meets its 1.5th power a little higher.
    assert 0.32 < found["overflow@q_1"]["level"]["value"] < 0.335
    validation = report["residual"]["validation"]
    # Initial levels are fitted although no column of [states] shows them.
    assert all(validation["rms_after"][level] < 0.01 * validation["rms_before"][level] for level in ("h_1", "h_2"))
