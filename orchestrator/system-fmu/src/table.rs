//! The variables of a system FMU, in their order; the value reference is the position.
//!
//! Connectors of the system by their own names, then for each component as `component.variable`: parameters, outputs,
//! and the continuous states with their derivatives. Both the archive and the library derive the table from the system.

use crate::recipe::{Recipe, added_to};
use airloop_cosim::master::embedded::{Place, Value};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Conversion, DataType, Source, Start};
use airloop_fmi::{Causality, Initial, InterfaceKind, Variability, Variable as Inner, VariableKind};

/// Role of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    Parameter,
    Input,
    Output,
    Local,
    /// Continuous state of this number.
    State(usize),
    /// Derivative of the state of this number.
    Derivative(usize),
    /// Input that adds to the rate of the state of this number.
    Added(usize),
}

/// A variable.
#[derive(Debug, Clone)]
pub(crate) struct Variable {
    pub name: String,
    pub description: String,
    pub role: Role,
    pub variability: Variability,
    pub data_type: DataType,
    pub place: Place,
    /// Start value of what can be set before the start.
    pub start: Option<Value>,
    pub unit: Option<String>,
    pub min: Option<String>,
    pub max: Option<String>,
    pub nominal: Option<f64>,
    /// A state or a derivative that is an output.
    pub shown: bool,
}

/// All variables.
#[derive(Debug, Clone, Default)]
pub(crate) struct Table {
    pub variables: Vec<Variable>,
    /// Positions of the states, in the order of the vector of states.
    pub states: Vec<usize>,
    /// Positions of their derivatives.
    pub derivatives: Vec<usize>,
    pub indicators: usize,
}

impl Table {
    /// Of what the FMU is.
    pub fn with(graph: &SystemGraph, recipe: &Recipe) -> Table {
        match &recipe.nmpc {
            Some(nmpc) => crate::predictive::table(nmpc),
            None if recipe.rates.is_empty() => Table::of(graph),
            None => Table::with_rates(graph, &recipe.rates),
        }
    }

    /// Of the only component, with its own names and all that it shows, and with inputs that add to `rates`.
    fn with_rates(graph: &SystemGraph, rates: &[String]) -> Table {
        let mut table = Table::default();
        let inputs = (0..graph.inputs.len()).map(|index| input(graph, index));
        table.variables.extend(inputs);
        let Some(owner) = graph.components.first() else { return table };
        let description = &owner.fmu.description;
        let plain = |variable: usize, role: Role| {
            let name = description.variables[variable].name.clone();
            Variable { name, ..inner(graph, 0, variable, role) }
        };
        let states: Vec<usize> = description.continuous_states().collect();
        let derivatives: Vec<usize> = description.derivatives.iter().map(|own| own.variable).collect();
        for (variable, own) in description.variables.iter().enumerate() {
            let role = match own.causality {
                _ if states.contains(&variable) || derivatives.contains(&variable) => continue,
                Causality::Parameter => Role::Parameter,
                Causality::Output => Role::Output,
                Causality::Local => Role::Local,
                _ => continue,
            };
            let source = Source::Output { component: 0, variable };
            let mut own = plain(variable, role);
            if let Some(index) = graph.outputs.iter().position(|output| output.source == source) {
                own.place = Place::Output(index);
            }
            table.variables.push(own);
        }
        let shown = |variable: usize| description.variables[variable].causality == Causality::Output;
        for (number, (&state, &rate)) in states.iter().zip(&derivatives).enumerate() {
            table.states.push(table.variables.len());
            table.variables.push(Variable { shown: shown(state), ..plain(state, Role::State(number)) });
            table.derivatives.push(table.variables.len());
            // A velocity that is a state may be the derivative of a position as well.
            let is_state = states.contains(&rate);
            let mut rate =
                Variable { shown: !is_state && shown(rate), ..plain(rate, Role::Derivative(number)) };
            if is_state {
                rate.name = format!("der({})", description.variables[state].name);
            }
            let added = rates.contains(&rate.name).then(|| Variable {
                name: added_to(&rate.name),
                description: format!("added to {}", rate.name),
                role: Role::Added(number),
                variability: Variability::Continuous,
                start: Some(Value::Real(0.0)),
                shown: false,
                ..rate.clone()
            });
            table.variables.push(Variable { start: None, ..rate });
            table.variables.extend(added);
        }
        table.indicators = description.number_of_event_indicators;
        table
    }

    pub fn of(graph: &SystemGraph) -> Table {
        let mut table = Table::default();
        for index in 0..graph.inputs.len() {
            table.variables.push(input(graph, index));
        }
        for (index, output) in graph.outputs.iter().enumerate() {
            let mut variable = match output.source {
                Source::Input(from) => Variable { start: None, ..input(graph, from) },
                Source::Output { component, variable } => inner(graph, component, variable, Role::Output),
            };
            variable.name.clone_from(&output.name);
            variable.unit.clone_from(&output.unit);
            (variable.role, variable.start, variable.place) = (Role::Output, None, Place::Output(index));
            if output.conversion != Conversion::IDENTITY {
                (variable.min, variable.max, variable.nominal) = (None, None, None);
            }
            table.variables.push(variable);
        }
        let taken: Vec<String> = table.variables.iter().map(|variable| variable.name.clone()).collect();
        for (component, owner) in graph.components.iter().enumerate() {
            let states: Vec<usize> = match has_model_exchange(graph) {
                true => owner.fmu.description.continuous_states().collect(),
                false => Vec::new(),
            };
            for (variable, description) in owner.fmu.description.variables.iter().enumerate() {
                let role = match description.causality {
                    Causality::Parameter => Role::Parameter,
                    Causality::Output if !states.contains(&variable) => Role::Local,
                    _ => continue,
                };
                let own = inner(graph, component, variable, role);
                if !taken.contains(&own.name) {
                    table.variables.push(own);
                }
            }
        }
        if has_model_exchange(graph) {
            table.add_states(graph);
        }
        table
    }

    /// States and derivatives of all components, in evaluation order, as the vector of states has them.
    fn add_states(&mut self, graph: &SystemGraph) {
        for &component in &graph.order {
            let description = &graph.components[component].fmu.description;
            self.indicators += description.number_of_event_indicators;
            for unknown in &description.derivatives {
                let VariableKind::Real(real) = &description.variables[unknown.variable].kind else {
                    continue;
                };
                let Some(state) = real.derivative else { continue };
                let number = self.states.len();
                let own = inner(graph, component, state, Role::State(number));
                let name = format!("der({})", own.name);
                self.states.push(self.variables.len());
                self.variables.push(own);
                let rate = inner(graph, component, unknown.variable, Role::Derivative(number));
                self.derivatives.push(self.variables.len());
                self.variables.push(Variable { name, start: None, ..rate });
            }
        }
    }

    /// Variable of a value reference.
    pub fn get(&self, reference: u32) -> Option<&Variable> {
        self.variables.get(usize::try_from(reference).ok()?)
    }
}

/// Whether all components can be integrated from outside.
pub(crate) fn has_model_exchange(graph: &SystemGraph) -> bool {
    has(graph, InterfaceKind::ModelExchange)
}

/// Whether all components have an interface.
pub(crate) fn has(graph: &SystemGraph, kind: InterfaceKind) -> bool {
    graph.components.iter().all(|component| component.fmu.interface(kind).is_some())
}

fn input(graph: &SystemGraph, index: usize) -> Variable {
    let own = &graph.inputs[index];
    let fed = graph.connections.iter().find(|connection| connection.source == Source::Input(index));
    let held = graph.input_is_held(index);
    let (mut start, mut description) = (zero(own.data_type), String::new());
    if let Some(fed) = fed {
        let behind = inner(graph, fed.component, fed.variable, Role::Input);
        description = behind.description;
        start = match behind.start {
            Some(Value::Real(value)) => Value::Real(fed.conversion.inverse().apply(value)),
            Some(value) => value,
            None => start,
        };
    }
    Variable {
        name: own.name.clone(),
        description,
        role: Role::Input,
        variability: if held { Variability::Discrete } else { Variability::Continuous },
        data_type: numeric(own.data_type),
        place: Place::Input(index),
        start: Some(start),
        unit: own.unit.clone(),
        min: None,
        max: None,
        nominal: None,
        shown: false,
    }
}

fn zero(data_type: DataType) -> Value {
    match data_type {
        DataType::Real => Value::Real(0.0),
        DataType::Integer | DataType::Enumeration => Value::Integer(0),
        DataType::Boolean => Value::Boolean(false),
        DataType::String => Value::String(String::new()),
    }
}

/// Enumerations of different FMUs may have one name for different items: outside they are Integers.
fn numeric(data_type: DataType) -> DataType {
    if data_type == DataType::Enumeration { DataType::Integer } else { data_type }
}

/// A bound of an integer as an FMU of FMI 2.0 can have it; none where its 32 bits are the narrower bound.
fn bound(value: i64) -> Option<String> {
    i32::try_from(value).ok().map(|value| value.to_string())
}

/// A variable of a component.
fn inner(graph: &SystemGraph, component: usize, variable: usize, role: Role) -> Variable {
    let owner = &graph.components[component];
    let description: &Inner = &owner.fmu.description.variables[variable];
    let given = owner.start_values.iter().find(|start| start.variable == variable);
    let given = given.map(|start| match &start.value {
        Start::Real(value) => Value::Real(*value),
        Start::Integer(value) => Value::Integer(*value),
        Start::Boolean(value) => Value::Boolean(*value),
        Start::String(value) => Value::String(value.clone()),
    });
    let own = match &description.kind {
        VariableKind::Real(real) => real.start.map(Value::Real),
        VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => {
            start.map(Value::Integer)
        }
        VariableKind::Boolean { start } => start.map(Value::Boolean),
        VariableKind::String { start } => start.clone().map(Value::String),
    };
    let (min, max, nominal, unit) = match &description.kind {
        VariableKind::Real(real) => {
            (real.min.map(number), real.max.map(number), real.nominal, real.unit.clone())
        }
        VariableKind::Integer { min, max, .. } | VariableKind::Enumeration { min, max, .. } => {
            (min.and_then(bound), max.and_then(bound), None, None)
        }
        _ => (None, None, None, None),
    };
    let exact = description.initial == Some(Initial::Exact);
    let settable = match role {
        Role::Parameter | Role::Input => true,
        Role::State(_) => exact,
        _ => false,
    };
    Variable {
        name: owner.path_of(variable),
        description: description.description.clone(),
        role,
        variability: match role {
            Role::Parameter => Variability::Fixed,
            _ => description.variability,
        },
        data_type: numeric(DataType::of(description)),
        place: Place::Variable { component, variable },
        start: given.or(own).filter(|_| settable),
        unit,
        min,
        max,
        nominal,
        shown: false,
    }
}

pub(crate) fn number(value: f64) -> String {
    fmi_export::description::number(value)
}
