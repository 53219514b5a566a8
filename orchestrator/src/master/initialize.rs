//! From a system graph to slaves at the start time, with outputs that are consistent across all connections.

use super::exchange::{Node, Values, Wiring};
use super::{Error, Grid, Settings};
use crate::fmu::{Instance, Slave, VariableKind};
use crate::system::SystemGraph;
use crate::system::graph::{Component, Start};

/// Instantiates, sets start values and runs through initialisation mode; nodes come in evaluation order.
pub(super) fn initialize(
    graph: &SystemGraph,
    wiring: &Wiring,
    settings: &Settings,
    grid: &Grid,
    values: &mut Values,
) -> Result<Vec<Node>, Error> {
    let mut nodes = Vec::with_capacity(graph.components.len());
    for &index in &graph.order {
        let component = &graph.components[index];
        let fixed_step = component
            .fmu
            .description
            .co_simulation
            .as_ref()
            .is_some_and(|interface| !interface.can_handle_variable_communication_step_size);
        if fixed_step && grid.shortened() {
            let (component, stop, step) = (component.name.clone(), grid.stop(), grid.step());
            return Err(Error::FixedStepOnly { component, stop, step });
        }
        let mut slave = Slave::instantiate(&component.fmu, &component.name, false)?;
        set_start_values(&mut slave, component)?;
        slave.setup_experiment(settings.tolerance, grid.start(), Some(grid.stop()))?;
        slave.enter_initialization_mode()?;
        nodes.push(wiring.node(slave, index));
    }
    settle(graph, wiring, &mut nodes, values)?;
    for node in &mut nodes {
        node.exit_initialization_mode()?;
    }
    for node in &mut nodes {
        node.get_outputs(values)?;
    }
    match nodes.iter().find(|node| !node.outputs_are_finite(values)) {
        Some(node) => Err(node.not_finite(values, grid.start())),
        None => Ok(nodes),
    }
}

/// Passes values on in evaluation order until no output changes.
///
/// Without an algebraic loop every round settles at least one more variable, so that there are at most as many
/// rounds as connections, and one to see it.
fn settle(
    graph: &SystemGraph,
    wiring: &Wiring,
    nodes: &mut [Node],
    values: &mut Values,
) -> Result<(), Error> {
    // Outputs at the start values first: an input must not be given a value that no output ever had.
    for node in nodes.iter_mut() {
        node.get_outputs(values)?;
    }
    let passes = graph.connections.len() + 2;
    let mut changed = None;
    for _ in 0..passes {
        let before = values.clone();
        for node in nodes.iter_mut() {
            node.set_inputs(values)?;
            node.get_outputs(values)?;
        }
        changed = values.first_difference(&before);
        if changed.is_none() {
            return Ok(());
        }
    }
    let variable = changed.map_or_else(|| "a text".into(), |slot| wiring.name_of(slot, graph));
    Err(Error::Unsettled { passes, variable })
}

pub(super) fn set_start_values(slave: &mut Instance, component: &Component) -> Result<(), Error> {
    for start in &component.start_values {
        let variable = &component.fmu.description.variables[start.variable];
        let reference = [variable.value_reference];
        match (&start.value, &variable.kind) {
            (Start::Real(value), VariableKind::Real(_)) => slave.set_real(&reference, &[*value])?,
            (Start::Integer(value), _) => slave.set_integer(&reference, &[*value])?,
            (Start::Boolean(value), _) => slave.set_boolean(&reference, &[*value])?,
            (Start::String(value), _) => slave.set_string(&reference, &[value.as_str()])?,
            (Start::Real(_), _) => unreachable!("start values have the type of their variable"),
        }
    }
    Ok(())
}
