"""Example 05: `airloop refine` on the shipped case, its report against the schema, and the amended system."""

import json
import re
import shutil

import fmpy
import fmpy.validation
import jsonschema
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from lxml import etree

from command import ROOT
from command import start as airloop
from test_examples import SCHEMAS

EXAMPLE = ROOT / "examples" / "05_refine"
EXPECTED = json.loads((EXAMPLE / "expected.json").read_text())
SHARED = ROOT.parent / "shared" / "data" / "rig"


@pytest.fixture(scope="module")
def schema():
    text = airloop("refine", "--schema").stdout
    jsonschema.Draft202012Validator.check_schema(json.loads(text))
    return jsonschema.Draft202012Validator(json.loads(text))


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The command of the README."""
    folder = tmp_path_factory.mktemp("refine")
    result = airloop("refine", "data/rig/v01", "-o", folder)
    assert result.returncode == 0, result.stderr
    return folder, result.stdout


def report_of(folder):
    return json.loads((folder / "report.json").read_text())


def test_the_numbers_are_those_of_the_readme(example):
    report = report_of(example[0])
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [effect["id"] for effect in selected] == [EXPECTED["effect"]]
    for name, expected in EXPECTED["params"].items():
        found = selected[0]["params"][name]
        assert found["value"] == pytest.approx(expected["value"], abs=expected["tolerance"]), name
        low, high = found["ci95"]
        assert low <= EXPECTED["truth"][name] <= high, name
    for key in ("rms_before", "rms_after"):
        for signal, expected in EXPECTED[key].items():
            assert report["residual"]["validation"][key][signal] == pytest.approx(expected, rel=0.02), (key, signal)


@pytest.mark.parametrize(("late", "slower"), [(1 / 3, 0.0), (0.0, 5e-4)])
def test_time_stamps_that_jitter_or_drift_give_the_same_answer(example, tmp_path, late, slower):
    """A logger whose loop is late by up to a part of a step, or runs slower."""
    folder = tmp_path / "case"
    folder.mkdir()
    shutil.copy(ROOT / "data" / "rig" / "v01" / "case.toml", folder)
    rng = np.random.default_rng(5)
    for path in (ROOT / "data" / "rig" / "v01").glob("*.csv"):
        names = path.read_text().splitlines()[0].split(",")
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        index = np.arange(int(0.999 * len(rows)))
        time = 0.001 * ((1.0 + slower) * index + late * rng.uniform(0.0, 1.0, len(index)))
        time[0] = 0.0
        columns = [np.interp(time, rows[:, 0], rows[:, k]) for k in range(2, rows.shape[1])]
        sent = rows[np.clip(np.round(time / 0.001).astype(int), 0, len(rows) - 1), 1]
        np.savetxt(folder / path.name, np.column_stack([time, sent, *columns]), delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    result = airloop("refine", folder, "-o", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    found, known = report_of(tmp_path / "out"), report_of(example[0])
    chosen = [[effect for effect in report["effects"] if effect["selected"]] for report in (found, known)]
    assert [effect["id"] for effect in chosen[0]] == [effect["id"] for effect in chosen[1]]
    low, high = chosen[0][0]["params"]["stiffness"]["ci95"]
    assert low <= EXPECTED["truth"]["stiffness"] <= high
    assert any("steps from a grid of 1000 Hz" in note for note in found["notes"])
    text = (folder / "trial_01.csv").read_text().splitlines()
    (folder / "trial_01.csv").write_text("\n".join(text[:100] + text[110:]))
    result = airloop("refine", folder, "-o", tmp_path / "out")
    assert result.returncode == 1 and "line 101" in result.stderr and "split the record at gaps" in result.stderr


def test_what_is_left_is_told_by_the_inputs_of_the_rig(example):
    left = report_of(example[0])["remaining"]["ports"]
    assert set(left) == {"actuator.u", "piston_friction.F_out", "cart_pole.F", "cart_pole.tau_ext"}
    # The spring explains the records: what is left is the noise.
    assert all(own["floors"] < 4.0 for own in left.values()), left


def test_the_terminal_shows_before_and_after_and_names_the_page(example):
    folder, text = example
    assert "cart.spring" in text and str(folder / "report.html") in text
    for signal in ("F_hat", "F_p", "x", "theta"):
        assert re.search(rf"^\s*{signal} ", text, re.M), signal


def test_the_page_is_complete_in_itself_and_small(example):
    html = (example[0] / "report.html").read_text()
    assert len(html.encode()) < 1_000_000
    assert not re.search(r"""(?:src|href)\s*=\s*["']|url\(|@import|https?://(?!www\.w3\.org/)""", html)
    tree = etree.fromstring(html, etree.HTMLParser())
    headings = [" ".join(h.itertext()) for h in tree.iter("h2")]
    for part in ("Error before and after", "Parameters", "Where it sits", "Residuals of", "Residuals against", "Autocorrelation", "Candidates", "What to measure next", "amended system"):
        assert any(part in heading for heading in headings), part
    assert len(tree.findall(".//svg")) > 10
    markdown = (example[0] / "report.md").read_text()
    # Both forms say the same: every heading but those of figures over time, and the sentence of the answer.
    for heading in headings:
        if not heading.startswith("Residuals of"):
            assert f"## {heading}" in markdown, heading
    assert "".join(tree.find(".//p[@class='answer']").itertext()) in markdown


def amended(folder, record, out):
    command = ("run", folder / "system" / "system.ssp", "--master", "monolithic", "--measured", record, "--no-plots", "-o", out)
    assert airloop(*command).returncode == 0
    return {signal["name"]: signal["rms_error"] for signal in json.loads((out / "summary.json").read_text())["signals"]}


def test_the_amended_system_follows_the_record_that_the_declared_one_does_not(example, tmp_path):
    record = ROOT / "data" / "rig" / "v01" / "trial_07.csv"
    found = amended(example[0], record, tmp_path / "amended")
    declared = ("run", "examples/01_run/system.ssd", "--master", "monolithic", "--measured", record, "--no-plots", "-o", tmp_path / "declared")
    assert airloop(*declared).returncode == 0
    summary = json.loads((tmp_path / "declared" / "summary.json").read_text())
    before = {signal["name"]: signal["rms_error"] for signal in summary["signals"]}
    # Both start at the first measured position, which is noisy; the error of the declared model is many times that.
    assert found["x"] < 0.3 * before["x"] and found["theta"] < 0.3 * before["theta"], (found, before)


def test_the_amended_system_is_valid_ssp_and_fmpy_runs_it(example, tmp_path):
    system = example[0] / "system"
    xsd = etree.XMLSchema(etree.parse(str(SCHEMAS / "SystemStructureDescription.xsd")))
    xsd.assertValid(etree.parse(str(system / "system.ssd")))
    for path in system.glob("*.fmu"):
        assert fmpy.validation.validate_fmu(str(path)) == [], path
    record = np.genfromtxt(ROOT / "data" / "rig" / "v01" / "trial_07.csv", delimiter=",", names=True)
    held = {"u": lambda time: record["u"][round(time * 1000)]}
    found = simulate_ssp(str(system / "system.ssp"), stop_time=1.0, step_size=1e-3, input=held)
    assert np.isfinite(found["cart_pole.x"]).all() and np.ptp(found["cart_pole.x"]) > 0.01


def changed(case, folder, dropped, changes):
    """A copy of a case in which some sensors are missing and the declared model says something else."""
    shutil.copytree(case, folder, ignore=shutil.ignore_patterns("truth.toml"))
    for path in folder.iterdir():
        path.chmod(0o644)
    text = (folder / "case.toml").read_text()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    for name in dropped:
        text = re.sub(rf"\[sensors\.{name}\]\n(?:(?!\[).*\n)*", "", text)
    (folder / "case.toml").write_text(text)
    for path in folder.glob("*.csv"):
        rows = [line.split(",") for line in path.read_text().splitlines()]
        keep = [i for i, name in enumerate(rows[0]) if name not in dropped]
        path.write_text("\n".join(",".join(row[i] for i in keep) for row in rows) + "\n")
    return folder


@pytest.mark.parametrize(
    "case, dropped, changes, code, verdict",
    [
        ("v05", (), {}, 10, "none"),
        pytest.param("v11", (), {}, 13, "law", marks=pytest.mark.slow),
        # Viscous friction that the declared piston lacks: without forces it might be the cart's as well.
        ("v05", ("F_hat", "F_p"), {"c4 = 49.2734": "c4 = 46.2734"}, 12, "effect"),
        ("v02", (), {}, 0, "effect"),
        ("v07", (), {}, 0, "effect"),
    ],
)
def test_exit_codes_say_the_verdict_and_every_report_follows_the_schema(schema, tmp_path, case, dropped, changes, code, verdict):
    source = ROOT / "data" / "rig" / case
    source = source if source.is_dir() else SHARED / case
    if not source.is_dir():
        pytest.skip(f"{source} is not there")
    folder = changed(source, tmp_path / "case", dropped, changes) if dropped else source
    result = airloop("refine", folder, "-o", tmp_path / "out")
    assert result.returncode == code, result.stdout + result.stderr
    report = report_of(tmp_path / "out")
    schema.validate(report)
    assert report["verdict"] == verdict
    groups = [effect["group"] for effect in report["effects"] if effect["selected"] and effect["group"] is not None]
    assert (code == 12) == bool(groups)
    for group in groups:
        assert sum(effect["group"] == group for effect in report["effects"]) > 1
    assert (report["amended_system"] is not None) == (tmp_path / "out" / "system" / "system.ssd").is_file()
    assert (report["amended_system"] is not None) == (verdict in ("effect", "law") or bool(report["corrections"]))


def test_the_report_of_the_example_follows_the_schema(schema, example):
    schema.validate(report_of(example[0]))


def test_the_schema_refuses_what_is_no_report(schema, example):
    report = report_of(example[0])
    for change in ({"verdict": "maybe"}, {"effects": [{"id": "cart.spring"}]}, {"measure_next": []}):
        with pytest.raises(jsonschema.ValidationError):
            schema.validate({**report, **change})
