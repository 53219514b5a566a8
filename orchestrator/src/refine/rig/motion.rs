//! The motion behind noisy records of position and speed: Kalman filter and Rauch-Tung-Striebel smoother.
//!
//! Position, speed, acceleration and jerk are a chain of integrators driven by white noise; its intensity is the one
//! that makes the records most likely.

use nalgebra::{Matrix4, Vector4};

/// Smoothed motion, each of shape \[n\].
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Position \[m\].
    pub x: Vec<f64>,
    /// Speed \[m/s\].
    pub v: Vec<f64>,
    /// Acceleration \[m/s2\].
    pub a: Vec<f64>,
    /// Variance of the speed \[m2/s2\].
    pub variance_v: Vec<f64>,
    /// Variance of the acceleration \[m2/s4\].
    pub variance_a: Vec<f64>,
}

struct Filtered {
    prior: Vec<(Vector4<f64>, Matrix4<f64>)>,
    posterior: Vec<(Vector4<f64>, Matrix4<f64>)>,
    /// Twice the negative logarithm of the likelihood, up to a constant.
    cost: f64,
}

/// One record: values and noise rms.
type Record<'a> = (&'a [f64], f64);

/// Smooths records of position and speed sampled every `dt` \[s\]; either may be missing.
pub fn smooth(x: Option<Record>, v: Option<Record>, dt: f64) -> Motion {
    let runs = (2..14).map(|power| filter(x, v, dt, 10f64.powi(power)));
    let Some(best) = runs.min_by(|a, b| a.cost.total_cmp(&b.cost)) else { return Motion::default() };
    let transition = transition(dt);
    let n = best.posterior.len();
    let mut smoothed = best.posterior.clone();
    for k in (0..n.saturating_sub(1)).rev() {
        let (mean, covariance) = best.posterior[k];
        let (prior, prior_covariance) = best.prior[k + 1];
        let Some(inverse) = scaled_inverse(prior_covariance) else { continue };
        let gain = covariance * transition.transpose() * inverse;
        let (next, next_covariance) = smoothed[k + 1];
        smoothed[k] = (
            mean + gain * (next - prior),
            covariance + gain * (next_covariance - prior_covariance) * gain.transpose(),
        );
    }
    Motion {
        x: smoothed.iter().map(|(m, _)| m[0]).collect(),
        v: smoothed.iter().map(|(m, _)| m[1]).collect(),
        a: smoothed.iter().map(|(m, _)| m[2]).collect(),
        variance_v: smoothed.iter().map(|(_, p)| p[(1, 1)].max(0.0)).collect(),
        variance_a: smoothed.iter().map(|(_, p)| p[(2, 2)].max(0.0)).collect(),
    }
}

/// The inverse of a covariance whose entries differ by many orders of magnitude.
fn scaled_inverse(p: Matrix4<f64>) -> Option<Matrix4<f64>> {
    let scale = Matrix4::from_diagonal(&p.diagonal().map(|value| value.max(1e-300).sqrt().recip()));
    Some(scale * (scale * p * scale).try_inverse()? * scale)
}

fn transition(dt: f64) -> Matrix4<f64> {
    Matrix4::new(
        1.0,
        dt,
        dt * dt / 2.0,
        dt.powi(3) / 6.0, //
        0.0,
        1.0,
        dt,
        dt * dt / 2.0, //
        0.0,
        0.0,
        1.0,
        dt, //
        0.0,
        0.0,
        0.0,
        1.0,
    )
}

fn filter(x: Option<Record>, v: Option<Record>, dt: f64, intensity: f64) -> Filtered {
    let n = x.or(v).map_or(0, |(values, _)| values.len());
    let f = transition(dt);
    let noise = Matrix4::from_fn(|i, j| {
        let power = 7 - i - j;
        let factorial = |n: usize| (1..=n).product::<usize>() as f64;
        intensity * dt.powi(power as i32) / (power as f64 * factorial(3 - i) * factorial(3 - j))
    });
    let mut mean = Vector4::new(x.map_or(0.0, |r| r.0[0]), v.map_or(0.0, |r| r.0[0]), 0.0, 0.0);
    let mut covariance = Matrix4::from_diagonal(&Vector4::new(1e-4, 1.0, 1e3, 1e6));
    let mut found = Filtered { prior: Vec::with_capacity(n), posterior: Vec::with_capacity(n), cost: 0.0 };
    for k in 0..n {
        if k > 0 {
            mean = f * mean;
            covariance = f * covariance * f.transpose() + noise;
        }
        found.prior.push((mean, covariance));
        for (row, record) in [(0, x), (1, v)] {
            let Some((values, rms)) = record else { continue };
            let variance = covariance[(row, row)] + rms * rms;
            let innovation = values[k] - mean[row];
            let gain = covariance.column(row) / variance;
            mean += gain * innovation;
            let row_of = covariance.row(row).into_owned();
            covariance -= gain * row_of;
            covariance = (covariance + covariance.transpose()) * 0.5;
            found.cost += innovation * innovation / variance + variance.ln();
        }
        found.posterior.push((mean, covariance));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::engine::noise::Noise;

    #[test]
    fn a_noisy_sine_is_recovered_ten_times_better_than_measured() {
        let (dt, w) = (1e-3, std::f64::consts::TAU * 2.0);
        let mut noise = Noise::new(5, 0);
        let n = 2000;
        let x: Vec<f64> = (0..n).map(|k| 0.02 * (w * k as f64 * dt).sin() + 1e-4 * noise.normal()).collect();
        let v: Vec<f64> =
            (0..n).map(|k| 0.02 * w * (w * k as f64 * dt).cos() + 1e-3 * noise.normal()).collect();
        let motion = smooth(Some((&x, 1e-4)), Some((&v, 1e-3)), dt);
        let rms = |f: &dyn Fn(usize) -> f64| {
            ((100..n - 100).map(|k| f(k).powi(2)).sum::<f64>() / (n - 200) as f64).sqrt()
        };
        let error_v = rms(&|k| motion.v[k] - 0.02 * w * (w * k as f64 * dt).cos());
        let error_a = rms(&|k| motion.a[k] + 0.02 * w * w * (w * k as f64 * dt).sin());
        assert!(error_v < 3e-4, "{error_v}");
        assert!(error_a < 0.03, "{error_a}");
        // The variance that the smoother states is that of its error, within a factor.
        let stated = motion.variance_v[n / 2].sqrt();
        assert!(error_v < 2.0 * stated && stated < 2.0 * error_v, "{error_v} {stated}");
    }
}
