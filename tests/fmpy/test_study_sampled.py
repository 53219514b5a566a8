"""Studies over a sampled model: an identified linear actuator whose command has a dead band that the model lacks."""

import json

import numpy as np
import pytest

from command import start

STEP, WIDTH, NOISE = 0.005, 12.0, 0.3
POLE, GAIN = 0.92, 0.95


def record(path, seed, width, begin=0.0):
    """Pressure behind a first-order lag from `begin` on; commands are steps of random height."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-80, 80, 40), 50)
    inside = u - np.clip(u, -width, width)
    y = np.empty(len(u))
    y[0] = begin
    for k in range(len(u) - 1):
        y[k + 1] = POLE * y[k] + (1 - POLE) * GAIN * inside[k]
    rows = np.column_stack([STEP * np.arange(len(u)), u, y + NOISE * rng.standard_normal(len(u))])
    np.savetxt(path, rows, delimiter=",", header="time [s],command [kPa],pressure [kPa]", comments="", fmt="%.8g")


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sampled")
    for k in range(2):
        record(folder / f"linear_{k}.csv", k, 0.0)
    names = [folder / f"linear_{k}.csv" for k in range(2)]
    options = ["--inputs", "command", "--outputs", "pressure", "--order", "1", "--fmu", "actuator", "-o", folder / "identified"]
    result = start("identify", "state-space", *names, *options)
    assert result.returncode == 0, result.stderr
    text = 'system = "identified/actuator.fmu"\n[inputs]\n"u[1]" = { column = "command", hold = true }\n'
    text += '[outputs]\n"y[1]" = { column = "pressure" }\n'
    for k in range(4):
        # Records begin anywhere: the first state is fitted, the eleven that the model does not use are not.
        record(folder / f"r{k}.csv", 10 + k, WIDTH, begin=20.0 * (k - 1))
        role = "estimation" if k < 3 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = "fit"\n'
    (folder / "study.toml").write_text(text)
    result = start("refine", folder / "study.toml", "-o", folder / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    return folder, json.loads((folder / "out" / "report.json").read_text())


def test_the_dead_band_before_an_identified_model_is_found(refined):
    _, report = refined
    [effect] = [effect for effect in report["effects"] if effect["selected"]]
    assert effect["id"] == "deadband@u[1]"
    width = effect["params"]["width"]
    assert width["value"] == pytest.approx(WIDTH, rel=0.02)
    assert report["residual"]["validation"]["rms_after"]["pressure"] == pytest.approx(NOISE, rel=0.1)


def test_the_amended_system_gives_the_errors_of_the_report(refined):
    folder, report = refined
    result = start("run", folder / "out" / "system" / "system.ssd", "--study", folder / "study.toml", "-o", folder / "run")
    assert result.returncode == 0, result.stderr
    summary = json.loads((folder / "run" / "summary.json").read_text())
    for role in ("estimation", "validation"):
        assert summary[role]["rms"] == pytest.approx(report["residual"][role]["rms_after"], rel=1e-3)
