//! Sampled components of a system, and its form in continuous time.

use super::Error;
use super::file::{Place, Statement};
use super::task::{positive, seconds};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Start};
use airloop_fmi::{Causality, VariableKind};
use airloop_series::names;

/// Parameters by which a component says that it is sampled, and chooses its form.
const SAMPLE_TIME: &str = "sample_time";
const REALIZATION: (&str, &str) = ("realization", "continuous");

/// Sampled components, and their common sample time.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampling {
    /// Indices of the components.
    pub components: Vec<usize>,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Place in the problem file that says so; the beginning of the file where the system does.
    pub place: Place,
}

/// Sampled part of a system, if there is one.
///
/// # Errors
/// [`Error::File`] for unknown components, no sample time, or several.
pub fn sampling(statement: &Statement, graph: &SystemGraph) -> Result<Option<Sampling>, Error> {
    let (source, settings) = (&statement.source, &statement.settings);
    let mut components = Vec::new();
    match &settings.sampled {
        Some(named) => {
            for name in named {
                let found = graph.components.iter().position(|component| component.name == name.text);
                components.push(found.ok_or_else(|| {
                    let known = graph.components.iter().map(|component| component.name.as_str());
                    let meant = names::suggestion(&name.text, known);
                    let problem = format!("the system has no component `{}`; {meant}", name.text);
                    source.error_at(name.place, problem)
                })?);
            }
        }
        None => {
            let sampled = graph.components.iter().enumerate().filter(|(_, one)| sample_time(one).is_some());
            components.extend(sampled.map(|(index, _)| index));
        }
    }
    if components.is_empty() {
        return Ok(None);
    }
    let place = settings.sampled.as_ref().and_then(|named| named.first()).map(|name| name.place);
    let place = settings.sample_time.as_ref().map(|time| time.place).or(place);
    let place = place.unwrap_or(Place(0));
    let own: Vec<f64> = components.iter().filter_map(|&one| sample_time(&graph.components[one])).collect();
    let sample_time = match (&settings.sample_time, own.first()) {
        (Some(time), _) => positive(source, seconds(source, time)?, time.place, "sample time")?,
        (None, Some(&first)) => {
            if let Some(other) = own.iter().find(|other| **other != first) {
                let problem = format!(
                    "the sampled components have several sample times, {first} s and {other} s; give `sample_time` in \
                     [settings], or list the components of one in `sampled`"
                );
                return Err(source.error_at(place, problem));
            }
            first
        }
        (None, None) => {
            let problem = "the components in `sampled` have no parameter `sample_time`; give `sample_time` in [settings]";
            return Err(source.error_at(place, problem));
        }
    };
    Ok(Some(Sampling { components, sample_time, place }))
}

fn sample_time(component: &Component) -> Option<f64> {
    let description = &component.fmu.description;
    let index = description.index_of(SAMPLE_TIME)?;
    let variable = &description.variables[index];
    let VariableKind::Real(real) = &variable.kind else { return None };
    let set = component.start_values.iter().find(|start| start.variable == index);
    let value = match set.map(|start| &start.value) {
        Some(Start::Real(value)) => Some(*value),
        _ => real.start,
    };
    value.filter(|value| variable.causality == Causality::Parameter && *value > 0.0)
}

/// The same system with the components that have a continuous form in it.
pub fn in_continuous_time(graph: &SystemGraph) -> SystemGraph {
    let mut graph = graph.clone();
    for component in &mut graph.components {
        let description = &component.fmu.description;
        let Some(index) = description.index_of(REALIZATION.0) else { continue };
        let VariableKind::Enumeration { declared_type, .. } = &description.variables[index].kind else {
            continue;
        };
        let declared = description.types.iter().find(|one| one.name == *declared_type);
        let item = declared.and_then(|one| one.items.iter().find(|(name, _)| name == REALIZATION.1));
        if let Some(value) = item.map(|(_, value)| *value) {
            component.set_start(index, Start::Integer(value));
        }
    }
    graph
}

/// The number of whole samples in a length of time, if it is one.
pub fn whole_samples(length: f64, sample_time: f64) -> Option<usize> {
    let samples = (length / sample_time).round();
    let fits = samples >= 1.0 && (length - samples * sample_time).abs() <= 1e-9 * length.max(sample_time);
    fits.then_some(samples as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_counted_in_spite_of_rounding() {
        assert_eq!(whole_samples(2.0, 1e-3), Some(2000));
        assert_eq!(whole_samples(0.1 + 0.2, 0.1), Some(3));
        assert_eq!(whole_samples(2.0 / 300.0, 1e-3), None);
        assert_eq!(whole_samples(1e-4, 1e-3), None);
    }
}
