//! Whether a model can be trusted: residual tests, poles and zeros, responses with their uncertainty, and a verdict.
//!
//! Start with [`diagnose`]; [`verdict::verdict`] puts it into words.

pub mod chi_squared;
pub mod residuals;
pub mod response;
pub mod verdict;
pub mod zeros;

use nalgebra::Complex;
use serde::Serialize;

use super::model::Model;
use super::parameters::Interval;
use super::record::Record;
use residuals::{Autocorrelation, CrossCorrelation};
use response::{Family, FrequencyResponse, StepResponse};

/// Residuals that are tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Measured minus one-step prediction: for equation-error and prediction-error estimates.
    OneStep,
    /// Measured minus simulated from the best initial state: for output-error and instrumental-variable estimates. An
    /// unstable model is tested by its one-step prediction.
    Simulated,
}

/// Settings of [`diagnose`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Residuals that are tested.
    pub kind: Kind,
    /// Largest lag of the correlations; 25 by default.
    pub lags: usize,
    /// Past outputs per equation that the model was fitted with (na of an ARX model estimated by least squares, else
    /// 0): as many degrees of freedom less in the whiteness test.
    pub fitted_lags: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options { kind: Kind::Simulated, lags: 25, fitted_lags: 0 }
    }
}

/// A pole or zero in the z plane, and what it means in time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Root {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
    /// Modulus.
    pub modulus: f64,
    /// Natural frequency `|ln z| / (2 pi T)` \[Hz\]; `None` at z = 0.
    pub frequency: Option<f64>,
    /// Damping ratio `-cos(arg(ln z))`; `None` at z = 0 and z = 1.
    pub damping: Option<f64>,
}

impl Root {
    /// From a place in the z plane and the sample time \[s\].
    pub fn new(z: Complex<f64>, sample_time: f64) -> Root {
        let s = z.ln();
        let known = z.norm() > 1e-9;
        Root {
            re: z.re,
            im: z.im,
            modulus: z.norm(),
            frequency: known.then(|| s.norm() / (std::f64::consts::TAU * sample_time)),
            damping: (known && s.norm() > 1e-12).then(|| -s.re / s.norm()),
        }
    }
}

/// Zeros of one channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelZeros {
    /// Name of the input.
    pub input: String,
    /// Name of the output.
    pub output: String,
    /// Zeros.
    pub zeros: Vec<Root>,
}

/// Everything that speaks for or against a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnostics {
    /// Residuals that were tested.
    pub residuals: Kind,
    /// Samples tested.
    pub samples: usize,
    /// RMS of every residual relative to the spread of its output (root mean square about the mean), shape \[n_y\];
    /// `None` for an output that does not change.
    pub relative_residual: Vec<Option<f64>>,
    /// Correlation of every residual with itself.
    pub autocorrelation: Vec<Autocorrelation>,
    /// Correlation of every residual with every input.
    pub cross_correlation: Vec<CrossCorrelation>,
    /// Parameters with their 95 % intervals; empty if the estimator gives none.
    pub parameters: Vec<Interval>,
    /// Poles, slowest first.
    pub poles: Vec<Root>,
    /// Transmission zeros.
    pub transmission_zeros: Vec<Root>,
    /// Zeros channel by channel.
    pub channel_zeros: Vec<ChannelZeros>,
    /// Step responses.
    pub step: Vec<StepResponse>,
    /// Frequency responses.
    pub frequency: Vec<FrequencyResponse>,
}

/// Tests a model on records (usually those of the estimation) and describes it.
///
/// `family` is the estimate with its covariance, for uncertainty bands; without it the bands are empty.
pub fn diagnose(
    model: &dyn Model,
    family: Option<Family>,
    records: &[Record],
    inputs: &[String],
    outputs: &[String],
    options: &Options,
) -> Diagnostics {
    let state_space = model.to_state_space();
    // The free simulation of an unstable model says nothing.
    let kind = if model.is_stable() { options.kind } else { Kind::OneStep };
    // A simulation that begins at noisy samples carries their error on; the best initial state does not.
    let (from, tested): (usize, &dyn Model) = match kind {
        Kind::OneStep => (model.warm_up(), model),
        Kind::Simulated => (0, &state_space),
    };
    let residual = |record: &Record| -> Vec<Vec<f64>> {
        let modeled = match kind {
            Kind::OneStep => tested.one_step(record),
            Kind::Simulated => tested.simulate(record),
        };
        let less = |(measured, modeled): (&Vec<f64>, &Vec<f64>)| {
            measured.iter().zip(modeled).skip(from).map(|(measured, modeled)| measured - modeled).collect()
        };
        record.outputs.iter().zip(&modeled).map(less).collect()
    };
    let all: residuals::Residuals = records.iter().map(residual).collect();
    let samples = all.iter().map(|record| record.first().map_or(0, Vec::len)).sum();
    let relative_residual = (0..outputs.len()).map(|i| relative_residual(&all, records, i)).collect();
    let lags = options.lags.min(records.iter().map(Record::len).max().unwrap_or(0) / 4);
    let named = |index: usize| (index, outputs[index].as_str());
    let mut cross_correlation = Vec::new();
    for i in 0..outputs.len() {
        for (j, input) in inputs.iter().enumerate() {
            let pair = residuals::cross_correlation(&all, records, named(i), (j, input), lags);
            cross_correlation.push(pair);
        }
    }
    let root = |z: &Complex<f64>| Root::new(*z, state_space.sample_time);
    let mut poles: Vec<Root> = model.poles().iter().map(root).collect();
    poles.sort_by(|a, b| b.modulus.total_cmp(&a.modulus).then(b.im.total_cmp(&a.im)));
    let mut channel_zeros = Vec::new();
    for (j, input) in inputs.iter().enumerate() {
        for (i, output) in outputs.iter().enumerate() {
            let zeros = zeros::channel_zeros(&state_space, i, j).iter().map(root).collect();
            channel_zeros.push(ChannelZeros { input: input.clone(), output: output.clone(), zeros });
        }
    }
    let longest = records.iter().map(Record::len).max().unwrap_or(1).max(1);
    let lowest = 1.0 / (longest as f64 * state_space.sample_time);
    Diagnostics {
        residuals: kind,
        samples,
        relative_residual,
        autocorrelation: outputs
            .iter()
            .enumerate()
            .map(|(i, output)| residuals::autocorrelation(&all, i, output, lags, options.fitted_lags))
            .collect(),
        cross_correlation,
        parameters: family.map_or(Vec::new(), |family| family.parameters.intervals()),
        poles,
        transmission_zeros: zeros::transmission_zeros(&state_space).iter().map(root).collect(),
        channel_zeros,
        step: response::step_responses(&state_space, family, inputs, outputs),
        frequency: response::frequency_responses(&state_space, family, inputs, outputs, lowest),
    }
}

/// RMS of the residual of output `index` over the spread of the output.
fn relative_residual(residuals: &residuals::Residuals, records: &[Record], index: usize) -> Option<f64> {
    let mean_square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64;
    let outputs: Vec<f64> = records.iter().flat_map(|record| record.outputs[index].iter().copied()).collect();
    let mean = outputs.iter().sum::<f64>() / outputs.len().max(1) as f64;
    let about: Vec<f64> = outputs.iter().map(|y| y - mean).collect();
    let residual: Vec<f64> = residuals.iter().flat_map(|record| record[index].iter().copied()).collect();
    let spread = mean_square(&about).sqrt();
    (spread > 0.0).then(|| mean_square(&residual).sqrt() / spread).filter(|share| share.is_finite())
}
