//! Common parts of all factorizations of a symmetric indefinite matrix: pattern, inertia, errors.

/// Numbers of positive, negative and zero eigenvalues.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inertia {
    /// Positive eigenvalues.
    pub positive: usize,
    /// Negative eigenvalues.
    pub negative: usize,
    /// Eigenvalues that are zero to working precision; a factorization with any solves nothing useful.
    pub zero: usize,
}

/// Reason why a pattern cannot be factorized.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PatternError {
    /// An entry lies outside the matrix.
    #[error(
        "entry {entry} of the pattern is ({row}, {column}), but the matrix has {dimension} rows; number rows and columns from 0"
    )]
    Outside {
        /// Position in the list of entries.
        entry: usize,
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
        /// Rows of the matrix.
        dimension: usize,
    },
    /// An entry couples stages that are not neighbors.
    #[error(
        "entry {entry} of the pattern couples row {row} of stage {row_stage} with row {column} of stage {column_stage}; \
         a stage may couple to itself and its neighbors only: merge the stages or leave the stage structure out"
    )]
    Stages {
        /// Position in the list of entries.
        entry: usize,
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
        /// Stage of the row.
        row_stage: usize,
        /// Stage of the column.
        column_stage: usize,
    },
    /// The list of stages has another length than the matrix.
    #[error("{given} stages are given for {dimension} rows; give one stage per row")]
    Length {
        /// Length of the list.
        given: usize,
        /// Rows of the matrix.
        dimension: usize,
    },
}

/// Checks that all entries lie inside a square matrix.
///
/// # Errors
/// [`PatternError::Outside`] names the first entry that does not.
pub fn check_pattern(dimension: usize, entries: &[(usize, usize)]) -> Result<(), PatternError> {
    match entries.iter().position(|&(row, column)| row >= dimension || column >= dimension) {
        None => Ok(()),
        Some(entry) => {
            let (row, column) = entries[entry];
            Err(PatternError::Outside { entry, row, column, dimension })
        }
    }
}
