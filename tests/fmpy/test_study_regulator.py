"""A pressure regulator that fills faster than it empties, from records to the effect as a user goes: identify the best linear
model, then ask what it lacks. The regulator is a proportional valve with choked flow and an overlap, typed here."""

import json

import numpy as np
import pytest

from command import start

STEP, COUNT, NOISE = 0.005, 1600, 0.3
SUPPLY, AMBIENT = 800.0, 101.0


def flow(upstream, downstream, conductance):
    """kPa/s: choked below a ratio of pressures of 0.3 (ISO 6358)."""
    ratio = downstream / upstream
    return conductance * upstream * (1.0 if ratio < 0.3 else np.sqrt(max(0.0, 1.0 - ((ratio - 0.3) / 0.7) ** 2)))


def regulator(command, fine=20):
    pressure, integral, spool, h, shown = AMBIENT + command[0], 0.0, 0.0, STEP / fine, []
    for wanted in command:
        shown.append(pressure - AMBIENT)
        for _ in range(fine):
            error = wanted - (pressure - AMBIENT)
            integral += h * error * 8.0
            spool += h * (np.clip(0.004 * error + 0.002 * integral, -1, 1) - spool) / 0.008
            opening = np.sign(spool) * max(abs(spool) - 0.01, 0.0)
            filling = opening > 0.0
            pressure += h * (flow(SUPPLY, pressure, 60 * opening) if filling else -flow(pressure, AMBIENT, -40 * opening))
    return np.array(shown)


def record(path, seed):
    rng = np.random.default_rng(seed)
    if seed % 2:
        command = np.repeat(rng.uniform(50, 450, COUNT // 70 + 1), 70)[:COUNT]
    else:
        t = STEP * np.arange(COUNT)
        sines = sum(np.sin(2 * np.pi * 0.11 * k * t + rng.uniform(0, 6.28)) for k in range(1, 12))
        command = 250 + 200 * sines / np.abs(sines).max()
    measured = regulator(command) + NOISE * rng.standard_normal(COUNT)
    columns = np.column_stack([STEP * np.arange(COUNT), command, measured])
    header = "time [s],command [kPa],pressure [kPa]"
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.6g")


def write_study(folder):
    """Records, the best linear model of them and a study of it."""
    names = [folder / f"r{k}.csv" for k in range(6)]
    for k, name in enumerate(names):
        record(name, k)
    options = ["--inputs", "command", "--outputs", "pressure", "--order", "2", "--fmu", "regulator"]
    result = start("identify", "state-space", *names[:4], *options, "-o", folder / "identified")
    assert result.returncode == 0, result.stderr
    text = 'system = "identified/regulator.fmu"\n[inputs]\n"u[1]" = { column = "command", hold = true }\n'
    text += '[outputs]\n"y[1]" = { column = "pressure" }\n'
    for k in range(6):
        role = "estimation" if k < 4 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = "fit"\n'
    (folder / "study.toml").write_text(text)


@pytest.mark.slow
def test_what_the_best_linear_model_of_a_regulator_lacks_is_found(tmp_path):
    write_study(tmp_path)
    result = start("refine", tmp_path / "study.toml", "-o", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    effects = {effect["id"]: effect["params"] for effect in report["effects"] if effect["selected"]}
    assert list(effects) == ["fill@u[1]"]
    fill = effects["fill@u[1]"]
    # It empties more slowly than it fills, and the linear model has the mean of both.
    assert fill["down"]["value"] > 2 * fill["up"]["value"]
    residual = report["residual"]["validation"]
    assert residual["rms_after"]["pressure"] < 0.7 * residual["rms_before"]["pressure"]
    # The amended system gives these errors: it has the coefficients, too.
    system = tmp_path / "out" / "system" / "system.ssd"
    run = start("run", system, "--study", tmp_path / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(residual["rms_after"], rel=1e-2)
    # As the report prints it, in its folder; the model has no unit, the column has.
    text = (tmp_path / "out" / "report.md").read_text()
    assert "airloop run system/system.ssd --study ../study.toml " in text
    assert "pressure [kPa]" in text


def test_a_study_of_an_identified_model_names_effects_as_reports_do_and_units_of_columns_agree(tmp_path):
    write_study(tmp_path)
    study = tmp_path / "study.toml"
    text = study.read_text()
    for name in ["fill", "fill@u[1]"]:
        study.write_text(text + f'[[attachment]]\ninput = "u[1]"\neffects = ["{name}"]\n')
        plan = start("refine", study, "--plan")
        assert plan.returncode == 0, plan.stderr
        assert "fill" in plan.stdout and "deadband" not in plan.stdout, plan.stdout
    study.write_text(text + '[[attachment]]\ninput = "u[1]"\neffects = ["fill@u[2]"]\n')
    assert "fill@u[2]" in start("refine", study, "--plan").stderr

    record = tmp_path / "r5.csv"
    record.write_text(record.read_text().replace("pressure [kPa]", "pressure [bar]"))
    study.write_text(text)
    refused = start("refine", study, "-o", tmp_path / "out")
    assert refused.returncode == 1
    assert "kPa in r0.csv" in refused.stderr and "bar in r5.csv" in refused.stderr, refused.stderr


def test_a_report_of_a_search_out_of_time_has_fitted_states_and_intervals(tmp_path):
    write_study(tmp_path)
    study = tmp_path / "study.toml"
    text = study.read_text() + '[[attachment]]\ninput = "u[1]"\neffects = ["gain"]\n'
    study.write_text(text)
    errors = []
    for options in [[], ["--budget", "3 s"]]:
        result = start("refine", study, "-o", tmp_path / "out", *options)
        assert result.returncode in (0, 10, 11, 12, 13), result.stderr
        report = json.loads((tmp_path / "out" / "report.json").read_text())
        errors.append(report["residual"]["validation"]["rms_before"]["pressure"])
    # The declared model is fitted in less than that; its error does not depend on when the search ends.
    assert report["partial"] is True
    assert errors[1] == pytest.approx(errors[0], rel=1e-3)
