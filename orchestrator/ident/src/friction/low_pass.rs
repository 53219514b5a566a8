//! Butterworth low-pass of order 4 without phase: once forwards, once backwards.

use std::f64::consts::PI;

/// A low-pass for samples at one rate.
#[derive(Debug, Clone)]
pub struct LowPass {
    sections: [Section; 2],
    /// Samples by which records are continued at both ends.
    pad: usize,
}

/// `y = b0 (u + 2 u1 + u2) - a1 y1 - a2 y2`
#[derive(Debug, Clone, Copy)]
struct Section {
    b0: f64,
    a1: f64,
    a2: f64,
}

impl LowPass {
    /// Corner frequency \[Hz\] (where one pass halves the power) and sample time \[s\]; none if the corner is not below
    /// half the sample rate.
    pub fn new(corner: f64, sample_time: f64) -> Option<LowPass> {
        let share = corner * sample_time;
        if !(share > 0.0 && share < 0.5) {
            return None;
        }
        let warped = (PI * share).tan();
        let section = |damping: f64| {
            // Bilinear transformation of 1/(s^2 + damping s + 1).
            let norm = 1.0 + damping * warped + warped * warped;
            let a1 = 2.0 * (warped * warped - 1.0) / norm;
            let a2 = (1.0 - damping * warped + warped * warped) / norm;
            Section { b0: warped * warped / norm, a1, a2 }
        };
        let damping = |k: f64| 2.0 * (PI / 8.0 * k).cos();
        Some(LowPass {
            sections: [section(damping(1.0)), section(damping(3.0))],
            pad: (1.0 / share) as usize + 12,
        })
    }

    /// Filters `values` \[n\] in place, forward and backward, so without delay. The record is continued at both ends,
    /// turned about its end points, so that the filter has settled where it begins.
    pub fn both_ways(&self, values: &mut [f64]) {
        let n = values.len();
        if n < 2 {
            return;
        }
        let pad = self.pad.min(n - 1);
        let (first, last) = (values[0], values[n - 1]);
        let before = (1..=pad).rev().map(|k| 2.0 * first - values[k]);
        let after = (1..=pad).map(|k| 2.0 * last - values[n - 1 - k]);
        let mut extended: Vec<f64> = before.chain(values.iter().copied()).chain(after).collect();
        for _ in 0..2 {
            for section in &self.sections {
                section.run(&mut extended);
            }
            extended.reverse();
        }
        values.copy_from_slice(&extended[pad..pad + n]);
    }
}

impl Section {
    fn run(&self, values: &mut [f64]) {
        // As if the first value had been there for ever.
        let start = values.first().copied().unwrap_or(0.0);
        let (mut u1, mut u2, mut y1, mut y2) = (start, start, start, start);
        for value in values {
            let y = self.b0 * (*value + 2.0 * u1 + u2) - self.a1 * y1 - self.a2 * y2;
            (u2, u1) = (u1, *value);
            (y2, y1) = (y1, y);
            *value = y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest value in the middle of a filtered sine of amplitude 1.
    fn gain(frequency: f64) -> f64 {
        let filter = LowPass::new(40.0, 1e-3).unwrap();
        let mut values: Vec<f64> =
            (0..4000).map(|k| (2.0 * PI * frequency * f64::from(k) * 1e-3).sin()).collect();
        let pure = values.clone();
        filter.both_ways(&mut values);
        let (mut up, mut down) = (0.0, 0.0);
        for k in 1000..3000 {
            up += values[k] * pure[k];
            down += pure[k] * pure[k];
        }
        up / down
    }

    #[test]
    fn two_passes_halve_the_amplitude_at_the_corner_and_keep_the_phase() {
        // |H|^2 = 1/(1 + r^8) with r the ratio of the warped frequencies; both passes multiply to |H|^2.
        let expected = |f: f64| 1.0 / (1.0 + ((PI * f * 1e-3).tan() / (PI * 0.04).tan()).powi(8));
        for frequency in [5.0, 40.0, 50.0, 80.0] {
            assert!((gain(frequency) - expected(frequency)).abs() < 2e-4, "{frequency}: {}", gain(frequency));
        }
        assert!(LowPass::new(600.0, 1e-3).is_none());
    }

    #[test]
    fn a_straight_line_stays() {
        let mut values: Vec<f64> = (0..200).map(|k| 3.0 - 0.1 * f64::from(k)).collect();
        let before = values.clone();
        LowPass::new(40.0, 1e-3).unwrap().both_ways(&mut values);
        assert!(values.iter().zip(&before).all(|(a, b)| (a - b).abs() < 1e-2));
    }
}
