//! Errors in a problem, a start or a setting, found before the first step.

use super::nlp::EvaluationError;
use crate::linalg::symmetric::PatternError;

/// The solver cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A vector of the wrong length.
    #[error("{what} has {given} values, but {expected} are needed")]
    Length {
        /// Name of the vector.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The right one.
        expected: usize,
    },
    /// Bounds that contradict each other, or are NaN.
    #[error("{name}: the lower bound {lower} and the upper bound {upper} leave no value; set lower <= upper")]
    Bounds {
        /// Variable or constraint.
        name: String,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// An entry of the Jacobian or Hessian outside the problem.
    #[error(
        "entry {entry} of the pattern of the {matrix} is ({row}, {column}), outside of [{rows}, {columns}]"
    )]
    Entry {
        /// "Jacobian" or "Hessian".
        matrix: &'static str,
        /// Position in the pattern.
        entry: usize,
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
        /// Rows there are.
        rows: usize,
        /// Columns there are.
        columns: usize,
    },
    /// A pattern that does not fit the stages.
    #[error("KKT matrix (variables, then constraints): {0}")]
    Pattern(#[from] PatternError),
    /// More equations than unknowns.
    #[error(
        "{equalities} equality constraints for {free} variables that are not fixed; \
         remove constraints, or free variables whose bounds are equal"
    )]
    Overdetermined {
        /// Equality constraints.
        equalities: usize,
        /// Variables that are not fixed.
        free: usize,
    },
    /// The start is not a point at which the functions have values.
    #[error("at the start: {0}; give a start at which all functions can be evaluated")]
    Start(EvaluationError),
    /// A setting out of its range.
    #[error("setting `{setting}` is {value}; allowed is {allowed}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// Its range in words.
        allowed: &'static str,
    },
}
