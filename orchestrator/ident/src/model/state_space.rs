//! State space with direct term and, if known, innovation gain.

use nalgebra::{DMatrix, DVector};

use super::Model;
use crate::record::Record;
use airloop_optim::linalg::spectral;

/// `x(k+1) = A x(k) + B u(k) + K e(k)`, `y(k) = C x(k) + D u(k) + e(k)`, about an operating point.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// Sample time \[s\].
    pub sample_time: f64,
    /// A, shape \[n_x, n_x\].
    pub a: DMatrix<f64>,
    /// B, shape \[n_x, n_u\].
    pub b: DMatrix<f64>,
    /// C, shape \[n_y, n_x\].
    pub c: DMatrix<f64>,
    /// D, shape \[n_y, n_u\].
    pub d: DMatrix<f64>,
    /// Innovation gain K, shape \[n_x, n_y\]; without one the one-step prediction is the simulation.
    pub gain: Option<DMatrix<f64>>,
    /// Operating point of the inputs, shape \[n_u\].
    pub input_offset: Vec<f64>,
    /// Operating point of the outputs, shape \[n_y\].
    pub output_offset: Vec<f64>,
}

impl StateSpace {
    /// Order n_x.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// The first `n` Markov parameters D, C B, C A B, ..: the response to an impulse, each of shape \[n_y, n_u\].
    pub fn markov_parameters(&self, n: usize) -> Vec<DMatrix<f64>> {
        let mut power = self.b.clone();
        let mut found = vec![self.d.clone()];
        while found.len() < n {
            found.push(&self.c * &power);
            power = &self.a * power;
        }
        found.truncate(n);
        found
    }

    /// Outputs, shape \[n_y\]\[n\], from the initial state `x0` and the inputs, shape \[n_u\]\[n\].
    pub fn simulate_from(&self, x0: &DVector<f64>, inputs: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.outputs(x0, inputs, None)
    }

    /// Predictor (`measured` given, with the gain) or simulation.
    fn outputs(
        &self,
        x0: &DVector<f64>,
        inputs: &[Vec<f64>],
        measured: Option<&[Vec<f64>]>,
    ) -> Vec<Vec<f64>> {
        let (n_x, n_u, n_y) = (self.order(), self.d.ncols(), self.d.nrows());
        let n = inputs.first().map_or(0, Vec::len);
        let (mut x, mut next) = (x0.clone(), DVector::zeros(n_x));
        let mut u = DVector::zeros(n_u);
        let mut y = DVector::zeros(n_y);
        let mut outputs = vec![vec![0.0; n]; n_y];
        for k in 0..n {
            for j in 0..n_u {
                u[j] = inputs[j][k] - self.input_offset[j];
            }
            y.gemv(1.0, &self.c, &x, 0.0);
            y.gemv(1.0, &self.d, &u, 1.0);
            next.gemv(1.0, &self.a, &x, 0.0);
            next.gemv(1.0, &self.b, &u, 1.0);
            for i in 0..n_y {
                outputs[i][k] = y[i] + self.output_offset[i];
            }
            if let (Some(gain), Some(measured)) = (&self.gain, measured) {
                for i in 0..n_y {
                    y[i] = measured[i][k] - outputs[i][k];
                }
                next.gemv(1.0, gain, &y, 1.0);
            }
            std::mem::swap(&mut x, &mut next);
        }
        outputs
    }

    /// Initial state that brings the simulation closest to the measured outputs (least squares over the whole record;
    /// by singular values, so that a state that the record does not show is left at 0), shape \[n_x\].
    pub fn initial_state(&self, record: &Record) -> DVector<f64> {
        let (n_x, n_y) = (self.order(), self.d.nrows());
        let mut rest = self.simulate_from(&DVector::zeros(n_x), &record.inputs);
        for (rest, measured) in rest.iter_mut().zip(&record.outputs) {
            rest.iter_mut().zip(measured).for_each(|(rest, measured)| *rest = measured - *rest);
        }
        // Normal equations are avoided: the free response is orthogonalized block by block as it decays.
        let mut stacked = DMatrix::<f64>::zeros(n_x + 1 + n_y, n_x + 1);
        let mut power = DMatrix::<f64>::identity(n_x, n_x);
        for k in 0..record.len() {
            stacked.view_mut((n_x + 1, 0), (n_y, n_x)).copy_from(&(&self.c * &power));
            for (i, rest) in rest.iter().enumerate() {
                stacked[(n_x + 1 + i, n_x)] = rest[k];
            }
            if !stacked.iter().all(|value| value.is_finite()) {
                break;
            }
            let r = stacked.clone().qr().unpack_r();
            stacked.fill(0.0);
            stacked.view_mut((0, 0), (n_x + 1, n_x + 1)).copy_from(&r);
            power = &self.a * power;
            if power.amax() < 1e-12 {
                break;
            }
        }
        let r = stacked.view((0, 0), (n_x, n_x)).into_owned();
        let rhs = stacked.view((0, n_x), (n_x, 1)).column(0).into_owned();
        let svd = spectral::svd(r, true, true);
        let threshold = svd.singular_values.max() * 1e-10;
        svd.solve(&rhs, threshold).unwrap_or_else(|_| DVector::zeros(n_x))
    }
}

impl Model for StateSpace {
    fn n_u(&self) -> usize {
        self.d.ncols()
    }

    fn n_y(&self) -> usize {
        self.d.nrows()
    }

    fn sample_time(&self) -> f64 {
        self.sample_time
    }

    fn simulate(&self, record: &Record) -> Vec<Vec<f64>> {
        self.simulate_from(&self.initial_state(record), &record.inputs)
    }

    fn one_step(&self, record: &Record) -> Vec<Vec<f64>> {
        self.outputs(&self.initial_state(record), &record.inputs, Some(&record.outputs))
    }

    fn warm_up(&self) -> usize {
        0
    }

    fn to_state_space(&self) -> StateSpace {
        self.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> StateSpace {
        StateSpace {
            sample_time: 0.1,
            a: DMatrix::from_row_slice(2, 2, &[0.9, 0.2, -0.2, 0.8]),
            b: DMatrix::from_row_slice(2, 1, &[1.0, 0.5]),
            c: DMatrix::from_row_slice(1, 2, &[1.0, -1.0]),
            d: DMatrix::from_row_slice(1, 1, &[0.3]),
            gain: None,
            input_offset: vec![2.0],
            output_offset: vec![-1.0],
        }
    }

    #[test]
    fn the_initial_state_of_a_simulated_record_is_found_again() {
        let x0 = DVector::from_vec(vec![0.7, -1.1]);
        let inputs = vec![(0..200).map(|k| (0.3 * f64::from(k)).sin()).collect::<Vec<_>>()];
        let outputs = model().simulate_from(&x0, &inputs);
        let record = Record { sample_time: 0.1, inputs, outputs, ..Record::default() };
        assert!((model().initial_state(&record) - x0).amax() < 1e-10);
    }

    #[test]
    fn at_the_operating_point_the_output_is_its_offset() {
        let y = model().simulate_from(&DVector::zeros(2), &[vec![2.0; 5]]);
        assert_eq!(y, [vec![-1.0; 5]]);
    }
}
