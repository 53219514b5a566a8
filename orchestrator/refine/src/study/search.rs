//! Which candidates are missing: step by step with a look ahead to pairs, judged on what was held out.

use std::sync::OnceLock;

use super::catalog::Candidate;
use super::effects;
use super::explain::Judge;
use super::fits::{Fits, Model};
use super::model::Study;
use super::physical::{fitting, physical};
use crate::answer::Stability;
use crate::engine::fit::Free;
use crate::engine::{parallel, stop};
use crate::order::ascending;

/// Share by which the error on what is held out has to fall for an effect to be added.
pub const MIN_FALL_OF_HELD_OUT: f64 = 0.05;
/// Share of the declared model's error that an effect has to take away.
pub const MIN_SHARE_OF_DECLARED: f64 = 0.02;
/// Candidates whose errors differ by less than this share are equally good; the simplest is taken.
pub const MAX_DIFFERENCE_OF_EQUALS: f64 = 0.03;
/// Models of each step whose error on what is held out is computed.
const HELD_OUT_MODELS: usize = 3;
/// Candidates that are fitted on top of the declared model, and beside effects found before: those whose linear step
/// predicts most.
const FITTED_CANDIDATES: (usize, usize) = (24, 16);
/// Models with one more effect that are fitted to all records with derivatives of their own: at least, at most.
const REFITTED: (usize, usize) = (3, 8);
/// Ratio of their errors to the least up to which they are.
const MAX_ERROR_OF_REFITTED: f64 = 1.5;
/// Singles that pairs are made of.
const PAIRED_SINGLES: usize = 6;
/// Effects that are exchanged at most.
const MAX_EXCHANGES: usize = 4;
/// Ratio of errors on a part of the records from which on an effect helps there.
const MAX_ERROR_RATIO_ON_PART: f64 = 0.99;
/// Share of the error on what is held out from which on an effect helps clearly, on however few parts.
const MIN_GAIN_ON_FEW_PARTS: f64 = 0.15;

/// Outcome.
#[derive(Debug, Clone)]
pub struct Selection {
    /// The declared model.
    pub declared: Model,
    /// The model of the answer.
    pub best: Model,
    /// Models with one effect exchanged that are as good as the best: effect that is replaced, the model.
    pub equals: Vec<(usize, Model)>,
    /// Single candidates on top of the declared model, best first.
    pub singles: Vec<Model>,
    /// Errors on what was held out after each step: effects so far, error.
    pub path: Vec<(Vec<usize>, f64)>,
    /// How each effect of the answer holds on parts of the records.
    pub stability: Vec<Stability>,
    /// Effects that were left out because they do not hold on most parts.
    pub refused: Vec<(usize, Stability)>,
    /// Whether the best model was fitted with residuals in units of the noise, which is all that it leaves.
    pub exact: bool,
    /// Declared parameters that the best model changes by more than their tolerances allow: effects of their own.
    pub changed: Vec<Free>,
}

impl Selection {
    /// A model with the single candidates and the steps that led to it, judged by nothing yet.
    pub fn new(declared: Model, best: Model, singles: Vec<Model>, path: Vec<(Vec<usize>, f64)>) -> Selection {
        let (equals, stability, refused, changed) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Selection { declared, best, equals, singles, path, stability, refused, exact: false, changed }
    }

    /// Number of effects of the best model.
    pub fn effects(&self) -> usize {
        self.best.added.len() + self.changed.len()
    }
}

/// Sentences for a progress display.
pub type Say<'a> = &'a (dyn Fn(&str) + Sync);

fn complexity(candidates: &[Candidate], model: &Model) -> usize {
    model.added.iter().map(|&c| candidates[c].complexity).sum()
}

/// The simplest of the models that are about as good as the best, then the best of those.
fn choose(study: &Study, models: Vec<Model>) -> Option<Model> {
    let least = models.iter().map(|model| model.held_out).fold(f64::INFINITY, f64::min);
    let near = models.into_iter().filter(|model| model.held_out <= (1.0 + MAX_DIFFERENCE_OF_EQUALS) * least);
    near.min_by(|a, b| {
        let key = |model: &Model| complexity(&study.candidates, model);
        key(a).cmp(&key(b)).then(a.held_out.total_cmp(&b.held_out))
    })
}

struct Search<'a> {
    fits: &'a Fits<'a>,
    judge: &'a Judge,
    say: Say<'a>,
    /// Candidates and pairs on top of the declared model, which several stages ask for.
    singles: OnceLock<Vec<Model>>,
    pairs: OnceLock<Vec<Model>>,
}

impl<'a> Search<'a> {
    fn new(fits: &'a Fits<'a>, judge: &'a Judge, say: Say<'a>) -> Search<'a> {
        Search { fits, judge, say, singles: OnceLock::new(), pairs: OnceLock::new() }
    }

    fn study(&self) -> &Study {
        self.fits.study
    }

    /// Exchanges effects for others that do better, or as well and are simpler; then the models with one effect
    /// exchanged that are as good. Those that only contain it with more freedom are no other explanation.
    fn exchange(&self, mut best: Model) -> (Model, Vec<(usize, Model)>) {
        let mut exchanged = 0;
        'again: loop {
            let mut equals = Vec::new();
            for &c in best.added.iter().take_while(|_| !stop::asked()) {
                let candidates = &self.study().candidates;
                let rest: Vec<usize> = best.added.iter().copied().filter(|&other| other != c).collect();
                if rest.iter().any(|&other| candidates[other].needs == Some(c)) {
                    continue;
                }
                let Some(base) = self.fits.fit_from(rest, &best.fit.parameters, &best.fit.locals) else {
                    continue;
                };
                let size = complexity(candidates, &best);
                // A shape that does not show in the records is no finding, so anything that does as well replaces it.
                let unreal = !physical(self.study(), &best);
                let simpler = |model: &Model| unreal || complexity(candidates, model) < size;
                let near = |model: &Model| {
                    let most = if simpler(model) {
                        1.0 + MAX_DIFFERENCE_OF_EQUALS
                    } else {
                        1.0 + 0.2 * MAX_DIFFERENCE_OF_EQUALS
                    };
                    !model.added.contains(&c) && model.error <= most * best.error
                };
                let found = self.extend(&base).into_iter().filter(near).take(HELD_OUT_MODELS);
                let mut found: Vec<Model> = found.collect();
                found.iter_mut().for_each(|model| self.fits.hold_out(model));
                let better = |model: &Model| {
                    let as_simple = complexity(candidates, model) <= size && model.error < best.error;
                    let most = match (simpler(model), as_simple) {
                        (true, _) => 1.0 + MAX_DIFFERENCE_OF_EQUALS,
                        (false, true) => 1.0,
                        (false, false) => 1.0 - MAX_DIFFERENCE_OF_EQUALS,
                    };
                    model.held_out < most * best.held_out
                };
                if exchanged < MAX_EXCHANGES
                    && let Some(at) = found.iter().position(better)
                {
                    best = found.swap_remove(at);
                    exchanged += 1;
                    continue 'again;
                }
                let equal = |model: &Model| {
                    model.error < (1.0 + 0.2 * MAX_DIFFERENCE_OF_EQUALS) * best.error
                        && model.held_out < (1.0 + 0.2 * MAX_DIFFERENCE_OF_EQUALS) * best.held_out
                };
                equals.extend(found.into_iter().filter(equal).map(|model| (c, model)));
            }
            return (best, equals);
        }
    }

    /// `base` with each candidate that it lacks, best fit first.
    fn extend(&self, base: &Model) -> Vec<Model> {
        if base.added.is_empty() {
            self.singles.get_or_init(|| self.extended(base)).clone()
        } else {
            self.extended(base)
        }
    }

    fn extended(&self, base: &Model) -> Vec<Model> {
        let may = |c: &usize| {
            let own = &self.study().candidates[*c];
            own.is_searched()
                && !base.added.contains(c)
                && own.needs.is_none_or(|needs| base.added.contains(&needs))
        };
        let open: Vec<usize> = (0..self.study().candidates.len()).filter(may).collect();
        let around = self.fits.around(base);
        let most = if base.added.is_empty() { FITTED_CANDIDATES.0 } else { FITTED_CANDIDATES.1 };
        let promises = self.fits.promises(base, around.as_ref(), &open);
        let mut ranked: Vec<(f64, usize, Vec<f64>)> =
            promises.into_iter().zip(open).filter_map(|(own, c)| own.map(|(left, p)| (left, c, p))).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        ranked.truncate(most);
        let found = parallel::map(ranked.len(), |i| {
            let (_, c, p) = &ranked[i];
            if stop::asked() { None } else { self.fits.add_near(base, around.as_ref(), (*c, p)) }
        });
        self.refitted(found.into_iter().flatten().collect())
    }

    /// Models that were fitted with the derivatives around another one, best first: the best of them fitted with their
    /// own.
    fn refitted(&self, mut models: Vec<Model>) -> Vec<Model> {
        ascending(&mut models, |own| own.error);
        if self.study().windows.is_some() {
            models.retain(|model| fitting(self.study(), model));
            return models;
        }
        let least = models.first().map_or(0.0, |model| model.error);
        let near = models.iter().filter(|model| model.error <= MAX_ERROR_OF_REFITTED * least).count();
        let count = near.clamp(REFITTED.0, REFITTED.1).min(models.len());
        let found = parallel::map(count, |i| {
            let own = &models[i];
            if stop::asked() {
                return None;
            }
            self.fits.fit_from(own.added.clone(), &own.fit.parameters, &own.fit.locals)
        });
        for (own, again) in models.iter_mut().zip(found) {
            if let Some(again) = again {
                *own = again;
            }
        }
        models.retain(|model| fitting(self.study(), model));
        ascending(&mut models, |own| own.error);
        models
    }

    /// The best of some models on what is held out.
    fn judge(&self, models: &[Model]) -> Option<Model> {
        let least = models.first().map_or(0.0, |model| model.error);
        // What fits much worse will not be better on what is held out.
        let near = models.iter().take(HELD_OUT_MODELS).filter(|model| model.error <= 1.2 * least);
        let mut near: Vec<Model> = near.cloned().collect();
        near.iter_mut().for_each(|model| self.fits.hold_out(model));
        choose(self.study(), near)
    }

    /// Pairs on top of `base`, of the best single ones, best fit first.
    fn pairs(&self, base: &Model, singles: &[Model]) -> Vec<Model> {
        let found = || self.paired(base, singles);
        if base.added.is_empty() { self.pairs.get_or_init(found).clone() } else { found() }
    }

    fn paired(&self, base: &Model, singles: &[Model]) -> Vec<Model> {
        let mut found: Vec<Model> = Vec::new();
        let last = |model: &Model| model.added.last().copied();
        let wanted: Vec<usize> = singles.iter().take(PAIRED_SINGLES).filter_map(last).collect();
        let mut jobs = Vec::new();
        for (i, single) in singles.iter().take(PAIRED_SINGLES).enumerate() {
            let own = last(single);
            jobs.extend(wanted[i + 1..].iter().map(|&c| (i, c)));
            // What acts on the Coulomb level comes with it.
            let needing = (0..self.study().candidates.len())
                .filter(|&c| self.study().candidates[c].needs.is_some_and(|needs| Some(needs) == own));
            jobs.extend(needing.map(|c| (i, c)));
        }
        for (i, single) in singles.iter().take(PAIRED_SINGLES).enumerate() {
            if single.added.len() != base.added.len() + 1 || stop::asked() {
                continue;
            }
            let around = self.fits.around(single);
            let own: Vec<usize> = jobs.iter().filter(|job| job.0 == i).map(|job| job.1).collect();
            let promises = self.fits.promises(single, around.as_ref(), &own);
            let models = parallel::map(own.len(), |k| {
                let (_, p) = promises[k].as_ref().filter(|_| !stop::asked())?;
                self.fits.add_near(single, around.as_ref(), (own[k], p))
            });
            found.extend(models.into_iter().flatten());
        }
        self.refitted(found)
    }

    /// Adds effects to `from` one by one (first two where only the pair is worth it) up to `most`.
    fn climb(&self, from: Model, most: usize, path: &mut Vec<(Vec<usize>, f64)>) -> Model {
        // Taking away next to nothing of the declared model's error is no finding, however small the residual.
        let least = path.first().map_or(0.0, |(_, error)| MIN_SHARE_OF_DECLARED * error);
        let mut best = from;
        while best.added.len() < most && !stop::asked() && !self.enough(&best) {
            (self.say)(&format!("searching effect {}", best.added.len() + 1));
            let worth = ((1.0 - MIN_FALL_OF_HELD_OUT) * best.held_out).min(best.held_out - least);
            let singles = self.extend(&best);
            // What gains too little where it was fitted gains no more on what is held out.
            let gains = |model: &&Model| {
                best.error - model.error > least || self.judge.halves(best.error, model.error)
            };
            let promising: Vec<Model> = singles.iter().filter(gains).cloned().collect();
            // Near the noise, spans that are held out show little, as their own initial states take much up.
            let near = |model: &Model| {
                self.judge.halves(best.error, model.error) && self.judge.falls(best.held_out, model.held_out)
            };
            let halves = |model: &Model| self.judge.halves(best.held_out, model.held_out) || near(model);
            // Added to an effect, the next one has to take away some of the residual; less is for the search for
            // shares.
            let notable =
                |model: &Model| best.added.is_empty() || self.judge.lessens(best.held_out, model.held_out);
            let single = self.judge(&promising);
            let single = single.filter(|model| model.held_out < worth && notable(model) || halves(model));
            let next = match single {
                Some(model) => Some(model),
                None if best.added.is_empty() && most >= 2 => {
                    let pairs = self.pairs(&best, &singles);
                    self.judge(&pairs)
                        .filter(|model| model.held_out < (1.0 - 2.0 * MIN_FALL_OF_HELD_OUT) * best.held_out)
                }
                None => None,
            };
            let Some(next) = next else { break };
            best = next;
            path.push((best.added.clone(), best.held_out));
        }
        best
    }

    /// Whether nothing more is to be looked for: beside effects, tolerances of the noise count.
    fn enough(&self, model: &Model) -> bool {
        self.judge.settled(self.fits, model)
            || !model.added.is_empty() && self.judge.tolerable(self.fits, model)
    }

    /// Leaves effects out again that the others have made superfluous.
    fn prune(&self, mut best: Model) -> Model {
        'again: while best.added.len() > 1 && !stop::asked() {
            for &c in &best.added {
                let rest: Vec<usize> = best.added.iter().copied().filter(|&other| other != c).collect();
                if rest.iter().any(|&other| self.study().candidates[other].acts_only_on(c)) {
                    continue;
                }
                let Some(mut without) = self.fits.fit_from(rest, &best.fit.parameters, &best.fit.locals)
                else {
                    continue;
                };
                if without.error > 1.3 * best.error {
                    continue;
                }
                self.fits.hold_out(&mut without);
                let as_good = without.held_out <= (1.0 + 0.5 * MIN_FALL_OF_HELD_OUT) * best.held_out;
                if (as_good || self.enough(&without)) && fitting(self.study(), &without) {
                    best = without;
                    continue 'again;
                }
            }
            break;
        }
        best
    }

    /// Leaves out effects that help on no more than half of the held-out folds and not clearly, or whose strength
    /// changes its sign between them.
    fn steady(&self, mut best: Model) -> (Model, Vec<Stability>, Vec<(usize, Stability)>) {
        let mut refused = Vec::new();
        loop {
            if stop::asked() {
                return (best, Vec::new(), refused);
            }
            let stability = stability(self.fits, None, &mut best);
            let has_others = best.added.len() > 1;
            let unsteady = |(k, own): (usize, &Stability)| {
                let turns = own.ranges.first().is_some_and(|range| range.0 < 0.0 && range.1 > 0.0);
                let needed =
                    best.added.iter().any(|&c| self.study().candidates[c].needs == Some(best.added[k]));
                let rarely = 2 * own.better <= own.parts && own.gain < MIN_GAIN_ON_FEW_PARTS;
                has_others && !needed && (rarely || turns && own.better < own.parts)
            };
            let worst = stability.iter().enumerate().filter(|&(k, own)| unsteady((k, own)));
            let Some((k, own)) = worst.min_by_key(|(_, own)| own.better) else {
                return (best, stability, refused);
            };
            let mut rest = best.added.clone();
            refused.push((rest.remove(k), own.clone()));
            match self.fits.fit_from(rest, &best.fit.parameters, &best.fit.locals) {
                Some(model) => best = model,
                None => return (best, stability, Vec::new()),
            }
        }
    }
}

/// How the effects of a model hold on the parts that were held out. `declared`: the model without effects, if it
/// is fitted.
pub fn stability(fits: &Fits, declared: Option<&Model>, best: &mut Model) -> Vec<Stability> {
    fits.hold_out(best);
    let best = &*best;
    let candidates = &fits.study.candidates;
    let one = |&c: &usize| {
        let own = |other: usize| other == c || candidates[other].needs == Some(c);
        let rest: Vec<usize> = best.added.iter().copied().filter(|&other| !own(other)).collect();
        let without = match declared.filter(|_| rest.is_empty()) {
            Some(declared) => Some(declared.clone()),
            None => fits.fit_from(rest, &best.fit.parameters, &best.fit.locals),
        };
        let parts = without.map_or_else(Vec::new, |mut model| {
            fits.hold_out(&mut model);
            model.parts
        });
        let better = parts
            .iter()
            .zip(&best.parts)
            .filter(|(without, with)| with.0 < MAX_ERROR_RATIO_ON_PART * without.0);
        let range = |k: usize| {
            let values = best.parts.iter().map(|(_, p)| effects::physical(fits.study, c, p)[k]);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ranges = (0..candidates[c].entries.len()).map(range).collect();
        let ratios = parts.iter().zip(&best.parts).map(|(without, with)| (with.0 / without.0).ln());
        let gain = 1.0 - (ratios.sum::<f64>() / best.parts.len().max(1) as f64).exp();
        Stability { parts: best.parts.len(), better: better.count(), gain, ranges }
    };
    best.added.iter().map(one).collect()
}

/// A selection once more under initial states that the model of its answer corrects: what the corrections of the
/// declared model had left may have looked like an effect.
pub fn confirm(fits: &Fits, judge: &Judge, mut selection: Selection, say: Say) -> Selection {
    let best = &selection.best;
    if best.added.is_empty() || stop::asked() {
        return selection;
    }
    let search = Search::new(fits, judge, say);
    let again = fits.fit_from(best.added.clone(), &best.fit.parameters, &best.fit.locals);
    let Some(mut best) = again else { return selection };
    fits.hold_out(&mut best);
    let before = best.added.len();
    let mut best = search.prune(best);
    if best.added.len() < before {
        (best, selection.equals) = search.exchange(best);
        (best, selection.stability, selection.refused) = search.steady(best);
    }
    selection.best = best;
    selection
}

/// A model proposed by other means, without effects that it does not need, judged as the search judges its own.
pub fn proposed(fits: &Fits, judge: &Judge, declared: &Model, best: Model, say: Say) -> Selection {
    let search = Search::new(fits, judge, say);
    let (mut declared, mut best) = (declared.clone(), best);
    fits.hold_out(&mut declared);
    fits.hold_out(&mut best);
    let path = vec![(Vec::new(), declared.held_out), (best.added.clone(), best.held_out)];
    let best = search.prune(best);
    let (best, equals) = search.exchange(best);
    let (best, stability, refused) = search.steady(best);
    Selection { equals, stability, refused, ..Selection::new(declared, best, Vec::new(), path) }
}

/// Searches from the fitted declared model, at most `most` effects.
pub fn search(fits: &Fits, judge: &Judge, declared: Model, most: usize, say: Say) -> Selection {
    let search = Search::new(fits, judge, say);
    let mut declared = declared;
    fits.hold_out(&mut declared);
    if judge.explained(fits, &declared) {
        let path = vec![(Vec::new(), declared.held_out)];
        let best = declared.clone();
        return Selection::new(declared, best, Vec::new(), path);
    }
    let mut path = vec![(Vec::new(), declared.held_out)];
    say("candidates one by one");
    let singles = search.extend(&declared);
    let mut best = search.climb(declared.clone(), most, &mut path);
    // A first step that was wrong shows when a pair beats it.
    if most >= 2 && best.added.len() != 1 {
        let pairs = search.pairs(&declared, &singles);
        if let Some(pair) = search.judge(&pairs) {
            let second = path.iter().find(|(added, _)| added.len() == 2).map_or(declared.held_out, |s| s.1);
            let worth = (1.0
                - if best.added.is_empty() { 2.0 * MIN_FALL_OF_HELD_OUT } else { MAX_DIFFERENCE_OF_EQUALS })
                * second;
            if pair.held_out < worth {
                let mut other = vec![path[0].clone(), (pair.added.clone(), pair.held_out)];
                let climbed = search.climb(pair, most, &mut other);
                if climbed.held_out < (1.0 - MAX_DIFFERENCE_OF_EQUALS) * best.held_out {
                    (best, path) = (climbed, other);
                }
            }
        }
    }
    let best = search.prune(best);
    if !search.enough(&best) {
        // No explanation to the noise: a proposal to the search for a share of the error, which judges it.
        return Selection::new(declared, best, singles, path);
    }
    say("trying other effects in their place");
    let (best, equals) = search.exchange(best);
    say("stability over parts of the records");
    let (best, stability, refused) = search.steady(best);
    let best = if stop::asked() { best } else { fits.polish(&best).unwrap_or(best) };
    Selection { equals, stability, refused, ..Selection::new(declared, best, singles, path) }
}
