//! The parallel master: all outputs at the communication point are exchanged, then all slaves step.
//!
//! The order of the slaves does not matter; every connection adds a delay of one communication step.

use super::Stop;
use super::Values;
use super::exchange::Node;
use airloop_fmi::StepStatus;

/// One macro step from `t` to `t + h` \[s\].
#[inline]
pub(super) fn step(nodes: &mut [Node], values: &mut Values, t: f64, h: f64) -> Result<(), Stop> {
    for node in nodes.iter_mut() {
        node.set_inputs(values)?;
    }
    let mut ended = None;
    for (index, node) in nodes.iter_mut().enumerate() {
        let status = node.do_step(t, h)?;
        if status != StepStatus::Complete {
            ended = Some(super::ended(node, index, status, values, t + h)?);
        }
    }
    for (index, node) in nodes.iter_mut().enumerate() {
        node.get_outputs(values)?;
        if !node.outputs_are_finite(values) {
            return Err(Stop::NotFinite { node: index });
        }
    }
    ended.map_or(Ok(()), |node| Err(Stop::Ended { node }))
}
