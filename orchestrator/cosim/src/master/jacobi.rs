//! The parallel master: all outputs at the communication point are exchanged, then all slaves step.
//!
//! The order of the slaves does not matter; every connection adds a delay of one communication step.

use super::Values;
use super::exchange::Node;
use super::stop::{Stop, do_step, get_outputs};

/// One macro step from `t` to `t + h` \[s\].
#[inline]
pub(super) fn step(nodes: &mut [Node], values: &mut Values, t: f64, h: f64) -> Result<(), Stop> {
    for node in nodes.iter_mut() {
        node.set_inputs(values)?;
    }
    let mut ended = None;
    for (index, node) in nodes.iter_mut().enumerate() {
        do_step(node, index, values, (t, h), &mut ended)?;
    }
    for (index, node) in nodes.iter_mut().enumerate() {
        get_outputs(node, index, values)?;
    }
    ended.map_or(Ok(()), |node| Err(Stop::Ended { node }))
}
