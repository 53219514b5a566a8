//! Effects with corrections of declared parameters: whether they stand in place of the effects that a search without
//! corrections found.

use super::by_share::{self, ByShare};
use super::fits::{Fits, Model};
use super::search::Selection;
use super::tolerance;
use crate::engine::fit::Free;
use crate::engine::stop;

/// Error of effects beside corrections over that of the effects alone from which on their fit is made again.
const MAX_ERROR_BESIDE_CORRECTIONS: f64 = 1.05;
/// The same ratio below which corrections within one tolerance belong to the answer where something is left beside
/// them: what they explain is not missing.
const MAX_ERROR_OF_NEEDED_CORRECTIONS: f64 = 0.8;

/// The search for a share of the error beside corrections of declared parameters, where effects alone do not reach the
/// noise, or several of them do or one for which corrections do as well: they may stand for parameters that are
/// slightly off.
pub fn search(search: &by_share::Search, exact: Selection) -> (Selection, Option<ByShare>) {
    let by_share::Search { fits, judge, settings, .. } = *search;
    let explained = judge.explained(fits, &exact.best);
    let may_be_corrections = || match exact.best.added.len() {
        0 => false,
        1 => corrections_explain(search, &exact.declared),
        _ => true,
    };
    if explained && (!exact.changed.is_empty() || !may_be_corrections()) || stop::asked() {
        return (exact, None);
    }
    let mut found = search.run(&exact);
    let mut exact = exact;
    let has_same_effects = found.is_without_corrections(&exact);
    if has_same_effects && !exact.exact {
        // The fit without them goes on until nothing moves.
        exact.best = fits.polish(&exact.best).unwrap_or(exact.best);
    }
    let are_needed = || {
        found.selection.best.error < MAX_ERROR_OF_NEEDED_CORRECTIONS * exact.best.error
            || judge.explained(fits, &found.selection.best)
    };
    if has_same_effects && (explained || !are_needed()) {
        // Corrections make nothing worse: where they seem to, their fit ended short of its optimum.
        let fell_short = found.selection.best.error > MAX_ERROR_BESIDE_CORRECTIONS * exact.best.error;
        let again = fell_short.then(|| search.refitted(&found, &exact.best.fit.parameters));
        // The search beside corrections looks at more rivals.
        for own in &found.selection.equals {
            let known = |other: &(usize, Model)| {
                other.0 == own.0 && other.1.added.iter().all(|c| own.1.added.contains(c))
            };
            if !exact.equals.iter().any(known) {
                exact.equals.push(own.clone());
            }
        }
        found.beside_corrections = Some(again.unwrap_or(found.selection.best));
        (found.selection, found.corrections, found.weighted) = (exact.clone(), Vec::new(), false);
        return (exact, Some(found));
    }
    // A parameter that is off by as much as a correction may be is an effect.
    let reach = 0.98 * settings.forward_selection.max_tolerances;
    let known = found.corrections.iter().all(|own| own.moved.abs() < reach * own.tolerance);
    let fewer = found.selection.effects() < exact.effects();
    let simpler = known && fewer && are_likelier(fits, &found, &exact);
    if explained && !(simpler && judge.explained(fits, &found.selection.best)) {
        return (exact, None);
    }
    (found.selection.clone(), Some(found))
}

/// Whether corrections of declared parameters within their tolerances leave the noise of the sensors without an effect.
fn corrections_explain(search: &by_share::Search, declared: &Model) -> bool {
    let (study, most) = (search.fits.study, search.settings.forward_selection.max_tolerances);
    let corrections: Vec<Free> = tolerance::corrections(study, most).into_iter().map(|own| own.0).collect();
    if corrections.is_empty() {
        return false;
    }
    let fits = Fits { corrections, ..Fits::new(study, search.fits.scale.clone()) };
    let own = &declared.fit;
    let corrected = fits.fit_from(Vec::new(), &own.parameters, &own.locals);
    corrected.is_some_and(|corrected| search.judge.explained(&fits, &corrected))
}

/// Whether the corrections beside some effects are likelier than the further effects of a selection that needs none.
fn are_likelier(fits: &Fits, found: &ByShare, exact: &Selection) -> bool {
    let parameters = |own: &Selection| -> usize {
        let of_effects = own.best.added.iter().map(|&c| fits.study.candidates[c].entries.len());
        of_effects.sum::<usize>() + own.changed.len()
    };
    let more = parameters(exact).saturating_sub(parameters(&found.selection)).max(1);
    let known = found.corrections.iter().filter(|own| own.tolerance > 0.0);
    let moved: Vec<f64> = known.map(|own| own.moved / own.tolerance).collect();
    are_cheaper(&moved, more, fits.count(&fits.pieces))
}

/// Whether parameters that are off, each by so many tolerances, cost less than so many `more` parameters of effects:
/// their sum of squares against the price of these in the Bayesian information criterion. Several that are all off by
/// two tolerances stand for one effect that does what they do together.
fn are_cheaper(moved: &[f64], more: usize, samples: usize) -> bool {
    let surprise: f64 = moved.iter().map(|own| own * own).sum();
    surprise <= more as f64 * (samples.max(2) as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_parameters_off_by_two_tolerances_cost_more_than_one_effect() {
        // ln(30 000) = 10.3.
        assert!(are_cheaper(&[1.0; 10], 1, 30_000));
        assert!(!are_cheaper(&[2.1; 6], 1, 30_000));
        assert!(are_cheaper(&[2.1; 6], 3, 30_000));
    }
}
