"""The same FMU simulated and fitted by FMPy with SciPy, and by airloop: the pendulum of example 06 with its declared model.

    .venv/bin/python tests/study/compare/fmpy_fit.py

Free are inertia, damping, the offset of the encoder and the first state of the record; the error on the validation records is that of the fitted
plant with first states of its own. airloop fits the same before its search for effects begins.
"""

import tempfile

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from scipy.optimize import least_squares

import pendulum as work

FMU = work.ROOT / "target" / "fmu" / "pendulum.fmu"
# Declared values of the plant, and what a step of each variable is.
PLANT, PLANT_STEP = np.array([3.4e-3, 1e-4, 0.0]), np.array([1e-3, 1e-4, 1e-2])
START_STEP = np.array([1e-2, 1e-1])


class Pendulum:
    """The FMU of this project in FMPy, instantiated once."""

    def __init__(self, folder):
        self.description = fmpy.read_model_description(str(FMU))
        fmpy.extract(str(FMU), str(folder))
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate()
        self.runs = 0

    def angles(self, plant, start, samples):
        """Co-simulation with a communication step of the records' sampling."""
        self.runs += 1
        values = {"m": work.M, "l": work.L, "I": plant[0], "b": plant[1], "theta": start[0], "omega": start[1]}
        self.fmu.reset()
        self.fmu.setReal([self.reference[name] for name in values], list(values.values()))
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        theta, found = [self.reference["theta"]], [start[0]]
        for k in range(samples - 1):
            self.fmu.doStep(currentCommunicationPoint=k * work.STEP, communicationStepSize=work.STEP)
            found.append(self.fmu.getReal(theta)[0])
        return np.array(found)


def starts(records):
    return [value for y in records for value in (y[0], (y[2] - y[0]) / (2 * work.STEP))]


def fit(model, records, plant=None):
    """Plant (unless it is given) and first states; the rms error in mrad."""
    count = 3 if plant is None else 0
    step = np.concatenate([PLANT_STEP[:count], np.tile(START_STEP, len(records))])
    begin = np.concatenate([PLANT[:count], starts(records)]) / step

    def residual(scaled):
        p = scaled * step
        own = p[:3] if plant is None else plant
        pairs = zip(records, p[count:].reshape(-1, 2))
        return np.concatenate([model.angles(own, start, len(y)) + own[2] - y for y, start in pairs]) / work.NOISE

    solved = least_squares(residual, begin, method="lm", diff_step=1e-5, x_scale="jac")
    samples = sum(map(len, records))
    return solved.x[:count] * step[:count], 1e3 * work.NOISE * np.sqrt(2 * solved.cost / samples)


def main():
    estimation, validation = work.segments()
    with tempfile.TemporaryDirectory() as folder:
        model = Pendulum(folder)
        with work.Timer() as timer:
            plant, left = fit(model, estimation)
            _, validated = fit(model, validation, plant)
    print(f"FMPy and SciPy: I = {plant[0]:.5f} kg.m2, b = {plant[1]:.2e} N.m.s, offset {1e3 * plant[2]:.2f} mrad")
    print(f"FMPy and SciPy: rms {left:.2f} mrad on estimation, {validated:.2f} mrad on validation; "
          f"{model.runs} simulations, {timer.seconds:.1f} s of processor time")
    report, seconds = work.refine()
    for part in ("estimation", "validation"):
        error = report["residual"][part]["rms_before"]
        print(f"airloop refine, declared model fitted: rms {1e3 * list(error.values())[0]:.2f} mrad on {part}")
    print(f"airloop refine, with the search for effects: {seconds:.1f} s of processor time")


if __name__ == "__main__":
    main()
