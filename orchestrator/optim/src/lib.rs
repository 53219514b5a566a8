//! Optimization: numbers in, numbers out. Nothing here knows of time, models or files, and nothing prints.
//!
//! | entry | problem |
//! |-------|---------|
//! | [`solve`] | nonlinear program: minimize f(x) subject to `c_l <= c(x) <= c_u` and `x_l <= x <= x_u` |
//! | [`Solver`] | the same many times, with other bounds, start or data: memory and analysis are kept |
//! | [`solve_quadratic`] | quadratic program |
//! | [`least_squares`] | sum of squares with bounds on the parameters |
//! | [`linalg`] | factorizations that these need |
//!
//! A nonlinear program implements [`Nlp`] (functions, exact first and second derivatives with fixed patterns, names,
//! and the chain of stages where it has one); [`solve`] takes it from a [`Start`] to a [`Solution`].
//!
//! # Two methods of nonlinear programming
//!
//! - **Interior point** ([`Method::InteriorPoint`]), for starts from afar: barrier for the bounds, Newton steps on the
//!   KKT conditions with the Hessian shifted until the inertia is that of a minimum, filter line search with
//!   second-order correction (Wächter and Biegler, Mathematical Programming 106, 2006), and restoration of feasibility
//!   by the same method on relaxed constraints. After a step with a strongly shifted Hessian the multipliers are
//!   estimated anew by least squares: those of the step belong to another problem, and the next Hessian would inherit
//!   their size.
//! - **SQP** ([`Method::Sqp`]), for starts near the solution (a coarser mesh, an earlier run): the KKT system with the
//!   bounds of the working set held, and Clarabel's quadratic program with all bounds only where that step leaves
//!   other bounds or a multiplier has the wrong sign. The same KKT system then gives the step of the new working set
//!   to the last digits, so convergence is quadratic. After a step that had to be cut, the next ones are kept short by
//!   a shift of the Hessian, as by a trust region. Where the linearized constraints have no solution within the
//!   bounds, or no step is acceptable, the interior point method goes on. In turn the SQP tries the start of an
//!   interior point run that found no feasible point.
//!
//! Both work on one form of the problem (`form`): scaled equations with one slack per inequality and bounds on
//! everything. Both share the filter, the KKT matrix, scaling, iteration table and stop test: scaled KKT error and
//! unscaled violation below their tolerances.
//!
//! # Linear algebra
//!
//! Slacks, also the relaxations of the restoration, are eliminated: the KKT matrix always has one row per variable and
//! constraint, so one symbolic analysis serves the whole run. With stages it is factorized by dense fronts along the
//! chain ([`crate::linalg::staged_ldl`]), pivots exchanged within a stage, inertia exact, cost linear in the number
//! of stages. Without stages small problems are one such front, others go to a sparse LDL^T
//! ([`crate::linalg::sparse_ldl`]) with refinement. Solutions are refined on the system before elimination.
//!
//! # Errors and outcomes
//!
//! A fault found before the first step is an [`Error`]; every end of a run that could begin is a [`Status`], with the
//! last point, the worst violation by name, and for infeasible problems the bound that stands most in the way. Values
//! that are NaN, or functions that fail, shorten the step. A monitor may stop the run; [`Solution::restart`] goes on
//! from its end. The result depends on the input alone: everything runs in one thread.

pub mod error;
mod filter;
mod form;
mod interior_point;
mod kkt;
pub mod least_squares;
pub mod linalg;
mod log;
pub mod nlp;
pub mod outcome;
pub mod qp;
pub mod scaled;
pub mod settings;
pub mod solver;
mod sqp;

use std::ops::ControlFlow;

pub use error::Error;
pub use log::Monitor;
pub use nlp::{Bounds, EvaluationError, Nlp, Stages};
pub use outcome::{
    Blocking, Evaluations, Iteration, Multipliers, Note, Side, Solution, Start, Status, Violation,
};
pub use qp::{Quadratic, QuadraticSolution, QuadraticStatus, solve_quadratic};
pub use settings::{Method, Settings};
pub use solver::Solver;

/// Solves a problem from a start.
///
/// # Errors
/// See [`Error`]; how a run ends that could begin is the [`Status`] of the solution.
pub fn solve(nlp: &mut dyn Nlp, start: &Start, settings: &Settings) -> Result<Solution, Error> {
    solve_with(nlp, start, settings, &mut |_| ControlFlow::Continue(()))
}

/// Same as [`solve`]; `monitor` sees every iteration and may stop the run, which then hands back its last point.
///
/// # Errors
/// Same as [`solve`].
pub fn solve_with(
    nlp: &mut dyn Nlp,
    start: &Start,
    settings: &Settings,
    monitor: &mut Monitor<'_>,
) -> Result<Solution, Error> {
    settings.validate()?;
    let mut solver = Solver::new(nlp)?;
    solver.solve(nlp, start, settings, monitor)?;
    Ok(solver.into_solution())
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
