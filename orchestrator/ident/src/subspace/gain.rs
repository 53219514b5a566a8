//! Innovation gain: from the residuals of the estimated state, then by prediction error.

use nalgebra::{DMatrix, DVector};

use super::data::{Matrices, Segment};
use super::hankel::HankelFactor;
use super::input_terms::{free_initial_state, input_terms};
use super::realization::spectral_radius;
use super::riccati::{Noise, kalman_gain};

/// Residual variance of the scaled outputs below which there is nothing to predict.
const MIN_RESIDUAL_VARIANCE: f64 = 1e-16;

/// Innovation gain K in scaled units, shape \[n, n_y\], such that the predictor `A - K C` is stable.
///
/// First guess: the state x(t) is taken from the past, `state` z(t-1) .. z(t-p); the residuals `w = x(t+1) - A x(t) - B
/// u(t)` and `v = y(t) - C x(t) - D u(t)` have the covariances of the Riccati equation. `None`: it has no solution.
/// Data without noise leave the gain at 0.
pub(super) fn riccati_gain(
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
    if noise.r.trace() < MIN_RESIDUAL_VARIANCE * n_y as f64 {
        return Some(DMatrix::zeros(n, n_y));
    }
    // An output without noise and rounding must not make the problem singular.
    let floor = 1e-10 * noise.r.trace() / n_y as f64;
    let floor_q = 1e-10 * noise.q.trace() / n as f64;
    (0..n_y).for_each(|i| noise.r[(i, i)] += floor);
    (0..n).for_each(|i| noise.q[(i, i)] += floor_q);
    kalman_gain(&model.a, &model.c, &noise)
}

/// Most Gauss-Newton steps; a step that improves the prediction by less than a ten-thousandth ends the search.
const MAX_GAUSS_NEWTON_STEPS: usize = 15;

/// Gain that brings the one-step predictions closest to the measured outputs, A, B, C and D given: Gauss-Newton from
/// the best of `starts`, with halved steps that keep the predictor stable. `None` if no start is finite.
///
/// With `e` the innovations, the change of the predictions with K is the response of `A - K C` to inputs e: each step
/// is the estimate of an input matrix.
pub(super) fn prediction_error_gain(
    segments: &[Segment],
    model: &Matrices,
    starts: &[DMatrix<f64>],
) -> Option<DMatrix<f64>> {
    let states: Vec<DVector<f64>> =
        segments.iter().map(|segment| free_initial_state(segment, model)).collect();
    let innovations = |gain: &DMatrix<f64>| -> Vec<DMatrix<f64>> {
        segments.iter().zip(&states).map(|(segment, x0)| innovations(segment, model, gain, x0)).collect()
    };
    let mut best: Option<(f64, DMatrix<f64>, Vec<DMatrix<f64>>)> = None;
    for gain in starts {
        let errors = innovations(gain);
        let cost = cost(&rms(&errors), segments);
        if cost.is_finite() && best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            best = Some((cost, gain.clone(), errors));
        }
    }
    let (mut least, mut gain, mut errors) = best?;
    for _ in 0..MAX_GAUSS_NEWTON_STEPS {
        // Every output counts by its relative error.
        let weights = rms(&errors).map(|rms| 1.0 / rms.max(f64::MIN_POSITIVE));
        let weights = DMatrix::from_diagonal(&weights);
        let driven: Vec<Segment> = errors.iter().map(|e| Segment { u: e.clone(), y: &weights * e }).collect();
        let closed = &model.a - &gain * &model.c;
        let Some(step) = input_terms(&driven, &closed, &(&weights * &model.c), None, false) else { break };
        let before = least;
        let mut length = 1.0;
        while length > 0.05 {
            let tried = &gain + &step.b * length;
            if spectral_radius(&(&model.a - &tried * &model.c)) < 1.0 {
                let found = innovations(&tried);
                let cost = cost(&rms(&found), segments);
                if cost < least {
                    (least, gain, errors) = (cost, tried, found);
                    break;
                }
            }
            length *= 0.5;
        }
        if least > before * (1.0 - 1e-4) {
            break;
        }
    }
    Some(gain)
}

/// Innovations `y(k) - C x(k) - D u(k)` of the predictor from the initial state, shape \[n_y, n\].
fn innovations(segment: &Segment, model: &Matrices, gain: &DMatrix<f64>, x0: &DVector<f64>) -> DMatrix<f64> {
    let mut errors = segment.y.clone();
    let (mut x, mut next) = (x0.clone(), x0.clone());
    for (mut e, u) in errors.column_iter_mut().zip(segment.u.column_iter()) {
        e.gemv(-1.0, &model.c, &x, 1.0);
        e.gemv(-1.0, &model.d, &u, 1.0);
        next.gemv(1.0, &model.a, &x, 0.0);
        next.gemv(1.0, &model.b, &u, 1.0);
        next.gemv(1.0, gain, &e, 1.0);
        std::mem::swap(&mut x, &mut next);
    }
    errors
}

/// RMS of every output, shape \[n_y\].
fn rms(errors: &[DMatrix<f64>]) -> DVector<f64> {
    let n: usize = errors.iter().map(DMatrix::ncols).sum();
    let n_y = errors.first().map_or(0, DMatrix::nrows);
    DVector::from_fn(n_y, |i, _| {
        let squares: f64 = errors.iter().map(|e| e.row(i).iter().map(|e| e * e).sum::<f64>()).sum();
        (squares / n as f64).sqrt()
    })
}

/// Sum of the relative errors of the outputs.
fn cost(errors: &DVector<f64>, segments: &[Segment]) -> f64 {
    let measured: Vec<DMatrix<f64>> = segments.iter().map(|segment| segment.y.clone()).collect();
    errors.component_div(&rms(&measured)).sum()
}
