//! Which way each loop of a system is solved, by what its slaves can do.

use super::follows::follows;
use super::group::{Group, Method};
use super::over_step::OverStep;
use crate::master::exchange::Wiring;
use crate::master::propagation::transfers_within;
use crate::master::{Algorithm, Error, Grid, Settings, Values};
use crate::system::SystemGraph;
use crate::system::order::loop_groups;

/// The groups in evaluation order.
pub(super) fn plan(
    graph: &SystemGraph,
    wiring: &Wiring,
    settings: &Settings,
    grid: &Grid,
    values: &Values,
) -> Result<Vec<Group>, Error> {
    let mut groups = Vec::new();
    for members in loop_groups(graph) {
        let start = graph.order.iter().position(|component| members.contains(component)).unwrap_or(0);
        let nodes = start..start + members.len();
        let variables: Vec<(usize, usize)> = graph
            .loops
            .iter()
            .filter(|one| members.contains(&one.variables[0].0))
            .flat_map(|one| one.variables.clone())
            .collect();
        let stuck = members
            .iter()
            .copied()
            .find(|&component| !follows(graph, wiring, (settings, grid), values, component, &variables));
        let method = match stuck {
            None => Method::AtPoint {
                all: transfers_within(graph, wiring, &members, false),
                inner: transfers_within(graph, wiring, &members, true),
            },
            Some(stuck) => {
                check_over_step(graph, settings, &members, stuck)?;
                Method::OverStep(Box::new(OverStep::new(graph, wiring, &members, nodes.clone(), stuck)))
            }
        };
        groups.push(Group { nodes, method });
    }
    groups.sort_by_key(|group| group.nodes.start);
    Ok(groups)
}

/// Refuses what cannot be solved over the step; the outputs of `stuck` do not follow its inputs without one.
fn check_over_step(
    graph: &SystemGraph,
    settings: &Settings,
    members: &[usize],
    stuck: usize,
) -> Result<(), Error> {
    const FOLLOWS: &str = "only lets its outputs follow its inputs through a step, so that";
    let refuse = |component: usize, reason: &str, remedy: &str| {
        let path = graph.loops.iter().find(|one| one.variables.iter().any(|&(owner, _)| owner == component));
        Err(Error::LoopMember {
            component: graph.components[component].name.clone(),
            reason: reason.to_owned(),
            path: path.map_or_else(String::new, |path| graph.loop_names(path).join(" -> ")),
            remedy: remedy.to_owned(),
        })
    };
    let interface = |component: usize| {
        graph.components[component].fmu.description.co_simulation.clone().unwrap_or_default()
    };
    let monolithic =
        graph.components.iter().all(|component| component.fmu.description.model_exchange.is_some());
    let other = match monolithic {
        true => "use `--master monolithic`",
        false => {
            "break the loop with a delay or a filter, or declare true `dependencies` of its outputs in the FMU"
        }
    };
    if let Some(&fixed) = members.iter().find(|&&member| !interface(member).can_get_and_set_fmu_state) {
        if fixed == stuck {
            let reason = format!(
                "{FOLLOWS} that step has to be repeated, but it cannot save and restore its state (canGetAndSetFMUstate), which is needed for"
            );
            return refuse(stuck, &reason, other);
        }
        let name = &graph.components[stuck].name;
        let reason = format!(
            "cannot save and restore its state (canGetAndSetFMUstate), but steps have to be repeated as `{name}` only lets its outputs follow its inputs through a step, for"
        );
        return refuse(fixed, &reason, other);
    }
    let reason = format!("{FOLLOWS} only held inputs of steps of one length solve");
    if settings.algorithm == Algorithm::InterfaceJacobian {
        return refuse(stuck, &reason, "use `--master gauss-seidel`");
    }
    if settings.adaptive.is_some() || settings.extrapolation > 0 {
        return refuse(stuck, &reason, "leave --adaptive and --extrapolation out");
    }
    Ok(())
}
