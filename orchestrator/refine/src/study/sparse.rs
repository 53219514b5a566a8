//! Columns with cells of their own times: a slower sensor leaves cells empty, a gap has no rows. What lies between is
//! interpolated for the simulation, but is no measurement: residuals are taken where a sensor was read.

use airloop_series::resample::{locate, value_at};
use airloop_series::{Interpolation, TimeSeries};

/// Distance of a sample of the grid to the next one of the column, in steps of the grid, up to which it counts as
/// measured.
const MAX_DISTANCE: f64 = 0.5;
/// Ratio of the usual step of a column to that of the grid from which on it is slower.
const MIN_RATIO_OF_SLOW: f64 = 1.5;
/// Ratio of a step of a column to its usual one from which on it is a gap: what lies in it is no measurement.
pub const MIN_RATIO_OF_GAP: f64 = 3.0;
/// Distance to a sample at the edge of a gap, in steps of the grid, up to which it is that sample: a line over a gap
/// leaves the signal at once.
const MAX_DISTANCE_AT_A_GAP: f64 = 0.01;
/// Samples that a column needs.
const MIN_SAMPLES: usize = 8;

/// Times and values of the cells of a column that are not empty.
fn cells(time: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    time.iter().zip(values).filter(|(_, value)| value.is_finite()).map(|(t, v)| (*t, *v)).unzip()
}

/// Whether a column has empty cells.
pub fn is_sparse(values: &[f64]) -> bool {
    values.iter().any(|value| value.is_nan())
}

/// The series with its empty cells filled from those before and behind.
///
/// # Errors
/// A column that is all but empty.
pub fn filled(series: &TimeSeries, interpolation: Interpolation) -> Result<TimeSeries, String> {
    let time = series.time();
    let mut channels = Vec::new();
    for channel in series.channels() {
        let values = if is_sparse(&channel.values) {
            let (own, values) = cells(time, &channel.values);
            if values.len() < MIN_SAMPLES {
                return Err(format!(
                    "column `{}` has {} values, all other cells are empty or NaN; a record needs at least {MIN_SAMPLES}",
                    channel.name,
                    values.len()
                ));
            }
            let mut guess = 0;
            let one = |t: &f64| {
                let position = locate(&own, *t, guess);
                guess = position.index;
                value_at(&values, position, interpolation)
            };
            time.iter().map(one).collect()
        } else {
            channel.values.clone()
        };
        channels.push((channel.name.clone(), channel.unit.clone(), values));
    }
    TimeSeries::with_channels(time.to_vec(), channels).map_err(|error| error.to_string())
}

/// Which samples of the grid `axis` \[s\] were measured by a column of a file; none where all were.
pub fn measured(series: &TimeSeries, column: &str, axis: &[f64], gaps: bool) -> Option<Vec<bool>> {
    let values = &series.channel(column)?.values;
    let sparse = is_sparse(values);
    if !sparse && !gaps {
        return None;
    }
    let (own, _) = cells(series.time(), values);
    let step = (axis[axis.len() - 1] - axis[0]) / (axis.len() - 1).max(1) as f64;
    let mut steps: Vec<f64> = own.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(step);
    let slow = sparse && usual > MIN_RATIO_OF_SLOW * step;
    // Sums of steps are not their multiples to the last bit.
    let reach = if slow { MAX_DISTANCE } else { MAX_DISTANCE_AT_A_GAP } * step * (1.0 + 1e-6);
    let near = |t: &f64| {
        let behind = own.partition_point(|sample| sample < t);
        let before = behind.checked_sub(1).and_then(|k| own.get(k));
        let (before, behind) = (before.copied(), own.get(behind).copied());
        let distance = |sample: Option<f64>| sample.map_or(f64::INFINITY, |sample| (sample - t).abs());
        let bridged = before.zip(behind).is_none_or(|(from, to)| to - from > MIN_RATIO_OF_GAP * usual);
        !slow && !bridged || distance(before).min(distance(behind)) <= reach
    };
    Some(axis.iter().map(near).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> TimeSeries {
        let time: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let slow = (0..100).map(|k| if k % 10 == 0 { f64::from(k) } else { f64::NAN }).collect();
        let channels = vec![("fast".to_owned(), None, time.clone()), ("slow".to_owned(), None, slow)];
        TimeSeries::with_channels(time, channels).unwrap()
    }

    #[test]
    fn a_slow_column_is_filled_by_lines_or_held_and_measured_at_its_own_samples() {
        let lines = filled(&series(), Interpolation::Linear).unwrap();
        let held = filled(&series(), Interpolation::Hold).unwrap();
        assert!((lines.channel("slow").unwrap().values[25] - 25.0).abs() < 1e-9);
        assert_eq!(held.channel("slow").unwrap().values[25], 20.0);
        let found = measured(&series(), "slow", series().time(), false).unwrap();
        assert_eq!((found.iter().filter(|own| **own).count(), found[20], found[25]), (10, true, false));
        assert_eq!(measured(&series(), "fast", series().time(), false), None);
    }

    #[test]
    fn samples_within_a_gap_are_not_measured() {
        let time: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(if k < 50 { k } else { k + 20 })).collect();
        let series = TimeSeries::with_channels(time.clone(), vec![("y".into(), None, time)]).unwrap();
        let axis: Vec<f64> = (0..120).map(|k| 0.01 * f64::from(k)).collect();
        let found = measured(&series, "y", &axis, true).unwrap();
        assert!(found[49] && !found[60] && found[70], "{found:?}");
        // Not even those next to its edges.
        assert_eq!(found.iter().filter(|own| !**own).count(), 20);
    }

    #[test]
    fn a_column_that_is_all_but_empty_is_refused() {
        let time: Vec<f64> = (0..100).map(f64::from).collect();
        let mut values = vec![f64::NAN; 100];
        values[3] = 1.0;
        let series = TimeSeries::with_channels(time, vec![("y".into(), None, values)]).unwrap();
        let problem = filled(&series, Interpolation::Linear).unwrap_err();
        assert!(problem.contains("`y` has 1 values"), "{problem}");
    }
}
