//! Fits of the forward selection with derivatives of a point nearby: a step costs one simulation of every record
//! instead of one for every parameter. Where these derivatives do not hold, a fit has its own.

use super::fit::Free;
use super::forward_selection::{REFINEMENT_ROUNDS, ROUNDS, Run, Weights};
use super::near::{Near, fit_near};
use super::normal::{Columns, columns};
use super::search::Model;
use super::stop;

/// Rounds of a fit without a fold.
const FOLD_ROUNDS: usize = 2;

impl Run<'_> {
    /// Error on folds that a model, fitted again without them, has not seen.
    pub(super) fn held_out_error(&self, weights: &Weights, model: &Model) -> f64 {
        let q = self.question;
        if q.folds.len() < 2 || stop::asked() {
            return self.fitted_error(model);
        }
        let part = |chosen: &[usize]| -> (Vec<usize>, Vec<Vec<f64>>) {
            chosen.iter().map(|&i| (q.records[i], model.fit.locals[i].clone())).unzip()
        };
        let around = self.around(weights, model);
        let squares = q.folds.iter().map(|fold| {
            let rest: Vec<usize> = (0..q.records.len()).filter(|i| !fold.contains(i)).collect();
            let columns: Vec<Columns> = rest.iter().map(|&i| around[i].clone()).collect();
            let (rest, locals) = part(&rest);
            let (own, own_locals) = part(fold);
            let (start, free) = (&model.fit.parameters, &model.fit.free);
            let near = self
                .with(weights, &rest, |search| fit_near(search.system, &rest, start, free, &locals, columns));
            // Where these derivatives do not hold without the fold, it is fitted with its own.
            let p = if near.settled {
                near.fit.parameters
            } else {
                self.fit_records(weights, (&rest, &locals), &model.added, start, FOLD_ROUNDS).fit.parameters
            };
            let own_locals = self.localized(weights, &own, &p, &own_locals);
            own.len() as f64 * q.held_out.error_from(&p, &own, &own_locals).powi(2)
        });
        (squares.sum::<f64>() / q.records.len() as f64).sqrt()
    }

    /// A fitted model fitted again under other weights, with the derivatives where it stands as long as these hold.
    pub(super) fn again(&self, weights: &Weights, model: &Model) -> Model {
        let (fit, columns) = (&model.fit, self.around(weights, model));
        let start = (&fit.parameters[..], &fit.locals[..]);
        let near = self.near(weights, &model.added, start, &fit.free, columns);
        near.unwrap_or_else(|| {
            self.fit(weights, &model.added, &fit.parameters, &fit.locals, REFINEMENT_ROUNDS)
        })
    }

    /// Effects fitted from the parameters `p`, with the derivatives `around` another model and those at the start that
    /// it lacks, as long as these hold.
    pub(super) fn beside(
        &self,
        weights: &Weights,
        (known, around): (&Model, &[Columns]),
        added: &[usize],
        p: &[f64],
    ) -> Model {
        let (q, locals) = (self.question, &known.fit.locals);
        let start = self.start(added, p);
        let own = added.iter().flat_map(|&c| &q.candidates[c].free).copied();
        let free: Vec<Free> = own.chain(q.beside(added)).collect();
        let place = |f: &Free| known.fit.free.iter().position(|other| other.index == f.index);
        let new: Vec<Free> = free.iter().filter(|f| place(f).is_none()).copied().collect();
        let starts: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
        let mut columns = self.with(weights, &q.records, |search| {
            columns(search.system, &q.records, &start, &new, &starts, false, None)
        });
        for (own, around) in columns.iter_mut().zip(around) {
            let mut fresh = std::mem::take(&mut own.columns).into_iter();
            let shared = free.iter().filter_map(|f| match place(f) {
                Some(place) => Some(around.columns[place].clone()),
                None => fresh.next(),
            });
            own.columns = shared.chain(around.columns[known.fit.free.len()..].iter().cloned()).collect();
        }
        let near = self.near(weights, added, (&start, locals), &free, columns);
        near.unwrap_or_else(|| self.fit(weights, added, p, locals, ROUNDS))
    }

    /// A fit to all records with derivatives of a point nearby; none where these do not hold.
    fn near(
        &self,
        weights: &Weights,
        added: &[usize],
        (p, locals): (&[f64], &[Vec<f64>]),
        free: &[Free],
        columns: Vec<Columns>,
    ) -> Option<Model> {
        self.with(weights, &self.question.records, |search| {
            let Near { fit, settled } = fit_near(search.system, &search.records, p, free, locals, columns);
            settled.then(|| Model { added: added.to_vec(), left: search.left(&fit), fit })
        })
    }

    /// All records around a model, `[records]`.
    pub(super) fn around(&self, weights: &Weights, model: &Model) -> Vec<Columns> {
        let (q, fit) = (self.question, &model.fit);
        let locals: Vec<&[f64]> = fit.locals.iter().map(Vec::as_slice).collect();
        self.with(weights, &q.records, |search| {
            columns(search.system, &q.records, &fit.parameters, &fit.free, &locals, true, None)
        })
    }
}
