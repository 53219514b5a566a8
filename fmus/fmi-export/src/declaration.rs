//! The builder that [`Table::input`], [`Table::state`] and the like give out.

use crate::table::{Causality, Kind, Table, Variability, Variable};
use crate::values::{Boolean, Integer, Real, Text};

/// Names an enumeration type of a [`Table`].
#[derive(Clone, Copy, Debug)]
pub struct Enumeration(usize);

impl Enumeration {
    pub(crate) fn number(index: usize) -> Self {
        Self(index)
    }
}

/// A variable in the making; one of the closing calls (`real`, `computed`, ...) adds it to the table.
#[must_use = "close the declaration with real(), computed() or the like"]
pub struct Declaration<'t> {
    table: &'t mut Table,
    variable: Variable,
    min: Option<f64>,
    max: Option<f64>,
    nominal: Option<f64>,
    derivative_of: Option<Real>,
}

impl<'t> Declaration<'t> {
    /// Starts a row that is not in the table yet.
    pub(crate) fn new(table: &'t mut Table, variable: Variable) -> Self {
        Self { table, variable, min: None, max: None, nominal: None, derivative_of: None }
    }

    pub(crate) fn continuous_state(mut self) -> Self {
        self.variable.is_state = true;
        self
    }

    pub(crate) fn of_state(mut self, state: Real) -> Self {
        self.derivative_of = Some(state);
        self
    }

    /// Description, one line.
    pub fn about(mut self, description: impl Into<String>) -> Self {
        self.variable.description = description.into();
        self
    }

    /// Unit, one of [`crate::units::STANDARD`] or declared by [`Table::unit`].
    pub fn unit(mut self, unit: &'static str) -> Self {
        self.variable.unit = Some(unit);
        self
    }

    /// Smallest allowed value.
    pub fn min(mut self, min: f64) -> Self {
        self.min = Some(min);
        self
    }

    /// Smallest and largest allowed value.
    pub fn range(mut self, min: f64, max: f64) -> Self {
        self.min = Some(min);
        self.max = Some(max);
        self
    }

    /// Order of magnitude, for solvers and for the search of dependencies.
    pub fn nominal(mut self, nominal: f64) -> Self {
        self.nominal = Some(nominal);
        self
    }

    /// Changes at events and samples only.
    pub fn discrete(mut self) -> Self {
        self.variable.variability = Variability::Discrete;
        self
    }

    /// Says that events or samples may set this state to a new value.
    pub fn reinit(mut self) -> Self {
        self.variable.reinit = true;
        self
    }

    /// Makes a state or derivative an output.
    pub fn output(mut self) -> Self {
        self.variable.causality = Causality::Output;
        self
    }

    /// Adds a Real with a start value (inputs, parameters, states).
    pub fn real(self, start: f64) -> Real {
        self.add_real(Some(start))
    }

    /// Adds a Real that the model computes (outputs, locals, derivatives, calculated parameters).
    pub fn computed(self) -> Real {
        self.add_real(None)
    }

    /// Adds an Integer with a start value; the range was given as whole numbers.
    pub fn integer(self, start: i32) -> Integer {
        self.add_integer(Some(start))
    }

    /// Adds an Integer that the model computes; discrete.
    pub fn computed_integer(self) -> Integer {
        self.add_integer(None)
    }

    /// Adds a Boolean with a start value.
    pub fn boolean(self, start: bool) -> Boolean {
        self.add_boolean(Some(start))
    }

    /// Adds a Boolean that the model computes; discrete.
    pub fn computed_boolean(self) -> Boolean {
        self.add_boolean(None)
    }

    /// Adds a String with a start value.
    pub fn text(self, start: impl Into<String>) -> Text {
        self.add_text(Some(start.into()))
    }

    /// Adds a String that the model computes; discrete.
    pub fn computed_text(self) -> Text {
        self.add_text(None)
    }

    /// Adds an Enumeration with a start value (1 = first item).
    pub fn enumeration_of(self, kind: Enumeration, start: i32) -> Integer {
        self.add_enumeration(kind, Some(start))
    }

    /// Adds an Enumeration that the model computes; discrete.
    pub fn computed_enumeration(self, kind: Enumeration) -> Integer {
        self.add_enumeration(kind, None)
    }

    fn add_real(mut self, start: Option<f64>) -> Real {
        let handle = self.table.next_real();
        let Self { min, max, nominal, derivative_of, .. } = self;
        self.variable.kind = Kind::Real { handle, start, min, max, nominal, derivative_of };
        self.table.add(self.variable);
        handle
    }

    fn add_integer(self, start: Option<i32>) -> Integer {
        let handle = self.table.next_integer();
        let (min, max) = (self.min.map(|x| x as i32), self.max.map(|x| x as i32));
        self.add_discrete(Kind::Integer { handle, start, min, max });
        handle
    }

    fn add_boolean(self, start: Option<bool>) -> Boolean {
        let handle = self.table.next_boolean();
        self.add_discrete(Kind::Boolean { handle, start });
        handle
    }

    fn add_text(self, start: Option<String>) -> Text {
        let handle = self.table.next_text();
        self.add_discrete(Kind::Text { handle, start });
        handle
    }

    fn add_enumeration(self, kind: Enumeration, start: Option<i32>) -> Integer {
        let handle = self.table.next_integer();
        self.add_discrete(Kind::Enumeration { handle, start, enumeration: kind.0 });
        handle
    }

    /// Only Reals may be continuous.
    fn add_discrete(mut self, kind: Kind) {
        if self.variable.variability == Variability::Continuous {
            self.variable.variability = Variability::Discrete;
        }
        self.variable.kind = kind;
        self.table.add(self.variable);
    }
}
