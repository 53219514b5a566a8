//! Small dense matrices, row by row in slices, without allocation: LU with row exchange, and the exponential.

/// Factors the `n` by `n` matrix in place; false if it is singular to working precision.
pub(super) fn factor(a: &mut [f64], pivots: &mut [usize], n: usize) -> bool {
    for k in 0..n {
        let mut pivot = k;
        for row in k + 1..n {
            if a[row * n + k].abs() > a[pivot * n + k].abs() {
                pivot = row;
            }
        }
        pivots[k] = pivot;
        let size = a[pivot * n + k];
        if size == 0.0 || !size.is_finite() {
            return false;
        }
        if pivot != k {
            for column in 0..n {
                a.swap(k * n + column, pivot * n + column);
            }
        }
        for row in k + 1..n {
            let factor = a[row * n + k] / size;
            a[row * n + k] = factor;
            if factor != 0.0 {
                for column in k + 1..n {
                    a[row * n + column] -= factor * a[k * n + column];
                }
            }
        }
    }
    true
}

/// Solves with the factors of [`factor`]: `b` holds `columns` right-hand sides, row by row.
pub(super) fn solve(lu: &[f64], pivots: &[usize], n: usize, b: &mut [f64], columns: usize) {
    for k in 0..n {
        if pivots[k] != k {
            for c in 0..columns {
                b.swap(k * columns + c, pivots[k] * columns + c);
            }
        }
    }
    for row in 0..n {
        for k in 0..row {
            let factor = lu[row * n + k];
            for c in 0..columns {
                b[row * columns + c] -= factor * b[k * columns + c];
            }
        }
    }
    for row in (0..n).rev() {
        for k in row + 1..n {
            let factor = lu[row * n + k];
            for c in 0..columns {
                b[row * columns + c] -= factor * b[k * columns + c];
            }
        }
        for c in 0..columns {
            b[row * columns + c] /= lu[row * n + row];
        }
    }
}

/// A matrix, its exponential, and room to compute it.
#[derive(Debug)]
pub(super) struct Exponential {
    n: usize,
    /// The matrix on entry; scaled afterwards.
    pub matrix: Vec<f64>,
    /// The exponential.
    pub result: Vec<f64>,
    product: Vec<f64>,
}

/// Terms of the Taylor series; with a norm of at most 1/2 the rest is below rounding.
const TERMS: usize = 14;

impl Exponential {
    pub fn new(n: usize) -> Exponential {
        Exponential { n, matrix: vec![0.0; n * n], result: vec![0.0; n * n], product: vec![0.0; n * n] }
    }

    /// `result = exp(matrix)` by scaling and squaring.
    pub fn compute(&mut self) {
        let n = self.n;
        let norm = (0..n)
            .map(|row| self.matrix[row * n..(row + 1) * n].iter().map(|a| a.abs()).sum::<f64>())
            .fold(0.0, f64::max);
        let squarings = if norm > 0.5 && norm.is_finite() { (2.0 * norm).log2().ceil() as i32 } else { 0 };
        let scale = 0.5f64.powi(squarings);
        self.matrix.iter_mut().for_each(|a| *a *= scale);
        identity(&mut self.result, n);
        for k in (1..=TERMS).rev() {
            multiply(&self.matrix, &self.result, &mut self.product, n);
            for (index, value) in self.product.iter().enumerate() {
                let diagonal = if index % (n + 1) == 0 { 1.0 } else { 0.0 };
                self.result[index] = diagonal + value / k as f64;
            }
        }
        for _ in 0..squarings {
            multiply(&self.result, &self.result, &mut self.product, n);
            self.result.copy_from_slice(&self.product);
        }
    }
}

fn identity(a: &mut [f64], n: usize) {
    a.fill(0.0);
    (0..n).for_each(|k| a[k * n + k] = 1.0);
}

fn multiply(a: &[f64], b: &[f64], out: &mut [f64], n: usize) {
    for row in 0..n {
        for column in 0..n {
            out[row * n + column] = (0..n).map(|k| a[row * n + k] * b[k * n + column]).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_needs_row_exchange_is_solved() {
        let a = [0.0, 2.0, 1.0, 1.0, -1.0, 0.5, 3.0, 0.0, 1.0];
        let x = [1.0, -2.0, 4.0];
        let mut b: Vec<f64> = (0..3).map(|row| (0..3).map(|k| a[row * 3 + k] * x[k]).sum()).collect();
        let (mut lu, mut pivots) = (a, [0; 3]);
        assert!(factor(&mut lu, &mut pivots, 3));
        solve(&lu, &pivots, 3, &mut b, 1);
        assert!(b.iter().zip(x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
        assert!(!factor(&mut [1.0, 2.0, 2.0, 4.0], &mut [0; 2], 2));
    }

    #[test]
    fn the_exponential_of_a_rotation_is_sine_and_cosine() {
        let mut exponential = Exponential::new(2);
        exponential.matrix.copy_from_slice(&[0.0, -7.0, 7.0, 0.0]);
        exponential.compute();
        let (s, c) = 7f64.sin_cos();
        for (value, expected) in exponential.result.iter().zip([c, -s, s, c]) {
            assert!((value - expected).abs() < 1e-13);
        }
    }

    #[test]
    fn the_exponential_of_a_chain_is_the_powers_of_time() {
        let mut exponential = Exponential::new(3);
        exponential.matrix.copy_from_slice(&[-1e4, 1.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0]);
        exponential.compute();
        assert!((exponential.result[5] - 3.0).abs() < 1e-11);
        assert!((exponential.result[1] - 1e-4).abs() < 1e-14);
    }
}
