//! The problem as the solver sees it: functions of a vector, bounds, sparsity, names.

pub use airloop_dynamics::EvaluationError;

/// Stages in a chain: an entry of the Jacobian or Hessian couples a stage with itself or a neighbor only. A
/// constraint between the variables of stages k and k + 1 belongs to either of them; k is the cheaper choice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stages {
    /// Stage of every variable, from 0, `[n]`.
    pub variables: Vec<usize>,
    /// Stage of every constraint, `[m]`.
    pub constraints: Vec<usize>,
}

/// Lower and upper bounds; infinite where there is none, equal where the value is fixed.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
}

impl Bounds {
    /// No bound on any of `count` values.
    pub fn free(count: usize) -> Self {
        Self { lower: vec![f64::NEG_INFINITY; count], upper: vec![f64::INFINITY; count] }
    }

    /// All of `count` values fixed at zero, as for equality constraints c(x) = 0.
    pub fn zero(count: usize) -> Self {
        Self { lower: vec![0.0; count], upper: vec![0.0; count] }
    }
}

/// Minimize f(x) subject to `c_l <= c(x) <= c_u` and `x_l <= x <= x_u`, x `[n]`, c `[m]`.
///
/// f and c are twice continuously differentiable where the solver is to converge. Patterns are fixed; an entry may
/// occur several times, its values are added. The functions take `&mut self` so that they may keep what they
/// computed for the last `x`: the solver asks for several of them at the same point. A value that is NaN or
/// infinite counts as an [`EvaluationError`].
pub trait Nlp {
    /// Number of variables n.
    fn variables(&self) -> usize;

    /// Number of constraints m.
    fn constraints(&self) -> usize;

    /// Bounds of the variables, `[n]`.
    fn variable_bounds(&self) -> Bounds;

    /// Bounds of the constraints, `[m]`.
    fn constraint_bounds(&self) -> Bounds;

    /// Both bounds as they are now, into memory that holds them from before; [`super::Solver`] asks at every solve.
    fn write_bounds(&self, variables: &mut Bounds, constraints: &mut Bounds) {
        *variables = self.variable_bounds();
        *constraints = self.constraint_bounds();
    }

    /// f(x).
    ///
    /// # Errors
    /// When f has no value at `x`; so in all functions below.
    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError>;

    /// Gradient of f, written to `gradient` `[n]`.
    ///
    /// # Errors
    /// See [`Nlp::objective`].
    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError>;

    /// c(x), written to `values` `[m]`.
    ///
    /// # Errors
    /// See [`Nlp::objective`].
    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError>;

    /// Entries (constraint, variable) of dc/dx.
    fn jacobian_pattern(&self) -> Vec<(usize, usize)>;

    /// Values of dc/dx in the order of the pattern.
    ///
    /// # Errors
    /// See [`Nlp::objective`].
    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError>;

    /// Entries of one triangle of the Hessian of the Lagrangian, (row, column) in either order.
    fn hessian_pattern(&self) -> Vec<(usize, usize)>;

    /// Hessian of `objective_factor f(x) + multipliers . c(x)` in the order of the pattern; multipliers `[m]`.
    ///
    /// # Errors
    /// See [`Nlp::objective`].
    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError>;

    /// The chain of stages, where the problem has one; the cost is then linear in their number.
    fn stages(&self) -> Option<Stages> {
        None
    }

    /// Name of a variable for messages.
    fn variable_name(&self, variable: usize) -> String {
        format!("x[{variable}]")
    }

    /// Name of a constraint for messages.
    fn constraint_name(&self, constraint: usize) -> String {
        format!("c[{constraint}]")
    }
}

impl<N: Nlp + ?Sized> Nlp for &mut N {
    fn variables(&self) -> usize {
        (**self).variables()
    }

    fn constraints(&self) -> usize {
        (**self).constraints()
    }

    fn variable_bounds(&self) -> Bounds {
        (**self).variable_bounds()
    }

    fn constraint_bounds(&self) -> Bounds {
        (**self).constraint_bounds()
    }

    fn write_bounds(&self, variables: &mut Bounds, constraints: &mut Bounds) {
        (**self).write_bounds(variables, constraints);
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        (**self).objective(x)
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        (**self).gradient(x, gradient)
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        (**self).constraint_values(x, values)
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        (**self).jacobian_pattern()
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        (**self).jacobian(x, values)
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        (**self).hessian_pattern()
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        (**self).hessian(x, objective_factor, multipliers, values)
    }

    fn stages(&self) -> Option<Stages> {
        (**self).stages()
    }

    fn variable_name(&self, variable: usize) -> String {
        (**self).variable_name(variable)
    }

    fn constraint_name(&self, constraint: usize) -> String {
        (**self).constraint_name(constraint)
    }
}
