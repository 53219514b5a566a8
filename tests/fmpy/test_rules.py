"""The rules of `test_description.py` find the defects that they are for: each mutation of a sound FMU fails its rule.

Most of these pass the schema, FMPy's validator and the FMI compliance checker.
"""

import copy

import pytest

import raw
import test_description as rules
from fmu import Fmu


def variable(xml, name):
    return xml.find(f"ModelVariables/ScalarVariable[@name='{name}']")


def first(xml, tag):
    return xml.find(f"ModelStructure/{tag}/Unknown")


def drop(element):
    element.getparent().remove(element)


def swap(list_element):
    list_element.append(list_element[0])


MUTATIONS = {
    "start above max": (
        rules.test_start_lies_between_min_and_max,
        lambda xml: variable(xml, "m_p")[0].set("max", "0.05"),
    ),
    "min above max": (
        rules.test_start_lies_between_min_and_max,
        lambda xml: variable(xml, "m_p")[0].attrib.update({"min": "1", "max": "0", "start": "0.5"}),
    ),
    "start that is not finite": (
        rules.test_start_lies_between_min_and_max,
        lambda xml: variable(xml, "F")[0].set("start", "NaN"),
    ),
    "no start on an input": (
        rules.test_start_stands_exactly_where_it_has_to,
        lambda xml: variable(xml, "F")[0].attrib.pop("start"),
    ),
    "start on a computed output": (
        rules.test_start_stands_exactly_where_it_has_to,
        lambda xml: variable(xml, "energy")[0].set("start", "0"),
    ),
    "stop before start": (
        rules.test_states_version_guid_tool_and_default_experiment,
        lambda xml: xml.find("DefaultExperiment").set("stopTime", "-1"),
    ),
    "no number of event indicators": (
        rules.test_number_of_event_indicators_is_stated,
        lambda xml: xml.attrib.pop("numberOfEventIndicators"),
    ),
    "derivative of an input": (
        rules.test_derivatives_are_complete_in_order_and_point_at_states,
        lambda xml: variable(xml, "a")[0].set("derivative", "1"),
    ),
    "a derivative is not listed": (
        rules.test_derivatives_are_complete_in_order_and_point_at_states,
        lambda xml: drop(first(xml, "Derivatives")),
    ),
    "an output is not listed": (
        rules.test_outputs_are_complete_and_in_order,
        lambda xml: drop(first(xml, "Outputs")),
    ),
    "outputs out of order": (
        rules.test_outputs_are_complete_and_in_order,
        lambda xml: swap(xml.find("ModelStructure/Outputs")),
    ),
    "an initial unknown is not listed": (
        rules.test_initial_unknowns_are_exactly_those_that_the_model_computes,
        lambda xml: drop(first(xml, "InitialUnknowns")),
    ),
    "illegal initial": (
        rules.test_causality_variability_initial_are_a_legal_triple,
        lambda xml: variable(xml, "m_p").set("initial", "calculated"),
    ),
    "initial on an input": (
        rules.test_causality_variability_initial_are_a_legal_triple,
        lambda xml: variable(xml, "F").set("initial", "exact"),
    ),
    "a continuous parameter": (
        rules.test_causality_variability_initial_are_a_legal_triple,
        lambda xml: variable(xml, "m_p").set("variability", "continuous"),
    ),
    "two variables of one name": (
        rules.test_names_are_unique_and_follow_the_declared_convention,
        lambda xml: variable(xml, "m_p").set("name", "m_c"),
    ),
    "a name that is not structured": (
        rules.test_names_are_unique_and_follow_the_declared_convention,
        lambda xml: variable(xml, "m_p").set("name", "mass of the pole"),
    ),
    "two variables of one reference": (
        rules.test_value_references_are_unique_but_for_rates_that_are_outputs,
        lambda xml: variable(xml, "m_p").set("valueReference", variable(xml, "m_c").get("valueReference")),
    ),
    "wrong exponents of a unit": (
        rules.test_units_are_defined_with_their_base_units,
        lambda xml: xml.find("UnitDefinitions/Unit[@name='N']/BaseUnit").set("s", "2"),
    ),
    "a unit that is not defined": (
        rules.test_units_are_defined_with_their_base_units,
        lambda xml: drop(xml.find("UnitDefinitions/Unit[@name='N']")),
    ),
    "a range on an input": (
        rules.test_inputs_and_states_declare_no_range,
        lambda xml: variable(xml, "F")[0].set("max", "100"),
    ),
    "a nominal of zero": (
        rules.test_nominals_are_positive,
        lambda xml: variable(xml, "F")[0].set("nominal", "0"),
    ),
    "no log categories": (
        rules.test_log_categories_of_the_standard_are_declared,
        lambda xml: drop(xml.find("LogCategories")),
    ),
    "no GUID": (
        rules.test_states_version_guid_tool_and_default_experiment,
        lambda xml: xml.set("guid", ""),
    ),
    "dependencies without kinds": (
        lambda fmu: rules.test_dependencies_are_stated_with_their_kinds(fmu, "Derivatives"),
        lambda xml: xml.find("ModelStructure/Derivatives")[-1].attrib.pop("dependenciesKind"),
    ),
    "an untested capability": (
        lambda fmu: rules.test_a_true_capability_flag_is_one_that_this_suite_exercises(fmu, raw.CO_SIMULATION),
        lambda xml: xml.find("CoSimulation").set("canRunAsynchronuously", "true"),
    ),
}


@pytest.mark.parametrize("name", MUTATIONS)
def test_rule_finds(shipped, name):
    rule, mutate = MUTATIONS[name]
    sound = shipped("cart-pole")
    rule(sound)
    spoiled = object.__new__(Fmu)
    spoiled.path, spoiled.folder, spoiled.xml = sound.path, sound.folder, copy.deepcopy(sound.xml)
    mutate(spoiled.xml)
    with pytest.raises(AssertionError):
        rule(spoiled)
