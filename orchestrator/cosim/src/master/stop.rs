//! One step of a slave, and the reason why a macro step stopped.

use super::exchange::Node;
use super::propagation::LoopFailure;
use super::{Error, Values};
use airloop_fmi::StepStatus;

/// Reason why a macro step stopped; small, so that the good path carries little.
#[derive(Debug)]
pub(super) enum Stop {
    Fmu(Box<airloop_fmi::Error>),
    Incomplete {
        node: usize,
        last_successful_time: Option<f64>,
        terminated: bool,
    },
    /// The whole step was done, and a slave asked for the end at its end.
    Ended {
        node: usize,
    },
    NotFinite {
        node: usize,
    },
    /// An algebraic loop or a coupled component.
    Unsolved(Box<Error>),
}

impl Stop {
    /// An error unless slave `node` completed its step.
    #[inline(always)]
    pub fn unless_complete(node: usize, status: StepStatus) -> Result<(), Stop> {
        match status {
            StepStatus::Complete => Ok(()),
            StepStatus::Discarded { last_successful_time, terminated } => {
                Err(Stop::Incomplete { node, last_successful_time, terminated })
            }
        }
    }

    /// An algebraic loop was not solved at `time` \[s\].
    #[cold]
    pub fn of_loop(failure: LoopFailure, time: f64) -> Stop {
        match failure {
            LoopFailure::Fmu(error) => error.into(),
            failure => Stop::Unsolved(Box::new(failure.at(time))),
        }
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

/// Whether a slave that came to `last` \[s\] did its whole step to `end` \[s\].
pub(super) fn is_at_end(last: Option<f64>, end: f64) -> bool {
    last.is_some_and(|last| (last - end).abs() <= END_TOLERANCE * end.abs().max(1.0))
}

/// Steps a slave from `t` to `t + h` \[s\]. One that asks for the end of the simulation exactly there is noted in
/// `ended`, so that the others can finish the step; one that stopped before is an error.
#[inline(always)]
pub(super) fn do_step(
    node: &mut Node,
    index: usize,
    values: &mut Values,
    (t, h): (f64, f64),
    ended: &mut Option<usize>,
) -> Result<(), Stop> {
    if let Err(stop) = Stop::unless_complete(index, node.do_step(t, h)?) {
        finish(stop, node, values, t + h)?;
        *ended = Some(index);
    }
    Ok(())
}

/// Reads all outputs of a slave; one that is not finite is an error.
#[inline(always)]
pub(super) fn get_outputs(node: &mut Node, index: usize, values: &mut Values) -> Result<(), Stop> {
    node.get_outputs(values)?;
    if node.outputs_are_finite(values) { Ok(()) } else { Err(Stop::NotFinite { node: index }) }
}

/// An error unless the slave asks for the end of the simulation exactly at the `end` \[s\] of its step.
#[cold]
fn finish(stop: Stop, node: &mut Node, values: &mut Values, end: f64) -> Result<(), Stop> {
    match stop {
        Stop::Incomplete { last_successful_time: last, terminated: true, .. }
            if is_at_end(last, end) && node.get_outputs(values).is_ok() =>
        {
            Ok(())
        }
        stop => Err(stop),
    }
}
