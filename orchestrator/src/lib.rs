//! The airloop library: import FMUs, couple them, compare with measurements.

pub mod fmu;
pub mod units;
