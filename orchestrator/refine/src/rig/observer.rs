//! The mechanics alone, driven by the measured load-cell force: a Kalman predictor.
//!
//! When the actuator does not follow its model, a simulation from the command says nothing about the rest of the rig.
//! Here the force of the actuator model gets a random-walk disturbance, which the load cell shows; motion of position
//! and angle that was not predicted is then due to the mechanics. A disturbance may also act on the cart or as a torque
//! on the pole: the one that makes the innovations white names the channel.
//!
//! Gains come from one pass over the record with the declared model and stay the same for all candidates, so that the
//! innovations are smooth functions of the parameters.

use std::array::from_fn;

use nalgebra::{SMatrix, SVector};

use super::coupled::{Coupled, Running, SIDE_BY_SIDE, Trial, sensor};
use super::lanes::Lanes;
use super::plant::{Mechanics, actuator, mechanics};
use super::record::Measured;
use crate::engine::noise::Noise;
use crate::engine::system::{Job, Span};
use crate::engine::{System, parallel};

/// x, v, theta, omega, then the disturbances: actuator force, cart force, pole torque, rate of the actuator force.
const STATES: usize = 8;
type Vector = SVector<f64, STATES>;
type Matrix = SMatrix<f64, STATES, STATES>;

/// Random-walk intensities, standard deviation of the increment per sample: actuator force \[N\], cart force \[N\],
/// pole torque \[N m\], change of the actuator force per sample \[N\]; 0: none.
pub type Walk = [f64; 4];

/// Gain and standard deviation of the innovation of one measured signal at one sample.
type Correction = (Vector, f64);

/// The mechanics as a system of the engine; its residuals are innovations of x and theta.
pub struct Observer<'a> {
    rig: &'a Coupled,
    /// Per record, sample and measured signal.
    corrections: Vec<Vec<Vec<Correction>>>,
    /// Disturbance that is allowed.
    pub walk: Walk,
    /// Time advance of the actuator force as a share of its change over a sample: 0 for a force that is held over
    /// samples, 0.5 for one that changes smoothly.
    pub time_advance: f64,
    /// Twice the negative logarithm of the likelihood of all estimation records.
    pub cost: f64,
}

/// Result of a pass over a record.
pub struct Pass {
    /// Innovations over their standard deviation: x, then theta.
    pub innovations: Vec<f64>,
    /// State estimate after each sample, shape \[n\].
    pub states: Vec<[f64; STATES]>,
    /// Force of the actuator, disturbance included \[N\].
    pub force: Vec<f64>,
}

/// States of several passes side by side.
type States<const L: usize> = [Lanes<L>; STATES];

/// Signals that correct the estimate: the pressure force says nothing about the mechanics.
fn used(trial: &Trial) -> Vec<&Measured> {
    trial.measured.iter().filter(|m| m.name != "F_hat").collect()
}

fn begin(trial: &Trial) -> [f64; STATES] {
    let first = |name: &str| trial.measured.iter().find(|m| m.name == name).map_or(0.0, |m| m.values[0]);
    [first("x"), 0.0, first("theta"), 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// Value of an ideal sensor; `f_act` is the force of the actuator model.
#[inline(always)]
fn ideal<const L: usize>(
    name: &str,
    s: &States<L>,
    plant: &Mechanics<L>,
    f_act: Lanes<L>,
    p: Lanes<L>,
    z: Lanes<L>,
) -> Lanes<L> {
    match name {
        "F_p" => f_act + s[4] - plant.piston.force(s[1], s[0], p, z),
        "x" => s[0],
        _ => s[2],
    }
}

/// One sample on; `hidden` are the presliding states, `change` is that of the force of the actuator model since the
/// sample before.
#[inline(always)]
fn step<const L: usize>(
    plant: &Mechanics<L>,
    s: &mut States<L>,
    hidden: &mut [Lanes<L>; 2],
    (f_act, change, time_advance): (Lanes<L>, Lanes<L>, f64),
    p: Lanes<L>,
    dt: f64,
) {
    let force = f_act + s[4] + (change + s[7]) * time_advance + s[5];
    let mut moved = [s[0], s[1], s[2], s[3], hidden[0], hidden[1]];
    for _ in 0..2 {
        moved = plant.step(&moved, force, p, s[6], 0.5 * dt);
    }
    s[..4].copy_from_slice(&moved[..4]);
    s[4] = s[4] + s[7];
    hidden.copy_from_slice(&moved[4..]);
}

fn sensing(name: &str, p: &[f64]) -> (f64, f64) {
    sensor(name).map_or((0.0, 1.0), |[offset, _, gain]| (p[offset], 1.0 + p[gain]))
}

/// Gains of a record, and twice the negative logarithm of its likelihood. The filter is linearized by differences: lane
/// 0 is the estimate, the others are moved in one state each.
fn gains(
    rig: &Coupled,
    trial: &Trial,
    p: &[f64],
    (walk, time_advance): (Walk, f64),
) -> (Vec<Vec<Correction>>, f64) {
    const DIFFERENCE_STEP: f64 = 1e-6;
    let dt = rig.actuator.sample_time;
    let terms = actuator(&rig.actuator, p);
    let mut running = Running::new(&terms, &trial.u);
    let plant: Mechanics<{ STATES + 1 }> = mechanics(&rig.declared, [p; STATES + 1]);
    let measured = used(trial);
    let mut s = Vector::from(begin(trial));
    let mut hidden = [Lanes::all(0.0); 2];
    let spread = |walk: f64| 400.0 * walk * walk;
    let force = if walk[0] == 0.0 && walk[3] == 0.0 { 0.0 } else { 1.0 };
    let mut covariance = Matrix::from_diagonal(&Vector::from([
        1e-4,
        0.0,
        1e-4,
        0.0,
        force,
        spread(walk[1]),
        spread(walk[2]),
        spread(walk[3]),
    ]));
    let steps = walk.map(|walk| walk * walk);
    let (mut found, mut cost) = (Vec::with_capacity(trial.u.len()), 0.0);
    let around = |s: &Vector| -> States<{ STATES + 1 }> {
        from_fn(|j| Lanes(from_fn(|lane| s[j] + if lane == j + 1 { DIFFERENCE_STEP } else { 0.0 })))
    };
    let mut before = Lanes::default();
    let slope = |value: &Lanes<{ STATES + 1 }>, j: usize| (value.0[j + 1] - value.0[0]) / DIFFERENCE_STEP;
    for k in 0..trial.u.len() {
        let [f_hat, f_act] = running.sample(k, k as f64 * dt, s[0], s[1]);
        let (magnitude, f_act) = (Lanes::all(f_hat.abs()), Lanes::all(f_act));
        let mut own = Vec::with_capacity(measured.len());
        for m in &measured {
            let (offset, gain) = sensing(&m.name, p);
            let shown = ideal(&m.name, &around(&s), &plant, f_act, magnitude, hidden[0]) * gain + offset;
            let error = m.values[k] - shown.0[0];
            let row = Vector::from_fn(|j, _| slope(&shown, j));
            let seen = covariance * row;
            let variance = seen.dot(&row) + m.weights[k].powi(-2);
            let gain = seen / variance;
            covariance -= gain * seen.transpose();
            cost += error * error / variance + variance.ln();
            s += gain * error;
            own.push((gain, variance.sqrt()));
        }
        found.push(own);
        let mut next = around(&s);
        step(&plant, &mut next, &mut hidden, (f_act, f_act - before, time_advance), magnitude, dt);
        before = f_act;
        hidden = hidden.map(|z| Lanes::all(z.0[0]));
        let transition = Matrix::from_fn(|i, j| slope(&next[i], j));
        s = Vector::from_fn(|i, _| next[i].0[0]);
        covariance = transition * covariance * transition.transpose();
        for (i, step) in steps.into_iter().enumerate() {
            covariance[(4 + i, 4 + i)] += step;
        }
        covariance = (covariance + covariance.transpose()) * 0.5;
    }
    (found, cost)
}

impl<'a> Observer<'a> {
    /// Computes the gains with the parameters `p`; for `time_advance` see [`Observer::time_advance`].
    pub fn around(rig: &'a Coupled, walk: Walk, time_advance: f64, p: &[f64]) -> Observer<'a> {
        let found = parallel::map(rig.trials.len(), |i| {
            let trial = &rig.trials[i];
            if trial.estimation { gains(rig, trial, p, (walk, time_advance)) } else { (Vec::new(), 0.0) }
        });
        let cost = found.iter().map(|(_, cost)| cost).sum();
        Observer {
            rig,
            corrections: found.into_iter().map(|(own, _)| own).collect(),
            walk,
            time_advance,
            cost,
        }
    }

    /// Passes over estimation records with gains known: smooth functions of the parameters.
    fn passes<const L: usize>(&self, jobs: &[Job]) -> Vec<Pass> {
        // Idle lanes repeat the last job.
        let job = |i: usize| &jobs[i.min(jobs.len() - 1)];
        let trials: [&Trial; L] = from_fn(|i| &self.rig.trials[job(i).record]);
        let dt = self.rig.actuator.sample_time;
        let terms: [_; L] = from_fn(|i| actuator(&self.rig.actuator, &job(i).parameters));
        let mut running: [_; L] = from_fn(|i| Running::new(&terms[i], &trials[i].u));
        let plant: Mechanics<L> = mechanics(&self.rig.declared, from_fn(|i| &job(i).parameters[..]));
        let measured: [_; L] = from_fn(|i| used(trials[i]));
        let starts: [_; L] = from_fn(|i| begin(trials[i]));
        let mut s: States<L> = from_fn(|j| Lanes(from_fn(|i| starts[i][j])));
        let mut hidden = [Lanes::default(); 2];
        let mut before = Lanes::default();
        let mut out: Vec<Pass> = trials[..jobs.len()]
            .iter()
            .map(|trial| {
                let n = trial.u.len();
                let (states, force) = (Vec::with_capacity(n), Vec::with_capacity(n));
                Pass { innovations: vec![0.0; 2 * n], states, force }
            })
            .collect();
        for k in 0..trials.iter().map(|trial| trial.u.len()).max().unwrap_or(0) {
            let (mut f_hat, mut f_act) = (Lanes::default(), Lanes::default());
            for (i, running) in running.iter_mut().enumerate() {
                [f_hat.0[i], f_act.0[i]] = running.sample(k, k as f64 * dt, s[0].0[i], s[1].0[i]);
            }
            let magnitude = f_hat.abs();
            for (sensor, first) in measured[0].iter().enumerate() {
                let name = &first.name;
                let shown = ideal(name, &s, &plant, f_act, magnitude, hidden[0]);
                for (i, pass) in out.iter_mut().enumerate().filter(|(i, _)| k < trials[*i].u.len()) {
                    let (offset, gain) = sensing(name, &job(i).parameters);
                    let error = measured[i][sensor].values[k] - (gain * shown.0[i] + offset);
                    let (correction, deviation) = &self.corrections[job(i).record][k][sensor];
                    (0..STATES).for_each(|j| s[j].0[i] += correction[j] * error);
                    match name.as_str() {
                        "x" => pass.innovations[k] = error / deviation,
                        "theta" => pass.innovations[trials[i].u.len() + k] = error / deviation,
                        _ => {}
                    }
                }
            }
            for (i, pass) in out.iter_mut().enumerate().filter(|(i, _)| k < trials[*i].u.len()) {
                pass.states.push(s.map(|value| value.0[i]));
                pass.force.push(f_act.0[i] + s[4].0[i]);
            }
            step(&plant, &mut s, &mut hidden, (f_act, f_act - before, self.time_advance), magnitude, dt);
            before = f_act;
        }
        out
    }

    /// One pass over an estimation record with the parameters `p`.
    pub fn pass(&self, record: usize, p: &[f64]) -> Pass {
        let job = Job { record, parameters: p.to_vec(), locals: Vec::new() };
        let mut found = self.passes::<1>(&[job]);
        found.remove(0)
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

    fn side_by_side(&self) -> usize {
        SIDE_BY_SIDE
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        jobs.chunks(SIDE_BY_SIDE)
            .flat_map(|some| self.passes::<SIDE_BY_SIDE>(some))
            .map(|pass| pass.innovations)
            .collect()
    }

    fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        predicted.iter().map(|_| noise.normal()).collect()
    }
}
