//! Nonlinear model predictive control along a planned trajectory: at every solve the rest of the plan is optimized
//! again from the estimated state, with the parameters that were learned so far.
//!
//! | module | what |
//! |---|---|
//! | [`family`] | the plant with uncertain parameters |
//! | [`step`] | one step with derivatives |
//! | [`estimator`] | extended Kalman filter of states, disturbances and parameters |
//! | [`horizon`] | the problem over the horizon, solved by stage-wise Gauss-Newton steps |
//!
//! Beyond the horizon counts the cost of the regulator ([`super::tvlqr`]) from there on. Between the solves the
//! feedback that the last one left acts at every sample.

pub mod estimator;
pub mod family;
pub mod horizon;
pub mod step;

use std::time::Instant;

use super::{Controller, Design, Error, Measured, Nominal, riccati};
use estimator::Estimator;
use family::Family;
use horizon::Horizon;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Cost of a sample at a bound, where a plan has used up its margin, compared with that of a deviation by one allowed
/// deviation.
const STIFFNESS: f64 = 400.0;
/// Initial deviation of measured states, in those of the regulator's estimator.
const MEASURED_AT_FIRST: f64 = 10.0;

/// Choices of the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Length of the horizon \[s\].
    pub horizon: f64,
    /// Time between its steps \[s\].
    pub step: f64,
    /// Time between solves \[s\].
    pub period: f64,
    /// Most rounds of a solve.
    pub iterations: usize,
    /// Wall-clock time after which no further round begins \[s\]; infinite: results depend on the inputs alone.
    pub time_budget: f64,
    /// Soft bounds of states: index, limits, and the margin by which plans stay inside.
    pub bounds: Vec<(usize, (f64, f64), f64)>,
    /// Standard deviation of the parameters at first, in widths, `[n_p]`.
    pub parameter_deviation: Vec<f64>,
    /// Standard deviation of their drift in one second, in widths, `[n_p]`.
    pub parameter_drift: Vec<f64>,
}

/// All that the controller knows but the model, in numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plant {
    /// Time of the first node \[s\].
    pub start: f64,
    /// Time between samples \[s\].
    pub sample_time: f64,
    /// Samples in a step of the horizon.
    pub samples_per_step: usize,
    /// Time between the nodes \[s\].
    pub step: f64,
    /// Steps of the horizon.
    pub steps: usize,
    /// Steps between solves.
    pub period: usize,
    /// Most rounds of a solve.
    pub iterations: usize,
    /// See [`Settings::time_budget`].
    pub time_budget: f64,
    /// States of the plan at the nodes; the last ones hold, `[nodes, n]`.
    pub states: Vec<Vec<f64>>,
    /// Inputs of the plan, `[nodes, m]`.
    pub inputs: Vec<Vec<f64>>,
    /// Cost from each node on, row-major, `[nodes, n, n]`.
    pub costs: Vec<Vec<f64>>,
    /// Deviation of every state that costs alike, `[n]`.
    pub deviation: Vec<f64>,
    /// Weights of a step, `[n]`.
    pub state_weight: Vec<f64>,
    /// See `state_weight`, `[m]`.
    pub input_weight: Vec<f64>,
    /// Limits of the inputs, `[m]`.
    pub limits: Vec<(f64, f64)>,
    /// Soft bounds; see [`Settings::bounds`].
    pub bounds: Vec<(usize, (f64, f64), f64)>,
    /// Measured signals, `[p]`.
    pub measured: Vec<Measured>,
    /// Their noise, `[p]`.
    pub noise: Vec<f64>,
    /// Drift of states in a second, `[n]`.
    pub state_drift: Vec<f64>,
    /// Drift of disturbances of inputs in a second, `[m]`.
    pub input_drift: Vec<f64>,
    /// Deviation of the initial states, `[n]`.
    pub initial: Vec<f64>,
    /// See [`Settings::parameter_deviation`].
    pub parameter_deviation: Vec<f64>,
    /// See [`Settings::parameter_drift`].
    pub parameter_drift: Vec<f64>,
}

impl Plant {
    /// Of a plan with its regulator.
    ///
    /// # Errors
    /// [`Error::Setting`]: times that do not fit each other, or numbers out of range.
    pub fn new(
        nominal: &Nominal,
        design: &Design,
        controller: &Controller,
        settings: &Settings,
    ) -> Result<Plant, Error> {
        let sample_time = nominal.sample_time;
        let count = |what: &str, time: f64, unit: f64| {
            let parts = time / unit;
            let whole = parts.round();
            if whole >= 1.0 && (parts - whole).abs() < 1e-6 && whole < 1e6 {
                return Ok(whole as usize);
            }
            let what = format!("{what} [s], in multiples of {unit} s");
            Err(Error::Setting { what, value: time, allowed: "a positive whole multiple" })
        };
        let samples_per_step = count("`step` of the prediction", settings.step, sample_time)?;
        let steps = count("`horizon` of the prediction", settings.horizon, settings.step)?;
        let period = count("`period` of the solves", settings.period, settings.step)?;
        let (n, m) = (nominal.states[0].len(), nominal.inputs[0].len());
        if m > 4 || n > 16 {
            let what = format!("{n} states and {m} inputs");
            return Err(Error::Setting { what, value: n as f64, allowed: "at most 16 states and 4 inputs" });
        }
        let costs = costs(controller, design, n)?;
        let samples = nominal.samples();
        let nodes: Vec<usize> = (0..samples).step_by(samples_per_step).chain([samples]).collect();
        // A measured state shows itself at once, wherever it begins.
        let initial = design.initial.iter().enumerate().map(|(i, deviation)| {
            let measured = design.measured.contains(&Measured::State(i));
            if measured { MEASURED_AT_FIRST * deviation } else { *deviation }
        });
        let weight = |deviation: &f64| samples_per_step as f64 / (deviation * deviation);
        Ok(Plant {
            start: nominal.start,
            sample_time,
            samples_per_step,
            step: settings.step,
            steps,
            period,
            iterations: settings.iterations,
            time_budget: settings.time_budget,
            states: nodes.iter().map(|&k| nominal.states[k].clone()).collect(),
            inputs: nodes.iter().map(|&k| nominal.inputs[k].clone()).collect(),
            costs: nodes.iter().map(|&k| costs[k].iter().copied().collect()).collect(),
            deviation: design.state_deviation.clone(),
            state_weight: design.state_deviation.iter().map(weight).collect(),
            input_weight: design.input_deviation.iter().map(weight).collect(),
            limits: design.limits.clone(),
            bounds: settings.bounds.clone(),
            measured: design.measured.clone(),
            noise: design.noise.clone(),
            state_drift: design.state_drift.clone(),
            input_drift: design.input_drift.clone(),
            initial: initial.collect(),
            parameter_deviation: settings.parameter_deviation.clone(),
            parameter_drift: settings.parameter_drift.clone(),
        })
    }

    /// Time of a node \[s\].
    fn time(&self, node: usize) -> f64 {
        self.start + node as f64 * self.step
    }

    /// States and inputs of the plan at a node.
    fn reference(&self, node: usize) -> (&[f64], &[f64]) {
        let node = node.min(self.states.len() - 1);
        (&self.states[node], &self.inputs[node])
    }

    /// Cost from a node on, `[n, n]`.
    fn terminal(&self, node: usize) -> &[f64] {
        &self.costs[node.min(self.costs.len() - 1)]
    }

    /// How far a state is beyond its soft bounds, and the weight of that.
    fn beyond(&self, state: usize, value: f64) -> (f64, f64) {
        let bound = self.bounds.iter().find(|bound| bound.0 == state);
        bound.map_or((0.0, 0.0), |&(_, (low, high), margin)| {
            let beyond = (value - high + margin).max(0.0) + (value - low - margin).min(0.0);
            (beyond, self.samples_per_step as f64 * STIFFNESS / (margin * margin))
        })
    }

    /// Cost of a step, and the largest distance beyond a soft bound in margins.
    fn cost(&self, node: usize, x: &[f64], u: &[f64]) -> (f64, f64) {
        let (x0, u0) = self.reference(node);
        let (mut cost, mut excess) = (0.0, 0.0_f64);
        for (i, x) in x.iter().enumerate() {
            let (beyond, weight) = self.beyond(i, *x);
            cost += 0.5 * (self.state_weight[i] * (x - x0[i]).powi(2) + weight * beyond * beyond);
            if weight > 0.0 {
                excess =
                    excess.max(beyond.abs() * (weight / (STIFFNESS * self.samples_per_step as f64)).sqrt());
            }
        }
        for (j, u) in u.iter().enumerate() {
            cost += 0.5 * self.input_weight[j] * (u - u0[j]).powi(2);
        }
        (cost, excess)
    }
}

/// Cost of the regulator from every sample on, `[n, n]`.
fn costs(controller: &Controller, design: &Design, n: usize) -> Result<Vec<DMatrix<f64>>, Error> {
    let weights = |deviations: &[f64]| {
        let squares = deviations.iter().map(|d| 1.0 / (d * d));
        DMatrix::from_diagonal(&DVector::from_iterator(deviations.len(), squares))
    };
    let (q, r) = (weights(&design.state_deviation), weights(&design.input_deviation));
    let rows = &controller.rows;
    let part = |k: usize| {
        let row = &rows[k];
        let m = row.inputs.len();
        let of = |matrix: &DMatrix<f64>, rows, columns| matrix.view((0, 0), (rows, columns)).into_owned();
        (of(&row.a, n, n), of(&row.b, n, m), of(&row.feedback, m, n))
    };
    let end = rows.len() - 1;
    let (a, b, _) = part(end);
    let mut p = riccati::steady(&a, &b, &q, &r).ok_or(Error::Riccati {
        what: "the cost beyond the horizon does not exist",
        time: controller.start + end as f64 * controller.sample_time,
        why: "the inputs do not reach every state that is not stable by itself, or such a state has no weight",
        remedy: "weights",
    })?;
    let mut costs = vec![p.clone(); end + 1];
    for k in (0..end).rev() {
        let (a, b, gain) = part(k);
        p = riccati::cost_before((&a, &b), &gain, &p, (&q, &r));
        costs[k].copy_from(&p);
    }
    Ok(costs)
}

/// Facts about the last solve.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Statistics {
    /// Wall-clock time \[s\].
    pub solve_time: f64,
    /// Rounds.
    pub iterations: usize,
    /// Whether a plan was found that keeps the soft bounds.
    pub feasible: bool,
}

/// The controller with its memory.
pub struct Nmpc {
    plant: Plant,
    family: Family,
    estimator: Estimator,
    horizon: Horizon,
    /// Number of the next sample.
    sample: usize,
    /// Disturbances at the last solve, `[m]`.
    solved_under: Vec<f64>,
    statistics: Statistics,
    inputs: Vec<f64>,
}

impl Nmpc {
    /// At the begin of the plan.
    pub fn new(plant: Plant, family: Family) -> Nmpc {
        let estimator = Estimator::new(&family, &plant, &plant.states[0]);
        let horizon = Horizon::new(&family, &plant);
        let m = plant.limits.len();
        let (solved_under, inputs) = (vec![0.0; m], plant.inputs[0].clone());
        let statistics = Statistics::default();
        Nmpc { plant, family, estimator, horizon, sample: 0, solved_under, statistics, inputs }
    }

    /// Takes the measured signals `[p]` of a sample and gives the inputs `[m]` that are held until the next; without
    /// `feedback` those of the plan, while the estimate goes on. Where the model has no value at the estimate, the
    /// estimate stays as it is, and so does the last plan: [`Statistics::feasible`] is then false.
    pub fn update(&mut self, measured: &[f64], feedback: bool) -> &[f64] {
        let Nmpc { plant, family, estimator, horizon, .. } = self;
        let time = plant.start + self.sample as f64 * plant.sample_time;
        let corrected = estimator.correct(family, time, measured).is_ok();
        let (node, within) = (self.sample / plant.samples_per_step, self.sample % plant.samples_per_step);
        if !feedback {
            self.inputs.copy_from_slice(plant.reference(node).1);
        } else {
            if within == 0 && node.is_multiple_of(plant.period) {
                let began = Instant::now();
                horizon.shift(node);
                self.solved_under.copy_from_slice(estimator.disturbances());
                let from = (estimator.states(), estimator.disturbances(), estimator.parameters());
                let budget = plant.time_budget;
                let mut late = || budget.is_finite() && began.elapsed().as_secs_f64() > budget;
                let rounds = if node == 0 { 4 * plant.iterations } else { plant.iterations };
                let (iterations, found) = horizon.solve(family, plant, from, rounds, &mut late);
                self.statistics = Statistics {
                    solve_time: began.elapsed().as_secs_f64(),
                    iterations,
                    feasible: found && horizon.feasible(),
                };
            }
            let steps = (node % plant.period) as f64 + within as f64 / plant.samples_per_step as f64;
            let disturbances = estimator.disturbances();
            let change = |j: usize| disturbances[j] - self.solved_under[j];
            horizon.inputs(plant, steps, estimator.states(), change, &mut self.inputs);
        }
        let predicted = estimator.predict(family, (time, plant.sample_time), &self.inputs).is_ok();
        self.statistics.feasible &= corrected && predicted;
        self.sample += 1;
        &self.inputs
    }

    /// Numbers of the controller.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Inputs of the last sample, `[m]`; before the first those of the plan.
    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// Estimated states, disturbances of the inputs, and parameters in widths, `[n + m + n_p]`.
    pub fn estimate(&self) -> &[f64] {
        &self.estimator.estimate
    }

    /// Facts about the last solve.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }
}
