//! Friction sweeps: the piston alone or the cart alone, moved by a drive, with the load cell in between.
//!
//! The motion is smoothed from the records of position and speed before the search. Where both are measured they have to
//! fit each other: what the position shows beyond what both records let expect is a residual of its own. The speed has
//! none: its innovations show first of all that a drive does not move at random.

use std::borrow::Cow;

use super::coupled::{sensed, sensor};
use super::lanes::Lanes;
use super::motion::{Course, Motion, Record, intensity, smooth};
use super::parameters::{SENSOR_GAIN_X, neutral};
use super::plant::{FrictionTerms, mechanics};
use super::record::Measured;
use crate::refine::case::Declared;
use crate::refine::engine::noise::Noise;
use crate::refine::engine::system::Span;

/// One sweep.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// The motion, smoothed from the records.
    pub motion: Motion,
    /// What it consists of.
    parts: Vec<Part>,
    /// Position, where both are measured.
    position: Option<Measured>,
    /// Load cell \[N\].
    pub force: Measured,
    /// Whether the cart was moved (else the piston).
    pub cart: bool,
    /// Whether it may be fitted.
    pub estimation: bool,
}

/// The motion that follows from what one sensor shows if the other shows nothing: smoothing is linear.
#[derive(Debug, Clone)]
struct Part {
    /// Sensor.
    name: &'static str,
    motion: Motion,
    /// The part of a constant 1 on this sensor.
    constant: Motion,
}

impl Sweep {
    /// A sweep from its records of position \[m\] and speed \[m/s\], of which one may be missing, sampled every `dt` \[s\];
    /// for `skew` see [`Course`]. `roles`: whether the cart was moved, and whether it may be fitted.
    pub fn new(
        records: [Option<Record>; 2],
        force: Measured,
        roles: (bool, bool),
        (dt, skew): (f64, f64),
    ) -> Sweep {
        let n = force.values.len();
        let [x, v] = records;
        let course = Course { dt, intensity: intensity(x, v, dt), skew };
        let (none, ones) = (vec![0.0; n], vec![1.0; n]);
        let alone = |sensor: usize, values: &[f64]| {
            let of = |i: usize| records[i].map(|(_, rms)| (if i == sensor { values } else { &none }, rms));
            smooth(of(0), of(1), course)
        };
        let parts = ["x", "v"].into_iter().zip(records).enumerate().filter_map(|(i, (name, record))| {
            let (values, _) = record?;
            Some(Part { name, motion: alone(i, values), constant: alone(i, &ones) })
        });
        let parts: Vec<Part> = parts.collect();
        let position = x.filter(|_| v.is_some()).map(|(values, rms)| Measured::new("x", values.to_vec(), rms));
        let (cart, estimation) = roles;
        Sweep { motion: smooth(x, v, course), parts, position, force, cart, estimation }
    }

    /// The motion if the sensors have the effects of the parameters `p`.
    fn moved(&self, p: &[f64], dt: f64) -> Cow<'_, Motion> {
        let effect = |part: &Part| {
            sensor(part.name).map_or((0.0, 0.0, 1.0), |[o, d, g]| (p[o], p[d] / dt, (1.0 + p[g]).recip()))
        };
        if self.parts.iter().all(|part| effect(part) == (0.0, 0.0, 1.0)) {
            return Cow::Borrowed(&self.motion);
        }
        let mut found = self.motion.clone();
        let Motion { x, v, a, innovations, .. } = &mut found;
        for (column, own) in [(x, 0), (v, 1), (a, 2), (innovations, 3)] {
            column.fill(0.0);
            for part in &self.parts {
                let (offset, delay, share) = effect(part);
                let of = |motion: &Motion| column_of(motion, own).to_vec();
                let (values, constant) = (of(&part.motion), of(&part.constant));
                for (k, sum) in column.iter_mut().enumerate() {
                    *sum += share * (ahead(&values, k, delay) - offset * constant[k]);
                }
            }
        }
        Cow::Owned(found)
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

fn column_of(motion: &Motion, column: usize) -> &[f64] {
    match column {
        0 => &motion.x,
        1 => &motion.v,
        2 => &motion.a,
        _ => &motion.innovations,
    }
}

/// `values` at sample `k + delay`, straight between samples and beyond the last.
fn ahead(values: &[f64], k: usize, delay: f64) -> f64 {
    if delay == 0.0 || values.len() < 2 {
        return values[k];
    }
    let at = k as f64 + delay;
    let below = (at.floor() as usize).min(values.len() - 2);
    values[below] + (at - below as f64) * (values[below + 1] - values[below])
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

impl crate::refine::engine::System for Sweeps {
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
        let n = self.sweeps[record].force.values.len();
        let span = |(i, m): (usize, &Measured)| Span {
            signal: m.name.clone(),
            range: i * n..(i + 1) * n,
            noise: m.noise,
        };
        self.sweeps[record].measured().enumerate().map(span).collect()
    }

    fn predict(&self, record: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
        let sweep = &self.sweeps[record];
        let plant = mechanics(&self.declared, [p]);
        let (friction, mass) =
            if sweep.cart { (&plant.cart, plant.cart_mass.0[0]) } else { (&plant.piston, 0.0) };
        let motion = sweep.moved(p, self.dt);
        let Motion { x, v, a, innovations, .. } = motion.as_ref();
        let mut z = 0.0;
        let mut truth = Vec::with_capacity(x.len());
        for k in 0..x.len() {
            truth.push(mass * a[k] + force(friction, v[k], x[k], z));
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
        self.sweeps[record].measured().flat_map(|m| m.values.iter().copied()).collect()
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
