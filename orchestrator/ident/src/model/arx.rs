//! ARX, eq. 6: `A(z) y(k) = B(z) u(k) + e(k)` with full matrices.

use nalgebra::DMatrix;

use super::{Model, StateSpace};
use crate::record::Record;

/// `y(k) + A1 y(k-1) + .. = B0 u(k) + B1 u(k-1) + .. + e(k)` (eq. 6), about an operating point.
#[derive(Debug, Clone, PartialEq)]
pub struct Arx {
    /// Sample time \[s\].
    pub sample_time: f64,
    /// A1, A2, ..: shape \[n_y, n_y\] each.
    pub a: Vec<DMatrix<f64>>,
    /// B0, B1, ..: shape \[n_y, n_u\] each; `b[j]` belongs to `u(k - j)`, so that leading zeros are the delay `n_k`.
    pub b: Vec<DMatrix<f64>>,
    /// Operating point of the inputs, shape \[n_u\].
    pub input_offset: Vec<f64>,
    /// Operating point of the outputs, shape \[n_y\].
    pub output_offset: Vec<f64>,
}

impl Arx {
    /// Samples before `k` that `y(k)` depends on.
    pub fn lags(&self) -> usize {
        self.a.len().max(self.b.len().saturating_sub(1))
    }

    /// Outputs from the difference equation: past outputs measured (`free` false) or its own (`free` true).
    fn outputs(&self, record: &Record, free: bool) -> Vec<Vec<f64>> {
        let (n_y, n_u, n) = (self.n_y(), self.n_u(), record.len());
        let lags = self.lags().min(n);
        let about = |values: &Vec<f64>, offset: f64| values.iter().map(|value| value - offset).collect();
        let u: Vec<Vec<f64>> = (0..n_u).map(|j| about(&record.inputs[j], self.input_offset[j])).collect();
        let measured: Vec<Vec<f64>> =
            (0..n_y).map(|i| about(&record.outputs[i], self.output_offset[i])).collect();
        let mut y = measured.clone();
        for k in lags..n {
            for i in 0..n_y {
                let mut sum = 0.0;
                for (lag, a) in self.a.iter().enumerate() {
                    for l in 0..n_y {
                        let past = if free { &y } else { &measured };
                        sum -= a[(i, l)] * past[l][k - 1 - lag];
                    }
                }
                for (lag, b) in self.b.iter().enumerate() {
                    for j in 0..n_u {
                        sum += b[(i, j)] * u[j][k - lag];
                    }
                }
                y[i][k] = sum;
            }
        }
        for (values, offset) in y.iter_mut().zip(&self.output_offset) {
            values.iter_mut().for_each(|value| *value += offset);
        }
        y
    }
}

impl Model for Arx {
    fn n_u(&self) -> usize {
        self.input_offset.len()
    }

    fn n_y(&self) -> usize {
        self.output_offset.len()
    }

    fn sample_time(&self) -> f64 {
        self.sample_time
    }

    fn simulate(&self, record: &Record) -> Vec<Vec<f64>> {
        self.outputs(record, true)
    }

    fn one_step(&self, record: &Record) -> Vec<Vec<f64>> {
        self.outputs(record, false)
    }

    fn warm_up(&self) -> usize {
        self.lags()
    }

    /// Observer form: block i of the state (n_y values each) holds what the past contributes to `y(k + i)`,
    /// `x_i(k+1) = x_{i+1}(k) - A_{i+1} y(k) + B_{i+1} u(k)`, `y(k) = x_0(k) + B0 u(k)`.
    fn to_state_space(&self) -> StateSpace {
        let (n_y, n_u, blocks) = (self.n_y(), self.n_u(), self.lags());
        let zero_a = DMatrix::zeros(n_y, n_y);
        let zero_b = DMatrix::zeros(n_y, n_u);
        let d = self.b.first().unwrap_or(&zero_b).clone();
        let mut a = DMatrix::zeros(n_y * blocks, n_y * blocks);
        let mut b = DMatrix::zeros(n_y * blocks, n_u);
        let mut c = DMatrix::zeros(n_y, n_y * blocks);
        for block in 0..blocks {
            let a_lag = self.a.get(block).unwrap_or(&zero_a);
            let b_lag = self.b.get(block + 1).unwrap_or(&zero_b);
            a.view_mut((block * n_y, 0), (n_y, n_y)).copy_from(&-a_lag);
            if block + 1 < blocks {
                a.view_mut((block * n_y, (block + 1) * n_y), (n_y, n_y)).fill_with_identity();
            }
            b.view_mut((block * n_y, 0), (n_y, n_u)).copy_from(&(b_lag - a_lag * &d));
        }
        if blocks > 0 {
            c.view_mut((0, 0), (n_y, n_y)).fill_with_identity();
        }
        StateSpace {
            sample_time: self.sample_time,
            a,
            b,
            c,
            d,
            gain: None,
            input_offset: self.input_offset.clone(),
            output_offset: self.output_offset.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::eq8;

    fn step(n: usize) -> Record {
        Record {
            sample_time: 1e-3,
            // The first measured sample is the first sample of the response: B0.
            inputs: vec![vec![1.0; n]],
            outputs: vec![
                [vec![0.6619], vec![0.0; n - 1]].concat(),
                [vec![0.0764], vec![0.0; n - 1]].concat(),
            ],
            ..Record::default()
        }
    }

    #[test]
    fn the_step_response_of_eq_8_has_the_published_values() {
        let y = eq8().simulate(&step(4000));
        for (k, expected) in [(10, 0.29220145), (50, 0.85012267), (100, 1.05908383)] {
            assert!((y[1][k] - expected).abs() < 1e-8, "k = {k}: {}", y[1][k]);
        }
        assert!((y[0][3999] - 0.98884648).abs() < 1e-8 && (y[1][3999] - 0.94626802).abs() < 1e-8);
    }

    #[test]
    fn poles_are_those_of_the_difference_equation() {
        let mut poles = eq8().poles();
        poles.sort_by(|a, b| a.im.total_cmp(&b.im));
        assert!((poles[1].re - 0.98405).abs() < 1e-8 && (poles[1].im - 0.01473762).abs() < 1e-8);
        assert!(eq8().is_stable());
    }

    #[test]
    fn the_state_space_form_has_the_same_impulse_response() {
        let mut arx = eq8();
        arx.a.push(DMatrix::from_row_slice(2, 2, &[0.1, 0.02, -0.03, 0.05]));
        arx.b.push(DMatrix::from_row_slice(2, 1, &[0.2, -0.1]));
        arx.b.push(DMatrix::from_row_slice(2, 1, &[0.0, 0.3]));
        let n = 40;
        let lags = arx.lags();
        let mut impulse = vec![0.0; n];
        impulse[lags] = 1.0;
        let record = Record {
            sample_time: 1e-3,
            inputs: vec![impulse],
            outputs: vec![vec![0.0; n]; 2],
            ..Record::default()
        };
        let expected = arx.simulate(&record);
        let model = arx.to_state_space();
        let found = model.simulate_from(&nalgebra::DVector::zeros(model.a.nrows()), &record.inputs);
        for i in 0..2 {
            for k in 0..n {
                assert!((expected[i][k] - found[i][k]).abs() < 1e-12, "y{i}({k})");
            }
        }
    }

    #[test]
    fn one_step_predictions_use_measured_outputs() {
        let mut record = step(20);
        record.outputs[1][9] = 5.0;
        let y = eq8().one_step(&record);
        assert!((y[1][10] - (0.9537 * 5.0 + 0.0764 - 0.0847)).abs() < 1e-12);
    }
}
