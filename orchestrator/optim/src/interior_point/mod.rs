//! Primal-dual interior point method with a filter line search (Wächter and Biegler, Mathematical Programming 106,
//! 2006): barrier for the bounds, Newton steps on the KKT conditions, restoration of feasibility where no step
//! is acceptable.

mod iterate;
mod line_search;
mod restoration;
mod start;

use super::filter::{Current, Filter, Measure};
use super::form::Form;
use super::kkt::Kkt;
use super::log::Log;
use super::nlp::EvaluationError;
use super::outcome::{Iteration, Note, Status};
use super::settings::Settings;
pub(super) use iterate::{Errors, Iterate, Point};
use line_search::{Search, Trial};
use restoration::Goal;

/// Error of a barrier problem, in units of its parameter, at which the parameter falls.
const BARRIER_ERROR: f64 = 10.0;
const BARRIER_FACTOR: f64 = 0.2;
const BARRIER_POWER: f64 = 1.5;
/// Shift of the scaled Hessian from which on the multipliers of the step are those of another problem: least squares
/// gives better ones, and the next Hessian less negative curvature (on the swing-up half of the iterations).
const STRONG_SHIFT: f64 = 2.0;
/// Least part of a step to the bound that is taken.
const MIN_FRACTION_TO_BOUNDARY: f64 = 0.99;
/// Iterations below the acceptable tolerance after which the run ends.
pub(super) const ACCEPTABLE_ITERATIONS: usize = 15;
/// Restorations that lead to a feasible point which the filter refuses, before the run ends.
const MAX_USELESS_RESTORATIONS: usize = 5;

/// Outcome of a run on one form.
pub(super) enum End {
    Status(Status),
    /// The restoration found a point from which the main run can go on.
    Restored,
}

/// Newton step with the steps of all multipliers.
#[derive(Debug, Default)]
pub(super) struct Step {
    x: Vec<f64>,
    y: Vec<f64>,
    bounds: [Vec<f64>; 2],
    /// Longest part allowed by the bounds, of X and of their multipliers.
    longest: f64,
    longest_multipliers: f64,
}

/// Vectors of a run, kept for the next one.
#[derive(Debug, Default)]
pub(super) struct Memory {
    pub at: Iterate,
    point: Point,
    filter: Filter,
    step: Step,
    kept: Step,
    trial: Trial,
    corrected: Vec<f64>,
    diagonal: Vec<f64>,
    work: Vec<f64>,
    negative_rows: Vec<f64>,
}

/// State of a run.
pub(super) struct Run<'r, 'n, 'm> {
    pub form: &'r mut Form<'n>,
    pub kkt: &'r mut Kkt,
    pub settings: &'r Settings,
    pub log: &'r mut Log<'m>,
    pub at: Iterate,
    pub barrier: f64,
    point: Point,
    filter: Filter,
    goal: Option<Goal>,
    step: Step,
    /// The step before its corrections, and the rows that they start from.
    kept: Step,
    corrected: Vec<f64>,
    trial: Trial,
    diagonal: Vec<f64>,
    work: Vec<f64>,
    negative_rows: Vec<f64>,
    /// Entry of the table for the step that led here.
    last: Iteration,
    acceptable: usize,
    tiny: usize,
    emergencies: usize,
}

impl<'r, 'n, 'm> Run<'r, 'n, 'm> {
    /// A run from the iterate in the memory; X strictly inside its bounds.
    pub fn new(
        form: &'r mut Form<'n>,
        kkt: &'r mut Kkt,
        settings: &'r Settings,
        log: &'r mut Log<'m>,
        memory: Memory,
        barrier: f64,
    ) -> Self {
        let Memory {
            at,
            mut point,
            mut filter,
            mut step,
            mut kept,
            trial,
            corrected,
            diagonal,
            work,
            negative_rows,
        } = memory;
        point.resize(form);
        filter.restart(0.0);
        for step in [&mut step, &mut kept] {
            step.x.resize(form.total(), 0.0);
            step.y.resize(form.m, 0.0);
        }
        kkt.least_shift = 0.0;
        Self {
            form,
            kkt,
            settings,
            log,
            at,
            barrier,
            point,
            filter,
            goal: None,
            step,
            kept,
            corrected,
            trial,
            diagonal,
            work,
            negative_rows,
            last: Iteration::default(),
            acceptable: 0,
            tiny: 0,
            emergencies: 0,
        }
    }

    /// The vectors, with the last iterate, for another run.
    pub fn into_memory(self) -> Memory {
        let Self { at, point, filter, step, kept, corrected, trial, diagonal, work, negative_rows, .. } =
            self;
        Memory { at, point, filter, step, kept, corrected, trial, diagonal, work, negative_rows }
    }

    /// Functions and derivatives at the present point.
    fn evaluate(&mut self) -> Result<(), EvaluationError> {
        self.form.set_barrier(self.barrier);
        self.point.objective = self.form.functions(&self.at.x, &mut self.point.rows)?;
        self.form.derivatives(&self.at.x, &mut self.point.gradient, &mut self.point.jacobian)
    }

    /// Iterates until the problem is solved or nothing helps; the point is evaluated.
    pub fn run(&mut self) -> End {
        self.filter.restart(self.theta());
        loop {
            let errors = self.errors(0.0);
            if let Some(end) = self.judge(errors) {
                return end;
            }
            self.update_barrier();
            if self.goal.is_none() && self.last.regularization >= STRONG_SHIFT {
                self.estimate_multipliers();
            }
            if let Err(error) = self.form.hessian(&self.at.x, &self.at.y, &mut self.point.hessian) {
                return End::Status(Status::EvaluationFailed(error.to_string()));
            }
            let search = if self.newton_step() { self.search() } else { Search::Failed(None) };
            match search {
                Search::Accepted => {}
                Search::Failed(reason) => {
                    if let Some(end) = self.restore(reason) {
                        return end;
                    }
                }
            }
        }
    }

    /// Writes the row of the table and says whether the run ends here.
    fn judge(&mut self, errors: Errors) -> Option<End> {
        let violation = self.own_violation();
        let restoring = self.goal.is_some();
        let objective = match restoring {
            false => self.point.objective / self.form.objective_scale,
            true => self.form.plain_objective(&self.at.x),
        };
        let note = if restoring { Note::Restoration } else { self.last.note };
        let row = Iteration {
            objective,
            violation,
            dual_infeasibility: errors.dual,
            barrier: self.barrier,
            note,
            ..self.last
        };
        let goes_on = self.log.push(row);
        if self.goal_reached() {
            return Some(End::Restored);
        }
        let status = if !goes_on {
            Status::Interrupted
        } else if errors.largest() <= self.settings.tolerance
            && (restoring || violation <= self.settings.violation_tolerance)
        {
            if restoring { Status::Infeasible } else { Status::Solved }
        } else if self.log.table.len() > self.settings.max_iterations {
            Status::IterationLimit
        } else if self.diverges() {
            Status::Diverging
        } else {
            let close = !restoring && self.is_acceptable(errors, violation);
            self.acceptable = if close { self.acceptable + 1 } else { 0 };
            if self.acceptable < ACCEPTABLE_ITERATIONS {
                return None;
            }
            Status::Acceptable
        };
        Some(End::Status(status))
    }

    fn is_acceptable(&self, errors: Errors, violation: f64) -> bool {
        errors.largest() <= self.settings.acceptable_tolerance
            && violation <= self.settings.acceptable_tolerance.max(self.settings.violation_tolerance)
    }

    /// The status when no step is left.
    fn stuck(&mut self, status: Status) -> End {
        let (errors, violation) = (self.errors(0.0), self.own_violation());
        let close = self.goal.is_none() && self.is_acceptable(errors, violation);
        End::Status(if close { Status::Acceptable } else { status })
    }

    fn diverges(&self) -> bool {
        let limit = self.settings.diverging;
        self.at.x[..self.form.n].iter().any(|x| x.abs() > limit) || self.point.objective < -limit
    }

    /// Scaled KKT error of the present point.
    pub fn error(&mut self) -> f64 {
        self.errors(0.0).largest()
    }

    fn errors(&mut self, barrier: f64) -> Errors {
        self.at.errors(self.form, &self.point, barrier, &mut self.work)
    }

    /// Violation of the rows without relaxations, in the units of the constraints.
    fn own_violation(&mut self) -> f64 {
        self.work.clear();
        self.work.extend_from_slice(&self.point.rows);
        self.form.remove_relaxations(&self.at.x, &mut self.work);
        self.form.violation(&self.work)
    }

    fn theta(&self) -> f64 {
        self.point.rows.iter().map(|c| c.abs()).sum()
    }

    /// Violation and barrier objective of the present point, with the slope along the step.
    fn current(&mut self) -> Current {
        let terms = self.at.barrier_terms(self.form, self.form.total());
        let at = Measure { theta: self.theta(), phi: self.point.objective + self.barrier * terms };
        self.work.clear();
        self.work.extend_from_slice(&self.point.gradient);
        self.at.add_barrier_gradient(self.form, self.barrier, &mut self.work);
        let slope = self.work.iter().zip(&self.step.x).map(|(g, d)| g * d).sum();
        Current { at, slope }
    }

    fn smallest_barrier(&self) -> f64 {
        self.settings.tolerance / 10.0
    }

    /// Lowers the barrier parameter as long as its problem is solved well enough.
    fn update_barrier(&mut self) {
        while self.barrier > self.smallest_barrier() {
            let solved = self.errors(self.barrier).largest() <= BARRIER_ERROR * self.barrier;
            if !solved && self.tiny == 0 {
                break;
            }
            self.tiny = 0;
            self.lower_barrier();
        }
    }

    fn lower_barrier(&mut self) {
        let lower = (BARRIER_FACTOR * self.barrier).min(self.barrier.powf(BARRIER_POWER));
        self.barrier = lower.max(self.smallest_barrier());
        self.filter.clear();
        if self.goal.is_some() {
            // The weight of the distance follows the barrier parameter; the point was evaluated before.
            let refreshed = self.evaluate();
            debug_assert!(refreshed.is_ok());
        }
    }

    fn fraction(&self) -> f64 {
        MIN_FRACTION_TO_BOUNDARY.max(1.0 - self.barrier)
    }

    /// Solves for the Newton step; false when no shift of the Hessian gives a useful one.
    fn newton_step(&mut self) -> bool {
        self.at.diagonal(self.form, &mut self.diagonal);
        let (form, point) = (&*self.form, &self.point);
        let held = |j| form.fixed(j);
        let factored =
            self.kkt.factor(form, &point.hessian, &point.jacobian, &self.diagonal, held, self.barrier);
        if factored.is_err() {
            return false;
        }
        while !self.solve(None) {
            let (form, point) = (&*self.form, &self.point);
            let raised = self.kkt.raise(form, &point.hessian, &point.jacobian, &self.diagonal, self.barrier);
            if raised.is_err() {
                return false;
            }
        }
        true
    }

    /// Solves with the factorized matrix for these rows, or those of the point; false when the result is useless.
    fn solve(&mut self, rows: Option<&[f64]>) -> bool {
        self.work.clear();
        self.work.extend_from_slice(&self.point.gradient);
        self.form.add_transposed(&self.point.jacobian, &self.at.y, &mut self.work);
        self.at.add_barrier_gradient(self.form, self.barrier, &mut self.work);
        self.work.iter_mut().for_each(|g| *g = -*g);
        self.negative_rows.clear();
        self.negative_rows.extend(rows.unwrap_or(&self.point.rows).iter().map(|c| -c));
        let Step { x, y, bounds, .. } = &mut self.step;
        if !self.kkt.solve(self.form, &self.point.jacobian, (&self.work, &self.negative_rows), x, y) {
            return false;
        }
        self.at.multiplier_steps(self.form, x, self.barrier, bounds);
        let fraction = self.fraction();
        self.step.longest = self.at.longest_step(self.form, &self.step.x, fraction);
        self.step.longest_multipliers = self.at.longest_multiplier_step(&self.step.bounds, fraction);
        true
    }
}
