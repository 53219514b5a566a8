//! Columns of a least-squares problem that are shifted signals, and their rows.

use nalgebra::DMatrix;

use airloop_optim::linalg::StreamedQr;

/// A column: `sign * signal(k - shift)` for every output, zero before the first and after the last sample of the
/// signal.
#[derive(Debug, Clone, Copy)]
pub struct Column<'a> {
    /// Signal of every output, shape \[n_y\]\[n\].
    pub signal: &'a [Vec<f64>],
    /// Shift \[samples\].
    pub shift: usize,
    /// Factor.
    pub sign: f64,
}

impl<'a> Column<'a> {
    /// The signal itself.
    pub fn of(signal: &'a [Vec<f64>]) -> Column<'a> {
        Column { signal, shift: 0, sign: 1.0 }
    }
}

/// Folds the rows of samples `samples`; the rows of one sample (one per output) are multiplied by `root`.
pub fn fold_columns(
    columns: &[Column],
    samples: std::ops::Range<usize>,
    root: &DMatrix<f64>,
    fold: &mut StreamedQr,
) {
    let n_y = root.nrows();
    let mut first = samples.start;
    while first < samples.end {
        let count = (fold.room(n_y) / n_y).min(samples.end - first);
        for (index, column) in columns.iter().enumerate() {
            let rows = fold.column(index, count * n_y);
            rows.fill(0.0);
            // Samples of the chunk that lie before or after the shifted signal stay zero.
            let absent = column.shift.saturating_sub(first).min(count);
            for (i, rows) in rows.chunks_exact_mut(count).enumerate() {
                for (l, signal) in column.signal.iter().enumerate() {
                    let weight = column.sign * root[(i, l)];
                    let from = (first + absent).saturating_sub(column.shift);
                    if weight == 0.0 || absent == count || from >= signal.len() {
                        continue;
                    }
                    let values = &signal[from..signal.len().min(from + count - absent)];
                    rows[absent..].iter_mut().zip(values).for_each(|(row, value)| *row += weight * value);
                }
            }
        }
        fold.commit(count * n_y);
        first += count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_the_shifted_and_weighted_signals() {
        let (s, t) =
            ([vec![1.0, 2.0, 3.0], vec![0.5, 0.0, -1.0]], [vec![1.0, 1.0, 1.0], vec![2.0, 0.0, 1.0]]);
        let columns = [Column { signal: &s, shift: 2, sign: -1.0 }, Column::of(&t)];
        let root = DMatrix::from_row_slice(2, 2, &[2.0, 0.0, 1.0, 3.0]);
        let mut fold = StreamedQr::new(2);
        fold_columns(&columns, 1..3, &root, &mut fold);
        let r = fold.finish().into_r();
        // Only sample 2 has an entry in the first column: -root [1, 0.5] = [-2, -2.5].
        let first = [0.0, 0.0, -2.0, -2.5];
        // root [1, 0] and root [1, 1]
        let second = [2.0, 1.0, 2.0, 4.0];
        let product: f64 = first.iter().zip(second).map(|(a, b)| a * b).sum();
        let gram = r.transpose() * &r;
        assert!((gram[(0, 0)] - 10.25).abs() < 1e-12);
        assert!((gram[(0, 1)] - product).abs() < 1e-12);
        assert!((gram[(1, 1)] - 25.0).abs() < 1e-12);
    }
}
