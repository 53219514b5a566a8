//! Sensor noise that is not white: a residual that is alike over a few samples and depends on nothing.
//!
//! The noise of a sensor is judged by its scatter from one sample to the next, as white noise. Filters in a sensor or
//! its amplifier make it correlated, and what a true model leaves then looks like an error of the model.

use std::collections::BTreeMap;

use airloop_ident::diagnostics::residuals::{
    Residuals, autocorrelation, cross_correlation, innovations, prediction,
};
use airloop_ident::record::Record as Signals;
use nalgebra::{Cholesky, DMatrix, DVector};

use super::declaration::Role;
use super::errors::initial;
use super::explain::{self, Judge};
use super::fits::{Fits, Model, pieces};
use super::model::Study;
use super::remarks::DEPENDS_ON_NOTHING;
use super::ruling::share;
use super::simulate::View;
use crate::answer::{Answer, Verdict};
use crate::engine::goodness::{BLOCKS, powers};
use crate::engine::{System, stop};

/// End of the sentence that says that a residual is more than noise.
pub(super) const STILL_MISSING: &str = "something is still missing";

/// Samples of a signal below which its correlation says too little.
const MIN_SAMPLES: usize = 400;
/// Sum of the autocorrelation over all lags \[samples\] up to which a residual may be noise: that of a first-order
/// filter with a pole at 0.82. What a model lacks changes as slowly as the machine moves.
const MAX_CORRELATION_TIME: f64 = 10.0;
/// Correlation below which it counts as none.
const MIN_CORRELATION: f64 = 0.05;
/// Lags of the autocorrelation, and of the correlations with what drives the machine.
const LAGS: (usize, usize) = (60, 25);
/// Past values that the filter uses which makes noise white.
const ORDER: usize = 4;
/// Deviations of the powers of white noise, over blocks of each length, up to which a filtered residual is white.
const MAX_DEVIATIONS: f64 = 4.0;
/// Share of the power of a residual that may be slower than its filter makes noise: a sixth of its rms.
const MAX_SLOW_SHARE: f64 = 0.03;
/// Share of it that a linear combination of a constant, commands, outputs and their squares may explain.
const MAX_EXPLAINED_SHARE: f64 = 0.02;
/// Ratio of the rms on validation and estimation records up to which noise is of one kind.
const MAX_RATIO_OF_RECORDS: f64 = 1.25;
/// Largest correlation with what drives the machine, in bands that independent signals leave in 1 % of all cases; there
/// are several such signals.
const MAX_BANDS: f64 = 1.25;

/// Noise of one signal.
pub(crate) struct Noise {
    /// Rms on the estimation records.
    rms: f64,
    /// Sum of the autocorrelation \[samples\].
    correlation_time: f64,
}

impl Noise {
    /// Rms of white noise that would leave a fit as uncertain.
    fn as_white(&self) -> f64 {
        self.rms * self.correlation_time.max(1.0).sqrt()
    }
}

/// Noise by output where it is not white, if a model leaves nothing else.
pub(crate) fn noises(fits: &Fits, judge: &Judge, model: &Model) -> Option<Vec<(usize, Noise)>> {
    let study = fits.study;
    if study.windows.is_some() || study.force.is_some() || stop::asked() {
        return None;
    }
    let [estimation, validation] =
        [Role::Estimation, Role::Validation].map(|role| recorded(fits, model, role));
    let noise = |&o: &usize| noise(o, &study.outputs[o].name, &estimation, &validation).map(|own| (o, own));
    let found = judge.beyond(fits, model).iter().map(noise).collect::<Option<Vec<(usize, Noise)>>>();
    found.filter(|found| !found.is_empty())
}

/// Noise by output that a model leaves, if it leaves nothing else: that of the sensors, or the white noise that hides
/// as much as one that is not white.
pub(crate) fn left(fits: &Fits, judge: &Judge, model: &Model) -> Option<Vec<f64>> {
    let mut scale = explain::noises(fits.study);
    if !judge.explained(fits, model) {
        for (output, noise) in noises(fits, judge, model)? {
            scale[output] = noise.as_white();
        }
    }
    Some(scale)
}

/// Floors on estimation and validation records that are not below such noise.
pub(crate) fn raised(
    floors: &[BTreeMap<String, f64>; 2],
    study: &Study,
    noises: &[(usize, Noise)],
) -> [BTreeMap<String, f64>; 2] {
    let mut found = floors.clone();
    for floor in &mut found {
        for (o, own) in noises {
            let known = floor.entry(study.outputs[*o].name.clone()).or_default();
            *known = known.max(own.rms);
        }
    }
    found
}

/// Corrects an answer whose model leaves noise that is not white, and nothing else: nothing is missing then. Returns
/// whether it does.
pub(super) fn settle(fits: &Fits, judge: &Judge, model: &Model, found: &mut Answer) -> bool {
    let study = fits.study;
    if found.complete {
        return false;
    }
    let Some(noises) = noises(fits, judge, model) else { return false };
    if judge.rest(fits, model).place.is_some() {
        return false;
    }
    for (o, own) in &noises {
        let output = &study.outputs[*o];
        let times = own.rms / found.floor_on(0, &output.name).unwrap_or(output.noise);
        found.notes.push(format!(
            "What is left of {name} is noise that is not white: alike over about {:.0} samples, and the same whatever commands and outputs are. Its rms is {:.3e} {}, {times:.1} times what its scatter from one sample to the next gives{}.",
            own.correlation_time.max(2.0),
            own.rms,
            output.unit,
            if times > 1.1 { format!("; `noise = {:.3e}` beside the output says so", own.rms) } else { String::new() },
            name = output.name,
        ));
        found.noise.insert(output.name.clone(), own.rms.max(output.noise));
    }
    found.floor = raised(&found.floor, study, &noises);
    let taken = || {
        share(study, [&found.before[1], &found.after[1]], &[found.floor[1].clone(), found.floor[1].clone()])
    };
    if found.share.is_some() {
        found.share = Some(taken());
    }
    if let (Some(law), Some(share), Verdict::Law) = (&mut found.law, found.share, found.verdict) {
        law.share = share;
    }
    found.notes.retain(|note| !note.contains(STILL_MISSING) && note != DEPENDS_ON_NOTHING);
    found.complete = true;
    found.left_at.clear();
    if found.verdict == Verdict::Unexplained {
        (found.verdict, found.unexplained) = (Verdict::Nothing, None);
    }
    true
}

/// Residuals of the records of a role, and for each what drives the machine: commands, outputs, and their squares.
fn recorded(fits: &Fits, model: &Model, role: Role) -> (Residuals, Vec<Signals>) {
    let (study, pieces, p) = (fits.study, pieces(fits.study, role), &model.fit.parameters);
    let locals = match role {
        Role::Estimation => model.fit.locals.clone(),
        _ => initial(fits, &model.added, &pieces, p),
    };
    let scale = vec![1.0; study.outputs.len()];
    let view = View { scale, ..fits.view(&model.added, &pieces) };
    let of_piece = |r: usize| {
        let n = pieces[r].range.len();
        let split = |values: &[f64]| values.chunks(n.max(1)).map(<[f64]>::to_vec).collect::<Vec<_>>();
        let predicted = split(&view.predict(r, p, &locals[r]));
        let record = &study.records[pieces[r].record];
        let commands = record.inputs.iter().flatten().map(|own| own[pieces[r].range.clone()].to_vec());
        let moving: Vec<Vec<f64>> = commands.chain(predicted).collect();
        let squares = moving.iter().map(|own| own.iter().map(|value| value * value).collect());
        let inputs = squares.collect::<Vec<Vec<f64>>>().into_iter().chain(moving.iter().cloned()).collect();
        let outputs = split(&view.residuals(r, p, &locals[r]));
        (outputs.clone(), Signals { sample_time: record.step, inputs, outputs, ..Signals::default() })
    };
    (0..pieces.len()).map(of_piece).unzip()
}

/// The noise of output `o`, if its residuals are nothing else.
fn noise(
    o: usize,
    name: &str,
    (estimation, drivers): &(Residuals, Vec<Signals>),
    (validation, _): &(Residuals, Vec<Signals>),
) -> Option<Noise> {
    let of = |records: &Residuals| records.iter().map(|own| own[o].clone()).collect::<Vec<Vec<f64>>>();
    let (own, other) = (of(estimation), of(validation));
    let samples: usize = own.iter().map(Vec::len).sum();
    let rms = |series: &[Vec<f64>]| {
        let n = series.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        (series.iter().flatten().map(|e| e * e).sum::<f64>() / n).sqrt()
    };
    let ratio = rms(&other) / rms(&own);
    // Residuals that are no numbers are no noise.
    if samples < MIN_SAMPLES || !(ratio < MAX_RATIO_OF_RECORDS && ratio > MAX_RATIO_OF_RECORDS.recip()) {
        return None;
    }
    let correlation = autocorrelation(estimation, o, name, LAGS.0, 0).values;
    let near = correlation.iter().skip(1).take_while(|own| own.abs() > MIN_CORRELATION);
    let correlation_time = 1.0 + 2.0 * near.sum::<f64>();
    if correlation_time > MAX_CORRELATION_TIME {
        return None;
    }
    let coefficients = prediction(&own, ORDER);
    // Power at low frequencies of noise of that filter, over the power of what the filter leaves.
    let slow = (1.0 - coefficients.iter().sum::<f64>()).powi(-2);
    let white = |mut series: Vec<Vec<f64>>| {
        let whole = rms(&series).powi(2);
        series.iter_mut().for_each(|own| innovations(own, &coefficients));
        let power = rms(&series).powi(2);
        let n = series.iter().map(Vec::len).sum::<usize>() as f64;
        let sums = series.iter().map(|own| powers(own)).fold([0.0; 3], |mut all, own| {
            all.iter_mut().zip(own).for_each(|(all, own)| *all += own);
            all
        });
        BLOCKS.iter().zip(sums).all(|(length, sum)| {
            let blocks = n / *length as f64;
            let more = sum / power - blocks;
            let allowed = MAX_SLOW_SHARE * n * whole / (slow * power);
            more < f64::max(MAX_DEVIATIONS * (2.0 * blocks).sqrt(), allowed)
        })
    };
    let is_driven = || {
        (0..drivers.first().map_or(0, |own| own.inputs.len())).any(|k| {
            cross_correlation(estimation, drivers, (o, name), (k, ""), LAGS.1).missing_dynamics > MAX_BANDS
        })
    };
    let is_alone = explained_by(drivers, &own) < MAX_EXPLAINED_SHARE;
    (is_alone && white(own.clone()) && white(other) && !is_driven())
        .then(|| Noise { rms: rms(&own), correlation_time })
}

/// Share of the power of residuals that a constant and what drives the machine explain together.
fn explained_by(drivers: &[Signals], residuals: &[Vec<f64>]) -> f64 {
    let count = drivers.first().map_or(0, |own| own.inputs.len());
    let constant = residuals.iter().flat_map(|own| vec![1.0; own.len()]).collect();
    let driver = |k: usize| drivers.iter().flat_map(|own| own.inputs[k].iter().copied()).collect();
    let columns = std::iter::once(constant).chain((0..count).map(driver));
    let columns: Vec<DVector<f64>> = columns
        .map(DVector::<f64>::from_vec)
        .filter(|column| column.norm() > 0.0)
        .map(|column| column.normalize())
        .collect();
    let e = DVector::from_iterator(columns[0].len(), residuals.iter().flatten().copied());
    let matrix = DMatrix::from_columns(&columns);
    let right = matrix.tr_mul(&e);
    // Signals that are alike change nothing.
    let normal = matrix.tr_mul(&matrix) + DMatrix::identity(columns.len(), columns.len()) * 1e-9;
    Cholesky::new(normal).map_or(1.0, |normal| normal.solve(&right).dot(&right) / e.norm_squared())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::noise::Noise as Drawn;

    /// Residuals of three records with noise of a first-order filter, `more` by command and sample, and their commands.
    fn records(pole: f64, seed: u64, more: impl Fn(f64, usize) -> f64) -> (Residuals, Vec<Signals>) {
        let record = |r: u64| {
            let mut drawn = Drawn::new(seed, r);
            let mut level = 0.0;
            let mut hold = 0.0;
            let (mut e, mut u) = (Vec::new(), Vec::new());
            for k in 0..1500 {
                level = pole * level + (1.0 - pole * pole).sqrt() * drawn.normal();
                if k % 40 == 0 {
                    hold = drawn.normal();
                }
                e.push(level + more(hold, k));
                u.push(hold);
            }
            let outputs = vec![e];
            (outputs.clone(), Signals { sample_time: 0.01, inputs: vec![u], outputs, ..Signals::default() })
        };
        (0..3).map(record).unzip()
    }

    fn is_noise(pole: f64, seed: u64, more: impl Fn(f64, usize) -> f64 + Copy) -> bool {
        noise(0, "y", &records(pole, seed, more), &records(pole, seed + 100, more)).is_some()
    }

    #[test]
    fn filtered_noise_is_noise_and_slow_noise_is_not_told_from_an_error() {
        for pole in [-0.5, 0.3, 0.5, 0.7] {
            let found = (0..20).filter(|&seed| is_noise(pole, seed, |_, _| 0.0)).count();
            assert!(found >= 18, "{pole}: {found} of 20");
        }
        assert!((0..20).all(|seed| !is_noise(0.97, seed, |_, _| 0.0)));
    }

    #[test]
    fn what_depends_on_a_command_or_stays_is_no_noise() {
        for seed in 0..20 {
            assert!(!is_noise(0.5, seed, |u, _| 0.3 * u), "{seed}: driven");
            assert!(!is_noise(0.5, seed, |_, _| 0.5), "{seed}: offset");
            assert!(!is_noise(0.5, seed, |_, k| 0.5 * (k as f64 / 150.0).sin()), "{seed}: wave");
        }
    }

    #[test]
    fn noise_of_another_level_on_validation_records_is_not_of_one_kind() {
        let (own, mut other) = (records(0.5, 1, |_, _| 0.0), records(0.5, 2, |_, _| 0.0));
        other.0.iter_mut().flatten().flatten().for_each(|e| *e *= 1.5);
        assert!(noise(0, "y", &own, &other).is_none());
    }
}
