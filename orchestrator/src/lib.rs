//! The airloop library: import FMUs, couple them, compare with measurements.
//!
//! A module uses modules of lower lines only (`tests/layers.rs` checks it):
//!
//! ```text
//!  8  cli
//!  7  error
//!  6  report
//!  5  plot
//!  4  discrepancy refine      rig         plan
//!  3  master      coupled     control
//!  2  system      ident       transcription
//!  1  fmu         results     optim       excite
//!  0  series      linalg      units       xml
//! ```
//!
//! Start with [`system::SystemGraph::open`], [`master::simulate::run`] and [`series::csv::write`].

pub mod cli;
pub mod control;
pub mod coupled;
pub mod discrepancy;
pub mod error;
pub mod excite;
pub mod fmu;
pub mod ident;
pub mod linalg;
pub mod master;
pub mod optim;
pub mod plan;
pub mod plot;
pub mod refine;
pub mod report;
pub mod results;
pub mod rig;
pub mod series;
pub mod system;
pub mod transcription;
pub mod units;
mod xml;

pub use error::Error;
