//! Discrete algebraic Riccati equation of the Kalman predictor.

use nalgebra::DMatrix;

use airloop_optim::linalg::spectral;

/// Covariances of process noise Q, measurement noise R and between them S (rows: states).
pub(super) struct Noise {
    pub q: DMatrix<f64>,
    pub s: DMatrix<f64>,
    pub r: DMatrix<f64>,
}

/// Gain `K = (A P C' + S) (C P C' + R)^-1` with the stabilizing solution of
/// `P = A P A' + Q - (A P C' + S) (C P C' + R)^-1 (A P C' + S)'`, by the structure-preserving doubling algorithm
/// (Chu, Fan, Lin and Wang, Int. J. Control 77, 2004). `None` if it does not converge to a stable predictor.
pub(super) fn kalman_gain(a: &DMatrix<f64>, c: &DMatrix<f64>, noise: &Noise) -> Option<DMatrix<f64>> {
    let n = a.nrows();
    let unit = DMatrix::<f64>::identity(n, n);
    let r_inverse = noise.r.clone().cholesky()?.inverse();
    // The cross term goes into A and Q.
    let mut left = (a - &noise.s * &r_inverse * c).transpose();
    let mut g = symmetric(c.transpose() * &r_inverse * c);
    let mut p = symmetric(&noise.q - &noise.s * &r_inverse * noise.s.transpose());
    for _ in 0..60 {
        let w = (&unit + &g * &p).try_inverse()?;
        let next_g = symmetric(&g + &left * &w * &g * left.transpose());
        let change = symmetric(left.transpose() * &p * &w * &left);
        let next = &p + &change;
        left = &left * &w * &left;
        g = next_g;
        p = next;
        if !p.iter().all(|value| value.is_finite()) {
            return None;
        }
        if change.norm() <= 1e-14 * p.norm() {
            break;
        }
    }
    let gain = (a * &p * c.transpose() + &noise.s) * (c * &p * c.transpose() + &noise.r).try_inverse()?;
    let radius = spectral::eigenvalues(&(a - &gain * c)).iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    (gain.iter().all(|value| value.is_finite()) && radius < 1.0).then_some(gain)
}

fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_is_that_of_scipy() {
        // tests/reference/kalman_gain.py
        let expected = DMatrix::from_row_slice(
            3,
            2,
            &[
                0.8136130609972,
                0.277876009736933,
                0.027689116503652,
                0.248015550398922,
                -0.064848699774532,
                0.220128911410995,
            ],
        );
        let a = DMatrix::from_row_slice(3, 3, &[1.1, 0.3, 0.0, -0.2, 0.7, 0.4, 0.0, 0.1, -0.5]);
        let c = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.5, 0.0, 1.0, -1.0]);
        let noise = Noise {
            q: DMatrix::from_row_slice(3, 3, &[0.5, 0.1, 0.0, 0.1, 0.4, 0.05, 0.0, 0.05, 0.3]),
            s: DMatrix::from_row_slice(3, 2, &[0.1, 0.02, 0.03, -0.05, 0.0, 0.04]),
            r: DMatrix::from_row_slice(2, 2, &[0.3, 0.05, 0.05, 0.2]),
        };
        let found = kalman_gain(&a, &c, &noise).unwrap();
        assert!((found - expected).amax() < 1e-12);
    }

    #[test]
    fn a_state_that_no_output_sees_and_that_grows_has_no_stable_predictor() {
        let noise = Noise { q: DMatrix::identity(1, 1), s: DMatrix::zeros(1, 1), r: DMatrix::identity(1, 1) };
        let a = DMatrix::from_element(1, 1, 1.2);
        assert!(kalman_gain(&a, &DMatrix::zeros(1, 1), &noise).is_none());
    }
}
