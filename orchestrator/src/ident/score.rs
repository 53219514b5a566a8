//! How well a model fits records: the free simulation and the one-step prediction, eq. 9.

use serde::Serialize;
use std::collections::BTreeMap;

use super::fit::nrmse;
use super::model::Model;
use super::record::Record;

/// Fits of one model, by output name, over one or several records.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Score {
    /// NRMSE fit of the free simulation \[%\] (eq. 9), the mean over the records. `None`: the model is unstable, or the
    /// output is constant.
    pub fit_simulated: BTreeMap<String, Option<f64>>,
    /// NRMSE fit of the one-step prediction \[%\], the mean over the records.
    pub fit_one_step: BTreeMap<String, Option<f64>>,
    /// RMS error of the free simulation in the unit of the output, over all samples of all records.
    pub rms_simulated: BTreeMap<String, Option<f64>>,
    /// Mean of `fit_simulated` over the outputs \[%\].
    pub mean_fit_simulated: Option<f64>,
    /// Mean of `fit_one_step` over the outputs \[%\].
    pub mean_fit_one_step: Option<f64>,
    /// The same for every record.
    pub records: Vec<RecordScore>,
}

/// Fits of one record.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RecordScore {
    /// Name of the record.
    pub name: String,
    /// Samples compared, those of [`Model::warm_up`] left out.
    pub samples: usize,
    /// NRMSE fit of the free simulation \[%\] by output.
    pub fit_simulated: BTreeMap<String, Option<f64>>,
    /// NRMSE fit of the one-step prediction \[%\] by output.
    pub fit_one_step: BTreeMap<String, Option<f64>>,
    /// RMS error of the free simulation in the unit of the output.
    pub rms_simulated: BTreeMap<String, Option<f64>>,
}

/// Scores a model on records.
///
/// An unstable model gets no simulated fit: the number would only say how long the record is.
pub fn score(model: &dyn Model, records: &[Record], outputs: &[String]) -> Score {
    let stable = model.is_stable();
    let records: Vec<RecordScore> =
        records.iter().map(|record| score_record(model, stable, record, outputs)).collect();
    Score::of_records(records, outputs)
}

fn score_record(model: &dyn Model, stable: bool, record: &Record, outputs: &[String]) -> RecordScore {
    let from = model.warm_up().min(record.len());
    let simulated = stable.then(|| model.simulate(record));
    let predicted = model.one_step(record);
    let mut scored =
        RecordScore { name: record.name.clone(), samples: record.len() - from, ..RecordScore::default() };
    for (i, name) in outputs.iter().enumerate() {
        let measured = &record.outputs[i][from..];
        let fit = |y: &[f64]| nrmse(measured, &y[from..]).ok().filter(|fit| fit.rms_error.is_finite());
        let free = simulated.as_ref().and_then(|y| fit(&y[i]));
        scored.fit_simulated.insert(name.clone(), free.and_then(|fit| fit.nrmse_percent));
        scored.rms_simulated.insert(name.clone(), free.map(|fit| fit.rms_error));
        scored.fit_one_step.insert(name.clone(), fit(&predicted[i]).and_then(|fit| fit.nrmse_percent));
    }
    scored
}

impl Score {
    /// Means over records that were scored one by one. A record without a fit for an output leaves the mean empty.
    pub fn of_records(records: Vec<RecordScore>, outputs: &[String]) -> Score {
        let mean = |values: Vec<Option<f64>>| -> Option<f64> {
            let known: Option<Vec<f64>> = values.into_iter().collect();
            known
                .filter(|known| !known.is_empty())
                .map(|known| known.iter().sum::<f64>() / known.len() as f64)
        };
        let by_output = |of: &dyn Fn(&RecordScore) -> &BTreeMap<String, Option<f64>>| {
            outputs
                .iter()
                .map(|name| {
                    (name.clone(), mean(records.iter().map(|r| of(r).get(name).copied().flatten()).collect()))
                })
                .collect::<BTreeMap<String, Option<f64>>>()
        };
        let fit_simulated = by_output(&|record| &record.fit_simulated);
        let fit_one_step = by_output(&|record| &record.fit_one_step);
        let samples: usize = records.iter().map(|record| record.samples).sum();
        let rms_simulated = outputs
            .iter()
            .map(|name| {
                let squares: Option<f64> = records
                    .iter()
                    .map(|record| {
                        let rms = record.rms_simulated.get(name).copied().flatten();
                        rms.map(|rms| rms * rms * record.samples as f64)
                    })
                    .sum();
                (name.clone(), squares.map(|sum| (sum / samples as f64).sqrt()))
            })
            .collect();
        Score {
            mean_fit_simulated: mean(fit_simulated.values().copied().collect()),
            mean_fit_one_step: mean(fit_one_step.values().copied().collect()),
            fit_simulated,
            fit_one_step,
            rms_simulated,
            records,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Arx;
    use super::*;
    use nalgebra::DMatrix;

    fn gain(pole: f64) -> Arx {
        Arx {
            sample_time: 1.0,
            a: vec![DMatrix::from_element(1, 1, -pole)],
            b: vec![DMatrix::from_element(1, 1, 1.0)],
            input_offset: vec![0.0],
            output_offset: vec![0.0],
        }
    }

    fn record(n: usize) -> Record {
        let u: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k % 7 < 3))).collect();
        let mut y = vec![0.0; n];
        (1..n).for_each(|k| y[k] = 0.5 * y[k - 1] + u[k]);
        Record { name: "r".into(), sample_time: 1.0, start: 0.0, inputs: vec![u], outputs: vec![y] }
    }

    #[test]
    fn the_true_model_fits_to_100_percent_in_both_ways() {
        let score = score(&gain(0.5), &[record(50), record(80)], &["y".into()]);
        assert!((score.mean_fit_simulated.unwrap() - 100.0).abs() < 1e-10);
        assert!((score.mean_fit_one_step.unwrap() - 100.0).abs() < 1e-10);
        assert_eq!(score.records.iter().map(|r| r.samples).collect::<Vec<_>>(), [49, 79]);
    }

    #[test]
    fn an_unstable_model_has_no_simulated_fit() {
        let score = score(&gain(1.01), &[record(50)], &["y".into()]);
        assert_eq!((score.fit_simulated["y"], score.mean_fit_simulated), (None, None));
        assert!(score.fit_one_step["y"].is_some());
    }
}
