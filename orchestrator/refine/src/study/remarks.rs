//! Sentences of a report on declared parameters, records and what is left.

use super::declaration::Role;
use super::errors::errors;
use super::explain::{Judge, Rest};
use super::fits::{Fits, Model};
use super::search::Selection;
use super::simulate::Piece;
use crate::share::percent;

/// Sentence on a residual that has no place.
pub(super) const DEPENDS_ON_NOTHING: &str = "What is left on estimation records depends on none of the variables known at the attachments: memory, other places, or noise that is not white.";

/// Sentences on the share of noise in the residual on the estimation records.
pub(super) fn noise(judge: &Judge, model: &Model) -> Vec<String> {
    let share = percent(judge.power.sqrt() / model.error);
    let mut found = vec![format!(
        "Noise and rounding of the sensors, carried through filters, initial states and inputs, give {share} of the error on estimation records (simulated {} times).",
        judge.draws()
    )];
    if judge.tolerated > 1.5 * judge.power {
        let share = (judge.tolerated - judge.power).sqrt() / model.error;
        found.push(format!(
            "Smoothing of measured derivatives gives up to {share:.2} of the error on estimation records: where the motion is sharper than the filter, the model is not to blame."
        ));
    }
    found
}

/// Sentences on the residual on the estimation records: on what it depends.
pub(super) fn leftover(fits: &Fits, judge: &Judge, model: &Model, rest: &Rest) -> Vec<String> {
    let mut found = Vec::new();
    if let Some((place, variables)) = &rest.place {
        let at = place.split_once('@').map_or(place.as_str(), |(_, port)| port);
        let (share, over) = (rest.gain / model.error.powi(2), variables.join(" and "));
        // By derivatives around the model, which far from it promise more than there is.
        found.push(if share < 1.0 {
            format!(
                "A free form over {over} at {at} would take away {:.0} % of the power that is left on estimation records.",
                100.0 * share
            )
        } else {
            format!("What is left on estimation records depends on {over} at {at}.")
        });
    } else if !judge.explained(fits, model) {
        found.push(DEPENDS_ON_NOTHING.into());
    }
    found
}

/// Sentences on declared parameters, and on other records; `printed`: parameter vectors without and with the answer.
pub(super) fn remarks(
    fits: &Fits,
    selection: &Selection,
    after: &Model,
    printed: [&[f64]; 2],
) -> Vec<String> {
    let study = fits.study;
    let before = &selection.declared;
    let chosen = !after.added.is_empty();
    let mut found = Vec::new();
    for (index, entry) in study.entries[..study.declared].iter().enumerate() {
        let [was, is] = printed.map(|p| p[index]);
        let unit = if entry.unit == "1" { String::new() } else { format!(" {}", entry.unit) };
        found.push(if chosen {
            format!(
                "Declared model, fitted: {} = {was:.6e}{unit} before, {is:.6e}{unit} with the effects.",
                entry.name
            )
        } else {
            format!("Declared model, fitted: {} = {was:.6e}{unit}.", entry.name)
        });
    }
    let idle = |model: &&Model| model.error >= 0.999 * before.error;
    let idle: Vec<String> =
        selection.singles.iter().filter(idle).map(|model| study.candidates[model.added[0]].name()).collect();
    if !idle.is_empty() {
        found.push(format!(
            "A first fit of these beside the declared model, near its parameters, gains nothing: {}.",
            idle.join(", ")
        ));
    }
    for (record, own) in study.records.iter().enumerate() {
        if own.role == Role::Estimation {
            continue;
        }
        let piece = [Piece { record, range: 0..own.n }];
        let error = |model: &Model, p: &[f64]| errors(fits, &model.added, &piece, p, None);
        let (was, is) = (error(before, printed[0]), error(after, printed[1]));
        for (signal, rms) in &was.rms {
            let after = is.rms.get(signal).copied().unwrap_or(f64::NAN);
            found.push(format!(
                "{} ({}): {signal} rms {rms:.4e} before, {after:.4e} after.",
                own.name,
                own.role.word()
            ));
        }
    }
    found
}
