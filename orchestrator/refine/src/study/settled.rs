//! Beginnings of records: a study that says nothing of the states begins as its FMUs do. Where its records begin
//! elsewhere, that would be explained by an effect.

use super::declaration::{File, Initial, InitialWord};
use super::model::Study;
use super::prepared::Played;
use crate::Error;
use crate::engine::settings::MIN_DISTANCE_OF_OTHER_BEGINNING;
use crate::regime::deviation;

/// Distance from the model at the first sample, in multiples of the noise, from which on a record begins elsewhere.
const MIN_DISTANCE_OVER_NOISE: f64 = 8.0;
/// Share of that distance that is still there in the second half of a record if it is no beginning: an offset.
const MAX_SHARE_LEFT: f64 = 0.3;

/// Refuses a study without [states] most of whose records begin where its declared model does not.
///
/// # Errors
/// Output, both values at the begin of a record, and the keys that say where it begins.
pub fn check(file: &File, study: &Study, played: &[Played]) -> Result<(), Error> {
    let untold = |own: &Initial| *own == Initial::Word(InitialWord::Measured);
    let silent =
        study.records.iter().all(|own| untold(&own.initial) && own.states.iter().all(Option::is_none));
    let has_states = study.records.first().is_some_and(|own| !own.states.is_empty());
    if !silent || !has_states || study.steps_alone || study.windows.is_some() {
        return Ok(());
    }
    for (o, output) in study.outputs.iter().enumerate() {
        let mut elsewhere = Vec::new();
        for own in played {
            let [given, measured] = own.output(o, study.outputs.len());
            let least = (MIN_DISTANCE_OF_OTHER_BEGINNING * deviation(measured))
                .max(MIN_DISTANCE_OVER_NOISE * output.noise);
            if begins_elsewhere(given, measured, least) {
                elsewhere.push((&study.records[own.record].name, measured[0], given[0]));
            }
        }
        if let Some((record, measured, given)) =
            elsewhere.first().filter(|_| 2 * elsewhere.len() > played.len())
        {
            return Err(file.refuse_all(format!(
                "{record} begins with `{}` at {measured:.4}, the declared model at {given:.4}, and nothing says where its states begin; write `initial = \"fit\"` at the segments, or the columns that show the states under [states]",
                output.name
            )));
        }
    }
    Ok(())
}

/// Whether a record begins at least so far from the model as `least`, and that goes away.
fn begins_elsewhere(given: &[f64], measured: &[f64], least: f64) -> bool {
    let (Some(m), Some(y)) = (given.first(), measured.first()) else { return false };
    let half = given.len() / 2;
    let left = given[half..].iter().zip(&measured[half..]).map(|(m, y)| y - m);
    let left = left.sum::<f64>() / (given.len() - half).max(1) as f64;
    (y - m).abs() > least && left.abs() < MAX_SHARE_LEFT * (y - m).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beginning_goes_away_and_an_offset_stays() {
        let model: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let with = |more: fn(f64) -> f64| -> Vec<f64> {
            model.iter().enumerate().map(|(k, m)| m + more(k as f64)).collect()
        };
        let least = MIN_DISTANCE_OF_OTHER_BEGINNING * deviation(&model);
        assert!(begins_elsewhere(&model, &with(|k| 2.0 * (-0.1 * k).exp()), least));
        assert!(!begins_elsewhere(&model, &with(|_| 2.0), least));
        assert!(!begins_elsewhere(&model, &with(|k| 0.1 * (-0.1 * k).exp()), least));
    }
}
