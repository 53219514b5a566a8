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
pub mod settings;

use std::ops::ControlFlow;

pub use error::Error;
use form::Form;
use interior_point::{End, Run};
use kkt::Kkt;
use log::Log;
pub use log::Monitor;
pub use nlp::{Bounds, EvaluationError, Nlp, Stages};
pub use outcome::{Evaluations, Iteration, Multipliers, Note, Solution, Start, Status, Violation};
pub use settings::{Method, Settings};

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
    let mut run = Run::begin(&mut form, &mut kkt, settings, &mut log, start)?;
    let status = match run.run() {
        End::Status(status) => status,
        End::Restored => Status::Stalled,
    };
    let error = run.error();
    let (at, barrier) = (std::mem::take(&mut run.at), run.barrier);
    let n = form.n;
    let scale = form.objective_scale;
    let plain = |z: &[f64]| z[..n].iter().map(|z| z / scale).collect();
    let multipliers = Multipliers {
        constraints: form.constraint_multipliers(&at.y),
        lower: plain(&at.lower),
        upper: plain(&at.upper),
    };
    let evaluations = Evaluations { factorisations: kkt.factorisations, ..form.evaluations };
    Ok(Solution {
        status,
        objective: form.plain_objective(&at.x),
        worst: form.worst(&at.x),
        x: at.x[..n].to_vec(),
        multipliers,
        barrier,
        error,
        iterations: log.table,
        evaluations,
    })
}
