//! The airloop library: all its crates under one roof, and what needs several of them.
//!
//! [`cosim`] couples FMUs and runs them, [`ident`] makes models from records, [`plan`] optimizes trajectories over the
//! coupled system, [`refine`] finds what a declared model lacks. Here live the start of a simulation ([`simulation`]),
//! the virtual test bench ([`rig`]), the comparison of a run with a measurement ([`discrepancy`]) and the sum of all
//! errors ([`Error`]).
//!
//! "The paper" is *Model-based Trajectory Control of Robots with Pneumatic Actuator Dynamics*; section and equation
//! numbers in this crate are its own.

pub mod discrepancy;
pub mod error;
pub mod new_study;
pub mod relative_path;
pub mod rig;
pub mod simulation;

pub use airloop_cosim as cosim;
pub use airloop_dynamics as dynamics;
pub use airloop_fmi as fmi;
pub use airloop_ident as ident;
pub use airloop_ocp as ocp;
pub use airloop_optim as optim;
pub use airloop_plan as plan;
pub use airloop_refine as refine;
pub use airloop_report as report;
pub use airloop_series as series;
pub use error::Error;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
