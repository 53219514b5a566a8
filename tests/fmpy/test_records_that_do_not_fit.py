"""Records with a wrong sign, a saturated sensor, another regime, gaps and several rates: told before the search, or searched right."""

import csv
import json
import math
import shutil
import subprocess

import pytest

from command import ROOT, start

PENDULUM = ROOT / "examples" / "06_study"
RIG = ROOT / "data" / "rig" / "v01"


def rows_of(path):
    with path.open() as file:
        head, *rows = csv.reader(file)
    return head, rows


def changed(source, target, column, change, only="*.csv"):
    """A copy of a folder in whose records, or in one, a column is `change(value)`."""
    shutil.copytree(source, target)
    for path in target.glob(only):
        head, rows = rows_of(path)
        at = head.index(column)
        for row in rows:
            row[at] = repr(change(float(row[at])))
        with path.open("w", newline="") as file:
            csv.writer(file).writerows([head, *rows])
    return target


def refused(folder, tmp_path, *words):
    result = start("refine", folder, "-o", tmp_path / "out")
    assert result.returncode == 1, result.stdout + result.stderr
    for word in words:
        assert word in result.stderr, result.stderr
    assert not (tmp_path / "out" / "report.json").exists()


def report(folder, tmp_path, code=0):
    result = start("refine", folder, "-o", tmp_path / "out")
    assert result.returncode == code, result.stdout + result.stderr
    return json.loads((tmp_path / "out" / "report.json").read_text()), result.stdout


def selected(found):
    return {effect["id"]: effect["params"] for effect in found["effects"] if effect["selected"]}


def test_a_command_of_the_other_sign_is_told_with_what_to_write(tmp_path):
    folder = shutil.copytree(ROOT / "examples" / "09_tanks", tmp_path / "tanks")
    subprocess.run(["sh", ROOT / "examples" / "make_fmu.sh", ROOT / "examples" / "09_tanks", folder], check=True, capture_output=True)
    study = folder / "study.toml"
    study.write_text(study.read_text().replace("hold = true }", "hold = true, scale = -1 }"))
    refused(folder, tmp_path, "column `u` has the other sign", "`scale = 1` at inputs.u", "line")


@pytest.mark.parametrize("column", ["u", "x"])
def test_a_column_of_a_case_with_the_other_sign_is_told(tmp_path, column):
    folder = changed(RIG, tmp_path / "case", column, lambda value: -value)
    refused(folder, tmp_path, f"column `{column}` has the other sign", "-1")


def test_one_record_of_a_case_with_the_other_sign_is_told(tmp_path):
    folder = changed(RIG, tmp_path / "case", "x", lambda value: -value, only="trial_02.csv")
    refused(folder, tmp_path, "column `x` has the other sign in trial_02.csv than in the other records", "-1")


def test_a_saturated_sensor_of_a_case_is_told(tmp_path):
    folder = changed(RIG, tmp_path / "case", "theta", lambda value: max(-0.75, min(0.75, value)))
    refused(folder, tmp_path, "`theta`", "0.75", "saturated", "trial_")


def pendulum(tmp_path, change, old="", new=""):
    """The pendulum with the rows of both records as `change` makes them."""
    folder = shutil.copytree(PENDULUM, tmp_path / "study")
    for name in ("swing.csv", "tail.csv"):
        head, rows = rows_of(folder / name)
        rows = change(name, [[float(cell) for cell in row] for row in rows])
        with (folder / name).open("w", newline="") as file:
            csv.writer(file).writerows([head, *rows])
    study = folder / "study.toml"
    assert old in study.read_text()
    study.write_text(study.read_text().replace(old, new) if old else study.read_text())
    return folder


def test_validation_of_another_regime_is_refused_or_told(tmp_path):
    small = lambda name, rows: [[t, a / 40 if name == "swing.csv" and t < 14.005 else a] for t, a in rows]
    refused(pendulum(tmp_path, small), tmp_path, "times larger in the validation records", "Exchange the roles")


def test_records_of_noise_are_refused(tmp_path):
    noise = lambda name, rows: [[t, 1e-3 * math.sin(1e4 * i * i)] for i, (t, _) in enumerate(rows)]
    refused(pendulum(tmp_path, noise), tmp_path, "no estimation record shows more than the noise")


def test_a_slower_sensor_leaves_cells_empty_and_counts_where_it_was_read(tmp_path):
    slow = lambda name, rows: [[t, a if i % 3 == 0 else ""] for i, (t, a) in enumerate(rows)]
    found, _ = report(pendulum(tmp_path, slow), tmp_path)
    values = {name: next(iter(params.values()))["value"] for name, params in selected(found).items()}
    # make_records.py
    assert values == {"pole.coulomb": pytest.approx(4.0e-4, rel=0.15), "pole.quaddrag": pytest.approx(3.0e-5, rel=0.15)}
    assert any("empty cells" in note for note in found["notes"])


def test_what_bridges_a_gap_is_no_measurement(tmp_path):
    gap = lambda name, rows: [row for row in rows if name != "swing.csv" or not 5.0 < row[0] < 6.3]
    result = start("refine", pendulum(tmp_path, gap), "-o", tmp_path / "out")
    assert result.returncode in (0, 11), result.stdout + result.stderr
    found = json.loads((tmp_path / "out" / "report.json").read_text())
    assert any("counts for no error" in note for note in found["notes"])
    # A straight line over one and a half swings, counted as measured, costs the validation records 0.097 rad.
    assert all(found["residual"][role]["rms_before"]["angle"] < 0.01 for role in ("estimation", "validation"))


def test_scale_and_offset_of_an_output(tmp_path):
    # make_records.py adds 0.003 rad.
    turned = lambda name, rows: [[t, 0.197 - a] for t, a in rows]
    old = 'theta = { column = "angle", unit = "rad", offset = "fit" }'
    folder = pendulum(tmp_path, turned, old, 'theta = { column = "angle", unit = "rad", scale = -1, offset = 0.194 }')
    study = folder / "study.toml"
    text = study.read_text().replace('theta = { column = "angle", unit = "rad" }', 'theta = { column = "angle", unit = "rad", scale = -1, offset = 0.194 }')
    study.write_text(text.replace('derivative_of = "angle"', 'derivative_of = "angle", scale = -1'))
    found, _ = report(folder, tmp_path)
    assert set(selected(found)) == {"pole.coulomb", "pole.quaddrag"}


def test_resample_writes_a_grid_with_units_and_says_what_it_did(tmp_path):
    record = tmp_path / "record.csv"
    times = [0.0002 * (k + 0.3 * math.sin(7.0 * k)) for k in range(20000)]
    rows = [[t, math.sin(2 * math.pi * 5 * t) + 0.5 * math.sin(2 * math.pi * 130 * t), k // 500 % 2] for k, t in enumerate(times)]
    with record.open("w", newline="") as file:
        csv.writer(file).writerows([["time", "y [m]", "u [N]"], *rows])
    result = start("resample", record, "--step", "5ms", "--held", "u", "-o", tmp_path / "new.csv")
    assert result.returncode == 0, result.stderr
    assert "low-pass" in result.stdout and "held between samples: u" in result.stdout
    head, rows = rows_of(tmp_path / "new.csv")
    assert head == ["time", "y [m]", "u [N]"]
    inside = [[float(cell) for cell in row] for row in rows[40:-40]]
    # 130 Hz is beyond the 100 Hz that the grid can show and would come back at 70 Hz with its 0.5; straight lines between
    # samples up to 0.32 ms apart are off by 0.5 (w h)^2 / 8 = 0.004 at most.
    assert max(abs(y - math.sin(2 * math.pi * 5 * t)) for t, y, _ in inside) < 0.01
    assert {u for *_, u in inside} == {0.0, 1.0}
    again = start("resample", record, "--step", "5ms", "-o", record)
    assert again.returncode == 1 and "record that is read" in again.stderr
    mine = tmp_path / "mine.csv"
    mine.write_text("time,y,u\n0,1,2\n0.3,2,3\n")
    again = start("resample", record, "--step", "5ms", "-o", mine)
    assert again.returncode == 1 and "mine.csv" in again.stderr and "another name" in again.stderr
    assert mine.read_text().startswith("time,y,u\n0,1,2")
    assert start("resample", record, "--step", "5ms", "--held", "u", "-o", tmp_path / "new.csv").returncode == 0
    wrong = start("resample", record, "--step", "5ms", "--held", "v", "-o", tmp_path / "new.csv")
    assert wrong.returncode == 1 and "`v`" in wrong.stderr and "y, u" in wrong.stderr


def test_identify_puts_uneven_records_on_a_grid_on_request(tmp_path):
    record = tmp_path / "record.csv"
    y, rows = 0.0, []
    for k in range(3000):
        u = 1.0 if (k // 37) % 2 else -0.5
        t = 0.01 * (k + 0.2 * math.sin(3.0 * k))
        rows.append([t, u, y])
        y += 0.01 * (u - y) / 0.2
    with record.open("w", newline="") as file:
        csv.writer(file).writerows([["time", "u", "y"], *rows])
    words = ["identify", "arx", record, "--inputs", "u", "--outputs", "y", "--na", "1", "--nb", "2", "--no-plots"]
    plain = start(*words, "-o", tmp_path / "plain")
    assert plain.returncode == 1, plain.stdout
    result = start(*words, "--resample", "20ms", "--held", "u", "-o", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert "low-pass" in result.stderr
