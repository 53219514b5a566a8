//! The problem over the horizon, and its solution by stage-wise Gauss-Newton steps with feedback.
//!
//! `min sum_k ½|x - x0|²_Q + ½|u - u0|²_R + ½ w |x outside of its bounds|²  + ½|x_N - x0_N|²_P` over the steps of the
//! horizon; inputs are limited exactly, states are bounded softly. A round is a Riccati recursion backward and a
//! simulation with feedback forward (Tassa, Mansard and Todorov, ICRA 2014), so that every plan is one of the model.

#![allow(clippy::needless_range_loop, reason = "one index runs over several arrays, as in the equations")]

use super::Plant;
use super::family::Family;
use super::step::{Next, Stepper, eliminate};
use crate::transcription::Point;

/// Parts of a step that are tried.
const PARTS: [f64; 4] = [1.0, 0.5, 0.2, 0.05];
/// Distance from a reference, in allowed deviations, that ends a simulation as lost.
const MAX_DISTANCE_FROM_REFERENCE: f64 = 1e4;

/// A simulation of the horizon, row-major.
#[derive(Clone)]
struct Rollout {
    /// `[steps + 1, n]`.
    x: Vec<f64>,
    /// `[steps, m]`.
    u: Vec<f64>,
    /// `[steps, n, n]`.
    a: Vec<f64>,
    /// `[steps, n, m]`.
    b: Vec<f64>,
    /// Largest excess over a bound of a state, in its margins.
    excess: f64,
    cost: f64,
}

/// The plan over the horizon.
pub struct Horizon {
    n: usize,
    m: usize,
    steps: usize,
    /// Node of the grid at which it begins.
    first: usize,
    plan: Rollout,
    trial: Rollout,
    /// Feedback, `[steps, m, n]`.
    k: Vec<f64>,
    /// Change of the inputs, `[steps, m]`.
    kk: Vec<f64>,
    stepper: Stepper,
    v: Vec<f64>,
    vv: Vec<f64>,
    work: Vec<f64>,
    quu: Vec<f64>,
    qux: Vec<f64>,
    qu: Vec<f64>,
    inputs: Vec<f64>,
}

impl Horizon {
    /// Along the reference.
    pub fn new(family: &Family, plant: &Plant) -> Horizon {
        let size = family.size();
        let (n, m, steps) = (size.states, size.inputs, plant.steps);
        let rows = |list: &[Vec<f64>], count: usize| -> Vec<f64> {
            (0..count).flat_map(|k| list[k.min(list.len() - 1)].clone()).collect()
        };
        let plan = Rollout {
            x: rows(&plant.states, steps + 1),
            u: rows(&plant.inputs, steps),
            a: vec![0.0; steps * n * n],
            b: vec![0.0; steps * n * m],
            excess: 0.0,
            cost: f64::INFINITY,
        };
        Horizon {
            n,
            m,
            steps,
            first: 0,
            trial: plan.clone(),
            plan,
            k: vec![0.0; steps * m * n],
            kk: vec![0.0; steps * m],
            stepper: Stepper::new(family),
            v: vec![0.0; n],
            vv: vec![0.0; n * n],
            work: vec![0.0; n * n],
            quu: vec![0.0; m * m],
            qux: vec![0.0; m * (1 + n)],
            qu: vec![0.0; m],
            inputs: vec![0.0; m],
        }
    }

    /// Moves the begin to a later node of the grid; the last input and feedback stay.
    pub fn shift(&mut self, first: usize) {
        let by = (first - self.first).min(self.steps - 1);
        self.first = first;
        let (n, m, steps) = (self.n, self.m, self.steps);
        let shift = |list: &mut [f64], width: usize| {
            list.copy_within(by * width.., 0);
            let count = list.len() / width;
            for k in count - by..count {
                list.copy_within((count - by - 1) * width..(count - by) * width, k * width);
            }
        };
        shift(&mut self.plan.x, n);
        shift(&mut self.plan.u, m);
        shift(&mut self.k, n * m);
        debug_assert_eq!(self.k.len(), steps * n * m);
    }

    /// Whether the plan keeps the bounds of the states, but for a hundredth of their margins.
    pub fn feasible(&self) -> bool {
        self.plan.cost.is_finite() && self.plan.excess <= 1.01
    }

    /// Solves from `states` `[n]` under `disturbances` `[m]` of the inputs and parameters `p` `[n_p]`, with at most
    /// `rounds` rounds or until `stop` says so; gives their number and whether there is a plan. Without one, the plan
    /// before stays.
    pub fn solve(
        &mut self,
        family: &mut Family,
        plant: &Plant,
        (states, disturbances, p): (&[f64], &[f64], &[f64]),
        rounds: usize,
        stop: &mut dyn FnMut() -> bool,
    ) -> (usize, bool) {
        self.kk.fill(0.0);
        let from = (states, disturbances, p);
        let mut found = self.forward(family, plant, from, 1.0);
        if found {
            std::mem::swap(&mut self.plan, &mut self.trial);
        } else {
            // The feedback leads away: the inputs of the plan as they are.
            self.k.fill(0.0);
            found = self.forward(family, plant, from, 0.0);
            if !found {
                return (0, false);
            }
            std::mem::swap(&mut self.plan, &mut self.trial);
        }
        let mut count = 0;
        while count < rounds && !stop() {
            count += 1;
            if !self.backward(plant) {
                break;
            }
            let before = self.plan.cost;
            let mut better = false;
            for part in PARTS {
                if self.forward(family, plant, from, part) && self.trial.cost < before {
                    std::mem::swap(&mut self.plan, &mut self.trial);
                    better = true;
                    break;
                }
            }
            if !better || before - self.plan.cost < 1e-4 * before {
                break;
            }
        }
        (count, true)
    }

    /// Simulates with feedback and a part of the change; false where it is lost.
    fn forward(
        &mut self,
        family: &mut Family,
        plant: &Plant,
        (states, disturbances, p): (&[f64], &[f64], &[f64]),
        part: f64,
    ) -> bool {
        let (n, m) = (self.n, self.m);
        let Horizon { plan, trial, .. } = self;
        trial.x[..n].copy_from_slice(states);
        trial.cost = 0.0;
        trial.excess = 0.0;
        for k in 0..self.steps {
            let (before, after) = trial.x.split_at_mut((k + 1) * n);
            let x = &before[k * n..];
            for j in 0..m {
                let mut u = plan.u[k * m + j] + part * self.kk[k * m + j];
                for i in 0..n {
                    u += self.k[(k * m + j) * n + i] * (x[i] - plan.x[k * n + i]);
                }
                let u = u.clamp(plant.limits[j].0, plant.limits[j].1);
                trial.u[k * m + j] = u;
                self.inputs[j] = u + disturbances[j];
            }
            let (cost, excess) = plant.cost(self.first + k, x, &trial.u[k * m..][..m]);
            trial.cost += cost;
            trial.excess = trial.excess.max(excess);
            let time = plant.time(self.first + k);
            let next = Next {
                x: &mut after[..n],
                a: &mut trial.a[k * n * n..][..n * n],
                b: &mut trial.b[k * n * m..][..n * m],
                g: &mut [],
            };
            let at = Point { time, states: x, inputs: &self.inputs };
            if self.stepper.step(family, (at, p), plant.step, next).is_err()
                || after[..n]
                    .iter()
                    .zip(&plant.deviation)
                    .any(|(x, size)| x.is_nan() || x.abs() > MAX_DISTANCE_FROM_REFERENCE * size)
            {
                return false;
            }
        }
        let last = self.first + self.steps;
        let end = &trial.x[self.steps * n..];
        let (weights, target) = (plant.terminal(last), plant.reference(last).0);
        for i in 0..n {
            for j in 0..n {
                trial.cost += 0.5 * weights[i * n + j] * (end[i] - target[i]) * (end[j] - target[j]);
            }
        }
        trial.cost.is_finite()
    }

    /// Feedback and change of the inputs of every step; false where the problem is not convex, which rounding alone
    /// can do.
    fn backward(&mut self, plant: &Plant) -> bool {
        let (n, m) = (self.n, self.m);
        let Horizon { plan, k: gains, kk, v, vv, work, quu, qux, qu, .. } = self;
        let last = self.first + self.steps;
        let (weights, target) = (plant.terminal(last), plant.reference(last).0);
        let end = &plan.x[self.steps * n..];
        vv.copy_from_slice(weights);
        for i in 0..n {
            v[i] = (0..n).map(|j| weights[i * n + j] * (end[j] - target[j])).sum();
        }
        for k in (0..self.steps).rev() {
            let (a, b) = (&plan.a[k * n * n..][..n * n], &plan.b[k * n * m..][..n * m]);
            let (x, u) = (&plan.x[k * n..][..n], &plan.u[k * m..][..m]);
            let (x0, u0) = plant.reference(self.first + k);
            // work = V A; right = [Q_u, Q_ux].
            for i in 0..n {
                for j in 0..n {
                    work[i * n + j] = (0..n).map(|l| vv[i * n + l] * a[l * n + j]).sum();
                }
            }
            let width = 1 + n;
            for j in 0..m {
                let own = plant.input_weight[j] * (u[j] - u0[j]);
                qu[j] = own + (0..n).map(|i| b[i * m + j] * v[i]).sum::<f64>();
                qux[j * width] = qu[j];
                for i in 0..n {
                    qux[j * width + 1 + i] = (0..n).map(|l| b[l * m + j] * work[l * n + i]).sum();
                }
                for i in 0..m {
                    let curvature: f64 = (0..n)
                        .map(|l| b[l * m + j] * (0..n).map(|r| vv[l * n + r] * b[r * m + i]).sum::<f64>())
                        .sum();
                    quu[j * m + i] = curvature + if i == j { plant.input_weight[j] } else { 0.0 };
                }
            }
            // Before the elimination: Q_ux and Q_u for the cost before this step.
            let (gain, change) = (&mut gains[k * m * n..][..m * n], &mut kk[k * m..][..m]);
            let mut right: [f64; 4 * 17] = [0.0; 4 * 17];
            let mut matrix: [f64; 16] = [0.0; 16];
            let mut fixed: [Option<f64>; 4] = [None; 4];
            loop {
                right[..m * width].copy_from_slice(qux);
                matrix[..m * m].copy_from_slice(quu);
                for j in 0..m {
                    let Some(value) = fixed[j] else { continue };
                    (0..m).for_each(|i| matrix[j * m + i] = if i == j { 1.0 } else { 0.0 });
                    right[j * width..][..width].fill(0.0);
                    right[j * width] = -value;
                }
                if !eliminate(&mut matrix[..m * m], &mut right[..m * width], m, width) {
                    return false;
                }
                let mut more = false;
                for j in 0..m {
                    let (low, high) = plant.limits[j];
                    let wanted = u[j] - right[j * width];
                    if fixed[j].is_none() && !(low..=high).contains(&wanted) {
                        fixed[j] = Some(wanted.clamp(low, high) - u[j]);
                        more = true;
                    }
                }
                if !more {
                    break;
                }
            }
            for j in 0..m {
                change[j] = -right[j * width];
                (0..n).for_each(|i| gain[j * n + i] = -right[j * width + 1 + i]);
            }
            // V = Q_xx + K'Q_uu K + K'Q_ux + Q_ux'K, v = Q_x + K'(Q_uu k + Q_u) + Q_ux'k.
            let mut slope = [0.0; 16];
            for i in 0..n {
                let mut value: f64 = (0..n).map(|l| a[l * n + i] * v[l]).sum();
                for j in 0..m {
                    let along: f64 = (0..m).map(|l| quu[j * m + l] * change[l]).sum();
                    value += gain[j * n + i] * (along + qu[j]) + qux[j * width + 1 + i] * change[j];
                }
                slope[i] = value;
            }
            for i in 0..n {
                for j in 0..=i {
                    let mut value: f64 = (0..n).map(|l| a[l * n + i] * work[l * n + j]).sum();
                    for l in 0..m {
                        let along: f64 = (0..m).map(|r| quu[l * m + r] * gain[r * n + j]).sum();
                        value += gain[l * n + i] * (along + qux[l * width + 1 + j])
                            + qux[l * width + 1 + i] * gain[l * n + j];
                    }
                    vv[i * n + j] = value;
                    vv[j * n + i] = value;
                }
            }
            v.copy_from_slice(&slope[..n]);
            for i in 0..n {
                v[i] += plant.state_weight[i] * (x[i] - x0[i]);
                vv[i * n + i] += plant.state_weight[i];
                let (beyond, weight) = plant.beyond(i, x[i]);
                v[i] += weight * beyond;
                vv[i * n + i] += if beyond == 0.0 { 0.0 } else { weight };
            }
        }
        v.iter().chain(vv.iter()).all(|value| value.is_finite())
    }

    /// Inputs `[m]` at a part of the steps after the begin: `u = u0 + K (x - x0) - (d - d0)`, within the limits.
    pub fn inputs(
        &self,
        plant: &Plant,
        steps: f64,
        states: &[f64],
        change: impl Fn(usize) -> f64,
        out: &mut [f64],
    ) {
        let (n, m) = (self.n, self.m);
        let k = (steps as usize).min(self.steps - 1);
        let part = (steps - k as f64).min(1.0);
        for j in 0..m {
            let mut u = self.plan.u[k * m + j] - change(j);
            for i in 0..n {
                let (from, to) = (self.plan.x[k * n + i], self.plan.x[(k + 1) * n + i]);
                u += self.k[(k * m + j) * n + i] * (states[i] - from - part * (to - from));
            }
            out[j] = u.clamp(plant.limits[j].0, plant.limits[j].1);
        }
    }
}
