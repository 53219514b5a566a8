//! Small symmetric positive definite systems without allocation.

use fmi2_export::Scalar;

/// `A = L D L^T` of the leading `n` rows of a matrix, without pivoting.
pub struct Ldl<S, const N: usize> {
    n: usize,
    /// Below the diagonal.
    l: [[S; N]; N],
    d: [S; N],
}

impl<S: Scalar, const N: usize> Ldl<S, N> {
    /// Reads the lower triangle of the leading `n` rows of `a`; gives the row of the first pivot that is not
    /// positive, where there is one.
    pub fn of(a: &[[S; N]; N], n: usize) -> Result<Self, usize> {
        let mut l = [[S::zero(); N]; N];
        let mut d = [S::zero(); N];
        for j in 0..n {
            let mut pivot = a[j][j];
            for k in 0..j {
                pivot -= l[j][k] * l[j][k] * d[k];
            }
            // Relative to the diagonal: what is left of a dependent row is rounding.
            if pivot.value().is_nan() || pivot.value() <= 1e-14 * a[j][j].value().abs() {
                return Err(j);
            }
            d[j] = pivot;
            for i in j + 1..n {
                let mut entry = a[i][j];
                for k in 0..j {
                    entry -= l[i][k] * l[j][k] * d[k];
                }
                l[i][j] = entry / pivot;
            }
        }
        Ok(Self { n, l, d })
    }

    /// Replaces the leading `n` entries of `b` by those of `A^-1 b`.
    pub fn solve(&self, b: &mut [S; N]) {
        for i in 0..self.n {
            for k in 0..i {
                let known = self.l[i][k] * b[k];
                b[i] -= known;
            }
        }
        for i in (0..self.n).rev() {
            b[i] /= self.d[i];
            for k in i + 1..self.n {
                let known = self.l[k][i] * b[k];
                b[i] -= known;
            }
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
        Ldl::of(&a, 3).expect("positive definite").solve(&mut b);
        for (row, right) in a.iter().zip([1.0, -2.0, 0.3]) {
            let left: f64 = row.iter().zip(b).map(|(a, x)| a * x).sum();
            assert!((left - right).abs() < 1e-14);
        }
    }

    #[test]
    fn a_dependent_row_is_named() {
        let a = [[2.0, 2.0], [2.0, 2.0]];
        assert_eq!(Ldl::of(&a, 2).err(), Some(1));
    }
}
