//! Measured, simulated and predicted outputs side by side.

use super::model::Model;
use super::record::{Experiments, Record};
use airloop_series::TimeSeries;

/// Responses of a model to one record.
#[derive(Debug, Clone, PartialEq)]
pub struct Responses {
    /// Inputs, then for each output y the columns `y`, `y_simulated` (none for an unstable model) and `y_one_step`.
    pub table: TimeSeries,
    /// First samples that are taken from the measurement.
    pub warm_up: usize,
}

/// The responses of a model to a record; names and units are those of the experiments.
pub fn responses(model: &dyn Model, record: &Record, data: &Experiments) -> Responses {
    let unit = |column: usize| data.units.get(column).filter(|unit| !unit.is_empty()).cloned();
    let time: Vec<f64> = (0..record.len()).map(|k| record.time(k)).collect();
    let mut table = TimeSeries::new(time).unwrap_or_default();
    let simulated = model.is_stable().then(|| model.simulate(record));
    let predicted = model.one_step(record);
    let n_u = data.inputs.len();
    let mut columns: Vec<(String, Option<String>, Vec<f64>)> = Vec::new();
    for (j, name) in data.inputs.iter().enumerate() {
        columns.push((name.clone(), unit(j), record.inputs[j].clone()));
    }
    for (i, name) in data.outputs.iter().enumerate() {
        columns.push((name.clone(), unit(n_u + i), record.outputs[i].clone()));
    }
    for (suffix, values) in [("simulated", simulated), ("one_step", Some(predicted))] {
        for (i, values) in values.into_iter().flatten().enumerate() {
            columns.push((format!("{}_{suffix}", data.outputs[i]), unit(n_u + i), values));
        }
    }
    for (name, unit, values) in columns {
        // A signal of the record may already have such a name; the measured one stays.
        let _ = table.push(name, unit, values);
    }
    Responses { table, warm_up: model.warm_up().min(record.len()) }
}
