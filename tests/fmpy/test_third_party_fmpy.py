"""FMPy and this project's masters: a loop written by hand over FMPy's slaves, and its schemas of SSP files."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from lxml import etree

from pneumatic import CART, CONNECTIONS, FMUS, SYSTEM, airloop, at_start_of_interval, differences, run, sine

PARAMETER_SET = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}ParameterSet"
STEPS = 2000
RECORDED = [
    ("actuator", "F_hat"),
    ("actuator", "F_act"),
    ("piston_friction", "F_out"),
    ("piston_friction", "f"),
    ("cart_friction", "F_out"),
    ("cart_pole", "x"),
    ("cart_pole", "theta"),
    ("cart_pole", "v"),
    ("cart_pole", "omega"),
    ("cart_pole", "a"),
    ("cart_pole", "energy"),
]


class Slaves:
    """The four slaves in initialization mode and after, by component and variable name."""

    def __init__(self, shipped):
        self.slaves, self.references = {}, {}
        for component, name in FMUS.items():
            unit = shipped(name)
            description = fmpy.read_model_description(str(unit.path))
            self.references[component] = {v.name: v.valueReference for v in description.modelVariables}
            self.slaves[component] = FMU2Slave(
                guid=description.guid,
                unzipDirectory=str(unit.folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=component,
            )
            self.slaves[component].instantiate()

    def get(self, component, variable):
        return self.slaves[component].getReal([self.references[component][variable]])[0]

    def set(self, component, variable, value):
        self.slaves[component].setReal([self.references[component][variable]], [value])

    def pass_on(self, outputs, components):
        """Sets the connected inputs of some components from a table of outputs."""
        for source, output, target, variable in CONNECTIONS:
            if target in components:
                self.set(target, variable, outputs[source, output])

    def outputs(self, components):
        connected = {(source, output) for source, output, _, _ in CONNECTIONS}
        return {key: self.get(*key) for key in connected if key[0] in components}

    def free(self):
        for slave in self.slaves.values():
            slave.terminate()
            # Without FMPy's unloading of the library, which other tests of this process use.
            slave.fmi2FreeInstance(slave.component)


def hand_written(shipped, step, times, command, serial):
    """Columns of RECORDED at all times; the co-simulation loop of a textbook."""
    system = Slaves(shipped)
    try:
        for name, value in CART.items():
            system.set("cart_friction", name, value)
        for slave in system.slaves.values():
            slave.setupExperiment(startTime=0.0, stopTime=times[-1])
            slave.enterInitializationMode()
        system.set("actuator", "u", command[0])
        for _ in range(len(FMUS)):
            for component in FMUS:
                system.pass_on(system.outputs(FMUS), [component])
        for slave in system.slaves.values():
            slave.exitInitializationMode()
        columns = {key: [system.get(*key)] for key in RECORDED}
        for time, u in zip(times[:-1], command):
            system.set("actuator", "u", u)
            outputs = system.outputs(FMUS)
            if not serial:
                system.pass_on(outputs, FMUS)
            for component in FMUS:
                if serial:
                    system.pass_on(outputs, [component])
                system.slaves[component].doStep(time, step)
                if serial:
                    outputs.update(system.outputs([component]))
            for key in RECORDED:
                columns[key].append(system.get(*key))
        return at_start_of_interval(columns)
    finally:
        system.free()


@pytest.mark.parametrize("master", ["gauss-seidel", "jacobi"])
def test_a_hand_written_loop_gives_the_same_bits(shipped, tmp_path, master):
    times = [k / 1000 for k in range(STEPS + 1)]
    command = sine(times)
    ours = run(tmp_path, SYSTEM, "1ms", times, command, master)
    theirs = hand_written(shipped, 1e-3, times, command, master == "gauss-seidel")
    found = differences(ours, theirs)
    assert found == dict.fromkeys(found, 0.0)
    assert np.ptp(ours["cart_pole.x"]) > 0.01


def test_the_two_loops_are_not_the_same(shipped):
    """The test above could not tell the masters apart if they agreed anyway."""
    times = [k / 1000 for k in range(101)]
    serial, parallel = (hand_written(shipped, 1e-3, times, sine(times), kind) for kind in (True, False))
    assert serial["cart_pole", "v"] != parallel["cart_pole", "v"]


def check(trees, version):
    """Descriptions and parameter sets, also those inside descriptions, against the schemas that come with FMPy."""
    schemas = Path(fmpy.__file__).parent / "ssp" / "schema"
    schema = {
        ending: etree.XMLSchema(etree.parse(str(schemas / f"SystemStructure{kind}.xsd")))
        for ending, kind in {"ssd": "Description", "ssv": "ParameterValues"}.items()
    }
    for file, tree in trees.items():
        found = [("ssv", element) for element in tree.getroot().iter(PARAMETER_SET)]
        if file.suffix == ".ssd":
            found.insert(0, ("ssd", tree.getroot()))
        for kind, element in found:
            assert element.get("version") == version
            element.set("version", "1.0")
            schema[kind].assertValid(etree.fromstring(etree.tostring(element)))


@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize("name", ["amended.ssd", "amended.ssp"])
def test_written_systems_follow_the_schema(tmp_path, version, name):
    """The schema of SSP 1.0; what a cart-pole needs of 2.0 differs from it in the version attribute only."""
    path = tmp_path / name
    airloop("export", SYSTEM, "--set", "cart_pole.m_p=0.12", "-o", path, "--ssp-version", version)
    folder = path.parent
    if name.endswith(".ssp"):
        folder = tmp_path / "unpacked"
        fmpy.extract(str(path), str(folder))
    trees = {file: etree.parse(str(file)) for ending in ("ssd", "ssv") for file in folder.rglob(f"*.{ending}")}
    assert len(trees) == (3 if name.endswith(".ssp") else 1)
    check(trees, version)


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_every_type_of_connector_follows_the_schema(shipped, tmp_path, version):
    """A single FMU with Enumerations, Strings, Booleans and Integers."""
    path = tmp_path / "types.ssd"
    airloop("export", shipped("test-all-types").path, "-o", path, "--ssp-version", version)
    tree = etree.parse(str(path))
    common = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
    found = {element.tag.removeprefix(common) for element in tree.iter(f"{common}*")}
    assert {"Real", "Integer", "Boolean", "String", "Enumeration", "Item"} <= found
    check({path: tree}, version)
