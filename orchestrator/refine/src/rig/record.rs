//! A measured signal with the weight of every sample, and the rounding of its sensor.

use crate::engine::noise::Noise;
use crate::engine::system::Span;

/// A measured signal of a record.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Column.
    pub name: String,
    /// Values, shape \[n\].
    pub values: Vec<f64>,
    /// Noise rms, rounding included.
    pub noise: f64,
    /// Rounding step of the values.
    pub step: f64,
    /// 1/noise of every sample, shape \[n\].
    pub weights: Vec<f64>,
}

impl Measured {
    /// A signal with rms noise `noise`, rounding included.
    pub fn new(name: &str, values: Vec<f64>, noise: f64) -> Measured {
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let extent = sorted.last().copied().unwrap_or(0.0) - sorted.first().copied().unwrap_or(0.0);
        let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 1e-9 * extent);
        // Values are written with few digits, so a gap of one step comes out a little long or short.
        let step = gaps.fold(f64::INFINITY, f64::min);
        let step = if step.is_finite() { step } else { 0.0 };
        let weights = weights(&values, noise);
        Measured { name: name.into(), values, noise, step, weights }
    }

    /// The first `n` samples.
    pub fn beginning(&self, n: usize) -> Measured {
        let (values, weights) = (self.values[..n].to_vec(), self.weights[..n].to_vec());
        Measured { name: self.name.clone(), values, weights, ..*self }
    }

    /// (measured - predicted) weighted, appended to `out`.
    pub fn whiten(&self, predicted: &[f64], out: &mut Vec<f64>) {
        out.extend((0..self.values.len()).map(|k| (self.values[k] - predicted[k]) * self.weights[k]));
    }

    /// The weighted noise of a repeated measurement of `predicted`, appended to `out`.
    pub fn redraw(&self, predicted: &[f64], noise: &mut Noise, out: &mut Vec<f64>) {
        let rounding = self.step / 12f64.sqrt();
        let white = (self.noise.powi(2) - rounding.powi(2)).max(0.0).sqrt();
        // Rounding that is all of the noise: the null has no other, even if the declared number is a digit off.
        let white = if white < 0.15 * self.noise { 0.0 } else { white };
        let shift = noise.uniform() * self.step;
        let round = |value: f64| {
            if self.step > 0.0 { super::lanes::round(value / self.step) * self.step } else { value }
        };
        let shown: Vec<f64> = predicted
            .iter()
            .map(|value| round(value + shift + white * if white > 0.0 { noise.normal() } else { 0.0 }))
            .collect();
        let weights = weights(&shown, self.noise);
        out.extend((0..shown.len()).map(|k| (shown[k] - predicted[k] - shift) * weights[k]));
    }
}

/// Where the signals of a record stand if their samples follow one another, signal by signal.
pub fn spans<'a>(signals: impl IntoIterator<Item = &'a Measured>) -> Vec<Span> {
    let mut end = 0;
    let span = |m: &Measured| {
        let begin = end;
        end += m.values.len();
        Span { signal: m.name.clone(), range: begin..end, noise: m.noise }
    };
    signals.into_iter().map(span).collect()
}

/// The values of all signals, one after the other.
pub fn values<'a>(signals: impl IntoIterator<Item = &'a Measured>) -> Vec<f64> {
    signals.into_iter().flat_map(|m| m.values.iter().copied()).collect()
}

/// (measured - predicted) weighted, of all signals, one after the other.
pub fn whitened(signals: &[Measured], predicted: &[f64]) -> Vec<f64> {
    let (mut out, mut rest) = (Vec::with_capacity(predicted.len()), predicted);
    for m in signals {
        let (own, others) = rest.split_at(m.values.len());
        m.whiten(own, &mut out);
        rest = others;
    }
    out
}

/// A value that an encoder repeats carries one rounding error, not many independent ones: a run of r equal values
/// counts as one sample.
fn weights(values: &[f64], noise: f64) -> Vec<f64> {
    let mut weights = Vec::with_capacity(values.len());
    while weights.len() < values.len() {
        let k = weights.len();
        let run = values[k..].iter().take_while(|&&value| value == values[k]).count();
        let weight = 1.0 / (noise * (run as f64).sqrt());
        weights.extend(std::iter::repeat_n(weight, run));
    }
    weights
}
