//! Sums of sines with equal amplitudes, whose phases keep the peak low: random ones or those of Schroeder (IEEE
//! Transactions on Information Theory 16, 1970), improved by clipping in turn.

use std::f64::consts::{PI, TAU};

use super::fourier::transform;
use super::{Band, Error, check};
use airloop_series::random::Random;

/// Largest multiple of the inverse of the period: phases are found in a table of eight times as many samples.
const MAX_HARMONIC: f64 = 4e6;

/// Random starts; the best of them is another signal for another seed.
const STARTS: usize = 8;
/// Rounds of clipping per start.
const ROUNDS: usize = 300;
/// Number of sines above which there is only one start, Schroeder's phases moved in time: each round is a transform
/// over eight points per shortest wave.
const MAX_SINES_OF_SEVERAL_STARTS: usize = 4096;
/// Most products of sines and samples, each of which is a cosine: half a minute.
const MAX_COSINES: f64 = 2e9;

/// `n` samples of all multiples of 1 / `period` in the band, peak 1.
pub(super) fn samples(
    band: &Band,
    period: f64,
    n: usize,
    sample_time: f64,
    seed: u64,
) -> Result<Vec<f64>, Error> {
    let (low, high) = (band.start.min(band.end), band.start.max(band.end));
    let harmonics =
        ((low * period - 1e-9).ceil().max(1.0) as usize)..=((high * period + 1e-9).floor() as usize);
    check("the period", period, "s", !harmonics.is_empty(), || {
        format!("no multiple of its inverse is in the band {low} to {high} Hz; take at least {} s", 1.0 / low)
    })?;
    let count = (harmonics.end() - harmonics.start() + 1) as f64;
    let most = (MAX_COSINES / n as f64).floor();
    check("the number of sines", count, "", count <= most, || {
        format!("with {n} samples at most {most}; take a narrower band, a shorter signal or a shorter period")
    })?;
    check("the period", period, "s", high * period <= MAX_HARMONIC, || {
        format!("with a band up to {high} Hz at most {:.3e} s", MAX_HARMONIC / high)
    })?;
    let sines: Vec<usize> = harmonics.collect();
    let mut random = Random::new(seed);
    let mut best = (f64::INFINITY, Vec::new());
    let moved = random.uniform();
    let starts = if sines.len() > MAX_SINES_OF_SEVERAL_STARTS { 1 } else { STARTS };
    for _ in 0..starts {
        let mut phases: Vec<f64> = if starts == 1 {
            let schroeder = schroeder(sines.len());
            sines.iter().zip(schroeder).map(|(h, phase)| phase + TAU * moved * *h as f64).collect()
        } else {
            sines.iter().map(|_| TAU * random.uniform()).collect()
        };
        let peak = lower_peak(&sines, &mut phases);
        if peak < best.0 {
            best = (peak, phases);
        }
    }
    let mut samples = vec![0.0; n];
    for (&harmonic, phase) in sines.iter().zip(&best.1) {
        let turn = harmonic as f64 * sample_time / period;
        for (k, sample) in samples.iter_mut().enumerate() {
            *sample += (TAU * (turn * k as f64).fract() + phase).cos();
        }
    }
    let peak = samples.iter().fold(0.0, |peak: f64, sample| peak.max(sample.abs()));
    samples.iter_mut().for_each(|sample| *sample /= peak);
    Ok(samples)
}

/// Phases of a low peak for a flat spectrum (Schroeder 1970).
fn schroeder(count: usize) -> Vec<f64> {
    (0..count).map(|k| -PI * (k * (k + 1)) as f64 / count as f64).collect()
}

/// Lowers the peak by clipping in time and keeping only the phases of what results (Van der Ouderaa, Schoukens,
/// Renneboog 1988); leaves the best phases met and gives their peak over the root mean square.
fn lower_peak(sines: &[usize], phases: &mut Vec<f64>) -> f64 {
    let last = sines.last().copied().unwrap_or(1);
    let n = (8 * (last + 1)).next_power_of_two();
    let mut best = (f64::INFINITY, phases.clone());
    let mut trial = phases.clone();
    for round in 0..ROUNDS {
        let (mut re, mut im) = (vec![0.0; n], vec![0.0; n]);
        for (&harmonic, phase) in sines.iter().zip(&trial) {
            (im[harmonic], re[harmonic]) = phase.sin_cos();
        }
        transform(&mut re, &mut im, true);
        let peak = re.iter().fold(0.0, |peak: f64, value| peak.max(value.abs()));
        let crest = peak / (0.5 * sines.len() as f64).sqrt();
        if crest < best.0 {
            best = (crest, trial.clone());
        }
        // Gentler clipping toward the end lets the peak settle.
        let level = peak * (0.80 + 0.18 * round as f64 / ROUNDS as f64);
        for value in &mut re {
            *value = value.clamp(-level, level);
        }
        im.fill(0.0);
        transform(&mut re, &mut im, false);
        for (phase, &harmonic) in trial.iter_mut().zip(sines) {
            *phase = im[harmonic].atan2(re[harmonic]);
        }
    }
    *phases = best.1;
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excite::Size;

    #[test]
    fn power_stands_at_the_lines_of_the_band_alone_and_is_flat() {
        // 1024 samples of one period, so that the transform has no leakage.
        let samples = samples(&(3.0..40.0), 1.0, 1024, 1.0 / 1024.0, 1).unwrap();
        let (mut re, mut im) = (samples.clone(), vec![0.0; 1024]);
        transform(&mut re, &mut im, false);
        let sizes: Vec<f64> = re.iter().zip(&im).map(|(a, b)| a.hypot(*b)).collect();
        for (k, size) in sizes[..512].iter().enumerate() {
            let expected = if (3..=40).contains(&k) { sizes[3] } else { 0.0 };
            assert!((size - expected).abs() < 1e-9 * sizes[3], "line {k}: {size}");
        }
    }

    #[test]
    fn the_peak_is_lower_than_that_of_schroeder_and_far_lower_than_that_of_a_pulse() {
        let samples = samples(&(0.1..12.0), 10.0, 10_000, 1e-3, 1).unwrap();
        let crest = Size::of(&samples, 0.0).crest_factor;
        // Schroeder's phases reach some 1.7, all phases equal sqrt(2 * 120) = 15; published searches end near 1.4.
        assert!(crest < 1.55, "{crest}");
    }

    #[test]
    fn another_seed_gives_another_signal() {
        let of = |seed| samples(&(0.5..4.0), 4.0, 400, 0.01, seed).unwrap();
        let (a, b) = (of(1), of(2));
        let product: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        let size: f64 = a.iter().map(|a| a * a).sum();
        assert!((product / size).abs() < 0.9 && a == of(1), "{}", product / size);
    }

    #[test]
    fn more_sines_than_can_be_summed_are_refused_at_once() {
        let message = samples(&(1e-5..499.0), 9e4, 90_000_000, 1e-3, 1).unwrap_err().to_string();
        assert!(message.contains("the number of sines") && message.contains("at most 22"), "{message}");
    }

    #[test]
    fn a_period_without_a_line_in_the_band_is_refused() {
        let message = samples(&(0.1..0.4), 2.0, 1000, 1e-3, 1).unwrap_err().to_string();
        assert!(message.contains("at least 10 s"), "{message}");
    }
}
