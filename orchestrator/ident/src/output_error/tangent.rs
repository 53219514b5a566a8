//! Local coordinates of a state-space model: the directions in which its outputs change.

use nalgebra::{DMatrix, DVector};

use crate::model::StateSpace;
use airloop_optim::linalg::spectral;

/// Directions in which the model can change its outputs: orthonormal columns over the entries of `[A, B, K, C]`
/// (column-major each), and the entries of D.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tangent {
    basis: DMatrix<f64>,
    with_gain: bool,
    with_direct_term: bool,
}

impl Tangent {
    pub(super) fn new(model: &StateSpace, with_direct_term: bool) -> Tangent {
        let (n_x, with_gain) = (model.order(), model.gain.is_some());
        let blocks = |a: DMatrix<f64>, b: DMatrix<f64>, k: Option<DMatrix<f64>>, c: DMatrix<f64>| {
            let gain = k.map_or(Vec::new(), |k| k.as_slice().to_vec());
            [a.as_slice(), b.as_slice(), &gain, c.as_slice()].concat()
        };
        let gain = model.gain.clone();
        let rows = blocks(model.a.clone(), model.b.clone(), gain, model.c.clone()).len();
        // What a change of basis I + S does: (S A - A S, S B, S K, -C S).
        let mut changes = DMatrix::zeros(rows, rows);
        for (index, mut column) in changes.column_iter_mut().take(n_x * n_x).enumerate() {
            let mut s = DMatrix::zeros(n_x, n_x);
            s[index] = 1.0;
            let a = &s * &model.a - &model.a * &s;
            let gain = model.gain.as_ref().map(|gain| &s * gain);
            column.copy_from_slice(&blocks(a, &s * &model.b, gain, -&model.c * &s));
        }
        let free = rows.saturating_sub(n_x * n_x);
        if free == 0 {
            return Tangent { basis: DMatrix::zeros(rows, 0), with_gain, with_direct_term };
        }
        // The left singular vectors of the smallest singular values are orthogonal to all changes of basis.
        let svd = spectral::svd(changes, true, false);
        let mut order: Vec<usize> = (0..rows).collect();
        order.sort_by(|&i, &j| svd.singular_values[i].total_cmp(&svd.singular_values[j]));
        let u = svd.u.unwrap_or_else(|| DMatrix::identity(rows, rows));
        let basis = DMatrix::from_fn(rows, free, |row, column| u[(row, order[column])]);
        Tangent { basis, with_gain, with_direct_term }
    }

    /// Number of directions.
    pub(super) fn len(&self, model: &StateSpace) -> usize {
        self.basis.ncols() + if self.with_direct_term { model.d.len() } else { 0 }
    }

    /// Changes of A, B, K, C, D along direction `index`.
    pub(super) fn direction(&self, model: &StateSpace, index: usize) -> [DMatrix<f64>; 5] {
        let mut unit = DVector::zeros(self.len(model));
        unit[index] = 1.0;
        self.changes(model, &unit)
    }

    /// Changes of A, B, K, C, D after a step.
    fn changes(&self, model: &StateSpace, step: &DVector<f64>) -> [DMatrix<f64>; 5] {
        let (n_x, n_u, n_y) = (model.order(), model.d.ncols(), model.d.nrows());
        let local = &self.basis * step.rows(0, self.basis.ncols());
        let gain = if self.with_gain { n_x * n_y } else { 0 };
        let mut rest = local.as_slice();
        let mut take = |rows: usize, columns: usize, len: usize| {
            let (head, tail) = rest.split_at(len);
            rest = tail;
            if len == 0 {
                DMatrix::zeros(rows, columns)
            } else {
                DMatrix::from_column_slice(rows, columns, head)
            }
        };
        let (a, b) = (take(n_x, n_x, n_x * n_x), take(n_x, n_u, n_x * n_u));
        let (k, c) = (take(n_x, n_y, gain), take(n_y, n_x, n_y * n_x));
        let d = if self.with_direct_term {
            DMatrix::from_iterator(n_y, n_u, step.iter().skip(self.basis.ncols()).copied())
        } else {
            DMatrix::zeros(n_y, n_u)
        };
        [a, b, k, c, d]
    }

    pub(super) fn apply(&self, model: &StateSpace, step: &DVector<f64>) -> StateSpace {
        let [a, b, k, c, d] = self.changes(model, step);
        StateSpace {
            a: &model.a + a,
            b: &model.b + b,
            c: &model.c + c,
            d: &model.d + d,
            gain: model.gain.as_ref().map(|gain| gain + k),
            ..model.clone()
        }
    }
}
