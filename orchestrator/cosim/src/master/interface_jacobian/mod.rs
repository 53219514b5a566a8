//! The interface-Jacobian master: linearly implicit co-simulation of strongly coupled components.
//!
//! A strongly connected component of the graph is solved inside the master as a small stiff differential equation,
//! the reduced problem: every FMU with states is its linear model about the present point plus a defect learned from
//! its own steps, every FMU without states is the function that it is. Only then do the FMUs step, each under the
//! straight line with the mean and the first moment of the input that was found. One repetition from the saved state
//! removes the error of linearization. The stiffness of the coupling is thereby met by an L-stable method and limits
//! no step.
//!
//! Components outside all cycles step once, in the order of the graph. An algebraic loop is part of the reduced
//! problem; where the step ends it is solved once more through the FMUs themselves ([`super::loops`]), so that what is
//! passed on is not an approximation. Events inside a coupled component are left to the monolithic master.

mod capabilities;
mod coupled;
mod dense;
mod evaluator;
mod local_model;
mod plan;
mod radau;
mod reduced;
mod signal;
mod single;
mod static_block;
mod unit;

use super::exchange::{Node, Wiring};
use super::loops::Loops;
use super::propagation::carry_flag;
use super::stop::Stop;
use super::{Error, Grid, Settings, Values};
use crate::system::SystemGraph;
use coupled::Coupled;
use plan::Planner;
pub(super) use plan::{interfaces, nominal};
pub(super) use signal::Signal as Trajectory;
pub(super) use unit::{Feed, Outputs, Unit};

/// One strongly connected component of the graph.
#[derive(Debug)]
enum Part {
    /// A unit outside all cycles, by number.
    Single(usize),
    /// Units in a cycle.
    Coupled(Box<Coupled>),
}

/// See the module.
#[derive(Debug)]
pub(super) struct InterfaceJacobian {
    /// In the order of their steps.
    parts: Vec<Part>,
    /// In evaluation order, as the nodes.
    units: Vec<Unit>,
    outputs: Outputs,
    /// Workspace of single steps.
    cuts: Vec<f64>,
    /// Start time \[s\].
    start: f64,
    notes: Vec<String>,
}

impl InterfaceJacobian {
    /// Plans the steps of initialized slaves.
    pub fn new(
        graph: &SystemGraph,
        wiring: &Wiring,
        settings: &Settings,
        grid: &Grid,
        nodes: &mut [Node],
        values: &Values,
        loops: Option<&Loops>,
    ) -> Result<InterfaceJacobian, Error> {
        let mut planner = Planner::new(graph, wiring, settings, grid);
        let mut units: Vec<Unit> = (0..nodes.len()).map(|unit| planner.unit(unit)).collect();
        let (groups, delayed) = planner.parts();
        planner.connect(&mut units, &delayed, values);
        planner.note_samples(&units);
        let pieces = planner.pieces(&units);
        let outputs = planner.outputs(&units, nodes, pieces)?;
        let mut parts = Vec::with_capacity(groups.len());
        for (members, is_coupled) in groups {
            parts.push(match is_coupled {
                false => Part::Single(members[0]),
                true => {
                    let mut coupled = planner.couple(&mut units, &members, pieces)?;
                    loops.iter().for_each(|loops| coupled.place_loops(loops));
                    Part::Coupled(Box::new(coupled))
                }
            });
        }
        let (cuts, start, notes) = (Vec::with_capacity(pieces), grid.start(), planner.notes);
        Ok(InterfaceJacobian { parts, units, outputs, cuts, start, notes })
    }

    /// One macro step from `t` to `t + h` \[s\].
    pub fn step(
        &mut self,
        nodes: &mut [Node],
        values: &mut Values,
        mut loops: Option<&mut Loops>,
        t: f64,
        h: f64,
    ) -> Result<(), Stop> {
        let outputs = &mut self.outputs;
        outputs.begin.copy_from_slice(&outputs.y);
        for part in &mut self.parts {
            match part {
                &mut Part::Single(number) => {
                    let (unit, node) = (&mut self.units[number], &mut nodes[number]);
                    single::step(unit, node, outputs, values, (self.start, t, h), &mut self.cuts)?;
                }
                Part::Coupled(coupled) => {
                    let loops = loops.as_deref_mut();
                    coupled.step(&mut self.units, nodes, outputs, values, loops, (t, h))?;
                }
            }
        }
        match self.units.iter().find(|unit| unit.ended) {
            Some(unit) => Err(Stop::Ended { node: unit.number }),
            None => Ok(()),
        }
    }

    /// Shows every number that is carried from step to step, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        self.outputs.carry(each);
        for unit in &mut self.units {
            unit.u.iter_mut().chain(unit.before.iter_mut().flatten()).for_each(&mut *each);
            carry_flag(&mut unit.ended, each);
        }
        for part in &mut self.parts {
            if let Part::Coupled(coupled) = part {
                each(&mut coupled.last_step);
                coupled.problem.dynamics.iter_mut().for_each(|block| block.model.carry(each));
            }
        }
    }

    /// Shows every number that iterations begin from, always in the same order.
    pub fn carry_guesses(&mut self, each: &mut dyn FnMut(&mut f64)) {
        for part in &mut self.parts {
            if let Part::Coupled(coupled) = part {
                coupled.radau.carry(each);
                coupled.problem.w.iter_mut().for_each(&mut *each);
            }
        }
    }

    /// Trajectories of system inputs (by place in the flat buffer) over the next step; inputs without one are held.
    pub fn trajectories(&mut self) -> &mut Vec<(usize, Trajectory)> {
        &mut self.outputs.trajectories
    }

    /// Substitutes for missing capabilities of FMUs, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Steps of each unit so far, in evaluation order.
    pub fn fmu_steps(&self) -> impl Iterator<Item = u64> + '_ {
        self.units.iter().map(|unit| unit.steps)
    }

    /// Evaluations of static blocks, rounds of Newton's method, and steps of coupled components with repetitions.
    pub fn inner_work(&self) -> [u64; 3] {
        self.parts.iter().fold([0; 3], |sum, part| match part {
            Part::Single(_) => sum,
            Part::Coupled(coupled) => {
                let work = [coupled.problem.evaluations, coupled.radau.rounds, coupled.passes];
                [sum[0] + work[0], sum[1] + work[1], sum[2] + work[2]]
            }
        })
    }
}
