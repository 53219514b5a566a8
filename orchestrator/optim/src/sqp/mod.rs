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
use super::interior_point::{Errors, Iterate, Point};
use super::kkt::Kkt;
use super::log::Log;
use super::nlp::EvaluationError;
use super::outcome::{Iteration, Note, Start, Status};
use super::settings::Settings;
use active_set::ActiveSet;
use step::Step;

const CORRECTIONS: usize = 2;

/// Outcome of a run.
pub(super) enum End {
    Status(Status),
    /// No step is acceptable; another method may go on.
    NoStep,
}

pub(super) struct Sqp<'r, 'n, 'm> {
    pub form: &'r mut Form<'n>,
    pub kkt: &'r mut Kkt,
    pub settings: &'r Settings,
    pub log: &'r mut Log<'m>,
    pub at: Iterate,
    point: Point,
    filter: Filter,
    active: ActiveSet,
    step: Step,
    work: Vec<f64>,
    last: Iteration,
    pub quadratic_programs: usize,
    programs_in_a_row: usize,
}

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
    ) -> Result<Self, Error> {
        length("the start", start.x.len(), form.n)?;
        let mut x = start.x.clone();
        x.resize(form.total(), 0.0);
        clip(form, &mut x);
        form.scale(&x, settings.scaling_gradient).map_err(Error::Start)?;
        let mut rows = vec![0.0; form.m];
        form.rows_at(&x, &mut rows).map_err(Error::Start)?;
        for (slack, s) in form.slacks.iter().zip(&mut x[form.n..]) {
            *s = rows[slack.row];
        }
        clip(form, &mut x);
        let total = form.total();
        let mut at = Iterate { x, y: vec![0.0; form.m], lower: vec![0.0; total], upper: vec![0.0; total] };
        if let Some(multipliers) = &start.multipliers {
            at.take_multipliers(form, multipliers)?;
        }
        let point = Point {
            objective: f64::NAN,
            rows,
            gradient: vec![0.0; total],
            jacobian: vec![0.0; form.jacobian_entries.len()],
            hessian: vec![0.0; form.hessian_entries.len()],
        };
        let active = ActiveSet::new(form, &mut at)?;
        let step = Step::new(form);
        let mut run = Self {
            form,
            kkt,
            settings,
            log,
            at,
            point,
            filter: Filter::default(),
            active,
            step,
            work: Vec::new(),
            last: Iteration::default(),
            quadratic_programs: 0,
            programs_in_a_row: 0,
        };
        run.evaluate().map_err(Error::Start)?;
        Ok(run)
    }

    fn evaluate(&mut self) -> Result<(), EvaluationError> {
        self.point.objective = self.form.functions(&self.at.x, &mut self.point.rows)?;
        self.form.derivatives(&self.at.x, &mut self.point.gradient, &mut self.point.jacobian)
    }

    /// Scaled KKT error of the present point.
    pub fn error(&mut self) -> f64 {
        self.errors().largest()
    }

    fn errors(&mut self) -> Errors {
        self.at.errors(self.form, &self.point, 0.0, &mut self.work)
    }

    /// Iterates until the problem is solved or no step helps.
    pub fn run(&mut self) -> End {
        self.filter = Filter::new(self.measure().theta);
        loop {
            if let Some(status) = self.judge() {
                return End::Status(status);
            }
            if let Err(error) = self.form.hessian(&self.at.x, &self.at.y, &mut self.point.hessian) {
                return End::Status(Status::EvaluationFailed(error.to_string()));
            }
            if !self.compute_step() || !self.search() {
                return End::NoStep;
            }
        }
    }

    fn judge(&mut self) -> Option<Status> {
        let errors = self.errors();
        let violation = self.form.violation(&self.point.rows);
        let row = Iteration {
            objective: self.point.objective / self.form.objective_scale,
            violation,
            dual_infeasibility: errors.dual,
            ..self.last
        };
        let limit = self.settings.diverging;
        if !self.log.push(row) {
            Some(Status::Interrupted)
        } else if errors.largest() <= self.settings.tolerance
            && violation <= self.settings.violation_tolerance
        {
            Some(Status::Solved)
        } else if self.log.table.len() > self.settings.max_iterations {
            Some(Status::IterationLimit)
        } else if self.at.x.iter().any(|x| x.abs() > limit) || self.point.objective < -limit {
            Some(Status::Diverging)
        } else {
            None
        }
    }

    fn measure(&self) -> Measure {
        let theta = self.point.rows.iter().map(|c| c.abs()).sum();
        Measure { theta, phi: self.point.objective }
    }

    /// Backtracks along the step to an acceptable point; false where there is none.
    fn search(&mut self) -> bool {
        let slope = self.point.gradient.iter().zip(&self.step.x).map(|(g, d)| g * d).sum();
        let current = Current { at: self.measure(), slope };
        let largest = self.step.x[..self.form.n].iter().fold(0.0f64, |m, d| m.max(d.abs()));
        self.last = Iteration { step: largest, regularization: self.kkt.shift, ..Iteration::default() };
        let (shortest, mut length) = (self.filter.shortest(current), 1.0);
        while length >= shortest || length == 1.0 {
            if let Some(trial) = self.try_length(length) {
                if let Some(acceptance) = self.filter.accepts(current, length, trial.measure) {
                    if self.take(&trial, current, acceptance, length) {
                        return true;
                    }
                } else if length == 1.0
                    && self.step.correctable
                    && trial.measure.theta >= current.at.theta
                    && self.correct(current, trial)
                {
                    self.last.note = Note::SecondOrderCorrection;
                    return true;
                }
            }
            length *= 0.5;
        }
        false
    }

    fn try_length(&mut self, length: f64) -> Option<Trial> {
        let mut x: Vec<f64> = self.at.x.iter().zip(&self.step.x).map(|(x, d)| x + length * d).collect();
        clip(self.form, &mut x);
        let mut rows = vec![0.0; self.form.m];
        let objective = self.form.functions(&x, &mut rows).ok()?;
        let theta = rows.iter().map(|c| c.abs()).sum();
        Some(Trial { x, rows, objective, measure: Measure { theta, phi: objective } })
    }

    /// Second-order corrections with the working set of the step; false where none is accepted.
    fn correct(&mut self, current: Current, trial: Trial) -> bool {
        let (kept, mut trial) = (self.step.clone(), trial);
        let mut rows = self.point.rows.clone();
        let mut before = current.at.theta;
        for attempt in 0..CORRECTIONS {
            if attempt > 0 && trial.measure.theta > 0.99 * before {
                break;
            }
            before = trial.measure.theta;
            rows.iter_mut().zip(&trial.rows).for_each(|(sum, c)| *sum += c);
            if !self.correct_step(&rows) || !self.active.inside(self.form, &self.at.x, &self.step.x) {
                break;
            }
            let Some(next) = self.try_length(1.0) else { break };
            if let Some(acceptance) = self.filter.accepts(current, 1.0, next.measure) {
                if self.take(&next, current, acceptance, 1.0) {
                    return true;
                }
                break;
            }
            trial = next;
        }
        self.step = kept;
        false
    }

    /// Moves to the trial point; false when the derivatives have no value there.
    fn take(&mut self, trial: &Trial, current: Current, acceptance: Acceptance, length: f64) -> bool {
        let derivatives = self.form.derivatives(&trial.x, &mut self.point.gradient, &mut self.point.jacobian);
        if derivatives.is_err() {
            return false;
        }
        if acceptance == Acceptance::Filter {
            self.filter.add(current.at);
        }
        self.at.x.copy_from_slice(&trial.x);
        self.point.objective = trial.objective;
        self.point.rows.copy_from_slice(&trial.rows);
        let go = |z: &mut [f64], to: &[f64]| {
            z.iter_mut().zip(to).for_each(|(z, to)| *z += length * (to - *z));
        };
        go(&mut self.at.y, &self.step.y);
        go(&mut self.at.lower, &self.step.lower);
        go(&mut self.at.upper, &self.step.upper);
        self.last.step_length = length;
        self.last.note = self.step.note;
        true
    }
}

/// Moves X into its bounds.
fn clip(form: &Form, x: &mut [f64]) {
    for (x, (&l, &u)) in x.iter_mut().zip(form.lower.iter().zip(&form.upper)) {
        *x = x.clamp(l, u);
    }
}
