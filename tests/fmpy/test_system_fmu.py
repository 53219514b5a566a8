"""`airloop export-fmu`: a whole system as one FMU, against `airloop run` with the same master, and in the other interface
against the monolithic master."""

import ctypes
import resource
import shutil
import subprocess

import casadi
import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

from command import ROOT, airloop, start
from pneumatic import SYSTEM, run, sine
from test_packages import amended, stabilized  # noqa: F401  (fixtures)

STEP, STEPS = 1e-3, 500
TIMES = [k / 1000 for k in range(STEPS + 1)]
STATES = ["cart_pole.x", "cart_pole.theta", "cart_pole.v", "cart_pole.omega"]


def exported(system, path, *options):
    airloop("export-fmu", system, "-o", path, *options)
    return path


class Unit:
    """An FMU in FMPy with its variables by name."""

    def __init__(self, path, folder, kind=FMU2Slave):
        self.description = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        interface = self.description.coSimulation if kind is FMU2Slave else self.description.modelExchange
        self.fmu = kind(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=interface.modelIdentifier,
            instanceName="system",
        )
        self.fmu.instantiate()

    def start(self, **values):
        self.fmu.setupExperiment(startTime=0.0)
        self.set(**values)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, **values):
        if values:
            self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, names):
        return self.fmu.getReal([self.references[name] for name in names])

    def free(self):
        self.fmu.terminate()
        # Without FMPy's unloading of the library, which other tests of this process use.
        self.fmu.fmi2FreeInstance(self.fmu.component)


def co_simulated(unit, names, command, steps=STEPS, step=STEP):
    unit.start(**({} if command is None else {"u": command[0]}))
    rows = [unit.get(names)]
    for k in range(steps):
        if command is not None:
            unit.set(u=command[k])
        unit.fmu.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
        rows.append(unit.get(names))
    return dict(zip(names, np.array(rows).T))


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi", "interface-jacobian"])
@pytest.mark.parametrize("system", ["01", "amended"])
def test_co_simulation_gives_the_bits_of_a_run(system, master, tmp_path, request):
    system = SYSTEM if system == "01" else request.getfixturevalue(system)
    path = exported(system, tmp_path / "system.fmu", "--master", master)
    command = sine(TIMES)
    ours = run(tmp_path, system, "1ms", TIMES, command, master)
    names = [*STATES, "x", "theta", "v", "omega"]
    theirs = co_simulated(Unit(path, tmp_path / "unpacked"), names, command)
    found = {name: float(np.max(np.abs(theirs[name] - ours[name]))) for name in names}
    assert found == dict.fromkeys(names, 0.0)
    assert np.ptp(ours["cart_pole.x"]) > 1e-3


@pytest.mark.parametrize("system", ["01", "amended", "stabilized"])
def test_fmpy_validates_and_simulates_both_interfaces(system, tmp_path, request):
    system = SYSTEM if system == "01" else request.getfixturevalue(system)
    path = exported(system, tmp_path / "system.fmu")
    assert validate_fmu(str(path)) == []
    output = airloop("inspect", "--check", path)
    assert " 0 errors" in "\n " + output.splitlines()[-1], output
    for kind in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(str(path), stop_time=0.05, step_size=1e-3, fmi_type=kind)
        assert len(result) > 10 and result["time"][-1] == pytest.approx(0.05)


# Constant inputs that set each system in motion, without a state event in half a second.
INPUTS = {"01": {"u": 15.0}, "amended": {"u": 15.0}, "walker": {"tau_rate": 2.0, "F1_rate": 1.0}}


def monolithic(tmp_path, system, inputs):
    """States of the system by name, at `TIMES`, by the monolithic master at 1e-10."""
    command = tmp_path / "command.csv"
    rows = [f"{t},{','.join(map(str, inputs.values()))}" for t in TIMES]
    command.write_text("\n".join([f"time,{','.join(inputs)}", *rows]) + "\n")
    span = ["--stop", TIMES[-1], "--step", "1ms", "--input", command]
    options = ["--master", "monolithic", "--tolerance", "1e-10", "--no-plots", "-q", "-o", tmp_path / "run"]
    airloop("run", system, *span, *options)
    return np.genfromtxt(tmp_path / "run" / "result.csv", delimiter=",", names=True, deletechars="")


def system_named(name, request):
    if name == "walker":
        return ROOT / "examples" / "04_half_step" / "walker.ssd"
    return SYSTEM if name == "01" else request.getfixturevalue(name)


def integrated(unit, inputs, tolerance):
    """States at `TIMES` by SciPy over the functions of Model Exchange: one call of the integrator between two time events."""
    rates = [v for v in unit.description.modelVariables if v.derivative is not None]
    names, size = [v.derivative.name for v in rates], len(rates)
    buffer, slope = (ctypes.c_double * size)(), (ctypes.c_double * size)()
    indicators = (ctypes.c_double * max(unit.description.numberOfEventIndicators, 1))()
    signs = []

    def events():
        needed = True
        while needed:
            needed, ended, _, _, defined, time = unit.fmu.newDiscreteStates()
            assert not ended
        unit.fmu.enterContinuousTimeMode()
        return time if defined else np.inf

    def place(t, x):
        buffer[:] = x
        unit.fmu.setTime(t)
        unit.fmu.setContinuousStates(buffer, size)

    def rate(t, x):
        place(t, x)
        unit.fmu.getDerivatives(slope, size)
        return np.array(slope)

    unit.start(**inputs)
    following, time, at = events(), 0.0, 0
    x = np.empty((len(TIMES), size))
    while True:
        unit.fmu.getContinuousStates(buffer, size)
        x[at] = buffer
        if at == len(TIMES) - 1:
            break
        end = min(following, TIMES[-1])
        inside = [t for t in TIMES[at + 1 :] if t <= end + 1e-12]
        points = sorted({*inside, end})
        if points[-1] > time:
            solution = solve_ivp(rate, (time, points[-1]), np.array(buffer), "DOP853", points, rtol=tolerance, atol=tolerance)
            assert solution.success
            x[at + 1 : at + 1 + len(inside)] = solution.y.T[: len(inside)]
            place(points[-1], solution.y[:, -1])
        unit.fmu.getEventIndicators(indicators, unit.description.numberOfEventIndicators)
        signs.append(tuple(np.sign(indicators)))
        time, at = points[-1], at + len(inside)
        if time >= following - 1e-12:
            unit.fmu.enterEventMode()
            following = events()
    assert len(set(signs)) == 1, "a state event, which this loop does not look for"
    return dict(zip(names, x.T))


@pytest.mark.parametrize("name", INPUTS)
def test_model_exchange_is_the_equation_of_the_monolithic_master(name, tmp_path, request):
    """Two integrators of order 8, both at 1e-10, over two ways to the same right-hand side."""
    system = system_named(name, request)
    path = exported(system, tmp_path / "system.fmu")
    ours = monolithic(tmp_path, system, INPUTS[name])
    unit = Unit(path, tmp_path / "unpacked", FMU2Model)
    theirs = integrated(unit, INPUTS[name], 1e-10)
    unit.free()
    moved = {state: np.ptp(ours[state]) for state in theirs if state in ours.dtype.names}
    assert max(moved.values()) > 1e-2, moved
    found = {state: float(np.max(np.abs(theirs[state] - ours[state]))) for state in moved}
    assert max(found.values()) <= 1e-8, found


@pytest.mark.parametrize("name", INPUTS)
def test_model_exchange_follows_the_monolithic_master(name, tmp_path, request):
    """CVode of FMPy against DOP853 at 1e-10.

    CVode bounds the error of a step and not that of their sum, takes the formulas of low order (BDF, at most 5), and begins
    at order 1 after each sample of the actuator: it errs by some 3000 times its tolerance here, in each system. The
    difference goes down with that tolerance, so it is CVode's and not that of the FMU, which the test above has at 1e-10.
    """
    system = system_named(name, request)
    path = exported(system, tmp_path / "system.fmu")
    ours = monolithic(tmp_path, system, INPUTS[name])
    states = [v.derivative.name for v in fmpy.read_model_description(str(path)).modelVariables if v.derivative]
    states = [state for state in states if state in ours.dtype.names]

    def difference(tolerance):
        theirs = fmpy.simulate_fmu(
            str(path),
            fmi_type="ModelExchange",
            stop_time=TIMES[-1],
            output_interval=STEP,
            relative_tolerance=tolerance,
            start_values=INPUTS[name],
            output=states,
            record_events=False,
        )
        assert len(theirs) == len(TIMES)
        return max(np.max(np.abs(theirs[state] - ours[state])) for state in states)

    coarse, fine = difference(1e-10), difference(1e-12)
    assert fine <= 1e-8
    assert fine <= coarse / 20


@pytest.mark.parametrize("system", ["joint", "toe", "walker"])
def test_the_systems_of_example_04_run_alike(system, tmp_path):
    source = ROOT / "examples" / "04_half_step" / f"{system}.ssd"
    path = exported(source, tmp_path / "system.fmu", "--step", "1ms")
    assert validate_fmu(str(path)) == []
    results = []
    for number, which in enumerate([source, path]):
        out = tmp_path / str(number)
        airloop("run", which, "--stop", "0.3", "--step", "1ms", "--no-plots", "-q", "-o", out)
        results.append(np.genfromtxt(out / "result.csv", delimiter=",", names=True, deletechars=""))
    names = [name for name in results[1].dtype.names if name in results[0].dtype.names]
    assert len(names) > 1
    assert all(np.array_equal(results[0][name], results[1][name]) for name in names)


def test_an_output_of_another_tool_that_is_a_state_depends_on_that_state(tmp_path):
    """Inside of its FMU such an output depends on nothing (`dependencies=""`); in the exported one the state is another variable."""
    source = shutil.copytree(ROOT / "examples" / "09_tanks", tmp_path / "source")
    text = (source / "modelDescription.xml").read_text()
    outputs = '<Outputs><Unknown index="1"/><Unknown index="2"/></Outputs>'
    assert outputs in text
    (source / "modelDescription.xml").write_text(text.replace(outputs, outputs.replace('"/><', '" dependencies=""/><')))
    shutil.copy(ROOT / "examples" / "model_exchange.h", tmp_path)
    subprocess.run(["sh", ROOT / "examples" / "make_fmu.sh", source], check=True, capture_output=True)
    path = exported(source / "tanks.fmu", tmp_path / "system.fmu")
    assert validate_fmu(str(path)) == []
    output = airloop("inspect", "--check", path)
    assert " 0 errors" in "\n " + output.splitlines()[-1], output
    description = fmpy.read_model_description(str(path))
    known = {unknown.variable.name: {v.name for v in unknown.dependencies} for unknown in description.outputs}
    assert known == {"h_1": {"tanks.h_1"}, "h_2": {"tanks.h_2"}}


def test_a_step_of_the_importer_is_made_of_steps_inside(tmp_path):
    path = exported(SYSTEM, tmp_path / "system.fmu", "--step", "1ms")
    fine = co_simulated(Unit(path, tmp_path / "a"), STATES, [15.0] * STEPS)
    coarse = co_simulated(Unit(path, tmp_path / "b"), STATES, [15.0] * STEPS, STEPS // 5, 5 * STEP)
    for name in STATES:
        assert np.array_equal(fine[name][::5], coarse[name]), name


def test_parameters_are_those_of_set(tmp_path):
    """A parameter set before the start is the same as `--set` in the export, bit for bit."""
    plain = Unit(exported(SYSTEM, tmp_path / "plain.fmu"), tmp_path / "a")
    plain.set(**{"cart_pole.m_p": 0.12})
    amended = Unit(exported(SYSTEM, tmp_path / "set.fmu", "--set", "cart_pole.m_p=0.12"), tmp_path / "b")
    one, other = (co_simulated(unit, STATES, [15.0] * STEPS, 100) for unit in (plain, amended))
    assert all(np.array_equal(one[name], other[name]) for name in STATES)
    third = co_simulated(Unit(tmp_path / "plain.fmu", tmp_path / "c"), STATES, [15.0] * STEPS, 100)
    assert not np.array_equal(one["cart_pole.theta"], third["cart_pole.theta"])


def test_states_are_saved_and_serialized(tmp_path):
    unit = Unit(exported(SYSTEM, tmp_path / "system.fmu"), tmp_path / "unpacked")
    unit.start(u=10.0)

    def on(first, count):
        for k in range(first, first + count):
            unit.set(u=10.0 + k % 7)
            unit.fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
        return unit.get([*STATES, "actuator.F_hat"])

    on(0, 50)
    state = unit.fmu.getFMUstate()
    first = on(50, 50)
    unit.fmu.setFMUstate(state)
    assert on(50, 50) == first
    # As bytes, into an instance that was reset.
    data = unit.fmu.serializeFMUstate(state)
    unit.fmu.freeFMUstate(state)
    unit.fmu.reset()
    restored = unit.fmu.deSerializeFMUstate(data)
    unit.fmu.setFMUstate(restored)
    unit.fmu.freeFMUstate(restored)
    assert on(50, 50) == first
    unit.free()


def test_a_system_can_be_a_component_and_be_exported_again(tmp_path):
    inner = exported(SYSTEM, tmp_path / "inner.fmu")
    outer = exported(inner, tmp_path / "outer.fmu", "--step", "1ms")
    command = sine(TIMES)
    one = co_simulated(Unit(inner, tmp_path / "a"), ["x", "theta"], command, 200)
    other = co_simulated(Unit(outer, tmp_path / "b"), ["x", "theta"], command, 200)
    assert all(np.array_equal(one[name], other[name]) for name in one)
    ours = run(tmp_path / "run", inner, "1ms", TIMES, command, "gauss-seidel")
    assert np.array_equal(ours["x"][:201], one["x"])


def test_directional_derivatives_are_those_of_differences_and_casadi_uses_them(tmp_path):
    path = exported(SYSTEM, tmp_path / "system.fmu")
    unit = Unit(path, tmp_path / "unpacked", FMU2Model)
    # The actuator holds what it sampled at the start; CasADi sets the command after that, so it is 0 here.
    unit.start(u=0.0)
    unit.fmu.newDiscreteStates()
    unit.fmu.enterContinuousTimeMode()
    rates = [v for v in unit.description.modelVariables if v.derivative is not None]
    states = [v.derivative.valueReference for v in rates]
    unknowns = [*(v.valueReference for v in rates), unit.references["F_p"]]
    point = np.linspace(0.1, 0.3, len(states))

    def values(x):
        unit.fmu.setContinuousStates((ctypes.c_double * len(x))(*x), len(x))
        return np.array(unit.fmu.getReal(unknowns))

    step = 1e-6
    differences = np.array([(values(point + d) - values(point - d)) / (2 * step) for d in step * np.eye(len(point))]).T
    values(point)
    exact = np.array([unit.fmu.getDirectionalDerivative(unknowns, [state], [1.0]) for state in states]).T
    assert np.max(np.abs(exact - differences)) <= 1e-7 * np.max(np.abs(exact))
    function = casadi.DaeBuilder("system", str(tmp_path / "unpacked")).create("f", ["x", "u"], ["ode"])
    jacobian = function.factory("J", ["x", "u"], ["jac:ode:x"])
    found = np.array(casadi.DM.full(jacobian(point, [0.0])))
    assert np.max(np.abs(found - exact[:-1])) <= 1e-10 * np.max(np.abs(exact))
    unit.free()


def test_life_cycles_are_flat(tmp_path):
    """Memory after 500 and after 10 500 life cycles."""
    path = exported(SYSTEM, tmp_path / "system.fmu")
    unit = Unit(path, tmp_path / "unpacked")
    unit.start()
    unit.free()

    def cycles(count):
        for _ in range(count):
            unit.fmu.instantiate()
            unit.start(u=1.0)
            unit.fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=STEP)
            unit.free()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = cycles(500)
    assert cycles(10_000) - before < 1024  # KiB


def test_the_fmu_is_checked_where_it_is_written(tmp_path):
    output = airloop("export-fmu", SYSTEM, "-o", tmp_path / "x.fmu", "--check")
    assert "x.fmu: " in output and "0 errors" in output.splitlines()[-1], output
    assert airloop("export-fmu", SYSTEM, "-o", tmp_path / "x.fmu", "--check", "-q") == ""


def test_what_cannot_be_exported_is_refused(tmp_path):
    result = start("export-fmu", SYSTEM, "--step", "0", "-o", tmp_path / "x.fmu")
    assert result.returncode == 2 and "longer than 0 s" in result.stderr
    result = start("export-fmu", SYSTEM, "--set", "cart_pole.nope=1", "-o", tmp_path / "x.fmu")
    assert result.returncode == 1 and "nope" in result.stderr
    assert not (tmp_path / "x.fmu").exists()
