//! Friction sweeps: the piston alone or the cart alone, moved by a drive, with the load cell in between.

use super::coupled::sensed;
use super::lanes::Lanes;
use super::motion::Motion;
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
    /// Load cell \[N\].
    pub force: Measured,
    /// Whether the cart was moved (else the piston).
    pub cart: bool,
    /// Whether it may be fitted.
    pub estimation: bool,
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

impl Sweep {
    /// Counts the uncertainty of the motion as noise of the force, with the slope `force(v)` of the declared model.
    pub fn weigh(&mut self, declared: &Declared) {
        let plant = mechanics(declared, [&super::parameters::neutral()[..]]);
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
        let force = &self.sweeps[record].force;
        let signal = force.name.clone();
        vec![Span { signal, range: 0..force.values.len(), noise: force.noise }]
    }

    fn predict(&self, record: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
        let sweep = &self.sweeps[record];
        let plant = mechanics(&self.declared, [p]);
        let (friction, mass) =
            if sweep.cart { (&plant.cart, plant.cart_mass.0[0]) } else { (&plant.piston, 0.0) };
        let Motion { x, v, a, .. } = &sweep.motion;
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
        seen
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        self.sweeps[record].force.values.clone()
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        let mut out = Vec::new();
        self.sweeps[record].force.whiten(predicted, &mut out);
        out
    }

    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let mut out = Vec::new();
        self.sweeps[record].force.redraw(predicted, noise, &mut out);
        out
    }
}
