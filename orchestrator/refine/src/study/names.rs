//! Names of signals of a system, as studies and messages write them.

use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Source};
use airloop_fmi::{Causality, InterfaceKind, VariableKind};

/// `component.variable` of a name that may leave out the component in a system of one FMU.
pub(super) fn path(graph: &SystemGraph, name: &str) -> Option<(usize, usize)> {
    if graph.single {
        return graph.components[0].fmu.description.index_of(name).map(|variable| (0, variable));
    }
    let (component, variable) = name.split_once('.')?;
    let index = graph.components.iter().position(|c| c.name == component)?;
    graph.components[index].fmu.description.index_of(variable).map(|variable| (index, variable))
}

/// Name of a variable of a component, which a system of one FMU leaves out.
pub(crate) fn name_of(graph: &SystemGraph, component: &Component, variable: usize) -> String {
    match graph.single {
        true => component.fmu.description.variables[variable].name.clone(),
        false => component.path_of(variable),
    }
}

/// Names of the system for messages.
pub fn known(graph: &SystemGraph, wanted: &[Causality]) -> String {
    let mut names: Vec<String> = Vec::new();
    if wanted.contains(&Causality::Input) {
        names.extend(graph.inputs.iter().map(|input| input.name.clone()));
    }
    for component in &graph.components {
        for (index, variable) in component.fmu.description.variables.iter().enumerate() {
            if !wanted.contains(&variable.causality) {
                continue;
            }
            let name = name_of(graph, component, index);
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    names.truncate(30);
    names.join(", ")
}

/// Places of attachments for messages: inputs, then rates of states.
pub(super) fn places(graph: &SystemGraph) -> String {
    let inputs = known(graph, &[Causality::Input]);
    let rates = graph.components.iter().flat_map(|component| {
        let variables = 0..component.fmu.description.variables.len();
        let rates = variables.filter(|&variable| state_of_rate(component, variable).is_some());
        rates.map(|variable| name_of(graph, component, variable))
    });
    let all: Vec<String> =
        std::iter::once(inputs).filter(|own| !own.is_empty()).chain(rates.take(30)).collect();
    all.join(", ")
}

/// Unit of a signal of the system: a system input, a connector or `component.variable`.
pub fn unit_of(graph: &SystemGraph, name: &str) -> Option<String> {
    if let Some(input) = graph.inputs.iter().find(|input| input.name == name) {
        return input.unit.clone();
    }
    if let Some(output) = graph.outputs.iter().find(|output| output.name == name) {
        return output.unit.clone();
    }
    let (component, variable) = path(graph, name)?;
    let component = &graph.components[component];
    let unit = |variable: usize| {
        airloop_cosim::system::graph::unit_of(&component.fmu.description.variables[variable])
    };
    let of_rate = || state_of_rate(component, variable).and_then(unit).map(per_second);
    unit(variable).map(str::to_owned).or_else(of_rate)
}

/// The unit of a rate, from that of its state.
fn per_second(unit: &str) -> String {
    match unit.strip_suffix("/s") {
        Some(own) => format!("{own}/s2"),
        None => format!("{unit}/s"),
    }
}

/// The state of which a variable of a component is the rate; none for any other variable, for a velocity that is a
/// state itself, and for a component that steps by itself.
pub(crate) fn state_of_rate(component: &Component, variable: usize) -> Option<usize> {
    let description = &component.fmu.description;
    component.fmu.interface(InterfaceKind::ModelExchange)?;
    description.derivatives.iter().find(|own| own.variable == variable)?;
    if description.continuous_states().any(|state| state == variable) {
        return None;
    }
    match &description.variables[variable].kind {
        VariableKind::Real(real) => real.derivative,
        _ => None,
    }
}

/// Where an attachment acts, in words of the graph: the input `name`, or the rate of a state, to which a block adds.
pub(super) fn attachment_target(graph: &SystemGraph, name: &str) -> Option<Vec<(usize, usize)>> {
    if let Some(input) = graph.inputs.iter().position(|input| input.name == name) {
        let fed = graph.connections.iter().filter(|c| c.source == Source::Input(input));
        return Some(fed.map(|c| (c.component, c.variable)).collect());
    }
    let (component, variable) = path(graph, name)?;
    let own = &graph.components[component];
    let is_input = own.fmu.description.variables[variable].causality == Causality::Input;
    (is_input || state_of_rate(own, variable).is_some()).then(|| vec![(component, variable)])
}
