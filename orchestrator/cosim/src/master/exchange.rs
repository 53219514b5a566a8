//! Values between slaves: flat buffers per type, and per slave one get and one set call per type.
//!
//! Layout of each buffer: the inputs of the system, then the outputs of the components in evaluation order. All
//! lists are made before the first step; a macro step only copies numbers.

use std::collections::{HashMap, HashSet};
use std::ops::{Deref, DerefMut, Range};

use super::{Algorithm, Error, Values};
use crate::results::{Column, Slot};
use crate::system::SystemGraph;
use crate::system::graph::{Conversion, DataType, Source, Start, SystemInput, unit_of};
use airloop_fmi::{Causality, Instance, Slave, StepStatus, VariableKind};

/// Position of every value in the flat buffers.
#[derive(Debug)]
pub(super) struct Wiring {
    /// Slot of each system input; `None` for String.
    pub inputs: Vec<Option<Slot>>,
    input_index: Vec<usize>,
    /// Buffer index of each output that is read, by (component, variable).
    outputs: HashMap<(usize, usize), usize>,
    /// Outputs of each component per type: variables and range in the buffer.
    component_outputs: Vec<[(Vec<usize>, Range<usize>); 4]>,
    component_inputs: Vec<[Vec<(usize, usize, Conversion)>; 4]>,
    /// Number of values per type.
    width: [usize; 4],
}

/// Slot of a value of some type in the flat buffers; `None` for String.
pub(super) fn slot(data_type: DataType, index: usize) -> Option<Slot> {
    match data_type {
        DataType::Real => Some(Slot::Real(index)),
        DataType::Integer | DataType::Enumeration => Some(Slot::Integer(index)),
        DataType::Boolean => Some(Slot::Boolean(index)),
        DataType::String => None,
    }
}

/// Position of a type in per-type arrays.
fn group(data_type: DataType) -> usize {
    match data_type {
        DataType::Real => 0,
        DataType::Integer | DataType::Enumeration => 1,
        DataType::Boolean => 2,
        DataType::String => 3,
    }
}

impl Wiring {
    pub fn new(graph: &SystemGraph, all_outputs: bool) -> Wiring {
        let mut width = [0; 4];
        let mut next = |data_type: DataType| {
            let position = &mut width[group(data_type)];
            *position += 1;
            *position - 1
        };
        let input_index: Vec<usize> = graph.inputs.iter().map(|input| next(input.data_type)).collect();
        let inputs = graph
            .inputs
            .iter()
            .zip(&input_index)
            .map(|(input, &index)| slot(input.data_type, index))
            .collect();
        let used: HashSet<Source> = graph
            .connections
            .iter()
            .map(|connection| connection.source)
            .chain(graph.outputs.iter().map(|output| output.source))
            .collect();
        let mut outputs = HashMap::new();
        let mut component_outputs: Vec<[(Vec<usize>, Range<usize>); 4]> =
            graph.components.iter().map(|_| Default::default()).collect();
        for &component in &graph.order {
            let groups = &mut component_outputs[component];
            groups.iter_mut().zip(width).for_each(|(group, start)| group.1 = start..start);
            let variables = &graph.components[component].fmu.description.variables;
            for (variable, description) in variables.iter().enumerate() {
                // A text costs an allocation per read, and no column can hold it.
                let recordable = all_outputs && DataType::of(description) != DataType::String;
                let wanted = description.causality == Causality::Output
                    && (recordable || used.contains(&Source::Output { component, variable }));
                if wanted {
                    let position = group(DataType::of(description));
                    groups[position].0.push(variable);
                    outputs.insert((component, variable), width[position]);
                    width[position] += 1;
                    groups[position].1.end = width[position];
                }
            }
        }
        let mut wiring = Wiring {
            inputs,
            input_index,
            outputs,
            component_outputs,
            component_inputs: graph.components.iter().map(|_| Default::default()).collect(),
            width,
        };
        for connection in &graph.connections {
            let variable =
                &graph.components[connection.component].fmu.description.variables[connection.variable];
            let from = wiring.index_of(connection.source);
            wiring.component_inputs[connection.component][group(DataType::of(variable))].push((
                connection.variable,
                from,
                connection.conversion,
            ));
        }
        wiring
    }

    /// Place of a value in the buffer of its type.
    pub fn index_of(&self, source: Source) -> usize {
        match source {
            Source::Input(input) => self.input_index[input],
            Source::Output { component, variable } => self.outputs[&(component, variable)],
        }
    }

    /// Buffers of the right size; system inputs have the start value of the first variable they feed.
    pub fn initial_values(&self, graph: &SystemGraph) -> Values {
        let mut values = Values {
            reals: vec![0.0; self.width[0]],
            integers: vec![0; self.width[1]],
            booleans: vec![false; self.width[2]],
            strings: vec![String::new(); self.width[3]],
        };
        for (input, &index) in self.input_index.iter().enumerate() {
            let source = Source::Input(input);
            let Some(connection) = graph.connections.iter().find(|connection| connection.source == source)
            else {
                continue;
            };
            let component = &graph.components[connection.component];
            let given = component.start_values.iter().find(|start| start.variable == connection.variable);
            match (
                given.map(|start| &start.value),
                &component.fmu.description.variables[connection.variable].kind,
            ) {
                (Some(Start::Real(start)), _) => {
                    values.reals[index] = connection.conversion.inverse().apply(*start)
                }
                (Some(Start::Integer(start)), _) => values.integers[index] = *start,
                (Some(Start::Boolean(start)), _) => values.booleans[index] = *start,
                (Some(Start::String(start)), _) => values.strings[index].clone_from(start),
                (None, VariableKind::Real(real)) => {
                    values.reals[index] = connection.conversion.inverse().apply(real.start.unwrap_or(0.0));
                }
                (None, VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. }) => {
                    values.integers[index] = start.unwrap_or(0);
                }
                (None, VariableKind::Boolean { start }) => values.booleans[index] = start.unwrap_or(false),
                (None, VariableKind::String { start }) => {
                    values.strings[index] = start.clone().unwrap_or_default();
                }
            }
        }
        values
    }

    /// A slave with the lists for its exchange.
    pub fn node(&self, slave: Slave, component: usize) -> Node {
        let reference = |variable: usize| slave.fmu().description.variables[variable].value_reference;
        let outputs = self.component_outputs[component].each_ref().map(|(variables, range)| Outputs {
            references: variables.iter().map(|&variable| reference(variable)).collect(),
            range: range.clone(),
        });
        let inputs = self.component_inputs[component].each_ref().map(|links| Inputs {
            place: place_of(links),
            references: links.iter().map(|&(variable, ..)| reference(variable)).collect(),
            sources: links.iter().map(|&(_, source, _)| source).collect(),
            conversions: links
                .iter()
                .enumerate()
                .filter(|(_, (.., conversion))| *conversion != Conversion::IDENTITY)
                .map(|(position, &(.., conversion))| (position, conversion))
                .collect(),
        });
        let others =
            (1..4).any(|group| !inputs[group].references.is_empty() || !outputs[group].references.is_empty());
        let [real_in, integer_in, boolean_in, string_in] = inputs;
        let [real_out, integer_out, boolean_out, string_out] = outputs;
        Node {
            real_buffer: vec![0.0; real_in.references.len()],
            integer_buffer: vec![0; integer_in.references.len()],
            boolean_buffer: vec![false; boolean_in.references.len()],
            slave,
            no_set_state_prior: true,
            real_in,
            real_out,
            others: others.then(|| {
                Box::new(Others { integer_in, integer_out, boolean_in, boolean_out, string_in, string_out })
            }),
        }
    }

    /// See [`super::Master::columns`].
    pub fn columns(&self, graph: &SystemGraph, algorithm: Algorithm) -> Vec<Column> {
        let mut columns = Vec::new();
        for (input, slot) in graph.inputs.iter().zip(&self.inputs) {
            let Some(slot) = *slot else { continue };
            let SystemInput { name, unit, .. } = input.clone();
            columns.push(Column { name, unit, slot, factor: 1.0, offset: 0.0, held: false });
        }
        for output in &graph.outputs {
            let Some(slot) = slot(output.data_type, self.index_of(output.source)) else { continue };
            let held = match output.source {
                Source::Input(_) => false,
                Source::Output { component, variable } => {
                    algorithm.stands_at_start(graph, component, variable)
                }
            };
            let Conversion { factor, offset } = output.conversion;
            columns.push(Column {
                name: output.name.clone(),
                unit: output.unit.clone(),
                slot,
                factor,
                offset,
                held,
            });
        }
        if graph.single {
            return columns;
        }
        for &index in &graph.order {
            let component = &graph.components[index];
            for variable in self.outputs_of(index) {
                let description = &component.fmu.description.variables[variable];
                let Some(slot) = slot(DataType::of(description), self.outputs[&(index, variable)]) else {
                    continue;
                };
                columns.push(Column {
                    name: component.path_of(variable),
                    unit: unit_of(description).map(str::to_owned),
                    slot,
                    factor: 1.0,
                    offset: 0.0,
                    held: algorithm.stands_at_start(graph, index, variable),
                });
            }
        }
        columns
    }

    /// All outputs that are read, as (component, variable), in ascending order.
    pub fn read_outputs(&self) -> Vec<(usize, usize)> {
        let mut outputs: Vec<(usize, usize)> = self.outputs.keys().copied().collect();
        outputs.sort_unstable();
        outputs
    }

    /// Outputs of a component that are read, in the order of the FMU.
    fn outputs_of(&self, component: usize) -> Vec<usize> {
        let mut variables: Vec<usize> =
            self.component_outputs[component].iter().flat_map(|(variables, _)| variables.clone()).collect();
        variables.sort_unstable();
        variables
    }

    /// Name of a value.
    pub fn name_of(&self, slot: Option<Slot>, graph: &SystemGraph) -> String {
        let matches = |component: usize, variable: usize, index: usize| {
            let data_type = DataType::of(&graph.components[component].fmu.description.variables[variable]);
            self::slot(data_type, index) == slot
        };
        let found = self
            .outputs
            .iter()
            .find(|((component, variable), index)| matches(*component, *variable, **index));
        found.map_or_else(
            || "a text".into(),
            |((component, variable), _)| graph.components[*component].path_of(*variable),
        )
    }
}

/// Place of the sources, if they stand one after the other and none is converted.
fn place_of(links: &[(usize, usize, Conversion)]) -> Option<Range<usize>> {
    let &(_, first, _) = links.first()?;
    let in_place = |(position, &(_, source, conversion)): (usize, &(usize, usize, Conversion))| {
        source == first + position && conversion == Conversion::IDENTITY
    };
    links.iter().enumerate().all(in_place).then(|| first..first + links.len())
}

/// Inputs of one type.
#[derive(Debug)]
struct Inputs {
    references: Vec<u32>,
    /// Index of the value of each input in the flat buffer.
    sources: Vec<usize>,
    /// Inputs (by position) whose value is converted; Real only.
    conversions: Vec<(usize, Conversion)>,
    /// Place of all sources in the flat buffer, if they stand there one after the other and none is converted: then
    /// nothing has to be copied.
    place: Option<Range<usize>>,
}

/// Outputs of one type.
#[derive(Debug)]
struct Outputs {
    references: Vec<u32>,
    /// Their place in the flat buffer.
    range: Range<usize>,
}

/// Exchange of the types that most slaves do not have.
#[derive(Debug)]
struct Others {
    integer_in: Inputs,
    integer_out: Outputs,
    boolean_in: Inputs,
    boolean_out: Outputs,
    string_in: Inputs,
    string_out: Outputs,
}

/// A slave with its place in the flat buffers.
#[derive(Debug)]
pub(super) struct Node {
    slave: Slave,
    /// Promise to the slave in every step that no state before it will be restored.
    no_set_state_prior: bool,
    real_in: Inputs,
    real_out: Outputs,
    real_buffer: Vec<f64>,
    integer_buffer: Vec<i64>,
    boolean_buffer: Vec<bool>,
    others: Option<Box<Others>>,
}

impl Deref for Node {
    type Target = Instance;

    fn deref(&self) -> &Instance {
        &self.slave
    }
}

impl DerefMut for Node {
    fn deref_mut(&mut self) -> &mut Instance {
        &mut self.slave
    }
}

impl Node {
    pub fn name(&self) -> &str {
        self.slave.name()
    }

    /// Announces in all later steps that a state before them may be restored.
    pub fn keep_states(&mut self) {
        self.no_set_state_prior = false;
    }

    /// Steps from `t` to `t + h` \[s\]; `keep`: the state before may be restored.
    pub fn step_keeping(&mut self, t: f64, h: f64, keep: bool) -> Result<StepStatus, airloop_fmi::Error> {
        self.slave.do_step(t, h, self.no_set_state_prior && !keep)
    }

    pub fn exit_initialization_mode(&mut self) -> Result<(), airloop_fmi::Error> {
        self.slave.exit_initialization_mode()
    }

    /// Sets all connected inputs to the values of their sources.
    #[inline(always)]
    pub fn set_inputs(&mut self, values: &Values) -> Result<(), airloop_fmi::Error> {
        if let Some(place) = &self.real_in.place {
            self.slave.set_real(&self.real_in.references, &values.reals[place.clone()])?;
        } else if !self.real_buffer.is_empty() {
            for (value, &source) in self.real_buffer.iter_mut().zip(&self.real_in.sources) {
                *value = values.reals[source];
            }
            for &(position, conversion) in &self.real_in.conversions {
                self.real_buffer[position] = conversion.apply(self.real_buffer[position]);
            }
            self.slave.set_real(&self.real_in.references, &self.real_buffer)?;
        }
        if self.others.is_some() { self.set_others(values) } else { Ok(()) }
    }

    /// Sets connected inputs other than Reals.
    pub fn set_non_reals(&mut self, values: &Values) -> Result<(), airloop_fmi::Error> {
        if self.others.is_some() { self.set_others(values) } else { Ok(()) }
    }

    /// The slave itself.
    #[inline(always)]
    pub fn slave(&mut self) -> &mut Slave {
        &mut self.slave
    }

    #[inline(never)]
    fn set_others(&mut self, values: &Values) -> Result<(), airloop_fmi::Error> {
        let Some(others) = &self.others else { return Ok(()) };
        let (integers, booleans, strings) = (&others.integer_in, &others.boolean_in, &others.string_in);
        if !integers.references.is_empty() {
            for (value, &source) in self.integer_buffer.iter_mut().zip(&integers.sources) {
                *value = values.integers[source];
            }
            self.slave.set_integer(&integers.references, &self.integer_buffer)?;
        }
        if !booleans.references.is_empty() {
            for (value, &source) in self.boolean_buffer.iter_mut().zip(&booleans.sources) {
                *value = values.booleans[source];
            }
            self.slave.set_boolean(&booleans.references, &self.boolean_buffer)?;
        }
        if !strings.references.is_empty() {
            let texts: Vec<&str> =
                strings.sources.iter().map(|&source| values.strings[source].as_str()).collect();
            self.slave.set_string(&strings.references, &texts)?;
        }
        Ok(())
    }

    /// Steps from `t` to `t + h` \[s\].
    #[inline(always)]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<StepStatus, airloop_fmi::Error> {
        self.slave.do_step(t, h, self.no_set_state_prior)
    }

    /// Reads all outputs into their places.
    #[inline(always)]
    pub fn get_outputs(&mut self, values: &mut Values) -> Result<(), airloop_fmi::Error> {
        if !self.real_out.references.is_empty() {
            let place = &mut values.reals[self.real_out.range.clone()];
            self.slave.get_real(&self.real_out.references, place)?;
        }
        if self.others.is_some() { self.get_others(values) } else { Ok(()) }
    }

    #[inline(never)]
    fn get_others(&mut self, values: &mut Values) -> Result<(), airloop_fmi::Error> {
        let Some(others) = &self.others else { return Ok(()) };
        let (integers, booleans, strings) = (&others.integer_out, &others.boolean_out, &others.string_out);
        if !integers.references.is_empty() {
            self.slave.get_integer(&integers.references, &mut values.integers[integers.range.clone()])?;
        }
        if !booleans.references.is_empty() {
            self.slave.get_boolean(&booleans.references, &mut values.booleans[booleans.range.clone()])?;
        }
        if !strings.references.is_empty() {
            let texts = self.slave.get_string(&strings.references)?;
            for (place, text) in values.strings[strings.range.clone()].iter_mut().zip(texts) {
                *place = text;
            }
        }
        Ok(())
    }

    /// Whether all Real outputs are finite.
    #[inline(always)]
    pub fn outputs_are_finite(&self, values: &Values) -> bool {
        values.reals[self.real_out.range.clone()].iter().all(|value| value.is_finite())
    }

    /// The error that names the first output that is not finite.
    pub fn not_finite(&self, values: &Values, time: f64) -> Error {
        let outputs = &values.reals[self.real_out.range.clone()];
        let position = outputs.iter().position(|value| !value.is_finite()).unwrap_or(0);
        let reference = self.real_out.references[position];
        Error::NotFinite {
            component: self.name().to_owned(),
            variable: self.output_name(reference),
            value: outputs[position],
            time,
        }
    }

    /// Name of the Real output with this value reference.
    pub fn output_name(&self, reference: u32) -> String {
        let variable = self.slave.fmu().description.variables.iter().find(|variable| {
            variable.causality == Causality::Output
                && variable.value_reference == reference
                && DataType::of(variable) == DataType::Real
        });
        variable.map_or_else(String::new, |variable| variable.name.clone())
    }

    /// C names of the step and of its answer that it stopped on the way.
    pub fn discard_names(&self) -> (&'static str, &'static str) {
        match self.slave.fmu().description.is_fmi3() {
            true => ("fmi3DoStep", "fmi3Discard"),
            false => ("fmi2DoStep", "fmi2Discard"),
        }
    }

    /// The last messages of the FMU as an appendix of an error message.
    pub fn log_tail(&self) -> String {
        self.slave.log().iter().rev().take(5).rev().map(|message| format!("\n  FMU log: {message}")).collect()
    }
}
