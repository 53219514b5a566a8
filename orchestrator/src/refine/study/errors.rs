//! Errors of models on the records of a role, in the units of the outputs, and as force.

use std::collections::BTreeMap;

use super::declaration::Role;
use super::fits::{Fits, pieces};
use super::force::ForceView;
use super::model::{Study, Target};
use super::simulate::Piece;
use crate::refine::answer::Errors;
use crate::refine::engine::System;
use crate::refine::engine::fit::{Free, fit};

/// Errors of pieces in the units of the outputs; initial states are fitted where the study says so.
pub fn errors(
    fits: &Fits,
    added: &[usize],
    pieces: &[Piece],
    p: &[f64],
    locals: Option<&[Vec<f64>]>,
) -> Errors {
    let mut found = Errors::default();
    if pieces.is_empty() {
        return found;
    }
    let view = fits.view(added, pieces);
    let own = match locals {
        Some(locals) => locals.to_vec(),
        None => fits.grow(added, pieces, p, &[], &[0.1, 0.3, 1.0], 12).locals,
    };
    let mut sums: BTreeMap<String, (f64, f64, f64, f64)> = BTreeMap::new();
    for (r, local) in own.iter().enumerate() {
        let (predicted, measured) = (view.predict(r, p, local), view.measured(r));
        for span in view.signals(r) {
            let sum = sums.entry(span.signal).or_default();
            for (a, b) in measured[span.range.clone()].iter().zip(&predicted[span.range.clone()]) {
                *sum = (sum.0 + 1.0, sum.1 + (a - b).powi(2), sum.2 + a, sum.3 + a * a);
            }
        }
    }
    for (signal, (n, error, sum, square)) in sums {
        let spread = (square / n - (sum / n).powi(2)).max(f64::MIN_POSITIVE);
        found.rms.insert(signal.clone(), (error / n).sqrt());
        found.nrmse.insert(signal, (error / n / spread).sqrt());
    }
    found
}

/// Force residual before and after on the records of a role, refitted on the force; empty without a rule.
pub fn force(fits: &Fits, added: &[usize], p: &[f64], roles: [Role; 2]) -> [Errors; 2] {
    let study = fits.study;
    if study.force.is_none() {
        return [Errors::default(), Errors::default()];
    }
    let of = |pieces: Vec<Piece>| ForceView { view: fits.view(added, &pieces), scale: 1.0 };
    let estimation = of(pieces(study, Role::Estimation));
    let free: Vec<Free> = fits
        .free(added)
        .into_iter()
        .filter(|free| !matches!(study.entries[free.index].target, Target::Offset))
        .collect();
    let records: Vec<usize> = (0..estimation.records()).collect();
    let none = vec![Vec::new(); records.len()];
    let found = fit(&estimation, &records, p, &free, &none, 25);
    roles.map(|role| {
        let view = of(pieces(study, role));
        let residuals: Vec<f64> =
            (0..view.records()).flat_map(|r| view.predict(r, &found.parameters, &[])).collect();
        let rms = (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len().max(1) as f64).sqrt();
        let mut errors = Errors::default();
        if let Some((.., name)) = &study.force {
            errors.rms.insert(name.clone(), rms);
            let spread = view.spread();
            errors.nrmse.insert(name.clone(), if spread > 0.0 { rms / spread } else { 0.0 });
        }
        errors
    })
}

/// Scatter of the driving force from sample to sample, as far as the low-pass lets it through.
pub fn force_noise(study: &Study, corner: f64) -> f64 {
    let records = study.records.iter().filter(|record| record.role == Role::Estimation);
    let first = records
        .flat_map(|record| record.inputs.iter().flatten().map(move |values| (values, record.step)))
        .next();
    first.map_or(1.0, |(values, step)| {
        (super::signal::scatter(values) * (2.0 * corner * step).sqrt()).max(1e-12)
    })
}
