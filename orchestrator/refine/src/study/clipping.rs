//! A signal that stands at its largest or least value again and again: the sensor or the machine is at a limit there.
//!
//! A signal at rest stands there, too, but comes to it slowly: only one that is stopped on its way is at a limit.

/// Samples at the same value that are no chance.
const SAMPLES_OF_RUN: usize = 8;
/// Runs at the limit, and share of the samples, from which on they count.
const MIN_RUNS: usize = 2;
const MIN_SHARE: f64 = 0.02;
/// Step of a signal that is stopped on its way, over the rms of its steps.
const MIN_STEP: f64 = 0.3;
/// Share of the samples from which on a record cannot be compared.
pub const MAX_SHARE: f64 = 0.1;

/// Where a signal is at its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clipping {
    /// The limit: the upper one where it is at both.
    pub at: f64,
    /// Samples there, at both limits together.
    pub samples: usize,
    /// Share of all samples.
    pub share: f64,
}

/// Whether a signal is at a limit in several runs of samples.
pub fn clipping(values: &[f64]) -> Option<Clipping> {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
    let least = MIN_STEP * rms_of_steps(values);
    let at_limit = [low, high].into_iter().filter_map(|at| {
        let there = |k: usize| (values[k] - at).abs() <= 1e-12 * (high - low);
        let stopped = runs(values.len(), there).filter(|first| step_before(values, *first) > least).count();
        let samples = (0..values.len()).filter(|&k| there(k)).count();
        let share = samples as f64 / values.len().max(1) as f64;
        (stopped >= MIN_RUNS && share > MIN_SHARE).then_some(Clipping { at, samples, share })
    });
    at_limit.reduce(|a, b| Clipping { samples: a.samples + b.samples, share: a.share + b.share, ..b })
}

/// First samples of the long runs for which `there` holds.
fn runs(count: usize, there: impl Fn(usize) -> bool) -> impl Iterator<Item = usize> {
    let mut length = 0;
    (0..count).filter_map(move |k| {
        length = if there(k) { length + 1 } else { 0 };
        (length == SAMPLES_OF_RUN).then(|| k + 1 - SAMPLES_OF_RUN)
    })
}

/// The last step before the one with which a signal comes to its limit at the sample `first`.
fn step_before(values: &[f64], first: usize) -> f64 {
    if first >= 2 { (values[first - 1] - values[first - 2]).abs() } else { 0.0 }
}

/// Rms of the steps that are not zero.
fn rms_of_steps(values: &[f64]) -> f64 {
    let steps = || values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step != 0.0);
    let count = steps().count().max(1) as f64;
    (steps().map(|step| step * step).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_that_is_cut_off_is_at_its_limit() {
        let wave: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.05).sin().min(0.9)).collect();
        let found = clipping(&wave).unwrap();
        assert!(found.at == 0.9 && (0.1..0.2).contains(&found.share), "{found:?}");
    }

    #[test]
    fn a_wave_and_a_pressure_that_comes_to_rest_are_not() {
        let wave: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.05).sin()).collect();
        // Rounded, a decay stands at zero for long.
        let decay = |k: i32| 100.0 * (-0.1 * f64::from(k % 200)).exp();
        let pressure: Vec<f64> = (0..1000).map(|k| (decay(k) * 10.0).round() / 10.0).collect();
        assert_eq!(pressure.iter().filter(|value| **value == 0.0).count() / 100, 6);
        assert_eq!([clipping(&wave), clipping(&pressure)], [None, None]);
    }
}
