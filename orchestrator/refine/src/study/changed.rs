//! Declared parameters that differ from their declared values by more than the tolerance allows: effects of their own.

use super::fits::Model;
use super::model::{Entry, Study, Target};
use crate::answer::{Effect, Parameter};
use crate::engine::candidate::{Candidate, Start};
use crate::engine::fit::{Fit, Free};
use crate::order::descending;

/// Kind of such an effect.
pub const KIND: &str = "parameter";

fn is_correction(entry: &Entry) -> bool {
    matches!(entry.target, Target::Correction { .. })
}

/// Corrections that a fit was free to choose.
pub fn corrected(study: &Study, fit: &Fit) -> Vec<Free> {
    fit.free.iter().filter(|free| is_correction(&study.entries[free.index])).copied().collect()
}

/// Those of them that exceed `most` of their tolerances, the one that exceeds it most first, without a tolerance that
/// would hold them back.
pub fn changed(study: &Study, fit: &Fit, most: f64) -> Vec<Free> {
    let tolerances = |free: &Free| {
        let tolerance = study.entries[free.index].free.prior.unwrap_or(f64::INFINITY);
        fit.parameters[free.index].abs() / tolerance
    };
    let mut own = corrected(study, fit);
    own.retain(|free| tolerances(free) > most);
    descending(&mut own, tolerances);
    own.into_iter().map(|free| Free { prior: None, ..free }).collect()
}

/// A change of a declared parameter as a candidate of the engine.
pub fn candidate(free: Free) -> Candidate {
    let starts = vec![Start { values: Vec::new(), open: vec![0], idle: true }];
    Candidate { id: "", channel: "", signal: None, free: vec![free], starts, place: 0, contains: None }
}

/// Number of the group of effects that the records cannot tell from a change.
pub fn group(study: &Study, free: &Free) -> usize {
    study.candidates.len() + free.index
}

/// Changes of a model as effects, in their order.
pub fn effects(study: &Study, model: &Model, changed: &[Free], score: f64) -> Vec<Effect> {
    let one = |free: &Free| {
        let entry = &study.entries[free.index];
        let Target::Correction { declared, .. } = entry.target else { return None };
        let place = model.fit.free.iter().position(|own| own.index == free.index)?;
        let moved = model.fit.parameters[free.index];
        let half = 1.96 * (declared * model.fit.covariance[(place, place)].max(0.0).sqrt()).abs();
        let delta = declared * moved;
        let parameter = Parameter {
            name: "delta".into(),
            unit: entry.unit.clone(),
            value: delta,
            interval: (delta - half, delta + half),
        };
        let tolerances = (moved / entry.free.prior.unwrap_or(1.0)).abs();
        let effect = Effect {
            id: format!("{KIND}@{}", entry.name),
            port: Some(entry.name.clone()),
            score,
            parameters: vec![parameter],
            reason: format!(
                "{:.6e} in place of {declared:.6e}, {tolerances:.1} of its tolerances away",
                declared + delta
            ),
            ..Effect::default()
        };
        Some(effect)
    };
    changed.iter().filter_map(one).collect()
}
