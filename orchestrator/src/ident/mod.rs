//! Models against data: how well a simulation fits a measurement.
//!
//! Works on plain slices and knows neither files nor FMUs.

pub mod fit;
