//! Effects of a set exchanged for others, since a set is found as a whole: what it was proposed with need not be what
//! does best beside the rest of it.

use super::forward_selection::{REFINEMENT_ROUNDS, ROUNDS, Run, Weights};
use super::question::{Found, Step, Tried};
use super::search::Model;
use super::step::distinct;
use super::stop;
use crate::order::ascending;

/// Other candidates that are fitted in the place of an effect: those whose linear step predicts most.
const RIVALS: usize = 3;

impl Run<'_> {
    /// Exchanges each effect for another that does better beside the rest, or as well and is simpler. Of those that a
    /// set alone brought, which took the place of the effects accepted one by one, others that do as well are noted.
    pub(super) fn exchange(&self, found: &mut Found) {
        if found.best.added.len() < 2 || self.question.changes_among(&found.best.added) {
            return;
        }
        // The last one accepted was compared with all others beside the rest.
        let one_by_one = &found.one_by_one.0;
        let last = one_by_one.last().copied().filter(|_| *one_by_one == found.best.added);
        let compared = one_by_one.clone();
        let open: Vec<usize> = found.best.added.iter().copied().filter(|c| Some(*c) != last).collect();
        for own in open {
            if stop::asked() {
                return;
            }
            let Some(step) = self.in_place_of(own, &found.best) else { continue };
            let Some(accepted) = self.accepted(&step.tried).cloned() else { continue };
            if !compared.contains(&own) {
                let rivals = self.rivals(&step, &accepted);
                found.equals.extend(rivals.into_iter().map(|other| (accepted.candidate, other)));
            }
            if accepted.candidate != own {
                found.best = accepted.model.clone();
                let beside = &found.best.added;
                found.equals.retain(|(_, other)| {
                    other.model.added.iter().all(|c| *c == other.candidate || beside.contains(c))
                });
            }
            if step.tried.len() > 1 && (accepted.candidate != own || !compared.contains(&own)) {
                found.steps.push(step);
            }
        }
    }

    /// Candidates of a step that the records cannot tell from the accepted one: beside what is left, which no effect
    /// explains, a small difference says nothing of the form.
    fn rivals(&self, step: &Step, accepted: &Tried) -> Vec<Tried> {
        let q = self.question;
        let nested = |t: &Tried| q.candidates[t.candidate].adds_to(&q.candidates[accepted.candidate]);
        let near =
            (q.settings.tie_share_of_rest * accepted.error).max(q.settings.tie_share * self.whole_error);
        let same = |t: &&Tried| {
            t.candidate != accepted.candidate
                && t.rejected.is_none()
                && !nested(t)
                && t.error - accepted.error < near
                && t.held_out >= q.settings.min_share_of_rival * accepted.held_out
        };
        step.tried.iter().filter(same).cloned().collect()
    }

    /// The effect `own` of a model and its rivals beside the other effects of it, best first; none where others need
    /// it.
    fn in_place_of(&self, own: usize, best: &Model) -> Option<Step> {
        let q = self.question;
        let rest: Vec<usize> = best.added.iter().copied().filter(|&c| c != own).collect();
        if rest.iter().any(|&other| !(q.may_join)(other, &rest)) {
            return None;
        }
        let weights = self.weights(&best.fit.parameters, &best.fit.locals);
        let mut start = best.fit.parameters.clone();
        q.candidates[own].free.iter().for_each(|free| start[free.index] = q.declared[free.index]);
        let base = self.fit(&weights, &rest, &start, &best.fit.locals, ROUNDS);
        let may =
            |c: usize| c != own && !q.is_change(c) && !q.free_forms.contains(&c) && (q.may_join)(c, &rest);
        let promises = self.with(&weights, &q.records, |search| search.screen_some(&base, &may));
        let refit = |model: &Model| {
            self.fit(&weights, &model.added, &model.fit.parameters, &model.fit.locals, REFINEMENT_ROUNDS)
        };
        let mut models = vec![(own, refit(best))];
        for promise in distinct(promises).into_iter().take(RIVALS) {
            let added = [&rest[..], &[promise.candidate]].concat();
            let model = self.fit(&weights, &added, &promise.parameters, &base.fit.locals, ROUNDS);
            models.push((promise.candidate, refit(&model)));
        }
        let mut tried = self.judged(&base, models, &weights);
        // The set as it is has been judged.
        let as_before = |other: &Tried| other.candidate == own;
        for other in tried.iter_mut().filter(|other| !as_before(other)) {
            other.rejected = (q.sense)(&q.candidates[other.candidate], &other.model).or_else(|| {
                (other.gain < q.settings.min_gain).then(|| "it gains nothing beside the others".to_owned())
            });
        }
        ascending(&mut tried, |own| own.error);
        Some(Step { added: rest, tried })
    }

    /// Models with one more candidate than `base`, compared with it on what is held out.
    fn judged(&self, base: &Model, models: Vec<(usize, Model)>, weights: &Weights) -> Vec<Tried> {
        let error_of = |own: &Model| self.error_without_corrections(weights, own);
        let (before, left) = (error_of(base), self.held_out_error(weights, base));
        let one = |(candidate, model): (usize, Model)| {
            let error = self.held_out_error(weights, &model);
            Tried {
                candidate,
                gain: base.fit.chi2 - model.fit.chi2,
                held_out: (left - error) / self.declared_error,
                error,
                alone: 1.0 - error_of(&model) / before,
                model,
                rejected: None,
            }
        };
        models.into_iter().map(one).collect()
    }
}
