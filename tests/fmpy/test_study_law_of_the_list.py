"""`airloop refine` where several effects of the list are missing at once, none of which helps alone: a mass with a spring and
dry friction, whose declared damping stands for both. A law that is their sum is answered as these effects; so are effects that
are small beside the error of a declared model which drifts away."""

import json

import numpy as np
import pytest

from command import start
from segments import write_mass_study
from test_study import named, refine

STEP, COUNT, FINE, NOISE = 0.01, 1000, 20, 1e-4
STIFFNESS, DRY, DAMPING, DECLARED = 8.0, 1.0, 0.2, 1.2


def command(rng):
    t = STEP * np.arange(COUNT)
    sines = (rng.uniform(1, 3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.3, 0.7, 1.3, 2.1, 3.3))
    return np.round(sum(sines), 4)


def moved(u):
    """Positions of the mass by the midpoint rule."""
    x, v, h, shown = 0.0, 0.0, STEP / FINE, []
    for force in u:
        shown.append(x)
        for _ in range(FINE):
            rate = lambda x, v: force - STIFFNESS * x - DAMPING * v - DRY * np.tanh(v / 0.01)
            xm, vm = x + 0.5 * h * v, v + 0.5 * h * rate(x, v)
            x, v = x + h * vm, v + h * rate(xm, vm)
    return np.array(shown)


def held_steps(rng):
    return np.round(np.repeat(rng.uniform(-8, 8, -(-COUNT // 60)), 60)[:COUNT], 4)


def write_study(folder, seed, command=command, declared=DECLARED):
    rng, records = np.random.default_rng(seed), []
    for _ in range(3):
        u = command(rng)
        x = moved(u) + NOISE * rng.standard_normal(COUNT)
        records.append(np.column_stack([STEP * np.arange(COUNT), u, x]))
    return write_mass_study(folder, records, declared)


@pytest.mark.parametrize(
    "command, declared",
    [
        pytest.param(command, DECLARED, marks=pytest.mark.slow, id="sines"),
        pytest.param(held_steps, DECLARED, marks=pytest.mark.slow, id="steps"),
        pytest.param(held_steps, 0.6, id="less_damping"),
    ],
)
def test_spring_coulomb_and_less_damping_are_answered_as_these(tmp_path, command, declared):
    study = write_study(tmp_path / "case", 1, command, declared)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert {name.split("@")[0] for name in named(report)} == {"spring", "coulomb", "viscous"}, result.stdout
    # The slope of the friction takes 0.01 m/s: with the steps of integration of the declared model several times the noise is left.
    assert report["complete"], result.stdout
    values = {e["id"].split("@")[0]: e["params"] for e in report["effects"] if e["selected"]}
    assert values["spring"]["stiffness"]["value"] == pytest.approx(STIFFNESS, rel=1e-3)
    assert values["coulomb"]["force"]["value"] == pytest.approx(DRY, rel=2e-3)
    assert values["viscous"]["coef"]["value"] == pytest.approx(DAMPING - declared, rel=2e-3)
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
