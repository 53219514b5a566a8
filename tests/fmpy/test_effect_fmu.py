"""An effect of one's own that an FMU computes: bristles of a seal as a Model Exchange FMU in C, which `airloop refine` fits as a candidate."""

import json
import os
import subprocess
import zipfile

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from command import ROOT, airloop, start
from test_own_effects import DAMPING, MASS, REACH, STEP, STIFFNESS, motion, write_study

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


def make(folder, name, source, variables, indicators=0, interface="ModelExchange"):
    """An FMU whose first variable is its output and whose last one is the derivative of its state."""
    (folder / "model.c").write_text(source)
    compiler = os.environ.get("CC", "gcc")
    library = folder / f"{name}.so"
    command = [compiler, "-O2", "-std=gnu99", "-shared", "-fPIC", "-w", "-I", ROOT / "examples", "-o", library, folder / "model.c", "-lm"]
    subprocess.run(command, check=True)
    units = "".join(f'<Unit name="{unit}"><BaseUnit {base}/></Unit>' for unit, base in UNITS.items())
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}" numberOfEventIndicators="{indicators}">
  <{interface} modelIdentifier="{name}" canNotUseMemoryManagementFunctions="true"/>
  <UnitDefinitions>{units}</UnitDefinitions>
  <ModelVariables>{"".join(REAL.format(*own) for own in variables)}</ModelVariables>
  <ModelStructure><Outputs><Unknown index="1"/></Outputs><Derivatives><Unknown index="{len(variables)}"/></Derivatives>
  <InitialUnknowns><Unknown index="{len(variables)}"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(library, f"binaries/linux64/{name}.so")
    library.unlink()
    (folder / "model.c").unlink()


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    folder = tmp_path_factory.mktemp("effect")
    effects = folder / "effects"
    effects.mkdir()
    make(effects, "bristle", SOURCE, VARIABLES)
    (effects / "bristle.toml").write_text(EFFECT)
    write_study(folder, motion)
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
    assert summary["validation"]["rms"] == pytest.approx(report["residual"]["validation"]["rms_after"], rel=1e-3)


def test_the_command_checks_it_and_says_what_does_not_fit(refined, tmp_path):
    effects = refined[0] / "effects"
    assert "bristle at a force port, 1 state, 2 parameters" in airloop("effects", "check", effects)
    shown = airloop("effects", "show", effects, "--figure", tmp_path / "bristle.svg")
    assert "force of bristle.fmu" in shown and "stiffness" in shown and "state  force of the FMU" in shown
    for name, (old, new, words) in BAD.items():
        assert old in EFFECT
        file = effects / f"{name}.toml"
        file.write_text(EFFECT.replace(old, new))
        result = start("effects", "check", file)
        file.unlink()
        assert result.returncode == 1 and words in result.stderr, (name, result.stderr)


# A relation holds between events, as tools for Modelica have it: the drag acts where the last event saw the speed above a threshold.
DRAG = """#define fmi2NewDiscreteStates header_new_discrete_states
#define fmi2GetEventIndicators header_event_indicators
enum { STATES = 1, INPUTS = 1, PARAMETERS = 3 };
static const double START[] = {0.0, 0.0, 1.0, 0.1, 0.0};
static const char GUID[] = "drag";
static void rates(const double *x, const double *u, const double *p, double *dx);
#include "model_exchange.h"
#undef fmi2NewDiscreteStates
#undef fmi2GetEventIndicators
static void rates(const double *x, const double *u, const double *p, double *dx) { dx[0] = p[2] * p[0] * (u[0] - p[1]); }
int fmi2NewDiscreteStates(void *m, EventInfo *info) {
    double *v = ((Model *)m)->values;
    memset(info, 0, sizeof *info);
    v[4] = v[1] > v[3];
    return OK;
}
int fmi2GetEventIndicators(void *m, double *indicators, size_t count) {
    double *v = ((Model *)m)->values;
    if (count) indicators[0] = v[1] - v[3];
    return OK;
}
"""
DRAG_VARIABLES = [
    ("force", 5, "output", "continuous", ' initial="calculated"', "N", ""),
    ("speed", 1, "input", "continuous", "", "m/s", ' start="0"'),
    ("coefficient", 2, "parameter", "fixed", ' initial="exact"', "N.s/m", ' start="1" min="0"'),
    ("threshold", 3, "parameter", "fixed", ' initial="exact"', "m/s", ' start="0.1" min="0"'),
    ("impulse", 0, "local", "continuous", ' initial="exact"', "N.s", ' start="0"'),
    ("der(impulse)", 5, "local", "continuous", ' initial="calculated"', "N", ' derivative="5"'),
]
UNITS |= {"N.s/m": 'kg="1" s="-1"', "N.s": 'kg="1" m="1" s="-1"'}
DRAG_EFFECT = """kind = "fast_drag"
port = "force"
fmu = "drag.fmu"
output = "force"
inputs = { v = "speed" }
[parameters]
coefficient = {}
threshold = { start = [0.05, 0.5] }
"""


def fast_drag(u):
    """Position of a mass with a drag above a speed, by an integrator of SciPy."""

    def rate(_, y, force):
        return [y[1], (force - DAMPING * y[1] - 4.0 * max(0.0, y[1] - 0.3)) / MASS]

    y, found = [0.0, 0.0], []
    for force in u:
        found.append(y[0])
        y = solve_ivp(rate, (0, STEP), y, args=(force,), rtol=1e-8, atol=1e-12).y[:, -1]
    return np.array(found)


def test_relations_follow_the_motion_and_other_interfaces_are_refused(tmp_path):
    make(tmp_path, "drag", DRAG, DRAG_VARIABLES, indicators=1)
    (tmp_path / "drag.toml").write_text(DRAG_EFFECT)
    write_study(tmp_path, fast_drag)
    result = start("refine", tmp_path / "study.toml", "--effects", tmp_path / "drag.toml", "-o", tmp_path / "out")
    assert result.returncode == 0, result.stdout + result.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    selected = [effect for effect in report["effects"] if effect["selected"]]
    assert [effect["id"].split("@")[0] for effect in selected] == ["fast_drag"]
    values = {name: p["value"] for name, p in selected[0]["params"].items()}
    assert values["coefficient"] == pytest.approx(4.0, rel=0.02) and values["threshold"] == pytest.approx(0.3, rel=0.02)
    run = start("run", tmp_path / "out" / "system" / "system.ssd", "--study", tmp_path / "study.toml", "-o", tmp_path / "run")
    assert run.returncode == 0, run.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["validation"]["rms"] == pytest.approx(report["residual"]["validation"]["rms_after"], rel=0.02)
    make(tmp_path, "drag", DRAG, DRAG_VARIABLES, indicators=1, interface="CoSimulation")
    result = start("effects", "check", tmp_path / "drag.toml")
    assert result.returncode == 1 and "has no Model Exchange; export it for Model Exchange" in result.stderr


def test_an_fmu_that_crashes_ends_as_a_candidate_and_the_rest_goes_on(refined, tmp_path):
    crash = SOURCE.replace('#include "model_exchange.h"', '#define fmi2GetReal header_get_real\n#include "model_exchange.h"\n#undef fmi2GetReal') + """
int fmi2GetReal(void *m, const unsigned *r, size_t n, double *v) {
    if (((Model *)m)->values[1] > 0.2) abort();
    return header_get_real(m, r, n, v);
}
"""
    make(tmp_path, "bristle", crash, VARIABLES)
    (tmp_path / "bristle.toml").write_text(EFFECT)
    result = start("refine", refined[0] / "study.toml", "--effects", tmp_path / "bristle.toml", "-o", tmp_path / "out", "--isolate=third-party")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert "bristle.fmu was lost in fmi2GetReal" in report["not_testable"]["bristle"]
    # Bristles are Coulomb friction that is a spring first: what the list has for it.
    kinds = [effect["id"].split(".")[-1].split("@")[0] for effect in report["effects"] if effect["selected"]]
    assert result.returncode == 0 and kinds == ["coulomb", "presliding"], result.stdout + result.stderr
