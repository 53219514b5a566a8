//! Choices made when a system is opened: states and their order, forms of components; and the notes about them.

use super::anatomy::Anatomy;
use super::{Error, Options, names};
use crate::system::SystemGraph;
use crate::system::graph::Start;
use airloop_fmi::VariableKind;

/// A state: component and position.
type State = (usize, usize);

/// Name of the parameter that chooses between a sampled and a continuous form, and its item for the latter.
const REALIZATION: (&str, &str) = ("realization", "continuous");

/// States in the order of the problem, as (component, position), and their names.
pub(super) fn states(
    graph: &SystemGraph,
    anatomy: &Anatomy,
    idle: &[(usize, usize)],
    options: &Options,
) -> Result<(Vec<State>, Vec<String>), Error> {
    let all = anatomy.blocks.iter().enumerate();
    let all = all.flat_map(|(component, block)| (0..block.states).map(move |state| (component, state)));
    let name = |&(component, state): &(usize, usize)| names::state_name(graph, component, state);
    let mut moving = all.filter(|state| !idle.contains(state));
    let Some(wanted) = &options.states else {
        let states: Vec<_> = moving.collect();
        let names = states.iter().map(name).collect();
        return Ok((states, names));
    };
    let states = wanted.iter().map(|name| names::state(graph, name)).collect::<Result<Vec<_>, _>>()?;
    if let Some((index, _)) =
        states.iter().enumerate().find(|(index, state)| states[..*index].contains(state))
    {
        return Err(Error::Twice { role: "state", name: wanted[index].clone() });
    }
    match moving.find(|state| !states.contains(state)) {
        Some(state) => Err(Error::StateMissing { name: name(&state) }),
        None => Ok((states, wanted.clone())),
    }
}

/// Components that have a sampled and a continuous form take the latter, unless the user chose one.
pub(super) fn continuous_forms(graph: &mut SystemGraph) -> Vec<String> {
    let mut notes = Vec::new();
    for component in &mut graph.components {
        let description = &component.fmu.description;
        let Some(index) = description.index_of(REALIZATION.0) else { continue };
        let VariableKind::Enumeration { declared_type, .. } = &description.variables[index].kind else {
            continue;
        };
        let mut types = description.types.iter().filter(|definition| definition.name == *declared_type);
        let item =
            types.find_map(|definition| definition.items.iter().find(|(name, _)| name == REALIZATION.1));
        let Some(&(_, value)) = item else { continue };
        if component.start_values.iter().all(|start| start.variable != index) {
            component.set_start(index, Start::Integer(value));
            notes.push(format!(
                "component `{}` runs in its continuous form (`{}` = {})",
                component.name, REALIZATION.0, REALIZATION.1
            ));
        }
    }
    notes
}

/// Says which inputs keep their start values.
pub(super) fn held_inputs(graph: &SystemGraph, inputs: &[usize]) -> Option<String> {
    let held = (0..graph.inputs.len()).filter(|input| !inputs.contains(input));
    let held: Vec<String> = held.map(|input| format!("`{}`", graph.inputs[input].name)).collect();
    (!held.is_empty()).then(|| format!("the inputs {} keep their start values", held.join(", ")))
}

/// Says which components have events that an optimization does not see.
pub(super) fn unseen_events(graph: &SystemGraph) -> Option<String> {
    let components = graph.components.iter();
    let with = components.filter(|component| component.fmu.description.number_of_event_indicators > 0);
    let with: Vec<String> = with.map(|component| format!("`{}`", component.name)).collect();
    (!with.is_empty()).then(|| {
        format!(
            "state events of {} are not handled: what holds at the start holds throughout",
            with.join(", ")
        )
    })
}
