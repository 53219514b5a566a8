//! Smallest set of candidates that leaves nothing but noise.
//!
//! Models are tried in the order of their assumptions: the declared model as it is, one candidate, a pair of
//! candidates, the declared model with its parameters slightly off, and candidates on top of that. The first stage
//! whose best model leaves only noise decides. Within it the Bayesian information criterion chooses; models within
//! [`MAX_DIFFERENCE_OF_CRITERION`] of the best cannot be distinguished from it by these records.

use super::candidate::Candidate;
use super::corrected::{as_declared, with_corrections};
use super::fit::Free;
use super::ladder::{Ladder, Reached, beginnings};
use super::search::{Model, Promise, Search};
use super::{System, stop};
use crate::order::ascending;

/// A model leaves only noise when no normalized power exceeds the largest of the null by more than this.
pub const MARGIN: f64 = 8.0;
/// A model that leaves more than the largest normalized power of the null plus this, if less than [`MARGIN`], is
/// compared with the declared model corrected.
pub const MIN_EXCESS_OF_NULL: f64 = 1.0;
/// Improvement of the sum of squares below which an effect is not looked at; noise gives up to some 25.
pub const MIN_FALL_OF_SQUARES: f64 = 45.0;
/// Difference of the information criterion within which two models count as equal.
pub const MAX_DIFFERENCE_OF_CRITERION: f64 = 12.0;
/// Rounds of a fit of candidates.
const ROUNDS: usize = 14;

/// How the declared model and the records were brought together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Declared model as it is.
    Declared,
    /// Candidates added to the declared model.
    Effects,
    /// Declared parameters corrected within what is known of them, candidates added if any.
    Corrected,
}

/// Outcome of the search.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Stage that ended the search.
    pub stage: Stage,
    /// The model of the answer, or the best one found if nothing leaves only noise.
    pub best: Model,
    /// Models that the records cannot tell from the best, best first.
    pub equals: Vec<Model>,
    /// Whether the best model leaves only noise.
    pub explained: bool,
    /// Every model that was fitted.
    pub tried: Vec<Model>,
    /// The declared model with the initial states fitted.
    pub declared: Model,
    /// Predicted sum of squares of every candidate added to the declared model, best first.
    pub screened: Vec<Promise>,
}

/// Candidates that a part of the system has been explained with, to be tried together.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// Candidates.
    pub added: Vec<usize>,
    /// Parameter vector.
    pub parameters: Vec<f64>,
}

/// Limits of the search.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Most effects added.
    pub max_effects: usize,
    /// Single candidates that are fitted.
    pub singles: usize,
    /// Single candidates that are fitted from the beginnings of the records on, where none leaves only noise otherwise.
    pub climbed: usize,
    /// Singles that pairs are built on, and candidates fitted on each.
    pub pairs: (usize, usize),
}

impl Default for Effort {
    fn default() -> Effort {
        Effort { max_effects: 3, singles: 14, climbed: 5, pairs: (4, 4) }
    }
}

/// Runs the search from the fitted declared model; `proposals` is asked when no single effect explains the records.
pub fn select<S: System + ?Sized>(
    search: &Search<S>,
    declared: Model,
    corrections: &[Free],
    effort: Effort,
    proposals: &dyn Fn() -> Vec<Proposal>,
) -> Selection {
    let limit = search.null.quantile + MARGIN;
    let penalty = search.penalty();
    let criterion = |model: &Model| model.fit.chi2 + penalty * model.size(search.candidates) as f64;
    let mut tried: Vec<Model> = Vec::new();
    search.system.stage("screening");
    let promises = search.screen(&declared);
    let screened = promises.clone();
    let end = |stage, passing: Vec<Model>, tried: Vec<Model>| {
        let mut passing = passing;
        ascending(&mut passing, criterion);
        let best = passing.remove(0);
        let equals = passing
            .into_iter()
            .filter(|other| {
                criterion(other) - criterion(&best) < MAX_DIFFERENCE_OF_CRITERION
                    && !nested(search.candidates, &best, other)
                    && !insignificant(search.candidates, &best, other)
            })
            .collect();
        let (declared, screened) = (declared.clone(), screened.clone());
        Selection { stage, best, equals, explained: true, tried, declared, screened }
    };
    let unexplained = |tried: Vec<Model>, declared: Model| {
        let best = tried
            .iter()
            .min_by(|a, b| criterion(a).total_cmp(&criterion(b)))
            .cloned()
            .unwrap_or(declared.clone());
        let (stage, screened) = (Stage::Effects, screened.clone());
        Selection { stage, best, equals: Vec::new(), explained: false, tried, declared, screened }
    };
    let clean = declared.worst() < limit;
    if clean {
        let noticed = promises
            .iter()
            .take(3)
            .map(|p| search.fit(&[p.candidate], &[], &p.parameters, &declared.fit.locals, 10));
        let noticed: Vec<Model> =
            noticed.filter(|m| declared.fit.chi2 - criterion(m) > MIN_FALL_OF_SQUARES).collect();
        if noticed.is_empty() {
            return end(Stage::Declared, vec![declared.clone()], tried);
        }
    }
    search.system.stage("single effects");
    let singles = attempt(search, &declared, &promises, effort.singles, limit);
    tried.extend(singles.iter().cloned());
    if stop::asked() {
        return unexplained(tried, declared);
    }
    let systems = beginnings(search.system);
    let ladder = Ladder::new(search, &systems, &declared, MARGIN);
    let passes = |m: &Model| m.worst() < limit;
    let mut passing: Vec<Model> = singles.iter().filter(|m| passes(m)).cloned().collect();
    if passing.is_empty() {
        let climbed = climbed(&ladder, &declared, effort.climbed);
        passing = climbed.iter().filter(|m| passes(m)).cloned().collect();
        tried.extend(climbed);
    }
    let mut bases = Vec::new();
    if passing.is_empty() && !stop::asked() {
        let proposed = proposed(&ladder, &declared, &proposals());
        let whole = proposed.iter().filter(|reached| reached.rung == ladder.top());
        let mut whole: Vec<Model> = whole.map(|reached| reached.model.clone()).collect();
        whole.retain(|m| m.added.len() <= effort.max_effects);
        passing = whole.iter().filter(|m| passes(m) && m.added.len() == 1).cloned().collect();
        if passing.is_empty() {
            passing = without_company(search, &declared, whole.iter().filter(|m| passes(m)).cloned(), limit);
        }
        tried.extend(whole);
        bases.extend(proposed.into_iter().map(|reached| reached.model).filter(|m| m.added.len() == 1));
    }
    if passing.is_empty() && effort.max_effects >= 2 && !stop::asked() {
        search.system.stage("pairs of effects");
        bases.extend(singles.iter().cloned());
        let pairs = pairs(&ladder, &bases, effort.pairs);
        tried.extend(pairs.iter().cloned());
        passing = without_company(search, &declared, pairs.into_iter().filter(|m| passes(m)), limit);
    }
    let best = passing.iter().min_by(|a, b| criterion(a).total_cmp(&criterion(b))).cloned();
    if let Some(best) = best.filter(|best| best.added.len() > 1) {
        let others = exchanged(&ladder, &declared, &best, effort.pairs.1);
        tried.extend(others.iter().cloned());
        let new = |m: &Model| passes(m) && !passing.iter().any(|old| same(old, m));
        let others: Vec<Model> = others.into_iter().filter(new).collect();
        passing.extend(others);
    }
    let best = passing.iter().min_by(|a, b| criterion(a).total_cmp(&criterion(b))).cloned();
    if best.as_ref().is_some_and(|best| best.worst() < search.null.quantile + MIN_EXCESS_OF_NULL) {
        return end(Stage::Effects, passing, tried);
    }
    if stop::asked() || corrections.is_empty() {
        return match passing.is_empty() {
            true => unexplained(tried, declared),
            false => end(Stage::Effects, passing, tried),
        };
    }
    search.system.stage("declared parameters");
    let rivals = with_corrections(&ladder, &declared, corrections, (effort.max_effects, penalty), &mut tried);
    let plausible = rivals.iter().filter(|rival| !as_declared(rival, &declared).1);
    let least = plausible.map(criterion).fold(f64::INFINITY, f64::min);
    match best {
        // An effect can imitate parameters that are slightly off, but not well. Parameters far off are no rival.
        Some(best) if least > best.fit.chi2 - MIN_FALL_OF_SQUARES => end(Stage::Effects, passing, tried),
        _ if !rivals.is_empty() => end(Stage::Corrected, rivals, tried),
        _ => unexplained(tried, declared),
    }
}

/// Whether `other` only adds freedom to `best`: one of its candidates contains the one of the best.
fn nested(candidates: &[Candidate], best: &Model, other: &Model) -> bool {
    let lacks: Vec<usize> = best.added.iter().copied().filter(|c| !other.added.contains(c)).collect();
    let has: Vec<usize> = other.added.iter().copied().filter(|c| !best.added.contains(c)).collect();
    match (&lacks[..], &has[..]) {
        ([], _) => true,
        (&[one], &[another]) => candidates[another].adds_to(&candidates[one]),
        _ => false,
    }
}

/// Whether a candidate of `other` imitates the best one at the edge of what it can be: with a parameter at a bound, or
/// with one that might as well be neutral. That is no second explanation.
pub fn insignificant(candidates: &[Candidate], best: &Model, other: &Model) -> bool {
    let own = |c: &usize| candidates[*c].free.iter().map(|f| f.index);
    let new: Vec<usize> = other.added.iter().filter(|c| !best.added.contains(c)).flat_map(own).collect();
    other.fit.free.iter().enumerate().any(|(a, f)| {
        let uncertain = 3.0 * other.fit.covariance[(a, a)].max(0.0).sqrt();
        new.contains(&f.index) && (other.fit.at_bound[a] || other.fit.parameters[f.index].abs() < uncertain)
    })
}

/// Fits what is promising on top of `base`, best promise first. Once a model leaves only noise, only candidates that
/// promised about as much are still fitted, or that have fewer parameters: a mode with much damping is a lag.
pub fn attempt<S: System + ?Sized>(
    search: &Search<S>,
    base: &Model,
    promises: &[Promise],
    count: usize,
    limit: f64,
) -> Vec<Model> {
    let mut found: Vec<Model> = Vec::new();
    // Promise up to which others are fitted, and parameters of the first candidate that leaves only noise.
    let (mut enough, mut parameters) = (f64::INFINITY, None);
    let mut seen = Vec::new();
    for promise in promises {
        if seen.len() >= count || stop::asked() {
            break;
        }
        let own = search.candidates[promise.candidate].free.len();
        let promises_less = promise.chi2 > enough && parameters.is_some_and(|most| own >= most);
        if seen.contains(&promise.candidate) || promises_less {
            continue;
        }
        seen.push(promise.candidate);
        let mut added = base.added.clone();
        added.push(promise.candidate);
        let model = search.fit(&added, &[], &promise.parameters, &base.fit.locals, ROUNDS);
        if model.worst() < limit {
            parameters.get_or_insert(own);
            enough = enough.min(2.0 * promise.chi2);
        }
        found.push(model);
    }
    ascending(&mut found, |own| own.fit.chi2);
    found
}

/// Fits of what is proposed, from the beginnings of the records on as far as they go.
fn proposed<S: System + ?Sized>(
    ladder: &Ladder<S>,
    declared: &Model,
    proposals: &[Proposal],
) -> Vec<Reached> {
    let fit = |proposal: &Proposal| {
        let mut start = declared.clone();
        start.fit.parameters.clone_from(&proposal.parameters);
        ladder.climb(0, &proposal.added, &[], &start, ROUNDS)
    };
    proposals.iter().map(fit).collect()
}

/// Single candidates, fitted from the beginnings of the records on: over whole records a fit of an effect that is
/// nonlinear in its parameters loses its way more easily.
fn climbed<S: System + ?Sized>(ladder: &Ladder<S>, declared: &Model, count: usize) -> Vec<Model> {
    let base = Reached { model: ladder.fit(0, &[], &[], declared, 5), rung: 0 };
    let promises = ladder.screen(0, &base.model);
    let promises: Vec<(&Promise, &Model)> = promises.iter().map(|p| (p, &base.model)).collect();
    let reached = ladder.attempt(&base, &promises, &[], (count, ROUNDS));
    reached.into_iter().filter(|reached| reached.rung == ladder.top()).map(|reached| reached.model).collect()
}

/// Models that leave only noise; where they still do with one of their effects left out, without it: a second one may
/// only have led the first to its place.
fn without_company<S: System + ?Sized>(
    search: &Search<S>,
    declared: &Model,
    models: impl Iterator<Item = Model>,
    limit: f64,
) -> Vec<Model> {
    let (mut found, mut fewer): (Vec<Model>, Vec<Model>) = (models.collect(), Vec::new());
    for model in &found {
        for &left_out in model.added.iter().filter(|_| model.added.len() > 1) {
            let added: Vec<usize> = model.added.iter().copied().filter(|&c| c != left_out).collect();
            let mut start = model.fit.parameters.clone();
            for f in &search.candidates[left_out].free {
                start[f.index] = declared.fit.parameters[f.index];
            }
            fewer.push(search.fit(&added, &[], &start, &model.fit.locals, ROUNDS));
        }
    }
    fewer.retain(|m| m.worst() < limit);
    if !fewer.is_empty() {
        found = fewer;
    }
    found
}

/// A model with each of its effects exchanged for others: what a second effect was found beside need not have been the
/// right one.
fn exchanged<S: System + ?Sized>(
    ladder: &Ladder<S>,
    declared: &Model,
    model: &Model,
    count: usize,
) -> Vec<Model> {
    let kept = |&kept: &usize| {
        let mut base = Model { added: vec![kept], ..model.clone() };
        for &c in model.added.iter().filter(|&&c| c != kept) {
            for f in &ladder.candidates()[c].free {
                base.fit.parameters[f.index] = declared.fit.parameters[f.index];
            }
        }
        pairs(ladder, &[base], (1, count))
    };
    model.added.iter().flat_map(kept).collect()
}

/// Whether two models have the same effects.
fn same(a: &Model, b: &Model) -> bool {
    a.added.len() == b.added.len() && a.added.iter().all(|c| b.added.contains(c))
}

/// Pairs: the best singles, each with the candidates that promise most beside it, as far as it goes.
fn pairs<S: System + ?Sized>(
    ladder: &Ladder<S>,
    singles: &[Model],
    (bases, each): (usize, usize),
) -> Vec<Model> {
    let mut found: Vec<Model> = Vec::new();
    for single in singles.iter().take(bases) {
        let base = ladder.climb(0, &single.added, &[], single, ROUNDS);
        let promises = ladder.screen(base.rung, &base.model);
        let promises: Vec<(&Promise, &Model)> = promises.iter().map(|p| (p, &base.model)).collect();
        let reached = ladder.attempt(&base, &promises, &[], (each, ROUNDS));
        let explained = reached.iter().any(|reached| ladder.explains(reached));
        for Reached { model, .. } in reached.into_iter().filter(|reached| reached.rung == ladder.top()) {
            if !found.iter().any(|other| same(other, &model)) {
                found.push(model);
            }
        }
        if explained {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::candidate::Start;
    use crate::engine::goodness::Null;
    use crate::engine::search::Rules;
    use crate::engine::system::testing::Lines;

    fn candidate(id: &'static str, index: usize) -> Candidate {
        let free = vec![Free { index, bounds: (-1e3, 1e3), step: 1e-3, prior: None }];
        let starts = vec![Start { values: Vec::new(), open: vec![0], idle: true }];
        Candidate { id, channel: "c", signal: None, free, starts, place: 0, contains: None }
    }

    fn chosen(system: &Lines, candidates: &[Candidate]) -> (Vec<&'static str>, bool, usize) {
        let locals = vec![vec![0.0], vec![40.0]];
        let null = Null::simulate(system, &[0, 1], &[0.0, 0.0], &locals, 100, 1);
        let search = Search {
            system,
            candidates,
            records: vec![0, 1],
            screened: vec![0, 1],
            null,
            rules: Rules::default(),
        };
        let declared = search.fit(&[], &[], &[0.0, 0.0], &locals, 5);
        let found = select(&search, declared, &[], Effort::default(), &Vec::new);
        (found.best.added.iter().map(|&c| candidates[c].id).collect(), found.explained, found.equals.len())
    }

    #[test]
    fn nothing_is_added_to_a_model_that_leaves_noise() {
        let candidates = [candidate("slope", 0), candidate("square", 1)];
        assert_eq!(chosen(&Lines::new(0.0, 0.0), &candidates), (vec![], true, 0));
    }

    #[test]
    fn the_effect_that_is_there_is_chosen_alone() {
        let candidates = [candidate("slope", 0), candidate("square", 1)];
        assert_eq!(chosen(&Lines::new(0.0, 60.0), &candidates), (vec!["square"], true, 0));
        assert_eq!(chosen(&Lines::new(60.0, 0.0), &candidates), (vec!["slope"], true, 0));
    }

    #[test]
    fn two_effects_are_found_as_a_pair() {
        let candidates = [candidate("slope", 0), candidate("square", 1)];
        let (mut both, explained, _) = chosen(&Lines::new(-60.0, 90.0), &candidates);
        both.sort_unstable();
        assert_eq!((both, explained), (vec!["slope", "square"], true));
    }

    #[test]
    fn an_effect_that_only_came_along_is_left_out() {
        let candidates = [candidate("slope", 0), candidate("square", 1)];
        let system = Lines::new(0.0, 60.0);
        let locals = vec![vec![0.0], vec![40.0]];
        let null = Null::simulate(&system, &[0, 1], &[0.0, 0.0], &locals, 100, 1);
        let limit = null.quantile + MARGIN;
        let search = Search {
            system: &system,
            candidates: &candidates,
            records: vec![0, 1],
            screened: vec![0, 1],
            null,
            rules: Rules::default(),
        };
        let declared = search.fit(&[], &[], &[0.0, 0.0], &locals, 5);
        let pair = search.fit(&[0, 1], &[], &[0.0, 0.0], &locals, 10);
        assert!(pair.worst() < limit);
        let enough = without_company(&search, &declared, [pair].into_iter(), limit);
        assert_eq!(enough.iter().map(|m| &m.added[..]).collect::<Vec<_>>(), [[1]]);
    }

    #[test]
    fn a_declared_parameter_far_from_what_is_known_of_it_is_an_effect() {
        let candidates = [candidate("slope", 0)];
        let system = Lines::new(60.0, 0.0);
        // The same slope as a correction: known to `share`.
        let with_share = |share: f64| {
            let locals = vec![vec![0.0], vec![40.0]];
            let null = Null::simulate(&system, &[0, 1], &[0.0; 3], &locals, 100, 1);
            let search = Search {
                system: &system,
                candidates: &candidates,
                records: vec![0, 1],
                screened: vec![0, 1],
                null,
                rules: Rules::default(),
            };
            let declared = search.fit(&[], &[], &[0.0; 3], &locals, 5);
            let correction = Free { index: 2, bounds: (-1e3, 1e3), step: 1e-3, prior: Some(share) };
            let effort = Effort { singles: 0, climbed: 0, ..Effort::default() };
            select(&search, declared, &[correction], effort, &Vec::new).best.added.len()
        };
        assert_eq!((with_share(40.0), with_share(6.0)), (0, 1));
    }

    #[test]
    fn twins_are_told_as_equals() {
        let candidates = [candidate("slope", 0), candidate("twin", 0)];
        assert_eq!(chosen(&Lines::new(60.0, 0.0), &candidates), (vec!["slope"], true, 1));
    }

    #[test]
    fn what_no_candidate_explains_is_said() {
        let candidates = [candidate("slope", 0)];
        assert!(!chosen(&Lines::new(0.0, 300.0), &candidates).1);
    }
}
