"""`airloop refine` with an FMU of Co-Simulation only: a slide behind a drive, which steps by itself (slide.c). The machine is
typed here, with exact and midpoint steps."""

import json
import os
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

from command import start
from segments import write_segments
from test_study import named, refine

STEP, COUNT, FINE, NOISE = 0.005, 1000, 10, 5e-4
MASS, DAMPING, FORCE, LATE = 1.5, 6.0, 20.0, 0.05
VARIABLES = [
    ("u", "input", "V", 0.0),
    ("load", "input", "N", 0.0),
    ("x", "output", "m", None),
    ("v", "output", "m/s", None),
    ("mass", "parameter", "kg", MASS),
    ("damping", "parameter", "N.s/m", DAMPING),
    ("force", "parameter", "N/V", FORCE),
    ("late", "parameter", "s", LATE),
    ("x0", "parameter", "m", 0.0),
]
UNITS = {
    "V": 'kg="1" m="2" s="-3" A="-1"',
    "N": 'kg="1" m="1" s="-2"',
    "m": 'm="1"',
    "m/s": 'm="1" s="-1"',
    "kg": 'kg="1"',
    "N.s/m": 'kg="1" s="-1"',
    "N/V": 'm="-1" s="1" A="1"',
    "s": 's="1"',
}


def make_fmu(path):
    kinds = {
        "input": 'causality="input" variability="continuous"',
        "output": 'causality="output" variability="continuous" initial="calculated"',
        "parameter": 'causality="parameter" variability="fixed" initial="exact"',
    }

    def variable(k, name, causality, unit, value):
        begin = "" if value is None else f'start="{value}" '
        return f'<ScalarVariable name="{name}" valueReference="{k}" {kinds[causality]}><Real {begin}unit="{unit}"/></ScalarVariable>'

    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="slide" guid="slide" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="slide" canNotUseMemoryManagementFunctions="true"/>
  <UnitDefinitions>{"".join(f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in UNITS.items())}</UnitDefinitions>
  <DefaultExperiment stepSize="0.0002"/>
  <ModelVariables>{"".join(variable(k, *own) for k, own in enumerate(VARIABLES))}</ModelVariables>
  <ModelStructure><Outputs><Unknown index="3" dependencies=""/><Unknown index="4" dependencies=""/></Outputs>
  <InitialUnknowns><Unknown index="3"/><Unknown index="4"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""
    library = path.with_suffix(".so")
    source = Path(__file__).with_name("slide.c")
    compiler = os.environ.get("CC", "gcc")
    subprocess.run([compiler, "-O2", "-std=gnu99", "-shared", "-fPIC", "-w", "-o", library, source], check=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(library, "binaries/linux64/slide.so")
    library.unlink()


def command(rng):
    """Slow sines and held steps, as a drive is tried."""
    t = STEP * np.arange(COUNT)
    sines = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in (0.4, 0.9, 1.7))
    return np.round(0.5 * sines + np.repeat(rng.uniform(-0.8, 0.8, COUNT // 100), 100), 4)


def measured(u, kind, value, begin):
    """Positions of the slide; the drive is solved exactly, the slide by the midpoint rule."""
    push, x, v, h, shown = 0.0, begin, 0.0, STEP / FINE, []
    for sent in u:
        shown.append(x)
        if kind == "deadband":
            sent = np.sign(sent) * max(abs(sent) - value, 0.0)
        for _ in range(FINE):
            before = push
            push = FORCE * sent + (push - FORCE * sent) * np.exp(-h / LATE)
            dry = value * np.tanh(v / 1e-3) if kind == "coulomb" else 0.0
            acceleration = lambda f, v: (f - dry - DAMPING * v) / MASS
            middle = v + 0.5 * h * acceleration(before, v)
            x, v = x + h * middle, v + h * acceleration(0.5 * (before + push), middle)
    return np.array(shown)


def write_study(folder, kind, value, seed, more=""):
    folder.mkdir(parents=True)
    make_fmu(folder / "slide.fmu")
    text = f'system = "slide.fmu"\n{more}[inputs]\nu = {{ column = "u", hold = true }}\n[outputs]\nx = {{ column = "x", unit = "m" }}\n'
    rng, records, begins = np.random.default_rng(seed), [], []
    for _ in range(3):
        u, begin = command(rng), round(rng.uniform(-0.2, 0.2), 3)
        x = measured(u, kind, value, begin) + NOISE * rng.standard_normal(COUNT)
        records.append(np.column_stack([STEP * np.arange(COUNT), u, x]))
        begins.append(f"{{ x0 = {begin} }}")
    text += write_segments(folder, records, "time,u,x", begins)
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.mark.parametrize(("kind", "value", "place"), [pytest.param("coulomb", 2.5, "load", marks=pytest.mark.slow), ("deadband", 0.15, "u")])
def test_an_effect_on_a_machine_that_only_steps_is_found_and_its_system_runs(tmp_path, kind, value, place):
    study = write_study(tmp_path / "case", kind, value, 3)
    result = refine(study, tmp_path / "out")
    assert result.returncode in (0, 12), result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert named(report)[0] == f"{kind}@{place}", result.stdout
    found = next(iter(report["effects"][0]["params"].values()))["value"]
    assert found == pytest.approx(value, rel=0.03)
    assert any("Co-Simulation only" in note for note in report["notes"])
    before, after = (report["residual"]["validation"][key]["x"] for key in ("rms_before", "rms_after"))
    assert after < 0.05 * before
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", study, "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"]["x"] == pytest.approx(after, abs=0.02 * before)


def test_a_machine_that_only_steps_and_lacks_nothing_gets_nothing(tmp_path):
    study = write_study(tmp_path / "case", "none", 0.0, 4)
    result = refine(study, tmp_path / "out")
    assert result.returncode == 10, result.stdout + result.stderr


def test_velocity_and_position_along_a_force_are_found_by_a_push(tmp_path):
    plan = start("refine", write_study(tmp_path / "case", "none", 0.0, 4), "--plan")
    assert plan.returncode == 0, plan.stderr
    line = next(line for line in plan.stdout.splitlines() if line.strip().startswith("load"))
    assert "v" in line.split() or "velocity v" in plan.stdout, plan.stdout


def test_windows_are_refused_where_states_cannot_be_set(tmp_path):
    study = write_study(tmp_path / "case", "none", 0.0, 4, "[error]\nwindows_s = 0.5\n")
    result = refine(study, tmp_path / "out")
    assert result.returncode not in (0, 10, 11, 12, 13)
    assert "windows_s" in result.stderr and "Model Exchange" in result.stderr
