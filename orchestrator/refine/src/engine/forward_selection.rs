//! The effect that matters where no model reaches the sensor noise.
//!
//! The declared parameters are free within what is known of them in every fit, so that they compete with the effects. The
//! residuals count as many independent samples as they hold ([`Weighted`]). An effect is accepted for the share of the
//! error on held-out records that it takes away beyond the corrected parameters; how far from the noise the model ends is
//! no reason against it.

use std::collections::BTreeMap;

use super::candidate::Candidate;
use super::fit::{Fit, Free};
use super::goodness::Null;
use super::held_out::HeldOut;
use super::normal::residuals;
use super::search::{Model, Promise, Search};
use super::settings::ForwardSelection as Settings;
use super::weighted::{Weighted, long_run};
use super::{System, parallel, stop};

/// A declared parameter that may be off within its tolerance.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// Its correction, with the tolerance as prior and bounds as far as a correction may go.
    pub free: Free,
    /// Candidate that does the same, if there is one: its first parameter is the correction times `declared`.
    pub effect: Option<usize>,
    /// Declared value.
    pub declared: f64,
}

/// What is searched.
pub struct Question<'a> {
    /// System.
    pub system: &'a dyn System,
    /// Error of its predictions.
    pub held_out: &'a HeldOut<'a>,
    /// Candidates.
    pub candidates: &'a [Candidate],
    /// Corrections of the declared parameters.
    pub corrections: &'a [Correction],
    /// Parameter vector of the declared model.
    pub declared: &'a [f64],
    /// Declared parameters that every fit is free to choose.
    pub always: &'a [Free],
    /// Local parameters of the declared model, by position in `records`; empty vectors where there are none.
    pub locals: Vec<Vec<f64>>,
    /// Whether a candidate may join the effects found before.
    pub may_join: &'a (dyn Fn(usize, &[usize]) -> bool + Sync),
    /// Sets of effects that another search found, with parameters to start from.
    pub proposals: &'a [(Vec<usize>, Vec<f64>)],
    /// Whether two effects are tried together where none is accepted alone.
    pub pairs: bool,
    /// Candidates that are free forms over one variable: they join nothing, but tell whether effects have the right form.
    pub free_forms: &'a [usize],
    /// Estimation records.
    pub records: Vec<usize>,
    /// Positions in `records` of those that candidates are screened on.
    pub screened: Vec<usize>,
    /// Folds of positions in `records`, each held out in turn.
    pub folds: Vec<Vec<usize>>,
    /// Why a fitted candidate makes no sense, if it does not.
    pub sense: &'a (dyn Fn(&Candidate, &Model) -> Option<String> + Sync),
    /// Settings.
    pub settings: Settings,
    /// Most effects.
    pub most: usize,
}

/// A candidate that was fitted beside the corrections and the effects found before it.
#[derive(Debug, Clone)]
pub struct Tried {
    /// Candidate.
    pub candidate: usize,
    /// The fit.
    pub model: Model,
    /// Fall of the weighted sum of squares.
    pub gain: f64,
    /// Fall of the error on held-out records, as a share of the error of the declared model.
    pub held_out: f64,
    /// Error that is left on the held-out records \[units\].
    pub error: f64,
    /// Share of the error of the model before it that it takes away without any correction.
    pub alone: f64,
    /// Why it was not accepted.
    pub rejected: Option<String>,
}

/// One step of the forward selection.
#[derive(Debug, Clone)]
pub struct Step {
    /// Effects found before.
    pub added: Vec<usize>,
    /// Candidates that were fitted, best first.
    pub tried: Vec<Tried>,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Corrections alone.
    pub base: Model,
    /// Corrections and effects.
    pub best: Model,
    /// Steps, the last one without an accepted candidate unless `most` was reached.
    pub steps: Vec<Step>,
    /// Candidates that the records cannot tell from an accepted one: accepted, other model.
    pub equals: Vec<(usize, Tried)>,
    /// Error of the declared model on the estimation records \[units\].
    pub declared_error: f64,
    /// The free form that takes away much more than the effects do, if one does.
    pub free_form: Option<FreeForm>,
}

/// A free form that takes away more of the error than the effects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeForm {
    /// Candidate.
    pub candidate: usize,
    /// Share of the error on held-out records, beyond the corrections, that it takes away.
    pub share: f64,
}

/// Finds the effects that take away most of the error.
pub fn search(question: &Question) -> Found {
    question.system.stage("corrections");
    let null = Null::simulate(question.system, &question.records, question.declared, &question.locals, 4, 1);
    let declared_error = question.held_out.error_from(question.declared, &question.records, &question.locals);
    let run = Run { question, null, declared_error };
    let mut weights = run.weights(question.declared, &question.locals);
    let mut base = run.fit(&weights, &[], question.declared, &question.locals, ROUNDS);
    for _ in 0..2 {
        weights = run.weights(&base.fit.parameters, &base.fit.locals);
        base = run.fit(&weights, &[], &base.fit.parameters, &base.fit.locals, ROUNDS);
    }
    let mut found = Found {
        best: base.clone(),
        base,
        steps: Vec::new(),
        equals: Vec::new(),
        declared_error,
        free_form: None,
    };
    question.system.stage("effects beside corrections");
    while found.best.added.len() < question.most && !stop::asked() {
        let added = found.best.added.clone();
        let (tried, reweighed) = run.step(&found.best, &weights);
        let accepted = run.accepted(&tried).cloned();
        let step = Step { added, tried };
        if let Some(accepted) = &accepted {
            let equals = run.equals(&step, accepted);
            found.equals.extend(equals.into_iter().map(|other| (accepted.candidate, other)));
            found.best = accepted.model.clone();
            weights = reweighed;
        }
        found.steps.push(step);
        // What is left must hold at least what the next effect has to take away.
        let worth = |accepted: Tried| accepted.error >= question.settings.min_held_out_share * declared_error;
        if !accepted.is_some_and(worth) {
            break;
        }
    }
    if !stop::asked() {
        question.system.stage("several effects at once");
        run.sets(&mut found);
    }
    if !stop::asked() {
        question.system.stage("form of the effects");
        found.free_form = run.free_form(&found.base, &found.best);
    }
    found
}

/// Rounds of a fit, of its refinement, and of the refits without a fold.
const ROUNDS: usize = 6;
const REFINEMENT_ROUNDS: usize = 4;
const FOLD_ROUNDS: usize = 2;
/// Rounds of a fit of local parameters alone.
const LOCAL_ROUNDS: usize = 3;
/// Candidates that pairs are made of.
const PAIRED_SINGLES: usize = 3;
/// Fall of the error on held-out folds that each effect of a set must bring: as a share of it, and of that of the declared
/// model.
const MIN_FALL_OF_SET: (f64, f64) = (0.05, 0.02);
/// Ratio of the errors of a proposed set and of the best model from which on it is not looked at further.
const MAX_ERROR_RATIO_OF_SET: f64 = 1.1;
/// Free forms that are fitted.
const FITTED_FREE_FORMS: usize = 2;
/// Candidates that are fitted for what they promise beside the corrections, and for what they do without them.
const FITTED_CANDIDATES: (usize, usize) = (5, 5);
/// Candidates that are fitted again under the weights of the best.
const REFITTED_CANDIDATES: usize = 4;

type Weights = BTreeMap<String, f64>;

/// A search at work.
struct Run<'a> {
    question: &'a Question<'a>,
    null: Null,
    declared_error: f64,
}

impl Question<'_> {
    /// Corrections beside the effects `added`, without those that an effect takes the place of, and what is always free.
    fn beside(&self, added: &[usize]) -> Vec<Free> {
        let kept = |c: &&Correction| !c.effect.is_some_and(|effect| added.contains(&effect));
        self.always.iter().copied().chain(self.corrections.iter().filter(kept).map(|c| c.free)).collect()
    }

    /// The correction that a candidate takes the place of.
    fn same(&self, candidate: usize) -> Option<&Correction> {
        self.corrections.iter().find(|c| c.effect == Some(candidate))
    }

    /// Parameters with only these effects: every correction as declared.
    fn without_corrections(&self, p: &[f64], added: &[usize]) -> Vec<f64> {
        let mut q = self.declared.to_vec();
        for free in added.iter().flat_map(|&c| &self.candidates[c].free).chain(self.always) {
            q[free.index] = p[free.index];
        }
        q
    }
}

impl Run<'_> {
    /// Long-run variances of the residuals at `p` and `locals`.
    fn weights(&self, p: &[f64], locals: &[Vec<f64>]) -> Weights {
        let q = self.question;
        let own = residuals(q.system, &q.records, p, locals);
        long_run(q.system, &q.records, &own)
    }

    fn with<T>(&self, weights: &Weights, records: &[usize], f: impl FnOnce(&Search<Weighted>) -> T) -> T {
        let q = self.question;
        let system = Weighted::new(q.system, weights);
        let (records, screened, null) = (records.to_vec(), q.screened.clone(), self.null.clone());
        f(&Search { system: &system, candidates: q.candidates, records, screened, null })
    }

    /// A fit of effects and corrections.
    fn fit(
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
    fn fit_records(
        &self,
        weights: &Weights,
        (records, locals): (&[usize], &[Vec<f64>]),
        added: &[usize],
        start: &[f64],
        rounds: usize,
    ) -> Model {
        let mut start = start.to_vec();
        for correction in self.question.corrections {
            if correction.effect.is_some_and(|effect| added.contains(&effect)) {
                start[correction.free.index] = self.question.declared[correction.free.index];
            }
        }
        let extra = self.question.beside(added);
        self.with(weights, records, |search| search.fit(added, &extra, &start, locals, rounds))
    }

    /// Local parameters that fit some records best at `p`, from those given.
    fn localized(
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

    /// Error at `p` on all records, with the local parameters that fit best.
    fn error_at(&self, weights: &Weights, p: &[f64], locals: &[Vec<f64>]) -> f64 {
        let q = self.question;
        q.held_out.error_from(p, &q.records, &self.localized(weights, &q.records, p, locals))
    }

    /// Error of a model on the records that it was fitted to.
    fn fitted_error(&self, model: &Model) -> f64 {
        self.question.held_out.error_from(&model.fit.parameters, &self.question.records, &model.fit.locals)
    }

    /// Error on folds that a model, fitted again without them, has not seen.
    fn held_out_error(&self, weights: &Weights, model: &Model) -> f64 {
        let q = self.question;
        if q.folds.len() < 2 || stop::asked() {
            return self.fitted_error(model);
        }
        let part = |chosen: Vec<usize>| -> (Vec<usize>, Vec<Vec<f64>>) {
            chosen.into_iter().map(|i| (q.records[i], model.fit.locals[i].clone())).unzip()
        };
        let squares = q.folds.iter().map(|fold| {
            let (rest, locals) = part((0..q.records.len()).filter(|i| !fold.contains(i)).collect());
            let (own, own_locals) = part(fold.clone());
            let refit =
                self.fit_records(weights, (&rest, &locals), &model.added, &model.fit.parameters, FOLD_ROUNDS);
            let p = &refit.fit.parameters;
            let own_locals = self.localized(weights, &own, p, &own_locals);
            own.len() as f64 * q.held_out.error_from(p, &own, &own_locals).powi(2)
        });
        (squares.sum::<f64>() / q.records.len() as f64).sqrt()
    }

    /// Candidates worth a fit, with the parameters to start from.
    fn promising(&self, base: &Model, weights: &Weights) -> Vec<Promise> {
        let q = self.question;
        let held = Model {
            fit: Fit {
                parameters: q.without_corrections(&base.fit.parameters, &base.added),
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
        let wanted = |c: usize| !q.free_forms.contains(&c) && (q.may_join)(c, &base.added);
        let [beside, without] = self.with(weights, &q.records, |search| {
            [base, &held].map(|model| distinct(search.screen_some(model, &wanted)))
        });
        let records: Vec<usize> = q.screened.iter().map(|&i| q.records[i]).collect();
        let locals: Vec<Vec<f64>> = q.screened.iter().map(|&i| base.fit.locals[i].clone()).collect();
        let errors = parallel::map(without.len(), |i| {
            q.held_out.error_from(&without[i].parameters, &records, &locals)
        });
        let mut alone: Vec<(f64, Promise)> = errors.into_iter().zip(without).collect();
        alone.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut chosen: Vec<Promise> = beside.into_iter().take(FITTED_CANDIDATES.0).collect();
        for (_, promise) in alone {
            let far = q.same(promise.candidate).is_some_and(|c| {
                let moved = base.fit.parameters[c.free.index].abs();
                c.free.prior.is_some_and(|tolerance| moved > 1.5 * tolerance)
            });
            let few = chosen.len() < FITTED_CANDIDATES.0 + FITTED_CANDIDATES.1;
            if (few || far) && !chosen.iter().any(|other| other.candidate == promise.candidate) {
                chosen.push(promise);
            }
        }
        chosen
    }

    /// One step: candidates fitted and judged, best first, and the weights that they were judged with.
    fn step(&self, base: &Model, weights: &Weights) -> (Vec<Tried>, Weights) {
        let q = self.question;
        let mut fitted: Vec<(f64, Model)> = self
            .promising(base, weights)
            .into_iter()
            .enumerate()
            .take_while(|(rank, _)| *rank == 0 || !stop::asked())
            .map(|(_, promise)| {
                let mut added = base.added.clone();
                added.push(promise.candidate);
                let model = self.fit(weights, &added, &promise.parameters, &base.fit.locals, ROUNDS);
                (self.fitted_error(&model), model)
            })
            .collect();
        fitted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some(best) = fitted.first() else { return (Vec::new(), weights.clone()) };
        let weights = self.weights(&best.1.fit.parameters, &best.1.fit.locals);
        let base = self.fit(&weights, &base.added, &base.fit.parameters, &base.fit.locals, REFINEMENT_ROUNDS);
        let base_error = self.held_out_error(&weights, &base);
        let base_fitted = self.fitted_error(&base);
        let uncorrected = q.without_corrections(&base.fit.parameters, &base.added);
        let before = self.error_at(&weights, &uncorrected, &base.fit.locals);
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
            let p = q.without_corrections(&model.fit.parameters, &model.added);
            let mut own = Tried {
                candidate,
                gain: reference.0 - model.fit.chi2,
                held_out: (reference.1 - error) / self.declared_error,
                error,
                alone: 1.0 - self.error_at(&weights, &p, &model.fit.locals) / before,
                model,
                rejected: None,
            };
            own.rejected =
                if again { self.objection(&own) } else { Some("others take more of the error away".into()) };
            tried.push(own);
        }
        // Those that were not fitted again have an error of the fit, which is no match for one on held-out folds.
        let judged = REFITTED_CANDIDATES.min(tried.len());
        let (again, once) = tried.split_at_mut(judged);
        again.sort_by(|a, b| a.error.total_cmp(&b.error));
        once.sort_by(|a, b| a.error.total_cmp(&b.error));
        (tried, weights)
    }

    /// Weighted sum of squares and held-out error of a model without one of its corrections.
    fn without(&self, base: &Model, correction: &Correction, weights: &Weights) -> (f64, f64) {
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

    /// Sets of effects that were proposed, and pairs of those that were not accepted alone, in place of the best model.
    fn sets(&self, found: &mut Found) {
        let q = self.question;
        let mut sets: Vec<(Vec<usize>, Vec<f64>)> = q.proposals.to_vec();
        if let Some(last) = found.steps.last().filter(|_| q.pairs && found.best.added.len() + 2 <= q.most) {
            let notable = |t: &&Tried| t.gain >= q.settings.min_gain && t.held_out > 0.0;
            let few: Vec<&Tried> = last.tried.iter().filter(notable).take(PAIRED_SINGLES).collect();
            for (i, a) in few.iter().enumerate() {
                for b in &few[i + 1..] {
                    let mut p = a.model.fit.parameters.clone();
                    let own = &q.candidates[b.candidate].free;
                    own.iter().for_each(|free| p[free.index] = b.model.fit.parameters[free.index]);
                    sets.push(([&a.model.added[..], &[b.candidate]].concat(), p));
                }
            }
        }
        for (set, p) in sets {
            let known = set.iter().all(|c| found.best.added.contains(c));
            if set.len() > q.most || known || stop::asked() {
                continue;
            }
            if let Some(step) = self.instead(&found.base, &found.best, &set, &p) {
                found.best = step.tried[0].model.clone();
                found.equals.clear();
                found.steps.push(step);
            }
        }
    }

    /// A set of effects, without those that it does not need, if it does clearly better than `best`.
    fn instead(&self, base: &Model, best: &Model, set: &[usize], p: &[f64]) -> Option<Step> {
        let q = self.question;
        let first =
            self.fit(&self.weights(&best.fit.parameters, &best.fit.locals), set, p, &best.fit.locals, ROUNDS);
        let weights = self.weights(&first.fit.parameters, &first.fit.locals);
        let again = |model: &Model| {
            self.fit(&weights, &model.added, &model.fit.parameters, &model.fit.locals, REFINEMENT_ROUNDS)
        };
        let mut model = again(&first);
        let mut error = self.held_out_error(&weights, &model);
        let (base, best) = (again(base), again(best));
        let [base_error, best_error] = [&base, &best].map(|own| self.held_out_error(&weights, own));
        let most = |extra: usize, from: f64| {
            let extra = extra as f64;
            ((1.0 - extra * MIN_FALL_OF_SET.0) * from)
                .min(from - extra * MIN_FALL_OF_SET.1 * self.declared_error)
        };
        // One effect too many may hide what the others bring, but not all of it.
        if error > MAX_ERROR_RATIO_OF_SET * best_error {
            return None;
        }
        let mut without: Vec<(f64, f64)> = Vec::new();
        'again: while model.added.len() > 1 {
            without.clear();
            for &c in &model.added {
                let rest: Vec<usize> = model.added.iter().copied().filter(|&other| other != c).collect();
                let mut start = model.fit.parameters.clone();
                q.candidates[c].free.iter().for_each(|free| start[free.index] = q.declared[free.index]);
                let own = self.fit(&weights, &rest, &start, &model.fit.locals, ROUNDS);
                let left = self.held_out_error(&weights, &own);
                let may_stay = rest.iter().all(|&other| (q.may_join)(other, &rest));
                if may_stay && error > most(1, left) {
                    (model, error) = (own, left);
                    continue 'again;
                }
                without.push((own.fit.chi2 - model.fit.chi2, (left - error) / self.declared_error));
            }
            break;
        }
        let extra = model.added.len().saturating_sub(best.added.len()).max(1);
        let enough = base_error - error >= q.settings.min_held_out_share * self.declared_error;
        let objection = model.added.iter().find_map(|&c| (q.sense)(&q.candidates[c], &model));
        let known = model.added.iter().all(|c| best.added.contains(c));
        if !enough || error > most(extra, best_error) || objection.is_some() || known {
            return None;
        }
        let tried = model.added.iter().enumerate().map(|(k, &candidate)| {
            let (gain, held_out) = without
                .get(k)
                .copied()
                .unwrap_or((base.fit.chi2 - model.fit.chi2, (base_error - error) / self.declared_error));
            Tried { candidate, model: model.clone(), gain, held_out, error, alone: f64::NAN, rejected: None }
        });
        Some(Step { added: Vec::new(), tried: tried.collect() })
    }

    /// The free form that takes away much more of the error than the effects of `best`, if one does.
    fn free_form(&self, base: &Model, best: &Model) -> Option<FreeForm> {
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

    /// Why a candidate is no effect that matters, if it is none.
    fn objection(&self, tried: &Tried) -> Option<String> {
        let (q, own) = (self.question, &self.question.candidates[tried.candidate]);
        let s = &q.settings;
        if tried.gain < s.min_gain {
            return Some(format!(
                "its gain of {:.0} is within what the residual that is left gives by chance",
                tried.gain
            ));
        }
        // An effect that takes most of the error by itself, with a significantly smaller sum, stands even where several
        // corrections together could do the same.
        let dominant = tried.alone >= s.min_share_of_correction;
        if tried.held_out < s.min_held_out_share && !dominant {
            return Some(format!(
                "it takes away {:.0} % of the error on held-out records beyond the corrections, less than {:.0} %",
                100.0 * tried.held_out,
                100.0 * s.min_held_out_share
            ));
        }
        if tried.alone < s.min_share_alone {
            return Some(format!(
                "without corrections of declared parameters it takes away {:.0} % of the error, less than {:.0} %",
                100.0 * tried.alone,
                100.0 * s.min_share_alone
            ));
        }
        if let Some(same) = q.same(tried.candidate) {
            let relative = tried.model.fit.parameters[own.free[0].index] / same.declared;
            let tolerance = same.free.prior.unwrap_or(0.0);
            let within = relative.abs() < s.max_tolerances * tolerance;
            if within && tried.alone < s.min_share_of_correction {
                return Some("it is within the tolerance of a declared parameter".into());
            }
        }
        (q.sense)(own, &tried.model)
    }

    /// The best of the candidates without objection: of those that leave about the least error the likeliest, or one with
    /// fewer parameters that takes as much away without corrections.
    fn accepted<'t>(&self, tried: &'t [Tried]) -> Option<&'t Tried> {
        let (q, tie) = (self.question, self.question.settings.tie_share);
        let size = |t: &Tried| q.candidates[t.candidate].free.len();
        let sound = || tried.iter().filter(|t| t.rejected.is_none());
        let least = sound().map(|t| t.error).fold(f64::INFINITY, f64::min);
        let near = || sound().filter(|t| t.error <= least + tie * self.declared_error);
        let likelier = |a: &&Tried, b: &&Tried| a.model.fit.chi2.total_cmp(&b.model.fit.chi2);
        let likeliest = near().min_by(likelier)?;
        let simpler = |t: &&Tried| size(t) < size(likeliest) && t.alone >= likeliest.alone - tie;
        let simplest = near().filter(simpler).min_by(|a, b| size(a).cmp(&size(b)).then(likelier(a, b)));
        simplest.or(Some(likeliest))
    }

    /// Candidates of a step that do as well as the accepted one with as many parameters.
    fn equals(&self, step: &Step, accepted: &Tried) -> Vec<Tried> {
        let q = self.question;
        let size = |t: &Tried| q.candidates[t.candidate].free.len();
        let same = |t: &&Tried| {
            let nested = q.candidates[t.candidate].contains == Some(q.candidates[accepted.candidate].id);
            t.candidate != accepted.candidate
                && !nested
                && t.rejected.is_none()
                && size(t) >= size(accepted)
                && (t.model.fit.chi2 - accepted.model.fit.chi2) < q.settings.tie
                && (t.error - accepted.error) < q.settings.tie_share * self.declared_error
        };
        step.tried.iter().filter(same).cloned().collect()
    }
}

/// The best promise of every candidate, in order.
fn distinct(promises: Vec<Promise>) -> Vec<Promise> {
    let mut found: Vec<Promise> = Vec::new();
    for promise in promises {
        if !found.iter().any(|other| other.candidate == promise.candidate) {
            found.push(promise);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Span;
    use crate::engine::candidate::Start;
    use crate::engine::noise::Noise;

    /// `y = p0 t + p1 t^2 + p2 t` and something that no parameter can do, plus unit noise, t in [0, 1).
    struct Wavy(Vec<Vec<f64>>);

    impl Wavy {
        fn new(slope: f64, square: f64, wave: f64) -> Wavy {
            let record = |r: u64| {
                let mut noise = Noise::new(7, r);
                let t = (0..1024).map(|k| f64::from(k) / 1024.0);
                t.map(|t| slope * t + square * t * t + wave * (25.0 * t + r as f64).sin() + noise.normal())
                    .collect()
            };
            Wavy((0..4).map(record).collect())
        }
    }

    impl System for Wavy {
        fn records(&self) -> usize {
            4
        }
        fn estimation(&self, _: usize) -> bool {
            true
        }
        fn locals(&self, _: usize) -> Vec<(f64, f64)> {
            Vec::new()
        }
        fn signals(&self, _: usize) -> Vec<Span> {
            vec![Span { signal: "y".into(), range: 0..1024, noise: 1.0 }]
        }
        fn predict(&self, _: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
            let t = (0..1024).map(|k| f64::from(k) / 1024.0);
            t.map(|t| (p[0] + p[2]) * t + p[1] * t * t).collect()
        }
        fn measured(&self, record: usize) -> Vec<f64> {
            self.0[record].clone()
        }
        fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
            self.0[record].iter().zip(predicted).map(|(y, p)| y - p).collect()
        }
        fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
            predicted.iter().map(|_| noise.normal()).collect()
        }
    }

    /// Effects found in a system whose slope is known to `tolerance`, by candidate, and the correction of the slope.
    fn found(system: &Wavy, tolerance: f64) -> (Vec<usize>, f64) {
        let free = |index: usize| Free { index, bounds: (-1e3, 1e3), step: 1e-3, prior: None };
        let candidate = |id: &'static str, index: usize| Candidate {
            id,
            channel: "c",
            signal: None,
            free: vec![free(index)],
            starts: vec![Start { values: Vec::new(), open: vec![0], idle: true }],
            contains: None,
        };
        let candidates = [candidate("slope", 0), candidate("square", 1)];
        let bounds = (-3.0 * tolerance, 3.0 * tolerance);
        let known = Free { prior: Some(tolerance), bounds, ..free(2) };
        let corrections = [Correction { free: known, effect: Some(0), declared: 1.0 }];
        let units = BTreeMap::from([("y".to_owned(), 1.0)]);
        let question = Question {
            system,
            held_out: &HeldOut::new(system, &units),
            candidates: &candidates,
            corrections: &corrections,
            declared: &[0.0; 3],
            always: &[],
            locals: vec![Vec::new(); 4],
            may_join: &|_, _| true,
            proposals: &[],
            pairs: false,
            free_forms: &[],
            records: (0..4).collect(),
            screened: (0..4).collect(),
            folds: vec![vec![0, 1], vec![2, 3]],
            sense: &|_, _| None,
            settings: Settings::default(),
            most: 2,
        };
        let result = search(&question);
        (result.best.added.clone(), result.best.fit.parameters[2])
    }

    #[test]
    fn an_effect_that_leaves_several_times_the_noise_is_found_for_its_share() {
        let (added, _) = found(&Wavy::new(0.0, 40.0, 6.0), 1.0);
        assert_eq!(added, [1]);
    }

    #[test]
    fn a_parameter_within_its_tolerance_is_corrected_and_one_beyond_it_is_an_effect() {
        let (added, slope) = found(&Wavy::new(1.5, 0.0, 6.0), 1.0);
        assert!(added.is_empty() && (0.1..3.0).contains(&slope), "{added:?} {slope}");
        assert_eq!(found(&Wavy::new(40.0, 0.0, 6.0), 1.0).0, [0]);
    }

    #[test]
    fn what_no_candidate_can_do_is_left() {
        assert!(found(&Wavy::new(0.0, 0.0, 20.0), 1.0).0.is_empty());
    }
}
