//! Errors of a friction law on a track: of the force predicted from the motion, or of the motion from the force.

use super::law::{C1, C2, C4, Dahl, E1, Law, MASS, Parameters};
use super::low_pass::LowPass;
use super::track::Track;

/// Predicted quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Predict {
    /// The force, from the smoothed motion: `m a + f(v)`. For sweeps, and wherever the force is measured well.
    Force,
    /// The position, from the force: `m v' = F - f(v)`, simulated anew from the smoothed motion at the start of each
    /// window.
    Motion {
        /// Length of a window \[s\].
        window: f64,
        /// Whether the force is held over each sample; else it runs straight between samples.
        held: bool,
    },
}

/// Most steps of the integrator within a sample.
const MOST_SUBSTEPS: f64 = 200.0;

/// Number of errors on a track.
pub fn count(predict: &Predict, track: &Track) -> usize {
    match predict {
        Predict::Force => track.len(),
        Predict::Motion { window, .. } => {
            windows(track, *window).iter().map(|(from, to)| to - from - 1).sum()
        }
    }
}

/// First and one past the last sample of each whole window.
fn windows(track: &Track, length: f64) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let (mut from, n) = (0, track.len());
    while from + 1 < n {
        let end = track.time[from] + length * (1.0 + 1e-9);
        let to = from + track.time[from..].partition_point(|t| *t <= end);
        let complete = track.time[n - 1] >= track.time[from] + length * (1.0 - 1e-6);
        if to < from + 2 || (!complete && !found.is_empty()) {
            break;
        }
        found.push((from, to));
        from = to - 1;
    }
    found
}

/// Fills measured minus predicted values, shape \[[`count`]\]; false if they cannot be computed.
pub fn errors(
    predict: &Predict,
    law: Law,
    c: &Parameters,
    track: &Track,
    low_pass: Option<&LowPass>,
    errors: &mut [f64],
) -> bool {
    match *predict {
        Predict::Force => {
            force(law, c, track, errors);
            for (error, measured) in errors.iter_mut().zip(&track.force) {
                *error = measured - *error;
            }
            if let Some(filter) = low_pass {
                filter.both_ways(errors);
            }
            true
        }
        Predict::Motion { window, held } => {
            let mut at = 0;
            for (from, to) in windows(track, window) {
                let part = &mut errors[at..at + to - from - 1];
                if !position(law, c, track, from, held, part) {
                    return false;
                }
                at += to - from - 1;
            }
            true
        }
    }
}

/// Fills the predicted force \[N\], shape \[n\].
pub fn force(law: Law, c: &Parameters, track: &Track, out: &mut [f64]) {
    let motion = &track.motion;
    if law == Law::Presliding {
        let mut spring = Dahl::sliding(c, motion.velocity[0]);
        for (k, out) in out.iter_mut().enumerate() {
            if k > 0 {
                let dt = track.time[k] - track.time[k - 1];
                spring.advance(c, 0.5 * (motion.velocity[k - 1] + motion.velocity[k]), dt);
            }
            *out = spring.force(c, motion.velocity[k]) + c[MASS] * motion.acceleration[k];
        }
        return;
    }
    for (k, out) in out.iter_mut().enumerate() {
        let (v, x) = (motion.velocity[k], motion.position[k]);
        let f = law.mean_force(c, v, motion.velocity_deviation[k], x, track.pressure[k]);
        *out = f + c[MASS] * motion.acceleration[k];
    }
}

/// Simulates one window with the classic Runge-Kutta method; fills measured minus simulated positions.
fn position(law: Law, c: &Parameters, track: &Track, from: usize, held: bool, errors: &mut [f64]) -> bool {
    let mass = c[MASS];
    let positions = track.measured_position.as_ref().unwrap_or(&track.motion.position);
    let (mut x, mut v) = (track.motion.position[from], track.motion.velocity[from]);
    // The steepest slope of the friction sets the fastest time constant.
    let slope = c[C1] * c[C2] + c[C4] + if law == Law::Stribeck { c[E1] * c[C2] } else { 0.0 };
    for (error, k) in errors.iter_mut().zip(from..) {
        let dt = track.time[k + 1] - track.time[k];
        let substeps = (slope / mass * dt).ceil().max(1.0);
        if substeps.is_nan() || substeps > MOST_SUBSTEPS {
            return false;
        }
        let h = dt / substeps;
        let (f0, p) = (track.force[k], track.pressure[k]);
        let rise = if held { 0.0 } else { (track.force[k + 1] - f0) / dt };
        for step in 0..substeps as usize {
            let begin = step as f64 * h;
            let a = |t: f64, x: f64, v: f64| (f0 + rise * t - law.force(c, v, x, p)) / mass;
            let a1 = a(begin, x, v);
            let (v2, x2) = (v + 0.5 * h * a1, x + 0.5 * h * v);
            let a2 = a(begin + 0.5 * h, x2, v2);
            let (v3, x3) = (v + 0.5 * h * a2, x + 0.5 * h * v2);
            let a3 = a(begin + 0.5 * h, x3, v3);
            let (v4, x4) = (v + h * a3, x + h * v3);
            let a4 = a(begin + h, x4, v4);
            x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
        }
        *error = positions[k + 1] - x;
    }
    true
}
