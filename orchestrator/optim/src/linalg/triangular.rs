//! Least squares from a triangular factor that may lack rank.

use nalgebra::{DMatrix, DVector};

use crate::linalg::spectral;

/// Solution x \[n\] of `R x = z` for an upper-triangular R \[n, n\] that may lack rank, and the rank: by singular
/// values of the column-scaled R; those below `tolerance` (relative to the largest) are left out.
pub fn solve(r: &DMatrix<f64>, z: &DVector<f64>, tolerance: f64) -> (DVector<f64>, usize) {
    let scales = column_scales(r);
    let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, j| r[(i, j)] / scales[j]);
    let svd = spectral::svd(scaled, true, true);
    let threshold = tolerance * svd.singular_values.max();
    let rank = svd.rank(threshold);
    let x = svd.solve(z, threshold).unwrap_or_else(|_| DVector::zeros(r.ncols()));
    (x.component_div(&scales), rank)
}

/// Euclidean norms of the columns, shape \[columns\]; 1 for columns of zeros.
pub fn column_scales(r: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(
        r.ncols(),
        r.column_iter().map(|column| Some(column.norm()).filter(|norm| *norm > 0.0).unwrap_or(1.0)),
    )
}

/// `R^-1 R^-T`, the inverse of `R^T R`, shape \[n, n\], and the condition number of the column-scaled R; no inverse if
/// R lacks rank (condition above 1e12).
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

    #[test]
    fn a_rank_deficient_system_has_the_smallest_solution_and_no_covariance() {
        let r = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 0.0]);
        let (x, rank) = solve(&r, &DVector::from_vec(vec![2.0, 0.0]), 1e-10);
        assert!((x - DVector::from_vec(vec![1.0, 1.0])).amax() < 1e-12);
        assert_eq!(rank, 1);
        assert!(covariance(&r).0.is_none());
    }
}
