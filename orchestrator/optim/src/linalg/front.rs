//! A dense symmetric matrix of which the leading rows are eliminated, with 1x1 and 2x2 pivots (Bunch-Kaufman,
//! restricted to the leading rows as in Duff and Reid, ACM TOMS 9(3), 1983).
//!
//! The caller places the entries and reads what is left; who needs the remainder is not known here.

use super::symmetric::Inertia;
use multiversion::multiversion;

/// Growth allowed in the first search for a pivot, and in the last resort before a row is left to the caller.
const THRESHOLDS: [f64; 2] = [1e-2, 1e-7];

/// Columns of the factor that one front produced.
#[derive(Clone, Debug, Default)]
pub(super) struct Factor {
    /// Unknown of every row of the front, pivots first, `[rows]`.
    pub index: Vec<usize>,
    /// Eliminated rows.
    pub pivots: usize,
    /// Columns of L below the diagonal, `[pivots * rows]`, column by column; the pivot block itself is left out.
    columns: Vec<f64>,
    /// Inverse of the pivots: diagonal entry, and the off-diagonal one with the next row where the pivot is 2x2.
    inverse: Vec<(f64, f64)>,
}

impl Factor {
    /// `b <- D^-1 L^-1 b` on the rows of this front.
    pub fn forward(&self, b: &mut [f64], local: &mut Vec<f64>) {
        let rows = self.index.len();
        local.clear();
        local.extend(self.index.iter().map(|&i| b[i]));
        let mut k = 0;
        while k < self.pivots {
            let width = self.width(k);
            let (done, rest) = local.split_at_mut(k + width);
            let top = k + width;
            for (j, &scale) in done.iter().enumerate().skip(k) {
                if scale != 0.0 {
                    let column = &self.columns[j * rows + top..(j + 1) * rows];
                    rest.iter_mut().zip(column).for_each(|(r, l)| *r -= l * scale);
                }
            }
            let (d, e) = self.inverse[k];
            if width == 1 {
                done[k] *= d;
            } else {
                let (p, q) = (done[k], done[k + 1]);
                done[k] = d * p + e * q;
                done[k + 1] = e * p + self.inverse[k + 1].0 * q;
            }
            k += width;
        }
        self.index.iter().zip(local.iter()).for_each(|(&i, &value)| b[i] = value);
    }

    /// `b <- L^-T b` on the rows of this front.
    pub fn backward(&self, b: &mut [f64], local: &mut Vec<f64>) {
        let rows = self.index.len();
        local.clear();
        local.extend(self.index.iter().map(|&i| b[i]));
        let mut end = self.pivots;
        while end > 0 {
            let width = if end >= 2 && self.width(end - 2) == 2 { 2 } else { 1 };
            for j in end - width..end {
                let column = &self.columns[j * rows + end..(j + 1) * rows];
                let sum: f64 = column.iter().zip(&local[end..]).map(|(l, x)| l * x).sum();
                local[j] -= sum;
            }
            end -= width;
        }
        self.index.iter().zip(local.iter()).for_each(|(&i, &value)| b[i] = value);
    }

    /// Rows of the pivot that starts at `k`. The second row of a 2x2 pivot carries NaN as its off-diagonal mark.
    fn width(&self, k: usize) -> usize {
        if self.inverse[k].1 != 0.0 && k + 1 < self.inverse.len() && self.inverse[k + 1].1.is_nan() {
            2
        } else {
            1
        }
    }
}

/// The matrix under elimination; lower triangle, column by column.
#[derive(Debug, Default)]
pub(super) struct Front {
    /// Unknown of every row, `[rows]`.
    pub index: Vec<usize>,
    values: Vec<f64>,
    rows: usize,
    /// Columns of the pivot before scaling, for the update of the rest.
    pivot: [Vec<f64>; 2],
}

enum Pivot {
    One(usize),
    Two(usize, usize),
}

impl Front {
    /// Empties the front and gives it the rows of `index`.
    pub fn reset(&mut self, index: impl Iterator<Item = usize>) {
        self.index.clear();
        self.index.extend(index);
        self.rows = self.index.len();
        self.values.clear();
        self.values.resize(self.rows * self.rows, 0.0);
    }

    /// Adds to the entry of two rows of the front.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        let (row, column) = if i >= j { (i, j) } else { (j, i) };
        self.values[column * self.rows + row] += value;
    }

    /// Adds to entries of one column, in rows that are not above the diagonal.
    pub fn add_column(&mut self, column: usize, rows: &[usize], values: &[f64]) {
        let target = &mut self.values[column * self.rows..(column + 1) * self.rows];
        rows.iter().zip(values).for_each(|(&row, value)| target[row] += value);
    }

    /// A column from the diagonal down.
    pub fn column(&self, column: usize) -> &[f64] {
        &self.values[column * self.rows + column..(column + 1) * self.rows]
    }

    /// Entry of two rows, `row >= column`.
    fn entry(&self, row: usize, column: usize) -> f64 {
        self.values[column * self.rows + row]
    }

    /// Eliminates what can be eliminated stably of the first `leading` rows into `factor`; the other rows of the
    /// front then hold the Schur complement. With `all`, every leading row is eliminated, whatever its pivot.
    pub fn eliminate(&mut self, leading: usize, all: bool, factor: &mut Factor, inertia: &mut Inertia) {
        factor.inverse.clear();
        factor.pivots = 0;
        let (mut k, mut from) = (0, 0);
        while k < leading {
            let Some(pivot) = self.search(k, from.clamp(k, leading), leading, all) else { break };
            from = match pivot {
                Pivot::One(i) => i + 1,
                // A row before the first of the pair stays behind, also when it is exchanged with it.
                Pivot::Two(i, _) => i + 2,
            };
            match pivot {
                Pivot::One(i) => {
                    self.swap(k, i);
                    let d = self.values[k * self.rows + k];
                    match d {
                        d if d > 0.0 => inertia.positive += 1,
                        d if d < 0.0 => inertia.negative += 1,
                        _ => inertia.zero += 1,
                    }
                    let inverse = if d == 0.0 || !d.is_finite() { 0.0 } else { 1.0 / d };
                    factor.inverse.push((inverse, 0.0));
                    self.update_one(k, inverse);
                    k += 1;
                }
                Pivot::Two(i, j) => {
                    let (i, j) = (i.min(j), i.max(j));
                    self.swap(k, i);
                    self.swap(k + 1, j);
                    let (a, b) = (self.entry(k, k), self.entry(k + 1, k));
                    let c = self.entry(k + 1, k + 1);
                    // Scaled by the off-diagonal entry, which is the largest: no overflow in the determinant.
                    let (p, q) = (a / b, c / b);
                    let determinant = p * q - 1.0;
                    if determinant < 0.0 {
                        inertia.positive += 1;
                        inertia.negative += 1;
                    } else if a > 0.0 {
                        inertia.positive += 2;
                    } else {
                        inertia.negative += 2;
                    }
                    let scale = 1.0 / (b * determinant);
                    let inverse = [q * scale, -scale, p * scale];
                    factor.inverse.push((inverse[0], inverse[1]));
                    factor.inverse.push((inverse[2], f64::NAN));
                    self.update_two(k, inverse);
                    k += 2;
                }
            }
        }
        factor.pivots = k;
        factor.index.clear();
        factor.index.extend_from_slice(&self.index);
        factor.columns.clear();
        factor.columns.extend_from_slice(&self.values[..k * self.rows]);
    }

    /// The next pivot among the rows from `k` on; the search begins at row `from`, behind those that failed before.
    fn search(&self, k: usize, from: usize, leading: usize, all: bool) -> Option<Pivot> {
        for threshold in THRESHOLDS {
            for candidate in (from..leading).chain(k..from) {
                let (inside, r, outside) = self.largest(candidate, k, leading);
                let diagonal = self.entry(candidate, candidate).abs();
                let largest = if inside > outside { inside } else { outside };
                // A row that is zero altogether is taken where nothing can come to it any more.
                if diagonal >= threshold * largest && (diagonal > 0.0 || (all && largest == 0.0)) {
                    return Some(Pivot::One(candidate));
                }
                if inside >= threshold * outside
                    && inside > 0.0
                    && self.growth((candidate, r), largest, k, leading) * threshold <= 1.0
                {
                    return Some(Pivot::Two(candidate, r));
                }
            }
        }
        if !all {
            return None;
        }
        (k..leading)
            .max_by(|&a, &b| self.entry(a, a).abs().total_cmp(&self.entry(b, b).abs()))
            .map(Pivot::One)
    }

    /// Largest entry of a row off the diagonal among the leading rows, where it is, and the largest of the rest.
    fn largest(&self, i: usize, k: usize, leading: usize) -> (f64, usize, f64) {
        let (mut inside, mut place) = (0.0, i);
        for j in k..i {
            let value = self.entry(i, j).abs();
            if value > inside {
                (inside, place) = (value, j);
            }
        }
        let column = &self.values[i * self.rows..(i + 1) * self.rows];
        for (j, value) in column.iter().enumerate().take(leading).skip(i + 1) {
            if value.abs() > inside {
                (inside, place) = (value.abs(), j);
            }
        }
        (inside, place, largest(&column[leading..]))
    }

    /// Bound of the largest entry of L that the pivot of two rows would give; `of_first` bounds the entries of the
    /// first row off the diagonal.
    fn growth(&self, (i, j): (usize, usize), of_first: f64, k: usize, leading: usize) -> f64 {
        let (a, b, c) = (self.entry(i, i), self.entry(i.max(j), i.min(j)), self.entry(j, j));
        let (p, q) = (a / b, c / b);
        let determinant = (p * q - 1.0).abs();
        if determinant <= 1e-10 {
            return f64::INFINITY;
        }
        let mi = of_first;
        let mut mj = 0.0;
        for t in (k..j).filter(|&t| t != i) {
            let value = self.entry(j, t).abs();
            mj = if value > mj { value } else { mj };
        }
        let column = &self.values[j * self.rows..(j + 1) * self.rows];
        for (t, value) in column.iter().enumerate().take(leading).skip(j + 1) {
            let value = if t == i { 0.0 } else { value.abs() };
            mj = if value > mj { value } else { mj };
        }
        let outside = largest(&column[leading..]);
        mj = if outside > mj { outside } else { mj };
        let scale = 1.0 / (b.abs() * determinant);
        ((q.abs() * mi + mj) * scale).max((mi + p.abs() * mj) * scale)
    }

    /// Exchanges two rows and their columns, with the rows of the columns that are factored already.
    fn swap(&mut self, i: usize, j: usize) {
        if i == j {
            return;
        }
        let (i, j) = (i.min(j), i.max(j));
        self.index.swap(i, j);
        let n = self.rows;
        for t in 0..i {
            self.values.swap(t * n + i, t * n + j);
        }
        for t in i + 1..j {
            self.values.swap(i * n + t, t * n + j);
        }
        for t in j + 1..n {
            self.values.swap(i * n + t, j * n + t);
        }
        self.values.swap(i * n + i, j * n + j);
    }

    fn update_one(&mut self, k: usize, inverse: f64) {
        let n = self.rows;
        let (head, tail) = self.values.split_at_mut((k + 1) * n);
        let column = &mut head[k * n + k + 1..];
        let unscaled = &mut self.pivot[0];
        unscaled.clear();
        unscaled.extend_from_slice(column);
        column.iter_mut().for_each(|value| *value *= inverse);
        subtract_one(tail, n, column, unscaled);
    }

    fn update_two(&mut self, k: usize, inverse: [f64; 3]) {
        let n = self.rows;
        let (head, tail) = self.values.split_at_mut((k + 2) * n);
        let (first, second) = head[k * n..].split_at_mut(n);
        let (first, second) = (&mut first[k + 2..], &mut second[k + 2..]);
        let [p, q] = &mut self.pivot;
        p.clear();
        q.clear();
        p.extend_from_slice(first);
        q.extend_from_slice(second);
        for ((l, m), (a, b)) in first.iter_mut().zip(second.iter_mut()).zip(p.iter().zip(q.iter())) {
            *l = inverse[0] * a + inverse[1] * b;
            *m = inverse[1] * a + inverse[2] * b;
        }
        subtract_two(tail, n, [first, second], [p, q]);
    }
}

/// `target -= column factors^T` on the lower triangle of the last rows of `target`, whose columns have `rows` entries.
#[multiversion(targets("x86_64+avx2"))]
fn subtract_one(target: &mut [f64], rows: usize, column: &[f64], factors: &[f64]) {
    for (j, &factor) in factors.iter().enumerate() {
        if factor != 0.0 {
            let target = &mut target[(j + 1) * rows - (column.len() - j)..(j + 1) * rows];
            target.iter_mut().zip(&column[j..]).for_each(|(t, l)| *t -= l * factor);
        }
    }
}

/// Same as above with two columns.
#[multiversion(targets("x86_64+avx2"))]
fn subtract_two(target: &mut [f64], rows: usize, columns: [&[f64]; 2], factors: [&[f64]; 2]) {
    for (j, (&a, &b)) in factors[0].iter().zip(factors[1]).enumerate() {
        if a != 0.0 || b != 0.0 {
            let target = &mut target[(j + 1) * rows - (columns[0].len() - j)..(j + 1) * rows];
            let both = columns[0][j..].iter().zip(&columns[1][j..]);
            target.iter_mut().zip(both).for_each(|(t, (l, m))| *t -= l * a + m * b);
        }
    }
}

/// Largest magnitude; four running maxima, which the processor takes side by side.
fn largest(values: &[f64]) -> f64 {
    let mut running = [0.0f64; 4];
    let chunks = values.chunks_exact(4);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (m, value) in running.iter_mut().zip(chunk) {
            let value = value.abs();
            *m = if value > *m { value } else { *m };
        }
    }
    let all = running.iter().chain(rest);
    all.fold(0.0, |m, value| if value.abs() > m { value.abs() } else { m })
}
