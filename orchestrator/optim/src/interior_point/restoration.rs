//! Restoration of feasibility: the rows are relaxed by p, n >= 0 whose sum is minimized near the present point, by
//! the same method, until a point is found that the filter of the main run admits.

use super::{End, Iterate, MAX_USELESS_RESTORATIONS, Memory, Run};
use crate::filter::{Filter, Measure};
use crate::form::{Form, RELAXATION_COST};
use crate::outcome::Status;

/// Decrease of the violation that the restoration has to bring.
const REQUIRED_DECREASE: f64 = 0.9;

/// Data that the main run needs to go on.
#[derive(Clone, Debug)]
pub(super) struct Goal {
    filter: Filter,
    theta: f64,
    barrier: f64,
}

impl Run<'_, '_, '_> {
    /// Called where the step leads to no acceptable point. None: the run goes on from another point.
    pub(super) fn restore(&mut self, reason: Option<String>) -> Option<End> {
        let failed = match reason {
            Some(reason) => Status::EvaluationFailed(reason),
            None => Status::Stalled,
        };
        if self.goal.is_some() {
            return self.renew_relaxations(failed);
        }
        let current = self.current().at;
        let feasible = self.own_violation() <= self.settings.violation_tolerance.min(self.settings.tolerance);
        if feasible || self.form.m == 0 {
            return self.emergency(failed);
        }
        self.filter.add(current);
        let size = self.point.rows.iter().fold(0.0f64, |m, c| m.max(c.abs()));
        let goal = Goal { filter: self.filter.clone(), theta: current.theta, barrier: self.barrier };
        let own = self.form.total();
        self.form.relax(&self.at.x);
        let barrier = self.barrier.max(size);
        let mut at = Iterate { y: vec![0.0; self.form.m], ..self.at.clone() };
        at.lower.iter_mut().chain(&mut at.upper).for_each(|z| *z = z.min(RELAXATION_COST));
        relaxations(&self.point.rows, barrier, &mut at);
        let memory = Memory { at, ..Memory::default() };
        let mut inner = Run::new(self.form, self.kkt, self.settings, self.log, memory, barrier);
        inner.goal = Some(goal);
        let end = match inner.evaluate() {
            Ok(()) => inner.run(),
            Err(error) => End::Status(Status::EvaluationFailed(error.to_string())),
        };
        let mut at = std::mem::take(&mut inner.at);
        self.form.unrelax();
        [&mut at.x, &mut at.lower, &mut at.upper].into_iter().for_each(|v| v.truncate(own));
        // Where the problem is infeasible, the multipliers of the restoration say which bounds stand in the way.
        self.at = at;
        if let Err(error) = self.evaluate() {
            return Some(End::Status(Status::EvaluationFailed(error.to_string())));
        }
        if !matches!(end, End::Status(Status::Infeasible | Status::Acceptable)) {
            self.at.reset_multipliers(self.form, self.barrier);
            self.estimate_multipliers();
        }
        match end {
            End::Restored => None,
            End::Status(Status::Infeasible | Status::Stalled | Status::Acceptable)
                if self.own_violation() <= self.settings.violation_tolerance =>
            {
                self.emergency(failed)
            }
            End::Status(Status::Acceptable) => Some(End::Status(Status::Infeasible)),
            end => Some(end),
        }
    }

    /// A feasible point that the filter does not admit: it is forgotten, a few times.
    fn emergency(&mut self, failed: Status) -> Option<End> {
        self.emergencies += 1;
        if self.emergencies > MAX_USELESS_RESTORATIONS || self.filter.is_empty() {
            return Some(self.stuck(failed));
        }
        self.filter.clear();
        None
    }

    /// Within the restoration: the best relaxations for the present point, and an empty filter.
    fn renew_relaxations(&mut self, failed: Status) -> Option<End> {
        self.emergencies += 1;
        if self.emergencies > MAX_USELESS_RESTORATIONS {
            return Some(End::Status(failed));
        }
        let own = self.form.n + self.form.own_slacks();
        self.work.clear();
        self.work.extend_from_slice(&self.point.rows);
        self.form.remove_relaxations(&self.at.x, &mut self.work);
        self.at.x.truncate(own);
        self.at.lower.truncate(own);
        self.at.upper.truncate(own);
        relaxations(&self.work, self.barrier, &mut self.at);
        self.filter.clear();
        match self.evaluate() {
            Ok(()) => None,
            Err(error) => Some(End::Status(Status::EvaluationFailed(error.to_string()))),
        }
    }

    /// The point without its relaxations is one for the main run.
    pub(super) fn goal_reached(&mut self) -> bool {
        let Some(goal) = &self.goal else { return false };
        let own = self.form.n + self.form.own_slacks();
        let mut rows = self.point.rows.clone();
        self.form.remove_relaxations(&self.at.x, &mut rows);
        let theta: f64 = rows.iter().map(|c| c.abs()).sum();
        if theta > REQUIRED_DECREASE * goal.theta {
            return false;
        }
        let Ok(objective) = self.form.own_objective(&self.at.x) else { return false };
        let phi = objective + goal.barrier * self.at.barrier_terms(self.form, own);
        goal.filter.admits(Measure { theta, phi })
    }
}

/// Appends the relaxations that minimize the barrier problem for these rows, with their multipliers.
fn relaxations(rows: &[f64], barrier: f64, at: &mut Iterate) {
    for &row in rows {
        let half = (barrier - RELAXATION_COST * row) / (2.0 * RELAXATION_COST);
        let n = half + (half * half + barrier * row / (2.0 * RELAXATION_COST)).sqrt();
        let n = n.max(1e-20);
        let p = (row + n).max(1e-20);
        // The order of `Form::relax`: -p, then +n, in row - p + n = 0.
        for value in [p, n] {
            at.x.push(value);
            at.lower.push(barrier / value);
            at.upper.push(0.0);
        }
    }
}

/// Multipliers of the rows by least squares.
impl Run<'_, '_, '_> {
    /// y that makes the gradient of the Lagrangian smallest; zero where it would be large.
    pub(super) fn estimate_multipliers(&mut self) {
        let form: &Form = self.form;
        let mut gradient = self.point.gradient.clone();
        for ((g, l), u) in gradient.iter_mut().zip(&self.at.lower).zip(&self.at.upper) {
            *g = l - u - *g;
        }
        let hessian = vec![0.0; form.hessian_entries.len()];
        let ones = vec![1.0; form.total()];
        let held = |j| form.fixed(j);
        let (rows, mut x) = (vec![0.0; form.m], vec![0.0; form.total()]);
        let jacobian = &self.point.jacobian;
        let least_shift = std::mem::take(&mut self.kkt.least_shift);
        let good = self.kkt.factor(form, &hessian, jacobian, &ones, held, 1.0).is_ok()
            && self.kkt.solve(form, jacobian, (&gradient, &rows), &mut x, &mut self.at.y);
        self.kkt.least_shift = least_shift;
        if !good || self.at.y.iter().any(|y| y.abs() > 1e3 || y.is_nan()) {
            self.at.y.fill(0.0);
        }
    }
}
