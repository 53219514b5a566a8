//! Values between the samples: linear interpolation or hold, on any time.
//!
//! A time that differs from a sample time only by rounding is that sample: 7 * 0.001 and the text `0.007` must
//! pick the same row of a sampled command.

use super::{Error, TimeSeries};

/// Interpolation of a signal between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Straight line between neighboring samples.
    #[default]
    Linear,
    /// The value of a sample is held until the next one (sampled command, discrete output).
    Hold,
}

/// Distance to a sample, as a fraction of the sample spacing, within which a time counts as that sample.
const SAMPLE_TOLERANCE: f64 = 1e-6;

/// Position of a time between the samples of an axis.
///
/// Before the first sample the first value holds, after the last the last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Index of the sample at or before the time.
    pub index: usize,
    /// Fraction of the way to the next sample, in \[0, 1).
    pub fraction: f64,
}

/// Finds `t` \[s\] on the increasing axis `time` \[s\], beginning the search at `guess`.
///
/// A guess at or just before the right interval makes the look-up constant in time; any guess gives the same
/// answer. The axis must not be empty.
pub fn locate(time: &[f64], t: f64, guess: usize) -> Position {
    let last = time.len().saturating_sub(1);
    let mut index = guess.min(last);
    let near = index + 1 < last && time[index] <= t && t < time[index + 2];
    if near {
        if time[index + 1] <= t {
            index += 1;
        }
    } else {
        index = time.partition_point(|&sample| sample <= t).saturating_sub(1);
    }
    if index >= last || t <= time[index] {
        return Position { index: index.min(last), fraction: 0.0 };
    }
    let fraction = (t - time[index]) / (time[index + 1] - time[index]);
    if fraction < SAMPLE_TOLERANCE {
        Position { index, fraction: 0.0 }
    } else if fraction > 1.0 - SAMPLE_TOLERANCE {
        Position { index: index + 1, fraction: 0.0 }
    } else {
        Position { index, fraction }
    }
}

/// Value of a signal \[n\] at a position found by [`locate`] on its axis of `n` times; in the unit of the signal.
pub fn value_at(values: &[f64], position: Position, interpolation: Interpolation) -> f64 {
    let here = values[position.index];
    if position.fraction == 0.0 || interpolation == Interpolation::Hold {
        return here;
    }
    here + position.fraction * (values[position.index + 1] - here)
}

impl TimeSeries {
    /// The same signals on another time axis \[s\], shape \[m\]; first and last values hold outside the range.
    ///
    /// # Errors
    /// [`Error::Time`] if the new axis does not increase.
    pub fn resample(&self, time: Vec<f64>, interpolation: Interpolation) -> Result<TimeSeries, Error> {
        let mut result = TimeSeries::new(time)?;
        let mut guess = 0;
        let positions: Vec<Position> = result
            .time
            .iter()
            .map(|&t| {
                let position = locate(&self.time, t, guess);
                guess = position.index;
                position
            })
            .collect();
        for channel in &self.channels {
            let values = positions.iter().map(|&at| value_at(&channel.values, at, interpolation)).collect();
            result.push(channel.name.clone(), channel.unit.clone(), values)?;
        }
        Ok(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> TimeSeries {
        let mut series = TimeSeries::new(vec![0.0, 0.001, 0.002, 0.004]).unwrap();
        series.push("r", None, vec![0.0, 1.0, 2.0, 4.0]).unwrap();
        series
    }

    #[test]
    fn a_line_is_interpolated_exactly_and_held_outside() {
        let found = ramp().resample(vec![-1.0, 0.0005, 0.003, 0.0035, 9.0], Interpolation::Linear).unwrap();
        let expected = [0.0, 0.5, 3.0, 3.5, 4.0];
        for (value, expected) in found.channels()[0].values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-12, "{value} {expected}");
        }
    }

    #[test]
    fn hold_keeps_the_last_sample_and_ignores_rounding_of_the_time() {
        let below = 0.002f64.next_down();
        let found = ramp().resample(vec![0.0019, below, 0.0039], Interpolation::Hold).unwrap();
        assert_eq!(found.channels()[0].values, [1.0, 2.0, 2.0]);
    }

    #[test]
    fn the_guess_does_not_change_the_answer() {
        let series = ramp();
        for guess in 0..5 {
            for t in [-1.0, 0.0, 0.0004, 0.001, 0.0031, 0.004, 1.0] {
                assert_eq!(locate(series.time(), t, guess), locate(series.time(), t, 0), "{t} from {guess}");
            }
        }
    }
}
