//! From a problem of optimal control to a nonlinear program.
//!
//! It sees a system only through [`Dynamics`]; FMUs, files and solvers' settings are left to others.
//!
//! [`Problem`] says what is wanted, [`Discretization`] how time is divided, [`Program`] is the nonlinear program for
//! [`airloop_optim::solve`]; [`solve_on`] does all of it for one mesh, [`refine`] goes on to finer ones; a
//! [`Solver`] is kept and solves the same program again and again. Start with [`Phase`].

mod block;
mod bounds;
mod check;
pub mod defects;
mod duals;
pub use airloop_dynamics as dynamics;
pub mod error;
mod evaluate;
mod functions;
mod joint;
mod layout;
mod linear;
pub mod link;
pub mod mesh;
pub mod names;
pub mod output_reset;
mod part;
mod pattern;
mod probe;
pub mod problem;
pub mod program;
pub mod relabeling;
pub mod relaxed;
mod scheme;
mod shift;
pub mod solve;
pub mod solver;
pub mod trajectory;
mod vector;

pub use defects::{IntervalErrors, interval_errors};
pub use duals::Duals;
pub use dynamics::{Dynamics, Entry, Point, Size, Structure};
pub use error::Error;
pub use link::{Link, Reset, ResetSize, StateLink};
pub use mesh::Mesh;
pub use names::Violation;
pub use output_reset::{After, OutputReset};
pub use problem::{
    Cost, Duration, Limit, LimitPlace, Path, Phase, Place, Problem, Quantity, RateLimit, Shooting, Variable,
};
pub use program::{Discretization, Program};
pub use relabeling::{Relabeled, Relabeling};
pub use relaxed::{Conflict, conflict};
pub use solve::{From, Outcome, Refinement, Round, refine, refined, solve_on};
pub use solver::Solver;
pub use trajectory::{Interpolation, PhaseTrajectory, Trajectory};

/// Transcription of an interval of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Transcription {
    /// Trapezoidal collocation; inputs linear within an interval.
    Trapezoidal,
    /// Hermite-Simpson collocation, states in the middle eliminated; inputs quadratic within an interval.
    HermiteSimpson,
    /// Hermite-Simpson collocation, states in the middle are variables.
    HermiteSimpsonSeparated,
    /// Multiple shooting with Runge-Kutta steps, a sampled block exactly; inputs held over intervals.
    MultipleShooting,
    /// States that form a linear system by exact shooting, the others collocated; inputs held over intervals.
    ShootingCollocation,
}
