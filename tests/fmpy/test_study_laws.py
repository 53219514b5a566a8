"""Laws that no list holds on records of `make study-laws`, made anew: friction with a memory that passes for friction of the list, a force
in time, a force over the speed that validation records carry further. The records are made by other code than the FMUs."""

import json
import sys

import numpy as np
import pytest

from command import ROOT, start

LAWS = ROOT / "tests" / "study" / "laws"
sys.path.append(str(LAWS))
import make_laws
import score_laws

# System, family, text, force of (x, v, t, z), rates of z, seed of the drive.
CASES = {
    "bristle": ("pendulum", "z", lambda x, v, t, z: 0.98 * z[0], lambda x, v, t, z: [v - abs(v) * z[0] / 0.05], 3),
    "maxwell": ("pendulum", "z", lambda x, v, t, z: 0.13 * z[0], lambda x, v, t, z: [v - z[0] / 0.26], 4),
    "maxwell_of_an_arm": ("arm", "z", lambda x, v, t, z: 0.9 * z[0], lambda x, v, t, z: [v - z[0] / 0.6], 5),
    "wave": ("arm", "t", lambda x, v, t, z: 0.75 * np.sin(3.956 * t + 0.11), lambda x, v, t, z: [], 6),
    "bump": ("pendulum", "v", lambda x, v, t, z: 0.06 * np.exp(-(((v - 0.89) / 0.477) ** 2)), lambda x, v, t, z: [], 7),
}


@pytest.mark.parametrize("name", CASES)
def test_the_law_is_found_and_leaves_noise(tmp_path, name):
    system, variable, force, rates, seed = CASES[name]
    system = make_laws.SYSTEMS[system]
    rows, points, floor = make_laws.records(system, ("", force, rates), 1e-3, np.random.default_rng(seed), False, 0.0)
    for r, own in enumerate(rows):
        make_laws.write(tmp_path, dict(zip(("time", *system.columns), own)), r, system.digits)
    text = f'name = "{name}"\n' + system.study(tmp_path) + make_laws.segments(system.initial)
    (tmp_path / "study.toml").write_text(text)
    result = start("refine", tmp_path, "-o", tmp_path / "out")
    assert result.returncode == 13, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert variable in report["law"]["formula"]
    assert score_laws.judge(report, tmp_path / "out", {"points": points}) < score_laws.RIGHT
    (after,) = report["residual"]["validation"]["rms_after"].values()
    assert after < 1.1 * floor
