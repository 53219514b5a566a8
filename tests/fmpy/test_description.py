"""The model description: the rules of FMI 2.0, written again from the standard and not taken from a validator."""

import math
import re
from pathlib import Path

import fmpy
import fmpy.validation
import pytest
from lxml import etree

import raw
from fmu import DEFAULT_INITIAL

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi2"

# FMI 2.0.4, section 2.2.7: the values of `initial` that each pair (causality, variability) allows.
ALLOWED_INITIAL = {
    ("parameter", "fixed"): {"exact"},
    ("parameter", "tunable"): {"exact"},
    ("calculatedParameter", "fixed"): {"approx", "calculated"},
    ("calculatedParameter", "tunable"): {"approx", "calculated"},
    ("input", "discrete"): {None},
    ("input", "continuous"): {None},
    ("output", "constant"): {"exact"},
    ("output", "discrete"): {"exact", "approx", "calculated"},
    ("output", "continuous"): {"exact", "approx", "calculated"},
    ("local", "constant"): {"exact"},
    ("local", "fixed"): {"approx", "calculated"},
    ("local", "tunable"): {"approx", "calculated"},
    ("local", "discrete"): {"exact", "approx", "calculated"},
    ("local", "continuous"): {"exact", "approx", "calculated"},
    ("independent", "continuous"): {None},
}

# SI base-unit exponents of the unit names in use: what each must declare, from a table of units and not from the code.
BASE_UNITS = {
    "Hz": {"s": -1},
    "N.m.s2/rad2": {"kg": 1, "m": 2, "rad": -2},
    "1": {},
    "J": {"kg": 1, "m": 2, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "N.m.s": {"kg": 1, "m": 2, "s": -1},
    "N.s/m": {"kg": 1, "s": -1},
    "N/m": {"kg": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Pa/s": {"kg": 1, "m": -1, "s": -3},
    "1/Pa": {"kg": -1, "m": 1, "s": 2},
    "1/(Pa.s)": {"kg": -1, "m": 1, "s": 1},
    "J/(kg.K)": {"m": 2, "s": -2, "K": -1},
    "K": {"K": 1},
    "kg/s": {"kg": 1, "s": -1},
    "m3": {"m": 3},
    "1/s2": {"s": -2},
    "bar": {"kg": 1, "m": -1, "s": -2},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "N.s": {"kg": 1, "m": 1, "s": -1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m/s3": {"m": 1, "s": -3},
    "m2": {"m": 2},
    "N/s": {"kg": 1, "m": 1, "s": -3},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "s": {"s": 1},
    "1/s": {"s": -1},
    "s/m": {"s": 1, "m": -1},
}


def test_fmpy_finds_no_problem(fmu):
    assert fmpy.validation.validate_fmu(str(fmu.path)) == []


def test_validates_against_the_schema_of_fmi_2(fmu):
    schema = etree.XMLSchema(etree.parse(str(SCHEMAS / "fmi2ModelDescription.xsd")))
    schema.assertValid(fmu.xml.getroottree())


def test_states_version_guid_tool_and_default_experiment(fmu):
    assert fmu.xml.get("fmiVersion") == "2.0"
    for attribute in ("guid", "modelName", "description", "version", "generationTool"):
        assert fmu.xml.get(attribute), attribute
    experiment = fmu.xml.find("DefaultExperiment")
    begin = float(experiment.get("startTime", "0"))
    assert begin < float(experiment.get("stopTime"))
    assert float(experiment.get("stepSize")) > 0


def test_has_both_interfaces_with_one_model_identifier(fmu):
    both = [fmu.interface("CoSimulation"), fmu.interface("ModelExchange")]
    assert None not in both
    assert both[0].get("modelIdentifier") == both[1].get("modelIdentifier")


def test_names_are_unique_and_follow_the_declared_convention(fmu):
    names = [v.name for v in fmu.variables]
    assert len(set(names)) == len(names)
    if fmu.xml.get("variableNamingConvention", "flat") == "structured":
        # FMI 2.0.4, section 2.2.9, without quoted names.
        part = r"[A-Za-z_]\w*(\[\d+(,\d+)*\])?"
        name = rf"{part}(\.{part})*"
        pattern = re.compile(rf"^({name}|der\({name}(,\d+)?\))$", re.ASCII)
        assert [n for n in names if not pattern.match(n)] == []


def test_value_references_are_unique_but_for_rates_that_are_outputs(fmu):
    """A rate of a state that is an output has a local alias, which is what carries `derivative`."""
    base = {"Enumeration": "Integer"}
    holders = {}
    for v in fmu.variables:
        holders.setdefault((base.get(v.type, v.type), v.reference), []).append(v)
    for shared in (variables for variables in holders.values() if len(variables) > 1):
        output, alias = shared
        assert (output.causality, alias.causality) == ("output", "local")
        assert alias.name.startswith("der(") and alias.description == f"alias of {output.name}"


def test_causality_variability_initial_are_a_legal_triple(fmu):
    for v in fmu.variables:
        pair = (v.causality, v.variability)
        assert pair in ALLOWED_INITIAL, f"{v.name}: {pair}"
        assert v.initial in ALLOWED_INITIAL[pair], f"{v.name}: {pair} with {v.initial}"
        assert v.declared_initial is None or DEFAULT_INITIAL[pair] is not None, f"{v.name}: initial is not allowed here"
        assert v.variability != "continuous" or v.is_real, f"{v.name}: only a Real can be continuous"


def test_start_stands_exactly_where_it_has_to(fmu):
    for v in fmu.variables:
        needed = v.initial in ("exact", "approx") or v.causality == "input" or v.variability == "constant"
        assert (v.start is not None) == needed, f"{v.name}: start {v.start!r}, initial {v.initial}"


def test_start_lies_between_min_and_max(fmu):
    for v in fmu.variables:
        if v.type in ("Boolean", "String"):
            continue
        low, high = v.number("min"), v.number("max")
        assert low is None or high is None or low <= high, v.name
        if v.start is not None:
            assert math.isfinite(v.start), v.name
            assert low is None or low <= v.start, v.name
            assert high is None or v.start <= high, v.name


def test_nominals_are_positive(fmu):
    for v in fmu.variables:
        if v.is_real and v.number("nominal") is not None:
            assert v.number("nominal") > 0 and math.isfinite(v.number("nominal")), v.name


def test_inputs_and_states_declare_no_range(fmu):
    """A range there would stop an optimizer in the middle of its search."""
    for v in [*fmu.of("input"), *fmu.states]:
        if v.is_real:
            assert v.number("min") is None and v.number("max") is None, v.name


def test_every_variable_has_a_description(fmu):
    assert [v.name for v in fmu.variables if not v.description] == []


def test_units_are_defined_with_their_base_units(fmu):
    defined = {u.get("name"): u for u in fmu.xml.iterfind("UnitDefinitions/Unit")}
    used = {v.attributes["unit"] for v in fmu.variables if "unit" in v.attributes}
    assert used - set(defined) == set(), "used without definition"
    assert set(defined) - used == set(), "defined without use"
    for name in used:
        base = defined[name].find("BaseUnit")
        assert base is not None, f"{name}: no BaseUnit"
        exponents = {k: int(e) for k, e in base.attrib.items() if k not in ("factor", "offset") and int(e) != 0}
        assert name in BASE_UNITS, f"{name}: add it to the table of this test"
        expected = BASE_UNITS[name]
        # A table may write an angle as 1 or as rad; both are right as long as the unit's name says it.
        assert exponents == expected, f"{name}: {exponents}, expected {expected}"
    for v in fmu.variables:
        display = v.attributes.get("displayUnit")
        if display is not None:
            names = {d.get("name") for d in defined[v.attributes["unit"]].iterfind("DisplayUnit")}
            assert display in names, f"{v.name}: {display}"


def test_outputs_are_complete_and_in_order(fmu):
    assert [v.name for v, _, _ in fmu.unknowns("Outputs")] == [v.name for v in fmu.of("output")]


def test_derivatives_are_complete_in_order_and_point_at_states(fmu):
    with_attribute = [v.name for v in fmu.variables if v.attributes.get("derivative") is not None]
    assert [v.name for v in fmu.derivatives] == with_attribute
    assert len({s.name for s in fmu.states}) == len(fmu.derivatives)
    for derivative, state in zip(fmu.derivatives, fmu.states):
        assert derivative.is_real and state.is_real
        assert derivative.variability == state.variability == "continuous"
        assert state.causality in ("local", "output") and derivative.causality in ("local", "output")


def test_initial_unknowns_are_exactly_those_that_the_model_computes(fmu):
    states = {s.name for s in fmu.states}
    derivatives = {d.name for d in fmu.derivatives}
    expected = [
        v.name
        for v in fmu.variables
        if v.initial in ("approx", "calculated")
        and (v.causality in ("output", "calculatedParameter") or v.name in states | derivatives)
    ]
    assert [v.name for v, _, _ in fmu.unknowns("InitialUnknowns")] == expected


@pytest.mark.parametrize("tag", ["Outputs", "Derivatives", "InitialUnknowns"])
def test_dependencies_are_stated_with_their_kinds(fmu, tag):
    states = {s.name for s in fmu.states}
    for unknown, dependencies, kinds in fmu.unknowns(tag):
        assert dependencies is not None, f"{unknown.name}: no dependencies (which would mean: on everything)"
        assert kinds is not None or not dependencies, f"{unknown.name}: no dependenciesKind"
        kinds = kinds or []
        assert len(kinds) == len(dependencies), unknown.name
        indices = [d.index for d in dependencies]
        assert indices == sorted(set(indices)), f"{unknown.name}: not ascending or not unique"
        allowed = {"dependent", "constant"}
        if tag != "InitialUnknowns":
            allowed |= {"fixed", "tunable", "discrete"}
        for known, kind in zip(dependencies, kinds):
            assert kind in allowed, f"{unknown.name} <- {known.name}: {kind}"
            assert kind == "dependent" or unknown.is_real, f"{unknown.name}: {kind} is for Reals"
            if tag == "InitialUnknowns":
                legal = known.causality == "input" or known.initial == "exact" or known.causality == "independent"
            else:
                legal = known.causality in ("input", "independent") or known.name in states
                legal = legal or (known.variability == "discrete" and known.causality in ("local", "output"))
                legal = legal or (known.causality == "parameter" and known.variability == "tunable")
            assert legal, f"{unknown.name} <- {known.name}: not a known of {tag}"


def test_number_of_event_indicators_is_stated(fmu):
    assert fmu.xml.get("numberOfEventIndicators") is not None


def test_log_categories_of_the_standard_are_declared(fmu):
    declared = {c.get("name") for c in fmu.xml.iterfind("LogCategories/Category")}
    assert {"logAll", "logStatusError", "logStatusWarning"} <= declared
    undescribed = [c.get("name") for c in fmu.xml.iterfind("LogCategories/Category") if not c.get("description")]
    assert undescribed == []


# Each capability flag that an FMU may set to true, and the file of this suite whose tests call for it.
EXERCISED = {
    "canHandleVariableCommunicationStepSize": "test_do_step.py",
    "canInterpolateInputs": "test_input_derivatives.py",
    "canNotUseMemoryManagementFunctions": "test_life_cycle.py",
    "canGetAndSetFMUstate": "test_state.py",
    "canSerializeFMUstate": "test_state.py",
    "providesDirectionalDerivative": "test_directional.py",
    "completedIntegratorStepNotNeeded": "test_model_exchange.py",
}


@pytest.mark.parametrize("kind", [raw.CO_SIMULATION, raw.MODEL_EXCHANGE], ids=["cs", "me"])
def test_a_true_capability_flag_is_one_that_this_suite_exercises(fmu, kind):
    element = fmu.interface("CoSimulation" if kind == raw.CO_SIMULATION else "ModelExchange")
    claimed = {name for name, value in element.attrib.items() if value == "true"}
    assert claimed - set(EXERCISED) == set()
    for name in claimed:
        text = (Path(__file__).parent / EXERCISED[name]).read_text()
        assert f'"{name}"' in text, f"{EXERCISED[name]} does not ask for {name}"
    if element.get("maxOutputDerivativeOrder", "0") != "0":
        assert "maxOutputDerivativeOrder" in (Path(__file__).parent / "test_input_derivatives.py").read_text()
