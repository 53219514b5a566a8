//! Numbers taken of a simulated signal.

use airloop_series::TimeSeries;

use crate::file::{Direction, Of};

/// Quantity of a signal; none where it has no value, such as an event that does not happen.
pub fn of(series: &TimeSeries, signal: &str, of: Of, level: f64, direction: Direction) -> Option<f64> {
    let values = &series.channel(signal)?.values;
    match of {
        Of::Min => values.iter().copied().reduce(f64::min),
        Of::Max => values.iter().copied().reduce(f64::max),
        Of::Peak => values.iter().map(|value| value.abs()).reduce(f64::max),
        Of::Final => values.last().copied(),
        Of::Rms => rms(series.time(), values),
        Of::Event => crossing(series.time(), values, level, direction),
        // Both come from the comparison with the record.
        Of::RmsError | Of::Fit => None,
    }
}

/// Root of the mean square over time, by the trapezoidal rule on the squares.
fn rms(time: &[f64], values: &[f64]) -> Option<f64> {
    let span = time.last()? - time.first()?;
    if span <= 0.0 {
        return values.first().map(|value| value.abs());
    }
    let pieces = time.windows(2).zip(values.windows(2));
    let sum: f64 = pieces.map(|(t, v)| 0.5 * (t[1] - t[0]) * (v[0] * v[0] + v[1] * v[1])).sum();
    Some((sum / span).sqrt())
}

/// First time at which a line between the rows crosses a level, or begins on it.
fn crossing(time: &[f64], values: &[f64], level: f64, direction: Direction) -> Option<f64> {
    let side = |value: f64| value - level;
    let step = |k: &usize| {
        let (before, after) = (side(values[*k]), side(values[k + 1]));
        match direction {
            Direction::Rising => before < 0.0 && after >= 0.0,
            Direction::Falling => before > 0.0 && after <= 0.0,
            Direction::Any => (before < 0.0 && after >= 0.0) || (before > 0.0 && after <= 0.0),
        }
    };
    let k = (0..values.len().saturating_sub(1)).find(step)?;
    let (before, after) = (side(values[k]), side(values[k + 1]));
    Some(time[k] + (time[k + 1] - time[k]) * before / (before - after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_the_quantities_of_the_closed_form() {
        let time: Vec<f64> = (0..=10_000).map(|k| f64::from(k) * 1e-3).collect();
        let pi = std::f64::consts::PI;
        let values: Vec<f64> = time.iter().map(|t| 2.0 * (pi * t + 0.1).sin()).collect();
        let last = *values.last().unwrap();
        let mut series = TimeSeries::new(time).unwrap();
        series.push("x", None, values).unwrap();
        let get = |what, level, direction| of(&series, "x", what, level, direction);
        // Straight lines between rows of 1 ms bend by less than (pi 1e-3)^2 / 8 of the amplitude.
        let near =
            |found: Option<f64>, truth: f64| assert!((found.unwrap() - truth).abs() < 3e-6, "{found:?}");
        near(get(Of::Max, 0.0, Direction::Any), 2.0);
        near(get(Of::Min, 0.0, Direction::Any), -2.0);
        near(get(Of::Peak, 0.0, Direction::Any), 2.0);
        near(get(Of::Rms, 0.0, Direction::Any), 2.0_f64.sqrt());
        assert_eq!(get(Of::Final, 0.0, Direction::Any), Some(last));
        near(get(Of::Event, 0.0, Direction::Falling), (pi - 0.1) / pi);
        near(get(Of::Event, 0.0, Direction::Rising), (2.0 * pi - 0.1) / pi);
        near(get(Of::Event, 1.0, Direction::Any), (pi / 6.0 - 0.1) / pi);
        assert_eq!(get(Of::Event, 3.0, Direction::Any), None);
    }
}
