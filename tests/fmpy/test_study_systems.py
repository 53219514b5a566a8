"""`airloop refine` of systems other than the rig, on sets with known truth made by tests/study/systems: one of each kind."""

import json
import subprocess
import sys

import numpy as np
import pytest

from test_study import ROOT, named, refine

sys.path.insert(0, str(ROOT / "tests" / "study" / "systems"))
import make_systems  # noqa: E402

CASES = [  # family, kind, strength, exit code, effects
    ("pendulum", "none", 1.0, 10, set()),
    ("pendulum", "drag", 1.0, 0, {"pole.quaddrag"}),
    ("pendulum", "cable", 1.0, 11, set()),
    ("seal", "area", 2.5, 0, {"act.area"}),
    ("actuator", "none", 1.0, 10, set()),
    ("actuator", "deadband", 1.0, 0, {"act.deadband"}),
    ("actuator", "play", 3.0, 0, {"act.hysteresis"}),
    ("actuator", "offset", 3.0, 0, {"sensor.offset"}),
]


@pytest.mark.parametrize("family, kind, strength, code, effects", CASES)
def test_what_is_missing_is_named_and_nothing_else(tmp_path, family, kind, strength, code, effects):
    folder = tmp_path / "set"
    folder.mkdir()
    make_systems.FAMILIES[family][0](folder, np.random.default_rng(7), kind, strength)
    result = refine(folder, tmp_path / "out")
    assert result.returncode == code, result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert set(named(found)) == effects
    if kind == "cable":
        assert found["unexplained"] == {"channel": "pole", "variables": ["theta"]}
    if family == "actuator" and effects:
        # The amended system runs as it stands.
        system = tmp_path / "out" / "system" / "system.ssd"
        run = subprocess.run(
            [ROOT / "target/release/airloop", "run", system, "--measured", folder / "trial_5.csv", "-o", tmp_path / "run"], capture_output=True, text=True
        )
        assert run.returncode == 0, run.stderr


def test_an_enumeration_of_the_system_is_set_by_its_item_and_checked(tmp_path):
    make_systems.actuator(tmp_path, np.random.default_rng(7), "none", 1.0)
    study = tmp_path / "study.toml"
    study.write_text(study.read_text().replace('"sampled"', '"smooth"'))
    result = refine(tmp_path, tmp_path / "out")
    assert result.returncode == 1
    for word in ["line 5", "realisation", "smooth", "sampled", "continuous"]:
        assert word in result.stderr, result.stderr
