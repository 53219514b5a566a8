//! Position, velocity and acceleration from noisy records, with the uncertainty of the velocity.
//!
//! Kalman filter and smoother (Bryson and Frazier, which inverts no matrix) of a motion whose jerk is white noise (the
//! acceleration is a Wiener process): between samples the motion is a cubic in the mean. It looks ahead as far as back,
//! so that neither the time nor the height of a reversal is shifted systematically, and takes uneven sample times as
//! they are. Sensor noise comes from how far each sample is from the cubic through its neighbors, the intensity of the
//! jerk from the likelihood of the record. The smoothed velocity is the mean of what the velocity may have been, given
//! the record, and `velocity_deviation` its spread: an expectation over it has no errors-in-variables bias.

use nalgebra::{Matrix3, RowVector3, Vector3};

/// Measurements of a motion: at least one of position and velocity.
#[derive(Debug, Clone, Copy)]
pub struct Measured<'a> {
    /// Times \[s\], shape \[n\], increasing.
    pub time: &'a [f64],
    /// Position \[m\].
    pub position: Option<&'a [f64]>,
    /// Velocity \[m/s\].
    pub velocity: Option<&'a [f64]>,
    /// Acceleration \[m/s2\].
    pub acceleration: Option<&'a [f64]>,
}

/// A smoothed motion; shape \[n\] each.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    /// Position \[m\]; the integral of the velocity from 0 where no position was measured.
    pub position: Vec<f64>,
    /// Velocity \[m/s\].
    pub velocity: Vec<f64>,
    /// Acceleration \[m/s2\].
    pub acceleration: Vec<f64>,
    /// Standard deviation of the velocity \[m/s\] about its smoothed value.
    pub velocity_deviation: Vec<f64>,
    /// Estimated standard deviation of the sensors of position, velocity, acceleration, in their units.
    pub sensor_deviation: [Option<f64>; 3],
}

/// Samples that the likelihood of the jerk looks at.
const LIKELIHOOD_SAMPLES: usize = 8000;

impl Measured<'_> {
    fn channels(&self) -> [Option<&[f64]>; 3] {
        [self.position, self.velocity, self.acceleration]
    }

    /// Smooths the motion. Records of fewer than 8 samples come back without estimate of noise.
    pub fn smooth(&self) -> Motion {
        let n = self.time.len();
        // In units of the mean sample time all numbers are of like size.
        let unit = if n > 1 { (self.time[n - 1] - self.time[0]) / (n - 1) as f64 } else { 1.0 };
        let gaps: Vec<f64> = self.time.windows(2).map(|pair| (pair[1] - pair[0]) / unit).collect();
        let powers = [1.0, unit, unit * unit];
        let scaled: [Option<Vec<f64>>; 3] = std::array::from_fn(|i| {
            self.channels()[i].map(|values| values.iter().map(|value| value * powers[i]).collect())
        });
        let variance: [f64; 3] = std::array::from_fn(|i| {
            let Some(values) = &scaled[i] else { return 0.0 };
            // Far below what a sensor resolves, but never zero.
            interpolation_variance(&gaps, values).max(1e-12 * spread(values)).max(f64::MIN_POSITIVE)
        });
        let mut filter = Filter { gaps: &gaps, scaled: &scaled, variance, jerk: 1.0 };
        filter.jerk = most_likely_jerk(&filter, n.min(LIKELIHOOD_SAMPLES));
        let states = filter.smooth(n);
        Motion {
            position: states.iter().map(|(s, _)| s[0]).collect(),
            velocity: states.iter().map(|(s, _)| s[1] / unit).collect(),
            acceleration: states.iter().map(|(s, _)| s[2] / unit / unit).collect(),
            velocity_deviation: states.iter().map(|(_, p)| p[(1, 1)].max(0.0).sqrt() / unit).collect(),
            sensor_deviation: std::array::from_fn(|i| {
                scaled[i].as_ref().map(|_| variance[i].sqrt() / powers[i])
            }),
        }
    }
}

/// Variance of white noise on a smooth signal: mean squared distance of each sample from the cubic through its two
/// neighbors on each side, over the factor by which that enlarges noise. `gaps` \[n - 1\] are the distances of the
/// samples, `values` \[n\]; the squared unit of the values, 0 for fewer than 8 samples.
pub fn interpolation_variance(gaps: &[f64], values: &[f64]) -> f64 {
    let n = values.len();
    if n < 8 {
        return 0.0;
    }
    let mut sum = 0.0;
    for k in 2..n - 2 {
        let at = [-gaps[k - 1] - gaps[k - 2], -gaps[k - 1], gaps[k], gaps[k] + gaps[k + 1]];
        let near = [values[k - 2], values[k - 1], values[k + 1], values[k + 2]];
        let (mut distance, mut enlarged) = (values[k], 1.0);
        for i in 0..4 {
            let weight: f64 = (0..4).filter(|&j| j != i).map(|j| -at[j] / (at[i] - at[j])).product();
            distance -= weight * near[i];
            enlarged += weight * weight;
        }
        sum += distance * distance / enlarged;
    }
    sum / (n - 4) as f64
}

fn spread(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len().max(1) as f64
}

struct Filter<'a> {
    gaps: &'a [f64],
    scaled: &'a [Option<Vec<f64>>; 3],
    variance: [f64; 3],
    jerk: f64,
}

/// Mean and covariance of position, velocity, acceleration.
type State = (Vector3<f64>, Matrix3<f64>);

/// One scalar measurement taken in: which signal, innovation, its variance, gain.
#[derive(Clone, Copy)]
struct Taken {
    signal: usize,
    innovation: f64,
    variance: f64,
    gain: Vector3<f64>,
}

impl Filter<'_> {
    /// Before the first sample the uncertainty of the motion is the scatter of the record: a signal by its own spread,
    /// its derivatives by its differences.
    fn start(&self) -> State {
        let mut mean = Vector3::zeros();
        let mut sizes = [0.0f64; 3];
        for (i, values) in self.scaled.iter().enumerate() {
            let Some(values) = values else { continue };
            mean[i] = values.first().copied().unwrap_or(0.0);
            let mut differences = values.clone();
            for (order, size) in sizes[i..].iter_mut().enumerate() {
                let square = differences.iter().map(|value| value * value).sum::<f64>()
                    / differences.len().max(1) as f64;
                *size = size.max(if order == 0 { spread(values) } else { square });
                differences = differences.windows(2).map(|pair| pair[1] - pair[0]).collect();
            }
        }
        let covariance = sizes.map(|size| 10.0 * size.max(f64::MIN_POSITIVE));
        (mean, Matrix3::from_diagonal(&Vector3::from(covariance)))
    }

    fn predict(&self, (mean, covariance): &State, h: f64) -> State {
        let f = transition(h);
        let (h2, h3) = (h * h, h * h * h);
        let q = Matrix3::new(
            h2 * h3 / 20.0,
            h2 * h2 / 8.0,
            h3 / 6.0,
            h2 * h2 / 8.0,
            h3 / 3.0,
            h2 / 2.0,
            h3 / 6.0,
            h2 / 2.0,
            h,
        );
        (f * mean, f * covariance * f.transpose() + q * self.jerk)
    }

    /// Takes in the samples of index `k`, one signal after another.
    fn update(&self, state: &mut State, k: usize, mut taken: impl FnMut(Taken)) {
        for (signal, values) in self.scaled.iter().enumerate() {
            let Some(values) = values else { continue };
            let innovation = values[k] - state.0[signal];
            let variance = state.1[(signal, signal)] + self.variance[signal];
            let row: RowVector3<f64> = state.1.row(signal).into_owned();
            let gain: Vector3<f64> = row.transpose() / variance;
            state.0 += gain * innovation;
            state.1 -= gain * row;
            taken(Taken { signal, innovation, variance, gain });
        }
    }

    /// Minus twice the log likelihood of the first `n` samples.
    fn deviance(&self, n: usize) -> f64 {
        let (mut state, mut deviance) = (self.start(), 0.0);
        for k in 0..n {
            if k > 0 {
                state = self.predict(&state, self.gaps[k - 1]);
            }
            self.update(&mut state, k, |taken| {
                deviance += taken.innovation * taken.innovation / taken.variance + taken.variance.ln();
            });
        }
        deviance
    }

    fn smooth(&self, n: usize) -> Vec<State> {
        let signals = self.scaled.iter().flatten().count();
        let mut states: Vec<State> = Vec::with_capacity(n);
        let mut all = Vec::with_capacity(n * signals);
        let mut state = self.start();
        for k in 0..n {
            if k > 0 {
                state = self.predict(&state, self.gaps[k - 1]);
            }
            self.update(&mut state, k, |taken| all.push(taken));
            states.push(state);
        }
        // What the samples after k say of the state at k.
        let (mut later, mut weight) = (Vector3::<f64>::zeros(), Matrix3::<f64>::zeros());
        for k in (0..n).rev() {
            let (mean, covariance) = states[k];
            let spread = covariance - covariance * weight * covariance;
            states[k] = (mean - covariance * later, spread);
            for taken in all[k * signals..(k + 1) * signals].iter().rev() {
                let mut keep = Matrix3::identity();
                for i in 0..3 {
                    keep[(i, taken.signal)] -= taken.gain[i];
                }
                later = keep.transpose() * later;
                later[taken.signal] -= taken.innovation / taken.variance;
                weight = keep.transpose() * weight * keep;
                weight[(taken.signal, taken.signal)] += 1.0 / taken.variance;
            }
            if k > 0 {
                let f = transition(self.gaps[k - 1]);
                later = f.transpose() * later;
                weight = f.transpose() * weight * f;
            }
        }
        states
    }
}

/// Transition of the mean over a gap `h`.
fn transition(h: f64) -> Matrix3<f64> {
    Matrix3::new(1.0, h, 0.5 * h * h, 0.0, 1.0, h, 0.0, 0.0, 1.0)
}

/// Jerk intensity of the greatest likelihood, over its logarithm relative to the sensor noise: the best decade, then
/// golden section.
fn most_likely_jerk(filter: &Filter, n: usize) -> f64 {
    let noise = filter.variance.iter().copied().fold(0.0, f64::max);
    let deviance = |power: f64| {
        let jerk = noise * 10f64.powf(power);
        Filter { jerk, ..*filter }.deviance(n)
    };
    // The likelihood has flat ends and may have a second, lower top: look at every decade first.
    let decades = (-16..=4).map(|power| (f64::from(power), deviance(f64::from(power))));
    let best = decades.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(power, _)| power);
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = (best - 1.0, best + 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (deviance(a), deviance(b));
    while high - low > 0.1 {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = deviance(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = deviance(b);
        }
    }
    noise * 10f64.powf(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut random = airloop_series::random::Random::new(seed);
        (0..n).map(|_| random.normal()).collect()
    }

    fn sine(n: usize) -> (Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..n).map(|k| k as f64 * 1e-3).collect();
        let v = time.iter().map(|t| 0.2 * (6.0 * t).sin()).collect();
        (time, v)
    }

    fn rms(a: &[f64], b: &[f64]) -> f64 {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    }

    #[test]
    fn velocity_noise_shrinks_to_what_the_smoother_says_is_left() {
        let (time, v) = sine(4000);
        let measured: Vec<f64> = v.iter().zip(noise(4000, 3)).map(|(v, e)| v + 1e-3 * e).collect();
        let motion =
            Measured { time: &time, position: None, velocity: Some(&measured), acceleration: None }.smooth();
        let sensor = motion.sensor_deviation[1].unwrap();
        assert!((sensor - 1e-3).abs() < 5e-5, "{sensor}");
        let left = rms(&motion.velocity, &v);
        let said = motion.velocity_deviation[2000];
        assert!(left < 2.5e-4 && left < 1.5 * said && left > 0.5 * said, "left {left}, said {said}");
        let a: Vec<f64> = time.iter().map(|t| 1.2 * (6.0 * t).cos()).collect();
        assert!(rms(&motion.acceleration, &a) < 0.05, "{}", rms(&motion.acceleration, &a));
    }

    #[test]
    fn velocity_from_uneven_positions_is_not_shifted_at_reversals() {
        // Time steps between 0.7 and 1.3 ms, position noise 0.1 mm.
        let jitter = noise(6000, 9);
        let time: Vec<f64> =
            (0..6000).map(|k| 1e-3 * (k as f64 + 0.15 * jitter[k].clamp(-1.0, 1.0))).collect();
        let v: Vec<f64> = time.iter().map(|t| 0.2 * (6.0 * t).sin()).collect();
        let x: Vec<f64> =
            time.iter().zip(noise(6000, 4)).map(|(t, e)| -0.2 / 6.0 * (6.0 * t).cos() + 1e-4 * e).collect();
        let motion =
            Measured { time: &time, position: Some(&x), velocity: None, acceleration: None }.smooth();
        // A shift of the reversals by tau shows as a correlation of the error with the acceleration.
        let (mut up, mut down) = (0.0, 0.0);
        for k in 200..5800 {
            let a = 1.2 * (6.0 * time[k]).cos();
            up += (motion.velocity[k] - v[k]) * a;
            down += a * a;
        }
        assert!((up / down).abs() < 2e-4, "shift {} s", up / down);
        assert!(rms(&motion.velocity[200..5800], &v[200..5800]) < 2e-3);
    }

    #[test]
    fn a_record_without_noise_comes_back_as_it_is() {
        let (time, v) = sine(500);
        let motion =
            Measured { time: &time, position: None, velocity: Some(&v), acceleration: None }.smooth();
        assert!(rms(&motion.velocity, &v) < 1e-7, "{}", rms(&motion.velocity, &v));
    }
}
