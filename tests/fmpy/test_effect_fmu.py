"""An effect of one's own that an FMU computes: bristles of a seal as a Model Exchange FMU in C, which `airloop refine` fits as a candidate."""

import json
import os
import subprocess
import zipfile

import fmpy.validation
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from scipy.interpolate import interp1d

from command import ROOT, airloop, start
from test_own_effects import COUNT, REACH, STEP, STIFFNESS, STUDY, drive, motion

SOURCE = """enum { STATES = 1, INPUTS = 1, PARAMETERS = 2 };
static const double START[] = {0.0, 0.0, 300.0, 0.0005};
static const char GUID[] = "bristle";
static void rates(const double *x, const double *u, const double *p, double *dx);
#include "model_exchange.h"
static void rates(const double *x, const double *u, const double *p, double *dx) { dx[0] = p[0] * u[0] - fabs(u[0]) * x[0] / p[1]; }
"""
REAL = '<ScalarVariable name="{}" valueReference="{}" causality="{}" variability="{}"{}><Real unit="{}"{}/></ScalarVariable>'
VARIABLES = [
    ("force", 0, "output", "continuous", ' initial="exact"', "N", ' start="0"'),
    ("speed", 1, "input", "continuous", "", "m/s", ' start="0"'),
    ("stiffness", 2, "parameter", "fixed", ' initial="exact"', "N/m", ' start="300" min="0"'),
    ("reach", 3, "parameter", "fixed", ' initial="exact"', "m", ' start="0.0005" min="1e-6"'),
    ("der(force)", 4, "local", "continuous", ' initial="calculated"', "N/s", ' derivative="1"'),
]
UNITS = {"N": 'kg="1" m="1" s="-2"', "m/s": 'm="1" s="-1"', "N/m": 'kg="1" s="-2"', "m": 'm="1"', "N/s": 'kg="1" m="1" s="-3"'}
EFFECT = """kind = "bristle"
port = "force"
fmu = "bristle.fmu"
output = "force"
inputs = { v = "speed" }
words = "elastic bristles of the seal"
[parameters]
stiffness = { unit = "N/m" }
reach = { bounds = [1e-5, 1e-1], start = [1e-4, 1e-3, 1e-2] }
"""
BAD = {  # what is said of a file with this instead of that
    "output": ('output = "force"', 'output = "forces"', "line 4, column 10: the FMU has no Real output `forces`; known: force"),
    "input": ('"speed"', '"velocity"', "no Real input `velocity`; known: speed"),
    "parameter": ("[parameters]", "[parameters]\nmass = {}", "no Real parameter `mass`; known: stiffness, reach"),
    "unit": ('"N/m"', '"N"', "the FMU has it in N/m, the file in N"),
    "file": ("bristle.fmu", "nothing.fmu", "nothing.fmu"),
    "both": ('output = "force"', 'formula = "v"', "give `formula` or `fmu`, not both"),
    "nothing": ('fmu = "bristle.fmu"\noutput = "force"\ninputs = { v = "speed" }\n', "", "it needs a `formula`, or an `fmu`"),
}


def make(folder):
    (folder / "model.c").write_text(SOURCE)
    compiler = os.environ.get("CC", "gcc")
    command = [compiler, "-O2", "-std=gnu99", "-shared", "-fPIC", "-w", "-I", ROOT / "examples", "-o", folder / "bristle.so", folder / "model.c", "-lm"]
    subprocess.run(command, check=True)
    units = "".join(f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in UNITS.items())
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="bristle" guid="bristle" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="bristle" canNotUseMemoryManagementFunctions="true"/>
  <CoSimulation modelIdentifier="bristle" canNotUseMemoryManagementFunctions="true"/>
  <UnitDefinitions>{units}</UnitDefinitions>
  <ModelVariables>{"".join(REAL.format(*own) for own in VARIABLES)}</ModelVariables>
  <ModelStructure><Outputs><Unknown index="1"/></Outputs><Derivatives><Unknown index="5"/></Derivatives>
  <InitialUnknowns><Unknown index="5"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
""".replace('  <CoSimulation modelIdentifier="bristle" canNotUseMemoryManagementFunctions="true"/>\n', "")
    with zipfile.ZipFile(folder / "bristle.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(folder / "bristle.so", "binaries/linux64/bristle.so")


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("effect")
    effects = folder / "effects"
    effects.mkdir()
    make(effects)
    (effects / "bristle.toml").write_text(EFFECT)
    text = STUDY
    for k in range(4):
        u = drive(k)
        x = motion(u) + 2e-5 * np.random.default_rng(100 + k).standard_normal(COUNT)
        rows = np.column_stack([STEP * np.arange(COUNT), u, x])
        np.savetxt(folder / f"r{k}.csv", rows, delimiter=",", header="time,force,position", comments="", fmt="%.7f")
        role = "estimation" if k < 3 else "validation"
        text += f'[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = {{ x = 0.0, v = 0.0 }}\n'
    (folder / "study.toml").write_text(text)
    result = start("refine", folder / "study.toml", "--effects", effects, "-o", folder / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    return folder, result, json.loads((folder / "out" / "report.json").read_text())


def test_the_fmu_is_found_with_its_parameters(refined):
    _, result, report = refined
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [effect["id"].split("@")[0] for effect in selected] == ["bristle"]
    values = {name: p["value"] for name, p in selected[0]["params"].items()}
    assert values["stiffness"] == pytest.approx(STIFFNESS, rel=0.02) and values["reach"] == pytest.approx(REACH, rel=0.02)
    assert "elastic bristles of the seal" in result.stdout and "force of bristle.fmu" in result.stdout


def test_the_amended_system_has_the_fmu_and_runs_as_the_truth_does(refined):
    folder, _, report = refined
    run = start("run", folder / "out" / "system" / "system.ssd", "--study", folder / "study.toml", "-o", folder / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((folder / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(report["residual"]["validation"]["rms_after"], rel=0.01)


def test_the_command_checks_it_and_says_what_does_not_fit(refined, tmp_path):
    effects = refined[0] / "effects"
    assert "bristle at a force port, 1 states, 2 parameters" in airloop("effects", "check", effects)
    shown = airloop("effects", "show", effects, "--figure", tmp_path / "bristle.svg")
    assert "force of bristle.fmu" in shown and "stiffness" in shown
    for name, (old, new, words) in BAD.items():
        assert old in EFFECT
        file = effects / f"{name}.toml"
        file.write_text(EFFECT.replace(old, new))
        result = start("effects", "check", file)
        file.unlink()
        assert result.returncode == 1 and words in result.stderr, (name, result.stderr)
