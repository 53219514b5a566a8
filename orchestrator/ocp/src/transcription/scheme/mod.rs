//! One interval of a mesh: its defects and what belongs to points inside it, with first and second derivatives.
//!
//! Nodes are evaluated before, once for both intervals they belong to. What an interval adds to the Hessian is the
//! congruence of the Hessians at its inner points, and weights on the functions at its ends: the curvature there is
//! added once, by the node.

mod collocation;
mod shooting;
mod shooting_collocation;

pub(super) use collocation::Collocation;
pub(super) use shooting::{MultipleShooting, Sample};
pub(super) use shooting_collocation::ShootingCollocation;

use super::dynamics::Dynamics;
use super::functions::{At, Functions, Scratch};
use airloop_optim::EvaluationError;

/// Points with the functions there.
#[derive(Debug, Clone, Default)]
pub(super) struct Points {
    nq: usize,
    nv: usize,
    pub q: Vec<f64>,
    pub values: Vec<f64>,
    pub jacobian: Vec<f64>,
    pub times: Vec<f64>,
}

impl Points {
    pub fn new(count: usize, functions: &Functions) -> Points {
        let (nq, nv) = (functions.arguments(), functions.values());
        Points {
            nq,
            nv,
            q: vec![0.0; count * nq],
            values: vec![0.0; count * nv],
            jacobian: vec![0.0; count * nv * nq],
            times: vec![0.0; count],
        }
    }

    pub fn q(&self, i: usize) -> &[f64] {
        &self.q[i * self.nq..(i + 1) * self.nq]
    }

    pub fn q_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.q[i * self.nq..(i + 1) * self.nq]
    }

    pub fn values(&self, i: usize) -> &[f64] {
        &self.values[i * self.nv..(i + 1) * self.nv]
    }

    pub fn jacobian(&self, i: usize) -> &[f64] {
        &self.jacobian[i * self.nv * self.nq..(i + 1) * self.nv * self.nq]
    }

    /// Row of the Jacobian of one value.
    pub fn row(&self, i: usize, value: usize) -> &[f64] {
        &self.jacobian(i)[value * self.nq..(value + 1) * self.nq]
    }

    fn at(&self, i: usize) -> At<'_> {
        At { time: self.times[i], q: self.q(i), values: self.values(i), jacobian: self.jacobian(i) }
    }

    /// Evaluates the functions at point `i`, whose arguments are set.
    pub fn evaluate(
        &mut self,
        i: usize,
        worker: &mut Worker<'_>,
        functions: &Functions,
        derivatives: bool,
    ) -> Result<(), EvaluationError> {
        let (nq, nv) = (self.nq, self.nv);
        let q = &self.q[i * nq..(i + 1) * nq];
        let values = &mut self.values[i * nv..(i + 1) * nv];
        let time = self.times[i];
        if derivatives {
            let jacobian = &mut self.jacobian[i * nv * nq..(i + 1) * nv * nq];
            functions.jacobian(worker.dynamics.as_mut(), &mut worker.scratch, time, q, values, jacobian)
        } else {
            functions.evaluate(worker.dynamics.as_mut(), time, q, values)
        }
    }
}

/// An instance of the dynamics with the memory of its thread.
pub(super) struct Worker<'a> {
    pub dynamics: Box<dyn Dynamics + 'a>,
    pub scratch: Scratch,
    pub weights: Vec<f64>,
    pub hessian: Vec<f64>,
    pub product: Vec<f64>,
    pub rows: Vec<f64>,
    pub adjoint: Vec<f64>,
}

impl<'a> Worker<'a> {
    pub fn new(dynamics: Box<dyn Dynamics + 'a>, functions: &Functions, width: usize) -> Worker<'a> {
        let (nq, nv) = (functions.arguments(), functions.values());
        Worker {
            dynamics,
            scratch: Scratch::default(),
            weights: vec![0.0; nv],
            hessian: vec![0.0; nq * nq],
            product: vec![0.0; width],
            rows: vec![0.0; 3 * nq * width],
            adjoint: vec![0.0; 6 * nq],
        }
    }

    /// Hessian of `self.weights . values` at a point, into `self.hessian`.
    pub fn curvature(
        &mut self,
        points: &Points,
        i: usize,
        functions: &Functions,
    ) -> Result<(), EvaluationError> {
        let dynamics = self.dynamics.as_mut();
        functions.hessian(dynamics, &mut self.scratch, points.at(i), &self.weights, &mut self.hessian)
    }
}

/// Inputs of the calculation of an interval.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub functions: &'a Functions,
    pub k: usize,
    /// Time of the left node, s.
    pub time: f64,
    /// Length in seconds, for the time of inner points.
    pub seconds: f64,
    /// Length in the time of the mesh: seconds, or fractions where the duration is free.
    pub length: f64,
    /// Variables of the interval.
    pub w: &'a [f64],
    pub left: &'a Points,
    pub right: &'a Points,
}

impl Frame<'_> {
    /// Index at which the states of the right node begin.
    pub fn right_states(&self, middle: usize) -> usize {
        self.functions.arguments() + middle + self.functions.free
    }
}

/// Results of the calculation of an interval.
#[derive(Debug, Clone, Default)]
pub(super) struct Interval {
    /// Variables n_w.
    pub width: usize,
    /// Inner points.
    pub points: Points,
    /// Derivatives of their arguments by the variables of the interval, `[points, n_q, row width]`.
    pub rows: Vec<f64>,
    /// Defects first, then further rows, `[m]` and `[m, n_w]`.
    pub values: Vec<f64>,
    pub jacobian: Vec<f64>,
    /// Cost of the inner points, and its gradient `[n_w]`.
    pub cost: f64,
    pub gradient: Vec<f64>,
    /// Lower triangle of the Hessian without the curvature at the nodes, `[n_w, n_w]`.
    pub block: Vec<f64>,
    /// Weights on the functions at the ends, `[n_v]`.
    pub ends: [Vec<f64>; 2],
    /// Multipliers of constraints on the point in the middle, summed: on its values and on its arguments.
    pub on_values: Vec<f64>,
    pub on_arguments: Vec<f64>,
}

impl Interval {
    pub fn new(width: usize, points: usize, rows: usize, constraints: usize, functions: &Functions) -> Self {
        let (nq, nv) = (functions.arguments(), functions.values());
        Interval {
            width,
            points: Points::new(points, functions),
            rows: vec![0.0; points * nq * rows],
            values: vec![0.0; constraints],
            jacobian: vec![0.0; constraints * width],
            cost: 0.0,
            gradient: vec![0.0; width],
            block: vec![0.0; width * width],
            ends: [vec![0.0; nv], vec![0.0; nv]],
            on_values: vec![0.0; nv],
            on_arguments: vec![0.0; nq],
        }
    }
}

/// Scheme by which an interval is made discrete.
pub(super) trait Scheme: Send + Sync {
    /// Variables in the middle of an interval, given those of the functions.
    fn middle(&self, states: usize, inputs: usize) -> usize;

    /// Inputs are held over intervals.
    fn held(&self) -> bool {
        false
    }

    /// Inner points of interval `k`.
    fn points(&self, k: usize) -> usize;

    /// Width of the derivative rows of inner points, at most that of the interval.
    fn row_width(&self, layout: &super::layout::Layout, k: usize) -> usize {
        layout.interval(k).len()
    }

    /// The inner point in the middle, for constraints there.
    fn midpoint(&self) -> Option<usize> {
        None
    }

    /// Defects, `[count]`, in terms of the states.
    fn defects(&self, states: usize) -> usize {
        states
    }

    /// Whether the functions are needed at the left node of every interval, and at the last node.
    fn needs_nodes(&self) -> [bool; 2];

    /// Weights of the cost at the left and the right node, in units of the length of the interval.
    fn end_weights(&self) -> [f64; 2];

    /// Defects and cost; with `derivatives` their Jacobian and gradient, too.
    fn evaluate(
        &self,
        worker: &mut Worker<'_>,
        frame: Frame<'_>,
        interval: &mut Interval,
        derivatives: bool,
    ) -> Result<(), EvaluationError>;

    /// Block of the Hessian and weights for the ends; `multipliers` of the defects, `factor` of the objective.
    fn adjoint(
        &self,
        worker: &mut Worker<'_>,
        frame: Frame<'_>,
        interval: &mut Interval,
        multipliers: &[f64],
        factor: f64,
    ) -> Result<(), EvaluationError>;
}
