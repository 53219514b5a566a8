//! Fit of a model to records: the free simulation and the one-step prediction, eq. 9.

use serde::Serialize;
use std::collections::BTreeMap;

use super::fit::nrmse;
use super::model::Model;
use super::playback::Played;
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

/// Takes the responses of a model to one record block by block, and makes its score.
#[derive(Debug, Clone)]
pub struct Tally {
    name: String,
    warm_up: usize,
    samples: usize,
    simulated: bool,
    channels: Vec<ChannelTally>,
}

#[derive(Debug, Clone, Copy, Default)]
struct ChannelTally {
    /// First measured value, about which the spread is summed.
    first: f64,
    sum: f64,
    squares: f64,
    /// Squared errors of the simulation and of the prediction.
    errors: [f64; 2],
}

impl Tally {
    /// Of a record with `n_y` outputs, of which the first `warm_up` samples do not count.
    pub fn new(name: &str, n_y: usize, warm_up: usize) -> Tally {
        let channels = vec![ChannelTally::default(); n_y];
        Tally { name: name.into(), warm_up, samples: 0, simulated: true, channels }
    }

    /// Adds a block.
    pub fn add(&mut self, played: &Played) {
        let n = played.outputs.first().map_or(0, |output| output.len());
        let from = self.warm_up.saturating_sub(played.at).min(n);
        self.simulated &= played.simulated.is_some();
        for (i, tally) in self.channels.iter_mut().enumerate() {
            let measured = &played.outputs[i][from..];
            if self.samples == 0 {
                tally.first = measured.first().copied().unwrap_or(0.0);
            }
            let about = |y: &f64| y - tally.first;
            tally.sum += measured.iter().map(about).sum::<f64>();
            tally.squares += measured.iter().map(|y| about(y) * about(y)).sum::<f64>();
            let error = |responses: &[f64]| -> f64 {
                measured.iter().zip(&responses[from..]).map(|(y, y_hat)| (y - y_hat) * (y - y_hat)).sum()
            };
            tally.errors[0] += played.simulated.map_or(0.0, |simulated| error(&simulated[i]));
            tally.errors[1] += error(&played.one_step[i]);
        }
        self.samples += n - from;
    }

    /// Score of the record; `outputs` are the names.
    pub fn finish(&self, outputs: &[String]) -> RecordScore {
        let n = self.samples as f64;
        let mut scored =
            RecordScore { name: self.name.clone(), samples: self.samples, ..RecordScore::default() };
        for (name, tally) in outputs.iter().zip(&self.channels) {
            let spread = tally.squares - tally.sum * tally.sum / n;
            let fit = |error: f64| {
                let fit = 100.0 * (1.0 - (error / spread).sqrt()); // eq. 9
                (spread > 0.0 && fit.is_finite()).then_some(fit)
            };
            let [free, predicted] = tally.errors;
            let rms = (free / n).sqrt();
            let free = Some(free).filter(|_| self.simulated);
            scored.fit_simulated.insert(name.clone(), free.and_then(fit));
            scored.rms_simulated.insert(name.clone(), free.map(|_| rms).filter(|rms| rms.is_finite()));
            scored.fit_one_step.insert(name.clone(), fit(predicted));
        }
        scored
    }
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
    use super::*;
    use crate::model::Arx;
    use crate::playback::Playback;
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
    fn scores_by_blocks_are_those_of_the_whole_record() {
        let (model, mut record) = (gain(0.4), record(9000));
        record.outputs[0].iter_mut().for_each(|y| *y += 1000.0);
        let model = Arx { output_offset: vec![1000.0], ..model };
        let mut tally = Tally::new("r", 1, model.warm_up());
        Playback::new(&model, true).run(&record, &mut |played| tally.add(&played)).unwrap();
        let (found, whole) = (tally.finish(&["y".into()]), score(&model, &[record], &["y".into()]));
        let whole = &whole.records[0];
        assert_eq!(found.samples, whole.samples);
        for (found, whole) in [
            (&found.fit_simulated, &whole.fit_simulated),
            (&found.fit_one_step, &whole.fit_one_step),
            (&found.rms_simulated, &whole.rms_simulated),
        ] {
            assert!((found["y"].unwrap() - whole["y"].unwrap()).abs() < 1e-9, "{found:?} {whole:?}");
        }
    }

    #[test]
    fn an_unstable_model_has_no_simulated_fit() {
        let score = score(&gain(1.01), &[record(50)], &["y".into()]);
        assert_eq!((score.fit_simulated["y"], score.mean_fit_simulated), (None, None));
        assert!(score.fit_one_step["y"].is_some());
    }
}
