//! Variables of the rig to show residuals against: command, pressure force, position and angle with their rates.

use super::{Residual, Signal};
use crate::case::Case;

/// A quantity over the time of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name in the vocabulary: `u`, `F`, `x`, `xdot`, `theta`, `thetadot`; or that of a signal of the system.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Values, shape \[n\].
    pub values: Vec<f64>,
}

/// Variables of a record: predicted by the corrected model where it predicts them, else as measured.
pub fn of(case: &Case, record: usize, signals: &[Signal], residuals: &[Residual]) -> Vec<Variable> {
    let dt = 1.0 / case.declaration.sample_rate_hz;
    let measured = |name: &str| Some(case.records.get(record)?.channel(name)?.values.clone());
    let predicted = |name: &str| {
        let own =
            residuals.iter().find(|r| signals.get(r.signal).is_some_and(|signal| signal.name == name))?;
        Some(own.measured.iter().zip(&own.values[1]).map(|(y, r)| y - r).collect::<Vec<f64>>())
    };
    let (x, theta) = (predicted("x"), predicted("theta"));
    let all = [
        ("u", "N", measured("u")),
        ("F", "N", predicted("F_hat")),
        ("xdot", "m/s", x.as_ref().map(|x| rate(x, dt)).or_else(|| measured("v"))),
        ("x", "m", x.or_else(|| measured("x"))),
        ("thetadot", "rad/s", theta.as_ref().map(|theta| rate(theta, dt))),
        ("theta", "rad", theta),
    ];
    all.into_iter()
        .filter_map(|(name, unit, values)| {
            Some(Variable { name: name.into(), unit: unit.into(), values: values? })
        })
        .collect()
}

/// Central differences, one-sided at the ends.
fn rate(values: &[f64], dt: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    let at = |k: usize| {
        let (low, high) = (k.saturating_sub(1), (k + 1).min(last));
        (values[high] - values[low]) / ((high - low).max(1) as f64 * dt)
    };
    (0..values.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_a_line_is_its_slope_up_to_the_ends() {
        let line: Vec<f64> = (0..10).map(|k| 3.0 + 0.5 * f64::from(k)).collect();
        assert!(rate(&line, 0.1).iter().all(|slope| (slope - 5.0).abs() < 1e-12));
    }
}
