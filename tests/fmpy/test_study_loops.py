"""`airloop refine` on a system with an algebraic loop: two sliding masses that push each other by their accelerations. The
machine is solved here for both accelerations at once."""

import json

import numpy as np
import pytest

from command import start
from segments import write_segments
from test_loops import system_of
from test_study import named, refine

LINKS = [("u", "one.F", 1.0, 0.0), ("one.a", "two.F", 0.3, 0.0), ("two.a", "one.F_ext", -0.2, 0.0), ("two.x", "two.F_ext", -3.0, 0.0)]
STEP, COUNT, FINE, NOISE = 0.01, 600, 10, 1e-3
MASS, DAMPING = (1.2, 0.5), (0.8, 0.3)


def moved(u, dry):
    """Positions of both masses by the midpoint rule; the second is held by a spring, the first is braked by dry friction."""
    state, h, shown = np.zeros(4), STEP / FINE, []
    # m1 a1 + 0.2 a2 = f1, m2 a2 - 0.3 a1 = f2
    inertia = np.array([[MASS[0], 0.2], [-0.3, MASS[1]]])

    def rates(state, force):
        x1, x2, v1, v2 = state
        forces = [force - DAMPING[0] * v1 - dry * np.tanh(v1 / 2e-3), -DAMPING[1] * v2 - 3.0 * x2]
        return np.concatenate([[v1, v2], np.linalg.solve(inertia, forces)])

    for force in u:
        shown.append(state[:2])
        for _ in range(FINE):
            state = state + h * rates(state + 0.5 * h * rates(state, force), force)
    return np.array(shown)


def write_study(folder, dry, seed):
    folder.mkdir(parents=True)
    system_of(folder, {"one": "rigid-mass.fmu", "two": "rigid-mass.fmu"}, LINKS, port="u")
    values = zip(("one", "two"), MASS, DAMPING)
    parameters = "".join(f'"{name}.m" = {m}\n"{name}.b" = {b}\n' for name, m, b in values)
    text = f'system = "system.ssd"\n[parameters]\n{parameters}[inputs]\nu = {{ column = "u", hold = true }}\n'
    text += '[[attachment]]\ninput = "u"\n[[attachment]]\ninput = "two.F_ext"\n'
    text += "".join(f'[outputs."{name}.x"]\ncolumn = "{name}"\nunit = "m"\n' for name in ("one", "two"))
    rng, begin = np.random.default_rng(seed), ", ".join(f'"{name}.{state}" = 0.0' for name in ("one", "two") for state in "xv")
    records = []
    for _ in range(3):
        u = np.round(np.repeat(rng.uniform(-4, 4, COUNT // 50), 50), 3)
        shown = moved(u, dry) + NOISE * rng.standard_normal((COUNT, 2))
        records.append(np.column_stack([STEP * np.arange(COUNT), u, shown]))
    text += write_segments(folder, records, "time,u,one,two", 3 * [f"{{ {begin} }}"])
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def test_friction_inside_a_loop_is_named_and_its_system_runs(tmp_path):
    study = write_study(tmp_path / "case", 0.6, 1)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report) == ["coulomb@u"], result.stdout
    assert next(iter(report["effects"][0]["params"].values()))["value"] == pytest.approx(0.6, rel=0.03)
    before, after = (report["residual"]["validation"][key] for key in ("rms_before", "rms_after"))
    assert after["one"] < 2 * NOISE and after["two"] < 2 * NOISE
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"]["one"] == pytest.approx(after["one"], abs=1e-3 * before["one"])


def test_a_loop_that_lacks_nothing_gets_nothing(tmp_path):
    result = refine(write_study(tmp_path / "case", 0.0, 2), tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr
