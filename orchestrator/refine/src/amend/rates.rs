//! FMUs that get inputs at rates of their states: a block can add there although its author gave it no such input.

use std::path::Path;

use super::Error;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::StartValue;
use airloop_cosim::system::ssp::{ComponentElement, Structure};
use airloop_cosim::system::ssv::Value;
use airloop_fmi::template_folder;
use airloop_system::{Recipe, TEMPLATE};

/// Puts FMUs with inputs at `rates`, component and variable, in place of those of the structure, in the folder `work`;
/// the values that the structure gives their parameters are start values of theirs, too.
///
/// # Errors
/// An FMU without Model Exchange, the library that is not there, or the file system.
pub fn add_inputs(
    structure: &mut Structure,
    rates: &[(String, String)],
    (work, templates): (&Path, Option<&Path>),
) -> Result<(), Error> {
    for index in 0..structure.components.len() {
        let component = &structure.components[index];
        let own = rates.iter().filter(|(name, _)| *name == component.name);
        let own: Vec<String> = own.map(|(_, rate)| rate.clone()).collect();
        if own.is_empty() {
            continue;
        }
        let template = template_folder::template(TEMPLATE, templates)?;
        let mut graph = SystemGraph::open_to_read(&component.source)?;
        graph.components[0].start_values = start_values(structure, component)?;
        let recipe = Recipe::with_rates(&graph, own);
        // The FMU itself may serve another component as it is.
        let file = format!("{}_with_rates.fmu", component.name);
        let refused = |source| Error::Rates { component: component.name.clone(), source };
        airloop_system::write(&graph, &recipe, &template, &work.join(&file)).map_err(refused)?;
        let old = component.source.clone();
        let component = &mut structure.components[index];
        (component.source, component.shown) = (work.join(&file), file.into());
        // Enumerations are Integers there; their values are start values.
        component.parameters.retain(|own| !matches!(own.value, Value::Enumeration(_)));
        if structure.components.iter().all(|own| own.source != old) {
            std::fs::remove_file(&old).map_err(|source| Error::Io { path: old, source })?;
        }
    }
    Ok(())
}

/// Start values that a structure gives a component.
fn start_values(structure: &Structure, component: &ComponentElement) -> Result<Vec<StartValue>, Error> {
    let alone = Structure {
        connectors: Vec::new(),
        connections: Vec::new(),
        components: vec![ComponentElement { connectors: Vec::new(), ..component.clone() }],
        ..structure.clone()
    };
    let mut graph = SystemGraph::from_structure(alone, None)?;
    Ok(std::mem::take(&mut graph.components[0].start_values))
}
