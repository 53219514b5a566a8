//! Order in which variables are set and read, so that one pass brings every value through the whole system.
//!
//! Nodes are connected inputs and the outputs that are read; an edge is a connection or a direct feed-through. The
//! strongly connected components (Tarjan 1972) in topological order are the passes: a single variable is set or read,
//! neighbors of one component and type together; several form an algebraic loop, solved in [`super::algebraic`].

use std::collections::HashMap;

use crate::system::SystemGraph;
use crate::system::graph::{Connection, DataType, Source};
use crate::system::order::strongly_connected;
use airloop_fmi::{Causality, Variability};

/// Variable of a component: (index of the component, index of the variable).
pub type Node = (usize, usize);

/// One pass over the system.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stage {
    /// Inputs of one component and type take the values of their sources.
    Set { component: usize, data_type: DataType, inputs: Vec<usize> },
    /// Outputs of one component and type are read.
    Get { component: usize, data_type: DataType, outputs: Vec<usize> },
    /// Variables that depend on each other.
    Loop(Vec<Node>),
}

/// Variables that a schedule holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Variables that may change between events and have a way to a derivative: for the right-hand side.
    Rates,
    /// As `Rates`, and all outputs: for a row of the result.
    Results,
    /// Everything: at events and initialization.
    All,
    /// As `All`, with the dependencies of initialization where the FMU lists them.
    Initial,
}

/// Whether a variable is exchanged between events: inputs that may be set there; Real outputs of any variability, as
/// a model may turn a discrete output into a continuous one by a parameter, and reading one that is held does no harm.
fn is_exchanged(graph: &SystemGraph, (component, variable): Node) -> bool {
    let variable = &graph.components[component].fmu.description.variables[variable];
    let settable = variable.causality == Causality::Output || variable.variability == Variability::Continuous;
    DataType::of(variable) == DataType::Real && settable
}

/// System inputs that feed a variable which can only be set at events, by index.
pub fn inputs_for_events(graph: &SystemGraph) -> Vec<bool> {
    let mut found = vec![false; graph.inputs.len()];
    for connection in &graph.connections {
        if let Source::Input(input) = connection.source {
            found[input] |= !is_exchanged(graph, (connection.component, connection.variable));
        }
    }
    found
}

/// The connection into each input that has one.
pub fn sources(graph: &SystemGraph) -> HashMap<Node, &Connection> {
    let key = |connection: &Connection| (connection.component, connection.variable);
    graph.connections.iter().map(|connection| (key(connection), connection)).collect()
}

/// The stages in order; `outputs` are all outputs that are read.
pub fn schedule(graph: &SystemGraph, outputs: &[Node], scope: Scope) -> Vec<Stage> {
    let all = matches!(scope, Scope::All | Scope::Initial);
    let changes = |node: Node| all || is_exchanged(graph, node);
    let mut nodes: Vec<Node> = Vec::new();
    let mut index = HashMap::new();
    let mut add = |node: Node| {
        index.entry(node).or_insert_with(|| {
            nodes.push(node);
            nodes.len() - 1
        });
    };
    for connection in &graph.connections {
        if changes((connection.component, connection.variable)) {
            add((connection.component, connection.variable));
        }
        if let Source::Output { component, variable } = connection.source
            && changes((component, variable))
        {
            add((component, variable));
        }
    }
    if scope != Scope::Rates {
        outputs.iter().for_each(|&node| add(node));
    }
    stages(graph, &nodes, &index, scope)
}

/// The stages among the components in `members`, for what changes between events; with `inner`, inputs from outside
/// stay as they are.
pub fn schedule_within(graph: &SystemGraph, members: &[usize], inner: bool) -> Vec<Stage> {
    let mut nodes: Vec<Node> = Vec::new();
    let mut index = HashMap::new();
    let mut add = |node: Node| {
        index.entry(node).or_insert_with(|| {
            nodes.push(node);
            nodes.len() - 1
        });
    };
    for connection in &graph.connections {
        let input = (connection.component, connection.variable);
        if !members.contains(&connection.component) || !is_exchanged(graph, input) {
            continue;
        }
        match connection.source {
            Source::Output { component, variable } if members.contains(&component) => {
                add((component, variable));
                add(input);
            }
            _ if !inner => add(input),
            _ => {}
        }
    }
    stages(graph, &nodes, &index, Scope::Rates)
}

/// The stages for these variables, of which `index` knows the positions.
fn stages(graph: &SystemGraph, nodes: &[Node], index: &HashMap<Node, usize>, scope: Scope) -> Vec<Stage> {
    let mut next: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    for connection in &graph.connections {
        let Source::Output { component, variable } = connection.source else { continue };
        let to = index.get(&(connection.component, connection.variable));
        if let (Some(&from), Some(&to)) = (index.get(&(component, variable)), to) {
            next[from].push(to);
        }
    }
    for (&(component, variable), &to) in index {
        let owner = &graph.components[component];
        if owner.fmu.description.variables[variable].causality == Causality::Output {
            let inputs = match scope {
                Scope::Initial => owner.fmu.initial_feed_through(variable),
                _ => owner.fmu.feed_through(variable),
            };
            inputs
                .iter()
                .filter_map(|&input| index.get(&(component, input)))
                .for_each(|&from| next[from].push(to));
        }
    }
    next.iter_mut().for_each(|successors| successors.sort_unstable());
    in_order(graph, nodes, &next)
}

fn in_order(graph: &SystemGraph, nodes: &[Node], next: &[Vec<usize>]) -> Vec<Stage> {
    let groups = strongly_connected(next);
    let mut group_of = vec![0; nodes.len()];
    for (group, members) in groups.iter().enumerate() {
        members.iter().for_each(|&member| group_of[member] = group);
    }
    let mut waiting = vec![0usize; groups.len()];
    for (from, successors) in next.iter().enumerate() {
        let others = successors.iter().filter(|&&to| group_of[to] != group_of[from]);
        others.for_each(|&to| waiting[group_of[to]] += 1);
    }
    let is_loop = |group: usize| {
        let members = &groups[group];
        members.len() > 1 || next[members[0]].contains(&members[0])
    };
    // What can be done in one call: component, direction and type; loops stand alone.
    let kind = |group: usize| {
        let (component, variable) = nodes[groups[group][0]];
        let variable = &graph.components[component].fmu.description.variables[variable];
        (component, variable.causality == Causality::Output, DataType::of(variable))
    };
    let mut left: Vec<usize> = (0..groups.len()).collect();
    let mut stages = Vec::new();
    loop {
        let ready: Vec<usize> = left.iter().copied().filter(|&group| waiting[group] == 0).collect();
        // Inputs first: more outputs are then ready for the same call.
        let Some(&first) = ready.iter().find(|&&group| !is_loop(group) && !kind(group).1).or(ready.first())
        else {
            return stages;
        };
        let taken: Vec<usize> = match is_loop(first) {
            true => vec![first],
            false => {
                ready.into_iter().filter(|&group| !is_loop(group) && kind(group) == kind(first)).collect()
            }
        };
        left.retain(|group| !taken.contains(group));
        for &group in &taken {
            for &member in &groups[group] {
                let others = next[member].iter().filter(|&&to| group_of[to] != group);
                others.for_each(|&to| waiting[group_of[to]] -= 1);
            }
        }
        if is_loop(first) {
            let mut members: Vec<Node> = groups[first].iter().map(|&member| nodes[member]).collect();
            members.sort_unstable();
            let data_type = |&(component, variable): &Node| {
                DataType::of(&graph.components[component].fmu.description.variables[variable])
            };
            match members.iter().all(|node| data_type(node) == DataType::Real) {
                true => stages.push(Stage::Loop(members)),
                // No Newton iteration with other types: one after the other, as often as it takes.
                false => stages
                    .extend(members.iter().map(|&(component, variable)| single(graph, component, variable))),
            }
            continue;
        }
        let mut variables: Vec<usize> = taken.iter().map(|&group| nodes[groups[group][0]].1).collect();
        variables.sort_unstable();
        let (component, is_output, data_type) = kind(first);
        stages.push(match is_output {
            true => Stage::Get { component, data_type, outputs: variables },
            false => Stage::Set { component, data_type, inputs: variables },
        });
    }
}

/// The stage of one variable alone.
fn single(graph: &SystemGraph, component: usize, variable: usize) -> Stage {
    let description = &graph.components[component].fmu.description.variables[variable];
    let data_type = DataType::of(description);
    match description.causality {
        Causality::Output => Stage::Get { component, data_type, outputs: vec![variable] },
        _ => Stage::Set { component, data_type, inputs: vec![variable] },
    }
}
