//! One step of the forward selection: which candidates are worth a fit, and how the fitted ones compare.

use super::fit::Fit;
use super::forward_selection::{OTHERS_TAKE_MORE, REFINEMENT_ROUNDS, ROUNDS, Run, Weights};
use super::question::Tried;
use super::search::{Model, Promise};
use super::{parallel, stop};
use crate::order::ascending;

/// Candidates fitted because of their predicted gain with the corrections, and because of their gain without them.
const FITTED_CANDIDATES: (usize, usize) = (5, 5);
/// Other values of declared parameters that are fitted beside them.
const FITTED_CHANGES: usize = 2;
/// Candidates that are fitted again under the weights of the best.
const REFITTED_CANDIDATES: usize = 4;

impl Run<'_> {
    /// Candidates worth a fit among those that may join, with the parameters to start from.
    fn promising(&self, base: &Model, weights: &Weights, may_join: &dyn Fn(usize) -> bool) -> Vec<Promise> {
        let q = self.question;
        let (parameters, locals) = self.uncorrected(weights, base);
        let held = Model {
            fit: Fit {
                parameters,
                locals: locals.clone(),
                free: base
                    .added
                    .iter()
                    .flat_map(|&c| &q.candidates[c].free)
                    .chain(q.always)
                    .copied()
                    .collect(),
                ..base.fit.clone()
            },
            ..base.clone()
        };
        let may = |c: usize| !q.free_forms.contains(&c) && may_join(c);
        // Beside corrections a change has the entry of one of them.
        let unchanged = |c: usize| may(c) && !q.is_change(c);
        let [beside, without] = self.with(weights, &q.records, |search| {
            [distinct(search.screen_some(base, &unchanged)), distinct(search.screen_some(&held, &may))]
        });
        let records: Vec<usize> = q.screened.iter().map(|&i| q.records[i]).collect();
        let [locals, bent] = [&locals, &base.fit.locals]
            .map(|own| q.screened.iter().map(|&i| own[i].clone()).collect::<Vec<_>>());
        let errors = parallel::map(without.len(), |i| {
            q.held_out.error_from(&without[i].parameters, &records, &locals)
        });
        let mut alone: Vec<(f64, Promise)> = errors.into_iter().zip(without).collect();
        ascending(&mut alone, |own| own.0);
        // Corrections may have been bent to do what the effect does. From zero the linear step finds the way back; an
        // effect that starts at values of its own begins where less is left, beside the corrections or without them.
        let straightened = |mut own: Promise| {
            let has_values = q.candidates[own.candidate].starts.iter().all(|start| start.open.is_empty());
            let straight = alone.iter().find(|(_, other)| has_values && other.candidate == own.candidate);
            if let Some((error, other)) = straight
                && *error < q.held_out.error_from(&own.parameters, &records, &bent)
            {
                own.parameters.clone_from(&other.parameters);
            }
            own
        };
        let mut chosen: Vec<Promise> =
            beside.into_iter().take(FITTED_CANDIDATES.0).map(straightened).collect();
        let (changes, alone): (Vec<_>, Vec<_>) =
            alone.into_iter().map(|own| own.1).partition(|own| q.is_change(own.candidate));
        for promise in alone {
            let far = q.same(promise.candidate).is_some_and(|c| {
                let moved = base.fit.parameters[c.free.index].abs();
                c.free.prior.is_some_and(|tolerance| moved > 1.5 * tolerance)
            });
            let few = chosen.len() < FITTED_CANDIDATES.0 + FITTED_CANDIDATES.1;
            if (few || far) && !chosen.iter().any(|other| other.candidate == promise.candidate) {
                chosen.push(promise);
            }
        }
        chosen.extend(changes.into_iter().take(FITTED_CHANGES));
        chosen
    }

    /// One step: candidates fitted and judged, best first, and the weights that they were judged with.
    pub(super) fn step(&self, base: &Model, weights: &Weights) -> (Vec<Tried>, Weights) {
        self.step_with(base, weights, &|c| (self.question.may_join)(c, &base.added))
    }

    /// One step, and one with the candidates that join only where no other does, if that is so.
    pub(super) fn step_or_last(&self, base: &Model, weights: &Weights) -> (Vec<Tried>, Weights) {
        let last = self.question.last;
        let (mut tried, first_weights) = self.step(base, weights);
        if last.is_empty() || !base.added.is_empty() || self.accepted(&tried).is_some() {
            return (tried, first_weights);
        }
        let (mut of_last, weights) = self.step_with(base, weights, &|c| last.contains(&c));
        if self.accepted(&of_last).is_some() {
            of_last.append(&mut tried);
            return (of_last, weights);
        }
        tried.append(&mut of_last);
        (tried, first_weights)
    }

    /// One step with the candidates that may join.
    fn step_with(
        &self,
        base: &Model,
        weights: &Weights,
        may_join: &dyn Fn(usize) -> bool,
    ) -> (Vec<Tried>, Weights) {
        let q = self.question;
        let mut fitted: Vec<(f64, Model)> = self
            .promising(base, weights, may_join)
            .into_iter()
            .enumerate()
            .take_while(|(rank, _)| *rank == 0 || !stop::asked())
            .map(|(_, promise)| {
                let mut added = base.added.clone();
                added.push(promise.candidate);
                let model = self.fit(weights, &added, &promise.parameters, &base.fit.locals, ROUNDS);
                (self.fitted_error(&model), model)
            })
            .filter(|(_, model)| {
                let change = model.added.last().filter(|&&c| q.is_change(c));
                change.is_none_or(|&c| q.is_beyond_correction(c, &model.fit.parameters))
            })
            .collect();
        ascending(&mut fitted, |own| own.0);
        let Some(best) = fitted.first_mut() else { return (Vec::new(), weights.clone()) };
        let (model, weights) = self.reweighed(best.1.clone());
        best.1 = model;
        let base = self.fit(&weights, &base.added, &base.fit.parameters, &base.fit.locals, REFINEMENT_ROUNDS);
        let base_error = self.held_out_error(&weights, &base);
        let base_fitted = self.fitted_error(&base);
        let before = self.error_without_corrections(&weights, &base);
        let mut tried: Vec<Tried> = Vec::new();
        for (rank, (error, model)) in fitted.into_iter().enumerate() {
            let candidate = model.added[model.added.len() - 1];
            let (mut model, mut error) = (model, error);
            let again = rank < REFITTED_CANDIDATES;
            let mut reference = (base.fit.chi2, if again { base_error } else { base_fitted });
            if again {
                model = self.fit(
                    &weights,
                    &model.added,
                    &model.fit.parameters,
                    &model.fit.locals,
                    REFINEMENT_ROUNDS,
                );
                error = self.held_out_error(&weights, &model);
            }
            if let Some(same) = q.same(candidate).filter(|_| again) {
                reference = self.without(&base, same, &weights);
            }
            let mut own = Tried {
                candidate,
                gain: reference.0 - model.fit.chi2,
                held_out: (reference.1 - error) / self.declared_error,
                error,
                alone: if again {
                    1.0 - self.error_without_corrections(&weights, &model) / before
                } else {
                    f64::NAN
                },
                model,
                rejected: None,
            };
            own.rejected = if again { self.objection(&own) } else { Some(OTHERS_TAKE_MORE.into()) };
            tried.push(own);
        }
        // Those that were not fitted again have an error of the fit, which is no match for one on held-out folds.
        let judged = REFITTED_CANDIDATES.min(tried.len());
        let (again, once) = tried.split_at_mut(judged);
        ascending(again, |own| own.error);
        ascending(once, |own| own.error);
        (tried, weights)
    }
}

/// The best predicted start of every candidate, in order.
pub(super) fn distinct(promises: Vec<Promise>) -> Vec<Promise> {
    let mut found: Vec<Promise> = Vec::new();
    for promise in promises {
        if !found.iter().any(|other| other.candidate == promise.candidate) {
            found.push(promise);
        }
    }
    found
}
