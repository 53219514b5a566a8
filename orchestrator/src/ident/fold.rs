//! Least squares on tall matrices: rows are folded block by block into an upper-triangular factor.
//!
//! Holds one block of rows and the factor, whatever the number of rows; never forms normal equations.

use nalgebra::{DMatrix, DVector};

use crate::linalg::spectral;

/// Rows of a block: with some tens of columns it stays in the second-level cache.
pub const BLOCK: usize = 192;

/// The factor R of a QR factorisation of rows that come one block after another.
#[derive(Debug, Clone)]
pub struct Fold {
    columns: usize,
    /// Upper triangle, column-major, shape \[columns, columns\].
    factor: Vec<f64>,
    /// Rows that wait, column-major with `BLOCK` rows.
    block: Vec<f64>,
    filled: usize,
}

impl Fold {
    /// A factor of no rows.
    pub fn new(columns: usize) -> Fold {
        Fold { columns, factor: vec![0.0; columns * columns], block: vec![0.0; columns * BLOCK], filled: 0 }
    }

    /// Rows that can be written before the next [`Fold::commit`]; at least `rows`, which is at most [`BLOCK`].
    pub fn room(&mut self, rows: usize) -> usize {
        if BLOCK - self.filled < rows {
            self.eliminate();
        }
        BLOCK - self.filled
    }

    /// The next `rows` entries of a column, to be written; `rows` is at most [`Fold::room`].
    pub fn column(&mut self, column: usize, rows: usize) -> &mut [f64] {
        let first = column * BLOCK + self.filled;
        &mut self.block[first..first + rows]
    }

    /// Takes the `rows` that were written into every column.
    pub fn commit(&mut self, rows: usize) {
        self.filled += rows;
        if self.filled == BLOCK {
            self.eliminate();
        }
    }

    /// Takes the rows of a matrix with as many columns.
    pub fn push(&mut self, rows: &DMatrix<f64>) {
        for row in rows.row_iter() {
            for (column, value) in row.iter().enumerate() {
                self.column(column, 1)[0] = *value;
            }
            self.commit(1);
        }
    }

    /// The upper-triangular factor of all rows, shape \[columns, columns\].
    pub fn finish(mut self) -> DMatrix<f64> {
        self.eliminate();
        DMatrix::from_vec(self.columns, self.columns, self.factor)
    }

    /// Householder reflections that bring the block to zero, column by column.
    fn eliminate(&mut self) {
        let (n, m) = (self.columns, self.filled);
        for j in 0..n {
            let (reflected, later) = self.block.split_at_mut((j + 1) * BLOCK);
            let v = &reflected[j * BLOCK..j * BLOCK + m];
            let below = dot(v, v);
            if below == 0.0 {
                continue;
            }
            let diagonal = self.factor[j * n + j];
            let norm = (diagonal * diagonal + below).sqrt();
            let new = if diagonal > 0.0 { -norm } else { norm };
            let head = diagonal - new;
            let scale = 2.0 / (head * head + below);
            self.factor[j * n + j] = new;
            for c in j + 1..n {
                let column = &mut later[(c - j - 1) * BLOCK..(c - j - 1) * BLOCK + m];
                let top = &mut self.factor[c * n + j];
                let weight = scale * (head * *top + dot(v, column));
                *top -= weight * head;
                column.iter_mut().zip(v).for_each(|(value, v)| *value -= weight * v);
            }
        }
        self.filled = 0;
    }
}

/// Scalar product with independent partial sums, which the compiler can keep in vector registers.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_blocks, b_blocks) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_blocks.zip(b_blocks) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    rest + sums.iter().sum::<f64>()
}

/// Solution of `R x = z` for a square upper-triangular R that may lack rank: by singular values of the column-scaled R,
/// those below `tolerance` times the largest are left out. Also the rank.
pub fn solve(r: &DMatrix<f64>, z: &DVector<f64>, tolerance: f64) -> (DVector<f64>, usize) {
    let scales = column_scales(r);
    let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, j| r[(i, j)] / scales[j]);
    let svd = spectral::svd(scaled, true, true);
    let threshold = tolerance * svd.singular_values.max();
    let rank = svd.rank(threshold);
    let x = svd.solve(z, threshold).unwrap_or_else(|_| DVector::zeros(r.ncols()));
    (x.component_div(&scales), rank)
}

/// Norms of the columns, 1 for columns of zeros.
pub fn column_scales(r: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(
        r.ncols(),
        r.column_iter().map(|column| Some(column.norm()).filter(|norm| *norm > 0.0).unwrap_or(1.0)),
    )
}

/// `R^-1 R^-T`, the inverse of `R^T R`, and the condition number of the column-scaled R; no inverse if R lacks rank.
pub fn covariance(r: &DMatrix<f64>) -> (Option<DMatrix<f64>>, f64) {
    let n = r.ncols();
    if n == 0 {
        return (Some(DMatrix::zeros(0, 0)), 1.0);
    }
    let scales = column_scales(r);
    let scaled = DMatrix::from_fn(n, n, |i, j| r[(i, j)] / scales[j]);
    let values = spectral::singular_values(scaled.clone());
    let condition = values.max() / values.min();
    if !condition.is_finite() || condition > 1e12 {
        return (None, condition);
    }
    let inverse = scaled.solve_upper_triangular(&DMatrix::identity(n, n));
    let product = inverse.map(|inverse| {
        let p = &inverse * inverse.transpose();
        DMatrix::from_fn(n, n, |i, j| p[(i, j)] / (scales[i] * scales[j]))
    });
    (product, condition)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    #[test]
    fn the_factor_has_the_scalar_products_of_the_columns() {
        let mut seed = 1;
        let rows = DMatrix::from_fn(1000, 5, |_, _| noise(&mut seed));
        let mut fold = Fold::new(5);
        fold.push(&rows);
        let r = fold.finish();
        assert!((r.transpose() * &r - rows.transpose() * &rows).amax() < 1e-11);
        assert_eq!(r.lower_triangle() - DMatrix::from_diagonal(&r.diagonal()), DMatrix::zeros(5, 5));
    }

    #[test]
    fn a_rank_deficient_system_has_the_smallest_solution_and_no_covariance() {
        let r = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 0.0]);
        let (x, rank) = solve(&r, &DVector::from_vec(vec![2.0, 0.0]), 1e-10);
        assert!((x - DVector::from_vec(vec![1.0, 1.0])).amax() < 1e-12);
        assert_eq!(rank, 1);
        assert!(covariance(&r).0.is_none());
    }
}
