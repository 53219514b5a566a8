//! The model description of an FMU of FMI 2.0 or 3.0 as typed data, with the defaults of the standard filled in.
//!
//! Indices into [`ModelDescription::variables`] are 0-based everywhere, while the XML counts from 1. Reading is in
//! `read.rs`, for FMI 3.0 in `fmi3`; judging what was read (beyond what makes the file unusable) is left to
//! `fmu::check`.

use serde::Serialize;

pub use error::DescriptionError;
pub use initial::allowed_initials;

mod attributes;
mod dependencies;
mod error;
mod fmi3;
mod initial;
mod kinds;
pub(crate) mod layout;
mod read;
mod roles;
mod structure;
mod variables;

/// Content of `modelDescription.xml` (FMI 2.0.4 section 2.2).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelDescription {
    /// "2.0", or "3.0" and its minor versions.
    pub fmi_version: String,
    /// Name of the model as used in the tool that made it.
    pub model_name: String,
    /// Fingerprint that library and description share.
    pub guid: String,
    /// Free text about the model.
    pub description: String,
    /// Name and organization of the author.
    pub author: String,
    /// Version of the model.
    pub version: String,
    /// Tool that wrote the file.
    pub generation_tool: String,
    /// Convention by which variable names are formed.
    pub variable_naming_convention: NamingConvention,
    /// Number of event indicators (Model Exchange); 0 if the file does not say.
    pub number_of_event_indicators: usize,
    /// Whether the file states the number of event indicators.
    pub states_number_of_event_indicators: bool,
    /// The Co-Simulation interface, if there is one.
    pub co_simulation: Option<Interface>,
    /// The Model Exchange interface, if there is one.
    pub model_exchange: Option<Interface>,
    /// Units in file order.
    pub units: Vec<UnitDefinition>,
    /// Type definitions in file order.
    pub types: Vec<TypeDefinition>,
    /// Log categories in file order.
    pub log_categories: Vec<LogCategory>,
    /// Experiment that the author suggests.
    pub default_experiment: DefaultExperiment,
    /// All variables in file order.
    pub variables: Vec<Variable>,
    /// `ModelStructure/Outputs`.
    pub outputs: Vec<Unknown>,
    /// `ModelStructure/Derivatives`; its order is the order of the continuous states.
    pub derivatives: Vec<Unknown>,
    /// `ModelStructure/InitialUnknowns`.
    pub initial_unknowns: Vec<Unknown>,
    /// Variables of types that are not carried (Binary and Clock, FMI 3.0).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unread: Vec<UnreadVariable>,
    #[serde(skip)]
    pub(crate) index: std::collections::HashMap<String, usize>,
    /// Where the variables lie in the FMU (FMI 3.0 only).
    #[serde(skip)]
    pub(crate) layout: Option<layout::Layout>,
}

/// A variable of a type that is not carried: it keeps its start value.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UnreadVariable {
    /// Unique name.
    pub name: String,
    /// Type as in the XML.
    pub kind: String,
    /// Whether it is an input.
    pub is_input: bool,
}

impl ModelDescription {
    /// Whether the FMU speaks FMI 3.0.
    pub fn is_fmi3(&self) -> bool {
        self.layout.is_some()
    }

    /// Whether the variable at `position` is a structural parameter that is the length of a dimension (FMI 3.0).
    pub fn sizes_arrays(&self, position: usize) -> bool {
        let place = |layout: &layout::Layout| {
            let slot = layout.find(self.variables[position].value_reference)?;
            Some(layout.wholes[slot.whole].structural && layout.wholes[slot.whole].sizes_arrays)
        };
        self.layout.as_ref().and_then(place).unwrap_or(false)
    }

    /// Whether the variable at `position` is a structural parameter (FMI 3.0).
    pub(crate) fn is_structural(&self, position: usize) -> bool {
        let place = |layout: &layout::Layout| {
            let slot = layout.find(self.variables[position].value_reference)?;
            Some(layout.wholes[slot.whole].structural)
        };
        self.layout.as_ref().and_then(place).unwrap_or(false)
    }

    /// Whether the variable at `position` is a float of single precision (FMI 3.0).
    pub(crate) fn is_single(&self, position: usize) -> bool {
        let base = |layout: &layout::Layout| {
            let slot = layout.find(self.variables[position].value_reference)?;
            Some(layout.wholes[slot.whole].base)
        };
        self.layout.as_ref().and_then(base) == Some(layout::BaseType::Float32)
    }

    /// Whether a variable is of type Binary (FMI 3.0), carried as a text of hexadecimal digits.
    pub fn is_binary(&self, variable: &Variable) -> bool {
        let base = |layout: &layout::Layout| {
            let slot = layout.find(variable.value_reference)?;
            Some(layout.wholes[slot.whole].base)
        };
        self.layout.as_ref().and_then(base) == Some(layout::BaseType::Binary)
    }

    /// Smallest and largest integer that the type of a variable holds, as far as 64 bits with a sign reach.
    pub fn integer_range(&self, variable: &Variable) -> (i64, i64) {
        let range = |layout: &layout::Layout| {
            let slot = layout.find(variable.value_reference)?;
            let (min, max) = layout.wholes[slot.whole].base.range()?;
            Some((i64::try_from(min).ok()?, i64::try_from(max).unwrap_or(i64::MAX)))
        };
        let of_fmi2 = (i32::MIN.into(), i32::MAX.into());
        self.layout.as_ref().map_or(of_fmi2, |layout| range(layout).unwrap_or((i64::MIN, i64::MAX)))
    }

    /// Structural parameters that are lengths of arrays, with their values (FMI 3.0).
    pub fn lengths(&self) -> Vec<(String, i64)> {
        let positions = (0..self.variables.len()).filter(|&position| self.sizes_arrays(position));
        positions.map(|position| (self.variables[position].name.clone(), self.length(position))).collect()
    }

    /// Same as [`Self::lengths`] with another value of the variable at `position`.
    pub fn lengths_with(&self, position: usize, value: i64) -> Vec<(String, i64)> {
        let mut lengths = self.lengths();
        for (_, length) in lengths.iter_mut().filter(|(name, _)| *name == self.variables[position].name) {
            *length = value;
        }
        lengths
    }

    fn length(&self, position: usize) -> i64 {
        match self.variables[position].kind {
            VariableKind::Integer { start, .. } => start.unwrap_or(0),
            _ => 0,
        }
    }

    /// The variable called `name`, if there is one.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.index_of(name).map(|index| &self.variables[index])
    }

    /// The position of the variable called `name` in [`Self::variables`].
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.index.get(name).copied()
    }

    /// The position of each continuous state in [`Self::variables`], in the order of [`Self::derivatives`].
    pub fn continuous_states(&self) -> impl Iterator<Item = usize> + '_ {
        self.derivatives.iter().filter_map(|unknown| match &self.variables[unknown.variable].kind {
            VariableKind::Real(real) => real.derivative,
            _ => None,
        })
    }
}

/// Capabilities of one interface (`CoSimulation` or `ModelExchange` element).
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Interface {
    /// Name of the library file without its ending.
    pub model_identifier: String,
    /// The FMU only talks to a tool that must be installed.
    pub needs_execution_tool: bool,
    /// Steps may have different lengths (Co-Simulation).
    pub can_handle_variable_communication_step_size: bool,
    /// Length of the steps inside of a communication step \[s\] (Co-Simulation, FMI 3.0), if they all have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fixed_internal_step_size: Option<f64>,
    /// Inputs may be given derivatives (Co-Simulation).
    pub can_interpolate_inputs: bool,
    /// Highest order of output derivatives (Co-Simulation).
    pub max_output_derivative_order: u32,
    /// Steps may run in the background (Co-Simulation); spelled as in the standard.
    pub can_run_asynchronuously: bool,
    /// A second instance in one process is refused.
    pub can_be_instantiated_only_once_per_process: bool,
    /// The FMU does not use the memory callbacks.
    pub can_not_use_memory_management_functions: bool,
    /// State can be saved and restored.
    pub can_get_and_set_fmu_state: bool,
    /// State can be turned into bytes.
    pub can_serialize_fmu_state: bool,
    /// Directional derivatives are offered.
    pub provides_directional_derivative: bool,
    /// `fmi2CompletedIntegratorStep` need not be called (Model Exchange).
    pub completed_integrator_step_not_needed: bool,
}

/// Convention by which variable names are formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub enum NamingConvention {
    /// Any unique string.
    #[default]
    Flat,
    /// Dots and array indices, as in `a.b[1].c` and `der(a.b)`.
    Structured,
}

/// A unit and its conversion to SI base units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitDefinition {
    /// Name that variables refer to.
    pub name: String,
    /// Conversion to base units, if the file gives one.
    pub base: Option<airloop_series::units::Unit>,
    /// Display units derived from this one.
    pub display_units: Vec<DisplayUnit>,
}

/// A unit for display: `shown = factor * value + offset`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DisplayUnit {
    /// Name of the display unit.
    pub name: String,
    /// Factor from the unit to the display unit.
    pub factor: f64,
    /// Offset from the unit to the display unit.
    pub offset: f64,
}

/// A named type with attributes that variables take over.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TypeDefinition {
    /// Name that variables refer to.
    pub name: String,
    /// Free text.
    pub description: String,
    /// Base type and attributes; starts are empty.
    pub kind: VariableKind,
    /// Items of an enumeration, as (name, value); empty otherwise.
    pub items: Vec<(String, i64)>,
}

/// A category of log messages.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogCategory {
    /// Name for `fmi2SetDebugLogging`.
    pub name: String,
    /// Free text.
    pub description: String,
}

/// Experiment that the author suggests; times in s.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct DefaultExperiment {
    /// Start time \[s\].
    pub start: Option<f64>,
    /// Stop time \[s\].
    pub stop: Option<f64>,
    /// Relative tolerance.
    pub tolerance: Option<f64>,
    /// Communication step size \[s\].
    pub step_size: Option<f64>,
}

/// Role of a variable in its FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Causality {
    /// Set by the user, constant during a run unless tunable.
    Parameter,
    /// Computed from parameters.
    CalculatedParameter,
    /// Set by connections.
    Input,
    /// Read by connections.
    Output,
    /// Internal.
    Local,
    /// The independent variable, usually time.
    Independent,
}

/// Times at which a variable may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialization.
    Fixed,
    /// At events that the importer causes.
    Tunable,
    /// At events.
    Discrete,
    /// Any time.
    Continuous,
}

/// Kind of initialization of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Initial {
    /// Equal to the start value.
    Exact,
    /// The start value is a guess.
    Approx,
    /// Computed.
    Calculated,
}

/// One `ScalarVariable`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Variable {
    /// Unique name.
    pub name: String,
    /// Handle for get and set, unique per base type up to aliases.
    pub value_reference: u32,
    /// Free text.
    pub description: String,
    /// Role in the FMU.
    pub causality: Causality,
    /// Times at which it may change.
    pub variability: Variability,
    /// Effective initialization: the default of the standard's table where the file says nothing; `None` for inputs
    /// and the independent variable, and for combinations that the standard does not allow.
    pub initial: Option<Initial>,
    /// The `initial` attribute as written in the file.
    pub declared_initial: Option<Initial>,
    /// Base type with its attributes, those of the declared type filled in.
    pub kind: VariableKind,
    /// Whether it may be set more than once per time instant (Model Exchange inputs).
    pub can_handle_multiple_set: Option<bool>,
    /// Line of the element in `modelDescription.xml`, from 1.
    pub line: usize,
}

/// Base type of a variable with its attributes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type")]
pub enum VariableKind {
    /// A real number.
    Real(RealAttributes),
    /// An integer.
    Integer {
        /// Start value.
        start: Option<i64>,
        /// Smallest value.
        min: Option<i64>,
        /// Largest value.
        max: Option<i64>,
        /// Physical quantity.
        quantity: Option<String>,
    },
    /// A truth value.
    Boolean {
        /// Start value.
        start: Option<bool>,
    },
    /// A text.
    String {
        /// Start value.
        start: Option<String>,
    },
    /// One of the items of a declared type; set and read as integer.
    Enumeration {
        /// Name of the type that holds the items.
        declared_type: String,
        /// Start value.
        start: Option<i64>,
        /// Smallest value.
        min: Option<i64>,
        /// Largest value.
        max: Option<i64>,
    },
}

impl VariableKind {
    /// Name of the base type as in the XML.
    pub fn name(&self) -> &'static str {
        match self {
            VariableKind::Real(_) => "Real",
            VariableKind::Integer { .. } => "Integer",
            VariableKind::Boolean { .. } => "Boolean",
            VariableKind::String { .. } => "String",
            VariableKind::Enumeration { .. } => "Enumeration",
        }
    }

    /// Takes the start value away.
    pub(crate) fn clear_start(&mut self) {
        match self {
            VariableKind::Real(real) => real.start = None,
            VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => *start = None,
            VariableKind::Boolean { start } => *start = None,
            VariableKind::String { start } => *start = None,
        }
    }

    /// Whether a start value is given.
    pub fn has_start(&self) -> bool {
        match self {
            VariableKind::Real(real) => real.start.is_some(),
            VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => start.is_some(),
            VariableKind::Boolean { start } => start.is_some(),
            VariableKind::String { start } => start.is_some(),
        }
    }
}

/// Attributes of a `Real` variable.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RealAttributes {
    /// Name of a unit definition.
    pub unit: Option<String>,
    /// Unit for display.
    pub display_unit: Option<String>,
    /// Physical quantity.
    pub quantity: Option<String>,
    /// Start value in `unit`.
    pub start: Option<f64>,
    /// Smallest value in `unit`.
    pub min: Option<f64>,
    /// Largest value in `unit`.
    pub max: Option<f64>,
    /// Typical magnitude in `unit`.
    pub nominal: Option<f64>,
    /// Position of the variable of which this one is the time derivative (0-based).
    pub derivative: Option<usize>,
    /// Whether a state may jump at an event (Model Exchange).
    pub reinit: bool,
    /// Whether offsets are left out of unit conversion.
    pub relative_quantity: bool,
    /// Whether error control should use an absolute tolerance.
    pub unbounded: bool,
}

/// An entry of `ModelStructure`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Unknown {
    /// Position in [`ModelDescription::variables`].
    pub variable: usize,
    /// `None`: depends on all knowns; `Some` and empty: on none.
    pub dependencies: Option<Vec<Dependency>>,
}

/// A known on which an unknown depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Dependency {
    /// Position in [`ModelDescription::variables`].
    pub variable: usize,
    /// Kind of dependence.
    pub kind: DependencyKind,
}

/// Kind of the dependence of an unknown on a known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub enum DependencyKind {
    /// Any way; the default where the file gives no kinds.
    #[default]
    Dependent,
    /// Linear with a constant factor.
    Constant,
    /// Linear with a factor fixed after initialization.
    Fixed,
    /// Linear with a factor that changes at tuning events.
    Tunable,
    /// Linear with a factor that changes at events.
    Discrete,
}
