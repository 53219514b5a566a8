//! Records without the samples that a sensor got wrong: bridged, or left empty, and named.

use airloop_series::TimeSeries;
use airloop_series::frame::parts;

use crate::{outliers, spikes};

/// Magnitude from which on squares of samples overflow in sums.
const MAX_MAGNITUDE: f64 = 1e100;

/// Places and values of the cells that are not empty.
fn there(values: &[f64]) -> (Vec<usize>, Vec<f64>) {
    values.iter().copied().enumerate().filter(|(_, value)| !value.is_nan()).unzip()
}

/// The record `name` with empty cells where a sensor failed for a while; a sentence on each goes to `notes`.
pub fn emptied(series: TimeSeries, name: &str, columns: &[&str], notes: &mut Vec<String>) -> TimeSeries {
    let (time, mut channels) = parts(series.clone());
    let mut any = false;
    for channel in channels.iter_mut().filter(|channel| columns.contains(&channel.name.as_str())) {
        let (places, values) = there(&channel.values);
        for run in outliers::failures(&values) {
            any = true;
            notes.push(format!(
                "The sensor of `{}` failed in {name} from {} s to {} s, {} samples near {}: they count for no error.",
                channel.name,
                time[places[run.start]],
                time[places[run.end - 1]],
                run.len(),
                values[run.start]
            ));
            run.for_each(|k| channel.values[places[k]] = f64::NAN);
        }
    }
    let channels = channels.into_iter().map(|channel| (channel.name, channel.unit, channel.values)).collect();
    TimeSeries::with_channels(time, channels).ok().filter(|_| any).unwrap_or(series)
}

/// The record `name` without the outliers of its `columns` and the spikes of those of them that are `states`; sentences
/// on them go to `notes`.
///
/// # Errors
/// A sample that is too large to be squared: column, time and value.
pub fn without(
    series: TimeSeries,
    name: &str,
    columns: &[&str],
    states: &[&str],
    notes: &mut Vec<String>,
) -> Result<TimeSeries, String> {
    for channel in series.channels() {
        let large = channel.values.iter().position(|value| value.abs() > MAX_MAGNITUDE);
        if let Some(k) = large {
            return Err(format!(
                "column `{}` is {:e} at {} s, beyond {MAX_MAGNITUDE:e}: no sensor shows that; cut the record or repair the sample",
                channel.name,
                channel.values[k],
                series.time()[k]
            ));
        }
    }
    let (time, mut channels) = parts(series);
    let mut behind = vec![false; time.len()];
    for command in channels.iter().filter(|channel| !columns.contains(&channel.name.as_str())) {
        let jumps = spikes::behind_jumps(&command.values);
        behind.iter_mut().zip(jumps).for_each(|(all, own)| *all |= own);
    }
    for channel in channels.iter_mut().filter(|channel| columns.contains(&channel.name.as_str())) {
        let (places, mut values) = there(&channel.values);
        let unit = channel.unit.as_deref().map(|unit| format!(" {unit}")).unwrap_or_default();
        let found = outliers::find(&values);
        for outlier in &found {
            notes.push(format!(
                "Outlier in {name}: `{}` is {}{unit} at {} s, its neighbors are near {}{unit}; {} replaced by the line between the samples before and after.",
                channel.name,
                outlier.value,
                time[places[outlier.first]],
                outlier.neighbors,
                match outlier.count {
                    1 => "the sample was".to_owned(),
                    count => format!("{count} samples were"),
                }
            ));
        }
        outliers::bridge(&mut values, &found);
        if states.contains(&channel.name.as_str()) {
            let behind: Vec<bool> = places.iter().map(|&k| behind[k]).collect();
            let found = spikes::find(&values, &values, &behind);
            if let Some(first) = found.first() {
                let first = format!("at {} s", time[places[first.first]]);
                notes.push(spikes::note(name, &channel.name, found.len(), &first));
            }
            outliers::bridge(&mut values, &found);
        }
        places.iter().zip(values).for_each(|(&k, value)| channel.values[k] = value);
    }
    let channels = channels.into_iter().map(|channel| (channel.name, channel.unit, channel.values)).collect();
    TimeSeries::with_channels(time, channels).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow swing.
    fn swing() -> Vec<f64> {
        (0..1000).map(|k| 0.1 * (0.02 * f64::from(k)).sin()).collect()
    }

    #[test]
    fn where_a_sensor_failed_cells_are_empty() {
        let mut values = swing();
        values[400..430].fill(0.5);
        let time: Vec<f64> = (0..1000).map(|k| 0.001 * f64::from(k)).collect();
        let series = TimeSeries::with_channels(time, vec![("x".into(), None, values)]).unwrap();
        let mut notes = Vec::new();
        let found = emptied(series, "a.csv", &["x"], &mut notes);
        assert_eq!(found.channels()[0].values.iter().filter(|value| value.is_nan()).count(), 30);
        assert!(notes[0].contains("`x`") && notes[0].contains("0.4 s to 0.429 s"), "{notes:?}");
    }

    #[test]
    fn the_note_names_record_signal_time_and_value() {
        let mut values = swing();
        values[400] = 1e7;
        let time: Vec<f64> = (0..1000).map(|k| 0.001 * f64::from(k)).collect();
        let series = |values| {
            let channels = vec![("x".to_owned(), Some("m".to_owned()), values)];
            TimeSeries::with_channels(time.clone(), channels).unwrap()
        };
        let mut notes = Vec::new();
        let cleaned = without(series(values.clone()), "trial_03.csv", &["x"], &[], &mut notes).unwrap();
        assert!(cleaned.channels()[0].values.iter().all(|value| value.abs() < 0.2));
        for part in ["trial_03.csv", "`x` is 10000000 m at 0.4 s"] {
            assert!(notes[0].contains(part), "{notes:?}");
        }
        values[400] = 1e153;
        let problem = without(series(values), "trial_03.csv", &["x"], &[], &mut notes).unwrap_err();
        assert!(problem.contains("`x` is 1e153 at 0.4 s"), "{problem}");
    }
}
