"""Packages that `airloop export` writes, as they are, in FMPy, libcosim and Ecos: same numbers as our Jacobi master.

Every tool has its own idea of the first step and of when outputs are read; `simulate_*` below say which. A step of
2^-9 s keeps times exact in all of them.
"""

import ctypes
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from lxml import etree

from command import ROOT, airloop
from pneumatic import SYSTEM, run, sine

STEP, STEPS = 2.0**-9, 512
TIMES = [k * STEP for k in range(STEPS + 1)]
SIGNALS = [f"cart_pole.{name}" for name in ("x", "theta", "v", "omega")]
CLOSE = 1e-12
# Where scripts/setup.sh puts the library that Ecos needs.
TBB = Path(sys.prefix) / "lib" / "libtbb.so.12"
NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}


@pytest.fixture(scope="session")
def amended(tmp_path_factory):
    """The amended system of example 05: a cable that the declared model lacks."""
    folder = tmp_path_factory.mktemp("amended")
    airloop("refine", ROOT / "data" / "rig" / "v01", "-o", folder)
    return folder / "system" / "system.ssd"


@pytest.fixture(scope="session")
def stabilized(tmp_path_factory):
    """The closed loop of example 03: a regulator that holds the swing-up on its plan."""
    folder = tmp_path_factory.mktemp("stabilized")
    example = ROOT / "examples" / "03_swing_up"
    shooting = ["--transcription", "multiple-shooting", "--intervals", 100, "--no-verification", "--no-plots"]
    airloop("optimize", example / "problem.toml", *shooting, "-o", folder / "plan")
    airloop("stabilize", folder / "plan", example / "stabilize.toml", "-o", folder / "loop")
    return folder / "loop" / "closed_loop.ssd"


@pytest.fixture(scope="session")
def system(request):
    """The system of an example by its name."""
    return SYSTEM if request.param == "01" else request.getfixturevalue(request.param)


EVERY_SYSTEM = pytest.mark.parametrize("system", ["01", "stabilized", "amended"], indirect=True)


def exported(system, path, *options):
    airloop("export", system, "-o", path, *options)
    return path


def start_values(package):
    """{(component, variable): value} of all parameter sets in a package, and the names of the sets."""
    values, names = {}, set()
    with zipfile.ZipFile(package) as archive:
        for name in archive.namelist():
            if name.endswith(".ssv"):
                root = etree.fromstring(archive.read(name))
                names.add(root.get("name"))
                for parameter in root.iterfind("ssv:Parameters/ssv:Parameter", NAMESPACES):
                    component = name.removeprefix("resources/").removesuffix(".ssv")
                    values[component, parameter.get("name")] = parameter[0].get("value")
    return values, names


@EVERY_SYSTEM
def test_start_values_are_in_the_fmus_and_in_sets_of_one_name(system, tmp_path):
    package = exported(system, tmp_path / "system.ssp", "--set", "cart_pole.m_p=0.12")
    values, names = start_values(package)
    assert names == {"initialValues"}
    assert values["cart_pole", "m_p"] == "0.12"
    fmpy.extract(str(package), str(tmp_path / "unpacked"))
    description = etree.parse(str(tmp_path / "unpacked" / "SystemStructure.ssd"))
    sources = {c.get("name"): c.get("source") for c in description.iterfind(".//ssd:Component", NAMESPACES)}
    for (component, variable), value in values.items():
        model = fmpy.read_model_description(str(tmp_path / "unpacked" / sources[component]))
        found = next(v for v in model.modelVariables if v.name == variable)
        assert float(found.start) == float(value), (component, variable)


def test_omsimulator_finds_its_master_and_step(tmp_path):
    """Its reader takes the type of a system from the first annotation (Model::getSystemType)."""
    for version, step, found in [("1.0", [], "0.001"), ("2.0", ["--step", "2ms"], "0.002")]:
        package = exported(SYSTEM, tmp_path / "system.ssp", "--ssp-version", version, *step)
        with zipfile.ZipFile(package) as archive:
            root = etree.fromstring(archive.read("SystemStructure.ssd"))
        annotation = root.find("ssd:System/ssd:Annotations", NAMESPACES)[0]
        master = annotation.find("oms:Annotations/oms:SimulationInformation/oms:FixedStepMaster", NAMESPACES)
        assert annotation.get("type") == "org.openmodelica"
        assert (master.get("description"), master.get("stepSize")) == ("oms-ma", found)


def in_fmpy(package, times, command):
    """FMPy's rows: values at the end of the step that begins at their time. Its command comes one step late."""
    feed = dict(zip(times, command[1:]))
    return simulate_ssp(str(package), stop_time=times[-1], step_size=times[1], input={"u": lambda t: feed.get(t, 0.0)})


AT_REST = ["--set", "cart_friction.c3=0", "--set", "cart_friction.c5=0"]


@pytest.mark.parametrize(
    "system, at_rest",
    [("01", AT_REST), ("amended", [*AT_REST, "--set", "effect_cart_spring.spring_rest=0"])],
    indirect=["system"],
    ids=["01", "amended"],
)
def test_fmpy_runs_the_default_package_to_the_same_bits(system, at_rest, tmp_path):
    """FMPy's first step has 0 at all connectors, and it reads no parameter sets. Where all forces are 0 at rest its
    first step is ours: then only the start values inside the FMUs can make the same numbers."""
    package = exported(system, tmp_path / "system.ssp", *at_rest)
    command = sine(TIMES)
    ours = run(tmp_path / "ours", package, repr(STEP), TIMES, command, "jacobi")
    theirs = in_fmpy(package, TIMES, command)
    found = {name: float(np.max(np.abs(ours[name][1:] - theirs[name]))) for name in SIGNALS}
    assert found == dict.fromkeys(SIGNALS, 0.0)
    assert np.ptp(theirs["cart_pole.x"]) > 0.01


@EVERY_SYSTEM
def test_fmpy_runs_every_default_package_but_for_its_first_step(system, tmp_path):
    """What 0 at all connectors makes in one step; in the closed loop of example 03, in the one sample of its
    controller."""
    package = exported(system, tmp_path / "system.ssp")
    times = [k * STEP / 4 for k in range(1025)]
    command = [0.0] * len(times) if system.name == "closed_loop.ssd" else sine(times)
    ours = run(tmp_path, package, repr(times[1]), times, None if not any(command) else command, "jacobi")
    theirs = in_fmpy(package, times, command)
    errors = {name: float(np.max(np.abs(ours[name][1:] - theirs[name])) / np.ptp(ours[name])) for name in SIGNALS}
    # The force of a friction at rest for 0.5 ms is a velocity of up to 4 % of its range.
    assert max(errors.values()) < 0.05


def in_libcosim(package):
    """Signals after each step; libcosim passes on values at the start as ours does, and reads parameter sets."""
    pytest.importorskip("libcosimpy", reason="libcosimpy has wheels for x86-64 on Linux and Windows only")
    from libcosimpy.CosimEnums import CosimExecutionState
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(str(package), round(STEP * 1e9))
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    index = execution.slave_index_from_instance_name("cart_pole")
    names = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
    references = [names[signal.removeprefix("cart_pole.")] for signal in SIGNALS]
    rows = []
    for _ in range(STEPS):
        assert execution.step()
        rows.append(observer.last_real_values(index, references))
    assert execution.status().state != CosimExecutionState.ERROR.value
    return dict(zip(SIGNALS, np.array(rows).T))


def in_ecos(package):
    """Signals after each step; Ecos applies the parameter sets of the name that it is given."""
    try:
        if TBB.exists():
            ctypes.CDLL(str(TBB), mode=ctypes.RTLD_GLOBAL)
        from ecospy.EcosSimulation import EcosSimulation
    except (ImportError, OSError) as error:
        pytest.skip(f"Ecos cannot be loaded ({error}): scripts/setup.sh test installs it on Debian")

    with EcosSimulation(step_size=STEP, ssp_path=str(package)) as simulation:
        simulation.init(parameter_set="initialValues")
        rows = []
        for _ in range(STEPS):
            simulation.step()
            rows.append([simulation.get_real(signal.replace(".", "::")) for signal in SIGNALS])
        simulation.terminate()
    return dict(zip(SIGNALS, np.array(rows).T))


@EVERY_SYSTEM
@pytest.mark.parametrize("tool, simulate", [("libcosim", in_libcosim), ("ecos", in_ecos)], ids=["libcosim", "ecos"])
def test_other_masters_run_every_package_to_our_numbers(system, tool, simulate, tmp_path):
    constant = [] if system.name == "closed_loop.ssd" else ["--set", "u=15"]
    package = exported(system, tmp_path / "system.ssp", "--for", tool, *constant)
    ours = run(tmp_path / "ours", package, repr(STEP), TIMES, None, "jacobi")
    theirs = simulate(package)
    found = {name: float(np.max(np.abs(ours[name][1:] - theirs[name]))) for name in SIGNALS}
    assert max(found.values()) <= CLOSE
    assert np.ptp(ours["cart_pole.x"]) > 1e-3
