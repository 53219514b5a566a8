//! Windows that start from measured states: residuals without what noise of those states gives.
//!
//! In a window, noise d of the states that it starts from moves all outputs by S d. Where a system forgets slowly, or
//! is unstable, that is most of what a true model leaves, and whatever brakes its growth would be paid for it. With S
//! of the declared model or the best one, in units of the noise of states and sensors, the residual a of a window has
//! the covariance `1 + S S'`; its inverse root, `1 - S V h(L) V'S'` with `S'S = V L V'` and
//! `h(L) = (1 - 1/sqrt(1 + L))/L`, makes it white again (generalized least squares).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::declaration::Role;
use super::fits::{Fits, pieces};
use super::model::Study;
use super::noise;
use super::simulate::{Shift, View};
use crate::engine::{System, parallel};

/// Difference step of a state over the largest of its values.
const STEP: f64 = 1e-4;
/// Seed of the draws of noise.
const SEED: u64 = 0x57a7;

/// How the outputs of a record answer noise of the states that its windows start from.
#[derive(Debug, Clone, Default)]
pub struct Starts {
    /// Samples of a window.
    window: usize,
    /// Samples of the record.
    n: usize,
    /// By state: its noise, carried to the outputs, in units of their noise, `[outputs][n]`.
    carried: Vec<Vec<f64>>,
}

/// Answers of all records of a study, with the candidates `added` beside the declared model and parameters `p`; empty:
/// it has no windows.
pub fn starts(study: &Study, added: &[usize], p: &[f64]) -> Vec<Starts> {
    if study.windows.is_none() {
        return Vec::new();
    }
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let mut found = vec![Starts::default(); study.records.len()];
    for role in [Role::Estimation, Role::Validation] {
        let view = fits.view(added, &pieces(study, role));
        let all = parallel::map(view.pieces.len(), |r| of_record(&view, r, p));
        for (piece, own) in view.pieces.iter().zip(all) {
            found[piece.record] = own.unwrap_or_default();
        }
    }
    found
}

/// Answers of a record, simulated as a whole; none where the model cannot follow it to its end.
fn of_record(view: &View, r: usize, p: &[f64]) -> Option<Starts> {
    let study = view.study;
    let record = &study.records[view.pieces[r].record];
    let window = study.window(record.step)?;
    let base = view.predict(r, p, &[]);
    let noises = noise::of_states(study, record, SEED);
    let mut found = Starts { window, n: record.n, carried: Vec::new() };
    for (i, noise) in noises.iter().enumerate() {
        let (Some(noise), Some(values)) = (noise, &record.states[i]) else { continue };
        let size = STEP * values.iter().fold(1e-6f64, |a, b| a.max(b.abs()));
        let mut states = vec![None; record.states.len()];
        states[i] = Some(vec![size; record.n]);
        let moved = view.shifted(r, p, &[], &Shift { states, ..Shift::default() });
        let outputs = moved.iter().zip(&base).enumerate();
        let mut own: Vec<f64> =
            outputs.map(|(at, (a, b))| (a - b) / size * noise / study.outputs[at / record.n].noise).collect();
        view.silence(r, &mut own);
        if own.iter().any(|value| !value.is_finite()) {
            return None;
        }
        found.carried.push(own);
    }
    Some(found)
}

impl Starts {
    /// Whether a measured state is known to move the outputs.
    pub fn is_known(&self) -> bool {
        !self.carried.is_empty()
    }

    /// Whitens the residuals `a` of a span of the record, `[outputs][span]` in units of the noise, in place; nothing
    /// where the span does not begin with a window.
    pub fn whiten(&self, span: &Range<usize>, a: &mut [f64]) {
        let (count, length) = (self.carried.len(), span.len());
        if count == 0 || length == 0 || !span.start.is_multiple_of(self.window) || span.end > self.n {
            return;
        }
        let outputs = a.len() / length;
        for begin in span.clone().step_by(self.window) {
            let end = (begin + self.window).min(span.end);
            // One output of the window, of the residual and of what a state carries.
            let own = |o: usize| o * length + begin - span.start..o * length + end - span.start;
            let carried = |i: usize, o: usize| &self.carried[i][o * self.n + begin..o * self.n + end];
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let sum = |of: &dyn Fn(usize) -> f64| (0..outputs).map(of).sum::<f64>();
            let products = DMatrix::from_fn(count, count, |i, j| sum(&|o| dot(carried(i, o), carried(j, o))));
            let right = DVector::from_fn(count, |i, _| sum(&|o| dot(carried(i, o), &a[own(o)])));
            let eigen = products.symmetric_eigen();
            let mut along = eigen.eigenvectors.transpose() * right;
            along.iter_mut().zip(&eigen.eigenvalues).for_each(|(value, square)| *value *= shrinking(*square));
            let taken = eigen.eigenvectors * along;
            for o in 0..outputs {
                for (i, taken) in taken.iter().enumerate() {
                    a[own(o)].iter_mut().zip(carried(i, o)).for_each(|(a, carried)| *a -= taken * carried);
                }
            }
        }
    }
}

/// `(1 - 1/sqrt(1 + L))/L`, 1/2 at 0.
fn shrinking(square: f64) -> f64 {
    let root = (1.0 + square.max(0.0)).sqrt();
    1.0 / (root * (1.0 + root))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_root_of_the_covariance_is_applied_window_by_window() {
        // Two outputs, two states, windows of three samples.
        let n = 6;
        let value = |i: usize, k: usize| ((3 * i + 2) as f64 * (k as f64 + 0.7)).sin() * 3.0;
        let carried: Vec<Vec<f64>> = (0..2).map(|i| (0..2 * n).map(|k| value(i, k)).collect()).collect();
        let starts = Starts { window: 3, n, carried: carried.clone() };
        let a: Vec<f64> = (0..2 * n).map(|k| (k as f64).cos()).collect();
        let mut white = a.clone();
        starts.whiten(&(0..n), &mut white);
        for begin in [0, 3] {
            let rows: Vec<usize> = (0..2).flat_map(|o| (0..3).map(move |k| o * n + begin + k)).collect();
            let s = DMatrix::from_fn(6, 2, |row, i| carried[i][rows[row]]);
            let covariance = DMatrix::identity(6, 6) + &s * s.transpose();
            let own = DVector::from_fn(6, |row, _| a[rows[row]]);
            let expected = own.dot(&(covariance.clone().try_inverse().unwrap() * &own));
            let found: f64 = rows.iter().map(|&row| white[row].powi(2)).sum();
            assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
        }
        // A span of it, from a window on, is the same.
        let mut part: Vec<f64> = [&a[3..6], &a[9..12]].concat();
        starts.whiten(&(3..6), &mut part);
        for (a, b) in part.iter().zip(white[3..6].iter().chain(&white[9..12])) {
            assert!((a - b).abs() < 1e-12);
        }
    }
}
