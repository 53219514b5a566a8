//! `modelDescription.xml` of a system FMU.

use airloop_cosim::master::embedded::{Place, Value};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{DataType, Source};
use airloop_fmi::{Causality, InterfaceKind, UnitDefinition, Variability};
use fmi_export::description::escape;

use crate::recipe::Recipe;
use crate::table::{Role, Table, Variable, has, number};

/// Name of the library.
pub(crate) const IDENTIFIER: &str = "airloop_system";

/// The text, with the GUID of `recipe`.
pub(crate) fn text(graph: &SystemGraph, recipe: &Recipe, table: &Table) -> String {
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let controls = recipe.nmpc.is_some();
    let about = match controls {
        true => format!("Model predictive controller with a model of {} FMUs", graph.components.len()),
        false if recipe.integrates() => format!("{} with inputs at rates of its states", recipe.name),
        false => format!("System of {} FMUs", graph.components.len()),
    };
    let root = [
        ("fmiVersion", "2.0".to_owned()),
        ("modelName", recipe.name.clone()),
        ("guid", recipe.guid.clone()),
        ("description", about),
        ("generationTool", concat!("airloop export-fmu ", env!("CARGO_PKG_VERSION")).to_owned()),
        ("variableNamingConvention", "flat".to_owned()),
        ("numberOfEventIndicators", table.indicators.to_string()),
    ];
    element(&mut xml, 0, "fmiModelDescription", &root, ">");
    let states = saves_states(graph) && !controls;
    if has(graph, InterfaceKind::ModelExchange) && !controls {
        let flags = [
            ("modelIdentifier", IDENTIFIER.to_owned()),
            ("canNotUseMemoryManagementFunctions", "true".into()),
            ("canGetAndSetFMUstate", states.to_string()),
            ("canSerializeFMUstate", states.to_string()),
            ("providesDirectionalDerivative", differentiates(graph).to_string()),
        ];
        element(&mut xml, 1, "ModelExchange", &flags, "/>");
    }
    let steps = controls || recipe.integrates();
    if has(graph, InterfaceKind::CoSimulation) || steps {
        let flags = [
            ("modelIdentifier", IDENTIFIER.to_owned()),
            ("canHandleVariableCommunicationStepSize", (steps || accepts_any_step(graph)).to_string()),
            ("canNotUseMemoryManagementFunctions", "true".into()),
            ("canGetAndSetFMUstate", states.to_string()),
            ("canSerializeFMUstate", states.to_string()),
        ];
        element(&mut xml, 1, "CoSimulation", &flags, "/>");
    }
    units(&mut xml, graph, table);
    xml.push_str("  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n");
    let (start, stop) = (graph.experiment.start.unwrap_or(0.0), graph.experiment.stop);
    let mut times = vec![("startTime", number(start))];
    times.extend(stop.map(|stop| ("stopTime", number(stop))));
    times.push(("stepSize", number(recipe.step)));
    element(&mut xml, 1, "DefaultExperiment", &times, "/>");
    xml.push_str("  <ModelVariables>\n");
    for (reference, variable) in table.variables.iter().enumerate() {
        scalar_variable(&mut xml, table, reference, variable);
    }
    xml.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    structure(&mut xml, graph, table);
    xml.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    xml
}

/// Whether all components can save and serialize their state.
pub(crate) fn saves_states(graph: &SystemGraph) -> bool {
    interfaces(graph)
        .all(|interface| interface.can_get_and_set_fmu_state && interface.can_serialize_fmu_state)
}

/// Whether directional derivatives follow from those of the components.
pub(crate) fn differentiates(graph: &SystemGraph) -> bool {
    let provides = |component: &airloop_cosim::system::graph::Component| {
        let interface = component.fmu.interface(InterfaceKind::ModelExchange);
        interface.is_some_and(|interface| interface.provides_directional_derivative)
    };
    graph.loops.is_empty() && graph.components.iter().all(provides)
}

pub(crate) fn accepts_any_step(graph: &SystemGraph) -> bool {
    graph.components.iter().all(|component| {
        let interface = component.fmu.interface(InterfaceKind::CoSimulation);
        interface.is_none_or(|interface| interface.can_handle_variable_communication_step_size)
    })
}

fn interfaces(graph: &SystemGraph) -> impl Iterator<Item = &airloop_fmi::Interface> {
    let kinds = [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange];
    graph
        .components
        .iter()
        .flat_map(move |component| kinds.map(|kind| component.fmu.interface(kind)))
        .flatten()
}

fn element(xml: &mut String, depth: usize, name: &str, attributes: &[(&str, String)], end: &str) {
    xml.push_str(&"  ".repeat(depth));
    xml.push('<');
    xml.push_str(name);
    for (key, value) in attributes {
        xml.push_str(&format!(" {key}=\"{}\"", escape(value)));
    }
    xml.push_str(end);
    xml.push('\n');
}

/// Definitions of the units that variables name: that of the system, else that of the first FMU that has one.
fn units(xml: &mut String, graph: &SystemGraph, table: &Table) {
    let mut names: Vec<&str> =
        table.variables.iter().filter_map(|variable| variable.unit.as_deref()).collect();
    names.sort_unstable();
    names.dedup();
    if names.is_empty() {
        return;
    }
    xml.push_str("  <UnitDefinitions>\n");
    for name in names {
        let of_fmus = graph.components.iter().flat_map(|component| &component.fmu.description.units);
        let mut of_fmus = of_fmus.filter(|unit: &&UnitDefinition| unit.name == name);
        let own = graph.units.iter().find(|(known, _)| known == name).map(|(_, unit)| *unit);
        let unit = own
            .or_else(|| of_fmus.find_map(|unit| unit.base))
            .or_else(|| airloop_series::units::lookup(name));
        element(xml, 2, "Unit", &[("name", name.to_owned())], if unit.is_some() { ">" } else { "/>" });
        let Some(unit) = unit else { continue };
        let exponents = unit.exponents.symbols();
        let mut base: Vec<(&str, String)> = exponents
            .iter()
            .filter(|(_, exponent)| *exponent != 0)
            .map(|(symbol, exponent)| (*symbol, exponent.to_string()))
            .collect();
        base.extend((unit.factor != 1.0).then(|| ("factor", number(unit.factor))));
        base.extend((unit.offset != 0.0).then(|| ("offset", number(unit.offset))));
        element(xml, 3, "BaseUnit", &base, "/>");
        xml.push_str("    </Unit>\n");
    }
    xml.push_str("  </UnitDefinitions>\n");
}

fn scalar_variable(xml: &mut String, table: &Table, reference: usize, variable: &Variable) {
    let causality = match variable.role {
        Role::Parameter => "parameter",
        Role::Input | Role::Added(_) => "input",
        Role::Output => "output",
        Role::State(_) | Role::Derivative(_) if variable.shown => "output",
        Role::Local | Role::State(_) | Role::Derivative(_) => "local",
    };
    let variability = match variable.variability {
        Variability::Constant | Variability::Fixed if variable.role == Role::Parameter => "fixed",
        Variability::Tunable if variable.role == Role::Parameter => "tunable",
        Variability::Continuous if variable.data_type == DataType::Real => "continuous",
        _ => "discrete",
    };
    let initial = match (variable.role, &variable.start) {
        (Role::Input | Role::Added(_), _) => None,
        (_, Some(_)) => Some("exact"),
        (_, None) => Some("calculated"),
    };
    let mut attributes = vec![("name", variable.name.clone()), ("valueReference", reference.to_string())];
    if !variable.description.is_empty() {
        attributes.push(("description", variable.description.clone()));
    }
    attributes.extend([("causality", causality.into()), ("variability", variability.into())]);
    attributes.extend(initial.map(|initial| ("initial", initial.to_owned())));
    element(xml, 2, "ScalarVariable", &attributes, ">");
    let start = variable.start.as_ref().map(|start| match start {
        Value::Real(value) => number(*value),
        Value::Integer(value) => value.to_string(),
        Value::Boolean(value) => value.to_string(),
        Value::String(value) => value.clone(),
    });
    let mut typed: Vec<(&str, String)> = Vec::new();
    let is_real = variable.data_type == DataType::Real;
    typed.extend(variable.unit.clone().filter(|_| is_real).map(|unit| ("unit", unit)));
    typed.extend(variable.min.clone().map(|min| ("min", min)));
    typed.extend(variable.max.clone().map(|max| ("max", max)));
    typed.extend(variable.nominal.filter(|_| is_real).map(|nominal| ("nominal", number(nominal))));
    typed.extend(start.map(|start| ("start", start)));
    if let Role::Derivative(state) = variable.role {
        typed.push(("derivative", (table.states[state] + 1).to_string()));
    }
    let name = match variable.data_type {
        DataType::Real => "Real",
        DataType::Integer | DataType::Enumeration => "Integer",
        DataType::Boolean => "Boolean",
        DataType::String => "String",
    };
    element(xml, 3, name, &typed, "/>");
    xml.push_str("    </ScalarVariable>\n");
}

fn structure(xml: &mut String, graph: &SystemGraph, table: &Table) {
    let outputs: Vec<usize> = (0..table.variables.len())
        .filter(|&position| table.variables[position].role == Role::Output || table.variables[position].shown)
        .collect();
    list(xml, "Outputs", &outputs, |position| {
        if table.variables[position].shown {
            return matches!(table.variables[position].role, Role::State(_)).then(|| vec![position]);
        }
        let Place::Output(output) = table.variables[position].place else { return None };
        Some(dependencies(graph, table, graph.outputs[output].source))
    });
    list(xml, "Derivatives", &table.derivatives, |_| None);
    let initial: Vec<usize> = (0..table.variables.len())
        .filter(|&position| {
            let variable = &table.variables[position];
            match variable.role {
                Role::Output | Role::Derivative(_) => true,
                Role::State(_) => variable.start.is_none(),
                _ => false,
            }
        })
        .collect();
    list(xml, "InitialUnknowns", &initial, |_| None);
}

fn list(
    xml: &mut String,
    name: &str,
    positions: &[usize],
    dependencies: impl Fn(usize) -> Option<Vec<usize>>,
) {
    if positions.is_empty() {
        return;
    }
    xml.push_str(&format!("    <{name}>\n"));
    for &position in positions {
        let mut attributes = vec![("index", (position + 1).to_string())];
        if let Some(known) = dependencies(position) {
            let known: Vec<String> = known.iter().map(|position| (position + 1).to_string()).collect();
            attributes.push(("dependencies", known.join(" ")));
        }
        element(xml, 3, "Unknown", &attributes, "/>");
    }
    xml.push_str(&format!("    </{name}>\n"));
}

/// Whether two variables of an FMU are one value under two names.
fn is_same_value(a: &airloop_fmi::Variable, b: &airloop_fmi::Variable) -> bool {
    DataType::of(a) == DataType::of(b) && a.value_reference == b.value_reference
}

/// Inputs and states that a value depends on directly: those that a path of direct feed-through leads to.
fn dependencies(graph: &SystemGraph, table: &Table, source: Source) -> Vec<usize> {
    let mut open = vec![source];
    let mut seen = open.clone();
    let mut found = Vec::new();
    let position = |wanted: Place| table.variables.iter().position(|variable| variable.place == wanted);
    while let Some(source) = open.pop() {
        let (component, variable) = match source {
            Source::Input(input) => {
                found.extend(position(Place::Input(input)));
                continue;
            }
            Source::Output { component, variable } => (component, variable),
        };
        let owner = &graph.components[component];
        let description = &owner.fmu.description;
        let listed = description.outputs.iter().find(|unknown| unknown.variable == variable);
        let declared = listed.and_then(|unknown| unknown.dependencies.as_ref());
        for (number, &state) in table.states.iter().enumerate() {
            let Place::Variable { component: of, variable: own } = table.variables[state].place else {
                continue;
            };
            if of != component {
                continue;
            }
            // Inside of its FMU an output that is a state depends on nothing else; here the state is another variable.
            let depends = is_same_value(&description.variables[variable], &description.variables[own])
                || declared.is_none_or(|known| known.iter().any(|dependency| dependency.variable == own));
            if depends {
                found.push(table.states[number]);
            }
        }
        for &input in owner.fmu.feed_through(variable) {
            debug_assert_eq!(description.variables[input].causality, Causality::Input);
            let into =
                graph.connections.iter().filter(|to| to.component == component && to.variable == input);
            for connection in into {
                if !seen.contains(&connection.source) {
                    seen.push(connection.source);
                    open.push(connection.source);
                }
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}
