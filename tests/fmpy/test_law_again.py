"""A law that no list holds is found in some records, and its file explains others as an effect of one's own."""

import json

import numpy as np
import pytest

from command import start

MASS, DAMPING, WEAKENING = 1.3, 2.0, 60.0
STEP, COUNT, STEPS = 0.004, 1500, 4
NOISE = 2e-5

STUDY = """name = "mass whose damping grows with the way"
system = "airloop:rigid-mass"
[parameters]
m = 1.3
b = 2.0
[inputs]
F = { column = "force", unit = "N", hold = true }
[outputs]
x = { column = "position", unit = "m" }
[[attachment]]
input = "F"
velocity = "v"
position = "x"
"""


def drive(seed):
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(COUNT)
    return sum(rng.uniform(2, 4) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.35, 0.8, 1.6))


def motion(u):
    """Position of a mass with the damping `b + c x^2` under a held force, classical Runge-Kutta with four steps per sample."""

    def rate(x, v, force):
        return v, (force - (DAMPING + WEAKENING * x * x) * v) / MASS

    x, v, found, h = 0.0, 0.0, [], STEP / STEPS
    for force in u:
        found.append(x)
        for _ in range(STEPS):
            a = rate(x, v, force)
            b = rate(x + h / 2 * a[0], v + h / 2 * a[1], force)
            c = rate(x + h / 2 * b[0], v + h / 2 * b[1], force)
            d = rate(x + h * c[0], v + h * c[1], force)
            x += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            v += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    return np.array(found)


def records(folder, seed):
    """A study of four records, the last for validation."""
    folder.mkdir()
    text = STUDY
    for k in range(4):
        u = drive(seed + k)
        x = motion(u) + NOISE * np.random.default_rng(1000 + seed + k).standard_normal(COUNT)
        rows = np.column_stack([STEP * np.arange(COUNT), u, x])
        np.savetxt(folder / f"r{k}.csv", rows, delimiter=",", header="time,force,position", comments="", fmt="%.7f")
        role = "estimation" if k < 3 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ x = 0.0, v = 0.0 }}\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("law")
    first = start("refine", records(folder / "first", 10), "-o", folder / "out")
    assert first.returncode == 13, first.stdout + first.stderr
    effects = folder / "effects"
    effects.mkdir()
    (effects / "law.toml").write_bytes((folder / "out" / "system" / "law.toml").read_bytes())
    second = start("refine", records(folder / "second", 50), "--effects", effects, "-o", folder / "again")
    assert second.returncode == 0, second.stdout + second.stderr
    read = lambda name: json.loads((folder / name / "report.json").read_text())  # noqa: E731
    return read("out"), read("again")


@pytest.mark.slow
def test_the_product_is_found_with_its_coefficient(found):
    law = found[0]["law"]
    assert law["formula"] == "a*x^2*v" and law["port"] == "F"
    assert law["params"]["a"]["value"] == pytest.approx(WEAKENING, rel=0.02)


@pytest.mark.slow
def test_its_file_explains_other_records_with_the_same_coefficient(found):
    selected = [effect for effect in found[1]["effects"] if effect["selected"]]
    assert [effect["id"].split("@")[0] for effect in selected] == ["law"]
    low, high = selected[0]["params"]["a"]["ci95"]
    margin = 0.02 * WEAKENING
    assert low - margin < WEAKENING < high + margin and low - margin < found[0]["law"]["params"]["a"]["value"] < high + margin
    for report in found:
        residual = report["residual"]["validation"]
        assert residual["rms_after"]["position"] < 0.1 * residual["rms_before"]["position"]
