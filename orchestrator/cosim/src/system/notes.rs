//! Notes on a system that a user should know although it can be simulated.

use super::graph::{Connection, Source, SystemGraph};
use super::ssp::Structure;

/// Says which components are ordered without knowing what their outputs depend on.
pub(super) fn missing_dependencies(graph: &mut SystemGraph) {
    for (index, component) in graph.components.iter().enumerate() {
        let outputs = &component.fmu.description.outputs;
        let connected = graph.connections.iter().any(|connection| match connection.source {
            Source::Output { component, variable } => {
                component == index
                    && !outputs.iter().any(|known| known.variable == variable && known.dependencies.is_some())
            }
            Source::Input(_) => false,
        });
        if connected {
            graph.notes.push(format!(
                "component `{}` does not declare the dependencies of its outputs: they are taken to depend on all inputs",
                component.name
            ));
        }
    }
}

/// Says which inputs that the file declares are driven by nothing: a connection may have been forgotten.
pub(super) fn open_inputs(structure: &Structure, graph: &mut SystemGraph) {
    for (index, element) in structure.components.iter().enumerate() {
        for connector in element.connectors.iter().filter(|connector| connector.kind == "input") {
            let variable = graph.components[index].fmu.description.index_of(&connector.name);
            let into = |fed: &Connection| fed.component == index && Some(fed.variable) == variable;
            if !graph.connections.iter().any(into) {
                let path = format!("{}.{}", element.name, connector.name);
                graph
                    .notes
                    .push(format!("nothing is connected to the input `{path}`: it keeps its start value"));
            }
        }
    }
}
