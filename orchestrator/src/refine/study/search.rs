//! Which candidates are missing: step by step with a look ahead to pairs, judged on what was kept back.

use super::catalogue::Candidate;
use super::explain::Judge;
use super::fits::{Fits, Model};
use super::law::{Law, Variable};
use super::model::{Action, Study};
use crate::refine::engine::parallel;

/// Share by which the error on what is kept back has to fall for an effect to be added.
pub const WORTH: f64 = 0.05;
/// Share of the declared model's error that an effect has to take away.
pub const NOTEWORTHY: f64 = 0.02;
/// Candidates whose errors differ by less than this share are equally good; the simplest is taken.
pub const EQUAL: f64 = 0.03;
/// Models of each step whose error on what is kept back is computed.
const LOOKED_AT: usize = 3;
/// Singles that pairs are made of.
const PAIRED: usize = 6;

/// Outcome.
#[derive(Debug)]
pub struct Selection {
    /// The declared model.
    pub declared: Model,
    /// The model of the answer.
    pub best: Model,
    /// Models with one effect exchanged that are as good as the best: effect that is replaced, the model.
    pub equals: Vec<(usize, Model)>,
    /// Single candidates on top of the declared model, best first.
    pub singles: Vec<Model>,
    /// Errors on what was kept back after each step: effects so far, error.
    pub path: Vec<(Vec<usize>, f64)>,
}

/// Sentences for a progress display.
pub type Say<'a> = &'a (dyn Fn(&str) + Sync);

/// Whether the shape of the candidate added last shows in the records; those before it are exchanged in the end. Far from where the records were, a spring is a constant
/// force, so is an end stop, a long wave is a spring, a wide friction peak is Coulomb friction.
fn shown(study: &Study, model: &Model) -> bool {
    let p = &model.fit.parameters;
    model.added.last().map(|&c| &study.candidates[c]).is_none_or(|own| {
        let Action::Block { law, tap } = own.action else { return true };
        let (low, high) = study.range(tap, Variable::Position);
        let (travel, first) = (high - low, own.entries.start);
        let (slowest, fastest) = study.range(tap, Variable::Velocity);
        match law {
            Law::Spring => {
                let rest = -p[first + 1] / p[first];
                p[first] > 0.0 && (low - travel..=high + travel).contains(&rest)
            }
            Law::EndStop => (low + 0.25 * travel..=high).contains(&p[first + 2]),
            Law::Cogging => p[first + 2] <= travel,
            Law::Stribeck => p[first + 1] <= 0.5 * fastest.abs().max(slowest.abs()),
            Law::Presliding => travel <= 0.0 || p[first] <= 0.25 * travel,
            _ => true,
        }
    })
}

/// Whether a fitted model takes energy out where friction should, over the whole range of the records.
fn passive(study: &Study, model: &Model) -> bool {
    let p = &model.fit.parameters;
    (0..study.taps.len()).all(|tap| {
        let strength = |law: Law| {
            let own = model.added.iter().map(|&c| &study.candidates[c]);
            let found = own.filter(|c| c.action == Action::Block { law, tap }).map(|c| c.entries.start);
            found.map(|index| (p[index], index)).next()
        };
        let declared = study.taps[tap].coulomb.map_or(0.0, |level| level.of(p));
        let coulomb = declared + strength(Law::Coulomb).map_or(0.0, |s| s.0);
        let asymmetry = strength(Law::Asymmetry);
        let forwards = asymmetry.map_or(0.0, |(force, _)| force);
        // One direction may have less friction, not none; without Coulomb friction a force for one direction is a bias.
        if asymmetry.is_some() && coulomb + forwards < 0.0 {
            return false;
        }
        match strength(Law::PositionCoulomb) {
            None => true,
            Some((slope, _)) => study.ranges.get(tap).is_none_or(|range| {
                [range[1].0, range[1].1].iter().all(|x| coulomb + slope * x >= -0.05 * coulomb.abs())
            }),
        }
    })
}

fn complexity(candidates: &[Candidate], model: &Model) -> usize {
    model.added.iter().map(|&c| candidates[c].complexity).sum()
}

/// The simplest of the models that are about as good as the best, then the best of those.
fn choose(study: &Study, models: Vec<Model>) -> Option<Model> {
    let least = models.iter().map(|model| model.held_back).fold(f64::INFINITY, f64::min);
    let near = models.into_iter().filter(|model| model.held_back <= (1.0 + EQUAL) * least);
    near.min_by(|a, b| {
        let key = |model: &Model| complexity(&study.candidates, model);
        key(a).cmp(&key(b)).then(a.held_back.total_cmp(&b.held_back))
    })
}

struct Search<'a> {
    fits: &'a Fits<'a>,
    judge: &'a Judge,
    say: Say<'a>,
}

impl Search<'_> {
    fn study(&self) -> &Study {
        self.fits.study
    }

    fn physical(&self, model: &Model) -> bool {
        passive(self.study(), model) && shown(self.study(), model)
    }

    /// Exchanges effects for simpler ones that do as well.
    fn simplify(&self, mut best: Model) -> Model {
        'again: loop {
            for &c in &best.added {
                let candidates = &self.study().candidates;
                let rest: Vec<usize> = best.added.iter().copied().filter(|&other| other != c).collect();
                if rest.iter().any(|&other| candidates[other].needs == Some(c)) {
                    continue;
                }
                let simpler = (0..candidates.len()).filter(|&other| {
                    let own = &candidates[other];
                    !own.probe
                        && own.complexity < candidates[c].complexity
                        && !best.added.contains(&other)
                        && own.needs.is_none_or(|needs| rest.contains(&needs))
                });
                let simpler: Vec<usize> = simpler.collect();
                if simpler.is_empty() {
                    continue;
                }
                let Some(base) = self.fits.fit_from(rest, &best.fit.parameters, &best.fit.locals) else {
                    continue;
                };
                let found = parallel::map(simpler.len(), |i| self.fits.add(&base, simpler[i]));
                let near = |model: &Model| model.error <= (1.0 + EQUAL) * best.error && self.physical(model);
                let mut found: Vec<Model> = found.into_iter().flatten().filter(near).collect();
                found.sort_by(|a, b| a.error.total_cmp(&b.error));
                if let Some(mut model) = found.into_iter().next() {
                    self.fits.hold_back(&mut model);
                    if model.held_back <= (1.0 + EQUAL) * best.held_back {
                        best = model;
                        continue 'again;
                    }
                }
            }
            return best;
        }
    }

    /// `base` with each candidate that it lacks, best fit first.
    fn extend(&self, base: &Model) -> Vec<Model> {
        let fitting = |c: &usize| {
            let own = &self.study().candidates[*c];
            !own.probe && !base.added.contains(c) && own.needs.is_none_or(|needs| base.added.contains(&needs))
        };
        let open: Vec<usize> = (0..self.study().candidates.len()).filter(fitting).collect();
        let found = parallel::map(open.len(), |i| self.fits.add(base, open[i]));
        let mut found: Vec<Model> =
            found.into_iter().flatten().filter(|model| self.physical(model)).collect();
        found.sort_by(|a, b| a.error.total_cmp(&b.error));
        found
    }

    /// The best of some models on what is kept back.
    fn judge(&self, models: &[Model]) -> Option<Model> {
        let least = models.first().map_or(0.0, |model| model.error);
        // What fits much worse will not be better on what is kept back.
        let near = models.iter().take(LOOKED_AT).filter(|model| model.error <= 1.2 * least);
        let mut near: Vec<Model> = near.cloned().collect();
        near.iter_mut().for_each(|model| self.fits.hold_back(model));
        choose(self.study(), near)
    }

    /// Pairs on top of `base`, of the best single ones, best fit first.
    fn pairs(&self, base: &Model, singles: &[Model]) -> Vec<Model> {
        let mut found: Vec<Model> = Vec::new();
        let last = |model: &Model| model.added.last().copied();
        let wanted: Vec<usize> = singles.iter().take(PAIRED).filter_map(last).collect();
        let mut jobs = Vec::new();
        for (i, single) in singles.iter().take(PAIRED).enumerate() {
            let own = last(single);
            jobs.extend(wanted[i + 1..].iter().map(|&c| (i, c)));
            // What acts on the Coulomb level comes with it.
            let needing = (0..self.study().candidates.len())
                .filter(|&c| self.study().candidates[c].needs.is_some_and(|needs| Some(needs) == own));
            jobs.extend(needing.map(|c| (i, c)));
        }
        let models = parallel::map(jobs.len(), |j| self.fits.add(&singles[jobs[j].0], jobs[j].1));
        found.extend(models.into_iter().flatten().filter(|model| self.physical(model)));
        found.retain(|model| model.added.len() == base.added.len() + 2);
        found.sort_by(|a, b| a.error.total_cmp(&b.error));
        found
    }

    /// Adds effects to `from` one by one (two where only the pair is worth it) up to `most`.
    fn climb(&self, from: Model, most: usize, path: &mut Vec<(Vec<usize>, f64)>) -> Model {
        // What takes away next to nothing of the declared model's error is no finding, however little is left.
        let least = path.first().map_or(0.0, |(_, error)| NOTEWORTHY * error);
        let mut best = from;
        while best.added.len() < most && !self.judge.settled(self.fits, &best) {
            (self.say)(&format!("searching effect {}", best.added.len() + 1));
            let worth = ((1.0 - WORTH) * best.held_back).min(best.held_back - least);
            let singles = self.extend(&best);
            // What gains too little where it was fitted gains no more on what is kept back.
            let gains = |model: &&Model| {
                best.error - model.error > least || self.judge.halves(best.error, model.error)
            };
            let promising: Vec<Model> = singles.iter().filter(gains).cloned().collect();
            let halves = |model: &Model| self.judge.halves(best.held_back, model.held_back);
            let single = self.judge(&promising).filter(|model| model.held_back < worth || halves(model));
            let next = match single {
                Some(model) => Some(model),
                None if best.added.len() + 2 <= most => {
                    let pairs = self.pairs(&best, &singles);
                    self.judge(&pairs).filter(|model| model.held_back < (1.0 - 2.0 * WORTH) * best.held_back)
                }
                None => None,
            };
            let Some(next) = next else { break };
            best = next;
            path.push((best.added.clone(), best.held_back));
        }
        best
    }

    /// Leaves effects out again that the others have made superfluous.
    fn prune(&self, mut best: Model) -> Model {
        'again: while best.added.len() > 1 {
            for &c in &best.added {
                let rest: Vec<usize> = best.added.iter().copied().filter(|&other| other != c).collect();
                let needs = |&other: &usize| self.study().candidates[other].needs == Some(c);
                if rest.iter().any(needs) {
                    continue;
                }
                let Some(mut without) = self.fits.fit_from(rest, &best.fit.parameters, &best.fit.locals)
                else {
                    continue;
                };
                if without.error > 1.3 * best.error {
                    continue;
                }
                self.fits.hold_back(&mut without);
                if without.held_back <= (1.0 + 0.5 * WORTH) * best.held_back && self.physical(&without) {
                    best = without;
                    continue 'again;
                }
            }
            break;
        }
        best
    }

    /// Models with the last effect exchanged that are as good; those that only contain it with more freedom are no
    /// other explanation.
    fn equals(&self, best: &Model, tried: &[Model]) -> Vec<(usize, Model)> {
        let mut found = Vec::new();
        for model in tried {
            let lacks: Vec<usize> = best.added.iter().copied().filter(|c| !model.added.contains(c)).collect();
            let (&[lacking], true) = (&lacks[..], model.added.len() == best.added.len()) else { continue };
            let near = (model.error / best.error - 1.0).abs() < 0.2 * EQUAL;
            if near
                && complexity(&self.study().candidates, model) >= complexity(&self.study().candidates, best)
            {
                let mut model = model.clone();
                self.fits.hold_back(&mut model);
                if model.held_back < (1.0 + 0.2 * EQUAL) * best.held_back {
                    found.push((lacking, model));
                }
            }
        }
        found
    }
}

/// Searches from the fitted declared model, at most `most` effects.
pub fn search(fits: &Fits, judge: &Judge, declared: Model, most: usize, say: Say) -> Selection {
    let search = Search { fits, judge, say };
    let mut declared = declared;
    fits.hold_back(&mut declared);
    if judge.explained(fits, &declared) {
        let path = vec![(Vec::new(), declared.held_back)];
        let best = declared.clone();
        return Selection { declared, best, equals: Vec::new(), singles: Vec::new(), path };
    }
    let mut path = vec![(Vec::new(), declared.held_back)];
    let singles = search.extend(&declared);
    let mut best = search.climb(declared.clone(), most, &mut path);
    // A first step that was wrong shows when a pair beats it.
    if most >= 2 && best.added.len() != 1 {
        let pairs = search.pairs(&declared, &singles);
        if let Some(pair) = search.judge(&pairs) {
            let second = path.iter().find(|(added, _)| added.len() == 2).map_or(declared.held_back, |s| s.1);
            let worth = (1.0 - if best.added.is_empty() { 2.0 * WORTH } else { EQUAL }) * second;
            if pair.held_back < worth {
                let mut other = vec![path[0].clone(), (pair.added.clone(), pair.held_back)];
                let climbed = search.climb(pair, most, &mut other);
                if climbed.held_back < (1.0 - EQUAL) * best.held_back {
                    (best, path) = (climbed, other);
                }
            }
        }
    }
    let best = search.simplify(search.prune(best));
    say("fitting the answer");
    let best = fits.polish(&best).unwrap_or(best);
    let equals = if best.added.is_empty() {
        Vec::new()
    } else {
        let base: Vec<usize> = best.added[..best.added.len() - 1].to_vec();
        let base = fits.fit_from(base, &best.fit.parameters, &best.fit.locals);
        base.map_or_else(Vec::new, |base| search.equals(&best, &search.extend(&base)))
    };
    Selection { declared, best, equals, singles, path }
}
