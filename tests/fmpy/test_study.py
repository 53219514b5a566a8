"""`airloop refine` of studies: a shipped one whose truth is known, what it refuses, and measured sets where they are there."""

import json
import shutil
import subprocess
import tomllib

import jsonschema
import pytest

from command import BINARY, ROOT, airloop, start

EXAMPLE = ROOT / "examples" / "06_study"
MEASURED = ROOT.parent / "shared" / "data" / "measured"


def refine(path, out):
    return start("refine", path, "-o", out)


def report(path, out):
    result = refine(path, out)
    assert result.returncode in (0, 10, 11, 12, 13), result.stdout + result.stderr
    return json.loads((out / "report.json").read_text())


def amended_has_printed_errors(study, out, found, rel=1e-3):
    """The amended system in the folder of a report, run on the records of the study, has the errors that are printed, but for
    what their steps of integration differ."""
    run = start("run", out / "system" / "system.ssd", "--study", study, "-o", out / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((out / "run" / "summary.json").read_text())
    for role in ("estimation", "validation"):
        assert summary[role]["rms"] == pytest.approx(found["residual"][role]["rms_after"], rel=rel)


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


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    """Folder of the answer to the example."""
    folder = tmp_path_factory.mktemp("example") / "out"
    report(EXAMPLE, folder)
    return folder


@pytest.fixture
def whole(answered):
    """Report of the example."""
    return json.loads((answered / "report.json").read_text())


def test_dry_friction_and_drag_are_found_together_with_their_values(whole):
    assert set(named(whole)) == {"pole.coulomb", "pole.quaddrag"}
    values = {e["id"]: next(iter(e["params"].values()))["value"] for e in whole["effects"] if e["selected"]}
    # make_records.py: only the ratios to the inertia show in a free swing, and I is fitted from 0.0036.
    assert values["pole.coulomb"] == pytest.approx(4.0e-4, rel=0.1)
    assert values["pole.quaddrag"] == pytest.approx(3.0e-5, rel=0.1)
    residual = whole["residual"]["validation"]
    assert residual["rms_after"]["angle"] < 0.2 * residual["rms_before"]["angle"]


def test_a_declared_damping_that_stands_for_dry_friction_and_drag_is_taken_back(tmp_path, whole):
    free = '[[free]]\nparameter = "b"\nstart = 0.0001\nmin = 0.0\n'
    fitted = next(n for n in whole["notes"] if "fitted: b = " in n)
    damping = float(fitted.split("b = ")[1].split()[0])
    folder = changed(tmp_path, free, "")
    study = folder / "study.toml"
    study.write_text(study.read_text().replace("l = 0.15", f"l = 0.15\nb = {damping}"))
    found = report(folder, tmp_path / "out")
    assert set(named(found)) == {"pole.viscous", "pole.coulomb", "pole.quaddrag"}
    values = {e["id"]: next(iter(e["params"].values()))["value"] for e in found["effects"] if e["selected"]}
    # Taken back as far as there is any: the records were made with a tenth of it.
    assert -damping <= values["pole.viscous"] < -0.5 * damping
    assert values["pole.coulomb"] == pytest.approx(4.0e-4, rel=0.1)
    assert values["pole.quaddrag"] == pytest.approx(3.0e-5, rel=0.1)


def test_a_gap_in_a_record_changes_nothing_in_the_answer(tmp_path, whole):
    def gap(rows):
        return [row for row in rows if not 5.0 <= row[0] < 6.3]

    found = report(records(tmp_path, gap), tmp_path / "out")
    assert set(named(found)) == {"pole.coulomb", "pole.quaddrag"}
    for one, other in zip(*([e for e in r["effects"] if e["selected"]] for r in (found, whole))):
        (own,), (reference,) = one["params"].values(), other["params"].values()
        assert own["ci95"][0] < reference["value"] < own["ci95"][1], (one, other)


def test_a_step_shorter_than_that_of_the_files_is_not_taken(tmp_path, whole):
    found = report(changed(tmp_path, SYSTEM, SYSTEM + "\nstep_s = 0.004"), tmp_path / "out")
    assert any("step_s = 0.004 s is shorter than its own step of 0.01 s" in note for note in found["notes"])
    assert found["effects"] == whole["effects"]


def test_steps_and_what_is_left_are_told_by_the_ports_of_the_study(whole):
    tried = [own for step in whole["steps"] for own in step["candidates"]]
    # Accepted ones are the selected ones; a rejected one says why.
    assert {own["id"] for own in tried if own["rejected"] is None} == set(named(whole))
    ports = {own["port"] for own in tried if not own["id"].startswith("sensor")}
    assert ports == {"tau_ext"}
    assert set(whole["remaining"]["ports"]) <= {"tau_ext"}


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('role = "validation"', 'role = "repeat"', ["validation"]),
        ('column = "angle", unit = "rad", offset', 'column = "angel", unit = "rad", offset', ["angel", "angle", "line"]),
        ('unit = "rad", offset', 'unit = "N", offset', ["rad", "line"]),
        ('input = "tau_ext"', 'input = "tau"', ["tau", "tau_ext", "line"]),
        ('parameter = "I"', 'parameter = "J"', ["J", "I", "line"]),
        ("[outputs]", "[tolerance]\nmass = 0.01\n[outputs]", ["tolerance", "mass", "m", "line"]),
        ("[outputs]", "[tolerance]\nm = -1\n[outputs]", ["tolerance", "-1", "between 0 and 1", "line"]),
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


SYSTEM = 'system = "airloop:pendulum"             # or a path: system.ssd, third_party.fmu'


def records(tmp_path, change):
    """The example with the rows of swing.csv as `change` makes them: a list of [time, angle]."""
    folder = tmp_path / "study"
    shutil.copytree(EXAMPLE, folder)
    head, *rows = (folder / "swing.csv").read_text().split()
    rows = change([[float(cell) for cell in row.split(",")] for row in rows])
    (folder / "swing.csv").write_text(head + "\n" + "".join(f"{t:.4f},{angle:.4f}\n" for t, angle in rows))
    return folder


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda rows: [r for r in rows if not 3.0 < r[0] < 9.0], ["gap", "from_s", "swing.csv"]),
        (lambda rows: [[t, max(min(a, 1.0), -1.0)] for t, a in rows], ["saturated", "from_s"]),
        (lambda rows: [[t, 0.3] for t, _ in rows], ["never changes"]),
        (lambda rows: [[t + 5000.0, a] for t, a in rows], ["clock", "5000", "swing.csv"]),
        (lambda rows: rows[:6], ["samples", "swing.csv"]),
        (lambda rows: rows[:200] + rows[150:], ["time", "swing.csv"]),
        (lambda rows: [[t, float("inf") if 100 < i < 110 else a] for i, (t, a) in enumerate(rows)], ["swing.csv", "line"]),
    ],
)
def test_records_that_do_not_fit_are_told_with_the_remedy(tmp_path, change, words):
    result = refine(records(tmp_path, change), tmp_path / "out")
    assert result.returncode == 1
    for word in words:
        assert word in result.stderr, result.stderr
    assert not (tmp_path / "out" / "report.json").exists()


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("from_s = 14.0", "from_s = 9.0", ["shares samples", "14", "line"]),
        ("m = 0.15", "m = 0.15\nd = 1.0", ["`d`", "line"]),
        ("m = 0.15", "m = -1.0", ["`m`", "line"]),
        (SYSTEM, 'system = "nowhere.ssd"', ["nowhere.ssd", "line"]),
        (SYSTEM, 'system = "airloop:pendulums"', ["pendulums", "line"]),
        (SYSTEM, SYSTEM + "\nstep_s = -0.01", ["step_s", "line"]),
        (SYSTEM, SYSTEM + "\nstep_s = 5.0", ["too long"]),
        ("start = 0.0034", "start = 1e-9", ["diverges", "step_s"]),
        ('velocity = "omega"', 'velocity = "speed"', ["speed", "omega", "line"]),
        ('role = "estimation"', 'role = "estimate"', ["estimate", "estimation", "line"]),
        ('channels = ["pole"]', 'channels = ["pole"]\neffects = ["pole.drag"]', ["pole.drag", "pole.quaddrag", "line"]),
        ('channels = ["pole"]', 'channels = ["pole"]\nvt = 0.0', ["vt", "line"]),
        ('offset = "fit" }', 'offset = "fit", noise = -1.0 }', ["noise", "line"]),
        ('derivative_of = "angle"', 'column = "angle", derivative_of = "angle"', ["column", "derivative_of", "line"]),
        ("savitzky_golay_points", "points", ["points", "savitzky_golay_points", "line"]),
    ],
)
def test_studies_that_do_not_fit_are_told_with_their_place(tmp_path, old, new, words):
    result = refine(changed(tmp_path, old, new), tmp_path / "out")
    assert result.returncode == 1
    for word in ["study.toml", *words]:
        assert word in result.stderr, result.stderr
    assert not (tmp_path / "out" / "report.json").exists()


def test_candidates_that_the_records_do_not_excite_are_listed_with_the_reason(tmp_path):
    folder = changed(tmp_path, 'channels = ["pole"]', 'channels = ["pole", "actuator"]')
    found = report(folder, tmp_path / "out")
    assert "pressure" in found["not_testable"]["act.area"]
    assert set(named(found)) == {"pole.coulomb", "pole.quaddrag"}


def test_the_schema_of_studies_takes_the_example_and_refuses_what_the_program_refuses():
    schema = json.loads(airloop("refine", "--schema", "study"))
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    example = (EXAMPLE / "study.toml").read_text()
    validator.validate(tomllib.loads(example))
    for old, new in [("savitzky_golay_points", "points"), ('role = "estimation"', 'role = "estimate"'), ('channels = ["pole"]', 'channels = ["poles"]')]:
        assert not validator.is_valid(tomllib.loads(example.replace(old, new)))


def test_one_seed_gives_one_report_on_any_number_of_processors(tmp_path, answered):
    one = ["taskset", "-c", "0", str(BINARY), "refine", str(EXAMPLE), "-o", str(tmp_path / "one")]
    subprocess.run(one, cwd=ROOT, capture_output=True, text=True)
    assert (answered / "report.json").read_bytes() == (tmp_path / "one" / "report.json").read_bytes()


def test_effects_are_found_again_in_records_that_are_drawn_again_and_none_where_none_is(tmp_path, answered, whole):
    def draw(system, seed, out, *words):
        result = start("refine", EXAMPLE, "--redraw", system, "--seed", str(seed), *words, "-o", out)
        assert result.returncode in (0, 10, 11, 12, 13), result.stderr
        return json.loads((out / "report.json").read_text())

    # Nothing is missing there but what made the residuals, which follows no law.
    nothing = draw("declared", 1, tmp_path / "declared")
    assert named(nothing) == [] and nothing["verdict"] in ("none", "unexplained")
    again = draw(answered / "system" / "system.ssd", 1, tmp_path / "again")
    assert set(named(again)) == {"pole.coulomb", "pole.quaddrag"}
    for one in whole["effects"]:
        for name, own in one["params"].items():
            other = next(e for e in again["effects"] if e["id"] == one["id"])["params"][name]
            assert other["ci95"][0] <= own["ci95"][1] and own["ci95"][0] <= other["ci95"][1]
            assert other["value"] != own["value"]
    for found in (nothing, again):
        assert any("drawn again, with seed 1" in note for note in found["notes"])
    # Its errors are not those on the files of the study.
    assert "--study" in (answered / "report.md").read_text()
    assert "--study" not in (tmp_path / "again" / "report.md").read_text()
    one = draw(answered / "system" / "system.ssd", 1, tmp_path / "one", "--threads", "1")
    assert one == again


@pytest.mark.parametrize(
    "place, system, words",
    [(EXAMPLE, "nowhere.ssd", ["nowhere.ssd"]), (ROOT / "data" / "rig" / "v01", "declared", ["study.toml", "case.toml"])],
)
def test_records_that_cannot_be_drawn_again_are_told(tmp_path, place, system, words):
    result = start("refine", place, "--redraw", system, "-o", tmp_path / "out")
    assert result.returncode == 1
    assert all(word in result.stderr for word in words), result.stderr
    assert not (tmp_path / "out").exists()


def test_the_page_of_a_study_has_its_charts(answered, whole):
    page = (answered / "report.html").read_text()
    assert page.count("<svg") >= 6 and len(page) < 1_000_000 and "http" not in page.replace("http://www.w3.org", "")
    for words in ["measured less predicted", "over theta", "autocorrelation", "pole.quaddrag", "friction at tau_ext [N m]"]:
        assert words in page, words
    assert whole["localization"][0]["compared_with"] == "angle"


@pytest.mark.slow
def test_free_pendulum(tmp_path):
    found = measured("pendulum_free_swing", tmp_path)
    assert set(named(found)) == {"pole.coulomb", "pole.quaddrag"}
    assert all(p["value"] >= 0 for e in found["effects"] if e["selected"] for p in e["params"].values())
    # 15 mrad over 33-55 s and 4 mrad over the tail, pooled by their samples (22 s, 5.5 s).
    assert found["residual"]["validation"]["rms_after"]["angle"] <= 0.0135
    # The encoder's step of 0.000157 rad shows in the tail only; the swing was averaged.
    assert found["noise_floor"]["angle"] >= 0.000157 / 12**0.5


@pytest.mark.slow
def test_free_pendulum_with_its_declared_inertia_and_damping(tmp_path):
    """The authors' damping is that of a model with nothing else: dry friction and drag are found in its place."""
    if not MEASURED.exists():
        pytest.skip(f"{MEASURED} is not there")
    folder = tmp_path / "study"
    shutil.copytree(MEASURED / "pendulum_free_swing", folder)
    segments = "".join(
        f'[[segment]]\nfile = "{file}"\nrole = "{role}"\nfrom_s = {start}\nto_s = {end}\ninitial = "fit"\n'
        for file, role, start, end in [("swing.csv", "estimation", 0.0, 33.0), ("swing.csv", "validation", 33.0, 55.0), ("tail.csv", "validation", 0.0, 5.5)]
    )
    (folder / "study.toml").write_text(
        """system = "airloop:pendulum"
[parameters]
m = 0.148
l = 0.148
g = 9.81
I = 0.003351
b = 0.000224
[outputs]
theta = { column = "angle", unit = "rad", offset = "fit" }
[states]
theta = { column = "angle", unit = "rad" }
omega = { derivative_of = "angle", unit = "rad", savitzky_golay_points = 9 }
[[attachment]]
input = "tau_ext"
channels = ["pole"]
velocity = "omega"
position = "theta"
viscous = "b"
"""
        + segments
    )
    found = report(folder, tmp_path / "out")
    assert set(named(found)) == {"pole.viscous", "pole.coulomb", "pole.quaddrag"}
    free = report(MEASURED / "pendulum_free_swing", tmp_path / "free")
    intervals = {}
    for one in (found, free):
        for effect in (e for e in one["effects"] if e["selected"]):
            intervals.setdefault(effect["id"], []).append(next(iter(effect["params"].values()))["ci95"])
    for (low, high), (other_low, other_high) in (intervals["pole.coulomb"], intervals["pole.quaddrag"]):
        assert max(low, other_low) < min(high, other_high)


@pytest.mark.slow
def test_seal(tmp_path):
    found = measured("pneumatic_seal_friction", tmp_path)
    # Presliding takes the place of act.area and a third effect at the same error.
    assert named(found) == ["pf.pressure", "pf.presliding"]
    # 1.33 N if the declared model is also fitted to what bridges the gaps of the estimation records, up to 0.3 s long.
    assert found["residual"]["validation"]["rms_before"]["force"] == pytest.approx(1.32, abs=0.01)
    assert found["residual"]["validation"]["rms_after"]["force"] <= 0.88


@pytest.mark.slow
def test_linear_axis(tmp_path):
    """The same two effects at the step of the records and at two longer ones, each inside the other's intervals."""
    folder = MEASURED / "linear_axis_emps"
    found = [measured("linear_axis_emps", tmp_path)]
    before, after = (found[0]["residual"]["validation"][key] for key in ("rms_before", "rms_after"))
    assert before["position"] == pytest.approx(6.25e-3, rel=0.01) and after["position"] <= 1.39e-3
    assert before["drive_force"] == pytest.approx(10.1, rel=0.01) and after["drive_force"] <= 3.05
    for step in ("5ms", "6.67ms"):
        files = [folder / f"{name}.csv" for name in ("estimation", "validation")]
        # The force acts between the samples that a longer step leaves, too: its last value says less than its mean.
        done = start("resample", *files, "--step", step, "-o", tmp_path / step)
        assert done.returncode == 0, done.stderr
        shutil.copy(folder / "dataset.toml", tmp_path / step)
        found.append(report(tmp_path / step, tmp_path / f"out-{step}"))
    intervals = {}
    for one in found:
        assert named(one) == ["cf.coulomb", "cf.asymmetry"] and one["law"] is None
        for effect in (own for own in one["effects"] if own["selected"]):
            for name, own in effect["params"].items():
                intervals.setdefault((effect["id"], name), []).append((own["value"], own["ci95"]))
    for own in intervals.values():
        assert all(low < value < high for value, _ in own for _, (low, high) in own), intervals
