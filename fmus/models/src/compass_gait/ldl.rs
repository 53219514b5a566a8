//! Small symmetric positive definite systems without allocation.

use fmi_export::Scalar;

/// `A = L D L^T` without pivoting.
pub struct Ldl<S, const N: usize> {
    /// `L^T` above the diagonal, the inverse of D on it; below it what the factorization left.
    factors: [[S; N]; N],
}

impl<S: Scalar, const N: usize> Ldl<S, N> {
    /// Of the lower triangle of a matrix; gives the row of the first pivot that is not positive, where there is one.
    // Inlined: the copies of the matrices cost more than a call saves.
    #[inline(always)]
    // An element stands next to its mirror image.
    #[allow(clippy::needless_range_loop)]
    pub fn of(mut f: [[S; N]; N]) -> Result<Self, usize> {
        for j in 0..N {
            // Below the diagonal stands L D, so that each product needs one factor of both.
            let (mut pivot, diagonal) = (f[j][j], f[j][j].value());
            for k in 0..j {
                pivot -= f[j][k] * f[k][j];
            }
            // Relative to the diagonal: the residual of a dependent row is rounding.
            if pivot.value().is_nan() || pivot.value() <= 1e-14 * diagonal.abs() {
                return Err(j);
            }
            let inverse = S::from(1.0) / pivot;
            f[j][j] = inverse;
            for i in j + 1..N {
                let mut entry = f[i][j];
                for k in 0..j {
                    entry -= f[i][k] * f[k][j];
                }
                f[i][j] = entry;
                f[j][i] = entry * inverse;
            }
        }
        Ok(Self { factors: f })
    }

    /// `b <- A^-1 b`.
    pub fn solve(&self, b: &mut [S; N]) {
        let f = &self.factors;
        for k in 0..N {
            let known = b[k];
            for i in k + 1..N {
                b[i] -= f[k][i] * known;
            }
        }
        for i in (0..N).rev() {
            let mut value = b[i] * f[i][i];
            for k in i + 1..N {
                value -= f[i][k] * b[k];
            }
            b[i] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solution_satisfies_the_system() {
        let a = [[4.0, 1.0, -0.5], [1.0, 3.0, 0.2], [-0.5, 0.2, 0.7]];
        let mut b = [1.0, -2.0, 0.3];
        Ldl::of(a).expect("positive definite").solve(&mut b);
        for (row, right) in a.iter().zip([1.0, -2.0, 0.3]) {
            let left: f64 = row.iter().zip(b).map(|(a, x)| a * x).sum();
            assert!((left - right).abs() < 1e-14);
        }
    }

    #[test]
    fn a_dependent_row_is_named() {
        let a = [[2.0, 2.0], [2.0, 2.0]];
        assert_eq!(Ldl::of(a).err(), Some(1));
    }
}
