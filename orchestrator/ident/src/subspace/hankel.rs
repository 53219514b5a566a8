//! Triangular factor of past and future of the records: all that the subspace methods need to know of the data.
//!
//! Row t of the tall matrix is `[u(t) .. u(t+f-1) | z(t-1) .. z(t-p) | y(t) .. y(t+f-1)]` with `z = (u, y)`: future
//! inputs, past by lag, future outputs, the columns of the block Hankel matrices of every record. It is folded block by
//! block into its factor R (the LQ factorization of the Hankel matrices, transposed), so that memory does not grow with
//! the records. The factor of a shorter horizon is that of some of its columns.

use nalgebra::DMatrix;

use super::data::Segment;
use airloop_optim::linalg::spectral;
use airloop_optim::linalg::{StreamedQr, Triangle};
use rayon::prelude::*;

/// Parts of the tall matrix that are folded side by side.
const PARTS: usize = 4;

/// R of the tall matrix with the horizon it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HankelFactor {
    pub n_u: usize,
    pub n_y: usize,
    /// Past samples p and future samples f.
    pub horizon: usize,
    /// Rows of the tall matrix.
    pub rows: u64,
    /// Shape \[q, q\], q = horizon (2 n_u + 2 n_y).
    r: DMatrix<f64>,
}

impl HankelFactor {
    /// Factor of all records that are long enough, for past and future of `horizon` samples each.
    pub fn new(segments: &[Segment], horizon: usize) -> HankelFactor {
        let n_u = segments.first().map_or(0, |segment| segment.u.nrows());
        let n_y = segments.first().map_or(0, |segment| segment.y.nrows());
        let signals: Vec<Signals> = segments
            .iter()
            .map(|segment| Signals { u: segment.u.transpose(), y: segment.y.transpose() })
            .collect();
        // The parts are always the same, so that the result does not depend on the number of threads.
        let parts = parts(segments, horizon);
        let one = |rows: &Vec<(usize, usize, usize)>| {
            let mut qr = StreamedQr::new(2 * horizon * (n_u + n_y));
            for &(segment, from, to) in rows {
                fold(&mut qr, &signals[segment], from, to, horizon);
            }
            qr.finish()
        };
        let triangles: Vec<Triangle> = parts.par_iter().map(one).collect();
        let rows = triangles.iter().map(Triangle::rows).sum();
        let mut triangles = triangles.into_iter();
        let mut r = triangles.next().map_or_else(|| DMatrix::zeros(0, 0), |first| first.r().clone());
        for other in triangles {
            r = stacked(&r, other.r());
        }
        HankelFactor { n_u, n_y, horizon, rows, r }
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
        HankelFactor { horizon, r, n_u: self.n_u, n_y: self.n_y, rows: self.rows }
    }

    /// First columns of the past and of the future outputs.
    fn starts(&self) -> (usize, usize) {
        let past = self.horizon * self.n_u;
        (past, past + self.horizon * (self.n_u + self.n_y))
    }

    /// L22 = R_ww': the past orthogonal to the future inputs, shape \[p n_z, p n_z\].
    pub fn past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.r.view((w, w), (y - w, y - w)).transpose()
    }

    /// \[L21 L22\]: all of the past, shape \[p n_z, f n_u + p n_z\].
    pub fn whole_past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.r.view((0, w), (y, y - w)).transpose()
    }

    /// L32: what the past says of the future outputs, orthogonal to the future inputs, shape \[f n_y, p n_z\].
    pub fn future_by_past(&self) -> DMatrix<f64> {
        let (w, y) = self.starts();
        self.r.view((w, y), (y - w, self.r.ncols() - y)).transpose()
    }

    /// \[L32 L33\]: the future outputs orthogonal to the future inputs, shape \[f n_y, p n_z + f n_y\].
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
        spectral::singular_values(self.r.select_columns(&columns)).iter().copied().collect()
    }
}

/// Variables of one time step in the coordinates of the factor, shape \[q, n\]: inner products are those over all rows.
pub(super) struct Steps {
    pub past: DMatrix<f64>,
    pub later: DMatrix<f64>,
    pub u: DMatrix<f64>,
    pub y: DMatrix<f64>,
}

/// Channels of a segment as columns.
struct Signals {
    u: DMatrix<f64>,
    y: DMatrix<f64>,
}

/// Rows (segment, first t, end) in [`PARTS`] parts of about the same length.
fn parts(segments: &[Segment], horizon: usize) -> Vec<Vec<(usize, usize, usize)>> {
    let end = |segment: &Segment| (segment.len() + 1).saturating_sub(horizon).max(horizon);
    let all: usize = segments.iter().map(|segment| end(segment) - horizon).sum();
    let most = all.div_ceil(PARTS).max(1);
    let mut parts = vec![Vec::new()];
    let mut room = most;
    for (index, segment) in segments.iter().enumerate() {
        let mut from = horizon;
        while from < end(segment) {
            if room == 0 {
                parts.push(Vec::new());
                room = most;
            }
            let rows = room.min(end(segment) - from);
            if let Some(part) = parts.last_mut() {
                part.push((index, from, from + rows));
            }
            from += rows;
            room -= rows;
        }
    }
    parts
}

/// Adds the rows `from .. to` of a segment.
fn fold(qr: &mut StreamedQr, signals: &Signals, from: usize, to: usize, horizon: usize) {
    let (n, n_u, n_y) = (signals.y.nrows(), signals.u.ncols(), signals.y.ncols());
    let mut t = from;
    while t < to {
        let rows = qr.space().min(to - t);
        qr.append(rows, |column, out| {
            let (of_input, channel, first) = place(column, t, horizon, n_u, n_y);
            let signal = if of_input { &signals.u } else { &signals.y };
            out.copy_from_slice(&signal.as_slice()[channel * n + first..][..rows]);
        });
        t += rows;
    }
}

/// Triangle of one matrix above another.
fn stacked(above: &DMatrix<f64>, below: &DMatrix<f64>) -> DMatrix<f64> {
    let n = above.ncols();
    let mut both = DMatrix::zeros(2 * n, n);
    both.rows_mut(0, n).copy_from(above);
    both.rows_mut(n, n).copy_from(below);
    both.qr().unpack_r()
}

/// Content of a column at row t: whether an input, which channel, which sample.
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
