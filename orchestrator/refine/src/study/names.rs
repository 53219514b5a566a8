//! Names of signals of a system, as studies and messages write them.

use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::Source;
use airloop_fmi::Causality;

/// `component.variable` of a name that may leave out the component in a system of one FMU.
pub(super) fn path(graph: &SystemGraph, name: &str) -> Option<(usize, usize)> {
    if graph.single {
        return graph.components[0].fmu.description.index_of(name).map(|variable| (0, variable));
    }
    let (component, variable) = name.split_once('.')?;
    let index = graph.components.iter().position(|c| c.name == component)?;
    graph.components[index].fmu.description.index_of(variable).map(|variable| (index, variable))
}

/// Names of the system for messages.
pub fn known(graph: &SystemGraph, wanted: &[Causality]) -> String {
    let mut names: Vec<String> = Vec::new();
    if wanted.contains(&Causality::Input) {
        names.extend(graph.inputs.iter().map(|input| input.name.clone()));
    }
    for component in &graph.components {
        for variable in component.fmu.description.variables.iter().filter(|v| wanted.contains(&v.causality)) {
            let name = if graph.single {
                variable.name.clone()
            } else {
                format!("{}.{}", component.name, variable.name)
            };
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    names.truncate(30);
    names.join(", ")
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
    let variable = &graph.components[component].fmu.description.variables[variable];
    airloop_cosim::system::graph::unit_of(variable).map(str::to_owned)
}

/// Where an attachment acts: the input `name`, in words of the graph.
pub(super) fn attachment_target(graph: &SystemGraph, name: &str) -> Option<Vec<(usize, usize)>> {
    if let Some(input) = graph.inputs.iter().position(|input| input.name == name) {
        let fed = graph.connections.iter().filter(|c| c.source == Source::Input(input));
        return Some(fed.map(|c| (c.component, c.variable)).collect());
    }
    let (component, variable) = path(graph, name)?;
    let input = graph.components[component].fmu.description.variables[variable].causality == Causality::Input;
    input.then(|| vec![(component, variable)])
}
