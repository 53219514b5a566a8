//! From a system graph to slaves at the start time, with outputs that are consistent across all connections.

use super::exchange::{Node, Wiring};
use super::propagation;
use super::{Error, Grid, Settings, Values};
use crate::system::SystemGraph;
use crate::system::graph::{Component, Start};
use airloop_fmi::{Instance, Slave, VariableKind};

/// Instantiates, sets start values and runs through initialization mode; nodes come in evaluation order.
pub(super) fn initialize(
    graph: &SystemGraph,
    wiring: &Wiring,
    settings: &Settings,
    grid: &Grid,
    values: &mut Values,
) -> Result<Vec<Node>, Error> {
    let mut slaves = Vec::with_capacity(graph.components.len());
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
        enter_initialization(&mut slave, component, settings)?;
        slaves.push(slave);
    }
    propagation::settle(graph, wiring, &mut slaves, values, grid.start())?;
    let mut nodes: Vec<Node> =
        slaves.into_iter().zip(&graph.order).map(|(slave, &index)| wiring.node(slave, index)).collect();
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

/// Brings a new instance into initialization mode, with the start values of its component.
pub(super) fn enter_initialization(
    instance: &mut Instance,
    component: &Component,
    settings: &Settings,
) -> Result<(), Error> {
    for start in &component.start_values {
        let variable = &component.fmu.description.variables[start.variable];
        let reference = [variable.value_reference];
        match (&start.value, &variable.kind) {
            (Start::Real(value), VariableKind::Real(_)) => instance.set_real(&reference, &[*value])?,
            (Start::Integer(value), _) => instance.set_integer(&reference, &[*value])?,
            (Start::Boolean(value), _) => instance.set_boolean(&reference, &[*value])?,
            (Start::String(value), _) => instance.set_string(&reference, &[value.as_str()])?,
            (Start::Real(_), _) => unreachable!("start values have the type of their variable"),
        }
    }
    instance.setup_experiment(settings.tolerance, settings.start_time, Some(settings.stop_time))?;
    Ok(instance.enter_initialization_mode()?)
}
