//! The rows of a file on a uniform grid: as they are where their stamps are one, else between them.

use std::collections::BTreeMap;
use std::ops::Range;

use super::sparse;
use airloop_series::{Interpolation, TimeSeries};

/// A file on its grid.
pub(super) struct Grid {
    pub series: TimeSeries,
    pub step: f64,
    pub held: TimeSeries,
    /// Means of stairs from one sample of the grid to the next: of commands that change at stamps of their own.
    pub means: TimeSeries,
    pub raw: TimeSeries,
    pub gaps: usize,
    /// The stamps are no such grid: values lie between them.
    pub between: bool,
    /// Which samples the columns measured that have empty cells, or a gap.
    pub measured: BTreeMap<String, Vec<bool>>,
}

fn median_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// Missing rows, in steps, that a line bridges also where what drives the system is missing with them.
const MAX_STEPS_BRIDGED: f64 = 10.0;

impl Grid {
    /// Spans of the samples `first` to `last` between which more rows are missing than a line bridges.
    pub(super) fn without_gaps(&self, first: usize, last: usize) -> Vec<Range<usize>> {
        let (axis, near) = (self.series.time(), 0.01 * self.step);
        let is_gap = |pair: &&[f64]| pair[1] - pair[0] > (1.0 + MAX_STEPS_BRIDGED) * self.step;
        let (mut spans, mut begin) = (Vec::new(), first);
        for pair in self.raw.time().windows(2).filter(is_gap) {
            let before = axis.partition_point(|&t| t <= pair[0] + near);
            let behind = axis.partition_point(|&t| t < pair[1] - near);
            if before >= last {
                break;
            }
            if before > begin {
                spans.push(begin..before);
            }
            begin = begin.max(behind);
        }
        if begin < last {
            spans.push(begin..last);
        }
        spans
    }
}

/// Samples by which stamps may be off a uniform grid: more is resampled by the stamps.
const MAX_DRIFT: f64 = 0.25;

/// Samples that a step may make of one file, or of each of its rows: more are a slip of the unit of `step_s`.
const MAX_SAMPLES: f64 = 1e6;
const MAX_SAMPLES_OF_A_ROW: f64 = 10.0;

/// Step of a file: the median, or the mean where all steps are near it, so that nothing adds up over the file.
pub(super) fn own_step(time: &[f64]) -> f64 {
    let median = median_step(time);
    let near = |pair: &[f64]| ((pair[1] - pair[0]) / median - 1.0).abs() < 0.01;
    let (Some(first), Some(last)) = (time.first(), time.last()) else { return median };
    let mean = (last - first) / (time.len() - 1).max(1) as f64;
    // Stamps with few digits have a mean that is a rounding off.
    if time.windows(2).all(near) && (mean / median - 1.0).abs() > 1e-6 { mean } else { median }
}

pub(super) fn grid(raw: TimeSeries, step: Option<f64>) -> Result<Grid, String> {
    let [series, stairs] = [Interpolation::Linear, Interpolation::Hold].map(|own| sparse::filled(&raw, own));
    let (series, stairs) = (series?, stairs?);
    let time = series.time();
    let own = own_step(time);
    if time.len() < 8 {
        return Err(format!("it has {} samples; a record needs more", time.len()));
    }
    let step = step.unwrap_or(own);
    let span = time[time.len() - 1] - time[0];
    if step > 0.1 * span {
        return Err(format!("step_s = {step} s is too long for a file of {span} s"));
    }
    let gaps = time.windows(2).filter(|pair| pair[1] - pair[0] > sparse::MIN_RATIO_OF_GAP * own).count();
    let longest = time.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    if longest > 0.2 * span {
        return Err(format!("there is a gap of {longest} s; cut it into two segments with from_s and to_s"));
    }
    let regular = |pair: &[f64]| ((pair[1] - pair[0]) / step - 1.0).abs() < 0.01;
    let drift = |(k, t): (usize, &f64)| (t - time[0] - k as f64 * step).abs();
    let drift = time.iter().enumerate().map(drift).fold(0.0, f64::max);
    if time.windows(2).all(regular) && drift < MAX_DRIFT * step {
        let measured = measured(&raw, time, false);
        return Ok(Grid {
            means: stairs.clone(),
            held: stairs,
            raw,
            series,
            step,
            gaps: 0,
            between: false,
            measured,
        });
    }
    let samples = (span / step).floor() + 1.0;
    if samples > MAX_SAMPLES.max(MAX_SAMPLES_OF_A_ROW * time.len() as f64) {
        return Err(format!(
            "a step of {step:e} s makes {samples:e} samples of a file of {span} s with {} rows; give a longer step_s",
            time.len()
        ));
    }
    let count = (span / step * (1.0 + 1e-12)) as usize + 1;
    let axis: Vec<f64> = (0..count).map(|k| time[0] + k as f64 * step).collect();
    let on = |source: &TimeSeries, interpolation| {
        source.resample(axis.clone(), interpolation).map_err(|error| error.to_string())
    };
    let (held, linear) = (on(&stairs, Interpolation::Hold)?, on(&series, Interpolation::Linear)?);
    let means = means(&stairs, &axis, step).map_err(|error| error.to_string())?;
    let measured = measured(&raw, &axis, gaps > 0);
    Ok(Grid { means, held, series: linear, raw, step, gaps, between: true, measured })
}

/// Means of stairs over the steps that begin at the times of `axis`. A command that is held from stamp to stamp acts
/// from its own stamp on: held from the next sample of the grid, it would come up to a step late.
fn means(stairs: &TimeSeries, axis: &[f64], step: f64) -> Result<TimeSeries, airloop_series::Error> {
    let time = stairs.time();
    let mut found = TimeSeries::new(axis.to_vec())?;
    for channel in stairs.channels() {
        let mut from = 0;
        let mut mean = |&begin: &f64| {
            let end = begin + step;
            while from + 1 < time.len() && time[from + 1] <= begin {
                from += 1;
            }
            let (mut sum, mut at, mut k) = (0.0, begin, from);
            while at < end {
                let until = time.get(k + 1).map_or(end, |next| next.min(end));
                sum += channel.values[k] * (until - at);
                (at, k) = (until, k + 1);
            }
            sum / step
        };
        found.push(channel.name.clone(), channel.unit.clone(), axis.iter().map(&mut mean).collect())?;
    }
    Ok(found)
}

/// Which samples of a grid the columns of a file measured, where not all.
fn measured(raw: &TimeSeries, axis: &[f64], gaps: bool) -> BTreeMap<String, Vec<bool>> {
    let names = raw.channels().iter().map(|channel| &channel.name);
    names.filter_map(|name| Some((name.clone(), sparse::measured(raw, name, axis, gaps)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(stamp: impl Fn(f64) -> f64) -> Grid {
        let time: Vec<f64> = (0..2000).map(|k| stamp(f64::from(k))).collect();
        let values = time.clone();
        let mut series = TimeSeries::new(time).unwrap();
        series.push("t", None, values).unwrap();
        grid(series, None).unwrap()
    }

    /// Largest difference between a signal that shows its time and the time on the grid.
    fn off(grid: &Grid) -> f64 {
        let shown = &grid.series.channel("t").unwrap().values;
        shown.iter().enumerate().map(|(k, t)| (t - k as f64 * grid.step).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn stamps_near_a_grid_do_not_drift_away_from_it() {
        // Nine of ten steps are 5 ms, the tenth 5.03 ms: 6 ms over the file for the median.
        let slow = file(|k| 0.005 * k + 3e-5 * (k / 10.0).floor());
        assert!(off(&slow) < 0.2 * slow.step, "{}", off(&slow));
        // A clock that runs faster and slower by 0.5 %.
        let swinging = file(|k| 0.005 * k + 0.005 * (0.005 * k).sin());
        assert!(off(&swinging) < 1e-9, "{}", off(&swinging));
        assert!((swinging.series.len() as f64 - 2000.0).abs() < 5.0);
    }

    #[test]
    fn a_span_ends_and_begins_anew_where_more_rows_are_missing_than_a_line_bridges() {
        // Rows 500 to 519 and 1000 to 1003 are missing.
        let lost = |k: f64| k + if k >= 500.0 { 20.0 } else { 0.0 } + if k >= 980.0 { 4.0 } else { 0.0 };
        let cut = file(|k| 0.25 * lost(k));
        assert_eq!(cut.without_gaps(100, 1500), [100..500, 520..1500]);
        assert_eq!(cut.without_gaps(510, 1500), [Range { start: 520, end: 1500 }]);
        assert_eq!(cut.without_gaps(0, 505), [Range { start: 0, end: 500 }]);
        assert_eq!(cut.without_gaps(600, 1500), [Range { start: 600, end: 1500 }]);
    }

    #[test]
    fn a_held_command_acts_from_its_own_stamp_on() {
        let mut series = TimeSeries::new(vec![0.0, 0.8, 2.3, 2.6, 4.0]).unwrap();
        series.push("u", None, vec![1.0, 3.0, -1.0, 5.0, 2.0]).unwrap();
        let found = means(&series, &[0.0, 1.0, 2.0, 3.0, 4.0], 1.0).unwrap();
        let expected = [0.8 + 0.2 * 3.0, 3.0, 0.3 * 3.0 - 0.3 + 0.4 * 5.0, 5.0, 2.0];
        for (value, expected) in found.channels()[0].values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-12, "{value} {expected}");
        }
    }

    #[test]
    fn uniform_stamps_are_as_they_are() {
        let uniform = file(|k| (0.001 * k * 1e3).round() / 1e3);
        assert!((uniform.step - 0.001).abs() < 1e-12 && uniform.series.len() == 2000);
    }
}
