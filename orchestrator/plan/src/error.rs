//! Reason why a problem cannot be read, stated or solved.

use std::path::PathBuf;

/// Reason why a problem cannot be read, stated or solved; the messages name file, place, value and remedy.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, line and names, as in each message")]
pub enum Error {
    /// A file cannot be read.
    #[error("{}: the file cannot be read: {source}", file.display())]
    Io { file: PathBuf, source: std::io::Error },
    /// Something in the problem file.
    #[error("{}: line {line}, column {column}: {problem}", file.display())]
    File { file: PathBuf, line: usize, column: usize, problem: String },
    /// Something on the command line or in a trajectory file.
    #[error("{place}: {problem}")]
    Place { place: String, problem: String },
    /// No motion from which a kept solver could start.
    #[error("{}: no first motion to start from: {reason}", file.display())]
    NoMotion { file: PathBuf, reason: String },
    /// A trajectory to start from cannot be read.
    #[error(transparent)]
    Csv(#[from] airloop_series::csv::Error),
    /// A series cannot be built.
    #[error(transparent)]
    Series(#[from] airloop_series::Error),
    /// The system cannot be opened.
    #[error(transparent)]
    System(#[from] airloop_cosim::system::Error),
    /// The system has no right-hand side that can be optimized.
    #[error(transparent)]
    Coupled(#[from] airloop_cosim::coupled::Error),
    /// The roll-out cannot be begun.
    #[error(transparent)]
    Master(#[from] airloop_cosim::master::Error),
    /// The problem cannot be transcribed.
    #[error(transparent)]
    Transcription(#[from] airloop_ocp::transcription::Error),
    /// The system cannot be evaluated where it has to be.
    #[error(transparent)]
    Evaluation(#[from] airloop_optim::EvaluationError),
    /// No commands for the actuators.
    #[error(transparent)]
    FeedForward(#[from] super::feed_forward::Error),
    /// The solver cannot begin.
    #[error(transparent)]
    Solver(#[from] airloop_optim::Error),
    /// The plan cannot be stabilized.
    #[error(transparent)]
    Control(#[from] airloop_ocp::control::Error),
}
