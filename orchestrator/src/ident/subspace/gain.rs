//! Innovation gain from the residuals of the estimated state.

use nalgebra::DMatrix;

use super::data::Matrices;
use super::hankel::HankelFactor;
use super::riccati::{Noise, kalman_gain};

/// Residual variance of the scaled outputs below which there is nothing to predict.
const NOISE_FREE: f64 = 1e-16;

/// Innovation gain K in scaled units, shape \[n, n_y\], such that the predictor `A - K C` is stable.
///
/// The state x(t) is taken from the past, `state` z(t-1) .. z(t-p); the residuals `w = x(t+1) - A x(t) - B u(t)` and
/// `v = y(t) - C x(t) - D u(t)` have the covariances of the Riccati equation. `None`: it has no solution.
/// Data without noise leave the gain at 0.
pub(super) fn innovation_gain(
    factor: &HankelFactor,
    model: &Matrices,
    state: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let (n, n_y) = (model.a.nrows(), model.c.nrows());
    let steps = factor.steps();
    // Coordinates of the factor: a column per state or output.
    let x = &steps.past * state.transpose();
    let w = &steps.later * state.transpose() - &x * model.a.transpose() - &steps.u * model.b.transpose();
    let v = &steps.y - &x * model.c.transpose() - &steps.u * model.d.transpose();
    let rows = factor.rows as f64;
    let mut noise = Noise { q: w.tr_mul(&w) / rows, s: w.tr_mul(&v) / rows, r: v.tr_mul(&v) / rows };
    if noise.r.trace() < NOISE_FREE * n_y as f64 {
        return Some(DMatrix::zeros(n, n_y));
    }
    // An output without noise and rounding must not make the problem singular.
    let floor = 1e-10 * noise.r.trace() / n_y as f64;
    let floor_q = 1e-10 * noise.q.trace() / n as f64;
    (0..n_y).for_each(|i| noise.r[(i, i)] += floor);
    (0..n).for_each(|i| noise.q[(i, i)] += floor_q);
    kalman_gain(&model.a, &model.c, &noise)
}
