//! From a residual to the effect that the declared model lacks.

pub mod answer;
pub mod case;
pub mod engine;
pub mod report;
pub mod rig;

use std::path::PathBuf;

/// Why the loop cannot be closed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A case folder says something that does not fit.
    #[error("{}: {problem}", path.display())]
    Case {
        /// File.
        path: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
    /// The report cannot be written.
    #[error("{}: the report cannot be written: {source}", path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// A record cannot be read.
    #[error(transparent)]
    Csv(#[from] crate::series::csv::Error),
}
