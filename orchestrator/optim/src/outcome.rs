//! Result of the solver: status, solution with multipliers, iteration table.

use std::fmt;

/// Outcome of a run. [`fmt::Display`] gives a sentence that says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// The KKT conditions hold to the tolerance.
    Solved,
    /// No further progress was possible, with a KKT error below the acceptable tolerance.
    Acceptable,
    /// A point at which the violation of the constraints has a minimum that is not zero.
    Infeasible,
    /// Variables or objective run away.
    Diverging,
    /// The limit of iterations was reached.
    IterationLimit,
    /// Stopped from outside.
    Interrupted,
    /// No step makes progress.
    Stalled,
    /// The functions had no value in any neighborhood that was tried; the reason of the last failure.
    EvaluationFailed(String),
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Status::Solved => f.write_str("solved: the optimality conditions hold to the tolerance"),
            Status::Acceptable => f.write_str(
                "solved to the acceptable tolerance only: rounding stops further progress; scale the problem \
                 or loosen `tolerance`",
            ),
            Status::Infeasible => f.write_str(
                "infeasible: the violation of the constraints has a minimum here that is not zero; relax the \
                 worst constraint or try another start",
            ),
            Status::Diverging => f.write_str(
                "diverging: the objective falls without end; bound the variables or the objective from below",
            ),
            Status::IterationLimit => f.write_str(
                "the limit of iterations was reached; raise `max_iterations` or continue from this point",
            ),
            Status::Interrupted => f.write_str("interrupted; continue from this point"),
            Status::Stalled => f.write_str(
                "stalled: no step reduces objective or violation; check the derivatives, or try another start",
            ),
            Status::EvaluationFailed(reason) => write!(
                f,
                "the functions could not be evaluated near the last point ({reason}); bound the variables away \
                 from there or try another start"
            ),
        }
    }
}

/// One row of the iteration table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Iteration {
    /// Number, from 0 (the start).
    pub number: usize,
    /// Objective, unscaled.
    pub objective: f64,
    /// Largest violation of a constraint or bound, in its own unit.
    pub violation: f64,
    /// Scaled gradient of the Lagrangian, largest entry.
    pub dual_infeasibility: f64,
    /// Barrier parameter; 0 for SQP.
    pub barrier: f64,
    /// Largest entry of the step that led here.
    pub step: f64,
    /// Part of the step that was taken, 0..1.
    pub step_length: f64,
    /// Number that was added to the diagonal of the Hessian.
    pub regularization: f64,
    /// Special event of the iteration.
    pub note: Note,
}

/// Mark of an iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Note {
    /// Nothing special.
    #[default]
    None,
    /// The step was corrected for the curvature of the constraints.
    SecondOrderCorrection,
    /// Step of the feasibility restoration.
    Restoration,
    /// The step came from a quadratic program with inequalities.
    QuadraticProgram,
}

/// The largest violation of a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Name of the constraint or variable.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its lower bound.
    pub lower: f64,
    /// Its upper bound.
    pub upper: f64,
    /// Distance to the nearer bound.
    pub amount: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, value, lower, upper, amount } = self;
        write!(f, "{name}: {lower} <= {value} <= {upper} violated by {amount:.3e}")
    }
}

/// End of a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The lower bound.
    Lower,
    /// The upper bound.
    Upper,
}

/// The bound that stands most in the way of a feasible point: relaxing it reduces the violation fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocking {
    /// Name of the variable or constraint.
    pub name: String,
    /// Side of the bound.
    pub side: Side,
    /// The bound.
    pub bound: f64,
}

impl fmt::Display for Blocking {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.side == Side::Lower { ">=" } else { "<=" };
        write!(f, "{} {sign} {}", self.name, self.bound)
    }
}

/// Multipliers and barrier parameter that belong to a point; the sign is that of L = f + y.c - z_l.x + z_u.x.
#[derive(Clone, Debug, PartialEq)]
pub struct Multipliers {
    /// y, of the constraints, `[m]`.
    pub constraints: Vec<f64>,
    /// z_l >= 0, of the lower bounds of the variables, `[n]`.
    pub lower: Vec<f64>,
    /// z_u >= 0, of the upper bounds of the variables, `[n]`.
    pub upper: Vec<f64>,
}

/// Starting point.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Variables, `[n]`; moved into their bounds.
    pub x: Vec<f64>,
    /// Multipliers of an earlier run, for a warm start.
    pub multipliers: Option<Multipliers>,
    /// Barrier parameter of that run; none: estimated from the multipliers.
    pub barrier: Option<f64>,
}

impl Start {
    /// A start from `x` \[n\] without knowledge of the multipliers.
    pub fn cold(x: Vec<f64>) -> Self {
        Self { x, multipliers: None, barrier: None }
    }
}

/// Numbers of evaluations of the functions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evaluations {
    /// Objective and constraints.
    pub functions: usize,
    /// Gradient and Jacobian.
    pub gradients: usize,
    /// Hessian of the Lagrangian.
    pub hessians: usize,
    /// Factorizations of the KKT matrix.
    pub factorizations: usize,
    /// Quadratic programs.
    pub quadratic_programs: usize,
}

/// The last point of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Outcome of the run.
    pub status: Status,
    /// Variables, `[n]`.
    pub x: Vec<f64>,
    /// Objective at `x`; NaN where it has no value.
    pub objective: f64,
    /// Multipliers at `x`; where the problem is infeasible those of the least violation.
    pub multipliers: Multipliers,
    /// Barrier parameter at the end.
    pub barrier: f64,
    /// Scaled KKT error at `x`.
    pub error: f64,
    /// Largest violation of a constraint or bound at `x`, in the unit of that constraint; 0 if none is violated.
    pub violation: f64,
    /// The constraint or bound that is violated most, where that is more than the tolerance of the settings.
    pub worst: Option<Violation>,
    /// The bound that stands most in the way, where the problem is infeasible and a bound does.
    pub blocking: Option<Blocking>,
    /// Iteration table.
    pub iterations: Vec<Iteration>,
    /// Evaluations.
    pub evaluations: Evaluations,
}

impl Solution {
    /// Before any solve.
    pub(super) fn empty() -> Self {
        Self {
            status: Status::Interrupted,
            x: Vec::new(),
            objective: f64::NAN,
            multipliers: Multipliers { constraints: Vec::new(), lower: Vec::new(), upper: Vec::new() },
            barrier: 0.0,
            error: f64::NAN,
            violation: 0.0,
            worst: None,
            blocking: None,
            iterations: Vec::new(),
            evaluations: Evaluations::default(),
        }
    }

    /// The point to continue from.
    pub fn restart(&self) -> Start {
        Start { x: self.x.clone(), multipliers: Some(self.multipliers.clone()), barrier: Some(self.barrier) }
    }
}
