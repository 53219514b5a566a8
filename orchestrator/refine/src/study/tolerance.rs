//! How well declared parameters of a study are known, and the entries of the parameter vector that correct them.

use airloop_series::units::{Exponents, lookup};

use super::declaration::File;
use super::model::{Entry, Study, Target};
use super::names;
use super::plant::Plant;
use crate::Error;
use crate::engine::fit::Free;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::{Causality, VariableKind};

/// Standard deviations of parameters by what they are, relative to the value.
const MASS_OR_LENGTH: f64 = 0.01;
const FRICTION: f64 = 0.03;
const SLOPE: f64 = 0.1;

/// Relative standard deviation of a declared parameter that the study says nothing about, by its unit; none for
/// constants of nature and for counts of time that are no property of a machine.
fn usual(unit: Option<&str>) -> Option<f64> {
    let Some(own) = unit.and_then(lookup).map(|unit| unit.exponents) else { return Some(MASS_OR_LENGTH) };
    let Exponents { kg, m, s, .. } = own;
    let plain = own.A == 0 && own.K == 0 && own.mol == 0 && own.cd == 0;
    Some(match (kg, m, s) {
        // Acceleration of gravity.
        (0, 1, -2) if plain => return None,
        // Forces and torques, and their slopes by speed.
        (1, 1 | 2, -2) | (1, 0 | 2, -1) if plain => FRICTION,
        // The speed over which a friction law changes its sign, and its inverse.
        (0, 1, -1) | (0, -1, 1) if plain => SLOPE,
        (0, 0, -1) | (0, 0, 1) if plain && own.rad != 0 => SLOPE,
        _ => MASS_OR_LENGTH,
    })
}

/// Whether a parameter is the clock of a component that samples, which is stated and not measured.
fn is_clock(name: &str, unit: Option<&str>) -> bool {
    let second = Exponents { s: 1, ..Exponents::default() };
    let time = unit.and_then(lookup).is_some_and(|own| own.exponents == second);
    time && name.to_lowercase().contains("sample")
}

/// Real parameters of the system by name, as a study names them; clocks are left out, and elements of matrices, as an
/// identified model is never scaled one coefficient at a time.
fn parameters(graph: &SystemGraph) -> Vec<String> {
    let mut found = Vec::new();
    for component in &graph.components {
        for (index, variable) in component.fmu.description.variables.iter().enumerate() {
            let VariableKind::Real(real) = &variable.kind else { continue };
            let name = &variable.name;
            if variable.causality == Causality::Parameter
                && !name.contains('[')
                && !is_clock(name, real.unit.as_deref())
            {
                found.push(names::name_of(graph, component, index));
            }
        }
    }
    found
}

/// Refuses tolerances that belong to no parameter or are no standard deviation.
///
/// # Errors
/// File, place and what is wrong.
pub fn check(file: &File, graph: &SystemGraph) -> Result<(), Error> {
    for (name, spanned) in &file.declaration.tolerance {
        let value = *spanned.get_ref();
        if Plant::parameter(graph, name).is_none() {
            let known = names::known(graph, &[Causality::Parameter]);
            return Err(file.refuse(
                spanned,
                format!("[tolerance]: there is no Real parameter `{name}`; known are: {known}"),
            ));
        }
        if !(value > 0.0 && value < 1.0) {
            return Err(file.refuse(
                spanned,
                format!("[tolerance]: `{name}` = {value}; give one standard deviation relative to the value, between 0 and 1"),
            ));
        }
    }
    Ok(())
}

/// Difference step of a correction, as long as that of a free parameter: a longer one over many periods of a swing
/// takes curvature for a difference between mass and length.
const DIFFERENCE_STEP: f64 = 1e-5;

/// Corrections that are fitted at most.
pub const MAX_CORRECTIONS: usize = 16;

/// Corrections of the declared parameters, each with its declared value, bounded to `most` of its tolerances.
pub fn corrections(study: &Study, most: f64) -> Vec<(Free, f64)> {
    let one = |entry: &Entry| {
        let Target::Correction { declared, .. } = entry.target else { return None };
        let (free, reach) = (entry.free, most * entry.free.prior?);
        Some((Free { bounds: (free.bounds.0.max(-reach), free.bounds.1.min(reach)), ..free }, declared))
    };
    study.entries.iter().filter_map(one).collect()
}

/// Adds an entry for every declared parameter that may be slightly off: relative change, 0 as declared.
pub fn fill(study: &mut Study, file: &File) {
    let free: Vec<String> = study.entries[..study.declared].iter().map(|entry| entry.name.clone()).collect();
    for name in parameters(&study.graph) {
        if free.contains(&name) {
            continue;
        }
        let Some((parameter, start, bounds)) = Plant::parameter(&study.graph, &name) else { continue };
        let set = study.fixed.iter().find(|(own, _)| *own == parameter).map(|(_, value)| *value);
        let declared = set.unwrap_or(start);
        let unit = names::unit_of(&study.graph, &name);
        let stated = file.declaration.tolerance.get(&name).map(|spanned| *spanned.get_ref());
        let Some(tolerance) = stated.or_else(|| usual(unit.as_deref())).filter(|_| declared != 0.0) else {
            continue;
        };
        let least = (bounds.0 / declared - 1.0, bounds.1 / declared - 1.0);
        let (low, high) = if declared > 0.0 { least } else { (least.1, least.0) };
        let index = study.entries.len();
        let free =
            Free { index, bounds: (low.max(-0.9), high), step: DIFFERENCE_STEP, prior: Some(tolerance) };
        let target = Target::Correction { parameter, declared };
        study.entries.push(Entry {
            name,
            unit: unit.unwrap_or_else(|| "1".into()),
            target,
            start: 0.0,
            free,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_time_is_a_clock_and_a_time_constant_is_none() {
        assert!(is_clock("sample_time", Some("s")) && is_clock("samplePeriod", Some("ms")));
        assert!(
            !is_clock("T", Some("s"))
                && !is_clock("sample_gain", Some("N"))
                && !is_clock("sample_time", None)
        );
    }

    #[test]
    fn the_usual_tolerance_follows_the_unit() {
        let of = |unit: &str| usual(Some(unit));
        assert_eq!(of("kg"), Some(0.01));
        assert_eq!(of("kg.m2"), Some(0.01));
        assert_eq!(of("N"), Some(0.03));
        assert_eq!(of("N.m"), Some(0.03));
        assert_eq!(of("N.m.s/rad"), Some(0.03));
        assert_eq!(of("m/s"), Some(0.1));
        assert_eq!(of("s/m"), Some(0.1));
        assert_eq!(of("m/s2"), None);
        assert_eq!(usual(None), Some(0.01));
    }
}
