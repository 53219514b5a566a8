//! Results of a run: samples at the communication points, and a summary of how they came about.
//!
//! Neither steps nor plots; it is told values and times and turns them into a [`airloop_series::TimeSeries`] and a
//! JSON file.

pub mod coupling_error;
mod journal;
pub mod recorder;
pub mod states;
pub mod summary;

pub use recorder::{Column, Keep, Recorder, Slot};
