//! Columns of a series to a record in SI units.

use super::track::Sweep;
use airloop_series::units::{self, Compatibility};
use airloop_series::{Channel, TimeSeries};

/// Names of the columns.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    /// Force \[N\].
    pub force: String,
    /// Position \[m\].
    pub position: Option<String>,
    /// Velocity \[m/s\].
    pub velocity: Option<String>,
    /// Acceleration \[m/s2\].
    pub acceleration: Option<String>,
    /// Pressure \[Pa\].
    pub pressure: Option<String>,
}

/// Reason why columns cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
#[allow(missing_docs, reason = "file, column and unit, as named in each message")]
pub enum Error {
    /// No such column.
    #[error("{file}: there is no column `{column}` for the {what}; there are {there}")]
    Column { file: String, column: String, what: &'static str, there: String },
    /// A unit of another quantity.
    #[error("{file}: column `{column}` is in [{unit}], but the {what} must be in a unit of {wanted}")]
    Unit { file: String, column: String, unit: String, what: &'static str, wanted: &'static str },
    /// Nothing left.
    #[error("{file}: no sample lies between {from} s and {to} s; the record runs from {first} s to {last} s")]
    Range { file: String, from: f64, to: f64, first: f64, last: f64 },
}

/// The record of a file, only its samples from `from` to `to` \[s\]. Columns without a unit are taken to be SI.
///
/// # Errors
/// A column that is not there or has a unit of another quantity, or nothing in the range.
pub fn sweep(
    series: &TimeSeries,
    file: &str,
    columns: &Columns,
    (from, to): (f64, f64),
) -> Result<Sweep, Error> {
    let time = series.time();
    let begin = time.partition_point(|t| *t < from);
    let end = time.partition_point(|t| *t <= to).max(begin);
    if begin == end {
        let (first, last) = (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(0.0));
        return Err(Error::Range { file: file.into(), from, to, first, last });
    }
    let take = |name: &Option<String>, what, wanted| -> Result<Option<Vec<f64>>, Error> {
        let Some(name) = name else { return Ok(None) };
        let channel = series.channel(name).ok_or_else(|| Error::Column {
            file: file.into(),
            column: name.clone(),
            what,
            there: series.channels().iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", "),
        })?;
        let (factor, offset) = to_si(channel, file, what, wanted)?;
        Ok(Some(channel.values[begin..end].iter().map(|value| factor * value + offset).collect()))
    };
    Ok(Sweep {
        name: file.into(),
        time: time[begin..end].to_vec(),
        force: take(&Some(columns.force.clone()), "force", "N")?.unwrap_or_default(),
        position: take(&columns.position, "position", "m")?,
        velocity: take(&columns.velocity, "velocity", "m/s")?,
        acceleration: take(&columns.acceleration, "acceleration", "m/s2")?,
        pressure: take(&columns.pressure, "pressure", "Pa")?,
    })
}

fn to_si(
    channel: &Channel,
    file: &str,
    what: &'static str,
    wanted: &'static str,
) -> Result<(f64, f64), Error> {
    let Some(unit) = &channel.unit else { return Ok((1.0, 0.0)) };
    let relation = units::lookup(unit).zip(units::lookup(wanted)).map(|(a, b)| units::compatible(&a, &b));
    match relation {
        Some(Compatibility::Equal) => Ok((1.0, 0.0)),
        Some(Compatibility::Convertible { factor, offset }) => Ok((factor, offset)),
        _ => {
            let (column, unit) = (channel.name.clone(), unit.clone());
            Err(Error::Unit { file: file.into(), column, unit, what, wanted })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> TimeSeries {
        let mut series = TimeSeries::new(vec![0.0, 0.5, 1.0]).unwrap();
        series.push("F", Some("kN".into()), vec![0.001, 0.002, 0.003]).unwrap();
        series.push("v", None, vec![0.1, 0.2, 0.3]).unwrap();
        series
    }

    fn columns(force: &str) -> Columns {
        Columns { force: force.into(), velocity: Some("v".into()), ..Columns::default() }
    }

    #[test]
    fn units_are_converted_and_the_range_is_cut() {
        let record = sweep(&series(), "a.csv", &columns("F"), (0.4, 9.0)).unwrap();
        assert_eq!(record.force, [2.0, 3.0]);
        assert_eq!(record.velocity.unwrap(), [0.2, 0.3]);
    }

    #[test]
    fn columns_that_do_not_fit_are_named() {
        let message = sweep(&series(), "a.csv", &columns("G"), (0.0, 1.0)).unwrap_err().to_string();
        assert!(message.contains("`G`") && message.contains("`F`, `v`"), "{message}");
        let wrong = Columns { velocity: Some("F".into()), ..columns("F") };
        let message = sweep(&series(), "a.csv", &wrong, (0.0, 1.0)).unwrap_err().to_string();
        assert!(message.contains("[kN]") && message.contains("m/s"), "{message}");
        assert!(matches!(sweep(&series(), "a.csv", &columns("F"), (5.0, 9.0)), Err(Error::Range { .. })));
    }
}
