//! LDL^T of a sparse symmetric matrix without a known structure: QDLDL of crate `clarabel`, ordered by approximate
//! minimum degree. Pivots are not exchanged; the caller refines the solution and regularizes where a pivot vanishes.

use clarabel::algebra::CscMatrix;
use clarabel::qdldl::{QDLDLFactorisation, QDLDLSettings};

use super::symmetric::{Inertia, PatternError, check_pattern};

/// Factorization with fixed pattern.
#[derive(Debug)]
pub struct SparseLdl {
    matrix: CscMatrix<f64>,
    /// Place of every given entry in the matrix.
    place: Vec<usize>,
    positions: Vec<usize>,
    factor: Option<QDLDLFactorisation<f64>>,
}

impl SparseLdl {
    /// Prepares for a matrix of `dimension` rows; `entries` as for [`super::staged_ldl::StagedLdl::new`].
    ///
    /// # Errors
    /// [`PatternError::Outside`] when an entry lies outside.
    pub fn new(entries: &[(usize, usize)], dimension: usize) -> Result<Self, PatternError> {
        check_pattern(dimension, entries)?;
        let mut upper: Vec<(usize, usize)> = entries.iter().map(|&(i, j)| (i.max(j), i.min(j))).collect();
        // The factorization needs every diagonal entry.
        upper.extend((0..dimension).map(|i| (i, i)));
        upper.sort_unstable();
        upper.dedup();
        let mut columns = vec![0; dimension + 1];
        upper.iter().for_each(|&(column, _)| columns[column + 1] += 1);
        (0..dimension).for_each(|i| columns[i + 1] += columns[i]);
        let rows = upper.iter().map(|&(_, row)| row).collect();
        let place =
            entries.iter().filter_map(|&(i, j)| upper.binary_search(&(i.max(j), i.min(j))).ok()).collect();
        let count = upper.len();
        let matrix = CscMatrix::new(dimension, dimension, columns, rows, vec![0.0; count]);
        Ok(Self { matrix, place, positions: (0..count).collect(), factor: None })
    }

    /// Factorizes the matrix whose entries have these values \[entries\], in the order of the pattern. A vanishing
    /// pivot makes the matrix count as singular altogether.
    pub fn factor(&mut self, values: &[f64]) -> Inertia {
        self.matrix.nzval.fill(0.0);
        self.place.iter().zip(values).for_each(|(&place, value)| self.matrix.nzval[place] += value);
        let done = match &mut self.factor {
            Some(factor) => {
                factor.update_values(&self.positions, &self.matrix.nzval);
                factor.refactor().is_ok()
            }
            None => {
                let settings = QDLDLSettings { regularize_enable: false, ..QDLDLSettings::default() };
                self.factor = QDLDLFactorisation::new(&self.matrix, Some(settings)).ok();
                self.factor.is_some()
            }
        };
        match &self.factor {
            Some(factor) if done && factor.D.iter().all(|d| d.is_finite() && *d != 0.0) => {
                let positive = factor.D.iter().filter(|&&d| d > 0.0).count();
                Inertia { positive, negative: self.matrix.n - positive, zero: 0 }
            }
            _ => Inertia { zero: self.matrix.n, ..Inertia::default() },
        }
    }

    /// Solves with the last factorization, in place, for a right-hand side `b` \[dimension\]; leaves `b` as it is when
    /// that one was singular.
    pub fn solve(&mut self, b: &mut [f64]) {
        if let Some(factor) = &mut self.factor {
            factor.solve(b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quasidefinite_matrix_is_solved_and_refactored() {
        // [[4, 1, 1], [1, 3, 0], [1, 0, -2]] x = b, one entry given in two parts.
        let entries = [(0, 0), (1, 0), (2, 0), (1, 1), (2, 2), (1, 1)];
        let mut ldl = SparseLdl::new(&entries, 3).unwrap();
        for scale in [1.0, 2.0] {
            let values = [4.0, 1.0, 1.0, 1.0, -2.0, 2.0].map(|v| v * scale);
            assert_eq!(ldl.factor(&values), Inertia { positive: 2, negative: 1, zero: 0 });
            // b = A [1, -1, 2]
            let mut b = [5.0, -2.0, -3.0].map(|v| v * scale);
            ldl.solve(&mut b);
            for (found, exact) in b.iter().zip([1.0, -1.0, 2.0]) {
                assert!((found - exact).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_vanishing_pivot_counts_as_singular() {
        let mut ldl = SparseLdl::new(&[(0, 0), (1, 1)], 2).unwrap();
        assert_eq!(ldl.factor(&[1.0, 0.0]).zero, 2);
        assert_eq!(ldl.factor(&[1.0, 3.0]), Inertia { positive: 2, negative: 0, zero: 0 });
    }
}
