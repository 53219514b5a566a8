//! Structural parameters that are lengths of arrays (FMI 3.0): their values decide which variables a component has, so
//! they are found before names are resolved.

use std::sync::Arc;

use super::Error;
use super::ssp::Structure;
use super::ssv::{Parameter, Value};
use airloop_fmi::Fmu;

/// The FMU of the component number `index`, with the lengths that the parameters of the system give its arrays.
pub(super) fn resized(structure: &Structure, index: usize, fmu: Arc<Fmu>) -> Result<Arc<Fmu>, Error> {
    let element = &structure.components[index];
    let prefix = format!("{}.", element.name);
    let bound = element.parameters.iter().map(|parameter| (parameter.name.as_str(), parameter));
    let system = structure
        .parameters
        .iter()
        .filter_map(|parameter| Some((parameter.name.strip_prefix(&prefix)?, parameter)));
    // What comes later holds, as for other parameters.
    let mut sizes: Vec<(String, i64)> = Vec::new();
    for (name, parameter) in bound.chain(system) {
        if let Some(value) = size(&fmu, name, parameter)? {
            sizes.retain(|(known, _)| known != name);
            sizes.push((name.to_owned(), value));
        }
    }
    if sizes.is_empty() {
        return Ok(fmu);
    }
    fmu.resized(&sizes).map_err(|source| Error::Fmu {
        file: structure.file.clone(),
        component: element.name.clone(),
        source: Box::new(source),
    })
}

/// The value of a parameter that is a length of arrays; `None` for other parameters.
fn size(fmu: &Fmu, name: &str, parameter: &Parameter) -> Result<Option<i64>, Error> {
    let description = &fmu.description;
    let Some(position) = description.index_of(name).filter(|&position| description.sizes_arrays(position))
    else {
        return Ok(None);
    };
    let value = match parameter.value {
        Value::Integer(value) => Some(value),
        _ => None,
    };
    let place = format!("{}: line {}", parameter.file.display(), parameter.line);
    super::start::length(&description.variables[position], description, value, &place).map(Some)
}
