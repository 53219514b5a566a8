//! The mechanics alone, driven by the measured load-cell force: a Kalman predictor.
//!
//! When the actuator does not do what its model says, a simulation from the command says nothing about the rest of the
//! rig. Here the force of the actuator model gets a disturbance that walks at random, and the load cell tells it; what
//! position and angle then do that was not predicted is owed to the mechanics. A disturbance may also act on the cart or
//! as a torque on the pole: the one that makes the innovations white names the channel.
//!
//! Gains come from one pass over the record with the declared model and stay the same for all candidates, so that the
//! innovations are smooth functions of the parameters.

use nalgebra::{SMatrix, SVector};

use super::coupled::{Coupled, Running, Trial, sensor};
use super::parameters::neutral;
use super::plant::{Mechanics, State, actuator, mechanics};
use crate::refine::engine::System;
use crate::refine::engine::goodness::Noise;
use crate::refine::engine::system::Span;

/// x, v, theta, omega, then the disturbances: actuator force, cart force, pole torque.
const STATES: usize = 7;
type Vector = SVector<f64, STATES>;
type Matrix = SMatrix<f64, STATES, STATES>;

/// Steps of the random walks per sample: actuator force \[N\], cart force \[N\], pole torque \[N m\]; 0: none.
pub type Walk = [f64; 3];

/// Gain and standard deviation of the innovation of one measured signal at one sample.
type Correction = (Vector, f64);

/// The mechanics as a system of the engine; its residuals are innovations of x and theta.
pub struct Observer<'a> {
    rig: &'a Coupled,
    /// Per record, sample and measured signal.
    corrections: Vec<Vec<Vec<Correction>>>,
    /// Disturbance that is allowed.
    pub walk: Walk,
    /// Twice the negative logarithm of the likelihood of all estimation records.
    pub cost: f64,
}

/// What a pass over a record gives.
pub struct Pass {
    /// Innovations over their standard deviation: x, then theta.
    pub innovations: Vec<f64>,
    /// State estimate before each sample, shape \[n\].
    pub states: Vec<[f64; STATES]>,
    /// Force of the actuator, disturbance included \[N\].
    pub force: Vec<f64>,
    corrections: Vec<Vec<Correction>>,
    cost: f64,
}

fn predicted(name: &str, s: &Vector, plant: &Mechanics, f_act: f64, p: f64) -> f64 {
    match name {
        "F_p" => f_act + s[4] - plant.piston.force(s[1], s[0], p, 0.0),
        "x" => s[0],
        _ => s[2],
    }
}

fn step(plant: &Mechanics, s: &Vector, hidden: &mut [f64; 2], f_act: f64, p: f64, dt: f64) -> Vector {
    let state: State = [s[0], s[1], s[2], s[3], hidden[0], hidden[1]];
    let mut moved = state;
    for _ in 0..2 {
        moved = plant.step_with(&moved, f_act + s[4] + s[5], p, 0.5 * dt, s[6]);
    }
    *hidden = [moved[4], moved[5]];
    Vector::from([moved[0], moved[1], moved[2], moved[3], s[4], s[5], s[6]])
}

/// One pass over a record. With `known` gains it is a function of the parameters; without, gains are computed on the way.
fn pass(rig: &Coupled, trial: &Trial, p: &[f64], walk: Walk, known: Option<&[Vec<Correction>]>) -> Pass {
    let n = trial.u.len();
    let dt = rig.actuator.sample_time;
    let terms = actuator(&rig.actuator, p);
    let mut running = Running::new(&terms, &trial.u);
    let plant = mechanics(&rig.declared, p);
    let used: Vec<_> = trial.measured.iter().filter(|m| m.name != "F_hat").collect();
    let first = |name: &str| used.iter().find(|m| m.name == name).map_or(0.0, |m| m.values[0]);
    let mut s = Vector::from([first("x"), 0.0, first("theta"), 0.0, 0.0, 0.0, 0.0]);
    let mut hidden = [0.0; 2];
    let initial = [1e-4, 0.0, 1e-4, 0.0, 1.0, 400.0 * walk[1].powi(2), 400.0 * walk[2].powi(2)];
    let mut covariance = Matrix::from_diagonal(&Vector::from(initial));
    if walk[0] == 0.0 {
        covariance[(4, 4)] = 0.0;
    }
    let noise = Matrix::from_diagonal(&Vector::from([
        0.0,
        0.0,
        0.0,
        0.0,
        walk[0].powi(2),
        walk[1].powi(2),
        walk[2].powi(2),
    ]));
    let mut out = Pass {
        innovations: vec![0.0; 2 * n],
        states: Vec::with_capacity(n),
        force: Vec::with_capacity(n),
        corrections: Vec::new(),
        cost: 0.0,
    };
    for k in 0..n {
        let [f_hat, f_act] = running.sample(k, k as f64 * dt, s[0], s[1]);
        let magnitude = f_hat.abs();
        let mut own = Vec::new();
        for (i, m) in used.iter().enumerate() {
            let (offset, gain) =
                sensor(&m.name).map_or((0.0, 1.0), |[offset, _, gain]| (p[offset], 1.0 + p[gain]));
            let shown = |s: &Vector| gain * predicted(&m.name, s, &plant, f_act, magnitude) + offset;
            let error = m.values[k] - shown(&s);
            let (correction, deviation) = match known {
                Some(known) => known[k][i],
                None => {
                    let mut row = Vector::zeros();
                    for j in 0..STATES {
                        let mut moved = s;
                        let h = 1e-6;
                        moved[j] += h;
                        row[j] = (shown(&moved) - shown(&s)) / h;
                    }
                    let variance = (covariance * row).dot(&row) + m.weights[k].powi(-2);
                    let gain = covariance * row / variance;
                    covariance -= gain * (covariance * row).transpose();
                    covariance = (covariance + covariance.transpose()) * 0.5;
                    out.cost += error * error / variance + variance.ln();
                    (gain, variance.sqrt())
                }
            };
            s += correction * error;
            match m.name.as_str() {
                "x" => out.innovations[k] = error / deviation,
                "theta" => out.innovations[n + k] = error / deviation,
                _ => {}
            }
            if known.is_none() {
                own.push((correction, deviation));
            }
        }
        out.states.push(s.into());
        out.force.push(f_act + s[4]);
        if known.is_none() {
            out.corrections.push(own);
            let mut transition = Matrix::zeros();
            let mut ahead = hidden;
            let next = step(&plant, &s, &mut ahead, f_act, magnitude, dt);
            for j in 0..STATES {
                let mut moved = s;
                let h = 1e-6;
                moved[j] += h;
                let column = (step(&plant, &moved, &mut hidden.clone(), f_act, magnitude, dt) - next) / h;
                transition.set_column(j, &column);
            }
            covariance = transition * covariance * transition.transpose() + noise;
            (s, hidden) = (next, ahead);
        } else {
            s = step(&plant, &s, &mut hidden, f_act, magnitude, dt);
        }
    }
    out
}

impl<'a> Observer<'a> {
    /// Computes the gains with the declared model.
    pub fn new(rig: &'a Coupled, walk: Walk) -> Observer<'a> {
        Observer::around(rig, walk, &neutral())
    }

    /// Computes the gains with the parameters `p`.
    pub fn around(rig: &'a Coupled, walk: Walk, p: &[f64]) -> Observer<'a> {
        let passes = crate::refine::engine::parallel::map(rig.trials.len(), |i| {
            pass(rig, &rig.trials[i], p, walk, None)
        });
        let cost = passes.iter().zip(&rig.trials).filter(|(_, t)| t.estimation).map(|(p, _)| p.cost).sum();
        Observer { rig, corrections: passes.into_iter().map(|p| p.corrections).collect(), walk, cost }
    }

    /// One pass over a record with the parameters `p`.
    pub fn pass(&self, record: usize, p: &[f64]) -> Pass {
        pass(self.rig, &self.rig.trials[record], p, self.walk, Some(&self.corrections[record]))
    }
}

impl System for Observer<'_> {
    fn records(&self) -> usize {
        self.rig.trials.len()
    }

    fn estimation(&self, record: usize) -> bool {
        self.rig.trials[record].estimation
    }

    fn locals(&self, _: usize) -> Vec<(f64, f64)> {
        Vec::new()
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        let n = self.rig.trials[record].u.len();
        let span = |signal: &str, range| Span { signal: signal.into(), range, noise: 1.0 };
        vec![span("x", 0..n), span("theta", n..2 * n)]
    }

    fn predict(&self, record: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
        self.pass(record, p).innovations.into_iter().map(|value| -value).collect()
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        vec![0.0; 2 * self.rig.trials[record].u.len()]
    }

    fn whiten(&self, _: usize, predicted: &[f64]) -> Vec<f64> {
        predicted.iter().map(|value| -value).collect()
    }

    fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        predicted.iter().map(|_| noise.normal()).collect()
    }
}
