//! A point of the run to which all slaves and the master can return.

use crate::master::{Master, Values};
use airloop_fmi::{Error, StateHandle};

/// See the module. What is saved again uses the memory of the last time.
#[derive(Debug)]
pub(super) struct Memory {
    states: Vec<Option<StateHandle>>,
    values: Values,
    /// Values that the master carries from step to step.
    carried: Vec<f64>,
}

impl Memory {
    /// Nothing is saved yet.
    pub fn new(master: &Master) -> Memory {
        let states = master.nodes.iter().map(|_| None).collect();
        Memory { states, values: master.values.clone(), carried: Vec::new() }
    }

    /// Saves the present point.
    pub fn save(&mut self, master: &mut Master) -> Result<(), Error> {
        for (node, state) in master.nodes.iter_mut().zip(&mut self.states) {
            node.slave().get_state(state)?;
        }
        self.values.copy_from(&master.values);
        self.carried.clear();
        let carried = &mut self.carried;
        master.scheme.carry(&mut |value| carried.push(*value));
        Ok(())
    }

    /// Returns to the saved point.
    pub fn restore(&self, master: &mut Master) -> Result<(), Error> {
        for (node, state) in master.nodes.iter_mut().zip(&self.states) {
            if let Some(state) = state {
                node.slave().set_state(state)?;
            }
        }
        master.values.copy_from(&self.values);
        let mut carried = self.carried.iter();
        master.scheme.carry(&mut |value| {
            if let Some(saved) = carried.next() {
                *value = *saved;
            }
        });
        Ok(())
    }
}
