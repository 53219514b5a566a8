//! Records with known answers, for tests.

use nalgebra::DMatrix;

use super::model::{Arx, Model};
use super::rational::{Coefficient, Mask};
use super::record::Record;
use airloop_optim::linalg::StreamedQr;
use airloop_optim::linalg::triangular::solve;

/// Normal random numbers, the same on every machine.
pub struct Noise(u64);

impl Noise {
    /// A sequence of its own for every seed.
    pub fn new(seed: u64) -> Noise {
        let mut noise = Noise(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..8).for_each(|_| _ = noise.uniform());
        noise
    }

    /// Uniform number in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Normal number with mean 0 and variance 1.
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = ((-2.0 * self.uniform().ln()).sqrt(), std::f64::consts::TAU * self.uniform());
        radius * angle.cos()
    }
}

/// Eq. 8 of the paper.
pub fn eq8() -> Arx {
    Arx {
        sample_time: 1e-3,
        a: vec![DMatrix::from_row_slice(2, 2, &[-1.0144, 0.0216, -0.0527, -0.9537])],
        b: vec![
            DMatrix::from_row_slice(2, 1, &[0.6619, 0.0764]),
            DMatrix::from_row_slice(2, 1, &[-0.6557, -0.0847]),
        ],
        input_offset: vec![0.0],
        output_offset: vec![0.0, 0.0],
    }
}

/// Random stairs \[n\] of +-`amplitude`, held for 20 to 150 samples.
pub fn stairs(n: usize, amplitude: f64, noise: &mut Noise) -> Vec<f64> {
    let mut u = Vec::with_capacity(n + 150);
    while u.len() < n {
        let (level, hold) = (amplitude * (2.0 * noise.uniform() - 1.0), 20.0 + 130.0 * noise.uniform());
        u.extend(std::iter::repeat_n(level, hold as usize));
    }
    u.truncate(n);
    u
}

/// A record of a model from rest under `inputs` \[n_u\]\[n\], with white measurement noise of standard deviation
/// `deviation`.
pub fn measure(model: &dyn Model, inputs: Vec<Vec<f64>>, deviation: f64, noise: &mut Noise) -> Record {
    let mut model = model.to_state_space();
    let offsets = std::mem::replace(&mut model.input_offset, vec![0.0; inputs.len()]);
    let x0 = nalgebra::DVector::zeros(model.order());
    let mut outputs = model.simulate_from(&x0, &inputs);
    outputs.iter_mut().flatten().for_each(|y| *y += deviation * noise.normal());
    let inputs = inputs
        .into_iter()
        .zip(offsets)
        .map(|(u, offset)| u.into_iter().map(|u| u + offset).collect())
        .collect();
    Record { name: "synthetic".into(), sample_time: model.sample_time, start: 0.0, inputs, outputs }
}

/// Plain least squares, equation by equation.
pub fn least_squares(template: &Arx, mask: &Mask, records: &[Record]) -> Arx {
    let coefficients = mask.coefficients();
    let mut fold = StreamedQr::new(coefficients.len() + 1);
    for record in records {
        for k in mask.lags()..record.len() {
            for i in 0..record.outputs.len() {
                fold.room(1);
                for (index, coefficient) in coefficients.iter().enumerate() {
                    fold.column(index, 1)[0] = match *coefficient {
                        Coefficient::A { lag, row, column } if row == i => -record.outputs[column][k - lag],
                        Coefficient::B { lag, row, column } if row == i => record.inputs[column][k - lag],
                        _ => 0.0,
                    };
                }
                fold.column(coefficients.len(), 1)[0] = record.outputs[i][k];
                fold.commit(1);
            }
        }
    }
    let r = fold.finish().into_r();
    let p = coefficients.len();
    let z = r.view((0, p), (p, 1)).column(0).into_owned();
    mask.model(template, &solve(&r.view((0, 0), (p, p)).into_owned(), &z, 1e-14).0)
}
