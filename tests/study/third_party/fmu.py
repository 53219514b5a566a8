"""Makes the FMU of a declared system from the table of its variables, equations/NAME.h and examples/model_exchange.h.

    python fmu.py DIR [NAME ...]
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import zipfile
from xml.sax.saxutils import quoteattr

from systems import SYSTEMS

HERE = pathlib.Path(__file__).parent
# Exponents of kg, m, s, A, K, rad.
BASE = {"kg": "kg", "m": "m", "s": "s", "A": "A", "K": "K", "rad": "rad", "N": "kg m s-2", "J": "kg m2 s-2", "W": "kg m2 s-3", "Pa": "kg m-1 s-2",
        "V": "kg m2 s-3 A-1", "Ohm": "kg m2 s-3 A-2", "H": "kg m2 s-2 A-2"}


def exponents(unit):
    """Exponents of the base units of a unit such as `N.m.s/rad` or `m3/(s.Pa)`."""
    found = {}
    over, _, under = unit.partition("/")
    for part, sign in ((over, 1), (under.strip("()"), -1)):
        for name, power in re.findall(r"([A-Za-z]+)(\d*)", part):
            for base, own in re.findall(r"([a-zA-Z]+)(-?\d*)", BASE[name]):
                found[base] = found.get(base, 0) + sign * int(power or 1) * int(own or 1)
    return {base: power for base, power in found.items() if power}


def rate_of(system, state):
    """Name of the variable that is the derivative of a state."""
    velocity = [name for name, (_, _, of) in system.states.items() if of == state]
    return velocity[0] if velocity and system.short else f"der({state})"


def description(system, guid):
    """modelDescription.xml. Value references: states, inputs, parameters, derivatives."""
    names = [*system.states, *system.inputs, *system.parameters]
    reference = {name: k for k, name in enumerate(names)}
    index, variables = {}, []

    def add(name, vr, kinds, inside):
        index[name] = len(variables) + 1
        variables.append((name, vr, kinds, inside))

    rates = [(state, rate_of(system, state)) for state in system.states]
    for name, (unit, nominal, of) in system.states.items():
        start = system.start.get(name, 0.0)
        inside = f'start="{start!r}" unit="{unit}" nominal="{nominal!r}"'
        if of and system.short:
            inside += f' derivative="{index[of]}"'
        causality = "local" if name in system.hidden else "output"
        add(name, reference[name], f'causality="{causality}" variability="continuous" initial="exact"', inside)
    for name, (unit, _) in system.inputs.items():
        add(name, reference[name], 'causality="input" variability="continuous"', f'start="0" unit="{unit}"')
    for name, (value, unit, _) in system.parameters.items():
        add(name, reference[name], 'causality="parameter" variability="tunable" initial="exact"', f'start="{value!r}" unit="{unit}"')
    for k, (state, rate) in enumerate(rates):
        if rate not in index:
            unit = system.states[state][0]
            unit = f"{unit}/s" if "/" not in unit else unit + "2" if unit.endswith("/s") else unit
            add(rate, len(names) + k, 'causality="local" variability="continuous" initial="calculated"', f'unit="{unit}" derivative="{index[state]}"')
    units = sorted({re.search(r'unit="([^"]*)"', inside).group(1) for *_, inside in variables})
    scale = lambda unit: " ".join(f'{base}="{power}"' for base, power in exponents(unit).items())
    define = "".join(f'    <Unit name="{unit}"><BaseUnit {scale(unit)}/></Unit>\n' for unit in units)
    scalar = "".join(f"    <ScalarVariable name={quoteattr(n)} valueReference=\"{vr}\" {kinds}><Real {inside}/></ScalarVariable>\n" for n, vr, kinds, inside in variables)
    unknown = lambda k: f'<Unknown index="{k}"/>'
    outputs = "".join(unknown(index[name]) for name in system.states if name not in system.hidden)
    derivatives = "".join(unknown(index[rate]) for _, rate in rates)
    initial = "".join(unknown(k) for k in sorted(index[rate] for _, rate in rates if rate not in system.states))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{system.name}" guid="{guid}" generationTool="tests/study/third_party/fmu.py" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="{system.name}" canNotUseMemoryManagementFunctions="true"/>
  <UnitDefinitions>
{define}  </UnitDefinitions>
  <ModelVariables>
{scalar}  </ModelVariables>
  <ModelStructure>
    <Outputs>{outputs}</Outputs>
    <Derivatives>{derivatives}</Derivatives>
{f"    <InitialUnknowns>{initial}</InitialUnknowns>{chr(10)}" if initial else ""}  </ModelStructure>
</fmiModelDescription>
"""


def source(system, guid):
    """model.c: sizes, start and nominal values, the function of the equations over their names, and FMI around it."""
    starts = [system.start.get(name, 0.0) for name in system.states] + [0.0] * len(system.inputs) + list(system.declared().values())
    numbers = lambda values: ", ".join(map(repr, values))
    const = lambda names, array: "".join(f"    const double {name} = {array}[{k}]; (void){name};\n" for k, name in enumerate(names))
    rates = "".join(f"    double der_{name};\n" for name in system.states)
    back = "".join(f"    dx[{k}] = der_{name};\n" for k, name in enumerate(system.states))
    return f"""enum {{ STATES = {len(system.states)}, INPUTS = {len(system.inputs)}, PARAMETERS = {len(system.parameters)} }};
static const char GUID[] = "{guid}";
static const double START[] = {{{numbers(starts)}}};
static const double NOMINALS[] = {{{numbers([nominal for _, nominal, _ in system.states.values()])}}};
#define NOMINAL(k) NOMINALS[k]
static void rates(const double *x_, const double *u_, const double *p_, double *dx);
#include "model_exchange.h"
static void rates(const double *x_, const double *u_, const double *p_, double *dx) {{
{const(system.states, "x_")}{const(system.inputs, "u_")}{const(system.parameters, "p_")}{rates}#include "equations/{system.name}.h"
{back}}}
"""


def make(system, path, home=HERE):
    """Writes the FMU of a system for Linux on this machine; `home`: folder with equations/NAME.h."""
    guid = f"airloop-third-party-{system.name}"
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "model.c").write_text(source(system, guid))
        library = folder / f"{system.name}.so"
        subprocess.run([os.environ.get("CC", "gcc"), "-O2", "-std=gnu99", "-shared", "-fPIC", "-Wall", "-Wextra", "-Wno-unused-parameter", "-I", home, "-I", HERE.parents[2] / "examples",
                        "-o", library, folder / "model.c", "-lm"], check=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", description(system, guid))
            archive.write(library, f"binaries/linux64/{library.name}")


if __name__ == "__main__":
    for name in sys.argv[2:] or SYSTEMS:
        make(SYSTEMS[name], pathlib.Path(sys.argv[1]) / f"{name}.fmu")
