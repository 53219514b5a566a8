//! Several effects at once, where each alone shows little.

use super::forward_selection::{REFINEMENT_ROUNDS, ROUNDS, Run};
use super::question::{Found, Step, Tried};
use super::search::Model;
use super::stop;

/// Candidates that pairs are made of.
const PAIRED_SINGLES: usize = 3;
/// Fall of the error on held-out folds that each effect of a set must bring: as a share of it, and of that of the
/// declared model.
const MIN_FALL_OF_SET: (f64, f64) = (0.05, 0.02);
/// Ratio of the errors of a proposed set and of the best model from which on it is not looked at further.
const MAX_ERROR_RATIO_OF_SET: f64 = 1.1;

impl Run<'_> {
    /// Sets of effects that were proposed, and pairs of those that were not accepted alone, in place of the best model.
    pub(super) fn sets(&self, found: &mut Found) {
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
            for pair in self.predicted_pairs(&found.best, &last.tried) {
                let same = |other: &(Vec<usize>, Vec<f64>)| {
                    other.0.len() == pair.0.len() && pair.0.iter().all(|c| other.0.contains(c))
                };
                if !sets.iter().any(same) {
                    sets.push(pair);
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
                let before = found.steps.iter_mut().flat_map(|own| &mut own.tried);
                for own in before.filter(|own| found.best.added.contains(&own.candidate)) {
                    if let Some(reason) = &mut own.rejected {
                        reason.push_str("; the set of the last step needs it");
                    }
                }
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
        // As for one effect: several corrections together could do much of what the set does.
        let dominant = || {
            let error_of = |own: &Model| {
                let p = q.without_corrections(&own.fit.parameters, &own.added);
                self.error_at(&weights, &p, &own.fit.locals)
            };
            error_of(&model) <= (1.0 - q.settings.min_share_of_correction) * error_of(&base)
        };
        let enough = base_error - error >= q.settings.min_held_out_share * self.declared_error || dominant();
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
}
