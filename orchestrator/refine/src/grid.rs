//! A record of a case on the grid of its sample rate: by its own time stamps where these are not the times of the grid.

use airloop_series::frame::parts;
use airloop_series::{Channel, Interpolation, TimeSeries};

/// Distance of a time stamp from its place on the grid, in steps, up to which it is rounding.
const MAX_ROUNDING: f64 = 0.02;
/// Ratio of the median step to the declared one, less one, from which on the rate is another one.
const MAX_RATE_ERROR: f64 = 0.05;
/// The same for the mean step: more loses commands, or repeats them, too often for a sampled actuator.
const MAX_DRIFT: f64 = 1e-3;
/// Ratio of a step to the declared one from which on samples are missing in between.
const MIN_RATIO_OF_GAP: f64 = 2.5;

/// The record `name` on a grid of `step` \[s\]: signals lie on straight lines between their samples; of the `held`
/// ones, commands that a controller sends once a row, the grid has those of the nearest rows. A sentence on what was
/// done goes to `notes`.
///
/// # Errors
/// A gap, or another rate, with the line of the file.
pub fn on_grid(
    series: TimeSeries,
    step: f64,
    name: &str,
    held: &[String],
    notes: &mut Vec<String>,
) -> Result<TimeSeries, String> {
    let time = series.time();
    let distance = |(k, at): (usize, &f64)| ((at - time[0]) / step - k as f64).abs();
    let most = time.iter().enumerate().map(distance).fold(0.0, f64::max);
    if most <= MAX_ROUNDING || time.len() < 2 {
        return Ok(series);
    }
    let rate = 1.0 / step;
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let gap = steps.iter().position(|own| own / step >= MIN_RATIO_OF_GAP);
    steps.sort_by(f64::total_cmp);
    let median = steps[(steps.len() - 1) / 2];
    let other_rate = |found: f64, of: &str| {
        format!(
            "its samples are {found:.9} s apart ({of}), but sample_rate_hz = {rate} means {step} s; correct the rate"
        )
    };
    if (median / step - 1.0).abs() > MAX_RATE_ERROR {
        return Err(other_rate(median, "the median"));
    }
    if let Some(index) = gap {
        return Err(format!(
            "line {}: {} s after the row before, but sample_rate_hz = {rate} means {step} s; split the record at gaps",
            index + 3,
            time[index + 1] - time[index]
        ));
    }
    let span = time[time.len() - 1] - time[0];
    let mean = span / (time.len() - 1) as f64;
    if (mean / step - 1.0).abs() > MAX_DRIFT {
        return Err(other_rate(mean, "the mean"));
    }
    let axis: Vec<f64> = (0..=(span / step) as usize).map(|k| time[0] + k as f64 * step).collect();
    let nearest = |at: f64| {
        let after = time.partition_point(|own| *own < at).clamp(1, time.len() - 1);
        if at - time[after - 1] <= time[after] - at { after - 1 } else { after }
    };
    let rows: Vec<usize> = axis.iter().map(|at| nearest(*at)).collect();
    let lines = series.resample(axis, Interpolation::Linear).map_err(|problem| problem.to_string())?;
    let (axis, channels) = parts(lines);
    let channel = |(own, lines): (&Channel, Channel)| {
        let is_held = held.contains(&own.name);
        let values = if is_held { rows.iter().map(|row| own.values[*row]).collect() } else { lines.values };
        (own.name.clone(), own.unit.clone(), values)
    };
    let channels = series.channels().iter().zip(channels).map(channel).collect();
    notes.push(format!(
        "The time stamps of {name} lie up to {most:.2} steps from a grid of {rate} Hz: the record was put on it by them, on straight lines between its samples{}.",
        if held.is_empty() { String::new() } else { format!(" ({} from the nearest rows)", held.join(", ")) }
    ));
    TimeSeries::with_channels(axis, channels).map_err(|problem| problem.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(time: Vec<f64>) -> TimeSeries {
        let line = time.iter().map(|t| 3.0 * t).collect();
        let held = time.iter().map(|t| (t * 10.0).floor()).collect();
        let channels = vec![("x".into(), None, line), ("u".into(), None, held)];
        TimeSeries::with_channels(time, channels).expect("a record")
    }

    fn jittered(count: usize, rate_error: f64, jitter: f64) -> Vec<f64> {
        let at = |k: usize| 0.01 * (1.0 + rate_error) * k as f64 + 0.01 * jitter * (7.0 * k as f64).sin();
        (0..count).map(at).collect()
    }

    #[test]
    fn stamps_that_jitter_or_drift_are_kept_by_what_they_say() {
        for (rate_error, jitter) in [(0.0, 0.3), (0.0008, 0.0), (-0.0005, 0.2)] {
            let mut notes = Vec::new();
            let time = jittered(500, rate_error, jitter);
            let found =
                on_grid(record(time.clone()), 0.01, "r.csv", &["u".into()], &mut notes).expect("a grid");
            let x = &found.channel("x").expect("x").values;
            for (k, (at, x)) in found.time().iter().zip(x).enumerate() {
                assert!((at - time[0] - 0.01 * k as f64).abs() < 1e-9 && (x - 3.0 * at).abs() < 1e-9);
            }
            let u = &found.channel("u").expect("u").values;
            assert!(u.iter().all(|value| value.fract() == 0.0));
            assert!(notes.len() == 1 && notes[0].contains("(u from the nearest rows)"), "{notes:?}");
        }
    }

    #[test]
    fn a_grid_stays_and_gaps_and_other_rates_are_refused() {
        let mut notes = Vec::new();
        let rounded: Vec<f64> = (0..100).map(|k| (1e4 * 0.00667 * f64::from(k)).round() / 1e4).collect();
        let same = on_grid(record(rounded.clone()), 0.00667, "r.csv", &[], &mut notes).expect("a grid");
        assert!(same.time() == rounded && notes.is_empty());
        let mut gap = jittered(100, 0.0, 0.0);
        gap[50..].iter_mut().for_each(|t| *t += 0.04);
        let error = on_grid(record(gap), 0.01, "r.csv", &[], &mut notes).expect_err("a gap");
        assert!(error.starts_with("line 52: 0.05"), "{error}");
        for (rate_error, step, what) in [(0.0, 0.02, "the median"), (0.004, 0.01, "the mean")] {
            let other = record(jittered(100, rate_error, 0.1));
            let error = on_grid(other, step, "r.csv", &[], &mut notes).expect_err("a rate");
            assert!(error.contains(what) && error.contains("correct the rate"), "{error}");
        }
    }
}
