//! Singular values and eigenvalues by iterations that always end.
//!
//! nalgebra's iterations have no limit and, rarely, never end: the QR iteration of its singular values on
//! matrices with a wide range of scales, that of its Schur form on cyclic matrices. Here they are limited; what they
//! leave is done by one-sided Jacobi rotations, or on another basis.

use nalgebra::{Complex, DMatrix, DVector, Dyn, SVD, Schur};

/// Iterations of nalgebra per row or column; two are usual.
const ITERATIONS: usize = 6;
/// Sweeps of Jacobi rotations; ten are usual.
const SWEEPS: usize = 60;

/// Singular value decomposition of a matrix \[m, n\], singular values descending. Left (`u`) and right vectors (`v`)
/// only where asked for; the vectors of a singular value of zero may be zero. A matrix that is not finite gives NaN.
pub fn svd(matrix: DMatrix<f64>, u: bool, v: bool) -> SVD<f64, Dyn, Dyn> {
    let limit = ITERATIONS * matrix.nrows().min(matrix.ncols()) + 50;
    let finite = matrix.iter().all(|value| value.is_finite());
    let quick = if finite && !matrix.is_empty() {
        SVD::try_new(matrix.clone(), u, v, 5.0 * f64::EPSILON, limit)
    } else {
        None
    };
    quick.unwrap_or_else(|| jacobi(matrix, u, v))
}

/// Singular values of a matrix \[m, n\], descending, shape \[min(m, n)\]; NaN if the matrix is not finite.
pub fn singular_values(matrix: DMatrix<f64>) -> DVector<f64> {
    svd(matrix, false, false).singular_values
}

/// One-sided Jacobi rotations (Hestenes) on the columns of the taller of the matrix and its transpose.
fn jacobi(matrix: DMatrix<f64>, with_u: bool, with_v: bool) -> SVD<f64, Dyn, Dyn> {
    let wide = matrix.nrows() < matrix.ncols();
    let mut columns = if wide { matrix.transpose() } else { matrix };
    let n = columns.ncols();
    let mut v = DMatrix::<f64>::identity(n, n);
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let (alpha, beta) = (columns.column(p).norm_squared(), columns.column(q).norm_squared());
                let gamma = columns.column(p).dot(&columns.column(q));
                if gamma.abs() > f64::EPSILON * alpha.sqrt() * beta.sqrt() {
                    rotated = true;
                    let zeta = (beta - alpha) / (2.0 * gamma);
                    let t = zeta.signum() / (zeta.abs() + 1f64.hypot(zeta));
                    let c = 1.0 / 1f64.hypot(t);
                    rotate(&mut columns, (p, q), (c, c * t));
                    rotate(&mut v, (p, q), (c, c * t));
                }
            }
        }
        if !rotated {
            break;
        }
    }
    let norms: Vec<f64> = columns.column_iter().map(|column| column.norm()).collect();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| norms[j].total_cmp(&norms[i]));
    let values = DVector::from_iterator(n, order.iter().map(|&k| norms[k]));
    let left = DMatrix::from_fn(columns.nrows(), n, |row, k| {
        let norm = norms[order[k]];
        if norm > 0.0 { columns[(row, order[k])] / norm } else { 0.0 }
    });
    let right = DMatrix::from_fn(n, n, |row, k| v[(row, order[k])]);
    let (u, v) = if wide { (right, left) } else { (left, right) };
    SVD { u: with_u.then_some(u), v_t: with_v.then(|| v.transpose()), singular_values: values }
}

/// Columns p and q turned by a rotation of cosine c and sine s.
fn rotate(matrix: &mut DMatrix<f64>, (p, q): (usize, usize), (c, s): (f64, f64)) {
    for row in 0..matrix.nrows() {
        let (a, b) = (matrix[(row, p)], matrix[(row, q)]);
        matrix[(row, p)] = c * a - s * b;
        matrix[(row, q)] = s * a + c * b;
    }
}

/// Eigenvalues of a square matrix \[n, n\], shape \[n\], in no particular order. NaN if the matrix is not finite.
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let n = matrix.nrows();
    if matrix.iter().all(|value| value.is_finite()) {
        let mut turned = matrix.clone();
        for attempt in 0..8 {
            if let Some(schur) = Schur::try_new(turned.clone(), f64::EPSILON, 100 * n + 100) {
                return schur.complex_eigenvalues().iter().copied().collect();
            }
            turned = reflected(&turned, attempt);
        }
    }
    vec![Complex::new(f64::NAN, f64::NAN); n]
}

/// The same eigenvalues on another basis: a reflection along a fixed direction for each attempt.
fn reflected(matrix: &DMatrix<f64>, attempt: usize) -> DMatrix<f64> {
    let n = matrix.nrows();
    let direction = DVector::from_fn(n, |row, _| (1.0 + row as f64 * (1.0 + attempt as f64 * 0.37)).sin());
    let direction = direction.normalize();
    let reflection = DMatrix::identity(n, n) - 2.0 * &direction * direction.transpose();
    &reflection * matrix * &reflection
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1 that are not the same from place to place.
    fn scattered(rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, j| {
            ((i * 37 + j * 101 + 13) as f64 * 0.618_033_988_75).fract() * 2.0 - 1.0
        })
    }

    fn rebuilt(svd: &SVD<f64, Dyn, Dyn>) -> DMatrix<f64> {
        svd.u.as_ref().unwrap() * DMatrix::from_diagonal(&svd.singular_values) * svd.v_t.as_ref().unwrap()
    }

    #[test]
    fn rotations_agree_with_the_iteration_on_tall_and_wide_matrices() {
        for (rows, columns) in [(7, 4), (4, 7), (6, 6), (1, 3), (3, 1)] {
            let matrix = scattered(rows, columns);
            let found = jacobi(matrix.clone(), true, true);
            let expected = svd(matrix.clone(), true, true);
            assert!((&found.singular_values - &expected.singular_values).amax() < 1e-13);
            assert!(
                (rebuilt(&found) - &matrix).amax() < 1e-13 && (rebuilt(&expected) - &matrix).amax() < 1e-13
            );
        }
    }

    #[test]
    fn scales_apart_by_many_decades_are_decomposed_too() {
        let n = 40;
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            if i <= j { scattered(n, n)[(i, j)] * 10f64.powi(-(i as i32)) } else { 0.0 }
        });
        let found = svd(matrix.clone(), true, true);
        assert!((rebuilt(&found) - &matrix).amax() < 1e-13);
        let turned = jacobi(matrix.clone(), true, true);
        assert!((rebuilt(&turned) - &matrix).amax() < 1e-13);
    }

    #[test]
    fn what_is_not_finite_ends_too() {
        let matrix = DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, 0.0, 1.0]);
        assert!(singular_values(matrix.clone()).iter().any(|value| value.is_nan()));
        assert!(eigenvalues(&matrix).iter().all(|value| value.re.is_nan()));
    }

    #[test]
    fn the_roots_of_unity_are_the_eigenvalues_of_a_cycle() {
        let n = 12;
        let cycle = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from((i + 1) % n == j)));
        let found = eigenvalues(&cycle);
        for k in 0..n {
            let angle = 2.0 * std::f64::consts::PI * k as f64 / n as f64;
            let root = Complex::new(angle.cos(), angle.sin());
            let nearest = found.iter().map(|value| (value - root).norm()).fold(f64::MAX, f64::min);
            assert!(nearest < 1e-12, "{root}: {nearest:e}");
        }
    }
}
