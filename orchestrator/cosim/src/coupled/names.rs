//! Names of states, inputs and outputs, as a problem writes them, and what they stand for.

use super::Error;
use crate::system::SystemGraph;
use crate::system::graph::{Conversion, DataType, Source, unit_of};
use airloop_fmi::{Causality, Variability};

/// Quantity behind an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Shown {
    /// A system input.
    Input(usize, Conversion),
    /// A continuous state: component and position.
    State(usize, usize, Conversion),
    /// The input of a component: component and variable.
    Driven(usize, usize, Conversion),
    /// Anything else: component and variable.
    Value(usize, usize, Conversion),
}

impl Shown {
    /// From the variable to the output.
    pub fn conversion(&self) -> Conversion {
        match *self {
            Shown::Input(_, conversion)
            | Shown::State(_, _, conversion)
            | Shown::Driven(_, _, conversion)
            | Shown::Value(_, _, conversion) => conversion,
        }
    }
}

/// Component and variable, or the system input, that a name stands for.
fn find(graph: &SystemGraph, name: &str) -> Option<(Source, Conversion)> {
    if let Some(output) = graph.outputs.iter().find(|output| output.name == name) {
        return Some((output.source, output.conversion));
    }
    if let Some(input) = graph.inputs.iter().position(|input| input.name == name) {
        return Some((Source::Input(input), Conversion::IDENTITY));
    }
    let inside = |(index, component): (usize, &crate::system::graph::Component)| {
        let bare = if graph.single { Some(name) } else { None };
        let rest =
            name.strip_prefix(component.name.as_str()).and_then(|rest| rest.strip_prefix('.')).or(bare)?;
        let variable = component.fmu.description.index_of(rest)?;
        Some((Source::Output { component: index, variable }, Conversion::IDENTITY))
    };
    graph.components.iter().enumerate().find_map(inside)
}

/// Position among the continuous states of the component, also through a variable with the same reference.
fn state_of(graph: &SystemGraph, component: usize, variable: usize) -> Option<usize> {
    let description = &graph.components[component].fmu.description;
    let reference = |variable: usize| description.variables[variable].value_reference;
    let real = DataType::of(&description.variables[variable]) == DataType::Real;
    description.continuous_states().position(|state| real && reference(state) == reference(variable))
}

/// Quantity behind an output of the dynamics.
pub(super) fn output(graph: &SystemGraph, name: &str) -> Result<Shown, Error> {
    let (component, index, conversion) = match find(graph, name) {
        Some((Source::Input(input), conversion)) => return Ok(Shown::Input(input, conversion)),
        Some((Source::Output { component, variable }, conversion)) => (component, variable, conversion),
        None => {
            let outputs = graph.outputs.iter().map(|output| output.name.clone());
            let prefixes = graph.components.iter().map(|component| format!("{}.*", component.name));
            let known = outputs.chain(prefixes).collect::<Vec<_>>().join(", ");
            return Err(Error::Unknown { role: "output", name: name.to_owned(), known });
        }
    };
    let variable = &graph.components[component].fmu.description.variables[index];
    let refuse = |reason: &'static str| Err(Error::Output { name: name.to_owned(), reason });
    if DataType::of(variable) != DataType::Real {
        return refuse("is not a Real; only Reals can be part of an optimization");
    }
    if let Some(state) = state_of(graph, component, index) {
        return Ok(Shown::State(component, state, conversion));
    }
    match (variable.causality, variable.variability) {
        (Causality::Independent, _) => refuse("is the time; bounds on it belong to the duration"),
        (Causality::Parameter | Causality::CalculatedParameter, _)
        | (_, Variability::Constant | Variability::Fixed | Variability::Tunable) => {
            refuse("is a parameter, which does not move; leave it out")
        }
        (Causality::Input, _) => Ok(Shown::Driven(component, index, conversion)),
        _ => Ok(Shown::Value(component, index, conversion)),
    }
}

/// Component and position of the state that a name stands for.
pub(super) fn state(graph: &SystemGraph, name: &str) -> Result<(usize, usize), Error> {
    let found = match find(graph, name) {
        Some((Source::Output { component, variable }, Conversion::IDENTITY)) => {
            state_of(graph, component, variable).map(|state| (component, state))
        }
        _ => None,
    };
    found.ok_or_else(|| {
        let known = graph.components.iter().enumerate().flat_map(|(index, component)| {
            (0..component.fmu.description.derivatives.len()).map(move |state| state_name(graph, index, state))
        });
        Error::Unknown { role: "state", name: name.to_owned(), known: known.collect::<Vec<_>>().join(", ") }
    })
}

/// Positions in the graph of the inputs of the dynamics.
pub(super) fn inputs(graph: &SystemGraph, names: Option<&[String]>) -> Result<Vec<usize>, Error> {
    let usable =
        |&input: &usize| graph.inputs[input].data_type == DataType::Real && !graph.input_is_held(input);
    let Some(names) = names else { return Ok((0..graph.inputs.len()).filter(usable).collect()) };
    let position = |name: &String| {
        graph.inputs.iter().position(|input| input.name == *name).ok_or_else(|| {
            let known = graph.inputs.iter().map(|input| input.name.clone()).collect::<Vec<_>>().join(", ");
            Error::Unknown { role: "input", name: name.clone(), known }
        })
    };
    once("input", names)?;
    names.iter().map(position).collect()
}

/// Refuses names that are given twice.
pub(super) fn once(role: &'static str, names: &[String]) -> Result<(), Error> {
    match names.iter().enumerate().find(|(index, name)| names[..*index].contains(name)) {
        Some((_, name)) => Err(Error::Twice { role, name: name.clone() }),
        None => Ok(()),
    }
}

/// Index of the variable that is a state.
fn state_variable(graph: &SystemGraph, component: usize, state: usize) -> usize {
    let mut states = graph.components[component].fmu.description.continuous_states();
    states.nth(state).expect("every derivative names its state")
}

/// `component.state`
pub(super) fn state_name(graph: &SystemGraph, component: usize, state: usize) -> String {
    graph.components[component].path_of(state_variable(graph, component, state))
}

/// Unit of a state.
pub(super) fn state_unit(graph: &SystemGraph, component: usize, state: usize) -> Option<String> {
    let variable = state_variable(graph, component, state);
    unit_of(&graph.components[component].fmu.description.variables[variable]).map(str::to_owned)
}

/// Unit of an output: that of the connector of the system, or of the variable.
pub(super) fn output_unit(graph: &SystemGraph, name: &str) -> Option<String> {
    if let Some(output) = graph.outputs.iter().find(|output| output.name == name) {
        return output.unit.clone();
    }
    match find(graph, name)?.0 {
        Source::Input(input) => graph.inputs[input].unit.clone(),
        Source::Output { component, variable } => {
            unit_of(&graph.components[component].fmu.description.variables[variable]).map(str::to_owned)
        }
    }
}
