//! Autocorrelation of residuals.

use super::{Record, Signal};

/// Longest lag \[s\], and most lags.
const MAX_LAG_TIME: f64 = 0.2;
const LAGS: usize = 100;

/// Autocorrelation of the residuals of a signal before and after.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// Signal.
    pub signal: String,
    /// Lags \[s\], shape \[m\].
    pub lags: Vec<f64>,
    /// Of the declared and of the corrected model, each of shape \[m\].
    pub values: [Vec<f64>; 2],
    /// White noise stays below this with 99 %.
    pub limit: f64,
}

/// Autocorrelation of all signals, pooled over the records.
pub fn of(signals: &[Signal], records: &[Record]) -> Vec<Correlation> {
    let Some(dt) = records.first().map(|record| record.sample_time) else { return Vec::new() };
    let every = ((MAX_LAG_TIME / dt / LAGS as f64).round() as usize).max(1);
    let steps: Vec<usize> = (1..=LAGS).map(|lag| lag * every).collect();
    let one = |(index, signal): (usize, &Signal)| {
        let own: Vec<_> =
            records.iter().flat_map(|r| r.residuals.iter().filter(|x| x.signal == index)).collect();
        let samples: usize = own.iter().map(|residual| residual.values[0].len()).sum();
        let values = [0, 1].map(|model| {
            let parts = own.iter().map(|residual| residual.values[model].as_slice());
            pooled(&parts.collect::<Vec<_>>(), &steps)
        });
        let lags = steps.iter().map(|&step| step as f64 * dt).collect();
        Correlation {
            signal: signal.name.clone(),
            lags,
            values,
            limit: 2.58 / (samples.max(1) as f64).sqrt(),
        }
    };
    signals.iter().enumerate().map(one).collect()
}

/// `sum r(k) r(k + step) / sum r(k)^2` over several records, for each step.
fn pooled(parts: &[&[f64]], steps: &[usize]) -> Vec<f64> {
    let power: f64 = parts.iter().flat_map(|part| part.iter()).map(|r| r * r).sum();
    let at = |&step: &usize| {
        let products = parts.iter().map(|part| {
            part.iter().zip(part.get(step..).unwrap_or_default()).map(|(a, b)| a * b).sum::<f64>()
        });
        products.sum::<f64>() / power.max(f64::MIN_POSITIVE)
    };
    steps.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_correlates_with_its_cosine() {
        let n = 10_000;
        let sine: Vec<f64> = (0..n).map(|k| (std::f64::consts::TAU * f64::from(k) / 100.0).sin()).collect();
        let found = pooled(&[&sine], &[25, 50, 100]);
        // The products of the ends are missing: half a percent.
        for (value, expected) in found.iter().zip([0.0, -1.0, 1.0]) {
            assert!((value - expected).abs() < 0.011, "{found:?}");
        }
    }
}
