//! Triangular factor of past and future of the records: all that the subspace methods need to know of the data.
//!
//! Row t of the tall matrix is `[u(t) .. u(t+f-1) | z(t-1) .. z(t-p) | y(t) .. y(t+f-1)]` with `z = (u, y)`: future inputs,
//! past by lag, future outputs, the columns of the block Hankel matrices of every record. It is folded block by block
//! into its factor R (the LQ factorisation of the Hankel matrices, transposed), so that memory does not grow with the
//! records. The factor of a shorter horizon is that of some of its columns.

use nalgebra::DMatrix;

use super::data::Segment;
use crate::linalg::{StreamedQr, Triangle};

/// R of the tall matrix with the horizon it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HankelFactor {
    pub n_u: usize,
    pub n_y: usize,
    /// Past samples p and future samples f.
    pub horizon: usize,
    /// Of q columns, q = horizon (2 n_u + 2 n_y).
    triangle: Triangle,
}

impl HankelFactor {
    /// Factor of all records that are long enough, for past and future of `horizon` samples each.
    pub fn new(segments: &[Segment], horizon: usize) -> HankelFactor {
        let n_u = segments.first().map_or(0, |segment| segment.u.nrows());
        let n_y = segments.first().map_or(0, |segment| segment.y.nrows());
        let mut qr = StreamedQr::new(2 * horizon * (n_u + n_y));
        for segment in segments {
            // A channel is a column here.
            let (u, y) = (segment.u.transpose(), segment.y.transpose());
            let end = (segment.len() + 1).saturating_sub(horizon);
            let mut t = horizon;
            while t < end {
                let rows = qr.space().min(end - t);
                qr.append(rows, |column, out| {
                    let (of_input, channel, from) = place(column, t, horizon, n_u, n_y);
                    let signal = if of_input { &u } else { &y };
                    out.copy_from_slice(&signal.as_slice()[channel * segment.len() + from..][..rows]);
                });
                t += rows;
            }
        }
        HankelFactor { n_u, n_y, horizon, triangle: qr.finish() }
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
        HankelFactor { horizon, triangle: self.triangle.select(&columns), n_u: self.n_u, n_y: self.n_y }
    }

    /// Rows of the tall matrix.
    pub fn rows(&self) -> u64 {
        self.triangle.rows()
    }

    /// First columns of the past and of the future outputs.
    fn starts(&self) -> (usize, usize) {
        let past = self.horizon * self.n_u;
        (past, past + self.horizon * (self.n_u + self.n_y))
    }

    /// L22 = R_ww': the past beside the future inputs, shape \[p n_z, p n_z\].
    pub fn past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.triangle.r().view((w, w), (y - w, y - w)).transpose()
    }

    /// \[L21 L22\]: all of the past, shape \[p n_z, f n_u + p n_z\].
    pub fn whole_past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.triangle.r().view((0, w), (y, y - w)).transpose()
    }

    /// L32: what the past says of the future outputs beside the future inputs, shape \[f n_y, p n_z\].
    pub fn future_by_past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.triangle.r().view((w, y), (y - w, self.triangle.r().ncols() - y)).transpose()
    }

    /// \[L32 L33\]: the future outputs beside the future inputs, shape \[f n_y, p n_z + f n_y\].
    pub fn future(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        let q = self.triangle.r().ncols();
        self.triangle.r().view((w, y), (q - w, q - y)).transpose()
    }

    /// Coordinates, one column per variable: z(t-1) .. z(t-p); one step later; u(t); y(t).
    pub fn steps(&self) -> Steps {
        let (w, y) = self.starts();
        let n_z = self.n_u + self.n_y;
        let u: Vec<usize> = (0..self.n_u).collect();
        let out: Vec<usize> = (y..y + self.n_y).collect();
        let past: Vec<usize> = (w..y).collect();
        let later: Vec<usize> = u.iter().chain(&out).copied().chain(w..y - n_z).collect();
        let of = |columns: &[usize]| self.triangle.r().select_columns(columns);
        Steps { past: of(&past), later: of(&later), u: of(&u), y: of(&out) }
    }

    /// Singular values of the past and future inputs, the largest first.
    pub fn input_singular_values(&self) -> Vec<f64> {
        let (w, y) = self.starts();
        let n_z = self.n_u + self.n_y;
        let columns: Vec<usize> =
            (0..w).chain((w..y).filter(|column| (column - w) % n_z < self.n_u)).collect();
        self.triangle.r().select_columns(&columns).singular_values().iter().copied().collect()
    }
}

/// Variables of one time step in the coordinates of the factor, shape \[q, n\]: inner products are those over all rows.
pub(super) struct Steps {
    pub past: DMatrix<f64>,
    pub later: DMatrix<f64>,
    pub u: DMatrix<f64>,
    pub y: DMatrix<f64>,
}

/// What stands in a column at row t: whether an input, which channel, which sample.
fn place(column: usize, t: usize, horizon: usize, n_u: usize, n_y: usize) -> (bool, usize, usize) {
    let n_z = n_u + n_y;
    if column < horizon * n_u {
        return (true, column % n_u, t + column / n_u);
    }
    let past = column - horizon * n_u;
    if past < horizon * n_z {
        let (lag, channel) = (1 + past / n_z, past % n_z);
        return if channel < n_u { (true, channel, t - lag) } else { (false, channel - n_u, t - lag) };
    }
    let future = past - horizon * n_z;
    (false, future % n_y, t + future / n_y)
}
