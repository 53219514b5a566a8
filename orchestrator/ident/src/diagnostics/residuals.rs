//! Correlation of the residuals with themselves and with the inputs (Ljung, System Identification, 2nd ed.,
//! sec. 16.6).
//!
//! With many samples every test finds something; so each comes with the share of the variance that it is about.

use serde::Serialize;

use super::chi_squared;
use crate::record::Record;
use airloop_optim::linalg::qr::dot;

/// Autocorrelation of the residual of one output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Autocorrelation {
    /// Name of the output.
    pub output: String,
    /// Correlation at lags 0, 1, .., shape \[lags + 1\].
    pub values: Vec<f64>,
    /// A value of white residuals stays within +- this with a probability of 99 %.
    pub band_99: f64,
    /// Ljung-Box statistic over all lags.
    pub ljung_box: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Probability of a larger statistic if the residuals are white.
    pub p_value: f64,
    /// Share of the variance of the residual that its own past explains (autoregression over the lags, less what white
    /// noise shows by chance), 0 to 1.
    pub explained_by_past: f64,
}

/// Correlation of the residual of one output with one input, both filtered so that the input is white: a slow input
/// would hide what is missing in the correlation of its neighboring values. The values then look like the impulse
/// response that the model lacks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CrossCorrelation {
    /// Name of the output.
    pub output: String,
    /// Name of the input.
    pub input: String,
    /// Lags, from negative to positive; at a positive lag the input comes first.
    pub lags: Vec<i64>,
    /// Correlation of the filtered `e(k + lag)` and `u(k)`.
    pub values: Vec<f64>,
    /// A value stays within +- this with a probability of 99 % if residual and input are independent.
    pub band_99: f64,
    /// Largest absolute value at lags from 0 on, in bands of 99 % *for all lags together*: above 1 the model misses
    /// dynamics or delay of this channel.
    pub missing_dynamics: f64,
    /// The same at negative lags: above 1 the input depends on past outputs (feedback).
    pub feedback: f64,
    /// Share of the variance of the filtered residual that the input explains: squared correlations at lags from 0 on,
    /// less what independent signals show by chance.
    pub explained_by_input: f64,
    /// Share of the variance of the filtered input that past residuals explain, in the same way over negative lags.
    pub explained_by_residual: f64,
}

/// Residuals of several records, shape \[records\]\[n_y\]\[n\].
pub type Residuals = Vec<Vec<Vec<f64>>>;

/// Autocorrelation of the residual of output `index`, up to `lags`; `fitted` lags of it were fitted by the model and
/// count less in the test.
pub fn autocorrelation(
    residuals: &Residuals,
    index: usize,
    output: &str,
    lags: usize,
    fitted: usize,
) -> Autocorrelation {
    let series = centered(residuals.iter().map(|record| record[index].as_slice()));
    let n: usize = series.iter().map(Vec::len).sum();
    let covariances = covariances(&series, &series, lags);
    let scale = if covariances[0] > 0.0 { covariances[0] } else { 1.0 };
    let values: Vec<f64> = covariances.iter().map(|value| value / scale).collect();
    let degrees_of_freedom = lags.saturating_sub(fitted).max(1);
    let n_f = n as f64;
    let squares = values.iter().enumerate().skip(1);
    let ljung_box =
        n_f * (n_f + 2.0) * squares.map(|(lag, r)| r * r / (n_f - lag as f64).max(1.0)).sum::<f64>();
    let by_chance = lags as f64 / n_f.max(1.0);
    let explained = if covariances[0] > 0.0 { autoregression(&values) } else { 0.0 };
    Autocorrelation {
        output: output.into(),
        values,
        band_99: chi_squared::two_sided_normal(0.01) / n_f.max(1.0).sqrt(),
        ljung_box,
        degrees_of_freedom,
        p_value: chi_squared::tail(ljung_box, degrees_of_freedom),
        explained_by_past: (explained - by_chance).max(0.0),
    }
}

/// Correlation of the residual of output `index` with input `input`, lags from `-lags` to `lags`.
///
/// The band takes the color of both into account: `Var = sum_k R_e(k) R_u(k) / n` (Ljung, eq. 16.46).
pub fn cross_correlation(
    residuals: &Residuals,
    records: &[Record],
    (index, output): (usize, &str),
    (input, input_name): (usize, &str),
    lags: usize,
) -> CrossCorrelation {
    let mut e = centered(residuals.iter().map(|record| record[index].as_slice()));
    let first = |(record, e): (&Record, &Vec<f64>)| record.inputs[input][record.len() - e.len()..].to_vec();
    let cut: Vec<Vec<f64>> = records.iter().zip(&e).map(first).collect();
    let mut u = centered(cut.iter().map(Vec::as_slice));
    whiten(&mut u, &mut e, lags.min(WHITENING_ORDER));
    let n: usize = e.iter().map(Vec::len).sum();
    let long = 4 * lags;
    let (of_e, of_u) = (covariances(&e, &e, long), covariances(&u, &u, long));
    let size = (of_e[0] * of_u[0]).sqrt();
    let scale = if size > 0.0 { size } else { 1.0 };
    let taper = |lag: usize| 1.0 - lag as f64 / (long + 1) as f64;
    let color: f64 = (1..=long).map(|lag| 2.0 * taper(lag) * of_e[lag] * of_u[lag]).sum();
    let white = of_e[0] * of_u[0];
    // The estimated sum may be small by chance; half of its white value is the least that is believed.
    let deviation = (f64::max(white + color, 0.5 * white) / n.max(1) as f64).sqrt() / scale;
    let later = covariances(&e, &u, lags);
    let earlier = covariances(&u, &e, lags);
    let values: Vec<f64> =
        earlier.iter().skip(1).rev().chain(&later).map(|covariance| covariance / scale).collect();
    let together = |count: usize| chi_squared::two_sided_normal(0.01 / count.max(1) as f64) * deviation;
    let largest = |values: &[f64]| values.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let in_bands =
        |values: &[f64]| if deviation > 0.0 { largest(values) / together(values.len()) } else { 0.0 };
    let (negative, positive) = values.split_at(lags);
    let explained = |values: &[f64]| {
        let by_chance = deviation.powi(2) * values.len() as f64;
        (values.iter().map(|r| r * r).sum::<f64>() - by_chance).clamp(0.0, 1.0)
    };
    CrossCorrelation {
        output: output.into(),
        input: input_name.into(),
        lags: (-(lags as i64)..=lags as i64).collect(),
        band_99: chi_squared::two_sided_normal(0.01) * deviation,
        missing_dynamics: in_bands(positive),
        feedback: in_bands(negative),
        explained_by_input: explained(positive),
        explained_by_residual: explained(negative),
        values,
    }
}

/// Series less their common mean.
fn centered<'a>(series: impl Iterator<Item = &'a [f64]> + Clone) -> Vec<Vec<f64>> {
    let count: usize = series.clone().map(<[f64]>::len).sum();
    let mean = series.clone().flatten().sum::<f64>() / count.max(1) as f64;
    series.map(|values| values.iter().map(|value| value - mean).collect()).collect()
}

/// `sum a(k + lag) b(k) / n` for lags 0, 1, ..; no product spans two series.
fn covariances(a: &[Vec<f64>], b: &[Vec<f64>], lags: usize) -> Vec<f64> {
    let n: usize = a.iter().map(Vec::len).sum();
    let at = |lag: usize| {
        let product = |(a, b): (&Vec<f64>, &Vec<f64>)| {
            if lag >= a.len() { 0.0 } else { dot(&a[lag..], &b[..a.len() - lag]) }
        };
        a.iter().zip(b).map(product).sum::<f64>() / n.max(1) as f64
    };
    (0..=lags).map(at).collect()
}

/// Share of the variance that an autoregression over all lags explains.
fn autoregression(correlation: &[f64]) -> f64 {
    1.0 - levinson(correlation).1
}

/// Coefficients of the best prediction from the past for a correlation sequence (Levinson and Durbin), shape \[lags\],
/// and the share of the variance that it leaves.
fn levinson(correlation: &[f64]) -> (Vec<f64>, f64) {
    let mut coefficients: Vec<f64> = Vec::new();
    let mut left = 1.0;
    for lag in 1..correlation.len() {
        let predicted: f64 = coefficients.iter().enumerate().map(|(j, a)| a * correlation[lag - 1 - j]).sum();
        let reflection = (correlation[lag] - predicted) / left;
        if reflection.abs() >= 1.0 {
            return (coefficients, 0.0);
        }
        let before = coefficients.clone();
        coefficients.iter_mut().enumerate().for_each(|(j, a)| *a -= reflection * before[lag - 2 - j]);
        coefficients.push(reflection);
        left *= 1.0 - reflection * reflection;
    }
    (coefficients, left)
}

/// The autoregression of `order` that predicts series of mean zero, shape \[records\]\[n\], best from their past:
/// coefficients of the values one, two, .. samples before, without a unit, shape \[order\]. Fewer where the past
/// predicts all, none for series of zeros.
pub fn prediction(series: &[Vec<f64>], order: usize) -> Vec<f64> {
    predictor(series, order, 0.0)
}

/// The same for series with white noise of the share `white` of their variance added.
fn predictor(series: &[Vec<f64>], order: usize, white: f64) -> Vec<f64> {
    let mut correlation = covariances(series, series, order);
    let variance = correlation[0] * (1.0 + white);
    if variance <= 0.0 {
        return Vec::new();
    }
    correlation.iter_mut().for_each(|value| *value /= variance);
    correlation[0] = 1.0;
    levinson(&correlation).0
}

/// Replaces a series, shape \[n\], by its difference from the prediction from its past (see [`prediction`]), in the
/// unit of the series; before its first sample it counts as zero.
pub fn innovations(values: &mut [f64], coefficients: &[f64]) {
    for k in (0..values.len()).rev() {
        let past = coefficients.iter().take(k).enumerate();
        let predicted: f64 = past.map(|(j, a)| a * values[k - 1 - j]).sum();
        values[k] -= predicted;
    }
}

/// Most past values of the filter that makes an input white.
const WHITENING_ORDER: usize = 20;
/// Share of its variance that is added to the input as fictitious white noise: frequencies without excitation are
/// not amplified.
const WHITE_NOISE_FLOOR: f64 = 1e-4;

/// Filters inputs and residuals with the filter that makes the inputs white.
fn whiten(inputs: &mut [Vec<f64>], residuals: &mut [Vec<f64>], order: usize) {
    let coefficients = predictor(inputs, order, WHITE_NOISE_FLOOR);
    inputs.iter_mut().chain(residuals).for_each(|values| innovations(values, &coefficients));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{Noise, stairs};

    fn record(u: Vec<f64>) -> Record {
        Record { sample_time: 1.0, outputs: vec![vec![0.0; u.len()]], inputs: vec![u], ..Record::default() }
    }

    /// A series without a random generator, that SciPy can repeat.
    fn irregular(n: usize) -> Vec<f64> {
        (0..n).map(|k| (0.7 * (k * k) as f64).sin() + 0.3 * (1.1 * k as f64).cos()).collect()
    }

    #[test]
    fn correlation_and_ljung_box_are_those_of_the_textbook() {
        // NumPy, tests/reference/identification_diagnostics.py
        let found = autocorrelation(&vec![vec![irregular(400)]], 0, "y", 10, 0);
        let expected = [1.0, 0.09257149907568168, -0.0856445987794102, -0.1381648505516753];
        for (found, expected) in found.values.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert!((found.ljung_box - LJUNG_BOX).abs() < 1e-9, "{}", found.ljung_box);
        assert!((found.p_value - P_VALUE).abs() < 1e-10, "{}", found.p_value);
    }

    const LJUNG_BOX: f64 = 26.06857823327996;
    const P_VALUE: f64 = 0.0036490386450127674;

    #[test]
    fn white_residuals_pass_and_the_effect_of_an_autoregression_is_its_square() {
        let mut noise = Noise::new(1);
        let white: Vec<f64> = (0..5000).map(|_| noise.normal()).collect();
        let found = autocorrelation(&vec![vec![white.clone()]], 0, "y", 25, 0);
        assert!(found.p_value > 0.01 && found.explained_by_past < 0.01, "{found:?}");
        let mut colored = white.clone();
        (1..colored.len()).for_each(|k| colored[k] += 0.6 * colored[k - 1]);
        let found = autocorrelation(&vec![vec![colored]], 0, "y", 25, 0);
        assert!(found.p_value < 1e-10);
        assert!((found.explained_by_past - 0.36).abs() < 0.03, "{}", found.explained_by_past);
    }

    #[test]
    fn innovations_of_an_autoregression_are_the_noise_that_drives_it() {
        let mut noise = Noise::new(3);
        let white: Vec<f64> = (0..20_000).map(|_| noise.normal()).collect();
        let mut colored = white.clone();
        (1..colored.len()).for_each(|k| colored[k] += 0.6 * colored[k - 1]);
        let found = prediction(std::slice::from_ref(&colored), 2);
        // Deviation of an estimated coefficient: 1 / sqrt(n) = 0.007.
        assert!((found[0] - 0.6).abs() < 0.03 && found[1].abs() < 0.03, "{found:?}");
        innovations(&mut colored, &[0.6]);
        assert!(colored.iter().zip(&white).all(|(found, drawn)| (found - drawn).abs() < 1e-12));
        assert!(prediction(&[vec![0.0; 50]], 2).is_empty());
    }

    #[test]
    fn the_band_for_all_lags_is_crossed_in_one_percent_of_independent_pairs() {
        let mut crossed = 0;
        for seed in 0..200 {
            let mut noise = Noise::new(seed);
            let mut e: Vec<f64> = (0..800).map(|_| noise.normal()).collect();
            (1..e.len()).for_each(|k| e[k] += 0.8 * e[k - 1]);
            let records = [record(stairs(800, 1.0, &mut noise))];
            let found = cross_correlation(&vec![vec![e]], &records, (0, "y"), (0, "u"), 25);
            crossed += usize::from(found.missing_dynamics > 1.0);
        }
        // Neighboring lags of colored signals say the same: fewer than 1 % of 200, chance included.
        assert!(crossed <= 6, "{crossed}");
    }

    #[test]
    fn a_missing_lag_and_feedback_are_told_apart_by_the_sign_of_the_lag() {
        let mut noise = Noise::new(7);
        let white: Vec<f64> = (0..3000).map(|_| noise.normal()).collect();
        let u: Vec<f64> = (0..3000).map(|_| noise.normal()).collect();
        let mut e = white.clone();
        (3..3000).for_each(|k| e[k] += 0.3 * u[k - 3]);
        let found = cross_correlation(&vec![vec![e]], &[record(u)], (0, "y"), (0, "u"), 20);
        assert!(found.missing_dynamics > 2.0 && found.feedback < 1.0, "{found:?}");
        // Var(0.3 u) over the whole variance
        assert!((found.explained_by_input - 0.09 / 1.09).abs() < 0.03);
        assert_eq!(found.lags[20 + 3], 3);
        let mut u: Vec<f64> = (0..3000).map(|_| noise.normal()).collect();
        (2..3000).for_each(|k| u[k] += 0.3 * white[k - 2]);
        let found = cross_correlation(&vec![vec![white]], &[record(u)], (0, "y"), (0, "u"), 20);
        assert!(found.missing_dynamics < 1.0 && found.feedback > 2.0, "{found:?}");
        // Var(0.3 e) over the whole variance of the input.
        assert!((found.explained_by_residual - 0.09 / 1.09).abs() < 0.03, "{found:?}");
    }
}
