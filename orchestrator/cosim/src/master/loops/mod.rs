//! Algebraic loops between slaves at the communication points, for the masters that step.
//!
//! The slaves that share a loop step together, as one group in the evaluation order. Where their outputs follow an
//! input as soon as it is set ([`follows`]), the loop is solved by Newton's method where the step begins, with the
//! inputs from outside that the step has, and again where it ends; inside the step its inputs are held (or run along
//! the polynomials of [`super::extrapolation`]). Where they do not, the step itself is solved for ([`over_step`]).
//!
//! Loops at initialization and in Model Exchange, and Newton's method at an instant, are in [`super::propagation`].

mod follows;
mod group;
mod over_step;
mod plan;

use std::ops::Range;

use super::exchange::{Node, Wiring};
use super::stop::{Stop, do_step, get_outputs};
use super::{Error, Grid, Settings, Values};
use crate::system::SystemGraph;
pub(super) use group::Group;

/// All loops of a system.
#[derive(Debug)]
pub(super) struct Loops {
    groups: Vec<Group>,
    /// Group of each node.
    group_of: Vec<Option<usize>>,
}

impl Loops {
    /// Finds out how the loops of initialized slaves can be solved; `None` without loops.
    ///
    /// # Errors
    /// [`Error::LoopMember`] for a slave that allows neither way.
    pub fn new(
        graph: &SystemGraph,
        wiring: &Wiring,
        settings: &Settings,
        grid: &Grid,
        values: &Values,
    ) -> Result<Option<Loops>, Error> {
        if graph.loops.is_empty() {
            return Ok(None);
        }
        let groups = plan::plan(graph, wiring, settings, grid, values)?;
        let mut group_of = vec![None; graph.components.len()];
        for (number, group) in groups.iter().enumerate() {
            group_of[group.nodes.clone()].fill(Some(number));
        }
        Ok(Some(Loops { groups, group_of }))
    }

    /// Method by which each loop is solved, one sentence each.
    pub fn notes(&self, nodes: &[Node]) -> Vec<String> {
        self.groups.iter().flat_map(|group| group.notes(nodes)).collect()
    }

    /// Whether a node shares a loop with the one before.
    pub fn continues(&self, node: usize) -> bool {
        self.group_of[node].is_some_and(|number| self.groups[number].nodes.start < node)
    }

    /// The group of a node.
    pub fn group_of(&self, node: usize) -> Option<usize> {
        self.group_of[node]
    }

    /// A group by its number.
    pub fn group(&mut self, number: usize) -> &mut Group {
        &mut self.groups[number]
    }

    /// All groups, in evaluation order.
    pub fn groups(&mut self) -> &mut [Group] {
        &mut self.groups
    }

    /// The nodes that step together with `node`, the first of them, and their group if they share a loop.
    pub fn block(&mut self, node: usize) -> (Range<usize>, Option<&mut Group>) {
        match self.group_of[node] {
            Some(number) => {
                let group = &mut self.groups[number];
                (group.nodes.clone(), Some(group))
            }
            None => (node..node + 1, None),
        }
    }

    /// Steps of a node beyond one per macro step.
    pub fn repeated_steps(&self, node: usize) -> u64 {
        self.group_of[node].map_or(0, |number| self.groups[number].repeated_steps(node))
    }

    /// Newton steps so far.
    pub fn rounds(&self) -> u64 {
        self.groups.iter().map(Group::rounds).sum()
    }

    /// One macro step from `t` to `t + h` \[s\] of the Gauss-Seidel (`serial`) or the Jacobi master.
    #[inline(never)]
    pub fn step(
        &mut self,
        nodes: &mut [Node],
        values: &mut Values,
        t: f64,
        h: f64,
        serial: bool,
    ) -> Result<(), Stop> {
        let mut ended = None;
        if serial {
            let mut next = 0;
            while next < nodes.len() {
                let (block, mut group) = self.block(next);
                next = block.end;
                set(nodes, values, &block, group.as_deref_mut(), t)?;
                advance(nodes, values, &block, group.as_deref_mut(), (t, h), &mut ended)?;
                finish(nodes, values, group, t + h, ended)?;
                read(nodes, values, block)?;
            }
        } else {
            // Loops first: what they come to is what the others see at the communication point.
            for group in &mut self.groups {
                group.begin(nodes, values, t)?;
            }
            for number in (0..nodes.len()).filter(|&number| self.group_of[number].is_none()) {
                nodes[number].set_inputs(values)?;
            }
            let mut next = 0;
            while next < nodes.len() {
                let (block, group) = self.block(next);
                next = block.end;
                advance(nodes, values, &block, group, (t, h), &mut ended)?;
            }
            for group in &mut self.groups {
                finish(nodes, values, Some(group), t + h, ended)?;
            }
            read(nodes, values, 0..nodes.len())?;
        }
        ended.map_or(Ok(()), |node| Err(Stop::Ended { node }))
    }
}

fn set(
    nodes: &mut [Node],
    values: &mut Values,
    block: &Range<usize>,
    group: Option<&mut Group>,
    t: f64,
) -> Result<(), Stop> {
    match group {
        Some(group) => group.begin(nodes, values, t),
        None => Ok(nodes[block.start].set_inputs(values)?),
    }
}

fn advance(
    nodes: &mut [Node],
    values: &mut Values,
    block: &Range<usize>,
    group: Option<&mut Group>,
    (t, h): (f64, f64),
    ended: &mut Option<usize>,
) -> Result<(), Stop> {
    match group.map(|group| group.step_as_one(nodes, values, t, h)) {
        Some(Err(stop)) => return Err(stop),
        Some(Ok(true)) => return Ok(()),
        Some(Ok(false)) | None => {}
    }
    for number in block.clone() {
        do_step(&mut nodes[number], number, values, (t, h), ended)?;
    }
    Ok(())
}

/// Solves the loops where the step ends, unless a slave asked for the end of the simulation and takes no more inputs.
fn finish(
    nodes: &mut [Node],
    values: &mut Values,
    group: Option<&mut Group>,
    end: f64,
    ended: Option<usize>,
) -> Result<(), Stop> {
    match group {
        Some(group) if !ended.is_some_and(|node| group.nodes.contains(&node)) => {
            group.solve(nodes, values, end)
        }
        _ => Ok(()),
    }
}

fn read(nodes: &mut [Node], values: &mut Values, mut block: Range<usize>) -> Result<(), Stop> {
    block.try_for_each(|number| get_outputs(&mut nodes[number], number, values))
}
