"""Cost of a step from Python and throughput of a batch, against FMPy in the same process: `python bench.py [THIRD_PARTY.fmu]`.

One table on the standard output. Every figure is the best of five repetitions.
"""

import os
import sys
import time
from pathlib import Path

import numpy as np

import airloop

STEPS, STEP = 2000, 1e-3


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


def fmpy_step(path):
    """Time per step [s] of FMPy: set one input, step, get one output, through its slave class."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    description = fmpy.read_model_description(path)
    folder = fmpy.extract(path)
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
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
    clock = [0.0]

    def loop():
        for _ in range(STEPS):
            if inputs:
                slave.setReal(inputs, [0.0])
            slave.doStep(currentCommunicationPoint=clock[0], communicationStepSize=STEP)
            clock[0] += STEP
            slave.getReal(outputs)

    duration = best(loop) / STEPS
    slave.terminate()
    slave.freeInstance()
    return duration


def main():
    """Prints the table."""
    batch = 64
    cases = [(file, file) for file in sys.argv[1:]]
    # FMPy steps single FMUs only: example 01 is exported as one, which both tools then step.
    with_system = Path(airloop.__file__).parent / "examples" / "system.ssd"
    one = Path(os.environ.get("TMPDIR", "/tmp")) / "airloop_bench.fmu"
    airloop.System(with_system).export(one)
    cases = [("example 01", one), ("friction", airloop.System("airloop:friction").path), *cases]
    print(f"us per instance and step; batch of {batch}, {os.cpu_count()} processors, step {STEP} s")
    print("| case | count=N | step() | set, step, get | batch: set, step, get | batch: rollout | FMPy | rollout against FMPy |")
    print("|---|---|---|---|---|---|---|---|")
    for name, path in cases:
        found = airloop_steps(path, batch)
        other = fmpy_step(str(path))
        numbers = " | ".join(f"{1e6 * one:.2f}" for one in (*found, other))
        print(f"| {Path(name).name} | {numbers} | {other / found[-1]:.1f} |")
    found = airloop_steps(with_system, batch)
    print(f"| example 01 (four FMUs) | {' | '.join(f'{1e6 * one:.2f}' for one in found)} | | |")
    os.unlink(one)


if __name__ == "__main__":
    main()
