//! Sequential quadratic programming with a filter line search (filter: Fletcher and Leyffer, Mathematical Programming
//! 91, 2002; line search: Wächter and Biegler, Mathematical Programming 106, 2006). The step solves the KKT system with
//! the bounds of the working set held (cheap, structured); where it leaves other bounds or a multiplier has the wrong
//! sign, a quadratic program with all bounds finds the working set. Where neither makes progress, or the constraints
//! have no solution when linearized within the bounds, the interior point method goes on from the point: it restores
//! feasibility.

mod active_set;
mod step;

use super::error::Error;
use super::filter::{Acceptance, Current, Filter, Measure};
use super::form::{Form, length};
use super::interior_point::{ACCEPTABLE_ITERATIONS, Errors, Iterate, Point};
use super::kkt::Kkt;
use super::log::Log;
use super::nlp::EvaluationError;
use super::outcome::{Iteration, Note, Start, Status};
use super::settings::Settings;
use active_set::ActiveSet;
use step::Step;

const CORRECTIONS: usize = 2;
/// Radius after a step, in units of the part of it that was taken. On re-solves of the swing-up that have to go to
/// another minimum (offsets of 1 to 2.4 %, meshes of 40 to 100 intervals) 1 and 4 cost more.
const RADIUS_IN_STEPS: f64 = 2.0;
/// Least radius, in scaled variables: shorter steps are cut for reasons that no model knows, such as noise of
/// derivatives from differences.
const MIN_RADIUS: f64 = 1.0;

/// Outcome of a run.
pub(super) enum End {
    Status(Status),
    /// No step is acceptable; another method may go on.
    NoStep,
}

/// Vectors of a run, kept for the next one.
#[derive(Debug, Default)]
pub(super) struct Memory {
    pub at: Iterate,
    point: Point,
    filter: Filter,
    active: ActiveSet,
    /// The working set before it changed for a step.
    before: ActiveSet,
    step: Step,
    kept: Step,
    trial: Trial,
    corrected: Vec<f64>,
    work: Work,
}

/// Right-hand sides of a step.
#[derive(Debug, Default)]
struct Work {
    diagonal: Vec<f64>,
    known: Vec<f64>,
    right: Vec<f64>,
    rows: Vec<f64>,
    errors: Vec<f64>,
}

pub(super) struct Sqp<'r, 'n, 'm> {
    pub form: &'r mut Form<'n>,
    pub kkt: &'r mut Kkt,
    pub settings: &'r Settings,
    pub log: &'r mut Log<'m>,
    pub memory: Memory,
    last: Iteration,
    pub quadratic_programs: usize,
    programs_in_a_row: usize,
    /// Length of a step up to which the quadratic model proved right.
    radius: f64,
    /// Iterations in a row below the acceptable tolerance.
    acceptable: usize,
}

#[derive(Debug, Default)]
struct Trial {
    x: Vec<f64>,
    rows: Vec<f64>,
    objective: f64,
    measure: Measure,
}

impl<'r, 'n, 'm> Sqp<'r, 'n, 'm> {
    /// A run from a start, evaluated and scaled there.
    pub fn begin(
        form: &'r mut Form<'n>,
        kkt: &'r mut Kkt,
        settings: &'r Settings,
        log: &'r mut Log<'m>,
        start: &Start,
        mut memory: Memory,
    ) -> Result<Self, Error> {
        length("the start", start.x.len(), form.n)?;
        let Memory { at, point, active, step, kept, .. } = &mut memory;
        at.x.clear();
        at.x.extend_from_slice(&start.x);
        at.x.resize(form.total(), 0.0);
        clip(form, &mut at.x);
        form.scale(&at.x, settings.scaling_gradient).map_err(Error::Start)?;
        point.resize(form);
        form.rows_at(&at.x, &mut point.rows).map_err(Error::Start)?;
        for (slack, s) in form.slacks.iter().zip(&mut at.x[form.n..]) {
            *s = point.rows[slack.row];
        }
        clip(form, &mut at.x);
        for (vector, count) in
            [(&mut at.y, form.m), (&mut at.lower, form.total()), (&mut at.upper, form.total())]
        {
            vector.clear();
            vector.resize(count, 0.0);
        }
        if let Some(multipliers) = &start.multipliers {
            at.take_multipliers(form, multipliers)?;
        }
        active.begin(form, at);
        step.resize(form);
        kept.resize(form);
        let last = Iteration::default();
        let mut run = Self {
            form,
            kkt,
            settings,
            log,
            memory,
            last,
            quadratic_programs: 0,
            programs_in_a_row: 0,
            radius: f64::INFINITY,
            acceptable: 0,
        };
        run.evaluate().map_err(Error::Start)?;
        Ok(run)
    }

    fn evaluate(&mut self) -> Result<(), EvaluationError> {
        let Memory { at, point, .. } = &mut self.memory;
        point.objective = self.form.functions(&at.x, &mut point.rows)?;
        self.form.derivatives(&at.x, &mut point.gradient, &mut point.jacobian)
    }

    /// Scaled KKT error of the present point.
    pub fn error(&mut self) -> f64 {
        self.errors().largest()
    }

    fn errors(&mut self) -> Errors {
        let Memory { at, point, work, .. } = &mut self.memory;
        at.errors(self.form, point, 0.0, &mut work.errors)
    }

    /// Iterates until the problem is solved or no step helps.
    pub fn run(&mut self) -> End {
        let theta = self.measure().theta;
        self.memory.filter.restart(theta);
        loop {
            if let Some(status) = self.judge() {
                return End::Status(status);
            }
            let Memory { at, point, .. } = &mut self.memory;
            if let Err(error) = self.form.hessian(&at.x, &at.y, &mut point.hessian) {
                return End::Status(Status::EvaluationFailed(error.to_string()));
            }
            if !self.compute_step() || !self.search() {
                return End::NoStep;
            }
        }
    }

    fn judge(&mut self) -> Option<Status> {
        let errors = self.errors();
        let Memory { at, point, .. } = &self.memory;
        let violation = self.form.violation(&point.rows);
        let row = Iteration {
            objective: point.objective / self.form.objective_scale,
            violation,
            dual_infeasibility: errors.dual,
            ..self.last
        };
        let limit = self.settings.diverging;
        let accepted = self.settings.acceptable_tolerance;
        let close =
            errors.largest() <= accepted && violation <= accepted.max(self.settings.violation_tolerance);
        self.acceptable = if close { self.acceptable + 1 } else { 0 };
        if !self.log.push(row) {
            Some(Status::Interrupted)
        } else if errors.largest() <= self.settings.tolerance
            && violation <= self.settings.violation_tolerance
        {
            Some(Status::Solved)
        } else if self.acceptable >= ACCEPTABLE_ITERATIONS {
            Some(Status::Acceptable)
        } else if self.log.table.len() > self.settings.max_iterations {
            Some(Status::IterationLimit)
        } else if at.x.iter().any(|x| x.abs() > limit) || point.objective < -limit {
            Some(Status::Diverging)
        } else {
            None
        }
    }

    fn measure(&self) -> Measure {
        let point = &self.memory.point;
        let theta = point.rows.iter().map(|c| c.abs()).sum();
        Measure { theta, phi: point.objective }
    }

    /// Backtracks along the step to an acceptable point; false where there is none.
    fn search(&mut self) -> bool {
        let Memory { point, step, .. } = &self.memory;
        let slope = point.gradient.iter().zip(&step.x).map(|(g, d)| g * d).sum();
        let largest = self.step_length();
        let current = Current { at: self.measure(), slope };
        self.last = Iteration { step: largest, regularization: self.kkt.shift, ..Iteration::default() };
        let (shortest, mut length) = (self.memory.filter.shortest(current), 1.0);
        while length >= shortest || length == 1.0 {
            if self.try_length(length) {
                let measure = self.memory.trial.measure;
                if let Some(acceptance) = self.memory.filter.accepts(current, length, measure) {
                    if self.take(current, acceptance, length) {
                        return true;
                    }
                } else if length == 1.0
                    && self.memory.step.correctable
                    && measure.theta >= current.at.theta
                    && self.correct(current)
                {
                    self.last.note = Note::SecondOrderCorrection;
                    return true;
                }
            }
            length *= 0.5;
        }
        false
    }

    /// Evaluates the point at this part of the step; false where it has no values.
    fn try_length(&mut self, length: f64) -> bool {
        let Memory { at, step, trial, .. } = &mut self.memory;
        trial.x.clear();
        trial.x.extend(at.x.iter().zip(&step.x).map(|(x, d)| x + length * d));
        clip(self.form, &mut trial.x);
        trial.rows.resize(self.form.m, 0.0);
        let Ok(objective) = self.form.functions(&trial.x, &mut trial.rows) else { return false };
        let theta = trial.rows.iter().map(|c| c.abs()).sum();
        trial.objective = objective;
        trial.measure = Measure { theta, phi: objective };
        true
    }

    /// Second-order corrections with the working set of the step; false where none is accepted.
    fn correct(&mut self, current: Current) -> bool {
        self.memory.kept.copy_from(&self.memory.step);
        let mut rows = std::mem::take(&mut self.memory.corrected);
        rows.clear();
        rows.extend_from_slice(&self.memory.point.rows);
        let mut before = current.at.theta;
        let mut found = false;
        for attempt in 0..CORRECTIONS {
            let theta = self.memory.trial.measure.theta;
            if attempt > 0 && theta > 0.99 * before {
                break;
            }
            before = theta;
            rows.iter_mut().zip(&self.memory.trial.rows).for_each(|(sum, c)| *sum += c);
            if !self.correct_step(&rows) || !self.step_is_inside() || !self.try_length(1.0) {
                break;
            }
            if let Some(acceptance) = self.memory.filter.accepts(current, 1.0, self.memory.trial.measure) {
                found = self.take(current, acceptance, 1.0);
                break;
            }
        }
        self.memory.corrected = rows;
        if !found {
            let Memory { step, kept, .. } = &mut self.memory;
            std::mem::swap(step, kept);
        }
        found
    }

    /// Moves to the trial point; false when the derivatives have no value there.
    fn take(&mut self, current: Current, acceptance: Acceptance, length: f64) -> bool {
        let Memory { at, point, filter, step, trial, .. } = &mut self.memory;
        let derivatives = self.form.derivatives(&trial.x, &mut point.gradient, &mut point.jacobian);
        if derivatives.is_err() {
            return false;
        }
        if acceptance == Acceptance::Filter {
            filter.add(current.at);
        }
        at.x.copy_from_slice(&trial.x);
        point.objective = trial.objective;
        point.rows.copy_from_slice(&trial.rows);
        let go = |z: &mut [f64], to: &[f64]| {
            z.iter_mut().zip(to).for_each(|(z, to)| *z += length * (to - *z));
        };
        go(&mut at.y, &step.y);
        go(&mut at.lower, &step.lower);
        go(&mut at.upper, &step.upper);
        self.last.step_length = length;
        self.last.note = step.note;
        self.kkt.adapt(length);
        let reach = RADIUS_IN_STEPS * length * self.last.step;
        self.radius = if length < 1.0 { reach.max(MIN_RADIUS) } else { self.radius.max(reach) };
        true
    }
}

/// Moves X into its bounds.
fn clip(form: &Form, x: &mut [f64]) {
    for (x, (&l, &u)) in x.iter_mut().zip(form.lower.iter().zip(&form.upper)) {
        *x = x.clamp(l, u);
    }
}
