//! Evidence of impulse responses on delay and order.

use nalgebra::DMatrix;

use airloop_optim::linalg::spectral;
use serde::Serialize;

use super::{ImpulseResponse, TWO_SIDED_99};

/// Evidence for a structure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evidence {
    /// Delay of every channel in samples, shape \[n_y\]\[n_u\]; `None` where no coefficient is outside its band.
    pub delay: Vec<Vec<Option<usize>>>,
    /// Singular values of the Hankel matrix of `g(1), g(2), ..` of all channels, every output in units of its noise.
    pub hankel_singular_values: Vec<f64>,
    /// Approximate size that the largest of them would have from noise alone.
    pub noise_level: f64,
    /// Singular values above the noise: the order that the data can show.
    pub order: usize,
    /// The same in words.
    pub sentences: Vec<String>,
}

/// Collects the evidence from the responses of all outputs.
pub fn evidence(responses: &[ImpulseResponse], inputs: &[String], outputs: &[String]) -> Evidence {
    let mut sentences = Vec::new();
    let delay: Vec<Vec<Option<usize>>> = responses
        .iter()
        .map(|of| of.channels.iter().map(|channel| channel.first_significant).collect())
        .collect();
    for (output, delays) in outputs.iter().zip(&delay) {
        for (input, delay) in inputs.iter().zip(delays) {
            sentences.push(match delay {
                None => format!("{input} does not reach {output}: its FIR is zero within its band at all lags"),
                Some(0) => format!("no delay from {input} to {output}: the FIR is outside its band at lag 0"),
                Some(delay) => format!(
                    "delay of {delay} samples likely: the FIR of {input} to {output} is zero within its band up to lag {}",
                    delay - 1
                ),
            });
        }
    }
    let length =
        responses.first().and_then(|of| of.channels.first()).map_or(0, |channel| channel.values.len());
    let (n_y, n_u, blocks) = (responses.len(), inputs.len(), length.saturating_sub(1).div_ceil(2));
    let scaled = |i: usize, j: usize, lag: usize, band: bool| {
        let channel = &responses[i].channels[j];
        let value = if band { channel.band_99.get(lag) } else { channel.values.get(lag) };
        value.copied().unwrap_or(0.0) / responses[i].noise_deviation.max(f64::MIN_POSITIVE)
    };
    let hankel = |band: bool| {
        DMatrix::from_fn(blocks * n_y, blocks * n_u, |row, column| {
            scaled(row % n_y, column % n_u, row / n_y + column / n_u + 1, band)
        })
    };
    let mut values: Vec<f64> = spectral::singular_values(hankel(false)).iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    // Errors of unlike lags are about independent: the norm of a random matrix is about the sum of the norms of its
    // longest row and column.
    let errors = hankel(true) / TWO_SIDED_99;
    let row = errors.row_iter().map(|row| row.norm()).fold(0.0, f64::max);
    let column = errors.column_iter().map(|column| column.norm()).fold(0.0, f64::max);
    let noise_level = row + column;
    let order = values.iter().filter(|value| **value > noise_level).count();
    sentences.push(format!(
        "{order} Hankel singular value{} of the FIR above the noise: a state-space model of order {order} is what the data can show within {length} samples",
        if order == 1 { " is" } else { "s are" }
    ));
    Evidence { delay, hankel_singular_values: values, noise_level, order, sentences }
}
