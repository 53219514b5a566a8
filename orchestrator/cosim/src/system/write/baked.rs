//! Start values inside the FMUs of a package: readers that ignore parameter sets simulate the same system.
//!
//! FMUs of this project can be derived with other start values; those of others hold theirs in the library, so that
//! only the parameter set has what the system changes.

use std::path::Path;

use super::Error;
use crate::system::graph::{Component, Start, StartValue};
use airloop_fmi::derive::{self, Derivation, Value};

/// Writes the FMU of a component with its start values to `out`; `false` if there is nothing that it could hold.
pub(super) fn derive(component: &Component, name: &str, file: &Path, out: &Path) -> Result<bool, Error> {
    let held: Vec<&StartValue> =
        component.start_values.iter().filter(|start| holds(component, start)).collect();
    if held.is_empty() {
        return Ok(false);
    }
    let value = |start: &StartValue| match &start.value {
        Start::Real(x) => Value::Real(*x),
        Start::Integer(x) => Value::Integer(*x),
        Start::Boolean(x) => Value::Boolean(*x),
        Start::String(x) => Value::String(x.clone()),
    };
    let description = &component.fmu.description;
    let derivation = Derivation {
        name: name.to_owned(),
        description: String::new(),
        start: held
            .into_iter()
            .map(|start| (description.variables[start.variable].name.clone(), value(start)))
            .collect(),
        resources: Vec::new(),
    };
    derive::derive(&component.fmu.path, out, &derivation).map_err(|source| Error::Derive {
        file: file.into(),
        component: component.name.clone(),
        source: Box::new(source),
    })?;
    Ok(true)
}

/// Whether the FMU of a component can have this start value by itself.
pub(super) fn holds(component: &Component, start: &StartValue) -> bool {
    let description = &component.fmu.description;
    derive::is_template(description) && derive::has_start(&description.variables[start.variable])
}
