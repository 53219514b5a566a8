"""The FMUs of FMI 3.0: valid, and with the numbers of those of 2.0 bit for bit, in both interfaces."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from command import airloop

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = [ROOT / "target" / "fmu", ROOT / "target" / "fmu" / "test"]
PAIRS = [
    pytest.param(two, two.parent / "fmi3" / two.name, id=two.stem)
    for folder in FOLDERS
    for two in sorted(folder.glob("*.fmu"))
]


@pytest.mark.parametrize("two, three", PAIRS)
def test_fmpy_finds_no_problem(two, three):
    assert three.is_file(), f"{three} is missing; run `make fmu`"
    assert validate_fmu(str(three)) == []


def _run(path, interface, **settings):
    # Constant inputs are start values: both versions get the same.
    result = fmpy.simulate_fmu(str(path), fmi_type=interface, validate=False, **settings)
    return {name: result[name] for name in result.dtype.names}


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("two, three", PAIRS)
def test_both_versions_give_the_same_bits(two, three, interface):
    description = fmpy.read_model_description(str(two), validate=False)
    step = float(description.defaultExperiment.stepSize)
    steps = 50
    # Aliases are in the description of 2.0 only.
    common = {v.name for v in fmpy.read_model_description(str(three), validate=False).modelVariables}
    reals = [v for v in description.modelVariables if v.type == "Real" and v.variability != "fixed"]
    names = [v.name for v in reals if v.name in common][:20]
    # A step of the explicit Euler method for each communication step, so that the importer adds the same to both.
    solver = {"solver": "Euler"} if interface == "ModelExchange" else {}
    settings = dict(stop_time=steps * step, step_size=step, output_interval=step, output=names, **solver)
    a, b = _run(two, interface, **settings), _run(three, interface, **settings)
    assert np.array_equal(a["time"], b["time"])
    for name in names:
        assert np.array_equal(a[name], b[name]), name


def test_event_indicators_time_and_adjoint_derivatives():
    path = FOLDERS[1] / "fmi3" / "test-bouncing-ball.fmu"
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    unzipped = fmpy.extract(str(path))
    model = fmpy.fmi3.FMU3Model(
        guid=description.guid,
        unzipDirectory=unzipped,
        modelIdentifier=description.modelExchange.modelIdentifier,
        instanceName="ball",
    )
    model.instantiate()
    model.enterInitializationMode(startTime=0.5)
    model.exitInitializationMode()
    indicators = [name for name in references if name.startswith("event_indicator[")]
    assert len(indicators) == model.getNumberOfEventIndicators() > 0
    assert model.getFloat64([references["time"]]) == [0.5]
    states = model.getNumberOfContinuousStates()
    assert states == len(description.derivatives)
    derivatives = [unknown.variable.valueReference for unknown in description.derivatives]
    known = [unknown.variable.derivative.valueReference for unknown in description.derivatives]
    # Row k of the Jacobian by the adjoint, column j by the directional derivative.
    unit = np.eye(states).tolist()
    columns = [model.getDirectionalDerivative(derivatives, known, seed) for seed in unit]
    rows = [model.getAdjointDerivative(derivatives, known, seed) for seed in unit]
    assert np.array_equal(np.array(columns).T, np.array(rows))
    model.terminate()
    model.freeInstance()


@pytest.mark.parametrize("master", ["gauss-seidel", "monolithic"])
def test_airloop_runs_both_versions_alike(master, tmp_path):
    """Under a master of ours, as a component of an exported system, too."""
    three = FOLDERS[0] / "fmi3" / "cart-pole.fmu"
    outer = tmp_path / "outer.fmu"
    airloop("export-fmu", three, "--master", "gauss-seidel", "--step", "1ms", "-o", outer)
    results = []
    for number, path in enumerate([FOLDERS[0] / "cart-pole.fmu", three, outer]):
        if path == outer and master == "monolithic":
            continue
        out = tmp_path / str(number)
        span = ("--stop", "0.2", "--step", "1ms", "--master", master)
        airloop("run", path, "--set", "F=1.5", *span, "--no-plots", "-q", "-o", out)
        results.append(np.genfromtxt(out / "result.csv", delimiter=",", names=True, deletechars=""))
    assert np.ptp(results[0]["x"]) > 1e-3
    for other in results[1:]:
        assert all(np.array_equal(results[0][name], other[name]) for name in ["time", "x", "theta"])
