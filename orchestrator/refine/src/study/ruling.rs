//! The verdict on what was found, and the shares of the error on validation records that it stands on.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use super::by_share::ByShare;
use super::declaration::Role;
use super::effects::order;
use super::errors::errors;
use super::explain::{Judge, Rest, depends};
use super::fits::{Fits, pieces};
use super::model::Study;
use super::search::Selection;
use crate::answer::{Errors, Verdict};
use crate::engine::settings::ForwardSelection;

/// Error in rms of the noise from which on something is missing even if the residual depends on nothing that is known:
/// the noise may be colored, which its scatter from sample to sample does not show.
const MIN_ERROR_OVER_NOISE: f64 = 3.0;

/// Ratio of the errors on validation records below which effects are no imitation of something else.
const MAX_ERROR_RATIO_OF_EFFECTS: f64 = 0.5;

/// Multiples of the floor on validation records up to which nothing may be missing.
const MAX_FLOORS: f64 = 3.0;
/// Share of the error on validation records below which effects are withdrawn.
const MIN_VALIDATED_SHARE: f64 = 0.05;

/// A verdict, the residual that goes with it, and whether the effects lower the error on validation records.
pub(super) struct Ruling {
    pub(super) verdict: Verdict,
    pub(super) rest: Rest,
    pub(super) helps: bool,
}

/// Share of a floor's power by which that of an error may be off it without being more or less: the level of the noise
/// is estimated.
const MAX_SHARE_OF_FLOOR: f64 = 0.1;

/// Share of the error on validation records above its floor that a model takes away; outputs in units of the declared
/// model's error.
pub(crate) fn share(
    study: &Study,
    [before, after]: [&Errors; 2],
    floors: &[BTreeMap<String, f64>; 2],
) -> f64 {
    let total = |errors: &Errors, floor: &BTreeMap<String, f64>| -> f64 {
        let one = |o: &super::model::Output| {
            let [own, unit] = [errors, before].map(|e| e.counted(&o.name, o.noise));
            let carried = floor.get(&o.name).filter(|_| !errors.white.contains_key(&o.name));
            let floor = carried.copied().unwrap_or(o.noise);
            let above = own * own - floor * floor;
            let is_more = unit > 0.0 && above.abs() > MAX_SHARE_OF_FLOOR * floor * floor;
            if is_more { above / (unit * unit) } else { 0.0 }
        };
        study.outputs.iter().map(one).sum::<f64>().max(0.0)
    };
    let (declared, best) = (total(before, &floors[0]), total(after, &floors[1]));
    if declared > 0.0 { 1.0 - (best / declared).sqrt() } else { 0.0 }
}

/// Shares of the error on validation records that each effect of the answer, and then each changed parameter, takes
/// away without the others and without corrections, in the order in which they are printed. `printed`: parameter
/// vectors of the declared model and of the answer.
pub(super) fn alone(
    fits: &Fits,
    selection: &Selection,
    printed: [&[f64]; 2],
    (before, floor): (&Errors, &BTreeMap<String, f64>),
) -> Vec<f64> {
    let study = fits.study;
    let validation = pieces(study, Role::Validation);
    let [declared, best] = printed;
    let one = |added: &[usize], changed: Option<usize>| {
        let mut p = declared.to_vec();
        let entries = added.iter().flat_map(|&c| study.candidates[c].entries.clone()).chain(changed);
        entries.chain(0..study.declared).for_each(|index| p[index] = best[index]);
        let after = errors(fits, added, &validation, &p, None);
        share(study, [before, &after], &[floor.clone(), floor.clone()])
    };
    let with_its_need = |c: usize| {
        let needs = study.candidates[c].needs.filter(|needs| selection.best.added.contains(needs));
        [c].into_iter().chain(needs).collect::<Vec<usize>>()
    };
    let effects = order(fits, selection).into_iter().map(|c| one(&with_its_need(c), None));
    effects.chain(selection.changed.iter().map(|free| one(&[], Some(free.index)))).collect()
}

/// The verdict on effects that were chosen for their share of the error.
pub(super) fn rule_by_share(
    fits: &Fits,
    judge: &Judge,
    found: &ByShare,
    share: f64,
    rules: &ForwardSelection,
) -> Ruling {
    let best = &found.selection.best;
    let helps = found.selection.effects() > 0 && share >= rules.min_validated_share;
    if let Some((channel, variables, _)) = found.free_form.clone() {
        let gain = best.error.powi(2);
        let port = channel.split_once('@').map_or(channel.as_str(), |(_, port)| port).to_owned();
        let rest = Rest { place: Some((channel, variables)), gain, ports: vec![(port, gain)] };
        return Ruling { verdict: Verdict::Unexplained, rest, helps };
    }
    if helps {
        let known = judge.explained(fits, best) || judge.tolerable(fits, best);
        let rest = if known { Rest::nothing() } else { judge.rest(fits, best) };
        return Ruling { verdict: Verdict::Effect, rest, helps };
    }
    let corrected = &found.corrected;
    if judge.explained(fits, corrected) || judge.tolerable(fits, corrected) {
        return Ruling { verdict: Verdict::Nothing, rest: Rest::nothing(), helps };
    }
    let rest = judge.rest(fits, corrected);
    Ruling { verdict: Verdict::Unexplained, rest, helps }
}

/// The verdict on effects that were chosen because they leave noise, or nearly; errors on validation records of the
/// declared model and of the best one, floor of the declared one.
pub(super) fn rule(
    fits: &Fits,
    judge: &Judge,
    selection: &Selection,
    validation: [&Errors; 2],
    floor: &BTreeMap<String, f64>,
    share: f64,
) -> Ruling {
    let (declared, best) = (&selection.declared, &selection.best);
    let total = |errors: &Errors| -> f64 {
        let share =
            |(o, scale): (&super::model::Output, &f64)| (errors.counted(&o.name, o.noise) / scale).powi(2);
        fits.study.outputs.iter().zip(&fits.scale).map(share).sum()
    };
    let helps = selection.effects() > 0
        && total(validation[1]) < total(validation[0])
        && share >= MIN_VALIDATED_SHARE;
    let beyond = |o: &super::model::Output| {
        let floor = floor.get(&o.name).copied().unwrap_or(o.noise);
        validation[0].times(&o.name, Some(floor)).is_some_and(|times| times > MAX_FLOORS)
    };
    let beyond = fits.study.outputs.iter().any(beyond);
    let rest_of_declared = OnceCell::new();
    let of_declared = || rest_of_declared.get_or_init(|| judge.rest(fits, declared));
    if judge.explained(fits, declared) {
        return Ruling { verdict: Verdict::Nothing, rest: Rest::nothing(), helps };
    }
    if helps {
        let known = judge.explained(fits, best) || judge.tolerable(fits, best);
        let rest = if known { Rest::nothing() } else { judge.rest(fits, best) };
        // A free form that takes away more than the effects did is what is missing; they only imitate it.
        let gained = declared.error.powi(2) - best.error.powi(2);
        let imitates = || {
            // What halves the error on records that it has not seen is more than an imitation.
            if total(validation[1]) < MAX_ERROR_RATIO_OF_EFFECTS.powi(2) * total(validation[0]) {
                return false;
            }
            let whole = of_declared();
            let other = |(_, variables): &(String, Vec<String>)| {
                variables.first().is_some_and(|first| {
                    best.added.iter().all(|&c| depends(fits.study, c).iter().all(|own| own != first))
                })
            };
            whole.gain > gained && whole.place.as_ref().is_some_and(other)
        };
        if rest.place.is_none() || rest.gain < gained && !imitates() {
            return Ruling { verdict: Verdict::Effect, rest, helps };
        }
    }
    if judge.tolerable(fits, declared) && !beyond {
        return Ruling { verdict: Verdict::Nothing, rest: Rest::nothing(), helps };
    }
    let rest = of_declared().clone();
    let far = declared.error > MIN_ERROR_OVER_NOISE * judge.tolerated.sqrt();
    let verdict = if rest.place.is_some() || far || beyond { Verdict::Unexplained } else { Verdict::Nothing };
    Ruling { verdict, rest, helps }
}
