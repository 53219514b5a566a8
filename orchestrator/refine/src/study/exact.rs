//! The smallest set of effects with which a study leaves nothing but what its sensors give: the engine's search, with
//! residuals in units of the noise.

use super::beside::SCREENED_RECORDS;
use super::explain::{Judge, noises};
use super::fits::{Fits, Model};
use super::physical::physical;
use super::search::{Say, Selection, stability};
use super::whole::{Whole, candidate, model};
use crate::answer::Settings;
use crate::engine::candidate::Candidate;
use crate::engine::fit::{Fit, fit};
use crate::engine::search::{self, Rules, Search};
use crate::engine::select::{Effort, select};

/// Rounds of a fit of everything.
const ROUNDS: usize = 14;

/// Searches from the fitted declared model; none where nothing explains the records to the noise, or where the declared model
/// does.
pub fn search(
    fits: &Fits,
    judge: &Judge,
    declared: &Model,
    settings: &Settings,
    say: Say,
) -> Option<Selection> {
    let study = fits.study;
    if judge.explained(fits, declared) {
        return None;
    }
    let view = fits.view(&[], &fits.pieces);
    let whole = Whole::new(&view, noises(study), say);
    let candidates: Vec<Candidate> = (0..study.candidates.len()).map(|c| candidate(study, c)).collect();
    let always = study.declared_free();
    let may_join = |c: usize, added: &[usize]| {
        let own = &study.candidates[c];
        !own.probe && own.needs.is_none_or(|needs| added.contains(&needs))
    };
    let sense =
        |added: &[usize], fit: &Fit| physical(study, &Model::new(added.to_vec(), fit.clone(), f64::NAN));
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    let every = records.len().div_ceil(SCREENED_RECORDS);
    let search = Search {
        system: &whole,
        candidates: &candidates,
        screened: records.iter().copied().step_by(every).collect(),
        records,
        null: judge.tolerant(),
        rules: Rules { always: &always, may_join: Some(&may_join), sense: Some(&sense) },
    };
    // Fewer models than for the rig: a simulation over FMUs costs more.
    let effort = Effort { max_effects: settings.max_effects, singles: 10, climbed: 2, pairs: (3, 3) };
    let start = search.fit(&[], &[], &declared.fit.parameters, &declared.fit.locals, ROUNDS);
    let found = select(&search, start, &[], effort, &Vec::new);
    let mut best = model(fits, &found.best);
    if !found.explained || best.added.is_empty() || !judge.explained(fits, &best) {
        return None;
    }
    let replaced = |own: &search::Model| {
        let lacking = best.added.iter().copied().find(|c| !own.added.contains(c))?;
        Some((lacking, model(fits, own)))
    };
    let equals = found.equals.iter().filter_map(replaced).collect();
    let singles = found.tried.iter().filter(|own| own.added.len() == 1);
    let mut singles: Vec<Model> = singles.map(|own| model(fits, own)).collect();
    singles.sort_by(|a, b| a.error.total_cmp(&b.error));
    singles.dedup_by(|a, b| a.added == b.added);
    let mut declared = declared.clone();
    say("stability over parts of the records");
    fits.hold_out(&mut declared);
    let stability = stability(fits, Some(&declared), &mut best);
    let path = vec![(Vec::new(), declared.held_out), (best.added.clone(), best.held_out)];
    Some(Selection { declared, best, equals, singles, path, stability, refused: Vec::new(), exact: true })
}

/// A model fitted anew with residuals in units of the noise.
pub fn refitted(fits: &Fits, own: &Model) -> Model {
    let view = fits.view(&own.added, &fits.pieces);
    let whole = Whole::new(&view, noises(fits.study), &|_| ());
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    let free = fits.free(&own.added);
    let fit = fit(&whole, &records, &own.fit.parameters, &free, &own.fit.locals, ROUNDS);
    let again = search::Model { added: own.added.clone(), fit, left: Vec::new() };
    let again = model(fits, &again);
    Model { held_out: own.held_out, parts: own.parts.clone(), ..again }
}
