//! An FMU as the interface-Jacobian master sees it: connected Real inputs and outputs, and one step under a straight
//! line of its inputs.

use std::ops::Range;

use super::signal::Signal;
use crate::master::Values;
use crate::master::exchange::Node;
use crate::master::stop::{Stop, is_at_end};
use crate::system::graph::Conversion;
use airloop_fmi::{Error, StateHandle, StepStatus};

/// Outputs of all units that feed something, one after the other.
#[derive(Debug, Default)]
pub(in crate::master) struct Outputs {
    /// Value at the last time the unit reached.
    pub y: Vec<f64>,
    /// Its time derivative there.
    pub rate: Vec<f64>,
    /// Value at the beginning of the communication step.
    pub begin: Vec<f64>,
    /// Trajectory over the communication step, from the moment the unit has stepped.
    pub signals: Vec<Signal>,
    /// Trajectories of system inputs over the communication step, by place in the flat buffer; the others are held.
    pub trajectories: Vec<(usize, Signal)>,
}

impl Outputs {
    /// Shows every number that is carried from step to step, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        self.y.iter_mut().chain(&mut self.rate).chain(&mut self.begin).for_each(each);
    }

    fn trajectory(&self, place: usize) -> Option<&Signal> {
        self.trajectories.iter().find(|(input, _)| *input == place).map(|(_, trajectory)| trajectory)
    }
}

/// Source of the value of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::master) enum Feed {
    /// A system input (place in the flat buffer), by its trajectory over the step or held.
    System(usize),
    /// An output, by its trajectory over the step.
    Signal(usize),
    /// An output, at its value when the communication step begins.
    Begin(usize),
}

impl Feed {
    /// Value at r; where a signal jumps, the value before (`right`: after) the jump.
    pub fn at(self, outputs: &Outputs, values: &Values, r: f64, right: bool) -> f64 {
        match self {
            Feed::System(place) => match outputs.trajectory(place) {
                Some(trajectory) if right => trajectory.right(r),
                Some(trajectory) => trajectory.left(r),
                None => values.reals[place],
            },
            Feed::Begin(output) => outputs.begin[output],
            Feed::Signal(output) if right => outputs.signals[output].right(r),
            Feed::Signal(output) => outputs.signals[output].left(r),
        }
    }

    /// Moments between two times.
    pub fn moments(self, outputs: &Outputs, values: &Values, begin: f64, end: f64) -> [f64; 2] {
        match self {
            Feed::Signal(output) => outputs.signals[output].moments(begin, end),
            Feed::System(place) if !outputs.trajectories.is_empty() => match outputs.trajectory(place) {
                Some(trajectory) => trajectory.moments(begin, end),
                None => [values.reals[place], 0.0],
            },
            _ => [self.at(outputs, values, begin, true), 0.0],
        }
    }
}

/// A connected Real input.
#[derive(Debug, Clone, Copy)]
pub(in crate::master) struct Input {
    pub feed: Feed,
    pub conversion: Conversion,
    /// Position of the variable in the model description.
    pub variable: usize,
    pub nominal: f64,
}

/// A unit; its number is that of its node in evaluation order.
#[derive(Debug)]
pub(in crate::master) struct Unit {
    pub number: usize,
    pub inputs: Vec<Input>,
    pub input_references: Vec<u32>,
    /// Places in [`Outputs`].
    pub outputs: Range<usize>,
    pub output_references: Vec<u32>,
    pub output_nominals: Vec<f64>,
    pub discrete: Vec<bool>,
    /// Outputs depend on the present inputs and parameters only.
    pub is_static: bool,
    /// Sample time \[s\] of discrete outputs, where known.
    pub sample: Option<f64>,
    /// Steps must not differ in length.
    pub fixed_step: bool,
    /// Inputs can be given slopes.
    pub ramps: bool,
    /// Outputs have derivatives.
    pub rates: bool,
    /// State can be saved and restored.
    pub rollback: bool,
    /// Inputs at the end of the last step.
    pub u: Vec<f64>,
    /// Inputs at the beginning of the next step, and their slopes in it \[1/s\].
    pub value: Vec<f64>,
    pub slope: Vec<f64>,
    /// First derivative, for each input and for each output.
    pub orders: Vec<i32>,
    /// Outputs and their derivatives before the present step.
    pub before: Vec<[f64; 2]>,
    pub saved: Option<StateHandle>,
    /// It asked for the end of the simulation where its last step ended.
    pub ended: bool,
    pub steps: u64,
}

impl Unit {
    /// Steps from `t` to `t + h` \[s\] with the inputs in `value` and `slope`.
    pub fn advance(&mut self, node: &mut Node, t: f64, h: f64, keep: bool) -> Result<(), Stop> {
        let count = self.inputs.len();
        if count > 0 {
            node.slave().set_real(&self.input_references, &self.value)?;
            if self.ramps {
                let orders = &self.orders[..count];
                node.slave().set_real_input_derivatives(&self.input_references, orders, &self.slope)?;
            }
        }
        if self.ended {
            // Where a piece of the communication step began.
            return Err(Stop::Incomplete {
                node: self.number,
                last_successful_time: Some(t),
                terminated: true,
            });
        }
        let status = node.step_keeping(t, h, keep)?;
        self.steps += 1;
        if let StepStatus::Discarded { last_successful_time, terminated } = status {
            self.ended = terminated && is_at_end(last_successful_time, t + h);
            if !self.ended {
                return Err(Stop::Incomplete { node: self.number, last_successful_time, terminated });
            }
        }
        for k in 0..count {
            self.u[k] = self.value[k] + if self.ramps { h * self.slope[k] } else { 0.0 };
        }
        Ok(())
    }

    /// Reads the outputs, and their derivatives where there are any.
    pub fn read(&self, node: &mut Node, y: &mut [f64], rate: &mut [f64]) -> Result<(), Stop> {
        if self.outputs.is_empty() {
            return Ok(());
        }
        node.slave().get_real(&self.output_references, y)?;
        if y.iter().any(|value| !value.is_finite()) {
            return Err(Stop::NotFinite { node: self.number });
        }
        if self.rates {
            let orders = &self.orders[..self.outputs.len()];
            node.slave().get_real_output_derivatives(&self.output_references, orders, rate)?;
        }
        Ok(())
    }

    /// Saves the state, using again the memory of the last one.
    pub fn save(&mut self, node: &mut Node) -> Result<(), Error> {
        node.slave().get_state(&mut self.saved)
    }

    /// Restores the state of the last [`Unit::save`].
    pub fn restore(&mut self, node: &mut Node) -> Result<(), Error> {
        self.ended = false;
        match &self.saved {
            Some(state) => node.slave().set_state(state),
            None => Ok(()),
        }
    }
}
