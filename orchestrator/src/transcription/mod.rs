//! From a problem of optimal control to a nonlinear program.
//!
//! It sees a system only through [`Dynamics`]; FMUs, files and solvers' settings are left to others.

pub mod dynamics;

pub use dynamics::{Dynamics, Entry, Point, Size, Structure};
