//! Measurement against simulation: which column belongs to which connector, and how far they are apart; and simulation
//! against itself: how much of it is owed to the communication step.

pub mod coupling_error;
pub mod residual;
pub mod richardson;
pub mod signals;

use std::path::PathBuf;

/// Reason why measurement and simulation cannot be brought together.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, column and connector, as in each message")]
pub enum Error {
    /// A column of an input file is not an input.
    #[error(transparent)]
    Csv(#[from] airloop_series::csv::Error),
    /// The table of signals cannot be read.
    #[error("{}: {problem}; write for example\n[signals]\nx = \"position\"", file.display())]
    Table { file: PathBuf, problem: String },
    /// The table names a connector that is not there.
    #[error("{}: the system has no connector `{connector}`; it has: {known}", file.display())]
    UnknownConnector { file: PathBuf, connector: String, known: String },
    /// Units of a column and its connector do not fit.
    #[error("{}: line 1, column `{column}`: its unit [{found}] cannot be converted to [{wanted}] of the connector `{connector}`", file.display())]
    Unit { file: PathBuf, column: String, found: String, connector: String, wanted: String },
    /// No column fits any connector.
    #[error("{}: none of its columns ({columns}) is an output of the system ({known}); name the pairs in a [signals] table and give it with `--signals`", file.display())]
    NothingMeasured { file: PathBuf, columns: String, known: String },
    /// The run does not touch the record.
    #[error("{}: the record goes from {first} s to {last} s, but the run from {start} s to {stop} s: no sample can be compared; choose `--start` and `--stop` inside of the record", file.display())]
    NoOverlap { file: PathBuf, first: f64, last: f64, start: f64, stop: f64 },
    /// The communication step cannot be made smaller.
    #[error("the run cannot be repeated {problem}")]
    NoRefinement { problem: String },
    /// A goal for a signal that is not there.
    #[error("--coupling-signal {name}: there is no such Real output or connected signal; known are: {known}")]
    NoSignal { name: String, known: String },
    /// The monolithic master has no coupling error.
    #[error(
        "`--master monolithic` has no coupling error to estimate; leave --estimate-coupling-error out, or choose another master"
    )]
    NoCoupling,
    /// The inputs of a run make no series.
    #[error(transparent)]
    Series(#[from] airloop_series::Error),
    /// The two time ranges have nothing in common.
    #[error("{}: signal `{signal}`: {source}", file.display())]
    Fit { file: PathBuf, signal: String, source: airloop_ident::fit::Error },
}
