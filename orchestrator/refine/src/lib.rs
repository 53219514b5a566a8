//! From a residual to the effect that the declared model lacks.
//!
//! [`case`] reads what was declared and measured, [`rig`] simulates it with every candidate effect, [`engine`] searches
//! (it knows no physics), [`answer`] says it in the words of the vocabulary. Files and pages are left to `report`.

pub mod amend;
pub mod answer;
pub mod case;
mod case_values;
mod cleaned;
pub mod engine;
pub mod evidence;
mod explained;
mod grid;
pub mod interval;
pub mod law;
pub mod moving;
mod order;
mod outliers;
mod regime;
pub mod rig;
pub mod selection_answer;
pub mod share;
pub mod sign;
mod spikes;
pub mod study;
pub mod vocabulary;
pub mod watch;

use std::path::PathBuf;

/// Why the loop cannot be closed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A case folder says something that does not fit.
    #[error("{}: {problem}", path.display())]
    Case {
        /// File.
        path: PathBuf,
        /// Problem and remedy.
        problem: String,
    },
    /// A study says something that does not fit.
    #[error("{}: {place}{problem}", path.display())]
    Study {
        /// File.
        path: PathBuf,
        /// Line and column, if there is one place.
        place: String,
        /// Problem and remedy.
        problem: String,
    },
    /// A record cannot be read.
    #[error(transparent)]
    Csv(#[from] airloop_series::csv::Error),
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
