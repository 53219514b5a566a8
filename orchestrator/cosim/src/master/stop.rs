//! Reason why a macro step stopped.

use super::exchange::Node;
use super::interface_jacobian::Failure;
use super::propagation::LoopFailure;
use super::values::Values;
use airloop_fmi::StepStatus;

/// Reason why a macro step stopped; small, so that the good path carries little.
#[derive(Debug)]
pub(super) enum Stop {
    Fmu(Box<airloop_fmi::Error>),
    Incomplete {
        node: usize,
        status: StepStatus,
    },
    /// The whole step was done, and a slave asked for the end at its end.
    Ended {
        node: usize,
    },
    NotFinite {
        node: usize,
    },
    Coupling(Box<Failure>),
    /// An algebraic loop at `time` \[s\].
    Loop {
        failure: Box<LoopFailure>,
        time: f64,
    },
}

impl Stop {
    /// An algebraic loop was not solved at `time` \[s\].
    #[cold]
    pub fn of_loop(failure: LoopFailure, time: f64) -> Stop {
        match failure {
            LoopFailure::Fmu(error) => error.into(),
            failure => Stop::Loop { failure: Box::new(failure), time },
        }
    }
}

impl From<Failure> for Stop {
    #[cold]
    fn from(failure: Failure) -> Stop {
        Stop::Coupling(Box::new(failure))
    }
}

impl From<airloop_fmi::Error> for Stop {
    #[cold]
    fn from(error: airloop_fmi::Error) -> Stop {
        Stop::Fmu(Box::new(error))
    }
}

/// Distance to the end of a step, relative to the time, below which a slave that stopped there did the whole step.
const END_TOLERANCE: f64 = 1e-9;

/// Whether a slave asks for the end of the simulation exactly at the `end` \[s\] of its step.
#[cold]
pub(super) fn ended_at(status: StepStatus, end: f64) -> bool {
    match status {
        StepStatus::Discarded { last_successful_time: Some(last), terminated: true } => {
            (last - end).abs() <= END_TOLERANCE * end.abs().max(1.0)
        }
        _ => false,
    }
}

/// The slave that asks for the end of the simulation exactly at the `end` \[s\] of the step, so that the others can
/// finish the step; an error for one that stopped before.
#[cold]
pub(super) fn ended(
    node: &mut Node,
    index: usize,
    status: StepStatus,
    values: &mut Values,
    end: f64,
) -> Result<usize, Stop> {
    if ended_at(status, end) && node.get_outputs(values).is_ok() {
        return Ok(index);
    }
    Err(Stop::Incomplete { node: index, status })
}
