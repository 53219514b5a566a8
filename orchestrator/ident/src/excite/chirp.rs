//! A sine whose frequency runs through a band.

use std::f64::consts::TAU;

use super::Band;

/// Change of the frequency over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sweep {
    /// The same time for every hertz.
    Linear,
    /// The same time for every octave.
    Logarithmic,
}

/// `n` samples of a chirp of amplitude 1 that starts at 0.
pub(super) fn samples(band: &Band, sweep: Sweep, n: usize, sample_time: f64) -> Vec<f64> {
    let duration = n as f64 * sample_time;
    let (f0, f1) = (band.start, band.end);
    let ratio = (f1 / f0).ln();
    let cycles = |t: f64| match sweep {
        Sweep::Logarithmic if ratio.abs() > 1e-9 => f0 * duration / ratio * (ratio * t / duration).exp_m1(),
        _ => f0 * t + 0.5 * (f1 - f0) * t * t / duration,
    };
    // Whole cycles are taken off first, so that the sine keeps its digits in long records.
    (0..n).map(|k| (TAU * cycles(k as f64 * sample_time).fract()).sin()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frequency from the times of rising zero crossings, found by linear interpolation.
    fn frequency_near(samples: &[f64], ts: f64, time: f64) -> f64 {
        let crossings: Vec<f64> = (1..samples.len())
            .filter(|&k| samples[k - 1] < 0.0 && samples[k] >= 0.0)
            .map(|k| (k as f64 - samples[k] / (samples[k] - samples[k - 1])) * ts)
            .collect();
        let after = crossings.iter().position(|&t| t > time).unwrap();
        1.0 / (crossings[after] - crossings[after - 1])
    }

    #[test]
    fn the_frequency_runs_through_the_band() {
        let (ts, n) = (1e-3, 60_000);
        let linear = samples(&(0.5..10.5), Sweep::Linear, n, ts);
        // Within a cycle the frequency moves by 10 Hz / 60 s / f.
        assert!((frequency_near(&linear, ts, 30.0) - 5.5).abs() < 0.05);
        assert!((frequency_near(&linear, ts, 59.5) - 10.42).abs() < 0.05);
        let octaves = samples(&(1.0..16.0), Sweep::Logarithmic, n, ts);
        assert!((frequency_near(&octaves, ts, 30.0) - 4.0).abs() < 0.06);
        let down = samples(&(16.0..1.0), Sweep::Logarithmic, n, ts);
        assert!((frequency_near(&down, ts, 45.0) - 2.0).abs() < 0.06);
    }
}
