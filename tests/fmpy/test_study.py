"""`airloop refine` of studies: a shipped one whose truth is known, what it refuses, and measured sets where they are there."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "06_study"
MEASURED = ROOT.parent / "shared" / "data" / "measured"


def refine(path, out):
    binary = Path(os.environ.get("AIRLOOP", ROOT / "target" / "release" / "airloop"))
    if not binary.exists():
        pytest.fail(f"{binary} does not exist: run `make fmu` first")
    return subprocess.run([binary, "refine", str(path), "-o", str(out)], cwd=ROOT, capture_output=True, text=True)


def report(path, out):
    result = refine(path, out)
    assert result.returncode in (0, 10, 11, 12), result.stdout + result.stderr
    return json.loads((out / "report.json").read_text())


def named(found):
    return [effect["id"] for effect in found["effects"] if effect["selected"]]


def changed(tmp_path, old, new):
    """The example with another text in its study.toml."""
    folder = tmp_path / "study"
    shutil.copytree(EXAMPLE, folder)
    text = (folder / "study.toml").read_text()
    assert old in text
    (folder / "study.toml").write_text(text.replace(old, new))
    return folder


def test_dry_friction_and_drag_are_found_together_with_their_values(tmp_path):
    found = report(EXAMPLE, tmp_path / "out")
    assert set(named(found)) == {"pole.coulomb", "pole.quaddrag"}
    values = {e["id"]: next(iter(e["params"].values()))["value"] for e in found["effects"] if e["selected"]}
    # make_records.py: only the ratios to the inertia show in a free swing, and I is fitted from 0.0036.
    assert values["pole.coulomb"] == pytest.approx(4.0e-4, rel=0.1)
    assert values["pole.quaddrag"] == pytest.approx(3.0e-5, rel=0.1)
    residual = found["residual"]["validation"]
    assert residual["rms_after"]["angle"] < 0.2 * residual["rms_before"]["angle"]


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('role = "validation"', 'role = "repeat"', ["validation"]),
        ('column = "angle", unit = "rad", offset', 'column = "angel", unit = "rad", offset', ["angel", "angle", "line"]),
        ('unit = "rad", offset', 'unit = "N", offset', ["rad", "line"]),
        ('input = "tau_ext"', 'input = "tau"', ["tau", "tau_ext", "line"]),
        ('parameter = "I"', 'parameter = "J"', ["J", "I", "line"]),
        ('channels = ["pole"]', 'channels = ["poles"]', ["poles", "pole", "line"]),
        ("to_s = 14.0", "to_s = -14.0", ["samples", "line"]),
        ("m = 0.15", 'm = "heavy"', ["line", "column"]),
        ("start = 0.0001", "start = -1.0", ["b", "line"]),
    ],
)
def test_what_does_not_fit_is_told_with_its_place(tmp_path, old, new, words):
    result = refine(changed(tmp_path, old, new), tmp_path / "out")
    assert result.returncode == 1
    for word in ["study.toml", *words]:
        assert word in result.stderr, result.stderr
    assert not (tmp_path / "out" / "report.json").exists()


def measured(name, tmp_path):
    folder = MEASURED / name
    if not folder.exists():
        pytest.skip(f"{folder} is not there")
    return report(folder, tmp_path / "out")


def test_free_pendulum(tmp_path):
    found = measured("pendulum_free_swing", tmp_path)
    assert set(named(found)) == {"pole.coulomb", "pole.quaddrag"}
    assert all(p["value"] >= 0 for e in found["effects"] if e["selected"] for p in e["params"].values())
    # 15 mrad over 33-55 s and 4 mrad over the tail, pooled by their samples (22 s, 5.5 s).
    assert found["residual"]["validation"]["rms_after"]["angle"] <= 0.0135


def test_seal(tmp_path):
    found = measured("pneumatic_seal_friction", tmp_path)
    assert named(found)[:2] == ["pf.pressure", "act.area"]
    assert found["residual"]["validation"]["rms_before"]["force"] == pytest.approx(1.33, abs=0.01)
    assert found["residual"]["validation"]["rms_after"]["force"] <= 1.0


def test_linear_axis(tmp_path):
    found = measured("linear_axis_emps", tmp_path)
    names = named(found)
    assert "cf.coulomb" in names and {"cf.offset", "cf.asymmetry"} & set(names) and "cf.stribeck" not in names
    before, after = (found["residual"]["validation"][key] for key in ("rms_before", "rms_after"))
    assert before["position"] == pytest.approx(6.25e-3, rel=0.01) and after["position"] <= 2.1e-3
    assert before["drive_force"] == pytest.approx(10.1, rel=0.01) and after["drive_force"] <= 3.5
