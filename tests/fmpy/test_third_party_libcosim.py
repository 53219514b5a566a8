"""libcosim (Open Simulation Platform) runs the system with its fixed-step algorithm, which is a Jacobi master.

How it works: it passes outputs on as often as there are slaves before the initialization ends, as ours does until
nothing changes; then all slaves step, then all outputs are passed on. It keeps time in whole nanoseconds and hands
each step to the slaves as the difference of two such times: with a step of 2^-9 s these are exact and the results must
be equal bit for bit; with 1 ms the times differ in the last place, which shows at 1e-12 or so.
"""

import fmpy
import numpy as np
import pytest

pytest.importorskip("libcosimpy", reason="libcosimpy has wheels for x86-64 on Linux and Windows only")

from libcosimpy.CosimEnums import CosimExecutionState  # noqa: E402
from libcosimpy.CosimExecution import CosimExecution  # noqa: E402
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: E402
from libcosimpy.CosimManipulator import CosimManipulator  # noqa: E402
from libcosimpy.CosimObserver import CosimObserver  # noqa: E402
from libcosimpy.CosimSlave import CosimLocalSlave  # noqa: E402

from pneumatic import CART, CONNECTIONS, FMUS, SYSTEM, run, sine  # noqa: E402
from pneumatic import at_start_of_interval, differences  # noqa: E402

RECORDED = {
    "actuator": ["F_hat", "F_act"],
    "piston_friction": ["F_out", "f"],
    "cart_friction": ["F_out"],
    "cart_pole": ["x", "theta", "v", "omega"],
}


@pytest.fixture(autouse=True)
def _quiet():
    log_output_level(CosimLogLevel.ERROR)


@pytest.fixture
def references(shipped):
    """Value references by component and variable name."""
    result = {}
    for component, name in FMUS.items():
        description = fmpy.read_model_description(str(shipped(name).path))
        result[component] = {v.name: v.valueReference for v in description.modelVariables}
    return result


def simulate(execution, indices, references, command, steps):
    """Columns of RECORDED after each step, with the command (if any) set before it."""
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    assert execution.add_observer(observer) and execution.add_manipulator(manipulator)
    columns = {(component, name): [] for component, names in RECORDED.items() for name in names}
    for k in range(steps):
        if command is not None:
            target = [references["actuator"]["u"]]
            assert manipulator.slave_real_values(indices["actuator"], target, [command[k]])
        assert execution.step()
        for component, names in RECORDED.items():
            wanted = [references[component][name] for name in names]
            for name, value in zip(names, observer.last_real_values(indices[component], wanted)):
                columns[component, name].append(value)
    assert execution.status().state != CosimExecutionState.ERROR.value
    return columns


def wired(shipped, references, nanoseconds):
    """The system put together through libcosim's own interface; execution and slave indices."""
    execution, indices = CosimExecution.from_step_size(nanoseconds), {}
    for component, name in FMUS.items():
        slave = CosimLocalSlave(str(shipped(name).path), component)
        indices[component] = execution.add_local_slave(slave)
    for source, output, target, variable in CONNECTIONS:
        ends = indices[source], references[source][output], indices[target], references[target][variable]
        assert execution.connect_real_variables(*ends) == 0
    for name, value in CART.items():
        reference = references["cart_friction"][name]
        assert execution.real_initial_value(indices["cart_friction"], reference, value)
    return execution, indices


def after_first_step(result, columns):
    """Both without the row of the start time, which libcosim does not report; sampled outputs where ours stand."""
    start = {key: [result[".".join(key)][0], *values] for key, values in columns.items()}
    return differences(result, at_start_of_interval(start))


@pytest.mark.parametrize(
    "nanoseconds, step, time, tolerance",
    [
        (1953125, repr(2.0**-9), lambda k: k / 512, 0.0),
        (1000000, "1ms", lambda k: k / 1000, 1e-11),
    ],
    ids=["2^-9 s, equal bits", "1 ms"],
)
def test_libcosim_agrees_with_the_jacobi_master(
    shipped, references, tmp_path, nanoseconds, step, time, tolerance
):
    times = [time(k) for k in range(1501)]
    command = sine(times)
    ours = run(tmp_path, SYSTEM, step, times, command, "jacobi")
    execution, indices = wired(shipped, references, nanoseconds)
    found = after_first_step(ours, simulate(execution, indices, references, command, len(times) - 1))
    print({name: f"{value:.1e}" for name, value in found.items()})
    assert max(found.values()) <= tolerance
    assert np.ptp(ours["cart_pole.x"]) > 0.01
    # The serial master is another thing, so the agreement says something.
    serial = run(tmp_path / "serial", SYSTEM, step, times, command, "gauss-seidel")
    assert np.max(np.abs(serial["cart_pole.v"] - ours["cart_pole.v"])) > 1e-6
