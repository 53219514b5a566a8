"""FMPy runs every FMU in both interfaces; the result has every output, finite, at every communication point."""

import fmpy
import numpy as np
import pytest


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_to_the_default_stop_time(fmu, interface):
    messages = []
    result = fmpy.simulate_fmu(
        str(fmu.path), fmi_type=interface, logger=lambda *message: messages.append(message), debug_logging=False
    )
    numeric = [v for v in fmu.of("output") if v.type != "String"]
    assert set(result.dtype.names) == {"time", *(v.name for v in numeric)}
    for v in numeric:
        assert np.all(np.isfinite(result[v.name].astype(float))), v.name
    assert result["time"][-1] == pytest.approx(fmu.stop_time)
    assert messages == []


def test_fmpy_feeds_inputs(fmu):
    """Without input derivatives: FMPy 0.3.32 cannot set them for more than one input at once (`test_input_derivatives.py`)."""
    inputs = [v for v in fmu.of("input") if v.is_real and v.variability == "continuous"]
    if not inputs:
        pytest.skip("no continuous Real input")
    time = np.linspace(0.0, fmu.stop_time, 50)
    signal = np.zeros(len(time), dtype=[("time", float), *((v.name, float) for v in inputs)])
    signal["time"] = time
    for v in inputs:
        signal[v.name] = (v.start or 0.0) + (v.number("nominal") or 1.0) * np.sin(3 * time + v.index)
    for interface in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(str(fmu.path), fmi_type=interface, input=signal)
        assert len(result) > 10
