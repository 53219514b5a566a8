//! Small square matrices without allocation, generic over the scalar, and their principal logarithm.

use fmi_export::Scalar;
use std::ops::Mul;

/// A square matrix of dimension `n <= MAX`; rows first.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<S, const MAX: usize> {
    n: usize,
    a: [[S; MAX]; MAX],
}

/// Reason why there is no principal logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoLogarithm {
    /// The matrix is singular to working precision.
    Singular,
    /// The square roots do not converge: a pole on the negative real axis, or very close to it.
    NoSquareRoot,
}

impl<S: Scalar, const MAX: usize> Matrix<S, MAX> {
    /// All entries zero.
    pub fn zero(n: usize) -> Self {
        assert!(n <= MAX, "matrix of dimension {n}; at most {MAX}");
        Self { n, a: [[S::zero(); MAX]; MAX] }
    }

    /// The identity.
    pub fn identity(n: usize) -> Self {
        let mut m = Self::zero(n);
        for i in 0..n {
            m.a[i][i] = S::from(1.0);
        }
        m
    }

    /// Number of rows.
    pub fn dimension(&self) -> usize {
        self.n
    }

    /// Entry in row `i`, column `j` (0-based).
    pub fn at(&self, i: usize, j: usize) -> S {
        self.a[i][j]
    }

    /// Sets the entry in row `i`, column `j` (0-based).
    pub fn set(&mut self, i: usize, j: usize, value: S) {
        self.a[i][j] = value;
    }

    /// `f · self`.
    pub fn scaled(mut self, f: f64) -> Self {
        self.a.iter_mut().flatten().for_each(|x| *x = *x * f);
        self
    }

    /// `self + f · I`.
    pub fn shifted(mut self, f: f64) -> Self {
        for i in 0..self.n {
            self.a[i][i] = self.a[i][i] + f;
        }
        self
    }

    /// `self + other`.
    pub fn plus(mut self, other: &Self) -> Self {
        for (x, y) in self.a.iter_mut().flatten().zip(other.a.iter().flatten()) {
            *x += *y;
        }
        self
    }

    /// Largest column sum of absolute values.
    pub fn norm1(&self) -> f64 {
        (0..self.n).map(|j| (0..self.n).map(|i| self.a[i][j].value().abs()).sum()).fold(0.0, f64::max)
    }

    /// Sum of the diagonal.
    pub fn trace(&self) -> S {
        (0..self.n).fold(S::zero(), |sum, i| sum + self.a[i][i])
    }

    /// Inverse by Gauss-Jordan elimination in place, with row exchanges; none where a pivot vanishes.
    pub fn inverse(&self) -> Option<Self> {
        let n = self.n;
        let mut m = *self;
        let mut exchanged = [0; MAX];
        for (k, exchanged) in exchanged.iter_mut().enumerate().take(n) {
            let size = |i: &usize| m.a[*i][k].value().abs();
            let p = (k..n).max_by(|i, j| size(i).total_cmp(&size(j)))?;
            if size(&p) < f64::MIN_POSITIVE {
                return None;
            }
            m.a.swap(k, p);
            *exchanged = p;
            let pivot = S::from(1.0) / m.a[k][k];
            m.a[k][k] = S::from(1.0);
            m.a[k].iter_mut().for_each(|x| *x *= pivot);
            let row = m.a[k];
            for i in (0..n).filter(|i| *i != k) {
                let factor = m.a[i][k];
                m.a[i][k] = S::zero();
                add_multiple(&mut m.a[i], -factor, &row);
            }
        }
        for k in (0..n).rev() {
            m.a.iter_mut().for_each(|row| row.swap(k, exchanged[k]));
        }
        Some(m)
    }

    /// Principal square root by the product form of the Denman-Beavers iteration
    /// (Higham, Functions of Matrices, eq. 6.29).
    fn sqrt(&self) -> Result<Self, NoLogarithm> {
        const ITERATIONS: usize = 30; // halves the distance of a pole's angle to 180 degrees each time
        let (mut x, mut m) = (*self, *self);
        let mut converged = false;
        for _ in 0..ITERATIONS {
            let inverse = m.inverse().ok_or(NoLogarithm::Singular)?;
            x = (x * inverse.shifted(1.0)).scaled(0.5);
            m = m.plus(&inverse).scaled(0.5).shifted(1.0).scaled(0.5);
            if converged {
                return Ok(x);
            }
            // The derivative of a dual converges as fast, one step later.
            converged = m.shifted(-1.0).norm1() < 1e-14 * self.n as f64;
        }
        Err(NoLogarithm::NoSquareRoot)
    }

    /// Principal logarithm by inverse scaling and squaring.
    ///
    /// Square roots bring the matrix `R` close to `I`; there
    /// `log R = 2 (W + W³/3 + W⁵/5 + ...)` with `W = (R - I)(R + I)⁻¹`. No eigenvectors are needed, so that
    /// derivatives pass and repeated poles do no harm.
    ///
    /// # Errors
    /// For a matrix with a pole at zero or on the negative real axis.
    pub fn logarithm(&self) -> Result<Self, NoLogarithm> {
        const MAX_DISTANCE_FROM_IDENTITY: f64 = 0.7;
        const MAX_ROOTS: usize = 60;
        let mut root = *self;
        let mut squarings = 0;
        while root.shifted(-1.0).norm1() > MAX_DISTANCE_FROM_IDENTITY {
            if squarings == MAX_ROOTS {
                return Err(NoLogarithm::NoSquareRoot);
            }
            root = root.sqrt()?;
            squarings += 1;
        }
        let w = root.shifted(-1.0) * root.shifted(1.0).inverse().ok_or(NoLogarithm::Singular)?;
        let w2 = w * w;
        let mut power = w;
        let mut sum = w;
        let mut k = 1.0;
        while power.norm1() > 1e-18 * sum.norm1() {
            power = power * w2;
            k += 2.0;
            sum = sum.plus(&power.scaled(1.0 / k));
        }
        Ok(sum.scaled(2.0 * f64::powi(2.0, squarings as i32)))
    }
}

impl<S: Scalar, const MAX: usize> Mul for Matrix<S, MAX> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let mut product = Self::zero(self.n);
        for (row, to) in self.a.iter().zip(&mut product.a).take(self.n) {
            for (factor, from) in row.iter().zip(&other.a).take(self.n) {
                add_multiple(to, *factor, from);
            }
        }
        product
    }
}

/// `row += factor * other`, over the whole width: a loop of fixed length is faster than one to `n`.
#[inline]
fn add_multiple<S: Scalar, const MAX: usize>(row: &mut [S; MAX], factor: S, other: &[S; MAX]) {
    for (x, y) in row.iter_mut().zip(other) {
        *x += factor * *y;
    }
}

/// A complex number: real and imaginary part.
pub type Complex = (f64, f64);

impl<const MAX: usize> Matrix<f64, MAX> {
    /// The values of the leading block of dimension `n`, without derivatives.
    pub fn leading<S: Scalar>(m: &Matrix<S, MAX>, n: usize) -> Self {
        let mut block = Self::zero(n);
        for i in 0..n {
            (0..n).for_each(|j| block.a[i][j] = m.a[i][j].value());
        }
        block
    }

    /// Eigenvalues, for messages and for checks: roots of the characteristic polynomial
    /// (Faddeev-LeVerrier, then Durand-Kerner). Those of multiplicity m are exact to about `ε^(1/m)`.
    pub fn poles(&self) -> Vec<Complex> {
        let n = self.n;
        let radius = self.norm1().max(f64::MIN_POSITIVE);
        let a = self.scaled(1.0 / radius);
        // p(λ) = λⁿ + c[1] λⁿ⁻¹ + ... + c[n]
        let mut c = vec![1.0];
        let mut m = Self::identity(n);
        for k in 1..=n {
            let product = a * m;
            let next = -product.trace() / k as f64;
            c.push(next);
            m = product.shifted(next);
        }
        // Coefficients that are rounding only: poles at zero, which no iteration would hit exactly.
        let degree = (1..=n).rev().find(|k| c[*k].abs() > 1e-15).unwrap_or(0);
        let mut poles = roots(&c[..=degree]);
        poles.resize(n, (0.0, 0.0));
        poles.iter_mut().for_each(|p| *p = (p.0 * radius, p.1 * radius));
        poles
    }
}

/// Roots of the monic polynomial `c[0] λⁿ + ... + c[n]`, `c[0] = 1`, by the Durand-Kerner iteration.
fn roots(c: &[f64]) -> Vec<Complex> {
    let n = c.len() - 1;
    let mul = |a: Complex, b: Complex| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let div = |a: Complex, b: Complex| {
        let d = (b.0 * b.0 + b.1 * b.1).max(f64::MIN_POSITIVE);
        ((a.0 * b.0 + a.1 * b.1) / d, (a.1 * b.0 - a.0 * b.1) / d)
    };
    let sub = |a: Complex, b: Complex| (a.0 - b.0, a.1 - b.1);
    let mut roots: Vec<Complex> = Vec::with_capacity(n);
    let mut next = (1.0, 0.0);
    for _ in 0..n {
        roots.push(next);
        next = mul(next, (0.4, 0.9));
    }
    for _ in 0..500 {
        let mut moved: f64 = 0.0;
        for i in 0..n {
            let x = roots[i];
            let value = c[1..].iter().fold((1.0, 0.0), |p, c| {
                let p = mul(p, x);
                (p.0 + c, p.1)
            });
            let others = (0..n).filter(|j| *j != i).fold((1.0, 0.0), |p, j| mul(p, sub(x, roots[j])));
            let step = div(value, others);
            roots[i] = sub(x, step);
            moved = moved.max(step.0.abs().max(step.1.abs()));
        }
        if moved < 1e-15 {
            break;
        }
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Dual;

    const MAX: usize = 5;

    fn matrix(rows: &[&[f64]]) -> Matrix<f64, MAX> {
        let mut m = Matrix::zero(rows.len());
        for (i, row) in rows.iter().enumerate() {
            row.iter().enumerate().for_each(|(j, x)| m.set(i, j, *x));
        }
        m
    }

    /// Taylor series after scaling: another route than the logarithm.
    fn exponential(a: Matrix<f64, MAX>) -> Matrix<f64, MAX> {
        let a = a.scaled(1.0 / 1024.0);
        let mut term = Matrix::identity(a.n);
        let mut sum = term;
        for k in 1..20 {
            term = (term * a).scaled(1.0 / f64::from(k));
            sum = sum.plus(&term);
        }
        (0..10).fold(sum, |m, _| m * m)
    }

    #[test]
    fn exponential_of_the_logarithm_is_the_matrix() {
        for a in [
            matrix(&[&[1.0144, -0.0216], &[0.0527, 0.9537]]),
            matrix(&[&[0.1, 1.0, 0.0], &[-0.3, 0.2, 1.0], &[0.05, 0.0, 0.4]]),
            matrix(&[&[1.0, 1.0], &[0.0, 1.0]]),    // a double pole at 1
            matrix(&[&[-0.2, -3.0], &[3.0, -0.2]]), // poles near the negative axis
        ] {
            let back = exponential(a.logarithm().expect("no pole on the negative real axis"));
            assert!(back.plus(&a.scaled(-1.0)).norm1() < 1e-12, "{a:?} {back:?}");
        }
    }

    #[test]
    fn no_logarithm_on_the_negative_axis_or_at_zero() {
        assert!(matrix(&[&[-0.5, 0.0], &[0.0, 0.5]]).logarithm().is_err());
        assert!(matrix(&[&[0.5, 0.0], &[0.0, 0.0]]).logarithm().is_err());
    }

    #[test]
    fn derivative_of_the_logarithm_agrees_with_a_difference() {
        let a = matrix(&[&[0.9, -0.2, 0.1], &[0.3, 0.8, 0.0], &[0.0, 0.1, 0.4]]);
        let mut dual = Matrix::<Dual, MAX>::zero(3);
        for i in 0..3 {
            (0..3).for_each(|j| dual.set(i, j, Dual::new(a.at(i, j), f64::from(u8::from((i, j) == (1, 2))))));
        }
        let exact = dual.logarithm().expect("poles in the right half plane");
        let shifted = |d: f64| {
            let mut b = a;
            b.set(1, 2, d);
            b.logarithm().expect("poles in the right half plane")
        };
        let h = 1e-5; // truncation 1e-10, rounding 1e-11
        let difference = shifted(h).plus(&shifted(-h).scaled(-1.0)).scaled(0.5 / h);
        for i in 0..3 {
            for j in 0..3 {
                assert!((exact.at(i, j).eps[0] - difference.at(i, j)).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn poles_of_a_block_triangular_matrix_are_those_of_its_blocks() {
        let a = matrix(&[
            &[0.5, -0.4, 7.0, 1.0],
            &[0.4, 0.5, 2.0, 0.0],
            &[0.0, 0.0, -0.3, 5.0],
            &[0.0, 0.0, 0.0, 0.0],
        ]);
        for expected in [(0.5, 0.4), (0.5, -0.4), (-0.3, 0.0), (0.0, 0.0)] {
            let hit = a.poles().iter().any(|p| (p.0 - expected.0).hypot(p.1 - expected.1) < 1e-12);
            assert!(hit, "{expected:?} is not in {:?}", a.poles());
        }
    }
}
