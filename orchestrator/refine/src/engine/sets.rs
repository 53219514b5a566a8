//! Several effects at once, where each alone shows little.

use super::forward_selection::{REFINEMENT_ROUNDS, ROUNDS, Run};
use super::question::{Found, Step, Tried};
use super::search::Model;
use super::stop;

/// Candidates that pairs are made of.
const PAIRED_SINGLES: usize = 3;
/// Fall of the error on held-out folds that each effect of a set must bring: as a share of it, and of the whole error.
const MIN_FALL_OF_SET: (f64, f64) = (0.05, 0.02);
/// Share that each effect of a set must take away of what the others of it leave, where all are too small to take a
/// share of the whole error.
const MIN_SHARE_OF_REST: f64 = 0.5;
/// Multiples of the sensor noise up to which what is left is not looked at again.
const MAX_NOISE_LEFT: f64 = 1.3;
/// Ratio of the errors of a proposed set and of the best model from which on it is not looked at further.
const MAX_ERROR_RATIO_OF_SET: f64 = 1.1;

/// Rounds after which the fit of a set goes on only if it has taken away this share of what it has to.
const FIRST_ROUNDS: usize = 2;
const SHARE_OF_FALL_AT_FIRST: f64 = 0.3;

/// Words that the report adds to the reason why an effect of a set was rejected before.
pub(super) const NEEDED: &str = "; a set of effects that was accepted later needs it";

/// Effects and parameters to start from.
type Proposal = (Vec<usize>, Vec<f64>);

/// The error that a set of effects has to take away from that of a smaller model.
#[derive(Clone, Copy, PartialEq)]
enum Demand {
    /// Shares of it and of the whole error for every effect.
    Each,
    /// Most of it.
    Rest,
}

impl Run<'_> {
    /// Sets of effects that were proposed, and pairs of those that were not accepted alone, in place of the best model;
    /// then what takes away nearly all that is left.
    pub(super) fn sets(&self, found: &mut Found) {
        let q = self.question;
        let mut sets: Vec<Proposal> = q.proposals.to_vec();
        if let Some(last) = found.steps.last().filter(|_| q.pairs) {
            sets.extend(self.pairs(&found.best, &last.tried));
        }
        self.take(found, sets, Demand::Each);
        while q.pairs && self.rest(found) {}
    }

    /// Pairs of effects beside those of `best`, of candidates tried around it.
    fn pairs(&self, best: &Model, tried: &[Tried]) -> Vec<Proposal> {
        let q = self.question;
        let mut sets: Vec<Proposal> = Vec::new();
        if best.added.len() + 2 > q.most {
            return sets;
        }
        let notable = |t: &&Tried| t.gain >= q.settings.min_gain && t.held_out > 0.0;
        let few: Vec<&Tried> = tried.iter().filter(notable).take(PAIRED_SINGLES).collect();
        for (i, a) in few.iter().enumerate() {
            for b in &few[i + 1..] {
                let mut p = a.model.fit.parameters.clone();
                let own = &q.candidates[b.candidate].free;
                own.iter().for_each(|free| p[free.index] = b.model.fit.parameters[free.index]);
                sets.push(([&a.model.added[..], &[b.candidate]].concat(), p));
            }
        }
        for pair in self.predicted_pairs(best, tried) {
            let same = |other: &Proposal| {
                other.0.len() == pair.0.len() && pair.0.iter().all(|c| other.0.contains(c))
            };
            if !sets.iter().any(same) {
                sets.push(pair);
            }
        }
        sets
    }

    /// Takes sets that do clearly better than the best model in its place, and says whether one did.
    fn take(&self, found: &mut Found, sets: Vec<Proposal>, demand: Demand) -> bool {
        let q = self.question;
        let mut better = false;
        for (set, p) in sets {
            let known = set.iter().all(|c| found.best.added.contains(c));
            if set.len() > q.most || known || stop::asked() {
                continue;
            }
            if let Some(step) = self.instead(&found.base, &found.best, (&set, &p), demand) {
                better = true;
                found.best = step.tried[0].model.clone();
                let before = found.steps.iter_mut().flat_map(|own| &mut own.tried);
                for own in before.filter(|own| found.best.added.contains(&own.candidate)) {
                    if let Some(reason) = own.rejected.as_mut().filter(|reason| !reason.ends_with(NEEDED)) {
                        reason.push_str(NEEDED);
                    }
                }
                found.equals.clear();
                found.steps.push(step);
            }
        }
        better
    }

    /// Looks around the best model where it is well above the noise, for effects that are small beside those found and
    /// take away nearly all that is left; says whether there are some.
    fn rest(&self, found: &mut Found) -> bool {
        let q = self.question;
        let floor = q.held_out.floor(&q.records);
        let full = found.best.added.is_empty() || found.best.added.len() >= q.most;
        if full || stop::asked() || self.fitted_error(&found.best) < MAX_NOISE_LEFT * floor {
            return false;
        }
        let around = found.steps.last().filter(|step| step.added == found.best.added);
        let tried = around.map(|step| step.tried.clone()).unwrap_or_else(|| {
            let weights = self.weights(&found.best.fit.parameters, &found.best.fit.locals);
            let (mut tried, _) = self.step(&found.best, &weights);
            for own in &mut tried {
                own.rejected.get_or_insert_with(|| "less is left than an effect has to take away".into());
            }
            found.steps.push(Step { added: found.best.added.clone(), tried: tried.clone() });
            tried
        });
        // Shares of the rest that they take where they were fitted.
        let left = self.above_noise(self.fitted_error(&found.best));
        let taken = |t: &Tried| 1.0 - self.above_noise(self.fitted_error(&t.model)) / left;
        let least = SHARE_OF_FALL_AT_FIRST * q.settings.min_share_of_rest;
        let few = tried.iter().take(PAIRED_SINGLES).filter(|t| taken(t) >= least);
        let mut sets: Vec<Proposal> =
            few.map(|t| (t.model.added.clone(), t.model.fit.parameters.clone())).collect();
        sets.extend(self.pairs(&found.best, &tried));
        self.take(found, sets, Demand::Rest)
    }

    /// An error without that of the sensors.
    fn above_noise(&self, error: f64) -> f64 {
        let floor = self.question.held_out.floor(&self.question.records);
        (error.powi(2) - floor.powi(2)).max(0.0).sqrt()
    }

    /// A set of effects, fitted; one that has to take most of the rest, if it takes away some of that where it is
    /// fitted: it takes away no more where it is held out.
    fn promising_set(&self, best: &Model, (set, p): (&[usize], &[f64]), demand: Demand) -> Option<Model> {
        let weights = self.weights(&best.fit.parameters, &best.fit.locals);
        if demand == Demand::Each {
            return Some(self.fit(&weights, set, p, &best.fit.locals, ROUNDS));
        }
        let fall = SHARE_OF_FALL_AT_FIRST * self.question.settings.min_share_of_rest;
        let first = self.fit(&weights, set, p, &best.fit.locals, FIRST_ROUNDS);
        let [left, whole] = [&first, best].map(|model| self.above_noise(self.fitted_error(model)));
        if left > (1.0 - fall) * whole {
            return None;
        }
        let (p, locals) = (&first.fit.parameters, &first.fit.locals);
        Some(self.fit(&weights, set, p, locals, ROUNDS - FIRST_ROUNDS))
    }

    /// A set of effects, without those that it does not need, if it does clearly better than `best`.
    fn instead(
        &self,
        base: &Model,
        best: &Model,
        (set, p): (&[usize], &[f64]),
        demand: Demand,
    ) -> Option<Step> {
        let q = self.question;
        let first = self.promising_set(best, (set, p), demand)?;
        let weights = self.weights(&first.fit.parameters, &first.fit.locals);
        let again = |model: &Model| {
            self.fit(&weights, &model.added, &model.fit.parameters, &model.fit.locals, REFINEMENT_ROUNDS)
        };
        let mut model = again(&first);
        let mut error = self.held_out_error(&weights, &model);
        let best = again(best);
        let best_error = self.held_out_error(&weights, &best);
        // Near the noise, a share of what is left is one of what is above it.
        let judged = |error: f64| if demand == Demand::Rest { self.above_noise(error) } else { error };
        let most = |extra: usize, from: f64| {
            let extra = extra as f64;
            match demand {
                Demand::Each => ((1.0 - extra * MIN_FALL_OF_SET.0) * from)
                    .min(from - extra * MIN_FALL_OF_SET.1 * self.whole_error),
                Demand::Rest => (1.0 - q.settings.min_share_of_rest) * from,
            }
        };
        let needed = |left: f64| match demand {
            Demand::Each => most(1, left),
            Demand::Rest => (1.0 - MIN_SHARE_OF_REST) * left,
        };
        // One effect too many may hide what the others bring, but not all of it.
        let hopeless = match demand {
            Demand::Each => MAX_ERROR_RATIO_OF_SET * best_error,
            Demand::Rest => needed(judged(best_error)),
        };
        if judged(error) > hopeless {
            return None;
        }
        let base = again(base);
        let base_error = self.held_out_error(&weights, &base);
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
                if may_stay && judged(error) > needed(judged(left)) {
                    (model, error) = (own, left);
                    continue 'again;
                }
                without.push((own.fit.chi2 - model.fit.chi2, (left - error) / self.declared_error));
            }
            break;
        }
        let extra = model.added.len().saturating_sub(best.added.len()).max(1);
        let share = (base_error - error) / self.whole_error;
        // As for one effect: several corrections together could do much of what the set does, or it of what they do.
        let error_of = |own: &Model| self.error_without_corrections(&weights, own);
        let alone = 1.0 - error_of(&model) / error_of(&base);
        // Effects that no accepted one is among stand by nothing but each other and the corrections.
        let stands = model.added.iter().any(|c| best.added.contains(c))
            && alone >= q.settings.min_share_alone
            || q.corrections.is_empty();
        let enough =
            stands && share >= q.settings.min_held_out_share || alone >= q.settings.min_share_of_correction;
        let objection = model.added.iter().find_map(|&c| (q.sense)(&q.candidates[c], &model));
        let known = model.added.iter().all(|c| best.added.contains(c));
        if !enough || judged(error) > most(extra, judged(best_error)) || objection.is_some() || known {
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
