//! Operating point and trend: the parts of the data that a linear model cannot explain.

use super::Record;
use super::read::Survey;

/// Trend that is removed before the estimation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Detrend {
    /// Nothing: the model has its rest at zero.
    #[default]
    None,
    /// The mean of every signal over the estimation records: the operating point of the model.
    Mean,
    /// The mean as before, and in every record the slope of its own straight line.
    Linear,
}

/// Operating point: input and output offsets, shapes \[n_u\], \[n_y\], over all samples of the estimation records.
pub fn operating_point(detrend: Detrend, estimation: &[Survey], n_u: usize) -> (Vec<f64>, Vec<f64>) {
    let columns = estimation.first().map_or(0, |survey| survey.channels.len());
    let samples: usize = estimation.iter().map(|survey| survey.sampling.samples).sum();
    let mut offsets: Vec<f64> = (0..columns)
        .map(|column| match detrend {
            Detrend::None => 0.0,
            _ => {
                let sum = |survey: &Survey| survey.channels[column].mean() * survey.sampling.samples as f64;
                estimation.iter().map(sum).sum::<f64>() / samples as f64
            }
        })
        .collect();
    let outputs = offsets.split_off(n_u);
    (offsets, outputs)
}

/// Slopes per sample \[columns\] that are to be removed from a record; zeros unless the trend is linear.
pub fn slopes(detrend: Detrend, survey: &Survey) -> Vec<f64> {
    let slope = |channel: &super::channel::Channel| match detrend {
        Detrend::Linear => channel.slope(),
        _ => 0.0,
    };
    survey.channels.iter().map(slope).collect()
}

/// Removes the slopes \[columns\] per sample, about the middle of the record, so that means stay.
pub fn remove_slopes(record: &mut Record, slopes: &[f64]) {
    let columns = record.inputs.iter_mut().chain(&mut record.outputs);
    for (column, &slope) in columns.zip(slopes).filter(|(_, slope)| **slope != 0.0) {
        let middle = 0.5 * (column.len() as f64 - 1.0);
        column.iter_mut().enumerate().for_each(|(k, value)| *value -= slope * (k as f64 - middle));
    }
}
