//! The responses of an ARX model to an experiment, block by block, in memory that does not grow with the experiment.
//!
//! The same numbers as [`Model::simulate`](super::model::Model::simulate) and
//! [`Model::one_step`](super::model::Model::one_step), which need the whole record.

use super::model::Arx;
use super::record::Error;
use super::source::{BLOCK, Source, Window};

/// New samples of an experiment with the responses to them.
#[derive(Debug, Clone, Copy)]
pub struct Played<'a> {
    /// Index of the first of them in the experiment.
    pub at: usize,
    /// Inputs, shape \[n_u\]\[n\].
    pub inputs: &'a [&'a [f64]],
    /// Measured outputs, shape \[n_y\]\[n\].
    pub outputs: &'a [&'a [f64]],
    /// Free simulation, shape \[n_y\]\[n\]; none for an unstable model.
    pub simulated: Option<&'a [Vec<f64>]>,
    /// One-step prediction, shape \[n_y\]\[n\].
    pub one_step: &'a [Vec<f64>],
}

/// A model laid out for speed.
#[derive(Debug, Clone)]
pub struct Playback<'a> {
    model: &'a Arx,
    simulate: bool,
    lags: usize,
    /// `-A` of each output over the past `[y(k-na), .., y(k-1)]`, all outputs of a sample side by side.
    past: Vec<Vec<f64>>,
}

impl<'a> Playback<'a> {
    /// Of a model; `simulate` is false for an unstable one.
    pub fn new(model: &'a Arx, simulate: bool) -> Playback<'a> {
        let n_y = model.output_offset.len();
        let past = |output: usize| {
            let by_lag = model.a.iter().rev();
            by_lag.flat_map(|a| (0..n_y).map(move |l| -a[(output, l)])).collect()
        };
        Playback { model, simulate, lags: model.lags(), past: (0..n_y).map(past).collect() }
    }

    /// First samples that are those of the measurement.
    pub fn warm_up(&self) -> usize {
        self.lags
    }

    /// Reads the experiment once and hands its samples with the responses to `take`, in order.
    ///
    /// # Errors
    /// Errors of reading the records.
    pub fn run(&self, source: &dyn Source, take: &mut dyn FnMut(Played)) -> Result<(), Error> {
        let (lags, n_y) = (self.lags, self.past.len());
        let mut one_step = vec![Vec::with_capacity(BLOCK); n_y];
        let mut forced = vec![Vec::with_capacity(BLOCK); n_y];
        let mut simulated = vec![Vec::with_capacity(BLOCK); n_y];
        // Simulated outputs about the operating point, `lags` old samples first, all outputs of a sample side by side.
        let mut free: Vec<f64> = vec![0.0; lags * n_y];
        source.windows(lags, &mut |window| {
            let n = window.len() - window.before;
            let known = lags.saturating_sub(window.at).min(n);
            for i in 0..n_y {
                let measured = &window.outputs[i][window.before..];
                self.forced(&window, i, known, &mut forced[i]);
                one_step[i].clear();
                one_step[i].extend_from_slice(&forced[i]);
                self.add_past(&window, i, known, &mut one_step[i]);
                let offset = self.model.output_offset[i];
                one_step[i].iter_mut().for_each(|y| *y += offset);
                one_step[i][..known].copy_from_slice(&measured[..known]);
            }
            if self.simulate {
                self.simulate(&window, known, &forced, &mut free);
                for (i, simulated) in simulated.iter_mut().enumerate() {
                    let offset = self.model.output_offset[i];
                    simulated.clear();
                    simulated.extend(free[lags * n_y..].iter().skip(i).step_by(n_y).map(|y| y + offset));
                    simulated[..known]
                        .copy_from_slice(&window.outputs[i][window.before..window.before + known]);
                }
                free.drain(..n * n_y);
            }
            let inputs: Vec<&[f64]> = window.inputs.iter().map(|u| &u[window.before..]).collect();
            let outputs: Vec<&[f64]> = window.outputs.iter().map(|y| &y[window.before..]).collect();
            take(Played {
                at: window.at,
                inputs: &inputs,
                outputs: &outputs,
                simulated: self.simulate.then_some(simulated.as_slice()),
                one_step: &one_step,
            });
        })
    }

    /// Contribution of the inputs to output `i` at the new samples; zeros at the first `known`.
    fn forced(&self, window: &Window, i: usize, known: usize, out: &mut Vec<f64>) {
        out.clear();
        out.resize(window.len() - window.before, 0.0);
        let rows = &mut out[known..];
        for (lag, b) in self.model.b.iter().enumerate() {
            for (j, input) in window.inputs.iter().enumerate() {
                let (b, offset) = (b[(i, j)], self.model.input_offset[j]);
                if b != 0.0 && !rows.is_empty() {
                    let past = &input[window.before + known - lag..];
                    rows.iter_mut().zip(past).for_each(|(y, u)| *y += b * (u - offset));
                }
            }
        }
    }

    /// Adds what measured past outputs contribute to output `i`.
    fn add_past(&self, window: &Window, i: usize, known: usize, out: &mut [f64]) {
        let rows = &mut out[known..];
        for (lag, a) in self.model.a.iter().enumerate() {
            for (l, output) in window.outputs.iter().enumerate() {
                let (a, offset) = (a[(i, l)], self.model.output_offset[l]);
                if a != 0.0 && !rows.is_empty() {
                    let past = &output[window.before + known - lag - 1..];
                    rows.iter_mut().zip(past).for_each(|(y, past)| *y -= a * (past - offset));
                }
            }
        }
    }

    /// Appends the free simulation at the new samples to `free`; the first `known` are measured.
    fn simulate(&self, window: &Window, known: usize, forced: &[Vec<f64>], free: &mut Vec<f64>) {
        let n_y = self.past.len();
        for k in 0..known {
            let measured = window.outputs.iter().zip(&self.model.output_offset);
            free.extend(measured.map(|(y, offset)| y[window.before + k] - offset));
        }
        let depth = self.model.a.len() * n_y;
        for k in known..window.len() - window.before {
            let end = free.len();
            for (row, forced) in self.past.iter().zip(forced) {
                let past = &free[end - depth..end];
                let sum: f64 = row.iter().zip(past).map(|(a, y)| a * y).sum();
                free.push(sum + forced[k]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::record::Record;
    use nalgebra::DMatrix;

    #[test]
    fn blocks_give_the_same_as_the_whole_record() {
        let model = Arx {
            sample_time: 0.1,
            a: vec![
                DMatrix::from_row_slice(2, 2, &[-1.2, 0.1, -0.05, -0.9]),
                DMatrix::from_row_slice(2, 2, &[0.4, -0.02, 0.03, 0.2]),
            ],
            b: vec![
                DMatrix::zeros(2, 2),
                DMatrix::zeros(2, 2),
                DMatrix::zeros(2, 2),
                DMatrix::from_element(2, 2, 0.7),
            ],
            input_offset: vec![0.5, -1.0],
            output_offset: vec![3.0, 100.0],
        };
        for n in [2, 3, 4, 5000, 3 * BLOCK, 3 * BLOCK + 1] {
            let wave = |scale: f64, phase: f64| -> Vec<f64> {
                (0..n).map(|k| scale * (0.01 * (k as f64).powf(1.1) + phase).sin()).collect()
            };
            let record = Record {
                name: "r".into(),
                sample_time: 0.1,
                start: 0.0,
                inputs: vec![wave(1.0, 0.0), wave(2.0, 1.0)],
                outputs: vec![wave(5.0, 2.0), wave(7.0, 3.0)],
            };
            let (simulated, one_step) = (model.simulate(&record), model.one_step(&record));
            let mut samples = 0;
            Playback::new(&model, true)
                .run(&record, &mut |played| {
                    assert_eq!(played.at, samples);
                    for i in 0..2 {
                        for (k, y) in played.simulated.unwrap()[i].iter().enumerate() {
                            assert!(
                                (y - simulated[i][played.at + k]).abs() < 1e-9,
                                "y{i}({})",
                                played.at + k
                            );
                            let predicted = played.one_step[i][k];
                            assert!((predicted - one_step[i][played.at + k]).abs() < 1e-9);
                            assert_eq!(played.outputs[i][k], record.outputs[i][played.at + k]);
                        }
                    }
                    samples += played.outputs[0].len();
                })
                .unwrap();
            assert_eq!(samples, n);
        }
    }
}
