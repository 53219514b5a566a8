//! Derivatives of predicted outputs with respect to all directions of a state-space model, sample by sample.

use nalgebra::{DMatrix, DVector};

use super::predictor::{Predictor, weighted};
use super::tangent::Tangent;
use crate::model::StateSpace;
use crate::rational::Experiment;
use airloop_optim::linalg::StreamedQr;

/// `x_d(k+1) = F x_d + (dA - K dC) x + (dB - K dD) u + dK e`, `y_d = C x_d + dC x + dD u` for every direction d at
/// once.
///
/// The derivatives of one state with respect to all directions stand together, so that every product is a sum of long
/// rows. The derivatives with respect to the initial state run along as further directions without forcing.
pub(super) struct Sensitivity {
    n_x: usize,
    n_y: usize,
    /// Number of directions.
    pub(super) p: usize,
    f: DMatrix<f64>,
    c: DMatrix<f64>,
    /// Forcing of every state by `[x, u, e]`: shape \[n_x\]\[n_x + n_u + n_y\]\[p\].
    state: Vec<f64>,
    /// Forcing of every output by `[x, u]`: shape \[n_y\]\[n_x + n_u\]\[p\].
    output: Vec<f64>,
}

impl Sensitivity {
    pub(super) fn new(model: &StateSpace, tangent: &Tangent, predictor: &Predictor) -> Sensitivity {
        let (n_x, n_u, n_y) = (model.order(), model.d.ncols(), model.d.nrows());
        let p = tangent.len(model);
        let gain = model.gain.clone().unwrap_or_else(|| DMatrix::zeros(n_x, n_y));
        let (wide, narrow) = (n_x + n_u + n_y, n_x + n_u);
        let mut state = vec![0.0; n_x * wide * p];
        let mut output = vec![0.0; n_y * narrow * p];
        for d in 0..p {
            let [da, db, dk, dc, dd] = tangent.direction(model, d);
            let (from_x, from_u) = (da - &gain * &dc, db - &gain * &dd);
            let mut put = |i: usize, source: usize, value: f64| state[(i * wide + source) * p + d] = value;
            for i in 0..n_x {
                (0..n_x).for_each(|j| put(i, j, from_x[(i, j)]));
                (0..n_u).for_each(|j| put(i, n_x + j, from_u[(i, j)]));
                (0..n_y).for_each(|j| put(i, n_x + n_u + j, dk[(i, j)]));
            }
            let mut put = |i: usize, source: usize, value: f64| output[(i * narrow + source) * p + d] = value;
            for i in 0..n_y {
                (0..n_x).for_each(|j| put(i, j, dc[(i, j)]));
                (0..n_u).for_each(|j| put(i, n_x + j, dd[(i, j)]));
            }
        }
        Sensitivity { n_x, n_y, p, f: predictor.f.clone(), c: predictor.c.clone(), state, output }
    }

    /// Folds `[derivatives, residual]` of an experiment, its initial state eliminated.
    pub(super) fn fold(
        &self,
        predictor: &Predictor,
        experiment: &Experiment,
        x0: &DVector<f64>,
        root: &DMatrix<f64>,
        all: &mut StreamedQr,
    ) {
        let (n_x, n_y, p) = (self.n_x, self.n_y, self.p);
        let horizon = predictor.horizon(experiment.len());
        let mut early = StreamedQr::new(n_x + p + 1);
        let mut free = self.c.clone();
        let mut x = vec![0.0; n_x * p];
        let mut next = vec![0.0; n_x * p];
        let mut y = vec![0.0; n_y * p];
        let mut folded = false;
        predictor.run(experiment, x0, |k, state, inputs, e| {
            if k == horizon {
                self.close(std::mem::replace(&mut early, StreamedQr::new(0)), all);
                folded = true;
            }
            for (i, y) in y.chunks_exact_mut(p).enumerate() {
                y.fill(0.0);
                (0..n_x).for_each(|j| add(y, self.c[(i, j)], &x[j * p..(j + 1) * p]));
                let forcing = self.output[i * (n_x + inputs.len()) * p..].chunks_exact(p);
                state.iter().chain(inputs).zip(forcing).for_each(|(value, row)| add(y, *value, row));
            }
            if folded {
                write_rows(&y, p, root, e, 0, all);
            } else {
                early.room(n_y);
                let rows = root * &free;
                for j in 0..n_x {
                    early.column(j, n_y).copy_from_slice(rows.column(j).as_slice());
                }
                free = &free * &self.f;
                write_rows(&y, p, root, e, n_x, &mut early);
            }
            let sources = n_x + inputs.len() + n_y;
            for (i, next) in next.chunks_exact_mut(p).enumerate() {
                next.fill(0.0);
                (0..n_x).for_each(|j| add(next, self.f[(i, j)], &x[j * p..(j + 1) * p]));
                let forcing = self.state[i * sources * p..].chunks_exact(p);
                let values = state.iter().chain(inputs).chain(e);
                values.zip(forcing).for_each(|(value, row)| add(next, *value, row));
            }
            std::mem::swap(&mut x, &mut next);
        });
        if !folded {
            self.close(early, all);
        }
    }

    /// Hands on what the initial state cannot explain.
    fn close(&self, early: StreamedQr, all: &mut StreamedQr) {
        let factor = early.finish().into_r();
        all.push(&factor.view((self.n_x, self.n_x), (self.p + 1, self.p + 1)).into_owned());
    }
}

/// `sum += factor * row`.
fn add(sum: &mut [f64], factor: f64, row: &[f64]) {
    sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += factor * value);
}

/// Rows of one sample: derivatives from column `first` on, then the residual.
fn write_rows(y: &[f64], p: usize, root: &DMatrix<f64>, e: &[f64], first: usize, fold: &mut StreamedQr) {
    let n_y = e.len();
    fold.room(n_y);
    for d in 0..p {
        for (i, out) in fold.column(first + d, n_y).iter_mut().enumerate() {
            *out = (0..n_y).map(|l| root[(i, l)] * y[l * p + d]).sum();
        }
    }
    weighted(root, e, fold.column(first + p, n_y));
    fold.commit(n_y);
}
