//! The components as functions: arguments (states and driven inputs) to values (rates and outputs), and what drives
//! what.

use std::ops::Range;

use super::names::{self, Shown};
use super::{Error, Options};
use crate::system::SystemGraph;
use crate::system::graph::{Conversion, DataType, Source};
use airloop_fmi::{DependencyKind, Unknown, Variability, Variable, VariableKind};

/// Source of the value of an argument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Origin {
    /// A continuous state of the component itself, by position.
    State(usize),
    /// An input of the dynamics, by position.
    Input(usize, Conversion),
    /// A value of a component.
    Value(usize, Conversion),
}

/// An argument of a component.
#[derive(Debug, Clone)]
pub(super) struct Argument {
    /// Index of the variable in the description.
    pub variable: usize,
    pub reference: u32,
    /// Typical magnitude.
    pub nominal: f64,
    pub origin: Origin,
}

/// A value of a component.
#[derive(Debug, Clone)]
pub(super) struct Value {
    pub component: usize,
    pub variable: usize,
    pub reference: u32,
    pub nominal: f64,
    /// Position among the derivatives; `None` for an output.
    pub rate: Option<usize>,
    /// Whether the FMU differentiates it.
    pub exact: bool,
}

/// A component as a function.
#[derive(Debug, Clone, Default)]
pub(super) struct Block {
    /// Number of continuous states; they are the first arguments.
    pub states: usize,
    pub arguments: Vec<Argument>,
    /// Its values among all: rates, then outputs.
    pub values: Range<usize>,
}

/// All components as functions.
#[derive(Debug, Default)]
pub(super) struct Anatomy {
    /// In the order of the components.
    pub blocks: Vec<Block>,
    pub values: Vec<Value>,
    /// Place where the outputs of the dynamics stand.
    pub outputs: Vec<(Origin, Conversion)>,
    /// For [`Origin::State`] among the outputs: the component.
    pub owners: Vec<usize>,
    /// Inputs that are held although they are connected, one sentence each.
    pub notes: Vec<String>,
}

/// Typical magnitude of a variable; 1 where none is declared.
pub(super) fn nominal(variable: &Variable) -> f64 {
    match &variable.kind {
        VariableKind::Real(real) => real.nominal.map_or(1.0, f64::abs).max(f64::MIN_POSITIVE),
        _ => 1.0,
    }
}

impl Anatomy {
    /// Components of the graph, where `inputs` (positions in the graph) are those of the dynamics.
    pub fn new(graph: &SystemGraph, inputs: &[usize], options: &Options) -> Result<Anatomy, Error> {
        let mut anatomy = Anatomy::default();
        let shown = options.outputs.iter().map(|name| names::output(graph, name));
        let shown: Vec<Shown> = shown.collect::<Result<_, _>>()?;
        anatomy.collect_values(graph, &shown)?;
        anatomy.collect_arguments(graph, inputs)?;
        for (shown, name) in shown.iter().zip(&options.outputs) {
            anatomy.place(shown, name, inputs)?;
        }
        Ok(anatomy)
    }

    fn collect_values(&mut self, graph: &SystemGraph, shown: &[Shown]) -> Result<(), Error> {
        for (index, component) in graph.components.iter().enumerate() {
            let description = &component.fmu.description;
            let nameless = |unknown: &&Unknown| match &description.variables[unknown.variable].kind {
                VariableKind::Real(real) => real.derivative.is_none(),
                _ => true,
            };
            if let Some(unknown) = description.derivatives.iter().find(nameless) {
                let variable = description.variables[unknown.variable].name.clone();
                return Err(Error::Derivative { component: component.name.clone(), variable });
            }
            let interface = description.model_exchange.as_ref();
            let derivatives = interface.is_some_and(|interface| interface.provides_directional_derivative);
            let value = |variable: usize, rate: Option<usize>, exact: bool| Value {
                component: index,
                variable,
                reference: description.variables[variable].value_reference,
                nominal: nominal(&description.variables[variable]),
                rate,
                exact,
            };
            let first = self.values.len();
            let rates = description.derivatives.iter().enumerate();
            self.values.extend(rates.map(|(k, unknown)| value(unknown.variable, Some(k), derivatives)));
            for variable in 0..description.variables.len() {
                let source = Source::Output { component: index, variable };
                let connected = graph.connections.iter().any(|connection| {
                    connection.source == source
                        && is_continuous(graph, connection.component, connection.variable)
                });
                let asked =
                    |shown: &Shown| matches!(*shown, Shown::Value(c, v, _) if (c, v) == (index, variable));
                let is_rate = description.derivatives.iter().any(|unknown| unknown.variable == variable);
                if (connected || shown.iter().any(asked)) && !is_rate {
                    let listed = description.outputs.iter().any(|unknown| unknown.variable == variable);
                    self.values.push(value(variable, None, derivatives && listed));
                }
            }
            let states = description.derivatives.len();
            self.blocks.push(Block { states, arguments: Vec::new(), values: first..self.values.len() });
        }
        Ok(())
    }

    fn collect_arguments(&mut self, graph: &SystemGraph, inputs: &[usize]) -> Result<(), Error> {
        for (index, component) in graph.components.iter().enumerate() {
            let description = &component.fmu.description;
            let argument = |variable: usize, origin: Origin| Argument {
                variable,
                reference: description.variables[variable].value_reference,
                nominal: nominal(&description.variables[variable]),
                origin,
            };
            let states = description.continuous_states().enumerate();
            let mut arguments: Vec<Argument> =
                states.map(|(k, variable)| argument(variable, Origin::State(k))).collect();
            for connection in graph.connections.iter().filter(|connection| connection.component == index) {
                let (variable, conversion) = (connection.variable, connection.conversion);
                let continuous = is_continuous(graph, index, variable);
                match connection.source {
                    Source::Input(input) => {
                        let Some(position) = inputs.iter().position(|&chosen| chosen == input) else {
                            continue;
                        };
                        if !continuous {
                            let name = graph.inputs[input].name.clone();
                            return Err(Error::Input { name, variable: component.path_of(variable) });
                        }
                        arguments.push(argument(variable, Origin::Input(position, conversion)));
                    }
                    Source::Output { component: from, variable: output } if continuous => {
                        let value = self.output(from, output).expect("connected outputs are values");
                        arguments.push(argument(variable, Origin::Value(value, conversion)));
                    }
                    Source::Output { .. } => self.notes.push(format!(
                        "`{}` is not a continuous Real: it is held at the value that it has at the start",
                        component.path_of(variable)
                    )),
                }
            }
            self.blocks[index].arguments = arguments;
        }
        Ok(())
    }

    /// Position of an output among the values.
    fn output(&self, component: usize, variable: usize) -> Option<usize> {
        let mut range = self.blocks[component].values.clone();
        range.find(|&value| self.values[value].variable == variable)
    }

    fn place(&mut self, shown: &Shown, name: &str, inputs: &[usize]) -> Result<(), Error> {
        let refuse = |reason: &'static str| Error::Output { name: name.to_owned(), reason };
        let (owner, origin) = match *shown {
            Shown::Input(input, _) => {
                let held =
                    "shows an input that is held; choose it as an input of the problem, or leave it out";
                let position =
                    inputs.iter().position(|&chosen| chosen == input).ok_or_else(|| refuse(held))?;
                (0, Origin::Input(position, Conversion::IDENTITY))
            }
            Shown::State(component, state, _) => (component, Origin::State(state)),
            Shown::Driven(component, variable, _) => {
                let mut arguments = self.blocks[component].arguments.iter();
                let driven = arguments.find(|argument| argument.variable == variable);
                let held = "is an input that nothing drives: it keeps its start value";
                (component, driven.ok_or_else(|| refuse(held))?.origin)
            }
            Shown::Value(component, variable, _) => {
                let value = self.output(component, variable).expect("shown outputs are values");
                (component, Origin::Value(value, Conversion::IDENTITY))
            }
        };
        self.outputs.push((origin, shown.conversion()));
        self.owners.push(owner);
        Ok(())
    }

    /// Declared derivative of a value by an argument of the same component: `None` for zero,
    /// else whether it is constant.
    pub fn declared(&self, graph: &SystemGraph, value: usize, argument: &Argument) -> Option<bool> {
        let value = &self.values[value];
        let description = &graph.components[value.component].fmu.description;
        let listed: Option<&Unknown> = match value.rate {
            Some(k) => description.derivatives.get(k),
            None => description.outputs.iter().find(|unknown| unknown.variable == value.variable),
        };
        let Some(known) = listed.and_then(|unknown| unknown.dependencies.as_ref()) else {
            return Some(false);
        };
        let dependency = known.iter().find(|dependency| dependency.variable == argument.variable)?;
        // Between events, every kind but `dependent` is linear with one factor.
        Some(dependency.kind != DependencyKind::Dependent)
    }
}

/// Whether an input can be set between events.
fn is_continuous(graph: &SystemGraph, component: usize, variable: usize) -> bool {
    let variable = &graph.components[component].fmu.description.variables[variable];
    DataType::of(variable) == DataType::Real && variable.variability == Variability::Continuous
}
