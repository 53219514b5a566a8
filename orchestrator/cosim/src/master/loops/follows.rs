//! Whether the outputs of a slave follow an input that is set, without a step.
//!
//! FMI 2.0.5 section 4.2.4 asks for a step between setting inputs and reading outputs of a slave, as a slave may
//! compute them in the step only. Many compute them when they are read. Which kind a slave is of shows on a second
//! instance, so that one that answers with an error does no harm.

use crate::master::exchange::{Node, Wiring};
use crate::master::initialize::enter_initialization;
use crate::master::propagation::nominal;
use crate::master::{Error, Grid, Settings, Values};
use crate::system::SystemGraph;
use airloop_fmi::{Error as FmuError, Slave, StepStatus};

/// Changes of an input that are tried, in units of max(|value|, nominal).
const CHANGES: [f64; 4] = [1e-3, -1e-3, 1.0, -1.0];

/// Inputs of a component in a loop, with the outputs of the loop that depend on each.
struct Dependent {
    input: u32,
    size: f64,
    outputs: Vec<u32>,
}

/// Whether all outputs in `members` (of which `component` has some) follow their inputs; `values` are those at the
/// start. Not, if it cannot be tried.
pub(super) fn follows(
    graph: &SystemGraph,
    wiring: &Wiring,
    (settings, grid): (&Settings, &Grid),
    values: &Values,
    component: usize,
    members: &[(usize, usize)],
) -> bool {
    let interface = graph.components[component].fmu.description.co_simulation.clone().unwrap_or_default();
    if interface.can_be_instantiated_only_once_per_process {
        return false;
    }
    let dependents = dependents(graph, component, members);
    let derivatives = interface.provides_directional_derivative;
    let tried = (|| -> Result<bool, Error> {
        let mut values = values.clone();
        let mut node = instantiate(graph, wiring, settings, &mut values, component)?;
        if !answers(&mut node, &dependents, derivatives)? {
            return Ok(false);
        }
        // A slave may treat the time before its first step in another way.
        if grid.steps() > 0 && node.do_step(grid.start(), grid.step_size(0))? == StepStatus::Complete {
            return Ok(answers(&mut node, &dependents, derivatives)?);
        }
        Ok(true)
    })();
    tried.unwrap_or(false)
}

fn dependents(graph: &SystemGraph, component: usize, members: &[(usize, usize)]) -> Vec<Dependent> {
    let owner = &graph.components[component];
    let variables = &owner.fmu.description.variables;
    let own = || members.iter().filter(|(index, _)| *index == component).map(|&(_, variable)| variable);
    let outputs: Vec<(usize, &[usize])> =
        own().map(|output| (output, owner.fmu.feed_through(output))).collect();
    let dependent = |input: usize| {
        let fed = outputs.iter().filter(|(output, inputs)| *output != input && inputs.contains(&input));
        Dependent {
            input: variables[input].value_reference,
            size: nominal(&variables[input]),
            outputs: fed.map(|(output, _)| variables[*output].value_reference).collect(),
        }
    };
    let is_input = |variable: &usize| variables[*variable].causality == airloop_fmi::Causality::Input;
    own().filter(is_input).map(dependent).collect()
}

/// A second instance at the start time, with the inputs that the first one has.
fn instantiate(
    graph: &SystemGraph,
    wiring: &Wiring,
    settings: &Settings,
    values: &mut Values,
    component: usize,
) -> Result<Node, Error> {
    let owner = &graph.components[component];
    let mut slave = Slave::instantiate(&owner.fmu, &owner.name, false)?;
    enter_initialization(&mut slave, owner, settings)?;
    let mut node = wiring.node(slave, component);
    node.set_inputs(values)?;
    node.exit_initialization_mode()?;
    node.get_outputs(values)?;
    Ok(node)
}

fn answers(node: &mut Node, dependents: &[Dependent], derivatives: bool) -> Result<bool, FmuError> {
    for Dependent { input, size, outputs } in dependents {
        let mut value = [0.0];
        node.get_real(&[*input], &mut value)?;
        let [value] = value;
        let mut before = vec![0.0; outputs.len()];
        let mut after = before.clone();
        node.get_real(outputs, &mut before)?;
        let mut followed = false;
        for change in CHANGES {
            node.set_real(&[*input], &[value + change * size.max(value.abs())])?;
            node.get_real(outputs, &mut after)?;
            followed = after != before;
            if followed {
                break;
            }
        }
        node.set_real(&[*input], &[value])?;
        if followed {
            continue;
        }
        // Nothing to follow where the derivative is 0.
        if !derivatives {
            return Ok(false);
        }
        for output in outputs {
            let mut gain = [0.0];
            node.directional_derivative(&[*output], &[*input], &[1.0], &mut gain)?;
            if gain != [0.0] {
                return Ok(false);
            }
        }
    }
    Ok(true)
}
