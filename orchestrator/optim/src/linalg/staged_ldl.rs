//! LDL^T of a symmetric indefinite matrix whose unknowns lie in a chain of stages, each coupled to its neighbors
//! only: one dense front per stage, cost linear in the number of stages.
//!
//! Pivots are chosen within a stage; a row without a stable pivot there is left to the next stage. The inertia is
//! exact up to rounding (Sylvester). A matrix in one stage is a dense Bunch-Kaufman factorization.

use super::front::{Factor, Front};
use super::symmetric::{Inertia, PatternError, check_pattern};

/// Place of one stored entry in the front of its stage.
#[derive(Clone, Copy, Debug)]
struct Place {
    entry: usize,
    row: usize,
    column: usize,
}

#[derive(Debug, Default)]
struct Stage {
    /// Unknowns of the stage, then those of the next stage that it couples to.
    rows: Vec<usize>,
    own: usize,
    /// Position of the latter within the next stage.
    border: Vec<usize>,
    places: Vec<Place>,
}

/// Factorization with fixed pattern; all memory is allocated at the first one.
#[derive(Debug)]
pub struct StagedLdl {
    stages: Vec<Stage>,
    factors: Vec<Factor>,
    front: Front,
    remainder: Vec<f64>,
    delayed: Vec<usize>,
    positions: Vec<usize>,
    local: Vec<f64>,
}

impl StagedLdl {
    /// Prepares for a matrix of `stage_of.len()` rows. `entries` holds one triangle, each entry as (row, column) in
    /// any order; entries that occur several times are added. `stage_of` is the stage of every row, from 0.
    ///
    /// # Errors
    /// [`PatternError`] when an entry lies outside or couples stages that are not neighbors.
    pub fn new(entries: &[(usize, usize)], stage_of: &[usize]) -> Result<Self, PatternError> {
        let dimension = stage_of.len();
        check_pattern(dimension, entries)?;
        let count = stage_of.iter().max().map_or(0, |last| last + 1);
        let mut stages: Vec<Stage> = (0..count).map(|_| Stage::default()).collect();
        let mut position = vec![0; dimension];
        for (unknown, &stage) in stage_of.iter().enumerate() {
            position[unknown] = stages[stage].rows.len();
            stages[stage].rows.push(unknown);
        }
        stages.iter_mut().for_each(|stage| stage.own = stage.rows.len());
        // Position of an unknown in the border of the stage before its own.
        let mut in_border = vec![usize::MAX; dimension];
        for (entry, &(row, column)) in entries.iter().enumerate() {
            let (from, to) = (stage_of[row], stage_of[column]);
            if from.abs_diff(to) > 1 {
                return Err(PatternError::Stages { entry, row, column, row_stage: from, column_stage: to });
            }
            let later = if from > to { row } else { column };
            if from != to && in_border[later] == usize::MAX {
                in_border[later] = 0;
            }
        }
        for k in 1..count {
            let (before, after) = stages.split_at_mut(k);
            let before = &mut before[k - 1];
            for &unknown in &after[0].rows[..after[0].own] {
                if in_border[unknown] == usize::MAX {
                    continue;
                }
                in_border[unknown] = before.rows.len();
                before.rows.push(unknown);
                before.border.push(position[unknown]);
            }
        }
        for (entry, &(row, column)) in entries.iter().enumerate() {
            let stage = stage_of[row].min(stage_of[column]);
            let place = |u: usize| if stage_of[u] == stage { position[u] } else { in_border[u] };
            stages[stage].places.push(Place { entry, row: place(row), column: place(column) });
        }
        let factors = vec![Factor::default(); count];
        let (front, remainder, delayed, positions, local) = Default::default();
        Ok(Self { stages, factors, front, remainder, delayed, positions, local })
    }

    /// Factorizes the matrix whose entries have these values \[entries\], in the order of the pattern; the inertia
    /// counts 1x1 pivots that are zero or NaN as zero.
    pub fn factor(&mut self, values: &[f64]) -> Inertia {
        let mut inertia = Inertia::default();
        self.delayed.clear();
        self.remainder.clear();
        // Rows of the remainder beyond the delayed ones, as positions within the current stage.
        let mut carried: &[usize] = &[];
        let last = self.stages.len().saturating_sub(1);
        for (k, stage) in self.stages.iter().enumerate() {
            let late = self.delayed.len();
            self.front.reset(self.delayed.iter().chain(&stage.rows).copied());
            // Both parts are in ascending order, so that a lower triangle stays one.
            self.positions.clear();
            self.positions.extend((0..late).chain(carried.iter().map(|&i| late + i)));
            let mut from = 0;
            for (column, &at) in self.positions.iter().enumerate() {
                let count = self.positions.len() - column;
                self.front.add_column(at, &self.positions[column..], &self.remainder[from..from + count]);
                from += count;
            }
            for at in &stage.places {
                self.front.add(late + at.row, late + at.column, values[at.entry]);
            }
            let leading = late + stage.own;
            let factor = &mut self.factors[k];
            self.front.eliminate(leading, k == last, factor, &mut inertia);
            self.delayed.clear();
            self.delayed.extend_from_slice(&factor.index[factor.pivots..leading]);
            self.remainder.clear();
            let rows = factor.index.len();
            for column in factor.pivots..rows {
                self.remainder.extend_from_slice(self.front.column(column));
            }
            carried = &stage.border;
        }
        inertia
    }

    /// Solves with the last factorization, in place, `b` `[rows]`.
    pub fn solve(&mut self, b: &mut [f64]) {
        self.factors.iter().for_each(|factor| factor.forward(b, &mut self.local));
        self.factors.iter().rev().for_each(|factor| factor.backward(b, &mut self.local));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform numbers in -1..1, the same in every run.
    fn random() -> impl FnMut() -> f64 {
        let mut state = 88172645463325252u64;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    fn residual(entries: &[(usize, usize)], values: &[f64], x: &[f64], b: &[f64]) -> f64 {
        let mut r = b.to_vec();
        for (&(i, j), v) in entries.iter().zip(values) {
            r[i] -= v * x[j];
            if i != j {
                r[j] -= v * x[i];
            }
        }
        r.iter().fold(0.0, |m, v| m.max(v.abs()))
    }

    /// KKT matrix of a chain: `n` variables and `m` rows per stage, each row reaching into the next stage.
    fn chain(stages: usize, n: usize, m: usize) -> (Vec<(usize, usize)>, Vec<f64>, Vec<usize>) {
        let mut random = random();
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        let width = n + m;
        for k in 0..stages {
            let at = k * width;
            for i in 0..n {
                entries.push((at + i, at + i));
                values.push(3.0 + random());
                for j in 0..i {
                    entries.push((at + i, at + j));
                    values.push(0.2 * random());
                }
            }
            for row in 0..m {
                for j in 0..n {
                    entries.push((at + n + row, at + j));
                    values.push(random());
                    if k + 1 < stages {
                        entries.push((at + n + row, at + width + j));
                        values.push(random());
                    }
                }
            }
        }
        (entries, values, (0..stages * width).map(|i| i / width).collect())
    }

    #[test]
    fn a_chain_of_stages_is_solved_and_its_inertia_counted() {
        let (stages, n, m) = (30, 5, 3);
        let (entries, values, stage_of) = chain(stages, n, m);
        let mut ldl = StagedLdl::new(&entries, &stage_of).unwrap();
        // Positive definite in the variables and rows of full rank: as many negative eigenvalues as rows.
        let expected = Inertia { positive: stages * n, negative: stages * m, zero: 0 };
        for _ in 0..2 {
            assert_eq!(ldl.factor(&values), expected);
            let b: Vec<f64> = (0..stage_of.len()).map(|i| (i as f64).sin()).collect();
            let mut x = b.clone();
            ldl.solve(&mut x);
            assert!(residual(&entries, &values, &x, &b) < 1e-11);
        }
    }

    #[test]
    fn one_stage_and_many_give_the_same_solution() {
        let (entries, values, stage_of) = chain(12, 4, 2);
        let mut chained = StagedLdl::new(&entries, &stage_of).unwrap();
        let mut dense = StagedLdl::new(&entries, &vec![0; stage_of.len()]).unwrap();
        assert_eq!(chained.factor(&values), dense.factor(&values));
        let b: Vec<f64> = (0..stage_of.len()).map(|i| (0.3 * i as f64).cos()).collect();
        let (mut x, mut y) = (b.clone(), b);
        chained.solve(&mut x);
        dense.solve(&mut y);
        let gap = x.iter().zip(&y).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(gap < 1e-11, "{gap}");
    }

    #[test]
    fn rows_without_a_pivot_in_their_stage_wait_for_the_next() {
        // Stage 0 is all zero; only the coupling with stage 1 makes the matrix regular.
        let entries = [(0, 0), (1, 1), (2, 0), (3, 1), (2, 2), (3, 3), (3, 2)];
        let values = [0.0, 0.0, 2.0, -1.0, 1.0, 5.0, 0.5];
        let mut ldl = StagedLdl::new(&entries, &[0, 0, 1, 1]).unwrap();
        assert_eq!(ldl.factor(&values), Inertia { positive: 2, negative: 2, zero: 0 });
        let b = [1.0, 2.0, 3.0, 4.0];
        let mut x = b;
        ldl.solve(&mut x);
        assert!(residual(&entries, &values, &x, &b) < 1e-13);
    }

    #[test]
    fn inertia_of_a_rotated_diagonal_is_that_of_the_diagonal() {
        // A = (I - 2 v v^T) D (I - 2 v v^T), |v| = 1.
        let d: [f64; 6] = [3.0, -2.0, 1e-3, -5.0, 7.0, -0.1];
        let mut v: [f64; 6] = [0.3, -0.5, 0.2, 0.7, -0.1, 0.4];
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.iter_mut().for_each(|x| *x /= norm);
        let q = |i: usize, j: usize| f64::from(u8::from(i == j)) - 2.0 * v[i] * v[j];
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for i in 0..6 {
            for j in 0..=i {
                entries.push((i, j));
                values.push((0..6).map(|k| q(i, k) * d[k] * q(k, j)).sum());
            }
        }
        let mut ldl = StagedLdl::new(&entries, &[0; 6]).unwrap();
        assert_eq!(ldl.factor(&values), Inertia { positive: 3, negative: 3, zero: 0 });
    }

    #[test]
    fn a_singular_matrix_is_seen() {
        let entries = [(0, 0), (1, 0), (1, 1), (2, 2)];
        let mut ldl = StagedLdl::new(&entries, &[0, 0, 1]).unwrap();
        assert_eq!(ldl.factor(&[1.0, 1.0, 1.0, 0.0]).zero, 2);
    }

    #[test]
    fn a_coupling_across_a_stage_is_refused_with_its_rows() {
        let error = StagedLdl::new(&[(0, 0), (2, 0)], &[0, 1, 2]).unwrap_err();
        assert_eq!(
            error,
            PatternError::Stages { entry: 1, row: 2, column: 0, row_stage: 2, column_stage: 0 }
        );
    }
}
