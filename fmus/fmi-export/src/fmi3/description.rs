//! The text of `modelDescription.xml` of FMI 3.0.

use super::references::{self, Meaning};
use crate::model::Identity;
use crate::shared_description::{
    default_experiment, dependencies, document, items, log_categories, named, root, typed, units,
};
use crate::structure::{Structure, Unknown};
use crate::table::{Kind, Table, Variable};
use crate::xml::{Element, Xml};

/// `modelDescription.xml` with the given instantiation token.
pub fn text(identity: &Identity, table: &Table, structure: &Structure, token: &str) -> String {
    let mut x = document();
    x.open(root("3.0", identity, ("instantiationToken", token)));
    interfaces(&mut x, identity);
    units(&mut x, &table.units());
    types(&mut x, table);
    log_categories(&mut x, super::names::in_message);
    default_experiment(&mut x, identity);
    x.open(Element::new("ModelVariables"));
    x.empty(
        Element::new("Float64")
            .with("name", free_name(table, "time"))
            .with("valueReference", Meaning::Time.reference(0))
            .with("description", "independent variable")
            .with("causality", "independent")
            .with("variability", "continuous"),
    );
    for v in table.variables() {
        variable(&mut x, table, v);
    }
    for number in 0..table.number_of_event_indicators() {
        x.empty(
            Element::new("Float64")
                .with("name", free_name(table, &format!("event_indicator[{}]", number + 1)))
                .with("valueReference", Meaning::Indicator.reference(number as u32))
                .with("causality", "local")
                .with("variability", "continuous")
                .with("initial", "calculated"),
        );
    }
    x.close("ModelVariables");
    x.open(Element::new("ModelStructure"));
    unknowns(&mut x, table, "Output", &structure.outputs);
    unknowns(&mut x, table, "ContinuousStateDerivative", &structure.derivatives);
    unknowns(&mut x, table, "InitialUnknown", &structure.initial_unknowns);
    for number in 0..table.number_of_event_indicators() {
        let reference = Meaning::Indicator.reference(number as u32);
        x.empty(Element::new("EventIndicator").with("valueReference", reference));
    }
    x.close("ModelStructure");
    x.close("fmiModelDescription");
    x.text
}

/// A name that no variable of the table has.
fn free_name(table: &Table, wanted: &str) -> String {
    let mut name = wanted.to_owned();
    while table.variables().iter().any(|variable| variable.name == name) {
        name.insert(0, '_');
    }
    name
}

fn interfaces(x: &mut Xml, identity: &Identity) {
    let common = |element: Element| {
        element
            .with("modelIdentifier", identity.model_identifier)
            .with("canGetAndSetFMUState", true)
            .with("canSerializeFMUState", true)
            .with("providesDirectionalDerivatives", true)
            .with("providesAdjointDerivatives", true)
    };
    x.empty(common(Element::new("ModelExchange")).with("needsCompletedIntegratorStep", false));
    x.empty(
        common(Element::new("CoSimulation"))
            .with("canHandleVariableCommunicationStepSize", true)
            .with("maxOutputDerivativeOrder", 1),
    );
}

fn types(x: &mut Xml, table: &Table) {
    if table.enumerations().is_empty() {
        return;
    }
    x.open(Element::new("TypeDefinitions"));
    for enumeration in table.enumerations() {
        x.open(Element::new("EnumerationType").with("name", enumeration.name));
        items(x, enumeration);
        x.close("EnumerationType");
    }
    x.close("TypeDefinitions");
}

fn variable(x: &mut Xml, table: &Table, v: &Variable) {
    let (mut state, mut text) = (None, None);
    let name = match &v.kind {
        Kind::Real { derivative_of, .. } => {
            state = derivative_of.map(|state| Meaning::Real.reference(state.0));
            "Float64"
        }
        Kind::Integer { .. } => "Int32",
        Kind::Boolean { .. } => "Boolean",
        Kind::Enumeration { .. } => "Enumeration",
        Kind::Text { start, .. } => {
            text = start.as_ref();
            "String"
        }
    };
    let element = typed(named(name, v, references::of(&v.kind)), v, table.enumerations(), state);
    let Some(text) = text else { return x.empty(element) };
    x.open(element);
    x.empty(Element::new("Start").with("value", text));
    x.close("String");
}

fn unknowns(x: &mut Xml, table: &Table, name: &'static str, unknowns: &[Unknown]) {
    let reference = |index: usize| references::of(&table.variables()[index].kind);
    for unknown in unknowns {
        let element = Element::new(name).with("valueReference", reference(unknown.variable));
        x.empty(dependencies(element, unknown, |index| reference(index).to_string()));
    }
}
