//! The predictor of a state-space model: residuals of a record, and the initial state that makes them smallest.

use nalgebra::{DMatrix, DVector};

use crate::model::StateSpace;
use crate::rational::Experiment;
use airloop_optim::linalg::{StreamedQr, qr, triangular};

/// `x(k+1) = F x + G u + K y`, `y_hat = C x + D u` with `F = A - K C`, `G = B - K D`; rows of the matrices one after
/// another.
pub(super) struct Predictor {
    n_x: usize,
    n_y: usize,
    /// `[F, G, K]`, shape \[n_x, n_x + n_u + n_y\].
    state: Vec<f64>,
    /// `[C, D]`, shape \[n_y, n_x + n_u\].
    output: Vec<f64>,
    pub(super) f: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
}

impl Predictor {
    pub(super) fn new(model: &StateSpace) -> Predictor {
        let (n_x, n_y) = (model.order(), model.d.nrows());
        let gain = model.gain.clone().unwrap_or_else(|| DMatrix::zeros(n_x, n_y));
        let (f, g) = (&model.a - &gain * &model.c, &model.b - &gain * &model.d);
        let state = (0..n_x)
            .flat_map(|i| f.row(i).iter().chain(&g.row(i)).chain(&gain.row(i)).copied().collect::<Vec<_>>());
        let output =
            (0..n_y).flat_map(|i| model.c.row(i).iter().chain(&model.d.row(i)).copied().collect::<Vec<_>>());
        Predictor { n_x, n_y, state: state.collect(), output: output.collect(), c: model.c.clone(), f }
    }

    /// Residuals from an initial state; `each` sees the sample, state, inputs and residual before the state moves on.
    pub(super) fn run(
        &self,
        experiment: &Experiment,
        x0: &DVector<f64>,
        mut each: impl FnMut(usize, &[f64], &[f64], &[f64]),
    ) -> Vec<Vec<f64>> {
        let (n_x, n_y, n_u, n) = (self.n_x, self.n_y, experiment.u.len(), experiment.len());
        // State, inputs and outputs of a sample stand together.
        let mut now = vec![0.0; n_x + n_u + n_y];
        now[..n_x].copy_from_slice(x0.as_slice());
        let mut next = vec![0.0; n_x];
        let mut e = vec![0.0; n_y];
        let mut residual = vec![Vec::with_capacity(n); n_y];
        for k in 0..n {
            for j in 0..n_u {
                now[n_x + j] = experiment.u[j][k];
            }
            for i in 0..n_y {
                let y = experiment.y[i][k];
                now[n_x + n_u + i] = y;
                let row = &self.output[i * (n_x + n_u)..(i + 1) * (n_x + n_u)];
                e[i] = y - qr::dot(row, &now[..n_x + n_u]);
                residual[i].push(e[i]);
            }
            each(k, &now[..n_x], &now[n_x..n_x + n_u], &e);
            for (next, row) in next.iter_mut().zip(self.state.chunks_exact(n_x + n_u + n_y)) {
                *next = qr::dot(row, &now);
            }
            now[..n_x].copy_from_slice(&next);
        }
        residual
    }

    /// Samples after which the free response is negligible.
    pub(super) fn horizon(&self, n: usize) -> usize {
        let mut power = DMatrix::identity(self.n_x, self.n_x);
        for k in 0..n {
            if power.amax() < 1e-10 {
                return k;
            }
            power = &self.f * power;
        }
        n
    }

    /// Initial state that makes the weighted residual smallest.
    pub(super) fn initial_state(&self, experiment: &Experiment, root: &DMatrix<f64>) -> DVector<f64> {
        let (n_x, n_y) = (self.n_x, self.n_y);
        let horizon = self.horizon(experiment.len());
        let early = Experiment {
            u: experiment.u.iter().map(|u| u[..horizon].to_vec()).collect(),
            y: experiment.y.iter().map(|y| y[..horizon].to_vec()).collect(),
        };
        let mut fold = StreamedQr::new(n_x + 1);
        let mut free = self.c.clone();
        self.run(&early, &DVector::zeros(n_x), |_, _, _, e| {
            let rows = root * &free;
            fold.room(n_y);
            for j in 0..n_x {
                fold.column(j, n_y).copy_from_slice(rows.column(j).as_slice());
            }
            weighted(root, e, fold.column(n_x, n_y));
            fold.commit(n_y);
            free = &free * &self.f;
        });
        let r = fold.finish().into_r();
        let z = r.view((0, n_x), (n_x, 1)).column(0).into_owned();
        triangular::solve(&r.view((0, 0), (n_x, n_x)).into_owned(), &z, 1e-10).0
    }
}

/// `root e`.
pub(super) fn weighted(root: &DMatrix<f64>, e: &[f64], out: &mut [f64]) {
    for (i, out) in out.iter_mut().enumerate() {
        *out = e.iter().enumerate().map(|(l, e)| root[(i, l)] * e).sum();
    }
}
