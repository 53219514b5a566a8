//! The serial master: one slave after the other, each with the newest outputs.
//!
//! In evaluation order, an output with direct feed-through has its new value before its consumers step; slaves
//! later in the order are seen with their values at the beginning of the step.

use super::Values;
use super::exchange::Node;
use super::stop::{Stop, do_step, get_outputs};

/// One macro step from `t` to `t + h` \[s\].
#[inline]
pub(super) fn step(nodes: &mut [Node], values: &mut Values, t: f64, h: f64) -> Result<(), Stop> {
    let mut ended = None;
    for (index, node) in nodes.iter_mut().enumerate() {
        node.set_inputs(values)?;
        do_step(node, index, values, (t, h), &mut ended)?;
        get_outputs(node, index, values)?;
    }
    ended.map_or(Ok(()), |node| Err(Stop::Ended { node }))
}
