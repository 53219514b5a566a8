"""`airloop refine` on machines of other systems that no model fits to the noise, made by tests/study/third_party."""

import json
import re
import subprocess
import sys

import pytest

from command import ROOT, start
from test_study import amended_has_printed_errors, named, refine

MAKE = ROOT / "tests" / "study" / "third_party" / "make_third_party.py"


def machine(tmp_path, name, seed=1):
    """A case of the bench with what is true of it."""
    made = subprocess.run(
        [sys.executable, MAKE, tmp_path / "cases", "--only", f"^{name}$", "--seed", str(seed)], capture_output=True, text=True, timeout=100
    )
    assert made.returncode == 0, made.stderr
    folder = tmp_path / "cases" / name
    return folder, json.loads((folder / "truth.json").read_text())


@pytest.mark.slow
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
    # Who is tried and stands neither in the answer nor beside it learns why.
    stands = [own for own in found["effects"] if own["selected"] or own["group"] is not None]
    names = {own["id"] for own in stands} | {f"{own['id']}@{own['port']}" for own in stands}
    tried = [own for step in found["steps"] for own in step["candidates"]]
    assert all(own["rejected"] for own in tried if own["id"] not in names) and any(own["id"] not in names for own in tried)
    amended_has_printed_errors(folder / "study.toml", tmp_path / "out", found)


# The arm sticks in wells that the declared model does not have, half a period away from where it has the arm.
@pytest.mark.slow
@pytest.mark.parametrize(
    "name, few, others",
    [
        ("furuta_m_cogging_tau", '["cart.cogging", "cart.endstop", "cf.coulomb"]', '["pole.viscous"]'),
        # The speeds are measured, the position follows from them.
        ("servo_m_cogging_tau_l", '["cart.cogging", "cart.endstop", "cf.coulomb"]', '["pf.viscous"]'),
        # A mode that is damped without end is near a delay, and none.
        ("furuta_m_delay_tau", '["act.delay", "act.mode", "act.hysteresis"]', '["pole.viscous"]'),
    ],
)
def test_what_no_step_from_the_declared_motion_leads_to_is_found(tmp_path, name, few, others):
    folder, truth = machine(tmp_path, name, seed=6006)
    study = folder / "study.toml"
    true = truth["effects"][0]
    # Few effects of the list, so that the search is short.
    head, *attachments = study.read_text().split("[[attachment]]\n")
    own = lambda text: few if f'input = "{true["port"]}"' in text else others
    study.write_text("[[attachment]]\n".join([head, *(f"effects = {own(text)}\n{text}" for text in attachments)]))
    result = refine(study, tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    effect, main = found["effects"][0], true["main"]
    assert named(found) == [true["id"]] and effect["port"] == true["port"]
    assert effect["params"][main]["value"] == pytest.approx(true["params"][main]["value"], rel=0.1)


def test_a_torque_that_depends_on_the_speed_of_another_joint_is_a_law(tmp_path):
    folder, truth = machine(tmp_path, "arm_e_outside_cross_tau_1")
    study = folder / "study.toml"
    # Few effects of the list: the search among them is not what is asked here.
    study.write_text(study.read_text().replace("vt = 0.05", 'vt = 0.05\neffects = ["cf.viscous"]'))
    result = refine(study, tmp_path / "out")
    assert result.returncode == 13, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    law, true = found["law"], truth["effects"][0]["params"]
    assert (law["port"], law["variables"], law["formula"]) == ("tau_1", ["w_2"], "a*tanh(v/s)")
    for name, main in [("a", "force"), ("s", "speed")]:
        # Intervals of 95 %; twice as wide ones hold the truth in all but one of ten thousand.
        low, high = law["params"][name]["ci95"]
        assert abs(law["params"][name]["value"] - true[main]["value"]) < high - low
    # The amended system has the speed of the other joint at the block.
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(found["residual"]["validation"]["rms_after"], rel=1e-3)
    # Whole records from states fitted to their beginning: as well as from the given ones, as the arm is damped.
    run = start("run", system, "--study", study, "--free-run", "2s", "-o", tmp_path / "free")
    assert run.returncode == 0, run.stderr
    free = json.loads((tmp_path / "free" / "summary.json").read_text())["validation"]["rms"]
    assert all(free[name] < 1.5 * rms for name, rms in summary["validation"]["rms"].items())


# A torque `k*(x - m)*v` at the motor: windows with fitted states do not tell it from `k*x*v`, whole records do.
@pytest.mark.slow
@pytest.mark.parametrize("port", ["tau_l", "tau_m"])
def test_a_torque_over_position_and_speed_of_one_end_of_the_shaft_is_a_law_there(tmp_path, port):
    folder, _ = machine(tmp_path, f"servo_e_outside_product_{port}", seed=11)
    study = folder / "study.toml"
    text = study.read_text()
    for channels, effect in (('["actuator", "piston_friction"]', "pf.viscous"), ('["cart_friction", "cart"]', "cf.viscous")):
        text = text.replace(f"channels = {channels}", f'channels = {channels}\neffects = ["{effect}"]')
    study.write_text(text)
    result = refine(study, tmp_path / "out")
    assert result.returncode == 13, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert (found["law"]["port"], found["law"]["variables"], found["complete"]) == (port, ["x", "xdot"], True)


def test_a_free_run_needs_more_of_a_record_than_its_beginning(tmp_path):
    folder, _ = machine(tmp_path, "arm_e_none_1")
    for time in ("1ms", "1h"):
        run = start("run", folder.parent / "fmu" / "arm.fmu", "--study", folder / "study.toml", "--free-run", time, "-o", tmp_path / "run")
        assert run.returncode == 1 and "free run" in run.stderr and "record_0.csv" in run.stderr, run.stderr
        assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_small_forces_and_parameters_within_their_tolerance_are_no_effect(tmp_path):
    folder, _ = machine(tmp_path, "furuta_m_none_1")
    result = refine(folder / "study.toml", tmp_path / "out")
    assert result.returncode in (10, 11), result.stdout + result.stderr
    assert named(json.loads((tmp_path / "out" / "report.json").read_text())) == []


def test_where_no_effect_is_named_the_answer_is_the_declared_model_with_its_corrections(tmp_path):
    folder, _ = machine(tmp_path, "tanks_m_none_1", seed=301)
    result = refine(folder / "study.toml", tmp_path / "out")
    assert result.returncode == 11, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    before, after = (found["residual"]["validation"][f"rms_{when}"] for when in ("before", "after"))
    assert named(found) == [] and found["corrections"]
    assert sum(after.values()) < 0.7 * sum(before.values())
    assert re.search(r"Corrections of declared parameters within their tolerances take away \d\d %", result.stdout)
    # What the amended system leaves is what is printed.
    amended_has_printed_errors(folder / "study.toml", tmp_path / "out", found)


def test_a_friction_that_changes_with_a_measured_temperature_is_a_law(tmp_path):
    folder, truth = machine(tmp_path, "motor_e_outside_heat_tau_load")
    study = folder / "study.toml"
    # Few effects of the list: the search among them is not what is asked here. Two records are enough.
    text = study.read_text().replace("vt = 2.0", 'vt = 2.0\neffects = ["cf.viscous"]')
    study.write_text(re.sub(r'\[\[segment\]\]\nfile = "record_1.csv"\n.*\n.*\n', "", text))
    result = refine(study, tmp_path / "out")
    assert result.returncode == 13, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    law, true = found["law"], truth["effects"][0]["params"]
    assert (law["port"], law["variables"]) == ("tau_load", ["T", "xdot"])
    assert law["formula"] == "a*(x - m)*tanh(v/sb)"
    # Text has the names of the signals.
    assert "over T (x) and w (v): a*(x - m)" in result.stdout
    for name, value in [("a", true["coef"]["value"]), ("m", true["temperature"]["value"])]:
        # Intervals of 95 %; twice as wide ones hold the truth in all but one of ten thousand.
        low, high = law["params"][name]["ci95"]
        assert abs(law["params"][name]["value"] - value) < high - low
    # The amended system has the temperature at the block.
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(found["residual"]["validation"]["rms_after"], rel=1e-3)


def test_a_stribeck_peak_beside_coulomb_friction_that_no_attachment_shows_is_named_alone(tmp_path):
    folder, truth = machine(tmp_path, "servo_e_stribeck_tau_l", seed=5150)
    result = refine(folder / "plain.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(found) == ["stribeck@tau_l"] and found["complete"]
    true, effect = truth["effects"][0]["params"], found["effects"][0]["params"]
    for name in ("force", "vs"):
        # Intervals of 95 %; twice as wide ones hold the truth in all but one of ten thousand.
        low, high = effect[name]["ci95"]
        assert abs(effect[name]["value"] - true[name]["value"]) < high - low
    # Its curve has the names and units of the system.
    assert "friction at tau_l [N m]" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.slow
def test_a_stribeck_peak_is_named_where_nothing_fits_to_the_noise_and_only_the_declared_model_knows_coulomb_friction(tmp_path):
    folder, truth = machine(tmp_path, "arm_m_stribeck_tau_2", seed=5150)
    result = refine(folder / "plain.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(found) == ["stribeck@tau_2"] and not found["complete"]
    force = found["effects"][0]["params"]["force"]["value"]
    assert force == pytest.approx(truth["effects"][0]["params"]["force"]["value"], rel=0.1)
    assert found["effects"][0]["share"] == pytest.approx(truth["share"], abs=0.1)
    # The amended system has the velocity over which the friction changes its sign, which no attachment states. The search integrates
    # with steps whose error may be a part of what is left.
    assert any("changes its sign over" in note for note in found["notes"])
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", folder / "plain.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(found["residual"]["validation"]["rms_after"], rel=0.03)


@pytest.mark.slow
def test_an_inertia_that_is_far_from_its_declared_value_is_named_where_nothing_fits_to_the_noise(tmp_path):
    folder, truth = machine(tmp_path, "furuta_m_parameter_J_p")
    result = refine(folder / "study.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(found) == ["parameter@J_p"] and not found["complete"]
    effect, change = found["effects"][0], truth["effects"][0]["params"]["change"]["value"]
    corrected = {own["parameter"]: own["value"] / own["declared"] for own in found["corrections"]}
    # A pendulum shows its inertia over mass times length.
    inertia = 1 + effect["params"]["delta"]["value"] / 1.1e-3
    off = truth["off"]
    true = (1 + change) * (1 + off["J_p"]) / (1 + off["m"]) / (1 + off["l"])
    assert inertia / corrected["m"] / corrected["l"] == pytest.approx(true, rel=0.05)
    assert effect["share"] == pytest.approx(truth["share"], abs=0.1)
    assert "J_p" not in corrected
    # The amended system has the other value.
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", folder / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(found["residual"]["validation"]["rms_after"], rel=1e-3)


def test_a_delay_of_a_slow_process_is_in_the_amended_system(tmp_path):
    folder, truth = machine(tmp_path, "tanks_e_delay_u")
    result = refine(folder / "study.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    delay = found["effects"][0]["params"]["delay"]["value"]
    assert named(found) == ["act.delay"] and delay == pytest.approx(truth["effects"][0]["params"]["delay"]["value"], rel=0.02)
    # More than 255 samples of 1 ms, as many as a block keeps.
    assert delay > 0.5
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", folder / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(found["residual"]["validation"]["rms_after"], rel=1e-3)


@pytest.mark.parametrize(
    ("case", "seed", "imitation", "reason"),
    [
        ("tanks_m_leakage_q_1", 501, "act.droop", "that is a gain"),
        ("tanks_m_pair_gain_u_leakage_q_1", 301, "act.deadband", "no value lies in it: that is an offset"),
    ],
)
def test_a_shape_that_no_record_shows_stands_for_nothing_else(tmp_path, case, seed, imitation, reason):
    """A leak that no channel has, and a pump that never stops: a fall within the first seconds is a gain, a dead band an offset."""
    folder, _ = machine(tmp_path, case, seed=seed)
    # Beside corrections they take next to nothing, which is reason enough; without that rule their shape is one.
    for words, why in ([], "beyond the corrections"), (["--set", "tie_share=0"], reason):
        result = start("refine", folder / "study.toml", "-q", "-o", tmp_path / "out", *words)
        assert result.returncode == 11, result.stdout + result.stderr
        found = json.loads((tmp_path / "out" / "report.json").read_text())
        assert named(found) == []
        tried = [own for step in found["steps"] for own in step["candidates"] if own["id"] == imitation]
        assert any(why in (own["rejected"] or "") for own in tried), tried


@pytest.mark.parametrize("kind", [pytest.param("resistance", marks=pytest.mark.slow), "voltage_drop"])
def test_a_voltage_that_is_lost_along_a_current_is_found_at_the_voltage(tmp_path, kind):
    folder, truth = machine(tmp_path, f"motor_e_{kind}_V", seed=3)
    result = refine(folder / "plain.toml", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(found) == [f"{kind}@V"] and found["complete"]
    main = truth["effects"][0]["main"]
    true, value = truth["effects"][0]["params"][main], found["effects"][0]["params"][main]
    assert value["value"] == pytest.approx(true["value"], rel=0.05) and value["unit"] == {"coef": "V/A", "drop": "V"}[main]
    amended_has_printed_errors(folder / "plain.toml", tmp_path / "out", found)
