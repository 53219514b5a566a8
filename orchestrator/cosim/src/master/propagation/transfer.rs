//! A stage of a schedule with all that it needs: references, places in the values, buffers.

use std::ops::DerefMut;

use super::algebraic::{AlgebraicLoop, LoopFailure, LoopInput, LoopOutput};
use super::schedule::{Node, Stage, sources};
use crate::master::Values;
use crate::master::exchange::Wiring;
use crate::system::SystemGraph;
use crate::system::graph::{Conversion, DataType, Source};
use airloop_fmi::{Causality, Error as FmuError, Instance, Variable, VariableKind};

/// A stage to be run.
#[derive(Debug)]
pub enum Transfer {
    /// Sets Reals.
    SetReal { instance: usize, references: Vec<u32>, sources: Vec<(usize, Conversion)>, buffer: Vec<f64> },
    /// Reads Reals.
    GetReal { instance: usize, references: Vec<u32>, places: Vec<usize>, buffer: Vec<f64> },
    /// Sets values of another type.
    Set { instance: usize, data_type: DataType, references: Vec<u32>, sources: Vec<usize> },
    /// Reads values of another type.
    Get { instance: usize, data_type: DataType, references: Vec<u32>, places: Vec<usize> },
    /// Solves a loop.
    Loop(AlgebraicLoop),
}

impl Transfer {
    pub fn new(graph: &SystemGraph, wiring: &Wiring, stage: &Stage) -> Transfer {
        let instance_of = |component: usize| {
            graph.order.iter().position(|&index| index == component).expect("the order holds every component")
        };
        let variable =
            |component: usize, index: usize| &graph.components[component].fmu.description.variables[index];
        let references = |component: usize, variables: &[usize]| -> Vec<u32> {
            variables.iter().map(|&index| variable(component, index).value_reference).collect()
        };
        let connections = sources(graph);
        match stage {
            Stage::Set { component, data_type, inputs } => {
                let source = |input: &usize| {
                    let connection = connections[&(*component, *input)];
                    (wiring.index_of(connection.source), connection.conversion)
                };
                let (instance, references) = (instance_of(*component), references(*component, inputs));
                let sources: Vec<(usize, Conversion)> = inputs.iter().map(source).collect();
                match data_type {
                    DataType::Real => {
                        Transfer::SetReal { instance, buffer: vec![0.0; sources.len()], references, sources }
                    }
                    &data_type => {
                        let sources = sources.into_iter().map(|(place, _)| place).collect();
                        Transfer::Set { instance, data_type, references, sources }
                    }
                }
            }
            Stage::Get { component, data_type, outputs } => {
                let place = |output: &usize| {
                    wiring.index_of(Source::Output { component: *component, variable: *output })
                };
                let (instance, references) = (instance_of(*component), references(*component, outputs));
                let places: Vec<usize> = outputs.iter().map(place).collect();
                match data_type {
                    DataType::Real => {
                        Transfer::GetReal { instance, buffer: vec![0.0; places.len()], references, places }
                    }
                    &data_type => Transfer::Get { instance, data_type, references, places },
                }
            }
            Stage::Loop(members) => {
                let is_output = |node: &Node| variable(node.0, node.1).causality == Causality::Output;
                let outputs: Vec<Node> = members.iter().copied().filter(is_output).collect();
                let input = |&(component, index): &Node| {
                    let connection = connections[&(component, index)];
                    let source = outputs.iter().position(|&(component, variable)| {
                        connection.source == Source::Output { component, variable }
                    });
                    LoopInput {
                        instance: instance_of(component),
                        reference: variable(component, index).value_reference,
                        source: source.expect("an input in a loop has its source in the loop"),
                        conversion: connection.conversion,
                        nominal: nominal(variable(component, index)),
                        name: graph.components[component].path_of(index),
                    }
                };
                let output = |&(component, index): &Node| LoopOutput {
                    instance: instance_of(component),
                    reference: variable(component, index).value_reference,
                    place: wiring.index_of(Source::Output { component, variable: index }),
                };
                let inputs = members.iter().filter(|node| !is_output(node)).map(input).collect();
                Transfer::Loop(AlgebraicLoop::new(inputs, outputs.iter().map(output).collect()))
            }
        }
    }

    /// Runs the stage.
    pub fn run<I: DerefMut<Target = Instance>>(
        &mut self,
        instances: &mut [I],
        values: &mut Values,
    ) -> Result<(), LoopFailure> {
        match self {
            Transfer::SetReal { instance, references, sources, buffer } => {
                for (value, (place, conversion)) in buffer.iter_mut().zip(sources) {
                    let source = values.reals[*place];
                    *value =
                        if *conversion == Conversion::IDENTITY { source } else { conversion.apply(source) };
                }
                instances[*instance].set_real(references, buffer)?;
            }
            Transfer::Set { instance, data_type, references, sources } => {
                set_other(&mut instances[*instance], *data_type, references, sources, values)?;
            }
            Transfer::Loop(algebraic) => algebraic.solve(instances, &mut values.reals)?,
            Transfer::GetReal { .. } | Transfer::Get { .. } => self.read(instances, values)?,
        }
        Ok(())
    }

    /// Only reads: outputs, also those in a loop as they are.
    pub fn read<I: DerefMut<Target = Instance>>(
        &mut self,
        instances: &mut [I],
        values: &mut Values,
    ) -> Result<(), FmuError> {
        match self {
            Transfer::GetReal { instance, references, places, buffer } => {
                instances[*instance].get_real(references, buffer)?;
                places.iter().zip(buffer).for_each(|(place, value)| values.reals[*place] = *value);
                Ok(())
            }
            Transfer::Get { instance, data_type, references, places } => {
                get_other(&mut instances[*instance], *data_type, references, places, values)
            }
            Transfer::Loop(algebraic) => algebraic.read(instances, &mut values.reals),
            Transfer::SetReal { .. } | Transfer::Set { .. } => Ok(()),
        }
    }
}

/// Typical magnitude of a variable; 1 where none is declared.
pub fn nominal(variable: &Variable) -> f64 {
    match &variable.kind {
        VariableKind::Real(real) => real.nominal.map_or(1.0, f64::abs).max(f64::MIN_POSITIVE),
        _ => 1.0,
    }
}

fn set_other(
    instance: &mut Instance,
    data_type: DataType,
    references: &[u32],
    sources: &[usize],
    values: &Values,
) -> Result<(), FmuError> {
    match data_type {
        DataType::Integer | DataType::Enumeration => {
            let new: Vec<i64> = sources.iter().map(|&place| values.integers[place]).collect();
            instance.set_integer(references, &new)
        }
        DataType::Boolean => {
            let new: Vec<bool> = sources.iter().map(|&place| values.booleans[place]).collect();
            instance.set_boolean(references, &new)
        }
        DataType::String => {
            let new: Vec<&str> = sources.iter().map(|&place| values.strings[place].as_str()).collect();
            instance.set_string(references, &new)
        }
        DataType::Real => unreachable!("Reals have a transfer of their own"),
    }
}

fn get_other(
    instance: &mut Instance,
    data_type: DataType,
    references: &[u32],
    places: &[usize],
    values: &mut Values,
) -> Result<(), FmuError> {
    match data_type {
        DataType::Integer | DataType::Enumeration => {
            let mut read = vec![0; places.len()];
            instance.get_integer(references, &mut read)?;
            places.iter().zip(read).for_each(|(&place, value)| values.integers[place] = value);
        }
        DataType::Boolean => {
            let mut read = vec![false; places.len()];
            instance.get_boolean(references, &mut read)?;
            places.iter().zip(read).for_each(|(&place, value)| values.booleans[place] = value);
        }
        DataType::String => {
            let read = instance.get_string(references)?;
            places.iter().zip(read).for_each(|(&place, value)| values.strings[place] = value);
        }
        DataType::Real => unreachable!("Reals have a transfer of their own"),
    }
    Ok(())
}
