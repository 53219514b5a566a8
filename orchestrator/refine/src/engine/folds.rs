//! Error on folds of the records that are held out in turn.
//!
//! A fit without a fold lies near the fit to all records, so that the derivatives around that serve for all folds;
//! where they do not hold, a fold is fitted with its own.

use super::forward_selection::{Run, Weights};
use super::near::fit_near;
use super::normal::{Columns, columns};
use super::search::Model;
use super::stop;
use super::weighted::Weighted;

/// Rounds of a fit without a fold, with derivatives of its own.
const ROUNDS: usize = 2;

impl Run<'_> {
    /// Error on folds that a model, fitted again without them, has not seen.
    pub(super) fn held_out_error(&self, weights: &Weights, model: &Model) -> f64 {
        let q = self.question;
        if q.folds.len() < 2 || stop::asked() {
            return self.fitted_error(model);
        }
        let around = self.around(weights, model);
        let squares = q.folds.iter().map(|fold| {
            let error = self.near_error(weights, model, &around, fold);
            let error = error.unwrap_or_else(|| self.error_afresh(weights, model, fold));
            fold.len() as f64 * error.powi(2)
        });
        (squares.sum::<f64>() / q.records.len() as f64).sqrt()
    }

    /// Residuals and derivatives around a model, `[records]`.
    pub(super) fn around(&self, weights: &Weights, model: &Model) -> Vec<Columns> {
        let (q, fit) = (self.question, &model.fit);
        let locals: Vec<&[f64]> = fit.locals.iter().map(Vec::as_slice).collect();
        let system = Weighted::new(q.system, weights);
        columns(&system, &q.records, &fit.parameters, &fit.free, &locals, true, None)
    }

    /// Error on a fold from the derivatives `around` a model; none where these do not hold.
    pub(super) fn near_error(
        &self,
        weights: &Weights,
        model: &Model,
        around: &[Columns],
        fold: &[usize],
    ) -> Option<f64> {
        let q = self.question;
        let (system, shared) = (Weighted::new(q.system, weights), model.fit.free.len());
        let near = |chosen: &[usize], first: usize, p: &[f64]| {
            let columns = chosen
                .iter()
                .map(|&i| Columns { residuals: Vec::new(), columns: around[i].columns[first..].to_vec() });
            let (records, locals) = part(&q.records, &model.fit.locals, chosen);
            let free = &model.fit.free[first..];
            let found = fit_near(&system, &records, p, free, &locals, columns.collect());
            found.settled.then_some((records, found.fit))
        };
        let rest: Vec<usize> = (0..q.records.len()).filter(|i| !fold.contains(i)).collect();
        let p = near(&rest, 0, &model.fit.parameters)?.1.parameters;
        let (records, locals) = part(&q.records, &model.fit.locals, fold);
        if locals.iter().all(Vec::is_empty) {
            return Some(q.held_out.error_from(&p, &records, &locals));
        }
        let (records, own) = near(fold, shared, &p)?;
        Some(q.held_out.error_from(&p, &records, &own.locals))
    }

    /// Error on a fold from a fit without it.
    pub(super) fn error_afresh(&self, weights: &Weights, model: &Model, fold: &[usize]) -> f64 {
        let q = self.question;
        let rest: Vec<usize> = (0..q.records.len()).filter(|i| !fold.contains(i)).collect();
        let (records, locals) = part(&q.records, &model.fit.locals, &rest);
        let refit =
            self.fit_records(weights, (&records, &locals), &model.added, &model.fit.parameters, ROUNDS);
        let p = &refit.fit.parameters;
        let (records, locals) = part(&q.records, &model.fit.locals, fold);
        q.held_out.error_from(p, &records, &self.localized(weights, &records, p, &locals))
    }
}

/// Records at some positions, and their local parameters.
fn part(records: &[usize], locals: &[Vec<f64>], chosen: &[usize]) -> (Vec<usize>, Vec<Vec<f64>>) {
    chosen.iter().map(|&i| (records[i], locals[i].clone())).unzip()
}
