//! The declared model with its parameters slightly off: corrected within their tolerances, alone or with candidates.
//!
//! A correction far outside of a tolerance is no correction: an effect that does the same explains the records better.

use super::System;
use super::fit::Free;
use super::ladder::{Ladder, Reached};
use super::search::{Model, Promise};
use super::select::insignificant;

/// Standard deviations of what is known of a declared parameter beyond which its correction is no small one.
const MAX_DEVIATIONS_OF_CORRECTION: f64 = 3.5;
/// Gain that a candidate must bring in place of a correction beyond that: most of what the correction costs.
const MIN_GAIN_OVER_CORRECTION: f64 = 0.85 * MAX_DEVIATIONS_OF_CORRECTION * MAX_DEVIATIONS_OF_CORRECTION;
/// Candidates that are fitted beside corrections.
const FITTED_CANDIDATES: usize = 7;
/// Rounds of a fit of corrections alone, and with candidates.
const ROUNDS: (usize, usize) = (12, 25);

/// The models with corrected parameters that leave only noise; every model that got as far as whole records is added to
/// `tried`.
pub fn with_corrections<S: System + ?Sized>(
    ladder: &Ladder<S>,
    declared: &Model,
    corrections: &[Free],
    (most, penalty): (usize, f64),
    tried: &mut Vec<Model>,
) -> Vec<Model> {
    let criterion = |model: &Model| model.fit.chi2 + penalty * model.size(ladder.candidates()) as f64;
    let mut base = ladder.climb(0, &[], corrections, declared, ROUNDS.0);
    let (mut passing, mut all) = (Vec::new(), vec![base.clone()]);
    for added in 0..=most.min(2) {
        let explained = ladder.explains(&base);
        let far = as_declared(&base.model, declared).1;
        if explained && added == 0 {
            passing.push(base.model.clone());
        }
        if added == most.min(2) || explained && !far {
            break;
        }
        let mut found = if explained {
            instead(ladder, &base.model, declared, corrections)
        } else {
            beside(ladder, &base, declared, corrections)
        };
        all.extend(found.iter().cloned());
        let better = if explained { base.model.fit.chi2 - MIN_GAIN_OVER_CORRECTION } else { f64::INFINITY };
        found.retain(|reached| ladder.explains(reached) && reached.model.fit.chi2 < better);
        let Some(best) = found.iter().min_by(|a, b| criterion(&a.model).total_cmp(&criterion(&b.model)))
        else {
            break;
        };
        base = best.clone();
        if explained {
            // What takes the place of a correction is about as simple, so the criterion has no say.
            passing.clear();
        }
        passing.extend(found.into_iter().map(|reached| reached.model));
    }
    tried.extend(all.into_iter().filter(|reached| reached.rung == ladder.top()).map(|reached| reached.model));
    passing
}

/// Candidates beside corrections that do not explain the records.
fn beside<S: System + ?Sized>(
    ladder: &Ladder<S>,
    base: &Reached,
    declared: &Model,
    corrections: &[Free],
) -> Vec<Reached> {
    let held = as_declared(&base.model, declared).0;
    let promises = [&base.model, &held].map(|start| ladder.screen(base.rung, start));
    let promises = merged(&promises, [&base.model, &held]);
    let mut found = ladder.attempt(base, &promises, corrections, (FITTED_CANDIDATES, ROUNDS.1));
    for reached in found.iter_mut().filter(|reached| ladder.explains(reached)) {
        if insignificant(ladder.candidates(), &base.model, &reached.model) {
            // The corrections alone do it, once they are led there.
            let mut start = reached.model.clone();
            for &c in reached.model.added.iter().filter(|c| !base.model.added.contains(c)) {
                for f in &ladder.candidates()[c].free {
                    start.fit.parameters[f.index] = declared.fit.parameters[f.index];
                }
            }
            let model = ladder.fit(reached.rung, &base.model.added, corrections, &start, ROUNDS.0);
            let alone = Reached { model, rung: reached.rung };
            if ladder.explains(&alone) {
                *reached = alone;
            }
        }
    }
    found
}

/// Candidates in place of corrections that explain the records, but some of them only far from what is declared.
fn instead<S: System + ?Sized>(
    ladder: &Ladder<S>,
    base: &Model,
    declared: &Model,
    corrections: &[Free],
) -> Vec<Reached> {
    let held = as_declared(base, declared).0;
    let near: Vec<Free> = corrections
        .iter()
        .filter(|f| held.fit.parameters[f.index] == base.fit.parameters[f.index])
        .copied()
        .collect();
    let promises = [ladder.screen(ladder.top(), base), ladder.screen(0, &held)];
    let mut found: Vec<Reached> = Vec::new();
    for (promise, _) in merged(&promises, [&held, &held]).into_iter().take(FITTED_CANDIDATES) {
        let mut added = base.added.clone();
        added.push(promise.candidate);
        let mut start = held.clone();
        for f in &ladder.candidates()[promise.candidate].free {
            start.fit.parameters[f.index] = promise.parameters[f.index];
        }
        // First without the corrections in question, since the way along a pair that does the same is long; with them
        // where that comes as far as the whole records.
        let reached = ladder.climb(0, &added, &near, &start, ROUNDS.1);
        let whole = reached.rung == ladder.top();
        found.push(if whole {
            ladder.climb(reached.rung, &added, corrections, &reached.model, ROUNDS.1)
        } else {
            reached
        });
    }
    found
}

/// The candidates of two lists, best first of each in turn, every candidate once.
fn merged<'a>(promises: &'a [Vec<Promise>; 2], starts: [&'a Model; 2]) -> Vec<(&'a Promise, &'a Model)> {
    let mut found: Vec<(&Promise, &Model)> = Vec::new();
    for i in 0..promises[0].len().max(promises[1].len()) {
        for (list, start) in promises.iter().zip(starts) {
            let new = list.get(i).filter(|p| !found.iter().any(|(other, _)| other.candidate == p.candidate));
            found.extend(new.map(|promise| (promise, start)));
        }
    }
    found
}

/// A model whose parameters are as declared where they are far outside of what is known of them, and whether some are.
///
/// They are held there while candidates are screened: free, they would do as well as any of them.
pub fn as_declared(model: &Model, declared: &Model) -> (Model, bool) {
    let mut start = model.clone();
    let mut some = false;
    for f in &model.fit.free {
        if f.prior
            .is_some_and(|prior| model.fit.parameters[f.index].abs() > MAX_DEVIATIONS_OF_CORRECTION * prior)
        {
            start.fit.parameters[f.index] = declared.fit.parameters[f.index];
            some = true;
        }
    }
    let kept = |f: &Free| f.prior.is_none() || start.fit.parameters[f.index] == model.fit.parameters[f.index];
    start.fit.free.retain(kept);
    (start, some)
}
