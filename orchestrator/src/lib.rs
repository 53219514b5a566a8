//! The airloop library: import FMUs, couple them, compare with measurements.
