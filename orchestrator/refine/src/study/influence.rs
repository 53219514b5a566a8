//! Changes of the residuals by corrections of the declared parameters, and the effects that change the same.

use super::law::Law;
use super::model::{Action, Study};
use super::tolerance::{MAX_CORRECTIONS, corrections};
use super::whole::{Whole, candidate};
use crate::engine::System;
use crate::engine::candidate::Candidate;
use crate::engine::fit::Free;
use crate::engine::normal::{Columns, columns, dot};

/// Fall of the sum of squares, residuals in units of the floor, that a correction of one tolerance must be able to
/// bring.
const MIN_INFLUENCE: f64 = 4.0;
/// Cosine of the angle between what a correction and an effect change from which on they are the same.
const MIN_COSINE_OF_SAME: f64 = 0.999;

/// A correction that the records show.
pub struct Influential {
    /// The correction.
    pub free: Free,
    /// Declared value of its parameter.
    pub declared: f64,
    /// Derivatives of the residuals of each record by the correction.
    columns: Vec<Vec<f64>>,
}

/// Columns of `free` parameters in all records around a parameter vector with its local parameters.
fn around(whole: &Whole, (p, locals): (&[f64], &[Vec<f64>]), free: &[Free]) -> Vec<Columns> {
    let records: Vec<usize> = (0..whole.records()).collect();
    let locals: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
    columns(whole, &records, p, free, &locals, false, None)
}

/// The corrections that the records show around `at`, bounded to `most` of their tolerances, most influential first; at
/// most
/// [`MAX_CORRECTIONS`].
pub fn influential(study: &Study, whole: &Whole, at: (&[f64], &[Vec<f64>]), most: f64) -> Vec<Influential> {
    let own = corrections(study, most);
    let free: Vec<Free> = own.iter().map(|own| own.0).collect();
    let found = around(whole, at, &free);
    let mut kept: Vec<(f64, Influential)> = own
        .into_iter()
        .enumerate()
        .map(|(k, (free, declared))| {
            let columns: Vec<Vec<f64>> = found.iter().map(|record| record.columns[k].clone()).collect();
            let size: f64 = columns.iter().map(|own| dot(own, own)).sum();
            (size * free.prior.unwrap_or(0.0).powi(2), Influential { free, declared, columns })
        })
        .filter(|(influence, _)| influence.is_finite() && *influence > MIN_INFLUENCE)
        .collect();
    kept.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.free.index.cmp(&b.1.free.index)));
    // Those that move the residuals most within their tolerance.
    kept.truncate(MAX_CORRECTIONS);
    kept.into_iter().map(|(_, own)| own).collect()
}

/// Viscous friction of the declared model at the ports of the candidates for it: candidate, coefficient.
///
/// `most`: tolerances up to which a declared parameter is corrected.
pub fn declared_viscous(
    study: &Study,
    whole: &Whole,
    at: (&[f64], &[Vec<f64>]),
    most: f64,
) -> Vec<(usize, f64)> {
    let viscous = |c: usize| matches!(study.candidates[c].action, Action::Block { law: Law::Viscous, .. });
    if !(0..study.candidates.len()).any(viscous) {
        return Vec::new();
    }
    let candidates: Vec<Candidate> = (0..study.candidates.len()).map(|c| candidate(study, c)).collect();
    let singles = Singles::new(study, whole, at, &candidates);
    let same = |own: Influential| singles.same(&own);
    influential(study, whole, at, most).into_iter().filter_map(same).filter(|&(c, _)| viscous(c)).collect()
}

/// The candidates that have one parameter, zero where they do nothing, and what it changes.
pub struct Singles {
    candidates: Vec<usize>,
    columns: Vec<Columns>,
}

impl Singles {
    /// Around `at`.
    pub fn new(study: &Study, whole: &Whole, at: (&[f64], &[Vec<f64>]), candidates: &[Candidate]) -> Singles {
        let own: Vec<usize> = (0..study.candidates.len())
            .filter(|&c| matches!(&study.candidates[c].starts[..], [only] if only == &[0.0]))
            .filter(|&c| !study.candidates[c].probe)
            .collect();
        let free: Vec<Free> = own.iter().map(|&c| candidates[c].free[0]).collect();
        Singles { columns: around(whole, at, &free), candidates: own }
    }

    /// The candidate that changes the same as a correction, and its parameter for a correction of one.
    pub fn same(&self, own: &Influential) -> Option<(usize, f64)> {
        let size: f64 = own.columns.iter().map(|column| dot(column, column)).sum();
        self.candidates.iter().enumerate().find_map(|(s, &c)| {
            let pairs = || own.columns.iter().zip(&self.columns);
            let both: f64 = pairs().map(|(column, record)| dot(column, &record.columns[s])).sum();
            let other: f64 = pairs().map(|(_, record)| dot(&record.columns[s], &record.columns[s])).sum();
            (both.abs() > MIN_COSINE_OF_SAME * (size * other).sqrt() && other > 0.0)
                .then(|| (c, both / other))
        })
    }
}
