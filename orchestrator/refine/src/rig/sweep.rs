//! Friction sweeps: the piston alone or the cart alone, moved by a drive, with the load cell in between.
//!
//! The motion is smoothed from the records of position and speed before the search. Where both are measured they have
//! to fit each other: the innovation of the position, given both records, is a residual of its own. The speed has none:
//! its innovations show first of all that a drive does not move at random.

use std::borrow::Cow;

use super::coupled::{sensed, sensor};
use super::lanes::Lanes;
use super::motion::{Motion, MotionProcess, Record, intensity, smooth};
use super::parameters::{SENSOR_GAIN_X, neutral};
use super::plant::{FrictionTerms, mechanics};
use super::record::{Measured, spans, values};
use crate::case::Declared;
use crate::engine::noise::Noise;
use crate::engine::system::Span;

/// One sweep.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// The motion, smoothed from the records.
    pub motion: Motion,
    /// Records of position and speed, as far as they are measured: values and noise rms.
    records: [Option<(Vec<f64>, f64)>; 2],
    /// Prior knowledge of the motion and its records.
    process: MotionProcess,
    /// Position, where both are measured.
    position: Option<Measured>,
    /// Load cell \[N\].
    pub force: Measured,
    /// Whether the cart was moved (else the piston).
    pub cart: bool,
    /// Whether it may be fitted.
    pub estimation: bool,
}

impl Sweep {
    /// A sweep from its records of position \[m\] and speed \[m/s\], of which one may be missing, sampled every `dt`
    /// \[s\]; for `skew` see [`super::motion::skew`]. `roles`: whether the cart was moved, and whether it may be
    /// fitted.
    pub fn new(
        records: [Option<Record>; 2],
        force: Measured,
        roles: (bool, bool),
        (dt, skew): (f64, f64),
    ) -> Sweep {
        let [x, v] = records;
        let process = MotionProcess { dt, intensity: intensity(x, v, dt), late: [skew, 0.0] };
        let position =
            x.filter(|_| v.is_some()).map(|(values, rms)| Measured::new("x", values.to_vec(), rms));
        let (cart, estimation) = roles;
        let motion = smooth(x, v, process);
        let records = records.map(|record| record.map(|(values, rms)| (values.to_vec(), rms)));
        Sweep { motion, records, process, position, force, cart, estimation }
    }

    /// The motion if the sensors have the effects of the parameters `p`.
    fn moved(&self, p: &[f64]) -> Cow<'_, Motion> {
        let [of_x, of_v] = ["x", "v"].map(|name| {
            sensor(name).map_or((0.0, 0.0, 1.0), |[offset, delay, gain]| (p[offset], p[delay], 1.0 + p[gain]))
        });
        if (of_x, of_v) == ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)) {
            return Cow::Borrowed(&self.motion);
        }
        let true_values = |i: usize, (offset, _, gain): (f64, f64, f64)| {
            let (values, rms) = self.records[i].as_ref()?;
            Some((values.iter().map(|value| (value - offset) / gain).collect::<Vec<f64>>(), *rms))
        };
        let (x, v) = (true_values(0, of_x), true_values(1, of_v));
        let [late_x, late_v] = self.process.late;
        let process = MotionProcess { late: [late_x + of_x.1, late_v + of_v.1], ..self.process };
        Cow::Owned(smooth(borrowed(&x), borrowed(&v), process))
    }

    /// Counts the uncertainty of the motion as noise of the force, with the slope `force(v)` of the declared model.
    pub fn weigh(&mut self, declared: &Declared) {
        let plant = mechanics(declared, [&neutral()[..]]);
        let (friction, mass) =
            if self.cart { (&plant.cart, plant.cart_mass.0[0]) } else { (&plant.piston, 0.0) };
        for k in 0..self.force.weights.len() {
            let (v, x) = (self.motion.v[k], self.motion.x[k]);
            let step = 1e-5;
            let slope =
                (force(friction, v + step, x, 0.0) - force(friction, v - step, x, 0.0)) / (2.0 * step);
            let variance =
                slope * slope * self.motion.variance_v[k] + mass * mass * self.motion.variance_a[k];
            self.force.weights[k] = (self.force.weights[k].powi(-2) + variance).powf(-0.5);
        }
    }

    /// Signals with residuals: the load cell, then the position where the speed is measured, too.
    fn measured(&self) -> impl Iterator<Item = &Measured> {
        std::iter::once(&self.force).chain(&self.position)
    }
}

fn borrowed(record: &Option<(Vec<f64>, f64)>) -> Option<Record<'_>> {
    record.as_ref().map(|(values, rms)| (&values[..], *rms))
}

/// All sweeps of a case.
#[derive(Debug, Clone)]
pub struct Sweeps {
    /// Declared parameters.
    pub declared: Declared,
    /// Sample time \[s\].
    pub dt: f64,
    /// Records.
    pub sweeps: Vec<Sweep>,
}

/// Friction force \[N\] of a vented cylinder or of the cart.
fn force(friction: &FrictionTerms<1>, v: f64, x: f64, z: f64) -> f64 {
    friction.force(Lanes([v]), Lanes([x]), Lanes::default(), Lanes([z])).0[0]
}

impl crate::engine::System for Sweeps {
    fn records(&self) -> usize {
        self.sweeps.len()
    }

    fn estimation(&self, record: usize) -> bool {
        self.sweeps[record].estimation
    }

    fn locals(&self, _: usize) -> Vec<(f64, f64)> {
        Vec::new()
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        spans(self.sweeps[record].measured())
    }

    fn predict(&self, record: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
        let sweep = &self.sweeps[record];
        let plant = mechanics(&self.declared, [p]);
        let (friction, mass) =
            if sweep.cart { (&plant.cart, plant.cart_mass.0[0]) } else { (&plant.piston, 0.0) };
        let motion = sweep.moved(p);
        let Motion { x, v, a, innovations, .. } = motion.as_ref();
        let mut z = 0.0;
        let mut truth = Vec::with_capacity(x.len());
        for k in 0..x.len() {
            let periodic = if sweep.cart { plant.cogging(Lanes([x[k]])) } else { None };
            let periodic = periodic.map_or(0.0, |force| force.0[0]);
            truth.push(mass * a[k] + force(friction, v[k], x[k], z) + periodic);
            if friction.disp.is_some() && k + 1 < x.len() {
                // Exact for a constant speed: sliding may set in within a fraction of a sample.
                for part in [0.125, 0.375, 0.625, 0.875] {
                    let w = Lanes([v[k] + part * (v[k + 1] - v[k])]);
                    z = friction.presliding_after(w, Lanes([z]), 0.25 * self.dt).0[0];
                }
            }
        }
        let mut seen = Vec::new();
        sensed(&sweep.force.name, &truth, p, self.dt, truth[0], &mut seen);
        if let Some(m) = &sweep.position {
            let gain = 1.0 + p[SENSOR_GAIN_X];
            seen.extend(m.values.iter().zip(innovations).map(|(value, beyond)| value - gain * beyond));
        }
        seen
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        values(self.sweeps[record].measured())
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        let sweep = &self.sweeps[record];
        let n = sweep.force.values.len();
        let mut out = Vec::with_capacity(predicted.len());
        sweep.force.whiten(&predicted[..n], &mut out);
        if let Some(m) = &sweep.position {
            let errors = m.values.iter().zip(&predicted[n..]).map(|(value, own)| value - own);
            out.extend(errors.zip(&sweep.motion.deviations).map(|(error, deviation)| error / deviation));
        }
        out
    }

    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let force = &self.sweeps[record].force;
        let n = force.values.len();
        let mut out = Vec::with_capacity(predicted.len());
        force.redraw(&predicted[..n], noise, &mut out);
        out.extend((n..predicted.len()).map(|_| noise.normal()));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Friction;
    use crate::engine::System;
    use crate::rig::parameters::{COG_PERIOD, COG_SIN, OFFSET_V, SENSOR_DELAY_X, SENSOR_GAIN_V};

    const DT: f64 = 1e-3;
    const N: usize = 3000;

    /// One sweep of the piston; its sensors show `shown(t)`: position and speed.
    fn sweeps(shown: impl Fn(f64) -> [f64; 2]) -> Sweeps {
        let piston = Friction { c1: 1.5, c2: 40.0, c4: 50.0, ..Friction::default() };
        let declared = Declared { piston_friction: Some(piston), ..Declared::default() };
        let mut noise = Noise::new(3, 0);
        let column = |i: usize, rms: f64, noise: &mut Noise| -> Vec<f64> {
            (0..N).map(|k| shown(k as f64 * DT)[i] + rms * noise.normal()).collect()
        };
        let [x, v] = [column(0, 1e-4, &mut noise), column(1, 1e-3, &mut noise)];
        let f = (0..N).map(|k| {
            let v = speed(k as f64 * DT);
            1.5 * (40.0 * v).tanh() + 50.0 * v + 0.3 * noise.normal()
        });
        let force = Measured::new("F_p", f.collect(), 0.3);
        let mut sweep = Sweep::new([Some((&x, 1e-4)), Some((&v, 1e-3))], force, (false, true), (DT, 0.0));
        sweep.weigh(&declared);
        Sweeps { declared, dt: DT, sweeps: vec![sweep] }
    }

    fn position(t: f64) -> f64 {
        0.03 * (8.0 * t).sin() + 0.01 * (19.0 * t).sin()
    }

    fn speed(t: f64) -> f64 {
        0.24 * (8.0 * t).cos() + 0.19 * (19.0 * t).cos()
    }

    /// Mean squares of the whitened residuals of force and position.
    fn misfit(sweeps: &Sweeps, values: &[(usize, f64)]) -> [f64; 2] {
        let mut p = neutral();
        values.iter().for_each(|&(index, value)| p[index] = value);
        let residuals = sweeps.residuals(0, &p, &[]);
        [0, 1].map(|i| residuals[i * N..(i + 1) * N].iter().map(|r| r * r).sum::<f64>() / N as f64)
    }

    /// A mean square of one within four standard deviations.
    fn is_noise(misfit: [f64; 2]) -> bool {
        misfit.iter().all(|square| (square - 1.0).abs() < 4.0 * (2.0 / N as f64).sqrt())
    }

    #[test]
    fn cogging_shows_in_the_load_cell_of_a_led_cart() {
        let mut own = sweeps(|t| [position(t), speed(t)]);
        own.sweeps[0].cart = true;
        let mut p = neutral();
        let without = own.predict(0, &p, &[]);
        (p[COG_SIN], p[COG_PERIOD]) = (0.8, 0.02);
        let with = own.predict(0, &p, &[]);
        for (k, x) in own.sweeps[0].motion.x.iter().enumerate() {
            let expected = 0.8 * (std::f64::consts::TAU * x / 0.02).sin();
            assert!((with[k] - without[k] - expected).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn true_sensors_leave_noise() {
        assert!(is_noise(misfit(&sweeps(|t| [position(t), speed(t)]), &[])));
    }

    #[test]
    fn the_effects_of_the_sensors_of_the_motion_explain_what_they_did() {
        let gain = sweeps(|t| [position(t), 1.05 * speed(t)]);
        let offset = sweeps(|t| [position(t), speed(t) + 0.01]);
        let delay = sweeps(|t| [position(t - 0.004), speed(t)]);
        for (sweeps, effect) in
            [(gain, (SENSOR_GAIN_V, 0.05)), (offset, (OFFSET_V, 0.01)), (delay, (SENSOR_DELAY_X, 0.004))]
        {
            assert!(!is_noise(misfit(&sweeps, &[])), "{effect:?}");
            let left = misfit(&sweeps, &[effect]);
            assert!(is_noise(left), "{effect:?} {left:?}");
        }
    }
}
