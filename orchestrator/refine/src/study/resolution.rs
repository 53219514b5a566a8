//! Resolution of sensors: whether a prediction in the steps that a column shows is nearer to it than the smooth one.
//!
//! The step is read off the column, so nothing is fitted. It is asked for when all other effects are known: rounding
//! says something only of a prediction that lies within a step of the measurement. A resolution that is fine against
//! what the records show is part of the sensor's noise.

use super::catalog::{Candidate, entries};
use super::declaration::Role;
use super::effects::effect;
use super::errors::{errors, initial};
use super::fits::{Fits, Model, pieces};
use super::model::{Action, Sensor, Study};
use super::search::Selection;
use crate::answer::{Answer, Effect, Errors, Verdict};

/// Steps within the range of a column from which on its resolution is part of the noise.
const MAX_STEPS_OF_A_RANGE: f64 = 100.0;
/// Steps within the range of a column that a resolution needs.
const MIN_STEPS_OF_A_RANGE: f64 = 3.0;
/// Rms distance of the values from multiples of the step, in steps, up to which they are such.
const MAX_DISTANCE: f64 = 0.05;
/// Ratio of the powers of the errors with rounding and without up to which a sensor rounds.
const MAX_POWER_WITH_ROUNDING: f64 = 0.5;
/// Half the interval of a step relative to it, at least: files round their numbers, and none has more digits.
const MIN_RELATIVE_HALF_WIDTH: f64 = 1e-6;

/// Step of an output and half the width of its 95 % interval, in the unit of the output; none where its column shows
/// no multiples of a step from zero that are coarse enough, or the study states its noise, which contains the rounding.
fn step(study: &Study, output: usize) -> Option<(f64, f64)> {
    let own = &study.outputs[output];
    let column = study.sensors.of(&own.name);
    if own.noise_is_stated || column.quantum <= 0.0 {
        return None;
    }
    let step = column.quantum * own.noise / column.rms();
    let mut values = Vec::new();
    for record in study.records.iter().filter(|record| record.role == Role::Estimation) {
        let there = |k: usize| record.measured[output].as_ref().is_none_or(|measured| measured[k]);
        values.extend((0..record.n).filter(|&k| there(k)).map(|k| record.outputs[output][k]));
    }
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.iter().fold(ends, |(low, high), v| (low.min(*v), high.max(*v)));
    if !(MIN_STEPS_OF_A_RANGE..=MAX_STEPS_OF_A_RANGE).contains(&((high - low) / step)) {
        return None;
    }
    let counts: Vec<f64> = values.iter().map(|value| (value / step).round()).collect();
    let square: f64 = counts.iter().map(|count| count * count).sum();
    let step = values.iter().zip(&counts).map(|(value, count)| value * count).sum::<f64>() / square;
    let apart = values.iter().zip(&counts).map(|(value, count)| (value - count * step).powi(2)).sum::<f64>();
    let apart = (apart / values.len() as f64).sqrt();
    let half = (1.96 * apart / square.sqrt()).max(MIN_RELATIVE_HALF_WIDTH * step);
    (apart < MAX_DISTANCE * step).then_some((step, half))
}

/// Adds the resolution of the sensor of an output to the candidates, where its column shows one: the step to start
/// from, and its 95 % interval as bounds.
pub fn fill(study: &mut Study, output: usize) {
    let Some((step, half)) = self::step(study, output) else { return };
    let (name, unit) = (study.outputs[output].name.clone(), study.outputs[output].unit.clone());
    let id = "sensor.quantization";
    let entries = entries(study, id, &[("step", unit)], |_| (step - half, step + half));
    study.candidates.push(Candidate {
        id: id.to_owned(),
        channel: "sensor",
        port: study.outputs[output].port.clone(),
        twin: false,
        signal: Some(name),
        action: Action::Sensor { kind: Sensor::Quantization, output },
        entries,
        starts: vec![vec![step]],
        complexity: 1,
        probe: false,
        into: None,
        needs: None,
    });
}

/// Adds the resolutions of the sensors to a finished answer, behind the effects of `shown`, the model of the answer.
pub fn add(fits: &Fits, selection: &Selection, shown: &Model, found: &mut Answer) {
    if !matches!(found.verdict, Verdict::Nothing | Verdict::Effect) {
        return;
    }
    let study = fits.study;
    let own = fits.as_declared(shown);
    let roles = [Role::Estimation, Role::Validation].map(|role| pieces(study, role));
    let locals = [own.locals.clone(), initial(fits, &shown.added, &roles[1], &own.parameters)];
    let of = |added: &[usize], p: &[f64]| -> [Errors; 2] {
        std::array::from_fn(|k| errors(fits, added, &roles[k], p, Some(&locals[k])))
    };
    let before = of(&shown.added, &own.parameters);
    for c in (0..study.candidates.len()).filter(|&c| study.candidates[c].is_resolution()) {
        let Action::Sensor { output, .. } = study.candidates[c].action else { continue };
        let name = &study.outputs[output].name;
        let entry = study.candidates[c].entries.start;
        let (step, interval) = (study.candidates[c].starts[0][0], study.entries[entry].free.bounds);
        let mut model = shown.clone();
        model.added.push(c);
        model.fit.parameters[entry] = step;
        let mut p = own.parameters.clone();
        p[entry] = step;
        let after = of(&model.added, &p);
        let ratio = |k: usize| after[k].rms[name] / before[k].rms[name];
        if !(0..2).all(|k| ratio(k).powi(2) < MAX_POWER_WITH_ROUNDING) {
            continue;
        }
        let mut effect = effect(fits, selection, &model, c, 0.0);
        effect.parameters[0].interval = interval;
        effect.selected = true;
        effect.share = Some(1.0 - ratio(1));
        effect.reason = format!(
            "the column moves in steps; rounded to them the prediction is nearer to it by {:.0} % on validation records",
            100.0 * (1.0 - ratio(1))
        );
        insert(found, effect);
        for (own, after) in found.after.iter_mut().zip(&after) {
            own.rms.insert(name.clone(), after.rms[name]);
            own.nrmse.insert(name.clone(), after.nrmse[name]);
            own.white.extend(after.white.get(name).map(|white| (name.clone(), *white)));
        }
        found.parameters[1][entry] = step;
        if found.verdict == Verdict::Nothing {
            (found.verdict, found.share) = (Verdict::Effect, Some(1.0 - ratio(1)));
        }
    }
}

/// Puts an effect behind the selected ones.
fn insert(found: &mut Answer, effect: Effect) {
    let behind = found.effects.iter().rposition(|own| own.selected).map_or(0, |last| last + 1);
    found.effects.insert(behind, effect);
}
