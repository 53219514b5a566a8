//! Forward selection of the effects that matter where no model reaches the sensor noise.
//!
//! The declared parameters are free within their tolerances in every fit, so that they compete with the effects. The
//! residuals count as many independent samples as they hold ([`Weighted`]). An effect is accepted for the share of the
//! error on held-out records that it takes away beyond the corrected parameters, however far from the noise the model
//! ends.

use std::collections::BTreeMap;

use super::fit::Free;
use super::goodness::Null;
use super::normal::residuals;
use super::question::{Correction, Found, FreeForm, Question, Step, Tried};
use super::search::{Model, Promise, Rules, Search};
use super::sets;
use super::stop;
use super::weighted::{Weighted, long_run};

/// Finds the effects that take away most of the error.
pub fn search(question: &Question) -> Found {
    question.system.stage("corrections");
    let run = Run::new(question);
    let declared_error = run.declared_error;
    let mut weights = run.weights(question.declared, &question.locals);
    let mut base = run.fit(&weights, &[], question.declared, &question.locals, ROUNDS);
    for _ in 0..2 {
        weights = run.weights(&base.fit.parameters, &base.fit.locals);
        base = run.fit(&weights, &[], &base.fit.parameters, &base.fit.locals, ROUNDS);
    }
    (base, weights) = run.reweighed(base);
    let mut found = Found {
        best: base.clone(),
        one_by_one: Default::default(),
        base,
        steps: Vec::new(),
        equals: Vec::new(),
        declared_error,
        free_form: None,
    };
    question.system.stage("effects beside corrections");
    while found.best.added.len() < question.most && !stop::asked() {
        let added = found.best.added.clone();
        let (tried, reweighed) = run.step_or_last(&found.best, &weights);
        let accepted = run.accepted(&tried).cloned();
        let step = Step { added, tried };
        if let Some(accepted) = &accepted {
            let equals = run.equals(&step, accepted);
            found.equals.extend(equals.into_iter().map(|other| (accepted.candidate, other)));
            found.best = accepted.model.clone();
            weights = reweighed;
        }
        found.steps.push(step);
        // The residual must hold at least as much as the next effect has to take away.
        let worth =
            |accepted: Tried| accepted.error >= question.settings.min_held_out_share * run.whole_error;
        if !accepted.is_some_and(worth) {
            break;
        }
    }
    found.one_by_one = (found.best.added.clone(), found.best.fit.parameters.clone());
    if !stop::asked() {
        question.system.stage("several effects at once");
        run.sets(&mut found);
        run.exchange(&mut found);
    }
    if !stop::asked() {
        question.system.stage("form of the effects");
        found.free_form = run.free_form(&found.base, &found.best);
    }
    tell_others(&mut found);
    found
}

/// Gives a reason to candidates without objection that are neither in the answer nor as good as an effect of it, and
/// takes what a set of effects needed from those that another set has replaced.
fn tell_others(found: &mut Found) {
    let tried = found.steps.iter_mut().flat_map(|step| &mut step.tried);
    for own in tried.filter(|own| !found.best.added.contains(&own.candidate)) {
        if let Some(reason) = own.rejected.as_mut()
            && let Some(rest) = reason.strip_suffix(sets::NEEDED)
        {
            *reason = rest.to_owned();
        }
    }
    let tried = found.steps.iter_mut().flat_map(|step| &mut step.tried);
    for own in tried.filter(|own| own.rejected.is_none()) {
        let as_good = found.equals.iter().any(|(_, other)| other.candidate == own.candidate);
        if !as_good && !found.best.added.contains(&own.candidate) {
            own.rejected = Some(OTHERS_TAKE_MORE.into());
        }
    }
}

/// A set of effects beside corrections, fitted from `start` under the weights of what they leave.
pub fn refit(question: &Question, added: &[usize], start: &[f64]) -> Found {
    let run = Run::new(question);
    let locals = &question.locals;
    let first = run.fit(&run.weights(start, locals), added, start, locals, ROUNDS);
    let weights = run.weights(&first.fit.parameters, &first.fit.locals);
    let best = run.fit(&weights, added, &first.fit.parameters, &first.fit.locals, ROUNDS);
    let base = run.fit(&weights, &[], question.declared, locals, ROUNDS);
    let free_form = run.free_form(&base, &best);
    let declared_error = run.declared_error;
    let one_by_one = (added.to_vec(), best.fit.parameters.clone());
    let (steps, equals) = (Vec::new(), Vec::new());
    Found { base, best, one_by_one, steps, equals, declared_error, free_form }
}

/// Parameters of a set of effects beside corrections, fitted from several starts: those that leave the least error.
pub fn fitted_from(question: &Question, added: &[usize], starts: &[Vec<f64>]) -> Option<Vec<f64>> {
    let run = Run::new(question);
    let locals = &question.locals;
    let one = |start: &Vec<f64>| {
        let model = run.fit(&run.weights(start, locals), added, start, locals, ROUNDS);
        (run.fitted_error(&model), model.fit.parameters)
    };
    let best = starts.iter().map(one).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, parameters)| parameters)
}

/// Rounds of a fit, and of its refinement.
pub(super) const ROUNDS: usize = 6;
pub(super) const REFINEMENT_ROUNDS: usize = 4;
/// Fits under the weights of the fit before, and the ratio of their errors above which there is no further one.
const MAX_REWEIGHTS: usize = 8;
const MAX_ERROR_RATIO_OF_REWEIGHTS: f64 = 0.9;
/// Share of a tolerance within which a correction stays that is taken back.
const TOLERANCE_OF_TAKEN_BACK: f64 = 1e-3;
/// Rounds of a fit of local parameters alone.
const LOCAL_ROUNDS: usize = 3;
/// Reason of a candidate that nothing else speaks against.
pub(crate) const OTHERS_TAKE_MORE: &str = "others take more of the error away";
/// Free forms that are fitted.
const FITTED_FREE_FORMS: usize = 2;
pub(super) type Weights = BTreeMap<String, f64>;

/// A search at work.
pub(super) struct Run<'a> {
    pub(super) question: &'a Question<'a>,
    pub(super) null: Null,
    pub(super) declared_error: f64,
    /// Error that an effect has to take a share of: that of the declared model, or the spread of the records where that
    /// is less, as shares of an error larger than all that the records show would leave most of them unexplained.
    pub(super) whole_error: f64,
}

impl<'a> Run<'a> {
    fn new(question: &'a Question<'a>) -> Run<'a> {
        let (records, locals) = (&question.records, &question.locals);
        let null = Null::simulate(question.system, records, question.declared, locals, 4, 1);
        let declared_error = question.held_out.error_from(question.declared, records, locals);
        let spread = question.held_out.spread(records);
        let whole_error = if spread > 0.0 { declared_error.min(spread) } else { declared_error };
        Run { question, null, declared_error, whole_error }
    }

    /// Long-run variances of the residuals at `p` and `locals`.
    pub(super) fn weights(&self, p: &[f64], locals: &[Vec<f64>]) -> Weights {
        let q = self.question;
        let own = residuals(q.system, &q.records, p, locals);
        long_run(q.system, &q.records, &own)
    }

    pub(super) fn with<T>(
        &self,
        weights: &Weights,
        records: &[usize],
        f: impl FnOnce(&Search<Weighted>) -> T,
    ) -> T {
        let q = self.question;
        let system = Weighted::new(q.system, weights);
        let (records, screened, null) = (records.to_vec(), q.screened.clone(), self.null.clone());
        f(&Search {
            system: &system,
            candidates: q.candidates,
            records,
            screened,
            null,
            rules: Rules::default(),
        })
    }

    /// A fit of effects and corrections.
    pub(super) fn fit(
        &self,
        weights: &Weights,
        added: &[usize],
        start: &[f64],
        locals: &[Vec<f64>],
        rounds: usize,
    ) -> Model {
        self.fit_records(weights, (&self.question.records, locals), added, start, rounds)
    }

    /// A fit to some records with their local parameters to start from.
    pub(super) fn fit_records(
        &self,
        weights: &Weights,
        (records, locals): (&[usize], &[Vec<f64>]),
        added: &[usize],
        start: &[f64],
        rounds: usize,
    ) -> Model {
        let mut start = start.to_vec();
        for correction in self.question.corrections {
            let replaced = |effect: usize| added.contains(&effect) && !self.question.is_change(effect);
            if correction.effect.is_some_and(replaced) {
                start[correction.free.index] = self.question.declared[correction.free.index];
            }
        }
        let extra = self.question.beside(added);
        self.with(weights, records, |search| search.fit(added, &extra, &start, locals, rounds))
    }

    /// A model fitted under the weights of what it leaves itself, and these weights.
    ///
    /// Under those of a model that leaves much more the data say little against the tolerances of the corrections, so
    /// that one fit ends in the middle of the way.
    pub(super) fn reweighed(&self, mut model: Model) -> (Model, Weights) {
        let mut error = self.fitted_error(&model);
        let mut weights = self.weights(&model.fit.parameters, &model.fit.locals);
        for _ in 0..MAX_REWEIGHTS {
            let fit = &model.fit;
            let next = self.fit(&weights, &model.added, &fit.parameters, &fit.locals, REFINEMENT_ROUNDS);
            let left = self.fitted_error(&next);
            if left > MAX_ERROR_RATIO_OF_REWEIGHTS * error || stop::asked() {
                break;
            }
            weights = self.weights(&next.fit.parameters, &next.fit.locals);
            (model, error) = (next, left);
        }
        (model, weights)
    }

    /// Local parameters that fit some records best at `p`, from those given.
    pub(super) fn localized(
        &self,
        weights: &Weights,
        records: &[usize],
        p: &[f64],
        locals: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        if locals.iter().all(Vec::is_empty) {
            return locals.to_vec();
        }
        self.with(weights, records, |search| search.fit(&[], &[], p, locals, LOCAL_ROUNDS)).fit.locals
    }

    /// Parameters and local ones of a model whose corrections are taken back to what is declared, while those that are
    /// always free follow: they may make up for one another. One whose place an effect has taken is no correction.
    pub(super) fn uncorrected(&self, weights: &Weights, model: &Model) -> (Vec<f64>, Vec<Vec<f64>>) {
        let q = self.question;
        let fit = &model.fit;
        let back = |own: &Correction| {
            let prior = own.free.prior.map(|tolerance| TOLERANCE_OF_TAKEN_BACK * tolerance);
            Free { prior, ..own.free }
        };
        let is_moved = |own: &&Correction| {
            let is_replaced = own.effect.is_some_and(|effect| model.added.contains(&effect));
            !is_replaced && fit.parameters[own.free.index] != q.declared[own.free.index]
        };
        let corrections: Vec<Free> = q.corrections.iter().filter(is_moved).map(back).collect();
        if q.always.is_empty() || corrections.is_empty() {
            return (q.without_corrections(&fit.parameters, &model.added), fit.locals.clone());
        }
        let extra = [q.always, &corrections].concat();
        let (p, locals) = (&fit.parameters, &fit.locals);
        let own = self.with(weights, &q.records, |search| search.fit(&[], &extra, p, locals, ROUNDS)).fit;
        (q.without_corrections(&own.parameters, &model.added), own.locals)
    }

    /// Error of a model on all records without its corrections.
    pub(super) fn error_without_corrections(&self, weights: &Weights, model: &Model) -> f64 {
        let (p, locals) = self.uncorrected(weights, model);
        self.error_at(weights, &p, &locals)
    }

    /// Error at `p` on all records, with the local parameters that fit best.
    fn error_at(&self, weights: &Weights, p: &[f64], locals: &[Vec<f64>]) -> f64 {
        let q = self.question;
        q.held_out.error_from(p, &q.records, &self.localized(weights, &q.records, p, locals))
    }

    /// Error of a model on the records that it was fitted to.
    pub(super) fn fitted_error(&self, model: &Model) -> f64 {
        self.question.held_out.error_from(&model.fit.parameters, &self.question.records, &model.fit.locals)
    }

    /// Weighted sum of squares and held-out error of a model without one of its corrections.
    pub(super) fn without(&self, base: &Model, correction: &Correction, weights: &Weights) -> (f64, f64) {
        let mut start = base.fit.parameters.clone();
        start[correction.free.index] = self.question.declared[correction.free.index];
        let q = self.question;
        let extra: Vec<Free> =
            q.beside(&base.added).into_iter().filter(|f| f.index != correction.free.index).collect();
        let locals = &base.fit.locals;
        let model = self.with(weights, &q.records, |search| {
            search.fit(&base.added, &extra, &start, locals, REFINEMENT_ROUNDS)
        });
        (model.fit.chi2, self.fitted_error(&model))
    }

    /// The free form that takes away much more of the error than the effects of `best`, if one does.
    pub(super) fn free_form(&self, base: &Model, best: &Model) -> Option<FreeForm> {
        let q = self.question;
        if q.free_forms.is_empty() {
            return None;
        }
        let weights = self.weights(&best.fit.parameters, &best.fit.locals);
        let refit = |model: &Model| {
            self.fit(&weights, &model.added, &model.fit.parameters, &model.fit.locals, REFINEMENT_ROUNDS)
        };
        let (base, best) = (refit(base), refit(best));
        let wanted = |c: usize| q.free_forms.contains(&c);
        let promises = self.with(&weights, &q.records, |search| search.screen_some(&base, &wanted));
        let [without, with] = [&base, &best].map(|model| self.held_out_error(&weights, model));
        let share = |error: f64| 1.0 - error / without;
        let enough = q.settings.min_form_share;
        let gained = base.fit.chi2 - best.fit.chi2;
        let hopeful = |promise: &&Promise| {
            let gain = base.fit.chi2 - promise.chi2;
            gain > q.settings.min_gain && enough * gain > gained
        };
        promises
            .iter()
            .filter(hopeful)
            .take(FITTED_FREE_FORMS)
            .map(|promise| {
                let locals = &base.fit.locals;
                let model = self.fit(&weights, &[promise.candidate], &promise.parameters, locals, ROUNDS);
                FreeForm { candidate: promise.candidate, share: share(self.held_out_error(&weights, &model)) }
            })
            .filter(|form| share(with) < enough * form.share && form.share > q.settings.min_held_out_share)
            .max_by(|a, b| a.share.total_cmp(&b.share))
    }
}

#[cfg(test)]
mod tests;
