"""Cost of a step from Python and throughput of a batch, against FMPy in the same process: `python bench.py [OTHER.fmu ...]`.

A third-party FMU is compiled from `orchestrator/testing/c/first_order.c` (an Euler step in C). One table on the standard output. Every figure is the best of five repetitions.
"""

import os
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np

import airloop

STEPS, STEP = 2000, 1e-3
SOURCE = Path(__file__).resolve().parents[2] / "orchestrator" / "testing" / "c" / "first_order.c"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="first_order" guid="right" generationTool="cc">
  <CoSimulation modelIdentifier="first_order" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="output" variability="continuous" initial="exact"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="3" causality="output" variability="continuous" initial="calculated"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies=""/><Unknown index="3" dependencies="1"/></Outputs>
    <InitialUnknowns><Unknown index="3"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


# Functions that FMPy looks up; those that the source does not have answer with an error.
LOOKED_UP = """SetDebugLogging Terminate Reset GetInteger GetBoolean GetString SetInteger SetBoolean SetString GetFMUstate SetFMUstate
FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative SetRealInputDerivatives
GetRealOutputDerivatives CancelStep GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus""".split()


def third_party(folder):
    """An FMU in C, of no tool of this project."""
    library, archive, others = (folder / f"first_order.{suffix}" for suffix in ("so", "fmu", "c"))
    weak = "__attribute__((weak)) int fmi2{}(void) {{ return 3; }}\n"
    others.write_text("".join(weak.format(name) for name in LOOKED_UP), encoding="utf-8")
    command = [os.environ.get("CC", "cc"), "-O2", "-shared", "-fPIC", "-o", library, SOURCE, others, "-lm"]
    subprocess.run(command, check=True)
    with zipfile.ZipFile(archive, "w") as out:
        out.writestr("modelDescription.xml", DESCRIPTION)
        out.write(library, "binaries/linux64/first_order.so")
    return archive


def best(work, repetitions=5):
    """Least wall-clock time [s] of `work`."""
    times = []
    for _ in range(repetitions):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def airloop_steps(path, batch):
    """Times per instance and step [s] of airloop: all steps in one call, one call per step, and set, step and get."""
    system = airloop.System(path)
    inputs = [one.name for one in system.inputs if one.type == "Real"][:1]
    output = next(one.name for one in system.outputs if one.type == "Real")
    with system.instantiate(step=STEP) as sim:

        def calls():
            for _ in range(STEPS):
                sim.step()

        def loop():
            for _ in range(STEPS):
                sim.set(**dict.fromkeys(inputs, 0.0))
                sim.step()
                sim.get(output)

        one_call, call_each, full = (best(work) / STEPS for work in (lambda: sim.step(count=STEPS), calls, loop))
    with system.instantiate(step=STEP, batch=batch) as many:
        values = {name: np.zeros((STEPS, 1)) for name in inputs}

        def environment():
            for _ in range(STEPS // 10):
                many.set(**dict.fromkeys(inputs, 0.0))
                many.step()
                many.get(output)

        stepped = best(environment) / (STEPS // 10) / batch
        rolled = best(lambda: many.rollout(values, steps=STEPS, read=[output]), 3) / STEPS / batch
    return one_call, call_each, full, stepped, rolled


def fmpy_step(*paths):
    """Time per step [s] of FMPy: for every FMU set one input, step, get one output, through its slave class."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    slaves = []
    for path in map(str, paths):
        description = fmpy.read_model_description(path)
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="bench",
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        reals = [one for one in description.modelVariables if one.type == "Real"]
        inputs = [one.valueReference for one in reals if one.causality == "input"][:1]
        outputs = [one.valueReference for one in reals if one.causality == "output"][:1]
        slaves.append((slave, inputs, outputs))
    clock = [0.0]

    def loop():
        for _ in range(STEPS):
            for slave, inputs, outputs in slaves:
                if inputs:
                    slave.setReal(inputs, [0.0])
                slave.doStep(currentCommunicationPoint=clock[0], communicationStepSize=STEP)
                slave.getReal(outputs)
            clock[0] += STEP

    duration = best(loop) / STEPS
    for slave, _, _ in slaves:
        slave.terminate()
        slave.freeInstance()
    return duration


def main():
    """Prints the table."""
    batch = 64
    example = Path(airloop.__file__).parent / "examples" / "system.ssd"
    parts = [airloop.System(f"airloop:{name}").path for name in ("arx-actuator", "friction", "friction", "cart-pole")]
    with tempfile.TemporaryDirectory() as folder:
        one = Path(folder) / "example_01.fmu"
        airloop.System(example).export(one)
        in_c = third_party(Path(folder))
        cases = [
            ("example 01, four FMUs", example, parts),
            ("example 01 as one FMU", one, [one]),
            ("friction", parts[1], parts[1:2]),
            ("an FMU in C", in_c, [in_c]),
            *((Path(file).name, file, [file]) for file in sys.argv[1:]),
        ]
        print(f"us per instance and step; batch of {batch}, {os.cpu_count()} processors, step {STEP} s")
        print("| case | count=N | step() | set, step, get | batch: set, step, get | batch: rollout | FMPy | rollout against FMPy |")
        print("|---|---|---|---|---|---|---|---|")
        for name, path, alone in cases:
            found = airloop_steps(path, batch)
            other = fmpy_step(*alone)
            numbers = " | ".join(f"{1e6 * value:.2f}" for value in (*found, other))
            print(f"| {name} | {numbers} | {other / found[-1]:.1f} |")


if __name__ == "__main__":
    main()
