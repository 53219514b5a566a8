//! Figures of a run as SVG, and one page that holds them all; figures of an identification.
//!
//! Everything is drawn from the files of a run (`result.csv`, `summary.json`, the measurement), never from a live
//! simulation. Start with [`run::draw`]; [`identification`] draws from the numbers of a model and its tests.

pub mod axes;
pub mod envelope;
pub mod figures;
pub mod fit_page;
pub mod formula;
pub mod friction;
pub mod identification;
pub mod page;
pub mod plan;
pub mod run;
pub mod singular_values;
pub mod stabilize;
pub mod svg;

use std::path::PathBuf;

/// Reason why a figure cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file and column, as in each message")]
pub enum Error {
    /// A series cannot be read.
    #[error(transparent)]
    Csv(#[from] airloop_series::csv::Error),
    /// The summary cannot be read.
    #[error(transparent)]
    Summary(#[from] airloop_cosim::results::summary::Error),
    /// The summary of a plan cannot be read.
    #[error(transparent)]
    Plan(#[from] airloop_plan::record::Error),
    /// A column named in the summary is not in the file.
    #[error("{}: there is no column `{column}`, though the summary names it; run the simulation again", file.display())]
    Column { file: PathBuf, column: String },
    /// A figure cannot be written.
    #[error("{}: {source}", file.display())]
    Io { file: PathBuf, source: std::io::Error },
}
