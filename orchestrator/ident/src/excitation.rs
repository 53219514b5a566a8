//! Information in the inputs: their band, and how many coefficients they can distinguish.

use serde::Serialize;

use super::record::Error;
use super::source::Source;
use airloop_optim::linalg::StreamedQr;

/// Samples of a segment of the spectrum; a power of two.
const SEGMENT: usize = 1024;
/// Share of the power that makes the band.
const SHARE_OF_POWER_IN_BAND: f64 = 0.99;
/// Most coefficients that are tried for persistence of excitation.
const MOST_ORDERS: usize = 20;
/// Residual of `u(k-n)` after projection on `u(k), .., u(k-n+1)`, relative to `u(k-n)`, below which it carries no news.
const MIN_NEW_SHARE: f64 = 1e-6;
/// Stretches of each record that are looked at for persistence of excitation, and their samples.
const STRETCHES: (usize, usize) = (8, 2048);

/// Information in one input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Excitation {
    /// Input.
    pub input: String,
    /// Frequency \[Hz\] below which 99 % of the power of its changes lie.
    pub band: f64,
    /// The same as a share of the band up to half the sample rate.
    pub share_of_band: f64,
    /// Order of persistence of excitation: number of coefficients on past values that it can distinguish; at most 20
    /// are tried.
    pub order: usize,
}

/// Looks at the inputs of all records.
///
/// # Errors
/// Errors of reading the records.
pub fn excitation(
    sources: &[&dyn Source],
    inputs: &[String],
    sample_time: f64,
) -> Result<Vec<Excitation>, Error> {
    let n_u = inputs.len();
    let mut spectra = vec![vec![0.0; SEGMENT / 2 + 1]; n_u];
    let mut news: Vec<StreamedQr> = (0..n_u).map(|_| StreamedQr::new(MOST_ORDERS)).collect();
    let mut fft = Fft::new(SEGMENT);
    for source in sources {
        let distance = (source.samples() / STRETCHES.0).max(1);
        let mut segments: Vec<Vec<f64>> = vec![Vec::with_capacity(SEGMENT); n_u];
        source.windows(MOST_ORDERS, &mut |window| {
            for j in 0..n_u {
                let column = window.inputs[j];
                for &value in &column[window.before..] {
                    segments[j].push(value);
                    if segments[j].len() == SEGMENT {
                        fft.add_power(&segments[j], &mut spectra[j]);
                        segments[j].clear();
                    }
                }
                let from = window.before.max(MOST_ORDERS.saturating_sub(window.at - window.before));
                let looked_at = |row: &usize| (window.at - window.before + row) % distance < STRETCHES.1;
                let rows: Vec<usize> = (from..window.len()).filter(looked_at).collect();
                let mut rows = rows.as_slice();
                while !rows.is_empty() {
                    let (some, rest) = rows.split_at(rows.len().min(news[j].space()));
                    news[j].append(some.len(), |lag, out| {
                        out.iter_mut().zip(some).for_each(|(out, row)| *out = column[row - lag]);
                    });
                    rows = rest;
                }
            }
        })?;
        // A record shorter than a segment still has a spectrum.
        for (segment, spectrum) in segments.iter().zip(&mut spectra) {
            if source.samples() < SEGMENT {
                fft.add_power(segment, spectrum);
            }
        }
    }
    let nyquist = 0.5 / sample_time;
    let found = inputs.iter().zip(&spectra).zip(news).map(|((input, spectrum), news)| {
        let share = band(spectrum);
        let triangle = news.finish();
        let dependent = triangle.dependent(MOST_ORDERS, MIN_NEW_SHARE);
        let order = dependent.map_or(MOST_ORDERS, |dependent| dependent.column);
        Excitation { input: input.clone(), band: share * nyquist, share_of_band: share, order }
    });
    Ok(found.collect())
}

/// Share of the band below which most of the power lies.
fn band(spectrum: &[f64]) -> f64 {
    let all: f64 = spectrum.iter().sum();
    let mut below = 0.0;
    for (bin, power) in spectrum.iter().enumerate() {
        below += power;
        if below >= SHARE_OF_POWER_IN_BAND * all {
            return (bin as f64 + 0.5).min((spectrum.len() - 1) as f64) / (spectrum.len() - 1) as f64;
        }
    }
    1.0
}

/// Fourier transform of segments, with its tables.
struct Fft {
    /// `exp(-2 pi i k / n)`, shape \[n / 2\].
    turns: Vec<(f64, f64)>,
    window: Vec<f64>,
    work: Vec<(f64, f64)>,
}

impl Fft {
    fn new(n: usize) -> Fft {
        let angle = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
        Fft {
            turns: (0..n / 2).map(|k| (angle(k).cos(), -angle(k).sin())).collect(),
            window: (0..n).map(|k| 0.5 - 0.5 * angle(k).cos()).collect(),
            work: vec![(0.0, 0.0); n],
        }
    }

    /// Adds the power of a segment about its mean (Hann window) to the spectrum, zeros appended if it is short.
    fn add_power(&mut self, segment: &[f64], spectrum: &mut [f64]) {
        let n = self.work.len();
        let mean = segment.iter().sum::<f64>() / segment.len().max(1) as f64;
        let bits = n.trailing_zeros();
        for (k, window) in self.window.iter().enumerate() {
            let value = segment.get(k).map_or(0.0, |value| (value - mean) * window);
            self.work[k.reverse_bits() >> (usize::BITS - bits)] = (value, 0.0);
        }
        let mut half = 1;
        while half < n {
            let stride = n / (2 * half);
            for block in self.work.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let (c, s) = self.turns[k * stride];
                    let turned = (b.0 * c - b.1 * s, b.0 * s + b.1 * c);
                    *b = (a.0 - turned.0, a.1 - turned.1);
                    *a = (a.0 + turned.0, a.1 + turned.1);
                }
            }
            half *= 2;
        }
        for (power, value) in spectrum.iter_mut().zip(&self.work) {
            *power += value.0 * value.0 + value.1 * value.1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Record;

    fn of(values: Vec<f64>) -> Excitation {
        let record = Record { sample_time: 1e-3, inputs: vec![values], ..Record::default() };
        excitation(&[&record], &["u".into()], 1e-3).unwrap().remove(0)
    }

    #[test]
    fn tones_excite_two_coefficients_each() {
        let tones = |count: usize| -> Vec<f64> {
            (0..5000)
                .map(|k| (1..=count).map(|m| (0.31 * (m * m * k) as f64 + m as f64).sin()).sum())
                .collect()
        };
        assert_eq!([1, 2, 4].map(|count| of(tones(count)).order), [2, 4, 8]);
    }

    #[test]
    fn the_band_of_a_chirp_ends_where_the_chirp_ends() {
        let n = 40_000;
        let phase = |t: f64| std::f64::consts::TAU * (0.1 * t + 0.5 * 49.9 * t * t / (n as f64 * 1e-3));
        let found = of((0..n).map(|k| phase(k as f64 * 1e-3).sin()).collect());
        assert!((found.band - 50.0).abs() < 3.0, "{found:?}");
        assert!((found.share_of_band - found.band / 500.0).abs() < 1e-12);
    }

    #[test]
    fn noise_excites_everything() {
        let mut state = 1u64;
        let noise = (0..600).map(|_| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64
        });
        let found = of(noise.collect());
        assert!(found.order == MOST_ORDERS && found.share_of_band > 0.95, "{found:?}");
    }
}
