//! Slaves that share algebraic loops, and how these are solved.

use std::ops::Range;

use super::over_step::OverStep;
use crate::master::Values;
use crate::master::exchange::Node;
use crate::master::propagation::Transfer;
use crate::master::stop::Stop;

/// See the module.
#[derive(Debug)]
pub(in crate::master) struct Group {
    /// Its nodes, which stand together in the evaluation order.
    pub nodes: Range<usize>,
    pub method: Method,
}

/// Method by which the loops of a group are solved.
#[derive(Debug)]
pub(in crate::master) enum Method {
    /// At the communication points, as outputs follow inputs that are set.
    AtPoint {
        /// All that is set and read where a step begins.
        all: Vec<Transfer>,
        /// The same without inputs from outside.
        inner: Vec<Transfer>,
    },
    /// Over the step, as outputs follow inputs through a step only.
    OverStep(Box<OverStep>),
}

impl Group {
    /// Sets all inputs where a step begins, so that the loops are solved at `t` \[s\]; or remembers them for the step.
    pub fn begin(&mut self, nodes: &mut [Node], values: &mut Values, t: f64) -> Result<(), Stop> {
        match &mut self.method {
            Method::AtPoint { all, .. } => {
                for node in &mut nodes[self.nodes.clone()] {
                    node.set_inputs(values)?;
                }
                run(all, nodes, values, t)
            }
            Method::OverStep(over) => {
                over.begin(values);
                Ok(())
            }
        }
    }

    /// Solves the loops at `time` \[s\], with the inputs from outside that the slaves have.
    pub fn solve(&mut self, nodes: &mut [Node], values: &mut Values, time: f64) -> Result<(), Stop> {
        let Method::AtPoint { inner: transfers, .. } = &mut self.method else { return Ok(()) };
        run(transfers, nodes, values, time)
    }

    /// Shows what the next solutions begin from, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        match &mut self.method {
            Method::AtPoint { all, inner } => {
                for transfer in all.iter_mut().chain(inner) {
                    if let Transfer::Loop(solver) = transfer {
                        solver.carry(each);
                    }
                }
            }
            Method::OverStep(over) => over.carry(each),
        }
    }

    /// Steps the whole group from `t` to `t + h` \[s\] and solves it over the step; false if its slaves are to step
    /// one by one.
    pub fn step_as_one(
        &mut self,
        nodes: &mut [Node],
        values: &mut Values,
        t: f64,
        h: f64,
    ) -> Result<bool, Stop> {
        match &mut self.method {
            Method::AtPoint { .. } => Ok(false),
            Method::OverStep(over) => over.step(nodes, values, t, h).map(|()| true),
        }
    }

    /// See [`super::Loops::notes`].
    pub fn notes(&self, nodes: &[Node]) -> Vec<String> {
        match &self.method {
            Method::AtPoint { all, .. } => all
                .iter()
                .filter_map(|transfer| match transfer {
                    Transfer::Loop(algebraic) => Some(algebraic.notes(nodes)),
                    _ => None,
                })
                .flatten()
                .collect(),
            Method::OverStep(over) => vec![over.note()],
        }
    }

    /// See [`super::Loops::repeated_steps`].
    pub fn repeated_steps(&self, node: usize) -> u64 {
        match &self.method {
            Method::AtPoint { .. } => 0,
            Method::OverStep(over) => over.repeated_steps(node - self.nodes.start),
        }
    }

    /// See [`super::Loops::rounds`].
    pub fn rounds(&self) -> u64 {
        match &self.method {
            Method::AtPoint { all, inner } => all.iter().chain(inner).map(rounds).sum(),
            Method::OverStep(over) => over.rounds(),
        }
    }
}

fn rounds(transfer: &Transfer) -> u64 {
    match transfer {
        Transfer::Loop(algebraic) => algebraic.rounds(),
        _ => 0,
    }
}

fn run(transfers: &mut [Transfer], nodes: &mut [Node], values: &mut Values, time: f64) -> Result<(), Stop> {
    for transfer in transfers {
        if let Transfer::Loop(algebraic) = transfer {
            // What a step begins with is the best guess for its end, and its end for the next.
            algebraic.forget();
        }
        transfer.run(nodes, values).map_err(|failure| Stop::of_loop(failure, time))?;
    }
    Ok(())
}
