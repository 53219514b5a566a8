//! A solver that is kept: the analysis of a problem and all memory serve one solve after another.

use super::error::Error;
use super::form::{self, Form};
use super::interior_point::{self, End, Iterate, Run};
use super::kkt::Kkt;
use super::log::{Log, Monitor};
use super::nlp::Nlp;
use super::outcome::{Evaluations, Multipliers, Solution, Start, Status};
use super::settings::{Method, Settings};
use super::sqp::{self, Sqp};

/// Solves one nonlinear program again and again, with other bounds, other data behind its functions, another start.
///
/// Sizes and patterns stay those of the problem it was made for. The result of a solve depends on its arguments
/// alone, not on the solves before: it has the bits of [`super::solve`].
///
/// After the first solve nothing is allocated, but for: the feasibility restoration, quadratic programs and the change
/// of method of [`Method::Sqp`], functions without a value, names of what is violated, and an analysis anew where
/// bounds make an equality of an inequality or the other way round, or a constraint of what bounded nothing.
pub struct Solver {
    form: form::Memory,
    kkt: Kkt,
    interior: interior_point::Memory,
    sqp: sqp::Memory,
    solution: Solution,
}

/// The end of a method; the last iterate is in its memory.
struct Finish {
    status: Status,
    barrier: f64,
    error: f64,
    quadratic_programs: usize,
    method: Method,
}

impl Solver {
    /// Analyzes a problem.
    ///
    /// # Errors
    /// [`Error`] says what in bounds, patterns or stages is wrong.
    pub fn new(nlp: &mut dyn Nlp) -> Result<Self, Error> {
        let mut form = form::Memory::new(nlp)?;
        let kkt = Kkt::new(&Form::new(nlp, &mut form))?;
        Ok(Self {
            form,
            kkt,
            interior: interior_point::Memory::default(),
            sqp: sqp::Memory::default(),
            solution: Solution::empty(),
        })
    }

    /// Solves the problem it was made for, with the bounds that it has now, from a start.
    ///
    /// # Errors
    /// See [`Error`]; how a run ends that could begin is the [`Status`] of the solution.
    pub fn solve(
        &mut self,
        nlp: &mut dyn Nlp,
        start: &Start,
        settings: &Settings,
        monitor: &mut Monitor<'_>,
    ) -> Result<&Solution, Error> {
        settings.validate()?;
        if !self.form.take_bounds(nlp)? {
            *self = Self::new(nlp)?;
        }
        self.kkt.restart();
        let mut log = Log::new(monitor, std::mem::take(&mut self.solution.iterations));
        let mut form = Form::new(nlp, &mut self.form);
        let finish = match settings.method {
            Method::InteriorPoint => {
                let (kkt, memory) = (&mut self.kkt, &mut self.interior);
                let finish = interior_point(&mut form, kkt, memory, settings, &mut log, start)?;
                match finish.status {
                    Status::Infeasible | Status::Stalled => {
                        second_opinion(&mut form, kkt, &mut self.sqp, settings, &mut log, start, finish)?
                    }
                    _ => finish,
                }
            }
            Method::Sqp => {
                match sequential(&mut form, &mut self.kkt, &mut self.sqp, settings, &mut log, start)? {
                    (sqp::End::Status(_), finish) => finish,
                    (sqp::End::NoStep, Finish { quadratic_programs, .. }) => {
                        let from = Start::cold(self.sqp.at.x[..form.n].to_vec());
                        let (kkt, memory) = (&mut self.kkt, &mut self.interior);
                        let finish = interior_point(&mut form, kkt, memory, settings, &mut log, &from)?;
                        Finish { quadratic_programs, ..finish }
                    }
                }
            }
        };
        let at = match finish.method {
            Method::InteriorPoint => &self.interior.at,
            Method::Sqp => &self.sqp.at,
        };
        let evaluations = Evaluations {
            factorizations: self.kkt.factorizations,
            quadratic_programs: finish.quadratic_programs,
            ..form.evaluations
        };
        self.solution.iterations = log.table;
        self.solution.evaluations = evaluations;
        write(&mut form, at, finish, settings, &mut self.solution);
        Ok(&self.solution)
    }

    /// The last solution.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// Same as [`Solver::solution`], to be changed; the next solve overwrites it.
    pub fn solution_mut(&mut self) -> &mut Solution {
        &mut self.solution
    }

    /// The last solution, at the end of the solver.
    pub fn into_solution(self) -> Solution {
        self.solution
    }
}

/// Writes the last point of a run into the solution.
fn write(form: &mut Form, at: &Iterate, finish: Finish, settings: &Settings, solution: &mut Solution) {
    let (n, scale) = (form.n, form.objective_scale);
    let plain = |own: &mut Vec<f64>, z: &[f64]| {
        own.clear();
        own.extend(z[..n].iter().map(|z| z / scale));
    };
    let Multipliers { constraints, lower, upper } = &mut solution.multipliers;
    form.constraint_multipliers(&at.y, constraints);
    plain(lower, &at.lower);
    plain(upper, &at.upper);
    solution.x.clear();
    solution.x.extend_from_slice(&at.x[..n]);
    solution.objective = form.plain_objective(&at.x);
    (solution.violation, solution.worst) = form.worst(&at.x, settings.violation_tolerance);
    let infeasible = finish.status == Status::Infeasible;
    solution.blocking = infeasible.then(|| form.blocking(&at.lower, &at.upper)).flatten();
    (solution.status, solution.barrier, solution.error) = (finish.status, finish.barrier, finish.error);
}

/// A run of the SQP from a start; where no step is left, the status is that of a run that stalls.
fn sequential(
    form: &mut Form,
    kkt: &mut Kkt,
    memory: &mut sqp::Memory,
    settings: &Settings,
    log: &mut Log,
    start: &Start,
) -> Result<(sqp::End, Finish), Error> {
    let mut run = Sqp::begin(form, kkt, settings, log, start, std::mem::take(memory))?;
    let end = run.run();
    let (error, quadratic_programs) = (run.error(), run.quadratic_programs);
    *memory = run.memory;
    let status = match &end {
        sqp::End::Status(status) => status.clone(),
        sqp::End::NoStep => Status::Stalled,
    };
    Ok((end, Finish { status, barrier: 0.0, error, quadratic_programs, method: Method::Sqp }))
}

/// The interior point method found a point of locally least violation, or no way on. Of some feasible problems it does
/// from some starts (Wächter and Biegler, Mathematical Programming 88, 2000: a line search within the bounds cannot
/// leave them to get to the constraints), so the SQP, which works on the bounds, tries the same start; its end counts
/// where it solves the problem.
fn second_opinion(
    form: &mut Form,
    kkt: &mut Kkt,
    memory: &mut sqp::Memory,
    settings: &Settings,
    log: &mut Log,
    start: &Start,
    first: Finish,
) -> Result<Finish, Error> {
    let scales = form.scales();
    kkt.restart_shifts();
    let (_, second) = sequential(form, kkt, memory, settings, log, start)?;
    let quadratic_programs = second.quadratic_programs;
    if matches!(second.status, Status::Solved | Status::Interrupted) {
        return Ok(second);
    }
    form.rescale(scales);
    Ok(Finish { quadratic_programs, ..first })
}

fn interior_point(
    form: &mut Form,
    kkt: &mut Kkt,
    memory: &mut interior_point::Memory,
    settings: &Settings,
    log: &mut Log,
    start: &Start,
) -> Result<Finish, Error> {
    let mut run = Run::begin(form, kkt, settings, log, start, std::mem::take(memory))?;
    let status = match run.run() {
        End::Status(status) => status,
        End::Restored => Status::Stalled,
    };
    let (error, barrier) = (run.error(), run.barrier);
    *memory = run.into_memory();
    Ok(Finish { status, barrier, error, quadratic_programs: 0, method: Method::InteriorPoint })
}
