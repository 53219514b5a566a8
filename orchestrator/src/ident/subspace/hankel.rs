//! Triangular factor of past and future of the records: all that the subspace methods need to know of the data.
//!
//! Row t of the tall matrix is `[u(t) .. u(t+f-1) | z(t-1) .. z(t-p) | y(t) .. y(t+f-1)]` with `z = (u, y)`: future inputs,
//! past by lag, future outputs, all columns of a block Hankel matrix side by side for every record. It is folded block
//! by block into its factor R (an LQ factorisation of the Hankel matrices, transposed), so that memory does not grow
//! with the records. The factor of a shorter horizon is that of some of its columns.

use nalgebra::DMatrix;

use super::data::Segment;

/// R of the tall matrix, upper triangular, with the horizon it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HankelFactor {
    pub n_u: usize,
    pub n_y: usize,
    /// Past samples p and future samples f.
    pub horizon: usize,
    /// Rows of the tall matrix.
    pub rows: usize,
    /// Shape \[q, q\], q = horizon (2 n_u + 2 n_y).
    r: DMatrix<f64>,
}

impl HankelFactor {
    /// Factor of all records that are long enough, for past and future of `horizon` samples each.
    pub fn new(segments: &[Segment], horizon: usize) -> HankelFactor {
        let n_u = segments.first().map_or(0, |segment| segment.u.nrows());
        let n_y = segments.first().map_or(0, |segment| segment.y.nrows());
        let q = 2 * horizon * (n_u + n_y);
        let mut fold = Fold::new(q);
        let mut row = vec![0.0; q];
        let mut rows = 0;
        for segment in segments {
            for t in horizon..(segment.len() + 1).saturating_sub(horizon) {
                fill(&mut row, segment, t, horizon);
                fold.push(&row);
                rows += 1;
            }
        }
        HankelFactor { n_u, n_y, horizon, rows, r: fold.finish() }
    }

    /// Factor for a shorter horizon.
    pub fn shorter(&self, horizon: usize) -> HankelFactor {
        if horizon >= self.horizon {
            return self.clone();
        }
        let (n_z, long) = (self.n_u + self.n_y, self.horizon);
        let columns: Vec<usize> = (0..horizon * self.n_u)
            .chain((0..horizon * n_z).map(|column| long * self.n_u + column))
            .chain((0..horizon * self.n_y).map(|column| long * (self.n_u + n_z) + column))
            .collect();
        let r = self.r.select_columns(&columns).qr().unpack_r();
        HankelFactor { horizon, r, ..self.clone() }
    }

    /// Future inputs to future inputs, past and future outputs: first columns of the groups.
    fn starts(&self) -> (usize, usize) {
        let past = self.horizon * self.n_u;
        (past, past + self.horizon * (self.n_u + self.n_y))
    }

    /// L22 = R_ww': the past beside the future inputs, shape \[p n_z, p n_z\].
    pub fn past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.r.view((w, w), (y - w, y - w)).transpose()
    }

    /// \[L21 L22\]: all of the past, shape \[p n_z, f n_u + p n_z\].
    pub fn whole_past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.r.view((0, w), (y, y - w)).transpose()
    }

    /// L32: what the past says of the future outputs beside the future inputs, shape \[f n_y, p n_z\].
    pub fn future_by_past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.r.view((w, y), (y - w, self.r.ncols() - y)).transpose()
    }

    /// \[L32 L33\]: the future outputs beside the future inputs, shape \[f n_y, p n_z + f n_y\].
    pub fn future(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        let q = self.r.ncols();
        self.r.view((w, y), (q - w, q - y)).transpose()
    }

    /// Coordinates, one column per variable: z(t-1) .. z(t-p); one step later; u(t); y(t).
    pub fn steps(&self) -> Steps {
        let (w, y) = self.starts();
        let n_z = self.n_u + self.n_y;
        let u: Vec<usize> = (0..self.n_u).collect();
        let out: Vec<usize> = (y..y + self.n_y).collect();
        let past: Vec<usize> = (w..y).collect();
        let later: Vec<usize> = u.iter().chain(&out).copied().chain(w..y - n_z).collect();
        let of = |columns: &[usize]| self.r.select_columns(columns);
        Steps { past: of(&past), later: of(&later), u: of(&u), y: of(&out) }
    }

    /// Singular values of the past and future inputs, the largest first.
    pub fn input_singular_values(&self) -> Vec<f64> {
        let (w, y) = self.starts();
        let n_z = self.n_u + self.n_y;
        let columns: Vec<usize> =
            (0..w).chain((w..y).filter(|column| (column - w) % n_z < self.n_u)).collect();
        self.r.select_columns(&columns).singular_values().iter().copied().collect()
    }
}

/// Variables of one time step in the coordinates of the factor, shape \[q, n\]: inner products are those over all rows.
pub(super) struct Steps {
    pub past: DMatrix<f64>,
    pub later: DMatrix<f64>,
    pub u: DMatrix<f64>,
    pub y: DMatrix<f64>,
}

fn fill(row: &mut [f64], segment: &Segment, t: usize, horizon: usize) {
    let (n_u, n_y) = (segment.u.nrows(), segment.y.nrows());
    let (u, y) = (segment.u.as_slice(), segment.y.as_slice());
    let (future_u, rest) = row.split_at_mut(horizon * n_u);
    let (past, future_y) = rest.split_at_mut(horizon * (n_u + n_y));
    future_u.copy_from_slice(&u[t * n_u..(t + horizon) * n_u]);
    future_y.copy_from_slice(&y[t * n_y..(t + horizon) * n_y]);
    for (lag, z) in past.chunks_exact_mut(n_u + n_y).enumerate() {
        let k = t - 1 - lag;
        z[..n_u].copy_from_slice(&u[k * n_u..(k + 1) * n_u]);
        z[n_u..].copy_from_slice(&y[k * n_y..(k + 1) * n_y]);
    }
}

/// A tall matrix folded row block by row block into its triangular factor.
pub(super) struct Fold {
    /// Factor so far above, rows to come below.
    stacked: DMatrix<f64>,
    columns: usize,
    filled: usize,
}

impl Fold {
    pub fn new(columns: usize) -> Fold {
        let block = (3 * columns).max(64);
        Fold { stacked: DMatrix::zeros(columns + block, columns), columns, filled: columns }
    }

    pub fn push(&mut self, row: &[f64]) {
        for (column, value) in row.iter().enumerate() {
            self.stacked[(self.filled, column)] = *value;
        }
        self.filled += 1;
        if self.filled == self.stacked.nrows() {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let n = self.columns;
        let stacked = std::mem::replace(&mut self.stacked, DMatrix::zeros(0, 0));
        let rows = stacked.nrows();
        let r = stacked.qr().unpack_r();
        self.stacked = DMatrix::zeros(rows, n);
        self.stacked.view_mut((0, 0), (n, n)).copy_from(&r);
        self.filled = n;
    }

    /// R, shape \[columns, columns\].
    pub fn finish(mut self) -> DMatrix<f64> {
        let (n, filled) = (self.columns, self.filled);
        if filled > n {
            self.stacked.rows_mut(filled, self.stacked.nrows() - filled).fill(0.0);
            self.fold();
        }
        self.stacked.rows(0, n).into_owned()
    }
}
