//! The text of `modelDescription.xml` from the variable table and the dependency structure.
//!
//! No date stands in it, so that equal models give equal bytes.
//!
//! An output that is the derivative of a state appears twice: as output, and behind all variables of the table as a
//! local alias `der(state)` that has the attribute `derivative`. Importers such as CasADi take a variable for one of
//! both only.

use crate::model::Identity;
use crate::shared_description::{
    default_experiment, dependencies, document, items, log_categories, named, root, typed, units,
};
use crate::structure::{Structure, Unknown};
use crate::table::{Causality, Kind, Table, Variable};
use crate::xml::{Element, Xml};

pub use crate::shared_description::{causality, variability};
pub use crate::xml::{escape, number};

/// `modelDescription.xml` with the given GUID.
pub fn text(identity: &Identity, table: &Table, structure: &Structure, guid: &str) -> String {
    let mut x = document();
    x.open(
        root("2.0", identity, ("guid", guid))
            .with("numberOfEventIndicators", table.number_of_event_indicators()),
    );
    interfaces(&mut x, identity);
    units(&mut x, &table.units());
    types(&mut x, table);
    log_categories(&mut x, str::to_owned);
    default_experiment(&mut x, identity);
    x.open(Element::new("ModelVariables"));
    for variable in table.variables() {
        scalar_variable(&mut x, table, variable);
    }
    let rates = rates_among_outputs(table);
    for &rate in &rates {
        alias_of_rate(&mut x, table, &table.variables()[rate]);
    }
    x.close("ModelVariables");
    x.open(Element::new("ModelStructure"));
    // The position of an alias follows those of the table.
    let alias = |variable: usize| {
        rates.iter().position(|&rate| rate == variable).map(|at| table.variables().len() + at)
    };
    let in_place = |unknown: &Unknown| Unknown {
        variable: alias(unknown.variable).unwrap_or(unknown.variable),
        dependencies: unknown.dependencies.clone(),
    };
    let derivatives: Vec<Unknown> = structure.derivatives.iter().map(in_place).collect();
    let initial = &structure.initial_unknowns;
    let initial_aliases = initial.iter().filter(|unknown| alias(unknown.variable).is_some()).map(in_place);
    let initial: Vec<Unknown> = initial.iter().cloned().chain(initial_aliases).collect();
    unknowns(&mut x, "Outputs", &structure.outputs);
    unknowns(&mut x, "Derivatives", &derivatives);
    unknowns(&mut x, "InitialUnknowns", &initial);
    x.close("ModelStructure");
    x.close("fmiModelDescription");
    x.text
}

fn interfaces(x: &mut Xml, identity: &Identity) {
    x.empty(
        Element::new("ModelExchange")
            .with("modelIdentifier", identity.model_identifier)
            .with("completedIntegratorStepNotNeeded", true)
            .with("canNotUseMemoryManagementFunctions", true)
            .with("canGetAndSetFMUstate", true)
            .with("canSerializeFMUstate", true)
            .with("providesDirectionalDerivative", true),
    );
    x.empty(
        Element::new("CoSimulation")
            .with("modelIdentifier", identity.model_identifier)
            .with("canHandleVariableCommunicationStepSize", true)
            .with("canInterpolateInputs", true)
            .with("maxOutputDerivativeOrder", 1)
            .with("canRunAsynchronuously", false)
            .with("canNotUseMemoryManagementFunctions", true)
            .with("canGetAndSetFMUstate", true)
            .with("canSerializeFMUstate", true)
            .with("providesDirectionalDerivative", true),
    );
}

fn types(x: &mut Xml, table: &Table) {
    if table.enumerations().is_empty() {
        return;
    }
    x.open(Element::new("TypeDefinitions"));
    for enumeration in table.enumerations() {
        x.open(Element::new("SimpleType").with("name", enumeration.name));
        x.open(Element::new("Enumeration"));
        items(x, enumeration);
        x.close("Enumeration");
        x.close("SimpleType");
    }
    x.close("TypeDefinitions");
}

fn scalar_variable(x: &mut Xml, table: &Table, v: &Variable) {
    let (value_reference, name) = match &v.kind {
        Kind::Real { handle, .. } => (handle.0, "Real"),
        Kind::Integer { handle, .. } => (handle.0, "Integer"),
        Kind::Boolean { handle, .. } => (handle.0, "Boolean"),
        Kind::Text { handle, .. } => (handle.0, "String"),
        Kind::Enumeration { handle, .. } => (handle.0, "Enumeration"),
    };
    let (mut state, mut text) = (None, None);
    match &v.kind {
        Kind::Real { derivative_of, .. } if v.causality != Causality::Output => {
            state = derivative_of.map(|state| table.index_of(state) + 1);
        }
        Kind::Text { start, .. } => text = start.as_ref(),
        _ => {}
    }
    x.open(named("ScalarVariable", v, value_reference));
    x.empty(typed(Element::new(name), v, table.enumerations(), state).with_some("start", text));
    x.close("ScalarVariable");
}

/// Positions of the outputs that are derivatives of states.
fn rates_among_outputs(table: &Table) -> Vec<usize> {
    let variables = table.variables().iter().enumerate();
    let rates = variables.filter(|(_, v)| v.causality == Causality::Output && v.derivative_of().is_some());
    rates.map(|(position, _)| position).collect()
}

/// The local variable `der(state)` with the value of the output `v`.
fn alias_of_rate(x: &mut Xml, table: &Table, v: &Variable) {
    let (Kind::Real { handle, .. }, Some(state)) = (&v.kind, v.derivative_of()) else { return };
    let state = table.index_of(state);
    let alias = Variable {
        name: format!("der({})", table.variables()[state].name),
        description: format!("alias of {}", v.name),
        causality: Causality::Local,
        ..v.clone()
    };
    x.open(named("ScalarVariable", &alias, handle.0));
    x.empty(typed(Element::new("Real"), &alias, table.enumerations(), Some(state + 1)));
    x.close("ScalarVariable");
}

fn unknowns(x: &mut Xml, name: &'static str, unknowns: &[Unknown]) {
    if unknowns.is_empty() {
        return;
    }
    x.open(Element::new(name));
    for unknown in unknowns {
        let element = Element::new("Unknown").with("index", unknown.variable + 1);
        x.empty(dependencies(element, unknown, |index| (index + 1).to_string()));
    }
    x.close(name);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Definition, Model, Outcome, Real, Scalar, Values};

    /// A table with what needs care in XML.
    struct Awkward {
        x: Real,
        der_x: Real,
        on: crate::Boolean,
    }

    impl Model for Awkward {
        const IDENTITY: Identity = Identity {
            model_identifier: "awkward",
            model_name: "awkward",
            description: "a < b & \"c\"",
            version: "1",
            author: "me",
            generation_tool: "test",
            stop_time: 1.0,
            step_size: 1e-6,
        };
        fn declare(t: &mut Table) -> Self {
            t.input("label").text("<&\">");
            let x = t.state("x").unit("m").output().reinit().real(0.1);
            t.event_indicators(2);
            Self {
                x,
                der_x: t.derivative("der(x)", x).unit("m/s").computed(),
                on: t.output("on").computed_boolean(),
            }
        }
        fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
            q[self.der_x] = -q[self.x];
            q[self.on] = q[self.x].value() > 0.0;
            Ok(())
        }
    }

    #[test]
    fn attributes_stand_where_the_standard_wants_them() {
        let xml = Definition::<Awkward>::new().xml();
        for line in [
            "description=\"a &lt; b &amp; &quot;c&quot;\"",
            "numberOfEventIndicators=\"2\"",
            "<DefaultExperiment startTime=\"0\" stopTime=\"1\" tolerance=\"1e-8\" stepSize=\"1e-6\"/>",
            "name=\"label\" valueReference=\"0\" causality=\"input\" variability=\"discrete\">",
            "<String start=\"&lt;&amp;&quot;&gt;\"/>",
            "<Real unit=\"m\" start=\"0.1\" reinit=\"true\"/>",
            // x is the second variable, so the derivative points at index 2.
            "<Real unit=\"m/s\" derivative=\"2\"/>",
            "causality=\"output\" variability=\"discrete\" initial=\"calculated\">",
            "<Boolean/>",
            "<DisplayUnit name=\"mm\" factor=\"1000\"/>",
        ] {
            assert!(xml.contains(line), "{line}\nis not in\n{xml}");
        }
    }

    #[test]
    fn guid_changes_with_the_description_only() {
        let (a, b) = (Definition::<Awkward>::new(), Definition::<Awkward>::new());
        assert_eq!(a.guid, b.guid);
        assert_eq!(a.xml(), b.xml());
        assert!(a.xml().contains(&format!("guid=\"{}\"", a.guid)));
    }
}
