"""Laws that no list holds on records of `make study-laws`, made anew: friction with a memory that passes for friction of the list, a force
in time, a force over the speed that validation records carry further; friction with a memory where declared values are off and noise is
large, so that viscous friction with them leaves little more than noise. The records are made by other code than the FMUs."""

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


def refined(folder, system, law, seed, messy=False):
    """The report on records that are made of a system with a law, points of the law, and the noise on validation records."""
    system, noise = make_laws.SYSTEMS[system], 0.02 if messy else 1e-3
    rows, points, floor = make_laws.records(system, ("", *law), noise, np.random.default_rng(seed), messy, 0.015)
    for r, own in enumerate(rows):
        make_laws.write(folder, dict(zip(("time", *system.columns), own)), r, system.digits)
    text = 'name = "law"\n' + system.study(folder) + make_laws.segments(system.initial)
    (folder / "study.toml").write_text(text)
    result = start("refine", folder, "-o", folder / "out")
    assert result.returncode == 13, result.stdout + result.stderr
    return json.loads((folder / "out" / "report.json").read_text()), points, floor


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in ("bristle", "bump"))) for name in CASES])
def test_the_law_is_found_and_leaves_noise(tmp_path, name):
    system, variable, force, rates, seed = CASES[name]
    report, points, floor = refined(tmp_path, system, (force, rates), seed)
    assert variable in report["law"]["formula"]
    assert score_laws.judge(report, tmp_path / "out", {"points": points}) < score_laws.RIGHT
    (after,) = report["residual"]["validation"]["rms_after"].values()
    assert after < 1.1 * floor


def test_friction_with_a_memory_is_found_where_viscous_friction_with_corrections_leaves_little(tmp_path):
    stiffness, time = 1.57, 0.2
    law = (lambda x, v, t, z: stiffness * z[0], lambda x, v, t, z: [v - z[0] / time])
    report, _, floor = refined(tmp_path, "arm", law, 21, messy=True)
    assert report["law"]["formula"] == "k*z"
    own = {name: value["value"] for name, value in report["law"]["params"].items()}
    assert own == {"k": pytest.approx(stiffness, rel=0.1), "s": pytest.approx(time, rel=0.1)}
    (after,) = report["residual"]["validation"]["rms_after"].values()
    assert after < 1.1 * floor
