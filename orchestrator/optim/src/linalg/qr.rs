//! QR of a tall matrix, row block by row block, and least squares from its triangle.
//!
//! Householder reflections fold each block into the triangle R of all rows before it (Golub and Van Loan, section 5.2;
//! "sequential TSQR"). A block stays in the cache, so that the cost is that of the arithmetic; no normal equations are
//! formed, so that the accuracy is that of a Householder QR of the whole matrix.

use nalgebra::{DMatrix, DVector};

use crate::linalg::spectral;

/// Rows that one block takes at least: short enough that some columns stay in the innermost cache.
pub const ROOM: usize = 512;
/// Independent partial sums of a dot product; a fixed number, so that results do not depend on the machine.
const LANES: usize = 8;
/// Squared norm of a column that counts as zero. What cancels in one dependent column after the other (samples of a
/// command that stands still) shrinks by the rounding error each time, down to where squares underflow.
const MIN_SQUARED_NORM: f64 = 1e-250;

/// The triangle R of all rows so far, with a block of rows that are not folded yet.
#[derive(Debug, Clone)]
pub struct StreamedQr {
    columns: usize,
    capacity: usize,
    /// Upper triangle, row-major, shape \[columns, columns\].
    r: Vec<f64>,
    /// Waiting rows, column-major with stride `capacity`.
    block: Vec<f64>,
    waiting: usize,
    rows: u64,
}

impl StreamedQr {
    /// Of a matrix with `columns` columns and no row yet.
    ///
    /// ```
    /// use airloop_optim::linalg::StreamedQr;
    /// let mut qr = StreamedQr::new(2);
    /// // y = 2 x at three points: column 0 is x, column 1 is y.
    /// qr.append(3, |column, out| out.copy_from_slice(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]][column]));
    /// let triangle = qr.finish();
    /// assert!((triangle.solve(1).unwrap()[(0, 0)] - 2.0).abs() < 1e-14);
    /// ```
    pub fn new(columns: usize) -> StreamedQr {
        let capacity = ROOM.max((2 * columns).next_multiple_of(LANES));
        StreamedQr {
            columns,
            capacity,
            r: vec![0.0; columns * columns],
            block: vec![0.0; columns * capacity],
            waiting: 0,
            rows: 0,
        }
    }

    /// Adds `rows` rows, [`StreamedQr::space`] at most; `fill(column, out)` writes their entries in one column, `out`
    /// of shape \[rows\].
    ///
    /// # Panics
    /// For more rows than there is space for.
    pub fn append(&mut self, rows: usize, mut fill: impl FnMut(usize, &mut [f64])) {
        assert!(rows <= self.space(), "more rows than there is space for; ask `space` first");
        for column in 0..self.columns {
            fill(column, self.column(column, rows));
        }
        self.commit(rows);
    }

    /// Rows that the next [`StreamedQr::append`] may add; at least 1.
    pub fn space(&self) -> usize {
        self.capacity - self.waiting
    }

    /// Same as [`StreamedQr::space`], after making sure that there is space for `rows`, [`ROOM`] at most.
    pub fn room(&mut self, rows: usize) -> usize {
        if self.space() < rows {
            self.fold();
        }
        self.space()
    }

    /// The next `rows` entries of a column, shape \[rows\], to be written before [`StreamedQr::commit`]; for rows whose
    /// entries are not made column by column.
    pub fn column(&mut self, column: usize, rows: usize) -> &mut [f64] {
        let first = column * self.capacity + self.waiting;
        &mut self.block[first..first + rows]
    }

    /// Adds the `rows` that were written into every [`StreamedQr::column`].
    pub fn commit(&mut self, rows: usize) {
        self.waiting += rows;
        self.rows += rows as u64;
        if self.waiting == self.capacity {
            self.fold();
        }
    }

    /// Adds the rows of a matrix of shape \[any, columns\].
    pub fn push(&mut self, rows: &DMatrix<f64>) {
        let mut first = 0;
        while first < rows.nrows() {
            let count = self.space().min(rows.nrows() - first);
            self.append(count, |column, out| {
                out.copy_from_slice(&rows.column(column).as_slice()[first..first + count]);
            });
            first += count;
        }
    }

    /// Rows so far.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Folds what waits and gives the triangle.
    pub fn finish(mut self) -> Triangle {
        self.fold();
        Triangle { r: DMatrix::from_row_slice(self.columns, self.columns, &self.r), rows: self.rows }
    }

    /// Householder reflections of the triangle over the waiting rows; the reflector of column j has one entry in row j
    /// of the triangle, and the whole column of the block.
    fn fold(&mut self) {
        let (p, m, stride) = (self.columns, self.waiting, self.capacity);
        self.waiting = 0;
        if m == 0 {
            return;
        }
        for j in 0..p {
            let (left, right) = self.block.split_at_mut((j + 1) * stride);
            let v = &left[j * stride..j * stride + m];
            let row = &mut self.r[j * p..(j + 1) * p];
            let below = dot(v, v);
            if below < MIN_SQUARED_NORM {
                continue;
            }
            let norm = (row[j] * row[j] + below).sqrt();
            let alpha = if row[j] > 0.0 { -norm } else { norm };
            let v0 = row[j] - alpha;
            let beta = -1.0 / (alpha * v0);
            row[j] = alpha;
            let mut rest = row[j + 1..].chunks_exact_mut(4);
            let mut columns = right.chunks_exact_mut(4 * stride);
            for (r, four) in rest.by_ref().zip(columns.by_ref()) {
                let (a, four) = four.split_at_mut(stride);
                let (b, four) = four.split_at_mut(stride);
                let (c, d) = four.split_at_mut(stride);
                reflect4(v, v0, beta, r, [&mut a[..m], &mut b[..m], &mut c[..m], &mut d[..m]]);
            }
            let single = columns.into_remainder().chunks_exact_mut(stride);
            for (r, column) in rest.into_remainder().iter_mut().zip(single) {
                let column = &mut column[..m];
                let w = beta * (v0 * *r + dot(v, column));
                *r -= w * v0;
                column.iter_mut().zip(v).for_each(|(x, v)| *x -= w * v);
            }
        }
    }
}

/// Dot product `x . y` of two vectors of one length \[n\], in a fixed order of summation.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (x_lanes, x_rest) = x.as_chunks::<LANES>();
    let (y_lanes, y_rest) = y.as_chunks::<LANES>();
    for (x, y) in x_lanes.iter().zip(y_lanes) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = x_rest.iter().zip(y_rest).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}

/// One reflection of four columns: the reflector is read once for all of them.
fn reflect4(v: &[f64], v0: f64, beta: f64, r: &mut [f64], columns: [&mut [f64]; 4]) {
    const HALF: usize = LANES / 2;
    let [a, b, c, d] = columns;
    let mut sums = [[0.0; HALF]; 4];
    let lanes = v.as_chunks::<HALF>().0.iter();
    let (a4, b4) = (a.as_chunks::<HALF>().0, b.as_chunks::<HALF>().0);
    let (c4, d4) = (c.as_chunks::<HALF>().0, d.as_chunks::<HALF>().0);
    for ((((v, a), b), c), d) in lanes.zip(a4).zip(b4).zip(c4).zip(d4) {
        for lane in 0..HALF {
            sums[0][lane] += v[lane] * a[lane];
            sums[1][lane] += v[lane] * b[lane];
            sums[2][lane] += v[lane] * c[lane];
            sums[3][lane] += v[lane] * d[lane];
        }
    }
    let mut w = sums.map(|sums| sums.iter().sum::<f64>());
    for k in v.len() / HALF * HALF..v.len() {
        [a[k], b[k], c[k], d[k]].iter().zip(&mut w).for_each(|(x, w)| *w += v[k] * x);
    }
    for (w, r) in w.iter_mut().zip(r) {
        *w = beta * (v0 * *r + *w);
        *r -= *w * v0;
    }
    for ((((v, a), b), c), d) in v.iter().zip(a).zip(b).zip(c).zip(d) {
        *a -= w[0] * v;
        *b -= w[1] * v;
        *c -= w[2] * v;
        *d -= w[3] * v;
    }
}

/// A column that is a linear combination of columns before it, to rounding.
#[derive(Debug, Clone, PartialEq)]
pub struct Dependent {
    /// The column.
    pub column: usize,
    /// Columns that it is made of, with their coefficients; none for a column of zeros.
    pub of: Vec<(usize, f64)>,
}

/// The triangle R of a QR decomposition: as good as the matrix itself for least squares.
#[derive(Debug, Clone, PartialEq)]
pub struct Triangle {
    r: DMatrix<f64>,
    rows: u64,
}

impl Triangle {
    /// R, upper triangular, shape \[columns, columns\].
    pub fn r(&self) -> &DMatrix<f64> {
        &self.r
    }

    /// R, upper triangular, shape \[columns, columns\].
    pub fn into_r(self) -> DMatrix<f64> {
        self.r
    }

    /// Rows of the matrix.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The triangle of a matrix made of some of the columns, in the given order.
    pub fn select(&self, columns: &[usize]) -> Triangle {
        // Nothing stands below the diagonal of the last column that is taken.
        let height = columns.iter().map(|column| column + 1).max().unwrap_or(0).max(columns.len());
        let part = DMatrix::from_fn(height, columns.len(), |i, j| self.r[(i, columns[j])]);
        Triangle { r: part.qr().unpack_r(), rows: self.rows }
    }

    /// The triangle of the matrix times a square matrix `t`, shape \[columns, columns\], as for columns shifted by a
    /// column of ones.
    pub fn times(&self, t: &DMatrix<f64>) -> Triangle {
        Triangle { r: (&self.r * t).qr().unpack_r(), rows: self.rows }
    }

    /// The first of the first `n` columns that depends on those before it: its residual is less than `tolerance` times
    /// its norm. `None` if the columns are independent.
    pub fn dependent(&self, n: usize, tolerance: f64) -> Option<Dependent> {
        let column = (0..n).find(|&j| {
            let (left, norm) = (self.r[(j, j)].abs(), self.r.view((0, j), (j + 1, 1)).norm());
            left.is_nan() || left <= tolerance * norm
        })?;
        let solution = self.back_substitute(column, &self.r.view((0, column), (column, 1)).into_owned());
        let norm = |j: usize| self.r.view((0, j), (j + 1, 1)).norm();
        // A part counts by what it contributes, not by its coefficient, which depends on the units.
        let own = norm(column);
        let of = (0..column).map(|j| (j, solution[(j, 0)]));
        Some(Dependent { column, of: of.filter(|&(j, c)| c.abs() * norm(j) > 1e-6 * own).collect() })
    }

    /// Least squares of the columns from `n` on by the first `n` columns, shape \[n, columns - n\]; `None` if those are
    /// exactly singular (see [`Triangle::dependent`] for nearly).
    pub fn solve(&self, n: usize) -> Option<DMatrix<f64>> {
        if (0..n).any(|j| self.r[(j, j)] == 0.0) {
            return None;
        }
        let right = self.r.view((0, n), (n, self.r.ncols() - n)).into_owned();
        Some(self.back_substitute(n, &right))
    }

    fn back_substitute(&self, n: usize, right: &DMatrix<f64>) -> DMatrix<f64> {
        let mut x = right.clone();
        for column in 0..x.ncols() {
            for i in (0..n).rev() {
                let known: f64 = (i + 1..n).map(|j| self.r[(i, j)] * x[(j, column)]).sum();
                x[(i, column)] = (x[(i, column)] - known) / self.r[(i, i)];
            }
        }
        x
    }

    /// Cross products of the residuals of [`Triangle::solve`], shape \[columns - n, columns - n\].
    pub fn residual_products(&self, n: usize) -> DMatrix<f64> {
        let rest = self.r.ncols() - n;
        let corner = self.r.view((n, n), (self.r.nrows() - n, rest));
        corner.tr_mul(&corner)
    }

    /// `(X^T X)^-1` of the first `n` columns X, shape \[n, n\].
    pub fn inverse_gram(&self, n: usize) -> DMatrix<f64> {
        let inverse = self.back_substitute(n, &DMatrix::identity(n, n));
        &inverse * inverse.transpose()
    }

    /// Condition number (2-norm) of the first `n` columns, each scaled to norm 1; infinite if they are dependent.
    pub fn scaled_condition(&self, n: usize) -> f64 {
        let mut scaled = self.r.view((0, 0), (n, n)).into_owned();
        for mut column in scaled.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let values: DVector<f64> = spectral::singular_values(scaled);
        values.max() / values.min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_has_the_scalar_products_of_the_columns() {
        let rows = DMatrix::from_fn(1000, 5, |i, j| ((i * 5 + j) as f64 * 0.618_033_988_75).fract() - 0.5);
        let mut qr = StreamedQr::new(5);
        qr.push(&rows);
        let r = qr.finish().into_r();
        assert!((r.transpose() * &r - rows.transpose() * &rows).amax() < 1e-11);
        assert_eq!(r.lower_triangle() - DMatrix::from_diagonal(&r.diagonal()), DMatrix::zeros(5, 5));
    }

    #[test]
    fn forty_equal_columns_leave_a_finite_triangle_of_rank_one() {
        let (rows, columns) = (300, 40);
        let mut qr = StreamedQr::new(columns);
        for k in 0..rows {
            qr.append(1, |_, out| out[0] = 0.1 + f64::from(k % 7));
        }
        let r = qr.finish();
        assert!(r.r().iter().all(|value| value.is_finite()));
        assert_eq!(r.dependent(columns, 1e-12).unwrap().column, 1);
    }

    /// Values between -1 and 1 without structure.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    fn streamed(matrix: &DMatrix<f64>, pieces: &[usize]) -> Triangle {
        let mut qr = StreamedQr::new(matrix.ncols());
        let mut at = 0;
        for &wanted in pieces.iter().cycle() {
            let rows = wanted.min(matrix.nrows() - at).min(qr.space());
            qr.append(rows, |column, out| {
                out.iter_mut().enumerate().for_each(|(i, x)| *x = matrix[(at + i, column)]);
            });
            at += rows;
            if at == matrix.nrows() {
                return qr.finish();
            }
        }
        unreachable!("pieces are not empty");
    }

    #[test]
    fn the_triangle_is_that_of_the_whole_matrix_up_to_signs() {
        let mut next = noise(1);
        for (rows, columns) in [(1300, 7), (2000, 14), (40, 9), (600, 1), (5000, 33)] {
            let matrix = DMatrix::from_fn(rows, columns, |_, j| next() * 10f64.powi(j as i32 % 5));
            let whole = matrix.clone().qr().unpack_r();
            let found = streamed(&matrix, &[17, 300, 1, 511]);
            for i in 0..columns {
                let sign = (whole[(i, i)] * found.r()[(i, i)]).signum();
                for j in 0..columns {
                    let scale = matrix.column(j).norm();
                    let error = (whole[(i, j)] - sign * found.r()[(i, j)]).abs();
                    assert!(error < 1e-13 * scale, "{rows} x {columns}: R[{i},{j}] is off by {error}");
                }
            }
        }
    }

    #[test]
    fn least_squares_keeps_digits_that_normal_equations_lose() {
        // Laeuchli's matrix: the squares of the small entries vanish compared with 1.
        let e = 1e-9;
        let matrix = DMatrix::from_row_slice(
            4,
            4,
            &[1.0, 1.0, 1.0, 6.0, e, 0.0, 0.0, e, 0.0, e, 0.0, 2.0 * e, 0.0, 0.0, e, 3.0 * e],
        );
        let x = streamed(&matrix, &[2]).solve(3).unwrap();
        for (i, expected) in [1.0, 2.0, 3.0].into_iter().enumerate() {
            assert!((x[(i, 0)] - expected).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn selected_columns_give_the_same_as_their_own_decomposition() {
        let mut next = noise(3);
        let matrix = DMatrix::from_fn(900, 8, |_, _| next());
        let some = [6, 1, 4, 7];
        let part = DMatrix::from_fn(900, 4, |i, j| matrix[(i, some[j])]);
        let expected = streamed(&part, &[512]).solve(3).unwrap();
        let found = streamed(&matrix, &[512]).select(&some);
        assert!((found.solve(3).unwrap() - expected).amax() < 1e-12);
        let residual = part.column(3) - part.columns(0, 3) * found.solve(3).unwrap();
        assert!((found.residual_products(3)[(0, 0)] - residual.norm_squared()).abs() < 1e-10);
    }

    #[test]
    fn a_dependent_column_is_named_with_what_it_is_made_of() {
        let mut next = noise(4);
        let mut matrix = DMatrix::from_fn(3000, 5, |_, j| 100f64.powi(j as i32) * next());
        let sum = matrix.column(1) * 3.0 - matrix.column(2) * 1e-2;
        matrix.set_column(3, &sum);
        let found = streamed(&matrix, &[512]).dependent(5, 1e-12).unwrap();
        assert_eq!((found.column, found.of.len()), (3, 2));
        assert!((found.of[0].1 - 3.0).abs() < 1e-9 && (found.of[1].1 + 1e-2).abs() < 1e-9, "{found:?}");
        assert_eq!(found.of.iter().map(|(j, _)| *j).collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn the_condition_number_does_not_depend_on_units() {
        let mut next = noise(5);
        let matrix = DMatrix::from_fn(2000, 3, |_, j| 1e4f64.powi(j as i32) * next());
        let condition = streamed(&matrix, &[512]).scaled_condition(3);
        assert!((1.0..1.2).contains(&condition), "{condition}");
    }
}
