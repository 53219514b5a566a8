//! Optimisation: numbers in, numbers out. Nothing here knows of time, models or files.
//!
//! [`least_squares`] fits parameters within bounds. The rest is nonlinear programming: minimise f(x) subject to `c_l <= c(x) <= c_u` and `x_l <= x <= x_u`.

pub mod error;
mod filter;
mod form;
mod interior_point;
mod kkt;
pub mod least_squares;
mod log;
pub mod nlp;
pub mod outcome;
pub mod qp;
pub mod settings;
mod sqp;

use std::ops::ControlFlow;

pub use error::Error;
use form::Form;
use interior_point::{End, Iterate, Run};
use kkt::Kkt;
use log::Log;
pub use log::Monitor;
pub use nlp::{Bounds, EvaluationError, Nlp, Stages};
pub use outcome::{Evaluations, Iteration, Multipliers, Note, Solution, Start, Status, Violation};
pub use qp::{Quadratic, QuadraticSolution, QuadraticStatus, solve_quadratic};
pub use settings::{Method, Settings};
use sqp::Sqp;

/// Solves a problem from a start.
///
/// # Errors
/// See [`Error`]; how a run ends that could begin is the [`Status`] of the solution.
pub fn solve(nlp: &mut dyn Nlp, start: &Start, settings: &Settings) -> Result<Solution, Error> {
    solve_with(nlp, start, settings, &mut |_| ControlFlow::Continue(()))
}

/// As [`solve`]; `monitor` sees every iteration and may stop the run, which then hands back its last point.
///
/// # Errors
/// As [`solve`].
pub fn solve_with(
    nlp: &mut dyn Nlp,
    start: &Start,
    settings: &Settings,
    monitor: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
) -> Result<Solution, Error> {
    settings.validate()?;
    let mut form = Form::new(nlp)?;
    let mut kkt = Kkt::new(&form)?;
    let mut log = Log::new(monitor);
    let end = run(&mut form, &mut kkt, settings, &mut log, start)?;
    let at = end.at;
    let n = form.n;
    let scale = form.objective_scale;
    let plain = |z: &[f64]| z[..n].iter().map(|z| z / scale).collect();
    let multipliers = Multipliers {
        constraints: form.constraint_multipliers(&at.y),
        lower: plain(&at.lower),
        upper: plain(&at.upper),
    };
    let evaluations = Evaluations {
        factorisations: kkt.factorisations,
        quadratic_programs: end.quadratic_programs,
        ..form.evaluations
    };
    Ok(Solution {
        status: end.status,
        objective: form.plain_objective(&at.x),
        worst: form.worst(&at.x),
        x: at.x[..n].to_vec(),
        multipliers,
        barrier: end.barrier,
        error: end.error,
        iterations: log.table,
        evaluations,
    })
}

/// The last iterate of a method, and how it came to an end.
struct Finish {
    status: Status,
    at: Iterate,
    barrier: f64,
    error: f64,
    quadratic_programs: usize,
}

fn run(
    form: &mut Form,
    kkt: &mut Kkt,
    settings: &Settings,
    log: &mut Log,
    start: &Start,
) -> Result<Finish, Error> {
    match settings.method {
        Method::InteriorPoint => interior_point(form, kkt, settings, log, start),
        Method::Sqp => {
            let mut run = Sqp::begin(form, kkt, settings, log, start)?;
            let end = run.run();
            let (error, quadratic_programs) = (run.error(), run.quadratic_programs);
            let at = std::mem::take(&mut run.at);
            match end {
                sqp::End::Status(status) => {
                    Ok(Finish { status, at, barrier: 0.0, error, quadratic_programs })
                }
                sqp::End::NoStep => {
                    let from = Start::cold(at.x[..form.n].to_vec());
                    let finish = interior_point(form, kkt, settings, log, &from)?;
                    Ok(Finish { quadratic_programs, ..finish })
                }
            }
        }
    }
}

fn interior_point(
    form: &mut Form,
    kkt: &mut Kkt,
    settings: &Settings,
    log: &mut Log,
    start: &Start,
) -> Result<Finish, Error> {
    let mut run = Run::begin(form, kkt, settings, log, start)?;
    let status = match run.run() {
        End::Status(status) => status,
        End::Restored => Status::Stalled,
    };
    let error = run.error();
    Ok(Finish { status, at: std::mem::take(&mut run.at), barrier: run.barrier, error, quadratic_programs: 0 })
}
