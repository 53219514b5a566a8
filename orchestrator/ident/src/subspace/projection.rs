//! Weighted projections of the future on the past: extended observability matrix and state.

use nalgebra::{DMatrix, DVector};

use airloop_optim::linalg::spectral;

use super::hankel::HankelFactor;

/// Relative singular value below which a direction is taken for not there.
const RANK_TOLERANCE: f64 = 1e-10;

/// Weightings of the projection.
///
/// Sources: Van Overschee and De Moor, Subspace Identification for Linear Systems (1996), theorem 12 (all three as one
/// method with different weights); Verhaegen (1994) for PO-MOESP; Larimore (1990) for CVA.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Weighting {
    /// None: the oblique projection itself.
    N4sid,
    /// Past, projected orthogonally to the future inputs (PO-MOESP).
    Moesp,
    /// Canonical variates: as MOESP, future outputs whitened.
    Cva,
}

impl Weighting {
    /// All of them.
    pub const ALL: [Weighting; 3] = [Weighting::N4sid, Weighting::Moesp, Weighting::Cva];
}

/// Singular values with the matrices that belong to them, for all orders at once.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Projection {
    /// Singular values, the largest first.
    pub singular_values: DVector<f64>,
    /// W1^-1 U S^1/2: extended observability matrix, shape \[f n_y, n_max\]; order n takes the first n columns.
    observability: DMatrix<f64>,
    /// S^-1/2 U' W1: from predicted future outputs to the state, shape \[n_max, f n_y\].
    state_from_future: DMatrix<f64>,
    /// L32 L22^+: from the past to the predicted future outputs, shape \[f n_y, p n_z\].
    predictor: DMatrix<f64>,
}

/// Past to predicted future outputs, L32 L22^+, shape \[f n_y, p n_z\].
pub(super) fn predictor(factor: &HankelFactor) -> DMatrix<f64> {
    factor.future_by_past() * pseudo_inverse(factor.past())
}

impl Projection {
    pub fn new(factor: &HankelFactor, weighting: Weighting, predictor: &DMatrix<f64>) -> Projection {
        let future = factor.future_by_past();
        let (weighted, inverse, weight) = match weighting {
            Weighting::N4sid => (predictor * factor.whole_past(), None, None),
            Weighting::Moesp => (future, None, None),
            Weighting::Cva => {
                let svd = spectral::svd(factor.future(), true, false);
                let u = svd.u.expect("asked for");
                let rank = rank(&svd.singular_values);
                let (u, s) =
                    (u.columns(0, rank).into_owned(), svd.singular_values.rows(0, rank).into_owned());
                let weight = DMatrix::from_diagonal(&s.map(|s| 1.0 / s)) * u.transpose();
                (&weight * future, Some(u * DMatrix::from_diagonal(&s)), Some(weight))
            }
        };
        let svd = spectral::svd(weighted, true, false);
        let n = rank(&svd.singular_values);
        let u = svd.u.expect("asked for").columns(0, n).into_owned();
        let root = svd.singular_values.rows(0, n).map(f64::sqrt);
        let observability = &u * DMatrix::from_diagonal(&root);
        let back = DMatrix::from_diagonal(&root.map(|s| 1.0 / s)) * u.transpose();
        Projection {
            observability: inverse.map_or_else(|| observability.clone(), |inverse| inverse * &observability),
            state_from_future: weight.map_or_else(|| back.clone(), |weight| &back * weight),
            singular_values: svd.singular_values,
            predictor: predictor.clone(),
        }
    }

    /// Highest order that the data show.
    pub fn rank(&self) -> usize {
        self.observability.ncols()
    }

    /// Extended observability matrix of order n, shape \[f n_y, n\].
    pub fn observability(&self, n: usize) -> DMatrix<f64> {
        self.observability.columns(0, n).into_owned()
    }

    /// State of order n from the past z(t-1) .. z(t-p), shape \[n, p n_z\].
    pub fn state_from_past(&self, n: usize) -> DMatrix<f64> {
        self.state_from_future.rows(0, n) * &self.predictor
    }
}

fn rank(singular_values: &DVector<f64>) -> usize {
    let largest = singular_values.max();
    singular_values.iter().filter(|&&s| s > RANK_TOLERANCE * largest && s > 0.0).count()
}

/// Moore-Penrose inverse; directions below `RANK_TOLERANCE` are left out.
pub(super) fn pseudo_inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let svd = spectral::svd(matrix, true, true);
    let rank = rank(&svd.singular_values);
    let inverse = svd.singular_values.rows(0, rank).map(|s| 1.0 / s);
    let v = svd.v_t.expect("asked for").rows(0, rank).transpose();
    let u = svd.u.expect("asked for").columns(0, rank).transpose();
    v * DMatrix::from_diagonal(&inverse) * u
}
