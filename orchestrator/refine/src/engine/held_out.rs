//! The error of a model on records, in units that make signals comparable.

use std::collections::BTreeMap;

use super::{System, parallel};

/// How far a model is from some records: each signal divided by its unit, root mean square over signals, the variance
/// of the sensor noise taken off.
pub struct HeldOut<'a> {
    system: &'a dyn System,
    /// Unit by signal; signals without one are not judged.
    units: &'a BTreeMap<String, f64>,
}

impl<'a> HeldOut<'a> {
    /// The error of predictions of `system`; `units` by signal.
    pub fn new(system: &'a dyn System, units: &'a BTreeMap<String, f64>) -> HeldOut<'a> {
        HeldOut { system, units }
    }

    /// Mean square of every judged signal above the variance of its noise \[unit^2\]; `locals`: local parameters of
    /// each record, where it has any.
    pub fn squares(&self, p: &[f64], records: &[usize], locals: &[Vec<f64>]) -> BTreeMap<String, f64> {
        let parts = parallel::map(records.len(), |i| {
            let (record, own) = (records[i], locals.get(i).map_or(&[][..], Vec::as_slice));
            let (predicted, measured) = (self.system.predict(record, p, own), self.system.measured(record));
            let (mut left, mut there): (Vec<f64>, Vec<f64>) =
                measured.iter().zip(&predicted).map(|(a, b)| (a - b, 1.0)).unzip();
            self.system.silence(record, &mut left);
            self.system.silence(record, &mut there);
            let square = |range: std::ops::Range<usize>| left[range].iter().map(|e| e * e).sum::<f64>();
            let count = |range: std::ops::Range<usize>| there[range].iter().sum::<f64>();
            let spans = self.system.signals(record).into_iter();
            spans
                .map(|span| (span.signal, count(span.range.clone()), square(span.range), span.noise))
                .collect::<Vec<_>>()
        });
        let mut sums: BTreeMap<String, (f64, f64)> = BTreeMap::new();
        for (signal, samples, square, noise) in parts.into_iter().flatten() {
            let Some(unit) = self.units.get(&signal) else { continue };
            let sum = sums.entry(signal).or_default();
            sum.0 += (square - samples * noise * noise) / (unit * unit);
            sum.1 += samples;
        }
        // A simulation that diverges is no perfect one: the larger of zero and what is no number would be zero.
        let square = |(sum, samples): (f64, f64)| match sum / samples {
            _ if samples <= 0.0 => 0.0,
            mean if mean.is_nan() => f64::INFINITY,
            mean => mean.max(0.0),
        };
        sums.into_iter().map(|(signal, own)| (signal, square(own))).collect()
    }

    /// Spread of some records \[units\]: root mean square over signals of their standard deviations, the variance of
    /// the sensor noise taken off. A model that ends farther from the records says nothing of them.
    pub fn spread(&self, records: &[usize]) -> f64 {
        // Samples, their sum, sum of squares less that of the noise.
        let mut sums: BTreeMap<String, [f64; 3]> = BTreeMap::new();
        for &record in records {
            let mut values = self.system.measured(record);
            let mut there = vec![1.0; values.len()];
            self.system.silence(record, &mut values);
            self.system.silence(record, &mut there);
            for span in self.system.signals(record) {
                let Some(unit) = self.units.get(&span.signal) else { continue };
                let samples = there[span.range.clone()].iter().sum::<f64>();
                let own = values[span.range].iter().map(|value| value / unit);
                let [count, sum, squares] = sums.entry(span.signal).or_default();
                *count += samples;
                *sum += own.clone().sum::<f64>();
                *squares +=
                    own.map(|value| value * value).sum::<f64>() - samples * (span.noise / unit).powi(2);
            }
        }
        let variance = |[count, sum, squares]: &[f64; 3]| (squares / count - (sum / count).powi(2)).max(0.0);
        (sums.values().map(variance).sum::<f64>() / sums.len().max(1) as f64).sqrt()
    }

    /// Root mean square of the sensor noise of some records over signals \[units\].
    pub fn floor(&self, records: &[usize]) -> f64 {
        let mut sums: BTreeMap<String, (f64, f64)> = BTreeMap::new();
        for span in records.iter().flat_map(|&record| self.system.signals(record)) {
            let Some(unit) = self.units.get(&span.signal) else { continue };
            let sum = sums.entry(span.signal).or_default();
            sum.0 += span.range.len() as f64 * (span.noise / unit).powi(2);
            sum.1 += span.range.len() as f64;
        }
        (sums.values().map(|(square, count)| square / count).sum::<f64>() / sums.len().max(1) as f64).sqrt()
    }

    /// Root mean square over signals \[units\] of a system without local parameters; infinite where a prediction is no
    /// number.
    pub fn error(&self, p: &[f64], records: &[usize]) -> f64 {
        self.error_from(p, records, &[])
    }

    /// The same with the local parameters of each record.
    pub fn error_from(&self, p: &[f64], records: &[usize], locals: &[Vec<f64>]) -> f64 {
        let squares = self.squares(p, records, locals);
        let mean = squares.values().sum::<f64>() / squares.len().max(1) as f64;
        if mean.is_finite() { mean.sqrt() } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::fit::{Free, fit};
    use crate::engine::noise::Noise;
    use crate::engine::system::testing::Lines;

    /// Lines through the origin of all records, which have no local parameters.
    struct Fixed(Lines);

    impl System for Fixed {
        fn records(&self) -> usize {
            self.0.records()
        }
        fn estimation(&self, record: usize) -> bool {
            self.0.estimation(record)
        }
        fn locals(&self, _: usize) -> Vec<(f64, f64)> {
            Vec::new()
        }
        fn signals(&self, record: usize) -> Vec<crate::engine::Span> {
            self.0.signals(record)
        }
        fn predict(&self, record: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
            self.0.predict(record, p, &[40.0 * record as f64])
        }
        fn measured(&self, record: usize) -> Vec<f64> {
            self.0.measured(record)
        }
        fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
            self.0.whiten(record, predicted)
        }
        fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
            self.0.redraw(record, predicted, noise)
        }
    }

    #[test]
    fn the_error_is_that_of_the_model_without_the_noise() {
        let system = Fixed(Lines::new(12.0, 0.0));
        let units = BTreeMap::from([("y".to_owned(), 2.0)]);
        let held = HeldOut::new(&system, &units);
        // 12 t over [0, 1) has the rms 12/sqrt(3) = 6.93; the noise of 1 is taken off.
        assert!((held.error(&[0.0, 0.0], &[0, 1]) * 2.0 / 6.93 - 1.0).abs() < 0.02);
        assert_eq!(held.floor(&[0, 1]).to_bits(), 0.5_f64.to_bits());
        let free = [Free { index: 0, bounds: (-1e3, 1e3), step: 1e-3, prior: None }];
        let found = fit(&system, &[0, 1], &[0.0, 0.0], &free, &[Vec::new(), Vec::new()], 5);
        // The mean square of 512 samples of unit noise scatters by 0.06.
        assert!(held.error(&found.parameters, &[2]) < 0.25);
        assert!(held.error(&[f64::NAN, 0.0], &[0, 1]).is_infinite());
    }
}
