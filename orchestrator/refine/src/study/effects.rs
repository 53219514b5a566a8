//! The effects of an answer: those chosen, those that the records cannot distinguish from them, and those that were
//! tried.

use std::sync::Arc;

use super::by_share::ByShare;
use super::catalog::Candidate;
use super::changed;
use super::exact;
use super::fits::{Fits, Model};
use super::law::Law;
use super::model::{Action, Sensor, Study, Tap};
use super::search::Selection;
use crate::answer::{Effect, Parameter, Wiring};
use crate::engine::{System, parallel, stop};
use crate::order::descending;

/// Friction level over the Stribeck peak that adds to it, up to which the peak is what is lacking first.
const MAX_LEVEL_BELOW_PEAK: f64 = 0.1;

/// Factor by which residuals that hang together widen intervals: power of sums over blocks against that of samples.
fn widening(residuals: &[Vec<f64>]) -> f64 {
    let all: f64 = residuals.iter().flatten().map(|r| r * r).sum();
    let power = |length: usize| {
        let blocks = residuals.iter().flat_map(|own| own.chunks_exact(length));
        blocks.map(|block| block.iter().sum::<f64>().powi(2) / length as f64).sum::<f64>() / all
    };
    [1, 8, 64, 256].into_iter().map(power).fold(1.0, f64::max).sqrt()
}

/// Parameters in the terms of the vocabulary.
pub fn physical(study: &Study, c: usize, p: &[f64]) -> Vec<f64> {
    let own = &study.candidates[c];
    let p = &p[own.entries.clone()];
    match own.action {
        Action::Block { law: Law::Spring, .. } => vec![p[0], -p[1] / p[0]],
        Action::Block { law: Law::CaughtOverflow, .. } => {
            vec![p[0], p[1], p[2] / p[0] * share_of_one(study, c)]
        }
        Action::Block { law: Law::Cogging | Law::PeriodicCoulomb, .. } => {
            vec![p[0].hypot(p[1]), p[1].atan2(p[0]), p[2]]
        }
        _ => p.to_vec(),
    }
}

/// Share that a level gets of what another loses, where a port adds as much there as another one takes off here: one
/// unit, or rates that grow with the values by the same slope. Ports of other units (a pump in V, the rate of a level)
/// count by the rates that they give.
fn share_of_one(study: &Study, c: usize) -> f64 {
    let own = &study.candidates[c];
    let (Action::Block { tap, .. }, Some(into)) = (own.action, own.into) else { return 1.0 };
    let [from, to] = [tap, into].map(|tap| &study.taps[tap]);
    let slope = |tap: &Tap| tap.attachment.port.map_or(0.0, |port| port.slope.abs());
    let ratio = slope(to) / slope(from);
    if from.units[0] == to.units[0] || !(ratio > 0.0 && ratio.is_finite()) { 1.0 } else { ratio }
}

/// Improvement of the information criterion over the declared model, but for the price of parameters.
fn score(fits: &Fits, selection: &Selection, model: &Model) -> f64 {
    let samples: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
    samples as f64 * (selection.declared.error / model.error).powi(2).ln()
}

/// An effect of a model; `widen`: factor of the standard deviations that the covariance of its fit gives.
pub(crate) fn effect(fits: &Fits, selection: &Selection, model: &Model, c: usize, widen: f64) -> Effect {
    let study = fits.study;
    let own = &study.candidates[c];
    let score = score(fits, selection, model);
    Effect {
        id: own.full_id(),
        channel: own.channel.to_owned(),
        port: Some(own.port.clone()),
        wiring: wiring(study, model, c),
        signal: own.signal.clone(),
        selected: false,
        group: None,
        score,
        parameters: parameters(study, model, c, widen),
        reason: String::new(),
        stability: None,
        share: None,
        own: match own.action {
            Action::Block { law: Law::Own(index), .. } | Action::Sensor { kind: Sensor::Own(index), .. } => {
                Some(Arc::clone(&study.own[index]))
            }
            _ => None,
        },
    }
}

/// Parameters of an effect of a model in the terms of the vocabulary, with their intervals; `widen` as in [`effect`].
pub(crate) fn parameters(study: &Study, model: &Model, c: usize, widen: f64) -> Vec<Parameter> {
    let own = &study.candidates[c];
    let values = physical(study, c, &model.fit.parameters);
    let names = study.entries[own.entries.clone()].iter();
    let parameters = names.zip(&values).enumerate().map(|(k, (entry, value))| {
        let mut slopes = vec![0.0; model.fit.free.len()];
        for (a, free) in model.fit.free.iter().enumerate() {
            let mut moved = model.fit.parameters.clone();
            moved[free.index] += free.step;
            slopes[a] = (physical(study, c, &moved)[k] - value) / free.step;
        }
        let mut variance = 0.0;
        let matters = |a: &usize| slopes[*a] != 0.0;
        for a in (0..slopes.len()).filter(matters) {
            for b in (0..slopes.len()).filter(matters) {
                variance += slopes[a] * model.fit.covariance[(a, b)] * slopes[b];
            }
        }
        // Not a number where the records do not determine it.
        let half = 1.96 * widen * if variance < 0.0 { 0.0 } else { variance.sqrt() };
        let name = entry.name.rsplit(' ').next().unwrap_or(&entry.name).to_owned();
        Parameter { name, unit: entry.unit.clone(), value: *value, interval: (value - half, value + half) }
    });
    parameters.collect()
}

/// How the block of a candidate is connected, with the friction that a model has at its port.
pub(crate) fn wiring(study: &Study, model: &Model, c: usize) -> Option<Wiring> {
    let name = &study.candidates[c].port;
    let index = match study.candidates[c].action {
        Action::Block { tap, .. } => tap,
        Action::Command { .. } => study.taps.iter().position(|tap| tap.name == *name)?,
        Action::Sensor { .. } => return None,
    };
    let (tap, p) = (&study.taps[index], &model.fit.parameters);
    let coulomb = model.added.iter().map(|&c| &study.candidates[c]);
    let coulomb = coulomb
        .filter(|own| own.action == Action::Block { law: Law::Coulomb, tap: index })
        .map(|own| &p[own.entries.clone()])
        .next();
    let bias = Action::Block { law: Law::Bias, tap: index };
    let declared = tap.coulomb.map_or(0.0, |level| level.of(p));
    let at = tap.attachment.clone();
    Some(Wiring {
        velocity: at.velocity,
        position: at.position,
        load: at.pressure_force,
        pressure: at.pressure,
        vt: coulomb.and_then(|own| own.get(1)).copied().unwrap_or(tap.vt),
        v0: tap.v0,
        // A constant is added to a value whatever it drives.
        sign: if study.candidates[c].action == bias { -1.0 } else { tap.sign },
        level: declared + coulomb.map_or(0.0, |own| own[0]),
        into: study.candidates[c].into.map(|tap| {
            let tap = &study.taps[tap];
            (tap.name.clone(), tap.sign / share_of_one(study, c))
        }),
    })
}

/// Places of effects, first the one whose removal costs most: `gains`; `needs`: the place of the Coulomb friction that
/// an effect acts on, which stands before it.
fn ranked(gains: &[f64], needs: &[Option<usize>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..gains.len()).collect();
    descending(&mut order, |&own| gains[own]);
    for (own, needed) in needs.iter().enumerate() {
        let place = |of: usize, order: &[usize]| order.iter().position(|&k| k == of);
        let Some(needed) = *needed else { continue };
        if let (Some(late), Some(early)) = (place(needed, &order), place(own, &order))
            && late > early
        {
            order.remove(late);
            order.insert(early, needed);
        }
    }
    order
}

/// Effects of the best model in the order in which they are printed: first the one whose removal costs most.
pub fn order(fits: &Fits, selection: &Selection) -> Vec<usize> {
    let best = &selection.best;
    let gains: Vec<f64> =
        (0..best.added.len()).map(|k| selection.stability.get(k).map_or(0.0, |own| own.gain)).collect();
    let needed = |&c: &usize| best.added.iter().position(|&own| fits.study.candidates[c].needs == Some(own));
    let needs: Vec<Option<usize>> = best.added.iter().map(needed).collect();
    let mut order: Vec<usize> = ranked(&gains, &needs).into_iter().map(|k| best.added[k]).collect();
    // A level of next to nothing that another effect needs to act on is not what is lacking first.
    order.sort_by_key(|&c| is_nothing(fits.study, best, c) || is_below_peak(fits.study, best, c));
    order
}

/// Whether an effect is a friction level far below a Stribeck peak that adds to it.
fn is_below_peak(study: &Study, model: &Model, c: usize) -> bool {
    let first = |c: usize| model.fit.parameters[study.candidates[c].entries.start].abs();
    let adds = |own: &Candidate| own.needs == Some(c) && own.may_stand_alone();
    let mut adding = model.added.iter().filter(|&&other| adds(&study.candidates[other]));
    adding.any(|&other| first(c) < MAX_LEVEL_BELOW_PEAK * first(other))
}

/// Whether the first parameter of an effect may as well be zero.
fn is_nothing(study: &Study, model: &Model, c: usize) -> bool {
    let (own, fit) = (study.candidates[c].entries.start, &model.fit);
    let place = fit.free.iter().position(|free| free.index == own);
    place.is_some_and(|a| fit.parameters[own].abs() < 1.96 * fit.covariance[(a, a)].max(0.0).sqrt())
}

/// An effect with intervals that hold those of the same model fitted with residuals as the independent samples that
/// they hold and with declared parameters within their tolerances: without them a value makes up for what they are off.
fn widened(effect: Effect, other: &Effect) -> Effect {
    let wider = |(own, other): (Parameter, &Parameter)| {
        let half = |own: &Parameter| 0.5 * (own.interval.1 - own.interval.0);
        let half = half(&own).max(half(other) + (own.value - other.value).abs());
        Parameter { interval: (own.value - half, own.value + half), ..own }
    };
    let parameters = effect.parameters.into_iter().zip(&other.parameters).map(wider).collect();
    Effect { parameters, ..effect }
}

/// Effects, chosen ones first; `by_share`: what the search for a share of the error found, where it was asked; `most`:
/// tolerances by which a declared parameter may be off.
pub fn effects(
    fits: &Fits,
    selection: &Selection,
    chosen: bool,
    by_share: Option<&ByShare>,
    most: f64,
) -> Vec<Effect> {
    let weighted = by_share.is_some_and(|found| found.weighted);
    let (study, best) = (fits.study, &selection.best);
    let beside = by_share.and_then(|found| found.beside_corrections.clone()).or_else(|| {
        let may_be_off = chosen && selection.exact && !weighted && !stop::asked();
        may_be_off.then(|| exact::beside_corrections(fits, best, most)).flatten()
    });
    let view = fits.view(&best.added, &fits.pieces);
    let residuals =
        parallel::map(fits.pieces.len(), |r| view.residuals(r, &best.fit.parameters, &best.fit.locals[r]));
    let widen = widening(&residuals);
    let widen = |model: &Model| if weighted || selection.exact { 1.0 } else { widen * model.error };
    let percent = |from: f64, to: f64| format!("{:.1} %", 100.0 * (1.0 - to / from));
    let mut found = Vec::new();
    for c in order(fits, selection) {
        let k = best.added.iter().position(|&own| own == c).unwrap_or(0);
        let step = selection.path.iter().position(|(added, _)| added.contains(&c));
        let reason = match step {
            Some(k) if k > 0 => {
                let with = selection.path[k].0.len() - selection.path[k - 1].0.len() > 1;
                format!(
                    "{}lowers the error on what was held out by {}",
                    if with { "together with its partner it " } else { "" },
                    percent(selection.path[k - 1].1, selection.path[k].1)
                )
            }
            _ => "part of the best model on what was held out".to_owned(),
        };
        let rivals = selection.equals.iter().any(|(lacking, _)| *lacking == c);
        let group = (chosen && rivals).then_some(c);
        let stability = selection.stability.get(k).cloned();
        let mut own = effect(fits, selection, best, c, widen(best));
        if let Some(model) = beside.as_ref().filter(|model| model.added.contains(&c)) {
            own = widened(own, &effect(fits, selection, model, c, 1.0));
        }
        found.push(Effect { selected: chosen, group, reason, stability, ..own });
    }
    if chosen {
        let score = score(fits, selection, best);
        let changes = changed::effects(study, best, &selection.changed, score);
        for (free, change) in selection.changed.iter().zip(changes) {
            let own = changed::group(study, free);
            let group = selection.equals.iter().any(|(lacking, _)| *lacking == own).then_some(own);
            found.push(Effect { selected: true, group, ..change });
        }
    }
    for (lacking, model) in &selection.equals {
        for &c in model.added.iter().filter(|c| !best.added.contains(c)) {
            let reason = "these records cannot tell it from the selected effect".to_owned();
            let group = chosen.then_some(*lacking);
            found.push(Effect { group, reason, ..effect(fits, selection, model, c, widen(model)) });
        }
        // Corrections within tolerances are no effects.
        let mut other = if selection.exact { changed::corrected(study, &model.fit) } else { Vec::new() };
        other.retain(|free| {
            let is_stated = selection.changed.iter().any(|own| own.index == free.index);
            free.prior.is_none() && !is_stated
        });
        for change in changed::effects(study, model, &other, 0.0) {
            let reason = "these records cannot tell it from the selected effect".to_owned();
            found.push(Effect { group: chosen.then_some(*lacking), reason, ..change });
        }
    }
    for (c, own) in &selection.refused {
        let stability = Some(own.clone());
        let reason = format!(
            "left out: it lowers the error on {} of {} parts of the estimation records only, or its sign changes between them",
            own.better, own.parts
        );
        let alone = selection.singles.iter().find(|model| model.added == [*c]);
        found.extend(alone.map(|model| Effect {
            stability,
            reason,
            ..effect(fits, selection, model, *c, widen(model))
        }));
    }
    for model in &selection.singles {
        let c = model.added[0];
        let own = &fits.study.candidates[c];
        let same = |e: &Effect| own.is(e);
        let gains = model.error < 0.999 * selection.declared.error;
        if gains && !found.iter().any(same) {
            let held = if model.held_out.is_nan() {
                String::new()
            } else {
                format!(", by {} on what was held out", percent(selection.declared.held_out, model.held_out))
            };
            let reason = format!(
                "alone it lowers the estimation error by {}{held}",
                percent(selection.declared.error, model.error)
            );
            let one = Effect { reason, ..effect(fits, selection, model, c, widen(model)) };
            // A spring without stiffness has no rest position: it was fitted as something else.
            let known = |p: &Parameter| [p.value, p.interval.0, p.interval.1].iter().all(|v| v.is_finite());
            if one.parameters.iter().all(known) {
                found.push(one);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_stand_in_the_order_of_what_they_are_worth_behind_the_friction_that_they_act_on() {
        assert_eq!(ranked(&[0.2, 0.5, 0.1], &[None; 3]), [1, 0, 2]);
        assert_eq!(ranked(&[0.2, 0.5, 0.3], &[None, Some(0), None]), [0, 1, 2]);
        // Equal ones stay in the order in which they were found.
        assert_eq!(ranked(&[0.3, 0.3], &[None; 2]), [0, 1]);
        assert_eq!(ranked(&[], &[]), Vec::<usize>::new());
    }
}
