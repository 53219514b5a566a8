//! Values through the whole system at one instant, in the order of direct feed-through.
//!
//! [`schedule`] finds the order, [`transfer`] carries it out, [`algebraic`] solves the loops in it. What happens
//! between instants is left to the masters.

mod algebraic;
mod schedule;
mod transfer;

use std::ops::DerefMut;

use super::exchange::Wiring;
use super::{Error, Values};
use crate::system::SystemGraph;
use airloop_fmi::Instance;

pub(super) use algebraic::{LoopFailure, LoopInput, carry_flag, residuals, solve_linear};
pub(super) use schedule::{Scope, inputs_for_events};
pub(super) use transfer::{Transfer, nominal};

/// Transfers of one pass over the variables of `scope`; instances come in evaluation order.
pub(super) fn transfers(graph: &SystemGraph, wiring: &Wiring, scope: Scope) -> Vec<Transfer> {
    let stages = schedule::schedule(graph, &wiring.read_outputs(), scope);
    stages.iter().map(|stage| Transfer::new(graph, wiring, stage)).collect()
}

/// Same as [`transfers`], among the components in `members` only and for what changes between events; with `inner`,
/// inputs from outside stay as they are.
pub(super) fn transfers_within(
    graph: &SystemGraph,
    wiring: &Wiring,
    members: &[usize],
    inner: bool,
) -> Vec<Transfer> {
    let stages = schedule::schedule_within(graph, members, inner);
    stages.iter().map(|stage| Transfer::new(graph, wiring, stage)).collect()
}

/// Initialization mode: passes values on until no output changes.
///
/// Without an algebraic loop every pass settles at least one more variable, so that there are at most as many as
/// connections, and one to see it. Where that is not enough, the dependencies of initialization may have a loop.
///
/// # Errors
/// [`Error::Unsettled`], [`Error::AlgebraicLoop`], or an FMU that fails.
pub(super) fn settle<I: DerefMut<Target = Instance>>(
    graph: &SystemGraph,
    wiring: &Wiring,
    instances: &mut [I],
    values: &mut Values,
    time: f64,
) -> Result<(), Error> {
    let mut usual = transfers(graph, wiring, Scope::All);
    // Outputs at the start values first: an input must not be given a value that no output ever had.
    for transfer in &mut usual {
        transfer.read(instances, values)?;
    }
    let passes = graph.connections.len() + 2;
    let mut changed = None;
    let mut run = |transfers: &mut Vec<Transfer>, values: &mut Values| -> Result<bool, Error> {
        for _ in 0..passes {
            let before = values.clone();
            for transfer in transfers.iter_mut() {
                transfer.run(instances, values).map_err(|failure| failure.at(time))?;
            }
            // Read again: in this mode an output may depend on more than the order of the pass knows.
            for transfer in transfers.iter_mut() {
                transfer.read(instances, values)?;
            }
            changed = values.first_difference(&before);
            if changed.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    };
    if run(&mut usual, values)? {
        return Ok(());
    }
    let mut initial = transfers(graph, wiring, Scope::Initial);
    if initial.iter().any(|transfer| matches!(transfer, Transfer::Loop(_))) && run(&mut initial, values)? {
        return Ok(());
    }
    let variable = changed.map_or_else(|| "a text".into(), |slot| wiring.name_of(slot, graph));
    Err(Error::Unsettled { passes, variable })
}
