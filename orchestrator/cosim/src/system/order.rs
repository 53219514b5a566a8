//! Evaluation order from direct feed-through, and algebraic loops.
//!
//! The graph of variables has an edge for every connection and for every input that an output depends on directly
//! (`dependencies` of the model structure). Its strongly connected components (Tarjan 1972) are the algebraic
//! loops. Components are then ordered so that an output with direct feed-through comes before its consumers; those
//! that share a loop stand together.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::Error;
use super::graph::{Component, Connection, DataType, Source, SystemGraph};
use airloop_fmi::{InterfaceKind, Variability};

/// An algebraic loop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loop {
    /// All its inputs and outputs, as (component, variable), in ascending order.
    pub variables: Vec<(usize, usize)>,
    /// Some of them as a path that closes: each follows directly from the one before.
    pub path: Vec<(usize, usize)>,
}

/// All algebraic loops of a system, in the order of their first variables.
pub fn algebraic_loops(graph: &SystemGraph) -> Vec<Loop> {
    let variables = VariableGraph::new(&graph.components, &graph.connections);
    let nodes = |numbers: &[usize]| numbers.iter().map(|&node| variables.nodes[node]).collect::<Vec<_>>();
    let mut loops: Vec<Loop> = variables
        .cycles()
        .iter()
        .map(|members| {
            let path = nodes(&variables.path(members));
            let mut variables = nodes(members);
            variables.sort_unstable();
            Loop { variables, path }
        })
        .collect();
    loops.sort_by(|a, b| a.variables.cmp(&b.variables));
    loops
}

/// Refuses loops that no master with this interface solves.
///
/// # Errors
/// [`Error::AlgebraicLoop`] with the variables that form the loop. Model Exchange takes Reals; in Co-Simulation they
/// have to be continuous as well, as a discrete output does not follow its inputs between its events.
pub fn check_loops(graph: &SystemGraph, interface: InterfaceKind) -> Result<(), Error> {
    let solvable = |&(component, variable): &(usize, usize)| {
        let variable = &graph.components[component].fmu.description.variables[variable];
        let continuous = variable.variability == Variability::Continuous;
        DataType::of(variable) == DataType::Real && (continuous || interface == InterfaceKind::ModelExchange)
    };
    for one in &graph.loops {
        let variables = &one.variables;
        let Some(culprit) = variables.iter().find(|node| !solvable(node)) else { continue };
        let name = |&(component, variable): &(usize, usize)| graph.components[component].path_of(variable);
        let reals = variables.iter().all(|&(component, variable)| {
            DataType::of(&graph.components[component].fmu.description.variables[variable]) == DataType::Real
        });
        let (file, culprit) = (graph.file.clone(), name(culprit));
        return Err(Error::AlgebraicLoop {
            file,
            variables: graph.loop_names(one),
            culprit,
            master: if reals { ", run it with `--master monolithic`" } else { "" },
        });
    }
    Ok(())
}

/// Components that share algebraic loops, each group in ascending order; components outside all loops are missing.
pub fn loop_groups(graph: &SystemGraph) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for one in &graph.loops {
        let mut members: Vec<usize> = one.variables.iter().map(|&(component, _)| component).collect();
        let shares = |group: &Vec<usize>| group.iter().any(|member| members.contains(member));
        let (shared, others): (Vec<_>, Vec<_>) = groups.into_iter().partition(shares);
        groups = others;
        members.extend(shared.into_iter().flatten());
        members.sort_unstable();
        members.dedup();
        groups.push(members);
    }
    groups
}

/// Components in evaluation order (indices into `graph.components`), those that share a loop one after the other.
///
/// Takes, again and again, the group that waits for the fewest others. Waiting for an output with direct
/// feed-through counts most, then for a discrete output (it only gets its value for the interval in the step), then
/// for any other; the order of the file decides between equals.
pub fn evaluation_order(graph: &SystemGraph) -> Vec<usize> {
    let mut groups = loop_groups(graph);
    let looped: Vec<usize> = groups.concat();
    let mut is_looped = vec![false; graph.components.len()];
    looped.iter().for_each(|&index| is_looped[index] = true);
    groups.extend((0..graph.components.len()).filter(|&index| !is_looped[index]).map(|index| vec![index]));
    groups.sort();
    let mut group_of = vec![0; graph.components.len()];
    for (group, members) in groups.iter().enumerate() {
        members.iter().for_each(|&member| group_of[member] = group);
    }
    let mut waiting = vec![[0usize; 3]; groups.len()];
    let mut consumers: Vec<Vec<(usize, usize)>> = vec![Vec::new(); groups.len()];
    for connection in &graph.connections {
        let Source::Output { component, variable } = connection.source else { continue };
        let (from, to) = (group_of[component], group_of[connection.component]);
        if from == to {
            continue;
        }
        let producer = &graph.components[component];
        let discrete = producer.fmu.description.variables[variable].variability == Variability::Discrete;
        let rank = match producer.fmu.feed_through(variable).is_empty() {
            false => 0,
            true if discrete => 1,
            true => 2,
        };
        waiting[to][rank] += 1;
        consumers[from].push((to, rank));
    }
    // The group that waits for the fewest comes first; one that has been counted down since it was queued is queued
    // again.
    let mut order = Vec::with_capacity(graph.components.len());
    let mut queue: BinaryHeap<_> = (0..groups.len()).map(|group| Reverse((waiting[group], group))).collect();
    let mut taken = vec![false; groups.len()];
    while let Some(Reverse((counted, group))) = queue.pop() {
        if taken[group] || counted != waiting[group] {
            continue;
        }
        taken[group] = true;
        for &(consumer, rank) in &consumers[group] {
            waiting[consumer][rank] -= 1;
            queue.push(Reverse((waiting[consumer], consumer)));
        }
        order.extend_from_slice(&groups[group]);
    }
    order
}

/// Connected variables and what follows directly from what.
struct VariableGraph {
    /// (component, variable)
    nodes: Vec<(usize, usize)>,
    /// Successors of each node.
    next: Vec<Vec<usize>>,
}

impl VariableGraph {
    fn new(components: &[Component], connections: &[Connection]) -> VariableGraph {
        let mut graph = VariableGraph { nodes: Vec::new(), next: Vec::new() };
        let mut index = HashMap::new();
        let mut outputs = Vec::new();
        for connection in connections {
            let Source::Output { component, variable } = connection.source else { continue };
            let known = index.len();
            let from = graph.node(&mut index, (component, variable));
            if index.len() > known {
                outputs.push((component, variable));
            }
            let to = graph.node(&mut index, (connection.component, connection.variable));
            graph.next[from].push(to);
        }
        for (component, output) in outputs {
            let to = index[&(component, output)];
            for &input in components[component].fmu.feed_through(output) {
                if let Some(&from) = index.get(&(component, input)) {
                    graph.next[from].push(to);
                }
            }
        }
        graph
    }

    fn node(&mut self, index: &mut HashMap<(usize, usize), usize>, key: (usize, usize)) -> usize {
        *index.entry(key).or_insert_with(|| {
            self.nodes.push(key);
            self.next.push(Vec::new());
            self.nodes.len() - 1
        })
    }

    /// Strongly connected components that hold a cycle.
    fn cycles(&self) -> Vec<Vec<usize>> {
        let mut components = strongly_connected(&self.next);
        components.retain(|members| members.len() > 1 || self.next[members[0]].contains(&members[0]));
        components
    }

    /// The nodes of a cycle inside a strongly connected component, in its direction.
    fn path(&self, members: &[usize]) -> Vec<usize> {
        // Inside a strongly connected component every node has a successor inside it: walking on closes a cycle.
        let mut path = vec![members[0]];
        loop {
            let last = path[path.len() - 1];
            let inside = self.next[last].iter().find(|node| members.contains(node));
            let Some(&next) = inside else { return path };
            if let Some(start) = path.iter().position(|&node| node == next) {
                return path.split_off(start);
            }
            path.push(next);
        }
    }
}

/// Strongly connected components (Tarjan 1972, without recursion), each in an order of its own.
pub fn strongly_connected(next: &[Vec<usize>]) -> Vec<Vec<usize>> {
    const UNSEEN: usize = usize::MAX;
    let mut number = vec![UNSEEN; next.len()];
    let mut low = vec![0; next.len()];
    let mut on_stack = vec![false; next.len()];
    let (mut stack, mut components, mut counter) = (Vec::new(), Vec::new(), 0);
    for root in 0..next.len() {
        if number[root] != UNSEEN {
            continue;
        }
        let mut calls = vec![(root, 0)];
        while let Some((node, edge)) = calls.pop() {
            if edge == 0 {
                number[node] = counter;
                low[node] = counter;
                counter += 1;
                stack.push(node);
                on_stack[node] = true;
            }
            if let Some(&successor) = next[node].get(edge) {
                calls.push((node, edge + 1));
                if number[successor] == UNSEEN {
                    calls.push((successor, 0));
                } else if on_stack[successor] {
                    low[node] = low[node].min(number[successor]);
                }
                continue;
            }
            if low[node] == number[node] {
                let start =
                    stack.iter().rposition(|&member| member == node).expect("the node is on the stack");
                let members = stack.split_off(start);
                members.iter().for_each(|&member| on_stack[member] = false);
                components.push(members);
            }
            if let Some(&(parent, _)) = calls.last() {
                low[parent] = low[parent].min(low[node]);
            }
        }
    }
    components
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(mut components: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
        components.iter_mut().for_each(|members| members.sort_unstable());
        components.sort();
        components
    }

    #[test]
    fn strongly_connected_components_agree_with_mutual_reachability() {
        // All graphs of 4 nodes without self loops, against the definition.
        let pairs: Vec<(usize, usize)> =
            (0..4).flat_map(|a| (0..4).filter(move |&b| a != b).map(move |b| (a, b))).collect();
        for bits in 0..1u32 << pairs.len() {
            let mut next = vec![Vec::new(); 4];
            let mut reach = [[false; 4]; 4];
            for (bit, &(a, b)) in pairs.iter().enumerate() {
                if bits >> bit & 1 == 1 {
                    next[a].push(b);
                    reach[a][b] = true;
                }
            }
            for k in 0..4 {
                let through = reach[k];
                for row in reach.iter_mut().filter(|row| row[k]) {
                    row.iter_mut().zip(through).for_each(|(reached, next)| *reached |= next);
                }
            }
            let mut expected: Vec<Vec<usize>> = Vec::new();
            for (a, row) in reach.iter().enumerate() {
                let class: Vec<usize> = (0..4).filter(|&b| a == b || row[b] && reach[b][a]).collect();
                if class[0] == a {
                    expected.push(class);
                }
            }
            assert_eq!(sorted(strongly_connected(&next)), sorted(expected), "{next:?}");
        }
    }

    #[test]
    fn a_long_chain_does_not_overflow_the_stack() {
        let length = 200_000;
        let next: Vec<Vec<usize>> =
            (0..length).map(|node| if node + 1 < length { vec![node + 1] } else { vec![] }).collect();
        assert_eq!(strongly_connected(&next).len(), length);
    }

    #[test]
    fn a_cycle_is_walked_in_its_direction() {
        let graph = VariableGraph {
            nodes: vec![(0, 0); 5],
            next: vec![vec![1], vec![2], vec![3], vec![1, 4], vec![]],
        };
        let cycles = graph.cycles();
        assert_eq!(cycles.len(), 1);
        let cycle = graph.path(&cycles[0]);
        for (position, &node) in cycle.iter().enumerate() {
            assert!(graph.next[node].contains(&cycle[(position + 1) % cycle.len()]), "{cycle:?}");
        }
        assert_eq!(cycle.len(), 3);
    }
}
