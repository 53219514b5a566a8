//! The variable table: name, unit, causality, start value of every variable, typed once.
//!
//! A model fills it in [`Model::declare`] and keeps the handles. The XML, the access rules of get and set, the
//! start values and the range checks all come from it.

use crate::declaration::{Declaration, Enumeration};
use crate::model::Model;
use crate::units::{self, Unit};
use crate::values::{Boolean, Integer, Interface, MemoryBlock, Real, Text, Values};

/// FMI `causality`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Causality {
    Parameter,
    CalculatedParameter,
    Input,
    Output,
    Local,
}

/// FMI `variability`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Variability {
    Fixed,
    Tunable,
    Discrete,
    Continuous,
}

/// FMI `initial`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Initial {
    Exact,
    Calculated,
}

/// Base type with its own attributes; the number is the value reference within the type.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Real: unit, range, nominal, start; `derivative_of` on state derivatives.
    Real {
        /// Handle.
        handle: Real,
        /// Start value, where the triple of causality, variability, initial asks for one.
        start: Option<f64>,
        /// Smallest allowed value.
        min: Option<f64>,
        /// Largest allowed value.
        max: Option<f64>,
        /// Order of magnitude.
        nominal: Option<f64>,
        /// State of which this is the time derivative.
        derivative_of: Option<Real>,
    },
    /// Integer.
    Integer {
        /// Handle.
        handle: Integer,
        /// Start value.
        start: Option<i32>,
        /// Smallest allowed value.
        min: Option<i32>,
        /// Largest allowed value.
        max: Option<i32>,
    },
    /// Boolean.
    Boolean {
        /// Handle.
        handle: Boolean,
        /// Start value.
        start: Option<bool>,
    },
    /// String.
    Text {
        /// Handle.
        handle: Text,
        /// Start value.
        start: Option<String>,
    },
    /// Enumeration, an Integer over the items of its type.
    Enumeration {
        /// Handle.
        handle: Integer,
        /// Start value.
        start: Option<i32>,
        /// Index into [`Table::enumerations`].
        enumeration: usize,
    },
}

/// One row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name in the structured naming convention.
    pub name: String,
    /// Meaning of the variable, for `modelDescription.xml`.
    pub description: String,
    /// FMI causality.
    pub causality: Causality,
    /// FMI variability.
    pub variability: Variability,
    /// FMI initial; none for inputs.
    pub initial: Option<Initial>,
    /// Unit name; none: dimensionless.
    pub unit: Option<&'static str>,
    /// True for a continuous state.
    pub is_state: bool,
    /// True for a continuous state that events may set to a new value (FMI `reinit`).
    pub reinit: bool,
    /// Type with attributes.
    pub kind: Kind,
}

impl Variable {
    /// Real handle, where the variable is Real.
    pub fn real(&self) -> Option<Real> {
        match self.kind {
            Kind::Real { handle, .. } => Some(handle),
            _ => None,
        }
    }

    /// State of which this variable is the derivative.
    pub fn derivative_of(&self) -> Option<Real> {
        match self.kind {
            Kind::Real { derivative_of, .. } => derivative_of,
            _ => None,
        }
    }

    /// True where the model computes the value; of a state, the initial one.
    pub fn is_computed(&self) -> bool {
        self.initial == Some(Initial::Calculated)
    }
}

/// An enumeration type; item `i` has the value `i + 1`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EnumerationType {
    /// Type name.
    pub name: &'static str,
    /// Items: name and description.
    pub items: &'static [(&'static str, &'static str)],
}

/// Handles of the parameters of the inner Co-Simulation integrator.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SolverParameters {
    pub method: Integer,
    pub max_step: Real,
    pub tolerance: Real,
}

/// The variables of a model.
#[derive(Clone, Debug, Default)]
pub struct Table {
    variables: Vec<Variable>,
    enumerations: Vec<EnumerationType>,
    extra_units: Vec<Unit>,
    reals: Vec<usize>,
    integers: Vec<usize>,
    booleans: Vec<usize>,
    texts: Vec<usize>,
    memory: u32,
    indicators: usize,
    states: Vec<Real>,
    derivatives: Vec<Real>,
    pub(crate) solver: Option<SolverParameters>,
}

impl Table {
    /// Declares model `M` and checks the table.
    ///
    /// # Panics
    /// On a table that no FMU can have (duplicate name, unknown unit, state without derivative): an error of
    /// the model's author, found by the first test that packages the model.
    pub fn of<M: Model>() -> (M, Table) {
        let mut table = Table::default();
        let model = M::declare(&mut table);
        if !table.states.is_empty() {
            table.declare_solver();
        }
        table.finish();
        (model, table)
    }

    /// Declares a unit that is not in [`crate::units::STANDARD`], by its SI base-unit exponents.
    pub fn unit(&mut self, name: &'static str, exponents: &'static [(&'static str, i32)]) {
        if self.find_unit(name).is_none() {
            self.extra_units.push(Unit { name, exponents, factor: 1.0, offset: 0.0, display: &[] });
        }
    }

    /// An input; continuous unless said otherwise.
    pub fn input(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Input, Variability::Continuous, None)
    }

    /// An output; continuous unless said otherwise.
    pub fn output(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Output, Variability::Continuous, Some(Initial::Calculated))
    }

    /// A local variable that the model computes.
    pub fn local(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Local, Variability::Continuous, Some(Initial::Calculated))
    }

    /// A parameter that can be set before and during initialization.
    pub fn parameter(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Parameter, Variability::Fixed, Some(Initial::Exact))
    }

    /// A parameter that can also be changed between communication points and at events.
    pub fn tunable(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Parameter, Variability::Tunable, Some(Initial::Exact))
    }

    /// A parameter that the model computes from others.
    pub fn calculated(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::CalculatedParameter, Variability::Fixed, Some(Initial::Calculated))
    }

    /// A continuous state with its start value; local unless made an output.
    pub fn state(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Local, Variability::Continuous, Some(Initial::Exact)).continuous_state()
    }

    /// A continuous state whose initial value [`Model::initialize`] computes; close it with `computed()`.
    pub fn computed_state(&mut self, name: impl Into<String>) -> Declaration<'_> {
        self.declare(name, Causality::Local, Variability::Continuous, Some(Initial::Calculated))
            .continuous_state()
    }

    /// The time derivative of a state; local unless made an output.
    pub fn derivative(&mut self, name: impl Into<String>, state: Real) -> Declaration<'_> {
        self.local(name).of_state(state)
    }

    /// An enumeration type; item `i` has the value `i + 1`.
    pub fn enumeration(
        &mut self,
        name: &'static str,
        items: &'static [(&'static str, &'static str)],
    ) -> Enumeration {
        self.enumerations.push(EnumerationType { name, items });
        Enumeration::number(self.enumerations.len() - 1)
    }

    /// Numbers that the importer does not see, part of the FMU state, 0 at the start.
    pub fn memory(&mut self, len: usize) -> MemoryBlock {
        let first = self.memory;
        self.memory += len as u32;
        MemoryBlock { first, len: len as u32 }
    }

    /// Declares the number of event indicators.
    pub fn event_indicators(&mut self, n: usize) {
        self.indicators = n;
    }

    /// All variables in the order of the model description.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Enumeration types.
    pub fn enumerations(&self) -> &[EnumerationType] {
        &self.enumerations
    }

    /// Continuous states, in the order of `ModelStructure/Derivatives`.
    pub fn states(&self) -> &[Real] {
        &self.states
    }

    /// Derivatives, in the order of the states.
    pub fn derivatives(&self) -> &[Real] {
        &self.derivatives
    }

    /// Number of event indicators.
    pub fn number_of_event_indicators(&self) -> usize {
        self.indicators
    }

    /// The units in use, in order of first use.
    pub fn units(&self) -> Vec<&Unit> {
        let mut used: Vec<&Unit> = Vec::new();
        for name in self.variables.iter().filter_map(|v| v.unit) {
            let unit = self.find_unit(name).expect("finish() has checked every unit");
            if !used.iter().any(|u| u.name == name) {
                used.push(unit);
            }
        }
        used
    }

    /// Index of a Real in [`Table::variables`].
    pub fn index_of(&self, handle: Real) -> usize {
        self.reals[handle.0 as usize]
    }

    /// The variable with a name.
    pub fn by_name(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|v| v.name == name)
    }

    pub(crate) fn real_variable(&self, vr: u32) -> Option<&Variable> {
        self.reals.get(vr as usize).map(|i| &self.variables[*i])
    }
    pub(crate) fn integer_variable(&self, vr: u32) -> Option<&Variable> {
        self.integers.get(vr as usize).map(|i| &self.variables[*i])
    }
    pub(crate) fn boolean_variable(&self, vr: u32) -> Option<&Variable> {
        self.booleans.get(vr as usize).map(|i| &self.variables[*i])
    }
    pub(crate) fn text_variable(&self, vr: u32) -> Option<&Variable> {
        self.texts.get(vr as usize).map(|i| &self.variables[*i])
    }

    /// Start values of every variable, memory 0, time 0.
    pub fn start_values(&self, interface: Interface) -> Values<f64> {
        let mut v = Values {
            time: 0.0,
            interface,
            at_sample: true,
            real: vec![0.0; self.reals.len()],
            memory: vec![0.0; self.memory as usize],
            integer: vec![0; self.integers.len()],
            boolean: vec![false; self.booleans.len()],
            text: vec![String::new(); self.texts.len()],
        };
        for variable in &self.variables {
            match &variable.kind {
                Kind::Real { handle, start, .. } => v[*handle] = start.unwrap_or(0.0),
                Kind::Integer { handle, start, .. } | Kind::Enumeration { handle, start, .. } => {
                    v[*handle] = start.unwrap_or(0);
                }
                Kind::Boolean { handle, start } => v[*handle] = start.unwrap_or(false),
                Kind::Text { handle, start } => v[*handle] = start.clone().unwrap_or_default(),
            }
        }
        v
    }

    fn declare(
        &mut self,
        name: impl Into<String>,
        causality: Causality,
        variability: Variability,
        initial: Option<Initial>,
    ) -> Declaration<'_> {
        Declaration::new(
            self,
            Variable {
                name: name.into(),
                description: String::new(),
                causality,
                variability,
                initial,
                unit: None,
                is_state: false,
                reinit: false,
                kind: Kind::Boolean { handle: Boolean(0), start: None },
            },
        )
    }

    /// Handles of the next variable of each type.
    pub(crate) fn next_real(&self) -> Real {
        Real(self.reals.len() as u32)
    }
    pub(crate) fn next_integer(&self) -> Integer {
        Integer(self.integers.len() as u32)
    }
    pub(crate) fn next_boolean(&self) -> Boolean {
        Boolean(self.booleans.len() as u32)
    }
    pub(crate) fn next_text(&self) -> Text {
        Text(self.texts.len() as u32)
    }

    /// Adds a complete row.
    pub(crate) fn add(&mut self, variable: Variable) {
        let row = self.variables.len();
        match variable.kind {
            Kind::Real { handle, .. } => {
                if variable.is_state {
                    self.states.push(handle);
                }
                self.reals.push(row);
            }
            Kind::Integer { .. } | Kind::Enumeration { .. } => self.integers.push(row),
            Kind::Boolean { .. } => self.booleans.push(row),
            Kind::Text { .. } => self.texts.push(row),
        }
        self.variables.push(variable);
    }

    /// Parameters of the integrator between communication points.
    fn declare_solver(&mut self) {
        let method = self.enumeration(
            "SolverMethod",
            &[
                ("rk4", "classical Runge-Kutta of order 4 with steps of at most solver.max_step"),
                ("dopri5", "Dormand-Prince pair of order 5(4), steps chosen from solver.tolerance"),
            ],
        );
        let method = self
            .parameter("solver.method")
            .about("integrator between communication points (Co-Simulation)")
            .enumeration_of(method, 1);
        let max_step = self
            .parameter("solver.max_step")
            .unit("s")
            .about("largest step of the integrator (Co-Simulation)")
            .range(1e-9, 1e3)
            .real(1e-3);
        let tolerance = self
            .parameter("solver.tolerance")
            .about("relative error allowed per integrator step, for dopri5; a tolerance of the experiment replaces it")
            .range(1e-14, 1e-1)
            .real(1e-8);
        self.solver = Some(SolverParameters { method, max_step, tolerance });
    }

    fn find_unit(&self, name: &str) -> Option<&Unit> {
        units::STANDARD.iter().chain(&self.extra_units).find(|u| u.name == name)
    }

    fn finish(&mut self) {
        for (i, v) in self.variables.iter().enumerate() {
            assert!(
                !self.variables[..i].iter().any(|w| w.name == v.name),
                "two variables are named `{}`",
                v.name
            );
            if let Some(unit) = v.unit {
                assert!(self.find_unit(unit).is_some(), "`{}`: unit `{unit}` is not declared", v.name);
            }
            if let Kind::Real { start: Some(s), min, max, .. } = v.kind {
                assert!(s.is_finite(), "`{}`: start value {s} is not finite", v.name);
                assert!(
                    min.is_none_or(|m| m <= s) && max.is_none_or(|m| s <= m),
                    "`{}`: start value {s} is outside {min:?}..{max:?}",
                    v.name
                );
            }
        }
        for state in &self.states {
            let name = &self.variables[self.index_of(*state)].name;
            let mut of_state = self.variables.iter().filter(|v| v.derivative_of() == Some(*state));
            let derivative = of_state.next().and_then(Variable::real);
            assert!(of_state.next().is_none(), "state `{name}` has two derivatives");
            self.derivatives.push(derivative.unwrap_or_else(|| panic!("state `{name}` has no derivative")));
        }
    }
}
