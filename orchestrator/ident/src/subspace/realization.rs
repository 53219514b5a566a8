//! A and C from the extended observability matrix or from the states, and the remedy for unstable poles.

use nalgebra::DMatrix;

use airloop_optim::linalg::spectral;

use super::hankel::HankelFactor;
use super::projection::{Projection, pseudo_inverse};

/// Method by which A and C are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Realization {
    /// Shift invariance of the extended observability matrix.
    Shift,
    /// Regression of next state and output on state and input.
    States,
}

impl Realization {
    /// Both of them.
    pub const ALL: [Realization; 2] = [Realization::Shift, Realization::States];
}

/// A and C of order n.
pub(super) fn realize(
    factor: &HankelFactor,
    projection: &Projection,
    realization: Realization,
    n: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let n_y = factor.n_y;
    match realization {
        Realization::Shift => {
            let gamma = projection.observability(n);
            let rows = gamma.nrows() - n_y;
            let a = pseudo_inverse(gamma.rows(0, rows).into_owned()) * gamma.rows(n_y, rows);
            (a, gamma.rows(0, n_y).into_owned())
        }
        Realization::States => {
            let steps = factor.steps();
            let state = projection.state_from_past(n).transpose();
            let n_u = factor.n_u;
            let mut regressor = DMatrix::zeros(steps.past.nrows(), n + n_u);
            regressor.columns_mut(0, n).copy_from(&(&steps.past * &state));
            regressor.columns_mut(n, n_u).copy_from(&steps.u);
            let inverse = pseudo_inverse(regressor);
            let next = &inverse * (&steps.later * &state);
            let output = &inverse * &steps.y;
            (next.rows(0, n).transpose(), output.rows(0, n).transpose())
        }
    }
}

/// Largest modulus of the poles.
pub(super) fn spectral_radius(a: &DMatrix<f64>) -> f64 {
    spectral::eigenvalues(a).iter().map(|pole| pole.norm()).fold(0.0, f64::max)
}

/// A with the poles outside the unit circle mirrored at it (to `1 / conj(z)`), in the real Schur form; poles next to
/// the circle come to rest at modulus 0.9999. `None` if the Schur form does not converge.
pub(super) fn stabilized(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    const MAX_MODULUS: f64 = 0.9999;
    let (q, mut t) = nalgebra::Schur::try_new(a.clone(), f64::EPSILON, 10_000)?.unpack();
    let n = t.nrows();
    let mut k = 0;
    while k < n {
        let size = if k + 1 < n && t[(k + 1, k)] != 0.0 { 2 } else { 1 };
        let radius = spectral_radius(&t.view((k, k), (size, size)).into_owned());
        if radius > MAX_MODULUS {
            let factor = (1.0 / radius).min(MAX_MODULUS) / radius;
            t.view_mut((k, k), (size, size)).scale_mut(factor);
        }
        k += size;
    }
    Some(&q * t * q.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_outside_the_circle_are_mirrored_and_others_stay() {
        // Poles 1.25, 0.5 and 1.1 exp(+-0.3i), mixed by a rotation.
        let (s, c) = 0.3f64.sin_cos();
        let diagonal = DMatrix::from_row_slice(
            4,
            4,
            &[
                1.25,
                0.2,
                0.0,
                0.3,
                0.0,
                0.5,
                0.1,
                0.0,
                0.0,
                0.0,
                1.1 * c,
                1.1 * s,
                0.0,
                0.0,
                -1.1 * s,
                1.1 * c,
            ],
        );
        let turn = DMatrix::from_fn(4, 4, |i, j| ((i * 4 + j) as f64).sin()).qr().q();
        let mended = stabilized(&(&turn * diagonal * turn.transpose())).unwrap();
        let mut moduli: Vec<f64> = spectral::eigenvalues(&mended).iter().map(|pole| pole.norm()).collect();
        moduli.sort_by(f64::total_cmp);
        for (found, expected) in moduli.iter().zip([0.5, 0.8, 1.0 / 1.1, 1.0 / 1.1]) {
            assert!((found - expected).abs() < 1e-12, "{moduli:?}");
        }
    }
}
