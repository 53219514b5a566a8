//! Measured minus simulated at the measured times, and the fit of every measured signal.

use std::path::Path;

use super::Error;
use super::signals::Links;
use airloop_cosim::master::Algorithm;
use airloop_cosim::results::summary::SignalRecord;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::Source;
use airloop_ident::fit::nrmse;
use airloop_series::resample::{locate, value_at};
use airloop_series::{Interpolation, TimeSeries};

/// Fit of every measured output of the system.
///
/// The simulation is looked up at the measured times inside the run: a straight line between communication points,
/// or the held value for a discrete output. Where that stands at the start of its steps, the last point is left out
/// (it only repeats the value before).
///
/// # Errors
/// [`Error::Fit`] if measurement and run have no time in common.
pub fn compare(
    (graph, algorithm): (&SystemGraph, Algorithm),
    result: &TimeSeries,
    measured: &TimeSeries,
    links: &Links,
    file: &Path,
) -> Result<Vec<SignalRecord>, Error> {
    let mut records = Vec::new();
    for link in &links.outputs {
        let output = &graph.outputs[link.connector];
        let Some(simulated) = result.channel(&output.name) else { continue };
        let column = &measured.channels()[link.channel];
        let kind = match output.source {
            Source::Input(_) => Kind::Continuous,
            Source::Output { component, variable } => match graph.is_held(component, variable) {
                true if algorithm.stands_at_start(graph, component, variable) => Kind::Sampled,
                true => Kind::Held,
                false => Kind::Continuous,
            },
        };
        let (y, y_hat) = pair(result, &simulated.values, kind, measured, &column.values);
        let y: Vec<f64> = y.into_iter().map(|value| link.conversion.apply(value)).collect();
        let fit = nrmse(&y, &y_hat).map_err(|source| Error::Fit {
            file: file.into(),
            signal: output.name.clone(),
            source,
        })?;
        records.push(SignalRecord {
            name: output.name.clone(),
            unit: output.unit.clone(),
            column: column.name.clone(),
            factor: link.conversion.factor,
            offset: link.conversion.offset,
            fit_percent: fit.nrmse_percent,
            rms_error: fit.rms_error,
            samples: fit.samples,
        });
    }
    Ok(records)
}

/// Behavior of a simulated signal between its rows.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Continuous,
    Held,
    /// Held, and the last row repeats the row before.
    Sampled,
}

/// Measured values and the simulated ones at their times.
fn pair(
    result: &TimeSeries,
    simulated: &[f64],
    kind: Kind,
    measured: &TimeSeries,
    column: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let (Some(&first), Some(&last)) = (result.time().first(), result.time().last()) else {
        return (Vec::new(), Vec::new());
    };
    let interpolation = if kind == Kind::Continuous { Interpolation::Linear } else { Interpolation::Hold };
    let end = result.len() - 1;
    let mut guess = 0;
    measured
        .time()
        .iter()
        .zip(column)
        .filter(|(t, _)| **t >= first && **t <= last)
        .filter_map(|(&t, &value)| {
            let position = locate(result.time(), t, guess);
            guess = position.index;
            let repeats = kind == Kind::Sampled && position.index == end && end > 0;
            (!repeats).then(|| (value, value_at(simulated, position, interpolation)))
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_paired_at_the_measured_times_inside_the_run() {
        let result = TimeSeries::new(vec![1.0, 2.0, 3.0]).unwrap();
        let measured = TimeSeries::new(vec![0.5, 1.0, 1.5, 3.0, 3.5]).unwrap();
        let column = [9.0, 10.0, 11.0, 12.0, 13.0];
        let (y, y_hat) = pair(&result, &[0.0, 10.0, 20.0], Kind::Continuous, &measured, &column);
        assert_eq!((y, y_hat), (vec![10.0, 11.0, 12.0], vec![0.0, 5.0, 20.0]));
        let (y, y_hat) = pair(&result, &[0.0, 10.0, 10.0], Kind::Sampled, &measured, &column);
        assert_eq!((y, y_hat), (vec![10.0, 11.0], vec![0.0, 0.0]));
        let (y, y_hat) = pair(&result, &[0.0, 10.0, 20.0], Kind::Held, &measured, &column);
        assert_eq!((y, y_hat), (vec![10.0, 11.0, 12.0], vec![0.0, 0.0, 20.0]));
    }
}
