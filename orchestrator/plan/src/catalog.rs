//! The variables of a system under the names that problem files use: connectors, and `component.variable`.

use std::sync::Arc;

use super::Error;
use super::file::{Place, Quantity, Source, Text};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{self, Conversion, DataType, Start};
use airloop_fmi::{Causality, Fmu, Variability, VariableKind};
use airloop_series::names;
use airloop_series::units::{self, Compatibility, Unit};

/// Units that are offered where another one does not fit.
const COMMON: [&str; 19] = [
    "m", "cm", "mm", "m/s", "mm/s", "rad", "deg", "rad/s", "deg/s", "rpm", "N", "kN", "N.m", "Pa", "kPa",
    "bar", "s", "ms", "kg",
];

/// Role of a variable in a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A continuous state.
    State,
    /// An input of the system.
    Input,
    /// Anything else that can be read.
    Output,
}

/// A variable of the system.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name in results and messages: the connector where there is one.
    pub name: String,
    /// `component.variable`; for inputs the connector.
    pub path: String,
    /// Role in a plan.
    pub kind: Kind,
    /// Name of the unit in which the plan counts.
    pub unit: Option<String>,
    /// The unit itself, where its name is known.
    pub meaning: Option<Unit>,
    /// Start value in that unit, where one is given.
    pub start: Option<f64>,
}

/// All variables of a system.
#[derive(Debug, Clone)]
pub struct Catalog {
    variables: Vec<Variable>,
    /// Further names: (name, index, from the value of the plan to that under this name).
    aliases: Vec<(String, usize, Conversion)>,
    units: Vec<(String, Unit)>,
    fmus: Vec<Arc<Fmu>>,
}

impl Catalog {
    /// Lists the variables of a system.
    pub fn new(graph: &SystemGraph) -> Catalog {
        let fmus = graph.components.iter().map(|component| Arc::clone(&component.fmu)).collect();
        let mut all =
            Catalog { variables: Vec::new(), aliases: Vec::new(), units: graph.units.clone(), fmus };
        for (index, component) in graph.components.iter().enumerate() {
            let description = &component.fmu.description;
            let states: Vec<usize> = description.continuous_states().collect();
            for (number, variable) in description.variables.iter().enumerate() {
                let VariableKind::Real(real) = &variable.kind else { continue };
                // Alias variables share a value reference.
                let is_state = states
                    .iter()
                    .any(|&state| description.variables[state].value_reference == variable.value_reference);
                let own = states.contains(&number);
                let readable = matches!(variable.causality, Causality::Output | Causality::Local)
                    && variable.variability != Variability::Constant;
                if !own && (is_state || !readable) {
                    continue;
                }
                let set = component.start_values.iter().find(|start| start.variable == number);
                let start = match set.map(|start| &start.value) {
                    Some(Start::Real(value)) => Some(*value),
                    _ => real.start,
                };
                let path = match graph.single {
                    true => variable.name.clone(),
                    false => component.path_of(number),
                };
                let kind = if own { Kind::State } else { Kind::Output };
                let meaning = real.unit.as_deref().and_then(|unit| all.unit(unit, Some(index)));
                let unit = real.unit.clone();
                all.variables.push(Variable { name: path.clone(), path, kind, unit, meaning, start });
            }
        }
        if graph.single {
            let component = &graph.components[0].name;
            let long = all.variables.iter().enumerate();
            let long = long.map(|(at, one)| (format!("{component}.{}", one.name), at, Conversion::IDENTITY));
            all.aliases = long.collect();
        }
        all.add_connectors(graph);
        all
    }

    fn add_connectors(&mut self, graph: &SystemGraph) {
        for (index, input) in graph.inputs.iter().enumerate() {
            if input.data_type != DataType::Real {
                continue;
            }
            let fed = graph.connections.iter().find(|one| one.source == graph::Source::Input(index));
            let meaning = input.unit.as_deref().and_then(|unit| self.unit(unit, fed.map(|to| to.component)));
            let start = fed.and_then(|to| {
                let set = &graph.components[to.component].start_values;
                match set.iter().find(|start| start.variable == to.variable).map(|start| &start.value) {
                    Some(Start::Real(value)) => Some(to.conversion.inverse().apply(*value)),
                    _ => match &graph.components[to.component].fmu.description.variables[to.variable].kind {
                        VariableKind::Real(real) => real.start.map(|v| to.conversion.inverse().apply(v)),
                        _ => None,
                    },
                }
            });
            self.variables.push(Variable {
                name: input.name.clone(),
                path: input.name.clone(),
                kind: Kind::Input,
                unit: input.unit.clone(),
                meaning,
                start,
            });
        }
        for output in &graph.outputs {
            let graph::Source::Output { component, variable } = output.source else { continue };
            let description = &graph.components[component].fmu.description;
            let own = &description.variables[variable];
            let states = description.continuous_states();
            let state = states
                .filter(|_| matches!(own.kind, VariableKind::Real(_)))
                .find(|&state| description.variables[state].value_reference == own.value_reference);
            let number = state.unwrap_or(variable);
            let path = match graph.single {
                true => description.variables[number].name.clone(),
                false => graph.components[component].path_of(number),
            };
            let Some(at) = self.variables.iter().position(|one| one.path == path) else { continue };
            if output.conversion == Conversion::IDENTITY && self.variables[at].name == path {
                self.variables[at].name.clone_from(&output.name);
            }
            self.aliases.push((output.name.clone(), at, output.conversion));
        }
    }

    /// A unit by name, as the system, the FMU of a component, or common use understands it.
    fn unit(&self, name: &str, component: Option<usize>) -> Option<Unit> {
        let of_fmu = |fmu: &Arc<Fmu>| {
            let units = &fmu.description.units;
            units.iter().find(|unit| unit.name == name).and_then(|unit| unit.base)
        };
        let of_system = || self.units.iter().find(|(own, _)| own == name).map(|(_, unit)| *unit);
        component
            .and_then(|index| of_fmu(&self.fmus[index]))
            .or_else(of_system)
            .or_else(|| units::lookup(name))
    }

    /// All variables: states and outputs by component, then inputs.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// The variable of a name and how values under that name follow from those of the plan, if there is one.
    pub fn find(&self, name: &str) -> Option<(usize, Conversion)> {
        let own = |one: &Variable| one.name == name || one.path == name;
        let index = self.variables.iter().position(own).map(|index| (index, Conversion::IDENTITY));
        index.or_else(|| {
            let alias = self.aliases.iter().find(|(alias, ..)| alias == name);
            alias.map(|(_, index, conversion)| (*index, *conversion))
        })
    }

    /// Same as [`Catalog::find`], for a name in a problem file.
    ///
    /// # Errors
    /// [`Error::File`] with the nearest names.
    pub fn want(&self, source: &Source, name: &Text) -> Result<(usize, Conversion), Error> {
        self.find(&name.text).ok_or_else(|| {
            let paths = self.variables.iter().filter(|one| one.path != one.name).map(|one| one.path.as_str());
            let known = self.variables.iter().map(|one| one.name.as_str()).chain(paths);
            let meant = names::suggestion(&name.text, known);
            source.error_at(name.place, format!("the system has no variable `{}`; {meant}", name.text))
        })
    }

    /// A quantity in the unit of a variable; `conversion` is that of [`Catalog::find`].
    ///
    /// # Errors
    /// [`Error::File`] for a unit that is not known or of another kind.
    pub fn value(
        &self,
        source: &Source,
        quantity: &Quantity,
        (index, conversion): (usize, Conversion),
    ) -> Result<f64, Error> {
        let back = conversion.inverse();
        match &quantity.unit {
            None if conversion == Conversion::IDENTITY => Ok(quantity.value),
            None => Ok(back.apply(quantity.value)),
            Some(unit) => self.convert(source, quantity.value, (unit, quantity.place), index),
        }
    }

    /// A number with a written unit in the unit of a variable.
    ///
    /// # Errors
    /// Same as [`Catalog::value`].
    pub fn convert(
        &self,
        source: &Source,
        value: f64,
        (unit, place): (&str, Place),
        index: usize,
    ) -> Result<f64, Error> {
        let variable = &self.variables[index];
        if variable.unit.as_deref() == Some(unit) {
            return Ok(value);
        }
        let known = self.unit(unit, None).ok_or_else(|| {
            let problem =
                format!("the unit `{unit}` is not known; {}", self.fitting(variable).unwrap_or_default());
            source.error_at(place, problem)
        })?;
        let meaning = variable.meaning.unwrap_or_else(|| units::lookup("1").unwrap_or(known));
        match units::compatible(&known, &meaning) {
            Compatibility::Equal => Ok(value),
            Compatibility::Convertible { factor, offset } => Ok(factor * value + offset),
            Compatibility::Incompatible => {
                let fitting = self.fitting(variable);
                let fitting = fitting.unwrap_or_else(|| format!("`{}` has no unit", variable.name));
                Err(source
                    .error_at(place, format!("`{unit}` is not a unit for `{}`; {fitting}", variable.name)))
            }
        }
    }

    /// Units that a variable accepts, in words.
    fn fitting(&self, variable: &Variable) -> Option<String> {
        let (own, meaning) = (variable.unit.as_deref()?, variable.meaning);
        let others = COMMON.iter().filter(|name| **name != own).filter(|name| {
            let pair = units::lookup(name).zip(meaning);
            pair.is_some_and(|(a, b)| units::compatible(&a, &b) != Compatibility::Incompatible)
        });
        let others: Vec<String> = others.map(|name| format!("`{name}`")).collect();
        let others = if others.is_empty() { String::new() } else { format!(" or {}", others.join(", ")) };
        Some(format!("`{}` is in `{own}`; write it in `{own}`{others}", variable.name))
    }
}
