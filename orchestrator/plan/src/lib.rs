//! Plans: a problem file and a system of FMUs become a trajectory, with a roll-out through the master as proof.
//!
//! [`mod@file`] reads what the user states; the other modules look its names up in a system, hand the problem to the
//! transcription and the solver, and roll the command out. Files of results, figures and words are left to the layers
//! above.
//!
//! Plain equation and figure numbers are those of *Model-based Trajectory Control of Robots with Pneumatic Actuator
//! Dynamics*, "the paper".

pub mod assemble;
pub mod balance;
pub mod catalog;
pub mod cycle;
pub mod deliver;
pub mod departure;
pub mod diagnose;
mod error;
pub mod feed_forward;
pub mod file;
pub mod guess;
pub mod multistart;
pub mod prepare;
pub mod recheck;
pub mod record;
mod reset;
pub mod sampling;
pub mod size;
pub mod solve;
pub mod solver;
pub mod stabilize;
pub mod start;
pub mod sweep;
pub mod table;
pub mod task;
pub mod trials;
pub mod vacuous;
pub mod verify;
mod workers;

pub use error::Error;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
