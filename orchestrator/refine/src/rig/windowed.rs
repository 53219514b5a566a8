//! Windowed predictions: the simulation begins again every half second from the measured motion.
//!
//! Over whole records small errors of a model add up, and the pole soon forgets what moved it. Over half a second the
//! prediction is nearly linear in what is missing. The states at the beginnings of the windows come from local
//! parabolas through position and angle; actuator and presliding run on.

use super::coupled::{Coupled, Trial};
use super::parameters::{OFFSET_THETA, SENSOR_DELAY_THETA, SENSOR_DELAY_X, SENSOR_GAIN_THETA, SENSOR_GAIN_X};

/// Length of a window \[s\].
pub const WINDOW: f64 = 0.5;
/// Length of a window in which a missing force moves the piston by too little to change the pressures \[s\].
const WINDOW_OF_MEASURED_MOTION: f64 = 0.004;
/// Half widths of the parabolas through position and angle \[s\].
const HALF_WIDTHS: [f64; 2] = [0.012, 0.025];

/// Where the windows of a trial begin.
#[derive(Debug, Clone)]
pub struct Restart {
    /// Samples per window.
    pub every: usize,
    /// Position \[m\] and angle \[rad\] as measured, each of shape \[n\].
    measured: [Vec<f64>; 2],
    /// Sample time \[s\].
    dt: f64,
    /// Parameters of the sensors that the measured motion is corrected with; none: those of the simulation.
    sensors: Option<Vec<f64>>,
}

impl Restart {
    /// Windows of the length `window` \[s\] of a trial with position and angle, sampled every `dt` \[s\]; `None` where
    /// one is missing.
    fn new(trial: &Trial, window: f64, dt: f64) -> Option<Restart> {
        let signal = |name: &str| trial.measured.iter().find(|m| m.name == name).map(|m| m.values.clone());
        let every = (window / dt).round().max(1.0) as usize;
        Some(Restart { every, measured: [signal("x")?, signal("theta")?], dt, sensors: None })
    }

    /// States x, v, theta, omega at the beginnings of the windows, under the sensors of the parameters `p`.
    pub fn states(&self, p: &[f64]) -> Vec<[f64; 4]> {
        let p = self.sensors.as_deref().unwrap_or(p);
        let truth = |i: usize, k: usize, (offset, delay, gain): (f64, f64, f64)| {
            let half = ((HALF_WIDTHS[i] / self.dt).round() as usize).max(2);
            // A late sensor shows the state of now when the delay is over.
            let late = (delay / self.dt).round();
            let [value, rate, second] = parabola(&self.measured[i], k + late as usize, half, self.dt);
            let rest = delay - late * self.dt;
            let (value, rate) = (value + rest * (rate + 0.5 * rest * second), rate + rest * second);
            // Records begin at rest.
            [(value - offset) / (1.0 + gain), if k == 0 { 0.0 } else { rate / (1.0 + gain) }]
        };
        let state = |k: usize| {
            let [x, v] = truth(0, k, (0.0, p[SENSOR_DELAY_X], p[SENSOR_GAIN_X]));
            let of_theta = (p[OFFSET_THETA], p[SENSOR_DELAY_THETA], p[SENSOR_GAIN_THETA]);
            let [theta, omega] = truth(1, k, of_theta);
            [x, v, theta, omega]
        };
        (0..self.measured[0].len()).step_by(self.every).map(state).collect()
    }
}

/// Value, rate and second derivative at sample `k` of the parabola through `half` samples to either side.
fn parabola(values: &[f64], k: usize, half: usize, dt: f64) -> [f64; 3] {
    let last = values.len().saturating_sub(1);
    let k = k.min(last);
    let (low, high) = (k.saturating_sub(half), (k + half).min(last));
    let (mut matrix, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
    for (i, value) in values.iter().enumerate().take(high + 1).skip(low) {
        // In units of the half width, so that the equations are well scaled.
        let t = (i as f64 - k as f64) / half as f64;
        let row = nalgebra::Vector3::new(1.0, t, t * t);
        matrix += row * row.transpose();
        right += row * *value;
    }
    let Some(found) = matrix.try_inverse().map(|inverse| inverse * right) else {
        return [values.get(k).copied().unwrap_or(0.0), 0.0, 0.0];
    };
    let width = half as f64 * dt;
    [found[0], found[1] / width, 2.0 * found[2] / (width * width)]
}

impl Coupled {
    /// The same records predicted in windows; those with the rod fixed as they are.
    pub fn windowed(&self) -> Coupled {
        self.windowed_over(WINDOW)
    }

    /// The same records predicted in windows of a length \[s\].
    fn windowed_over(&self, window: f64) -> Coupled {
        let mut found = self.clone();
        for trial in found.trials.iter_mut().filter(|trial| !trial.fixed) {
            trial.restart = Restart::new(trial, window, self.actuator.sample_time);
        }
        found
    }

    /// The pressure force alone, in windows so short that the piston moves as it was measured, whatever the mechanics
    /// lack.
    pub fn pressure_force(&self) -> Coupled {
        let mut found = self.windowed_over(WINDOW_OF_MEASURED_MOTION);
        for trial in &mut found.trials {
            trial.measured.retain(|m| m.name == "F_hat");
        }
        found
    }

    /// Windows that begin where the motion was if the sensors are those of the parameters `p`, whatever is simulated.
    pub fn with_sensors(&self, p: &[f64]) -> Coupled {
        let mut found = self.clone();
        for restart in found.trials.iter_mut().filter_map(|trial| trial.restart.as_mut()) {
            restart.sensors = Some(p.to_vec());
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Actuator;
    use crate::engine::System;
    use crate::rig::parameters::{SPRING, neutral};
    use crate::rig::testing::rig;

    const FINE_NOISE_RMS: [(&str, f64); 4] = [("F_hat", 0.01), ("F_p", 0.01), ("x", 1e-6), ("theta", 1e-6)];

    fn actuator() -> Actuator {
        Actuator { sample_time: 1e-3, A1: [[-0.98, 0.0], [0.0, -0.98]], B0: [0.02; 2], B1: [0.0; 2] }
    }

    #[test]
    fn a_parabola_is_recovered_with_its_derivatives() {
        let values: Vec<f64> =
            (0..40).map(|k| 1.0 + 2.0 * f64::from(k) * 1e-3 + 3.0 * (f64::from(k) * 1e-3).powi(2)).collect();
        let [value, rate, second] = parabola(&values, 20, 8, 1e-3);
        let exact = [1.0 + 0.04 + 3.0 * 4e-4, 2.0 + 6.0 * 0.02, 6.0];
        for (found, exact) in [value, rate, second].into_iter().zip(exact) {
            assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
        }
    }

    #[test]
    fn windows_of_a_true_model_leave_little_and_those_of_a_wrong_one_less_than_the_whole() {
        let values = [(SPRING, 40.0)];
        let whole = rig(actuator(), 2000, &FINE_NOISE_RMS, &values);
        let windowed = whole.windowed();
        let mut truth = neutral();
        values.iter().for_each(|&(index, value)| truth[index] = value);
        let error = |system: &Coupled, p: &[f64]| {
            let locals: Vec<f64> = system.locals(0).iter().map(|local| local.0).collect();
            let (predicted, measured) = (system.predict(0, p, &locals), system.measured(0));
            let x = 4000..6000;
            (measured[x.clone()].iter().zip(&predicted[x]).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
                / 2000.0)
                .sqrt()
        };
        assert!(windowed.locals(0).is_empty());
        // The speed at the beginning of a window is known to some 0.1 mm/s, which lasts for 10 ms.
        assert!(error(&windowed, &truth) < 2e-5, "{}", error(&windowed, &truth));
        let [lost, whole] = [error(&windowed, &neutral()), error(&whole, &neutral())];
        assert!(lost > 10.0 * error(&windowed, &truth) && lost < whole, "{lost} {whole}");
    }
}
