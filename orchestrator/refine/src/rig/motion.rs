//! The motion behind noisy records of position and speed: Kalman filter and Rauch-Tung-Striebel smoother.
//!
//! Position, speed, acceleration and jerk are a chain of integrators driven by white noise; its intensity is the one
//! that makes one of the records most likely.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

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
    /// Measured position less its prediction from all samples before \[m\]; empty: it is not measured.
    pub innovations: Vec<f64>,
    /// Standard deviations of the innovations \[m\].
    pub deviations: Vec<f64>,
}

struct Filtered {
    prior: Vec<(Vector4<f64>, Matrix4<f64>)>,
    posterior: Vec<(Vector4<f64>, Matrix4<f64>)>,
    innovations: Vec<f64>,
    deviations: Vec<f64>,
    /// Twice the negative logarithm of the likelihood, up to a constant.
    cost: f64,
}

/// One record: values and noise rms.
pub type Record<'a> = (&'a [f64], f64);

/// The intensity that makes the record of the speed, or else that of the position, most likely: one sensor alone, since
/// two may contradict each other.
pub fn intensity(x: Option<Record>, v: Option<Record>, dt: f64) -> f64 {
    let (x, v) = if v.is_some() { (None, v) } else { (x, None) };
    let filter = |x, v, dt, intensity| filter(x, v, MotionProcess { dt, intensity, late: [0.0; 2] });
    let runs =
        (8..56).map(|power| 10f64.powf(0.25 * f64::from(power))).map(|q| (q, filter(x, v, dt, q).cost));
    runs.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(1.0, |(q, _)| q)
}

/// Prior knowledge of a motion and its records.
#[derive(Debug, Clone, Copy)]
pub struct MotionProcess {
    /// Sample time \[s\].
    pub dt: f64,
    /// See [`intensity`].
    pub intensity: f64,
    /// How late the sensors of position and speed are \[s\].
    pub late: [f64; 2],
}

/// Time \[s\] by which positions are sampled before the speeds of the same rows, so that they are late, if less than a
/// sample: two sensors that are read one after the other. Anything more is an effect of a sensor.
///
/// Found by least squares over all records (positions, speeds): the position is the integral of the speed, up to an
/// initial value, an offset and a gain of the speed, and the distance covered within the skew.
pub fn skew(records: &[[&[f64]; 2]], dt: f64) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for [x, v] in records {
        let n = x.len().min(v.len());
        let mut covered = vec![0.0; n];
        for k in 1..n {
            covered[k] = covered[k - 1] + 0.5 * (v[k] + v[k - 1]) * dt;
        }
        let lacking = DVector::from_fn(n, |k, _| x[k] - covered[k]);
        let others = DMatrix::from_fn(n, 3, |k, j| [1.0, k as f64 * dt, covered[k]][j]);
        // What the speed and the position have beyond the other regressors.
        let basis = others.qr().q();
        let beyond = |column: DVector<f64>| &column - &basis * (basis.transpose() * &column);
        let speed = beyond(DVector::from_row_slice(&v[..n]));
        product += speed.dot(&beyond(lacking));
        square += speed.norm_squared();
    }
    let found = if square > 0.0 { -product / square } else { 0.0 };
    if found.abs() < 0.75 * dt { found } else { 0.0 }
}

/// Smooths records of position and speed; either may be missing.
pub fn smooth(x: Option<Record>, v: Option<Record>, process: MotionProcess) -> Motion {
    let best = filter(x, v, process);
    let dt = process.dt;
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
        innovations: best.innovations,
        deviations: best.deviations,
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

fn filter(x: Option<Record>, v: Option<Record>, process: MotionProcess) -> Filtered {
    let MotionProcess { dt, intensity, late: [dx, dv] } = process;
    let n = x.or(v).map_or(0, |(values, _)| values.len());
    let f = transition(dt);
    let noise = Matrix4::from_fn(|i, j| {
        let power = 7 - i - j;
        let factorial = |n: usize| (1..=n).product::<usize>() as f64;
        intensity * dt.powi(power as i32) / (power as f64 * factorial(3 - i) * factorial(3 - j))
    });
    let mut mean = Vector4::new(x.map_or(0.0, |r| r.0[0]), v.map_or(0.0, |r| r.0[0]), 0.0, 0.0);
    let mut covariance = Matrix4::from_diagonal(&Vector4::new(1e-4, 1.0, 1e3, 1e6));
    let mut found = Filtered {
        prior: Vec::with_capacity(n),
        posterior: Vec::with_capacity(n),
        innovations: Vec::with_capacity(n),
        deviations: Vec::with_capacity(n),
        cost: 0.0,
    };
    for k in 0..n {
        if k > 0 {
            mean = f * mean;
            covariance = f * covariance * f.transpose() + noise;
        }
        found.prior.push((mean, covariance));
        // What a sensor shows that is late: the series of Taylor.
        let rows = [
            Vector4::new(1.0, -dx, dx * dx / 2.0, -dx.powi(3) / 6.0),
            Vector4::new(0.0, 1.0, -dv, dv * dv / 2.0),
        ];
        for (i, (row, record)) in rows.iter().zip([x, v]).enumerate() {
            let Some((values, rms)) = record else { continue };
            let seen = covariance * row;
            let variance = seen.dot(row) + rms * rms;
            let innovation = values[k] - mean.dot(row);
            let gain = seen / variance;
            mean += gain * innovation;
            covariance -= gain * seen.transpose();
            covariance = (covariance + covariance.transpose()) * 0.5;
            if i == 0 {
                found.innovations.push(innovation);
                found.deviations.push(variance.sqrt());
            }
            found.cost += innovation * innovation / variance + variance.ln();
        }
        found.posterior.push((mean, covariance));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::noise::Noise;

    #[test]
    fn a_noisy_sine_is_recovered_ten_times_better_than_measured() {
        let (dt, w) = (1e-3, std::f64::consts::TAU * 2.0);
        let mut noise = Noise::new(5, 0);
        let n = 2000;
        let x: Vec<f64> = (0..n).map(|k| 0.02 * (w * k as f64 * dt).sin() + 1e-4 * noise.normal()).collect();
        let v: Vec<f64> =
            (0..n).map(|k| 0.02 * w * (w * k as f64 * dt).cos() + 1e-3 * noise.normal()).collect();
        let (x, v) = (Some((&x[..], 1e-4)), Some((&v[..], 1e-3)));
        let motion = smooth(x, v, MotionProcess { dt, intensity: intensity(x, v, dt), late: [0.0; 2] });
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

    #[test]
    fn the_skew_between_two_sensors_is_found_beside_a_gain_and_an_offset() {
        let (dt, w) = (1e-3, std::f64::consts::TAU * 1.3);
        let mut noise = Noise::new(6, 0);
        let mut record = |late: f64| -> [Vec<f64>; 2] {
            let at = |k: usize| w * k as f64 * dt;
            let x = (0..3000).map(|k| 0.02 * (at(k) - w * late).sin() + 1e-4 * noise.normal()).collect();
            let v: Vec<f64> =
                (0..3000).map(|k| 0.01 + 1.04 * 0.02 * w * at(k).cos() + 1e-3 * noise.normal()).collect();
            [x, v]
        };
        let mut found = |late: f64| {
            let records = [record(late), record(late)];
            skew(&records.each_ref().map(|[x, v]| [&x[..], &v[..]]), dt)
        };
        // Noise of 0.1 mm over 6000 samples at 0.11 m/s: some 12 us.
        assert!((found(0.4e-3) - 0.4e-3).abs() < 5e-5);
        assert_eq!(found(4e-3), 0.0);
    }
}
