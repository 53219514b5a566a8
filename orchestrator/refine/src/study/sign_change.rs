//! Velocity over which friction changes its sign where no attachment declares it.
//!
//! Friction of other shapes takes it from Coulomb friction that is fitted beside it. If the declared model has all of
//! the level, that friction does nothing: the velocity is the attachment's then, or it is fitted beside friction that
//! stands without it.

use super::by_share::{self, ByShare};
use super::exact;
use super::explain::Judge;
use super::fits::{Fits, Model};
use super::law::Law;
use super::model::{Action, Study};
use super::search::{Say, Selection};
use crate::answer::Settings;

/// Ratio of the error without it to that with it, up to which nothing is lost.
const MAX_ERROR_RATIO: f64 = 1.002;

/// Where to look for the velocity of the sign change, as ratios to that of the attachment.
const STARTS: [f64; 3] = [1.0, 0.4, 2.5];

/// The selection without such friction; as it is where that explains less.
pub fn settle(study: &mut Study, scale: &[f64], judge: &Judge, selection: Selection) -> Selection {
    let Some((c, tap, vt)) = beside(study, &selection.best) else { return selection };
    let before = std::mem::replace(&mut study.taps[tap].vt, vt);
    let fits = Fits::new(study, scale.to_vec());
    let own = &selection.best;
    let added: Vec<usize> = own.added.iter().copied().filter(|&other| other != c).collect();
    let mut p = own.fit.parameters.clone();
    study.candidates[c].entries.clone().for_each(|index| p[index] = 0.0);
    let fitted = fits.fit_from(added, &p, &own.fit.locals);
    let fitted = fitted.map(|model| if selection.exact { exact::refitted(&fits, &model) } else { model });
    let stands = |model: &Model| match selection.exact {
        true => judge.explained(&fits, model),
        false => model.error <= MAX_ERROR_RATIO * own.error,
    };
    match fitted.filter(stands) {
        Some(best) => {
            let best = Model { held_out: own.held_out, parts: own.parts.clone(), ..best };
            Selection { best, ..selection }
        }
        None => {
            study.taps[tap].vt = before;
            selection
        }
    }
}

/// Effects found for their share of the error with the velocity over which friction changes its sign that fits them
/// best: where friction of the list stands without the Coulomb friction that would have it, and where a fit from other
/// velocities leaves less; none where nothing changes.
pub fn fitted(
    study: &mut Study,
    scale: &[f64],
    judge: &Judge,
    (settings, say): (&Settings, Say),
    found: &ByShare,
) -> Option<ByShare> {
    let mut better: Option<ByShare> = None;
    for (coulomb, tap) in alone(study, &found.added) {
        let own = better.as_ref().unwrap_or(found);
        let (entry, usual) = (study.candidates[coulomb].entries.start + 1, study.taps[tap].vt);
        let values = STARTS.map(|ratio| ratio * usual);
        let fits = Fits::new(study, scale.to_vec());
        let search = by_share::Search { fits: &fits, judge, units: scale, settings, say };
        let free = study.entries[entry].free;
        let Some(mut p) = search.fitted_from(own, (entry, &values), Some(free)) else { continue };
        study.taps[tap].vt = std::mem::take(&mut p[entry]);
        let fits = Fits::new(study, scale.to_vec());
        let search = by_share::Search { fits: &fits, judge, units: scale, settings, say };
        let again = search.fitted(own, &own.added, &p);
        if again.selection.best.error < own.selection.best.error {
            better = Some(again);
        } else {
            study.taps[tap].vt = usual;
        }
    }
    let own = better.as_ref().unwrap_or(found);
    if let Some((coulomb, _, vt)) = beside(study, &own.selection.best) {
        let entry = study.candidates[coulomb].entries.start + 1;
        let fits = Fits::new(study, scale.to_vec());
        let search = by_share::Search { fits: &fits, judge, units: scale, settings, say };
        let values = STARTS.map(|ratio| ratio * vt);
        let again = search.fitted_from(own, (entry, &values), None);
        let again = again.map(|p| search.fitted(own, &own.added, &p));
        better = again.filter(|again| again.selection.best.error < own.selection.best.error).or(better);
    }
    better
}

/// Sentences on the velocities of sign changes that were fitted with friction that stands without Coulomb friction.
pub fn notes(study: &Study, added: &[usize]) -> Vec<String> {
    let one = |(_, tap): (usize, usize)| {
        let own = &study.taps[tap];
        format!(
            "Friction at {} changes its sign over {:.4} {}, as fits best.",
            own.name, own.vt, own.units[1]
        )
    };
    alone(study, added).into_iter().map(one).collect()
}

/// Coulomb friction that friction of a model acts on, and that is not in it, with its port.
fn alone(study: &Study, added: &[usize]) -> Vec<(usize, usize)> {
    let needed = added.iter().filter_map(|&c| study.candidates.get(c)?.needs);
    let mut found = Vec::new();
    for coulomb in needed.filter(|coulomb| !added.contains(coulomb)) {
        let own = &study.candidates[coulomb];
        if let Action::Block { tap, .. } = own.action
            && own.entries.len() == 2
            && !found.contains(&(coulomb, tap))
        {
            found.push((coulomb, tap));
        }
    }
    found
}

/// Coulomb friction that is fitted with the velocity of its sign change and that other friction needs: its place, its
/// port, and that velocity.
fn beside(study: &Study, model: &Model) -> Option<(usize, usize, f64)> {
    model.added.iter().find_map(|&c| {
        let own = &study.candidates[c];
        let Action::Block { law: Law::Coulomb, tap } = own.action else { return None };
        let is_needed = model.added.iter().any(|&other| study.candidates[other].needs == Some(c));
        let fitted = own.entries.len() == 2 && is_needed;
        fitted.then(|| (c, tap, model.fit.parameters[own.entries.start + 1]))
    })
}
