//! The airloop library: import FMUs, couple them, compare with measurements.

pub mod fmu;
pub mod ident;
pub mod master;
pub mod results;
pub mod series;
pub mod system;
pub mod units;
