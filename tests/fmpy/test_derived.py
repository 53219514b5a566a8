"""Derived FMUs: the library of a template with other start values, name and GUID.

What a derived FMU computes is compared with the template whose values are set one by one through FMI. `resources` is then
made wrong in every way, and the library must say so.
"""

import hashlib
import math
import zipfile
from dataclasses import replace

import fmpy
import fmpy.validation
import numpy as np
import pytest
from lxml import etree

import raw
import scenario
from command import airloop, start
from fmu import Fmu
from test_description import SCHEMAS
from test_reference import coefficients, recursion

A1, B0, B1 = coefficients("toe")
TOE = {f"A1[{i + 1},{j + 1}]": float(A1[i, j]) for i in range(2) for j in range(2)}
TOE |= {f"B{k}[{i + 1}]": float(b[i]) for k, b in enumerate((B0, B1)) for i in range(2)}
ALL_TYPES = {
    "gain": "-2.5",
    "shift": "-7",
    "invert": "true",
    "prefix": 'a "quoted" ä \\ <text>',
    "fault_time": "1e3",
    "u_enumeration": "third",
}
START_VALUES = "start_values.toml"


def derive(template, out, values, **options):
    sets = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
    airloop("derive", template.path, *sets, *(f"--{k}={v}" for k, v in options.items()), "-o", out)
    return out


@pytest.fixture(scope="module")
def toe(shipped, tmp_path_factory):
    folder = tmp_path_factory.mktemp("toe")
    values = {name: repr(value) for name, value in TOE.items()} | {"z[1]": "1.5"}
    path = derive(shipped("arx-actuator"), folder / "toe.fmu", values, name="the toe", description="Eq. 12 <&>")
    return Fmu(path, folder / "unpacked")


@pytest.fixture(scope="module")
def all_types(shipped, tmp_path_factory):
    folder = tmp_path_factory.mktemp("types")
    return Fmu(derive(shipped("test-all-types"), folder / "types.fmu", ALL_TYPES), folder / "unpacked")


def test_description_is_valid_and_says_what_the_fmu_is(toe, all_types, shipped):
    for fmu, template in ((toe, "arx-actuator"), (all_types, "test-all-types")):
        assert fmpy.validation.validate_fmu(str(fmu.path)) == []
        etree.XMLSchema(etree.parse(str(SCHEMAS / "fmi2ModelDescription.xsd"))).assertValid(fmu.xml.getroottree())
        assert fmu.guid != shipped(template).guid
        assert "0 errors, 0 warnings" in airloop("inspect", "--check", fmu.path)
    assert (toe.xml.get("modelName"), toe.xml.get("description")) == ("the toe", "Eq. 12 <&>")
    assert "generationDateAndTime" not in toe.xml.attrib
    starts = {v.name: v.start for v in all_types.variables}
    assert starts["gain"] == -2.5 and starts["shift"] == -7 and starts["invert"] is True
    assert starts["prefix"] == ALL_TYPES["prefix"] and starts["u_enumeration"] == 3


def without_start(variable):
    return replace(variable, attributes={k: v for k, v in variable.attributes.items() if k != "start"})


def test_all_but_names_and_start_values_is_that_of_the_template(toe, shipped):
    template = shipped("arx-actuator")
    given = {**TOE, "z[1]": 1.5}
    for ours, theirs in zip(toe.variables, template.variables, strict=True):
        assert ours.start == given.get(ours.name, theirs.start), ours.name
        assert without_start(ours) == without_start(theirs)
    for tag in ("UnitDefinitions", "TypeDefinitions", "ModelStructure", "CoSimulation", "ModelExchange"):
        assert etree.tostring(toe.xml.find(tag)) == etree.tostring(template.xml.find(tag))
    assert toe.binary.read_bytes() == template.binary.read_bytes()


def test_equal_derivations_give_equal_bytes_and_others_another_guid(toe, shipped, tmp_path):
    template = shipped("arx-actuator")
    values = {name: repr(value) for name, value in TOE.items()} | {"z[1]": "1.5"}
    options = dict(name="the toe", description="Eq. 12 <&>")
    again = derive(template, tmp_path / "again.fmu", dict(reversed(values.items())), **options)
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(toe.path.read_bytes()).digest()
    guids = {toe.guid}
    for number, change in enumerate([{"nk": "1"}, {"B0[1]": "0.63"}]):
        other = derive(template, tmp_path / f"{number}.fmu", values | change, **options)
        guids.add(Fmu(other, tmp_path / str(number)).guid)
    named = derive(template, tmp_path / "named.fmu", values, name="another", description="Eq. 12 <&>")
    guids.add(Fmu(named, tmp_path / "named").guid)
    assert len(guids) == 4


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_it_to_the_numbers_of_the_template_with_these_values_set(toe, shipped, interface):
    time = np.arange(0.0, 0.3, 1e-3)
    signal = np.zeros(len(time), dtype=[("time", float), ("u", float)])
    signal["time"], signal["u"] = time, [30 * math.sin(40 * t) for t in time]
    options = dict(fmi_type=interface, input=signal, stop_time=0.3, output_interval=1e-3, output=["F_hat", "F_act"])
    ours = fmpy.simulate_fmu(str(toe.path), **options)
    values = {**TOE, "z[1]": 1.5}
    theirs = fmpy.simulate_fmu(str(shipped("arx-actuator").path), start_values=values, **options)
    plain = fmpy.simulate_fmu(str(shipped("arx-actuator").path), **options)
    assert np.array_equal(ours, theirs)
    assert np.max(np.abs(ours["F_act"] - plain["F_act"])) > 1.0


def outputs(fmu, instance, commands):
    rows = []
    for k, u in enumerate(commands):
        instance.set([fmu.variable("u")], [u])
        instance.must("DoStep", k * 1e-3, 1e-3, 0)
        rows.append(instance.get([fmu.variable("F_hat"), fmu.variable("F_act")]))
    return np.array(rows)


def test_it_is_the_recursion_of_eq_12_before_and_after_a_reset(toe):
    commands = [10 * math.sin(0.1 * k) for k in range(200)]
    expected = recursion(commands, A1, B0, B1)
    with toe.instantiate(raw.CO_SIMULATION) as instance:
        for _ in range(2):
            instance.initialize(set_first=([toe.variable("z[1]")], [0.0]))
            assert np.max(np.abs(outputs(toe, instance, commands) - expected)) < 1e-11
            instance.must("Reset")
        instance.initialize()
        assert instance.get([toe.variable("z[1]"), toe.variable("B0[1]")]) == [1.5, 0.6297]


def test_start_values_of_every_type_reach_the_equations(all_types):
    with all_types.instantiate(raw.CO_SIMULATION) as instance:
        instance.initialize()
        names = ["y_integer", "y_boolean", "y_string", "y_enumeration"]
        values = instance.get([all_types.variable(n) for n in names])
        shift = instance.get([all_types.variable("u_integer")])[0] - 7
        boolean = not instance.get([all_types.variable("u_boolean")])[0]
        text = ALL_TYPES["prefix"] + instance.get([all_types.variable("u_string")])[0]
    assert values == [shift, boolean, text, 3]


def test_a_derived_fmu_can_be_derived_again(toe, shipped, tmp_path):
    path = derive(toe, tmp_path / "later.fmu", {"nk": "2", "B0[1]": "0.5"}, description="Two samples later")
    later = Fmu(path, tmp_path / "later")
    values = {**TOE, "z[1]": 1.5, "nk": 2, "B0[1]": 0.5}
    assert {v.name: v.start for v in later.variables if v.name in values} == values
    ours = scenario.co_simulation(later, 30, 1e-3)
    theirs = scenario.co_simulation(shipped("arx-actuator"), 30, 1e-3, parameters=values)
    assert [raw.bits(row) for row in ours] == [raw.bits(row) for row in theirs]


def test_a_state_does_not_pass_between_template_and_derived_fmu(toe, shipped):
    with shipped("arx-actuator").instantiate(raw.CO_SIMULATION) as other, toe.instantiate(raw.CO_SIMULATION) as own:
        other.initialize(), own.initialize()
        data = other.serialize(other.get_state())
        with pytest.raises(raw.BadStatus):
            own.deserialize(data)
        assert "state of another FMU" in own.messages[-1][3]


# -- wrong resources ------------------------------------------------------------------------------------------------------


def refusal(fmu, folder, guid=None):
    """Message of the library when it refuses an instance with these resources."""
    instance = raw.Instance(fmu, raw.CO_SIMULATION, guid=guid, resources=folder.as_uri())
    assert not instance.component
    return "\n".join(text for *_, text in instance.messages)


def test_the_guid_must_be_that_of_the_resources(toe, shipped):
    base = shipped("arx-actuator").guid
    assert toe.guid in refusal(toe, toe.resources, guid=base)
    # Without its resources the library is that of the template.
    assert "fmuResourceLocation" in refusal(toe, toe.folder)


def test_resources_of_another_library_are_refused(toe, shipped, tmp_path):
    text = (toe.resources / START_VALUES).read_text()
    other = shipped("friction").guid
    (tmp_path / START_VALUES).write_text(text.replace(shipped("arx-actuator").guid, other))
    assert other in refusal(toe, tmp_path) and "derive the FMU again" in refusal(toe, tmp_path)


@pytest.mark.parametrize(
    "line, expected",
    [
        ('"A1[1,9]" = 1.0', "no variable `A1[1,9]`"),
        ('"F_hat" = 1.0', "`F_hat` is computed"),
        ('"B1[1]" = true', "allowed: a Real"),
        ('"B1[1]" = nan', "finite"),
        ("sample_time = -1.0", "allowed: a Real in 1e-9.."),
        ("nk = 65", "allowed: an Integer in 0..64"),
        ("nk = 1.0", "allowed: an Integer"),
        ("realization = 3", "allowed: an item number in 1..2"),
        ("nk = 99999999999", "allowed: an Integer in 0..64"),
        ("nk 3", "name = value"),
    ],
)
def test_wrong_start_values_are_refused_with_file_line_and_what_is_allowed(toe, tmp_path, line, expected):
    head = (toe.resources / START_VALUES).read_text().split("[start]")[0]
    (tmp_path / START_VALUES).write_text(f"{head}[start]\n{line}\n")
    message = refusal(toe, tmp_path)
    assert f"resources/{START_VALUES}, line {len(head.splitlines()) + 2}" in message and expected in message, message


# -- the command ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments, expected",
    [
        (["--set", "a1[1,1]=1"], "there is `A1[1,1]`"),
        (["--set", "F_hat=1"], "computed by the model"),
        (["--set", "nk=65"], "a whole number from 0 to 64"),
        (["--set", "nk=1", "--set", "nk=2"], "given twice"),
        (["--set", "B0[1]=nan"], "a finite number"),
        (["--set", "realization=fast"], "1 (sampled), 2 (continuous)"),
        (["--name", " "], "it is empty"),
    ],
)
def test_the_command_refuses_what_does_not_fit_and_writes_nothing(shipped, tmp_path, arguments, expected):
    out = tmp_path / "out.fmu"
    outcome = start("derive", shipped("arx-actuator").path, *arguments, "-o", out)
    assert outcome.returncode == 1 and expected in outcome.stderr, outcome.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_fmu_of_another_exporter_is_refused(shipped, tmp_path):
    third_party = tmp_path / "third_party.fmu"
    with zipfile.ZipFile(shipped("friction").path) as old, zipfile.ZipFile(third_party, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b'generationTool="airloop fmi-export"', b'generationTool="other"'))
    outcome = start("derive", third_party, "-o", tmp_path / "out.fmu")
    assert outcome.returncode == 1 and 'generationTool is "other"' in outcome.stderr
