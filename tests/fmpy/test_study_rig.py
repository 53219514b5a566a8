"""The rig's record in `data/rig/v01` as a study over the FMUs of example 01, without a word on where to look."""

import json
import tomllib

import pytest

from command import ROOT, start

RECORDS = ROOT / "data" / "rig" / "v01"
SYSTEM = ROOT / "examples" / "01_run" / "system.ssd"
TRUTH = json.loads((ROOT / "examples" / "05_refine" / "expected.json").read_text())["truth"]


def study(sensors, seconds):
    """Text of a study: the noise of the sensors as the case declares it, the beginnings of four records."""
    outputs = "".join(
        f'{name} = {{ column = "{name}", unit = "{own["unit"]}", noise = {own["noise_rms"]} }}\n'
        for name, own in sensors.items()
        if name != "u"
    )
    segments = "".join(
        f'[[segment]]\nfile = "{RECORDS / f"trial_{k:02d}.csv"}"\nrole = "{role}"\nto_s = {seconds}\ninitial = "fit"\n'
        for k, role in [(1, "estimation"), (3, "estimation"), (5, "estimation"), (7, "validation")]
    )
    inputs = 'u = { column = "u", unit = "N", hold = true }\n'
    return f'system = "{SYSTEM}"\nstep_s = 0.001\n[inputs]\n{inputs}[outputs]\n{outputs}{segments}'


@pytest.mark.slow
def test_the_spring_of_the_rig_is_found_at_its_port_over_fmus(tmp_path):
    sensors = tomllib.loads((RECORDS / "case.toml").read_text())["sensors"]
    path = tmp_path / "study.toml"
    path.write_text(study(sensors, 1.2))
    result = start("refine", path, "-o", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    [effect] = [effect for effect in found["effects"] if effect["selected"]]
    assert effect["id"] == "spring@cart_pole.F_ext"
    assert found["complete"]
    low, high = effect["params"]["stiffness"]["ci95"]
    value = effect["params"]["stiffness"]["value"]
    # Four standard deviations, as the interval has four on both sides together.
    assert abs(value - TRUTH["stiffness"]) < high - low
    assert value == pytest.approx(TRUTH["stiffness"], rel=0.005)
    for signal, own in found["remaining"]["signals"].items():
        assert own["floors"] < 1.1, signal
