"""`airloop refine` on machines of tests/study/laws: a slightly cubic spring, and tanks that run over."""

import json
import subprocess
import sys

import pytest

from command import ROOT, start

LAWS = ROOT / "tests" / "study" / "laws"
THRESHOLD = 0.03  # of its value


def refined(name, tmp_path, seed=1):
    """Truth and report of a case."""
    words = [tmp_path, "--only", f"^{name}$", "--seed", str(seed)]
    subprocess.run([sys.executable, LAWS / "make_machines.py", *words], check=True)
    case, out = tmp_path / name, tmp_path / "out"
    result = start("refine", case, "-o", out)
    assert (out / "report.json").exists(), result.stderr
    return json.loads((case / "truth.json").read_text()), json.loads((out / "report.json").read_text())


def test_a_cubic_spring_is_found_with_its_coefficient(tmp_path):
    truth, report = refined("spring_00", tmp_path)
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [effect["id"] for effect in selected] == ["cubic_spring@F"]
    stiffness = selected[0]["params"]["stiffness"]["value"]
    assert abs(stiffness / truth["law"]["c"] - 1) < max(0.02, 2 * truth["law"]["deviation"] / truth["law"]["c"])


@pytest.mark.parametrize("name, place", [("tanks_00", "u"), ("tanks_02", "q_1")])
def test_an_overflow_is_found_with_its_level_at_a_pump_in_volts_and_at_a_flow(tmp_path, name, place):
    truth, report = refined(name, tmp_path)
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [effect["id"] for effect in selected] == [f"overflow@{place}"]
    assert selected[0]["params"]["level"]["value"] == pytest.approx(truth["law"]["level"], rel=THRESHOLD)


def test_tanks_that_run_over_get_no_offset_larger_than_their_command(tmp_path):
    # All parameters are free and the level of the upper tank is not measured: an offset of 14 V was the answer.
    _, report = refined("tanks_01", tmp_path, seed=4242)
    found = [effect["id"] for effect in report["effects"] if effect["selected"]]
    assert found and not [name for name in found if name.startswith("offset")]


@pytest.mark.slow
def test_a_part_of_what_runs_over_is_found_in_the_lower_tank_and_the_amended_system_has_it(tmp_path):
    # Levels above the brim of the upper tank do not last: a block that is faster than the step of the records.
    truth, report = refined("tanks_03", tmp_path, seed=4001)
    selected = {effect["id"]: effect["params"] for effect in report["effects"] if effect["selected"]}
    assert selected["caught_overflow@q_1"]["caught"]["value"] == pytest.approx(truth["law"]["caught"], abs=0.02)
    left = report["residual"]["validation"]["rms_after"]["level"]
    assert left < 0.05  # V, with noise of 0.03 V
    words = ["run", tmp_path / "out" / "system" / "system.ssd", "--study", tmp_path / "tanks_03" / "study.toml", "-o", tmp_path / "run"]
    again = start(*words)
    found = next(line.split() for line in again.stdout.splitlines() if "validation" in line)
    assert float(found[found.index("level") + 1]) == pytest.approx(left, rel=1e-3), again.stdout + again.stderr


@pytest.mark.parametrize("name", [pytest.param("tanks_01", marks=pytest.mark.slow), "tanks_09"])
def test_tanks_without_an_input_for_a_flow_get_one_in_the_amended_system(tmp_path, name):
    # The FMU has the command of the pump alone: what the lower tank catches comes in at the rate of its level.
    truth, report = refined(name, tmp_path, seed=4001)
    selected = {effect["id"]: effect["params"] for effect in report["effects"] if effect["selected"]}
    # A share, although one port is in V and the other in V/s; the gain of the pump is free, and the share that of its declared value.
    assert selected["caught_overflow@u"]["caught"]["value"] == pytest.approx(truth["law"]["caught"], abs=0.03)
    left = report["residual"]["validation"]["rms_after"]["level"]
    assert left < 1.2 * truth["floor"]  # 0.25 and 0.16 V without the port
    words = ["run", tmp_path / "out" / "system" / "system.ssd", "--study", tmp_path / name / "study.toml", "-o", tmp_path / "run"]
    again = start(*words)
    found = next(line.split() for line in again.stdout.splitlines() if "validation" in line)
    assert float(found[found.index("level") + 1]) == pytest.approx(left, rel=1e-3), again.stdout + again.stderr


def test_an_overflow_into_a_level_that_no_attachment_feeds_is_told_to_be_not_testable(tmp_path):
    words = [tmp_path, "--only", "^tanks_02_none$"]
    subprocess.run([sys.executable, LAWS / "make_machines.py", *words], check=True)
    study = tmp_path / "tanks_02_none" / "study.toml"
    study.write_text(study.read_text() + '\n[[attachment]]\ninput = "q_1"\neffects = ["caught_overflow"]\n')
    start("refine", study, "-o", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "report.json").read_text())["not_testable"]
    assert "no attachment" in found["caught_overflow"]


def test_tanks_that_lack_nothing_get_no_law(tmp_path):
    _, report = refined("tanks_00_none", tmp_path)
    assert report["verdict"] == "none"
