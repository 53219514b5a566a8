//! A system whose steps somebody else commands: slaves under a co-simulation master as one slave.
//!
//! Used where a whole system is one FMU. Steps, inputs and values are those of a run with the same settings, bit for
//! bit; the state can be saved as bytes. The same for Model Exchange is [`super::monolithic::Models`].

use super::exchange::slot;
use super::{Error, Master, Progress, Settings, Values};
use crate::results::Slot;
use crate::system::SystemGraph;
use crate::system::graph::{Conversion, DataType, Source};
use airloop_fmi::Instance;

/// A value that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Input of the system.
    Input(usize),
    /// Output of the system.
    Output(usize),
    /// Any variable of a component.
    Variable {
        /// Index of the component.
        component: usize,
        /// 0-based index into the FMU's variables.
        variable: usize,
    },
}

/// A value as it was read.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Real.
    Real(f64),
    /// Integer or Enumeration.
    Integer(i64),
    /// Boolean.
    Boolean(bool),
    /// String.
    String(String),
}

/// A place that was looked up in one instance of [`Slaves`]; it serves all instances of the same system.
#[derive(Debug, Clone, Copy)]
pub struct Reader(At);

#[derive(Debug, Clone, Copy)]
enum At {
    /// In the buffers of the master; without a slot it is a text.
    Exchanged { slot: Option<Slot>, index: usize, conversion: Conversion },
    /// Asked of the component at this position of the evaluation order.
    Asked { node: usize, variable: usize },
}

/// Slaves at a communication point.
#[derive(Debug)]
pub struct Slaves {
    master: Master,
    /// Position of each component in evaluation order.
    positions: Vec<usize>,
}

impl Slaves {
    /// Instantiates and initializes all components; see [`Master::new`].
    ///
    /// # Errors
    /// Same as [`Master::new`].
    pub fn new(graph: &SystemGraph, settings: &Settings, inputs: &[(usize, f64)]) -> Result<Slaves, Error> {
        let mut master = Master::new(graph, settings, inputs)?;
        // Whoever commands the steps may return to an earlier one.
        master.nodes.iter_mut().for_each(super::exchange::Node::keep_states);
        Ok(Slaves { master, positions: positions(graph) })
    }

    /// Sets a system input; see [`Master::set_input`].
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.master.set_input(input, value);
    }

    /// One macro step from `t` to `t + h` \[s\].
    ///
    /// # Errors
    /// Same as [`Master::step`].
    pub fn step(&mut self, t: f64, h: f64) -> Result<Progress, Error> {
        match self.master.advance(t, h) {
            Ok(()) => Ok(Progress::Stepped),
            Err(stop) => {
                let (component, last_successful_time) = self.master.explain(stop, (t, h), t + h)?;
                Ok(Progress::Terminated { component, last_successful_time })
            }
        }
    }

    /// Looks a place up, for [`Slaves::read_by`] in every step.
    pub fn reader(&self, graph: &SystemGraph, place: Place) -> Reader {
        match source_of(graph, place) {
            Ok((source, data_type, conversion)) => {
                let index = self.master.wiring.index_of(source);
                Reader(At::Exchanged { slot: slot(data_type, index), index, conversion })
            }
            Err((component, variable)) => Reader(At::Asked { node: self.positions[component], variable }),
        }
    }

    /// A value at the present communication point.
    ///
    /// # Errors
    /// The FMU refuses.
    #[inline]
    pub fn read_by(&mut self, reader: Reader) -> Result<Value, Error> {
        match reader.0 {
            At::Exchanged { slot, index, conversion } => {
                Ok(exchanged_value(&self.master.values, slot, index, conversion))
            }
            At::Asked { node, variable } => read_variable(&mut self.master.nodes[node], variable),
        }
    }

    /// Same as [`Slaves::read_by`], for a value that is asked for once.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn read(&mut self, graph: &SystemGraph, place: Place) -> Result<Value, Error> {
        self.read_by(self.reader(graph, place))
    }

    /// The state of all slaves and of the master as bytes.
    ///
    /// # Errors
    /// An FMU cannot save or serialize its state.
    pub fn save(&mut self) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::new();
        put_values(&mut bytes, &self.master.values);
        let mut carried = Vec::new();
        self.master.carry(&mut |value| carried.push(*value));
        put_reals(&mut bytes, &carried);
        for node in &mut self.master.nodes {
            put_instance(&mut bytes, node)?;
        }
        Ok(bytes)
    }

    /// Returns to a saved state; `false` for bytes that are not those of [`Slaves::save`] of the same system.
    ///
    /// # Errors
    /// An FMU refuses its state.
    pub fn restore(&mut self, mut bytes: &[u8]) -> Result<bool, Error> {
        let Some(values) = take_values(&mut bytes, &self.master.values) else { return Ok(false) };
        let Some(carried) = take_reals(&mut bytes) else { return Ok(false) };
        for node in &mut self.master.nodes {
            if !take_instance(&mut bytes, node)? {
                return Ok(false);
            }
        }
        self.master.values = values;
        let mut carried = carried.into_iter();
        self.master.carry(&mut |value| *value = carried.next().unwrap_or(*value));
        Ok(true)
    }
}

/// Position of each component in evaluation order.
pub(super) fn positions(graph: &SystemGraph) -> Vec<usize> {
    let mut positions = vec![0; graph.components.len()];
    graph.order.iter().enumerate().for_each(|(position, &component)| positions[component] = position);
    positions
}

/// An exchanged value with its type and, for an output of the system, its number; or a variable of a component.
type Exchanged = (Source, DataType, Conversion);

/// Where a value stands in the buffers, or (component, variable) if it has to be asked for.
pub(super) fn source_of(graph: &SystemGraph, place: Place) -> Result<Exchanged, (usize, usize)> {
    match place {
        Place::Input(input) => {
            Ok((Source::Input(input), graph.inputs[input].data_type, Conversion::IDENTITY))
        }
        Place::Output(output) => {
            let output = &graph.outputs[output];
            let data_type = match output.source {
                Source::Input(input) => graph.inputs[input].data_type,
                Source::Output { component, variable } => {
                    DataType::of(&graph.components[component].fmu.description.variables[variable])
                }
            };
            Ok((output.source, data_type, output.conversion))
        }
        Place::Variable { component, variable } => Err((component, variable)),
    }
}

/// A value out of the buffers; without a slot it is a text.
#[inline]
pub(super) fn exchanged_value(
    values: &Values,
    slot: Option<Slot>,
    index: usize,
    conversion: Conversion,
) -> Value {
    match slot {
        Some(Slot::Real(index)) => Value::Real(conversion.apply(values.reals[index])),
        Some(Slot::Integer(index)) => Value::Integer(values.integers[index]),
        Some(Slot::Boolean(index)) => Value::Boolean(values.booleans[index]),
        None => Value::String(values.strings[index].clone()),
    }
}

/// A variable, read from the instance.
pub(super) fn read_variable(instance: &mut Instance, variable: usize) -> Result<Value, Error> {
    let description = &instance.fmu().description.variables[variable];
    let (reference, data_type) = ([description.value_reference], DataType::of(description));
    Ok(match data_type {
        DataType::Real => {
            let mut value = [0.0];
            instance.get_real(&reference, &mut value)?;
            Value::Real(value[0])
        }
        DataType::Integer | DataType::Enumeration => {
            let mut value = [0];
            instance.get_integer(&reference, &mut value)?;
            Value::Integer(value[0])
        }
        DataType::Boolean => {
            let mut value = [false];
            instance.get_boolean(&reference, &mut value)?;
            Value::Boolean(value[0])
        }
        DataType::String => Value::String(instance.get_string(&reference)?.remove(0)),
    })
}

pub(super) fn put_bytes(bytes: &mut Vec<u8>, more: &[u8]) {
    bytes.extend_from_slice(&(more.len() as u64).to_le_bytes());
    bytes.extend_from_slice(more);
}

pub(super) fn take_bytes<'a>(bytes: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (taken, rest) = rest.split_at_checked(length)?;
    *bytes = rest;
    Some(taken)
}

pub(super) fn put_reals(bytes: &mut Vec<u8>, reals: &[f64]) {
    let text: Vec<u8> = reals.iter().flat_map(|value| value.to_le_bytes()).collect();
    put_bytes(bytes, &text);
}

pub(super) fn take_reals(bytes: &mut &[u8]) -> Option<Vec<f64>> {
    let taken = take_bytes(bytes)?;
    let real = |chunk: &[u8]| chunk.try_into().map(f64::from_le_bytes).ok();
    taken.chunks(8).map(real).collect()
}

pub(super) fn put_values(bytes: &mut Vec<u8>, values: &Values) {
    put_reals(bytes, &values.reals);
    put_bytes(bytes, &values.integers.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>());
    put_bytes(bytes, &values.booleans.iter().map(|&value| u8::from(value)).collect::<Vec<u8>>());
    values.strings.iter().for_each(|text| put_bytes(bytes, text.as_bytes()));
}

/// Values of the same layout as `like`.
pub(super) fn take_values(bytes: &mut &[u8], like: &Values) -> Option<Values> {
    let reals = take_reals(bytes)?;
    let integer = |chunk: &[u8]| chunk.try_into().map(i64::from_le_bytes).ok();
    let integers: Vec<i64> = take_bytes(bytes)?.chunks(8).map(integer).collect::<Option<_>>()?;
    let booleans: Vec<bool> = take_bytes(bytes)?.iter().map(|&byte| byte != 0).collect();
    let text = |_| String::from_utf8(take_bytes(bytes)?.to_vec()).ok();
    let strings: Vec<String> = like.strings.iter().map(text).collect::<Option<_>>()?;
    let same = (reals.len(), integers.len(), booleans.len())
        == (like.reals.len(), like.integers.len(), like.booleans.len());
    same.then_some(Values { reals, integers, booleans, strings })
}

pub(super) fn put_instance(bytes: &mut Vec<u8>, instance: &mut Instance) -> Result<(), Error> {
    put_bytes(bytes, &state_of(instance)?);
    Ok(())
}

/// The state of an instance as bytes; none from an FMU that has no state to give.
pub(super) fn state_of(instance: &mut Instance) -> Result<Vec<u8>, Error> {
    let mut state = None;
    instance.get_state(&mut state)?;
    let Some(state) = state else { return Ok(Vec::new()) };
    let saved = instance.serialize_state(&state);
    let freed = instance.free_state(state);
    // The first of them is the cause of the other.
    let saved = saved?;
    freed?;
    Ok(saved)
}

/// Restores an instance; `false` if the bytes end before.
pub(super) fn take_instance(bytes: &mut &[u8], instance: &mut Instance) -> Result<bool, Error> {
    let Some(saved) = take_bytes(bytes) else { return Ok(false) };
    set_state_of(instance, saved)?;
    Ok(true)
}

/// Restores the state of [`state_of`].
pub(super) fn set_state_of(instance: &mut Instance, saved: &[u8]) -> Result<(), Error> {
    let state = instance.deserialize_state(saved)?;
    let outcome = instance.set_state(&state);
    let freed = instance.free_state(state);
    outcome?;
    Ok(freed?)
}
