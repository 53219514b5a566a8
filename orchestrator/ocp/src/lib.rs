//! Optimal control: trajectories of a plant that is seen through [`Dynamics`](airloop_dynamics::Dynamics) alone.
//!
//! [`transcription`] turns a problem with phases, costs and constraints into a sparse nonlinear program for
//! `airloop-optim`; [`control`] designs the regulator and estimator that keep the plant on the trajectory found. FMUs,
//! files and figures are left to the crates above. Start reading at [`transcription::Program`].

pub mod control;
pub mod transcription;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
