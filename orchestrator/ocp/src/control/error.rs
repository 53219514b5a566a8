//! Reason why a trajectory cannot be stabilized.

use airloop_optim::EvaluationError;

/// Reason why a trajectory cannot be stabilized.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "named in each message")]
pub enum Error {
    /// The functions of the plant.
    #[error("t = {time} s: {source}")]
    Evaluation { time: f64, source: EvaluationError },
    /// A state that is not part of a linear block.
    #[error(
        "`{state}` cannot be held over a sample: its rate does not depend linearly, with constant coefficients, on sampled states and inputs alone; leave it out of the sampled states"
    )]
    NotLinear { state: String },
    /// A number out of range.
    #[error("{what} = {value}; allowed: {allowed}")]
    Setting { what: String, value: f64, allowed: &'static str },
    /// A trajectory that is too short or has no order.
    #[error("trajectory: {0}")]
    Trajectory(String),
    /// A measured signal that reacts at once.
    #[error(
        "the measured signal `{signal}` depends directly on the input `{input}`, which is to follow from it; measure something else"
    )]
    Direct { signal: String, input: String },
    /// No stabilizing solution of a Riccati equation.
    #[error(
        "{what} at the end of the trajectory (t = {time} s): {why}. Change the {remedy}, or end the trajectory elsewhere"
    )]
    Riccati { what: &'static str, time: f64, why: &'static str, remedy: &'static str },
}

impl Error {
    /// Puts the time \[s\] to an error of the plant's functions.
    pub(super) fn at(time: f64) -> impl Fn(EvaluationError) -> Error {
        move |source| Error::Evaluation { time, source }
    }
}
