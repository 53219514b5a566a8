//! `A(z)^-1` as a filter, and a record filtered by it.
//!
//! Everything that linear estimators of `A(z) y = B(z) u` need are shifts of few filtered signals: `A(z)^-1 e_i s` for
//! every equation i and every signal s (an output, an input, or an impulse for the initial state).

use nalgebra::DMatrix;

use airloop_optim::linalg::qr::dot;

/// `v(k) = f(k) - A1 v(k-1) - A2 v(k-2) ..`, at rest before the first sample.
#[derive(Debug, Clone)]
pub struct Inverse {
    n_y: usize,
    lags: usize,
    /// Row i: coefficients of equation i, oldest lag first, shape \[n_y, lags n_y\].
    rows: Vec<f64>,
}

impl Inverse {
    /// The filter of `A1, A2, ..`, shape \[n_y, n_y\] each.
    pub fn new(a: &[DMatrix<f64>], n_y: usize) -> Inverse {
        let mut rows = Vec::with_capacity(n_y * n_y * a.len());
        for i in 0..n_y {
            for a in a.iter().rev() {
                rows.extend(a.row(i).iter().map(|value| -value));
            }
        }
        Inverse { n_y, lags: a.len(), rows }
    }

    /// Response to a forcing of `n` samples, shape \[n_y\]\[n\]; `force` adds `f(k)` to a slice of zeros, shape
    /// \[n_y\].
    pub fn run(&self, n: usize, mut force: impl FnMut(usize, &mut [f64])) -> Vec<Vec<f64>> {
        let (n_y, width) = (self.n_y, self.n_y * self.lags);
        let mut all = vec![0.0; width + n * n_y];
        for k in 0..n {
            let (past, now) = all.split_at_mut(width + k * n_y);
            let (past, now) = (&past[k * n_y..], &mut now[..n_y]);
            force(k, now);
            for (value, row) in now.iter_mut().zip(self.rows.chunks_exact(width.max(1))) {
                *value += dot(row, past);
            }
        }
        let of = |i: usize| all[width..].iter().skip(i).step_by(n_y).copied().collect();
        (0..n_y).map(of).collect()
    }

    /// `A(z)^-1 e_i s` for every equation i, shape \[n_y\]\[n_y\]\[n\].
    pub fn columns(&self, signal: &[f64]) -> Vec<Vec<Vec<f64>>> {
        (0..self.n_y).map(|i| self.run(signal.len(), |k, now| now[i] = signal[k])).collect()
    }

    /// Impulse responses `A(z)^-1 e_i`, shape \[n_y\]\[n_y\]\[m\], as far as they are not negligible; `m` is at most
    /// `n`.
    pub fn impulses(&self, n: usize) -> Vec<Vec<Vec<f64>>> {
        let mut length = n.min(256);
        loop {
            let mut impulse = vec![0.0; length];
            impulse.iter_mut().take(1).for_each(|first| *first = 1.0);
            let mut responses = self.columns(&impulse);
            let peak = responses.iter().flatten().flatten().fold(0.0f64, |peak, value| peak.max(value.abs()));
            let last = |response: &Vec<f64>| response.iter().rposition(|value| value.abs() > 1e-10 * peak);
            let decayed = responses.iter().flatten().filter_map(last).max().map_or(0, |last| last + 1);
            // A quarter of silence: a slow oscillation passes through zero, but not for that long.
            if length == n || decayed + length / 4 < length {
                responses.iter_mut().flatten().for_each(|response| response.truncate(decayed));
                return responses;
            }
            length = n.min(4 * length);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_impulse_response_is_that_of_the_difference_equation() {
        let a = [DMatrix::from_row_slice(1, 1, &[-0.5]), DMatrix::from_row_slice(1, 1, &[0.06])];
        // 1 / ((1 - 0.2 q)(1 - 0.3 q)): partial fractions 3 * 0.3^k - 2 * 0.2^k
        let response = Inverse::new(&a, 1).impulses(60);
        let decayed = response[0][0].len();
        for (k, value) in response[0][0].iter().enumerate() {
            let k = i32::try_from(k).unwrap();
            assert!((value - (3.0 * 0.3f64.powi(k) - 2.0 * 0.2f64.powi(k))).abs() < 1e-15);
        }
        assert!((18..22).contains(&decayed), "{decayed}");
    }

    #[test]
    fn without_a_the_forcing_passes() {
        let out = Inverse::new(&[], 2).run(3, |k, now| now[1] = k as f64);
        assert_eq!(out, [vec![0.0; 3], vec![0.0, 1.0, 2.0]]);
    }
}
