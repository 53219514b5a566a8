"""Stamps that jitter: a held command acts from its own stamp on, also where the records are taken onto a grid."""

import json

import numpy as np
import pytest

from command import start

STEP, TAU, GAIN, NOISE = 0.005, 0.1, 0.8, 0.008


def record(path, seed, jitter):
    """Pressure behind a first-order lag, exact between the stamps; the command is new at each of some."""
    rng = np.random.default_rng(seed)
    n = 2000
    time = STEP * np.arange(n) + jitter * STEP * rng.standard_normal(n)
    command = np.repeat(rng.uniform(0, 8, n // 20), 20)
    pressure = np.empty(n)
    pressure[0] = GAIN * command[0]
    for k in range(n - 1):
        decay = np.exp(-(time[k + 1] - time[k]) / TAU)
        pressure[k + 1] = GAIN * command[k] + (pressure[k] - GAIN * command[k]) * decay
    rows = np.column_stack([time, command, pressure + NOISE * rng.standard_normal(n)])
    np.savetxt(path, rows, delimiter=",", header="time [s],command [V],pressure [bar]", comments="", fmt="%.8g")


@pytest.mark.parametrize("jitter", [0.02, 0.1])
def test_nothing_is_missing_in_an_exact_model_whose_stamps_jitter(tmp_path, jitter):
    """The lag itself by the mass of `airloop:rigid-mass`: m dv/dt = F - b v, with v for the pressure."""
    text = (
        f'system = "airloop:rigid-mass"\n[parameters]\nm = {TAU / GAIN}\nb = {1 / GAIN}\n'
        '[inputs]\nF = { column = "command", hold = true, unit = "N" }\n'
        '[outputs]\nv = { column = "pressure", unit = "m/s" }\n'
    )
    for k in range(5):
        record(tmp_path / f"r{k}.csv", 40 + k, jitter)
        role = "estimation" if k < 4 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = "fit"\n'
    (tmp_path / "study.toml").write_text(text)
    result = start("refine", tmp_path / "study.toml", "-o", tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["residual"]["validation"]["rms_before"]["pressure"] < 1.1 * NOISE
    assert any("stamps" in note for note in report["notes"]), report["notes"]
