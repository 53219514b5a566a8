//! A system whose residuals count as many independent samples as they hold.
//!
//! Where no model reaches the sensor noise, residuals are model error with a correlation time of many samples. In units
//! of the sensor noise their sum of squares would outweigh all priors of the declared parameters. Divided by the
//! long-run standard deviation of the residual of the best model so far it counts effective samples; for white noise of
//! the declared rms nothing changes.

use std::collections::BTreeMap;

use super::noise::Noise;
use super::system::Job;
use super::{Span, System};

/// Block lengths \[samples\] over which the long-run variance is sought.
pub const BLOCKS: [usize; 4] = [1, 8, 64, 256];

/// A system with the residuals of each signal multiplied by a factor.
pub struct Weighted<'a> {
    inner: &'a dyn System,
    /// Factor by signal; 1 where there is none.
    factors: BTreeMap<String, f64>,
}

impl<'a> Weighted<'a> {
    /// `inner` with its residuals divided by the square roots of long-run variances by signal.
    pub fn new(inner: &'a dyn System, long_run: &BTreeMap<String, f64>) -> Weighted<'a> {
        let factors = long_run.iter().map(|(signal, s)| (signal.clone(), s.sqrt().recip())).collect();
        Weighted { inner, factors }
    }

    fn factor(&self, signal: &str) -> f64 {
        self.factors.get(signal).copied().unwrap_or(1.0)
    }

    fn scale(&self, record: usize, residuals: &mut [f64]) {
        for span in self.inner.signals(record) {
            let factor = self.factor(&span.signal);
            residuals[span.range].iter_mut().for_each(|value| *value *= factor);
        }
    }
}

impl System for Weighted<'_> {
    fn records(&self) -> usize {
        self.inner.records()
    }
    fn estimation(&self, record: usize) -> bool {
        self.inner.estimation(record)
    }
    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        self.inner.locals(record)
    }
    fn signals(&self, record: usize) -> Vec<Span> {
        let mut spans = self.inner.signals(record);
        spans.iter_mut().for_each(|span| span.noise /= self.factor(&span.signal));
        spans
    }
    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.inner.predict(record, parameters, locals)
    }
    fn measured(&self, record: usize) -> Vec<f64> {
        self.inner.measured(record)
    }
    fn silence(&self, record: usize, values: &mut [f64]) {
        self.inner.silence(record, values);
    }
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        let mut residuals = self.inner.whiten(record, predicted);
        self.scale(record, &mut residuals);
        residuals
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let mut residuals = self.inner.redraw(record, predicted, noise);
        self.scale(record, &mut residuals);
        residuals
    }
    fn stage(&self, name: &str) {
        self.inner.stage(name);
    }
    fn side_by_side(&self) -> usize {
        self.inner.side_by_side()
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        let mut found = self.inner.residuals_of(jobs);
        for (job, residuals) in jobs.iter().zip(&mut found) {
            self.scale(job.record, residuals);
        }
        found
    }
}

/// Long-run variance of the whitened residuals of some records by signal, at least 1: the largest mean over blocks of
/// (sum of the block)^2 / length.
pub fn long_run(system: &dyn System, records: &[usize], residuals: &[Vec<f64>]) -> BTreeMap<String, f64> {
    let mut sums: BTreeMap<String, [(f64, f64); BLOCKS.len()]> = BTreeMap::new();
    for (&record, own) in records.iter().zip(residuals) {
        for span in system.signals(record) {
            let sums = sums.entry(span.signal).or_default();
            for (sum, length) in sums.iter_mut().zip(BLOCKS) {
                for block in own[span.range.clone()].chunks_exact(length) {
                    sum.0 += block.iter().sum::<f64>().powi(2) / length as f64;
                    sum.1 += 1.0;
                }
            }
        }
    }
    let largest = |sums: [(f64, f64); BLOCKS.len()]| {
        sums.iter().filter(|(_, count)| *count > 0.0).map(|(sum, count)| sum / count).fold(1.0, f64::max)
    };
    sums.into_iter().map(|(signal, sums)| (signal, largest(sums))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::fit::{Free, fit};
    use crate::engine::system::testing::Lines;

    #[test]
    fn white_noise_counts_as_it_is_and_a_slow_error_as_a_few_samples() {
        let residuals = |square: f64| {
            let system = Lines::new(0.0, square);
            let own: Vec<Vec<f64>> =
                (0..2).map(|r| system.residuals(r, &[0.0, 0.0], &[40.0 * r as f64])).collect();
            long_run(&system, &[0, 1], &own)["y"]
        };
        // Blocks of 256 of 1024 samples: four squares of unit variance, whose mean stays below 5 with 99.9 %.
        assert!(residuals(0.0) < 5.0);
        // 20 t^2 has the mean 20 (1/12 + 7/12)/2 over the two halves: 256 * (1.67^2 + 11.7^2)/2.
        assert!((residuals(20.0) / 17_800.0 - 1.0).abs() < 0.1);
    }

    #[test]
    fn knowledge_of_a_parameter_outweighs_residuals_that_are_no_noise() {
        let system = Lines::new(1.0, 40.0);
        let free = [Free { index: 0, bounds: (-1e3, 1e3), step: 1e-3, prior: Some(2.0) }];
        let locals = vec![vec![0.0], vec![40.0]];
        let plain = fit(&system, &[0, 1], &[0.0, 0.0], &free, &locals, 10);
        let own: Vec<Vec<f64>> =
            (0..2).map(|r| system.residuals(r, &[0.0, 0.0], &[40.0 * r as f64])).collect();
        let weighted = Weighted::new(&system, &long_run(&system, &[0, 1], &own));
        let counted = fit(&weighted, &[0, 1], &[0.0, 0.0], &free, &locals, 10);
        // A parabola of 40 t^2 looks like a slope of 40 beside an offset.
        assert!(plain.parameters[0] > 35.0 && counted.parameters[0] < 5.0, "{}", counted.parameters[0]);
    }
}
