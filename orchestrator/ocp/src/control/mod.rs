//! Stabilization of a planned trajectory: time-varying linear-quadratic regulator with a state estimator.
//!
//! | module | what |
//! |---|---|
//! | [`sampled`] | one sample of a [`Dynamics`](crate::transcription::Dynamics) with its derivatives |
//! | [`nominal`] | the trajectory on the samples, and the equilibrium that it is held at |
//! | [`riccati`] | Riccati equations of regulator and estimator |
//! | [`phases`] | trajectories with phases: samples beyond their ends, saltation at the events between them |
//! | [`tvlqr`] | design: from trajectory, weights and noise to a controller |
//! | [`nmpc`] | model predictive control along the plan |
//! | [`controller`] | rows of gains, as a table, and the controller as equations |
//!
//! The plant is seen through [`Dynamics`](crate::transcription::Dynamics) only. Which FMUs it consists of, files of
//! settings, the FMU of the controller, and trials are left to others.

pub mod controller;
mod error;
pub mod nmpc;
pub mod nominal;
pub mod phases;
pub mod riccati;
pub mod sampled;
#[cfg(test)]
mod tests;
pub mod tvlqr;

pub use controller::{Controller, Estimate, PhaseRows, Repeat};
pub use error::Error;
pub use nominal::Nominal;
pub use phases::{Event, Leg, Monodromy, Periodic, Phases, Turn};
pub use sampled::{Linearization, Sampled};
pub use tvlqr::{Design, Measured, design};
