//! Horizon over which a declared model can be predicted: an unstable system that a controller holds leaves its records
//! within seconds, however right its model is.

use super::declaration::File;
use super::fits::Fits;
use super::model::Study;
use super::prepared::Played;
use super::simulate::View;
use crate::Error;
use crate::engine::System;
use crate::engine::fit::Fit;
use crate::regime::deviation;

/// Error over the spread of an output from which on a model does not follow it.
const MIN_NRMSE: f64 = 1.0;
/// Difference of a state over its size, so small that nothing but the linearized system answers.
const STEP: f64 = 1e-9;
const LEAST_SIZE: f64 = 1e-3;
/// Growth of a difference of an output from which on it may be that of an unstable system, and ratio of the growth at
/// a time and at half of it from which on it is exponential: a period that depends on the amplitude gives 2, an
/// integrator behind another 4.
const MIN_GROWTH: f64 = 30.0;
const MIN_RATIO_OF_GROWTH: f64 = 5.0;
/// Growth of a difference in a window.
const GROWTH_IN_WINDOW: f64 = 20.0;
/// Records that are looked at.
const RECORDS: usize = 3;

/// Refuses a study without windows whose declared model is unstable and leaves the records.
///
/// # Errors
/// Output and error, the time in which a difference grows, and the keys of windows that may be predicted.
pub fn check(file: &File, study: &Study, declared: &Fit, played: &[Played]) -> Result<(), Error> {
    if study.windows.is_some() || study.steps_alone {
        return Ok(());
    }
    let count = study.outputs.len();
    let mut worst: Option<(f64, usize)> = None;
    for (own, o) in played.iter().flat_map(|own| (0..count).map(move |o| (own, o))) {
        let [given, measured] = own.output(o, count);
        let square = given.iter().zip(measured).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let nrmse = (square / given.len().max(1) as f64).sqrt() / deviation(measured);
        if nrmse > worst.map_or(MIN_NRMSE, |own| own.0) {
            worst = Some((nrmse, o));
        }
    }
    let Some((nrmse, o)) = worst else { return Ok(()) };
    let fits = Fits::new(study, vec![1.0; count]);
    let view = fits.view(&[], &fits.pieces);
    let rate = |r: usize| growth(&view, r, &declared.parameters, &declared.locals[r]);
    let Some(rate) = (0..view.pieces.len().min(RECORDS)).filter_map(rate).reduce(f64::max) else {
        return Ok(());
    };
    let step = study.records[view.pieces[0].record].step;
    let window = rounded(GROWTH_IN_WINDOW.ln() / rate).max(8.0 * step);
    let names = study.take().map(|plant| {
        let names = plant.states_by_place();
        study.give(plant);
        names
    });
    let names = names.map_err(|problem| file.refuse_all(problem.to_string()))?;
    let listed: Vec<String> = names.iter().take(8).map(|name| format!("`{name}`")).collect();
    Err(file.refuse_all(format!(
        "the declared model is unstable and cannot be predicted over a record: a difference of its states grows {GROWTH_IN_WINDOW:.0} times in {window} s, and what it gives for `{}` is off by {nrmse:.1} times the spread of the records. Let simulations begin anew from measured states: `windows_s = {window}` under [error], and under [states] a signal for each of {} that records show, as in `v = {{ derivative_of = \"x\", low_pass_hz = 20 }}`; the regulator's command stays an input",
        study.outputs[o].name,
        listed.join(", "),
    )))
}

/// Rate \[1/s\] at which differences of the states of a record grow that are outputs, if they grow exponentially.
fn growth(view: &View, r: usize, p: &[f64], locals: &[f64]) -> Option<f64> {
    let study = view.study;
    let piece = &view.pieces[r];
    let (n, step) = (piece.range.len(), study.records[piece.record].step);
    let first = view.traced(r, p, locals).1.into_iter().next()?;
    let from = |x: &[f64]| {
        let begins = vec![x.to_vec()];
        View { begins, pieces: vec![piece.clone()], ..view.clone() }.predict(0, p, x)
    };
    let base = from(&first);
    let of_state = |i: usize| {
        let mut moved = first.clone();
        moved[i] += STEP * moved[i].abs().max(LEAST_SIZE);
        let moved = from(&moved);
        let of_output = |o: usize| {
            let own = base[o * n..(o + 1) * n].iter().zip(&moved[o * n..(o + 1) * n]);
            rate(&own.map(|(a, b)| (a - b).abs()).collect::<Vec<_>>(), step)
        };
        (0..study.outputs.len()).filter_map(of_output).reduce(f64::max)
    };
    (0..first.len()).filter_map(of_state).reduce(f64::max)
}

/// Rate of the first exponential growth of differences `[n]` with a `step` \[s\]; none where there is none at first.
fn rate(differences: &[f64], step: f64) -> Option<f64> {
    let begin = *differences.first().filter(|own| **own > 0.0)?;
    let mut largest = begin;
    let growth: Vec<f64> = differences
        .iter()
        .map(|own| {
            largest = largest.max(*own);
            largest / begin
        })
        .collect();
    let grown = |k: &usize| {
        growth[*k].is_finite()
            && growth[*k] >= MIN_GROWTH
            && growth[*k] >= MIN_RATIO_OF_GROWTH * growth[k / 2]
    };
    let at = (1..growth.len()).find(grown)?;
    Some((growth[at] / growth[at / 2]).ln() / ((at - at / 2) as f64 * step))
}

/// A time with two digits.
fn rounded(time: f64) -> f64 {
    let digit = 10f64.powf(time.log10().floor() - 1.0);
    ((time / digit).round() * digit * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_growth_has_a_rate_and_that_of_integrators_has_none() {
        let differences =
            |of: &dyn Fn(f64) -> f64| (0..1200).map(|k| of(0.01 * f64::from(k))).collect::<Vec<_>>();
        let found = rate(&differences(&|t| 1e-9 * (6.0 * t).cosh()), 0.01).unwrap();
        assert!((found - 6.0).abs() < 1.0, "{found}");
        // A swing whose period depends on its amplitude, an integrator behind another, and what decays.
        assert_eq!(rate(&differences(&|t| 1e-9 * (1.0 + 20.0 * t) * (9.0 * t).cos().abs()), 0.01), None);
        assert_eq!(rate(&differences(&|t| 1e-9 * (1.0 + t * t)), 0.01), None);
        assert_eq!(rate(&differences(&|t| 1e-9 * (-t).exp()), 0.01), None);
    }

    #[test]
    fn times_have_two_digits() {
        assert_eq!([rounded(0.4993), rounded(12.34), rounded(0.0317)], [0.5, 12.0, 0.032]);
    }
}
