//! The smallest set of effects with which a study leaves nothing but sensor noise: the engine's search, with residuals
//! in units of the noise.

use super::beside::SCREENED_RECORDS;
use super::changed;
use super::explain::{Judge, noises};
use super::fits::{Fits, Model};
use super::influence::{Singles, influential};
use super::model::Study;
use super::physical::physical;
use super::search::{Say, Selection, stability};
use super::tolerance;
use super::whole::{Whole, candidate, model};
use crate::answer::Settings;
use crate::engine::candidate::Candidate;
use crate::engine::fit::{Fit, Free, fit};
use crate::engine::search::{self, Rules, Search};
use crate::engine::select::{self, Effort, select};
use crate::order::ascending;

/// Single candidates whose errors on what is held out are shown beside that of the best model.
const HELD_OUT_RIVALS: usize = 3;
/// Models that are tried: fewer than for the rig, as a simulation over FMUs costs more.
const EFFORT: Effort = Effort { max_effects: 3, singles: 10, climbed: 2, pairs: (3, 3) };
/// Rounds of a fit of everything.
const ROUNDS: usize = 14;

/// Searches from the fitted declared model.
///
/// # Errors
/// Nothing explains the records to the noise: the best model that was tried, if there is one.
pub fn search(
    fits: &Fits,
    judge: &Judge,
    declared: &Model,
    settings: &Settings,
    say: Say,
) -> Result<Selection, Option<Box<Model>>> {
    let study = fits.study;
    if judge.explained(fits, declared) {
        return Err(None);
    }
    let view = fits.view(&[], &fits.pieces);
    let whole = Whole::new(&view, noises(study), say);
    let mut candidates: Vec<Candidate> = (0..study.candidates.len()).map(|c| candidate(study, c)).collect();
    let changes = changes(study, &whole, &declared.fit, &candidates);
    candidates.extend(changes.iter().map(|&free| changed::candidate(free)));
    let always = study.declared_free();
    let found = fewest(fits, judge, (&whole, &candidates), (&always, &declared.fit), settings);
    if !found.explained || found.best.added.is_empty() {
        return Err(Some(Box::new(model(fits, &found.best))).filter(|best| best.error.is_finite()));
    }
    // An effect of the list comes before another value of a declared parameter.
    let mut equals: Vec<&search::Model> = [&found.best].into_iter().chain(&found.equals).collect();
    let first = (0..equals.len()).min_by_key(|&k| changed::corrected(study, &equals[k].fit).len());
    let chosen = equals.remove(first.unwrap_or(0));
    let changed = changed::changed(study, &chosen.fit, settings.forward_selection.max_tolerances);
    let mut best = model(fits, chosen);
    // Parameters that are off within their tolerances are corrections, for which the search for shares is.
    if changed.len() < changed::corrected(study, &chosen.fit).len() || !judge.explained(fits, &best) {
        return Err(None);
    }
    let replaced = |own: &search::Model| {
        let lacking = chosen.added.iter().copied().find(|c| !own.added.contains(c))?;
        let change = lacking.checked_sub(study.candidates.len());
        Some((change.map_or(lacking, |k| changed::group(study, &changes[k])), model(fits, own)))
    };
    let equals = equals.into_iter().filter_map(replaced).collect();
    let single = |own: &&search::Model| matches!(own.added[..], [c] if c < study.candidates.len());
    let mut singles: Vec<Model> = found.tried.iter().filter(single).map(|own| model(fits, own)).collect();
    ascending(&mut singles, |own| own.error);
    singles.dedup_by(|a, b| a.added == b.added);
    let mut declared = declared.clone();
    say("stability over parts of the records");
    fits.hold_out(&mut declared);
    let stability = stability(fits, Some(&declared), &mut best);
    // Others that do nearly as well are held out, too, to be shown.
    let near = singles.iter_mut().filter(|own| own.added != best.added);
    near.take(HELD_OUT_RIVALS).for_each(|own| fits.hold_out(own));
    let path = vec![(Vec::new(), declared.held_out), (best.added.clone(), best.held_out)];
    let selection = Selection::new(declared, best, singles, path);
    Ok(Selection { equals, stability, exact: true, changed, ..selection })
}

/// The fewest effects beside which a model that has a law already leaves nothing but noise: the model with all of them,
/// if there is one.
pub fn beside(fits: &Fits, judge: &Judge, with_law: &Model, settings: &Settings, say: Say) -> Option<Model> {
    let study = fits.study;
    let view = fits.view(&[], &fits.pieces);
    let whole = Whole::new(&view, noises(study), say);
    let candidates: Vec<Candidate> = (0..study.candidates.len()).map(|c| candidate(study, c)).collect();
    // The parameters of the law say that it acts.
    let entries = with_law.added.iter().flat_map(|&c| study.candidates[c].entries.clone());
    let mut always = study.declared_free();
    always.extend(entries.map(|index| study.entries[index].free));
    let found = fewest(fits, judge, (&whole, &candidates), (&always, &with_law.fit), settings);
    if !found.explained || found.best.added.is_empty() {
        return None;
    }
    let added = found.best.added.iter().chain(&with_law.added).copied().collect();
    let best = refitted(fits, &Model::new(added, found.best.fit, f64::NAN));
    judge.explained(fits, &best).then_some(best)
}

/// The engine's search for the fewest candidates that leave noise, changes of declared parameters behind those of the
/// study; `always`: parameters that are fitted with all of them, from `start`.
fn fewest(
    fits: &Fits,
    judge: &Judge,
    (whole, candidates): (&Whole, &[Candidate]),
    (always, start): (&[Free], &Fit),
    settings: &Settings,
) -> select::Selection {
    let study = fits.study;
    let may_join = |c: usize, added: &[usize]| {
        let Some(own) = study.candidates.get(c) else { return true };
        own.is_searched() && own.needs.is_none_or(|needs| added.contains(&needs))
    };
    let sense = |added: &[usize], fit: &Fit| {
        let added = added.iter().copied().filter(|&c| c < study.candidates.len()).collect();
        physical(study, &Model::new(added, fit.clone(), f64::NAN))
    };
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    let every = records.len().div_ceil(SCREENED_RECORDS);
    let search = Search {
        system: whole,
        candidates,
        screened: records.iter().copied().step_by(every).collect(),
        records,
        null: judge.tolerant(),
        rules: Rules { always, may_join: Some(&may_join), sense: Some(&sense) },
    };
    let effort = Effort { max_effects: settings.max_effects, ..EFFORT };
    let declared = search.fit(&[], &[], &start.parameters, &start.locals, ROUNDS);
    let mut found = select(&search, declared, &[], effort, &Vec::new);
    if found.explained {
        special_cases(&search, start, &mut found);
    }
    found
}

/// Puts effects in the place of those that only add freedom to them, where that takes nothing away: a lag for one with
/// a time for each direction.
fn special_cases(search: &Search<Whole>, start: &Fit, found: &mut select::Selection) {
    for k in 0..found.best.added.len() {
        let own = &search.candidates[found.best.added[k]];
        let Some(simple) = search.candidates.iter().position(|other| own.adds_to(other)) else { continue };
        let mut added = found.best.added.clone();
        added[k] = simple;
        for from in &search.candidates[simple].starts {
            let mut p = found.best.fit.parameters.clone();
            own.free.iter().for_each(|free| p[free.index] = start.parameters[free.index]);
            from.values.iter().for_each(|&(index, value)| p[index] = value);
            let model = search.fit(&added, &[], &p, &found.best.fit.locals, ROUNDS);
            let risen = model.fit.chi2 - found.best.fit.chi2;
            if risen < select::MAX_DIFFERENCE_OF_CRITERION && model.worst().is_finite() {
                found.best = model;
                break;
            }
        }
    }
}

/// Declared parameters of which another value may be missing: those that no effect of the list does the same as.
fn changes(study: &Study, whole: &Whole, declared: &Fit, candidates: &[Candidate]) -> Vec<Free> {
    let at = (&declared.parameters[..], &declared.locals[..]);
    let found = influential(study, whole, at, f64::INFINITY);
    if found.is_empty() {
        return Vec::new();
    }
    let singles = Singles::new(study, whole, at, candidates);
    let alone = found.into_iter().filter(|own| singles.same(own).is_none());
    alone.map(|own| Free { prior: None, ..own.free }).collect()
}

/// A model fitted anew with residuals in units of the noise.
pub fn refitted(fits: &Fits, own: &Model) -> Model {
    refitted_beside(fits, own, &[])
}

/// The same beside corrections of the declared parameters up to `most` of their tolerances; none where there are none.
pub fn beside_corrections(fits: &Fits, own: &Model, most: f64) -> Option<Model> {
    let corrections: Vec<Free> =
        tolerance::corrections(fits.study, most).into_iter().map(|own| own.0).collect();
    (!corrections.is_empty()).then(|| refitted_beside(fits, own, &corrections))
}

fn refitted_beside(fits: &Fits, own: &Model, corrections: &[Free]) -> Model {
    let view = fits.view(&own.added, &fits.pieces);
    let whole = Whole::new(&view, noises(fits.study), &|_| ());
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    let mut free = fits.free(&own.added);
    free.extend(changed::corrected(fits.study, &own.fit));
    let corrections = corrections.iter().filter(|own| free.iter().all(|other| other.index != own.index));
    free.extend(corrections.copied().collect::<Vec<_>>());
    let fit = fit(&whole, &records, &own.fit.parameters, &free, &own.fit.locals, ROUNDS);
    let again = search::Model { added: own.added.clone(), fit, left: Vec::new() };
    let again = model(fits, &again);
    Model { held_out: own.held_out, parts: own.parts.clone(), ..again }
}
