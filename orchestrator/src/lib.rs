//! The airloop library: import FMUs, couple them, compare with measurements.

pub mod ident;
pub mod results;
pub mod series;
