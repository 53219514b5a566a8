//! Tables in memory, as a caller from another language has them: the rules and the messages of a CSV file.
//!
//! Row k of the table has the line that it would have in a file: k + 2, below the header.

use std::path::Path;

use super::csv::Error;
use super::header::{Seconds, header_cells};
use super::{Channel, TimeSeries};

/// A series from the header of a CSV file and its columns, the first of them the time.
///
/// `header` is the first line of the file, such as `time [ms],u [N]`; `columns` has one entry per cell of it, all of
/// the same length. `label` takes the place of the path in messages.
///
/// ```
/// use airloop_series::frame;
/// let series = frame::series("time [ms],u", vec![vec![0.0, 7.0], vec![1.0, 2.0]], "inputs".as_ref()).unwrap();
/// assert_eq!(series.time(), [0.0, 0.007]);
/// ```
///
/// | name | shape | meaning |
/// |------|-------|---------|
/// | `columns` | \[cells of the header\]\[n\] | time, increasing, and the channels, in the units of the header |
///
/// # Errors
/// The [`Error`] that the file would get: header, number of cells, values that are not finite, time that does not
/// increase.
pub fn series(header: &str, columns: Vec<Vec<f64>>, label: &Path) -> Result<TimeSeries, Error> {
    let path = || label.to_owned();
    let names = header_cells(header, label)?;
    let seconds = match &names[0].1 {
        None => Seconds::Times(1.0),
        Some(unit) => {
            Seconds::of(unit).ok_or_else(|| Error::TimeUnit { path: path(), unit: unit.clone() })?
        }
    };
    let rows = columns.first().map_or(0, Vec::len);
    if columns.len() != names.len() || columns.iter().any(|column| column.len() != rows) {
        let line = columns.iter().map(Vec::len).min().unwrap_or(0) + 2;
        let (found, expected) = (columns.len(), names.len());
        return Err(Error::RowLength { path: path(), line, found, expected });
    }
    if rows == 0 {
        return Err(Error::Empty { path: path() });
    }
    for ((name, _), column) in names.iter().zip(&columns) {
        if let Some(row) = column.iter().position(|value| !value.is_finite()) {
            let (line, column, value) = (row + 2, name.clone(), column[row].to_string());
            return Err(Error::NotFinite { path: path(), line, column, value });
        }
    }
    let mut columns = columns.into_iter();
    let time = columns.next().unwrap_or_default();
    let time: Vec<f64> = time.into_iter().map(|value| seconds.convert(value)).collect();
    if let Some(k) = (1..time.len()).find(|&k| time[k] <= time[k - 1]) {
        return Err(Error::NotIncreasing { path: path(), line: k + 2, before: time[k - 1], after: time[k] });
    }
    let channel = |((name, unit), values)| Channel { name, unit, values, words: false };
    let channels = names.into_iter().skip(1).zip(columns).map(channel).collect();
    Ok(TimeSeries { time, channels })
}

/// Time \[s\] and channels of a series, without a copy of the values.
pub fn parts(series: TimeSeries) -> (Vec<f64>, Vec<Channel>) {
    (series.time, series.channels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_gets_the_messages_of_the_file_it_could_be() {
        let cases = [
            ("t,u", vec![vec![0.0], vec![1.0]], "found `t`"),
            ("time,u", vec![vec![0.0, 1.0], vec![1.0, f64::NAN]], "line 3, column `u`: `NaN` is not finite"),
            (
                "time,u",
                vec![vec![0.0, 0.0], vec![1.0, 2.0]],
                "line 3, column `time`: 0 s does not come after 0 s",
            ),
            ("time,u", vec![vec![0.0, 1.0], vec![1.0]], "line 3: 2 cells, but the header has 2"),
            ("time,u", vec![vec![0.0]], "1 cells, but the header has 2"),
            ("time,u", vec![vec![], vec![]], "no row of data"),
            ("time,u,u", vec![vec![0.0], vec![0.0], vec![0.0]], "column 3: the name `u` is a duplicate"),
            ("time [N],u", vec![vec![0.0], vec![0.0]], "[N] is not a unit of time"),
        ];
        for (header, columns, expected) in cases {
            let message = series(header, columns, Path::new("inputs")).unwrap_err().to_string();
            assert!(message.starts_with("inputs: ") && message.contains(expected), "{header}: {message}");
        }
    }

    #[test]
    fn a_table_is_the_series_of_its_file() {
        let text = "time [ms],u [N],\"a,b\"\n0,1,2\n7,3,4\n";
        let columns = vec![vec![0.0, 7.0], vec![1.0, 3.0], vec![2.0, 4.0]];
        let table = series(text.lines().next().unwrap(), columns, Path::new("x")).unwrap();
        let file = super::super::csv::parse(text, Path::new("x")).unwrap();
        assert_eq!(table, file);
        let (time, channels) = parts(table);
        assert_eq!((time, channels[0].values.clone()), (vec![0.0, 0.007], vec![1.0, 3.0]));
    }
}
