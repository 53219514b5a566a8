//! CSV in the FMI convention: first column `time` \[s\], then one column per signal, a dot as decimal sign.
//!
//! Another unit of time may be given, as in `time [ms]`; the series is in seconds. Truth values may be written as
//! `true` and `false`.
//!
//! A header cell may be quoted and may carry its unit as `name [unit]`. Numbers are written in the shortest form
//! that reads back bit for bit. A file appears under its name only when it is complete.

use std::io::{Read, Write};
use std::path::Path;

use super::TimeSeries;
use super::header::header_cells;
use super::stream::{Rows, Stream, truth};

pub use super::header::Error;

/// Reads a CSV file.
///
/// # Errors
/// Every [`Error`] names file, line and column.
pub fn read(path: &Path) -> Result<TimeSeries, Error> {
    let file = super::file::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    collect(Stream::whole(file, path)?, path)
}

/// Reads a CSV file some of whose columns have fewer samples: cells that are empty or `NaN`, as NumPy and MATLAB write
/// them, become NaN.
///
/// # Errors
/// Same as [`read`].
pub fn read_with_gaps(path: &Path) -> Result<TimeSeries, Error> {
    let file = super::file::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    collect(Stream::whole(file, path)?.with_gaps(), path)
}

/// Reads CSV text; `path` is only used in messages.
///
/// ```
/// let series = airloop_series::csv::parse("time,u\n0,1\n0.5,2\n", "record.csv".as_ref()).unwrap();
/// assert_eq!(series.channel("u").unwrap().values, [1.0, 2.0]);
/// ```
///
/// # Errors
/// Same as [`read`].
pub fn parse(text: &str, path: &Path) -> Result<TimeSeries, Error> {
    collect(Stream::whole(text.as_bytes(), path)?, path)
}

/// All rows of a stream of whole rows.
fn collect(mut stream: Stream<impl Read>, path: &Path) -> Result<TimeSeries, Error> {
    let mut rows = Rows::default();
    stream.read(&mut rows, usize::MAX)?;
    let Rows { time, columns, lines, words } = rows;
    if time.is_empty() {
        return Err(Error::Empty { path: path.into() });
    }
    if let Some(k) = (1..time.len()).find(|&k| time[k] <= time[k - 1]) {
        let (line, before, after) = (lines[k], time[k - 1], time[k]);
        return Err(Error::NotIncreasing { path: path.into(), line, before, after });
    }
    let named = stream.into_names().into_iter().skip(1).zip(columns);
    let channels = named.map(|((name, unit), values)| (name, unit, values)).collect();
    let mut series =
        TimeSeries::with_channels(time, channels).expect("times, names and lengths were checked");
    for (channel, words) in series.channels.iter_mut().zip(words) {
        channel.words = words;
    }
    Ok(series)
}

/// The error for a value that `signal` cannot have: line and text of the first cell of `column` (0-based, without
/// the time) that `bad` refuses, given its number and whether it is written as a word.
///
/// Reads the file again, as a series does not keep where its values stood; `None` if no cell is refused.
pub fn refuse(
    path: &Path,
    column: usize,
    signal: &str,
    allowed: &str,
    bad: impl Fn(f64, bool) -> bool,
) -> Option<Error> {
    let bytes = std::fs::read(path).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    let names = header_cells(lines.next()?.1, path).ok()?;
    let name = &names.get(column + 1)?.0;
    lines.filter(|(_, row)| !row.trim().is_empty()).find_map(|(index, row)| {
        let cell = row.split(',').nth(column + 1)?;
        let word = truth(cell.as_bytes());
        let value =
            word.or_else(|| cell.trim().trim_matches('"').parse().ok().filter(|v: &f64| v.is_finite()))?;
        bad(value, word.is_some()).then(|| Error::Value {
            path: path.into(),
            line: index + 1,
            column: name.clone(),
            value: cell.trim().into(),
            signal: signal.into(),
            allowed: allowed.into(),
        })
    })
}

/// Writes the series; units are not part of the FMI convention and stay out.
///
/// The rows go to a temporary file next to `path`, which is then renamed: there is never half a file under `path`.
///
/// # Errors
/// [`Error::Io`].
pub fn write(series: &TimeSeries, path: &Path) -> Result<(), Error> {
    super::file::write_whole(path, |out| write_rows(series, out))
        .map_err(|source| Error::Io { path: path.into(), source })
}

fn write_rows(series: &TimeSeries, out: &mut impl Write) -> std::io::Result<()> {
    super::rows::write_header(out, series.channels().iter().map(|channel| channel.name.as_str()))?;
    for (row, &time) in series.time().iter().enumerate() {
        super::rows::write_row(out, time, series.channels().iter().map(|channel| channel.values[row]))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<TimeSeries, Error> {
        parse(text, Path::new("record.csv"))
    }

    #[test]
    fn empty_cells_and_nan_are_gaps_where_they_are_allowed() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "time,a,b\n0,1,\n0.1,,2\n").unwrap();
        let found = read_with_gaps(file.path()).unwrap();
        assert!(found.channels()[0].values[1].is_nan() && found.channels()[1].values[0].is_nan());
        assert!(read(file.path()).is_err());
        std::fs::write(file.path(), "time,a\n0,1\n0.1,NaN\n0.2,3\n").unwrap();
        assert!(read_with_gaps(file.path()).unwrap().channels()[0].values[1].is_nan());
        assert!(read(file.path()).is_err());
        for bad in ["time,a\n0,1\nnan,2\n", "time,a\n0,1\n0.1,inf\n", "time,a\n0,1\n0.1,none\n"] {
            std::fs::write(file.path(), bad).unwrap();
            assert!(read_with_gaps(file.path()).is_err(), "{bad}");
        }
    }

    #[test]
    fn bad_files_are_refused_with_file_line_and_column() {
        let cases = [
            ("", "the file is empty"),
            ("time;u\n0;1\n", "line 1: columns must be separated by commas, but this header has semicolons"),
            ("time\tu\n0\t1\n", "this header has tabs"),
            ("time [N],u\n0,1\n", "line 1, column `time`: [N] is not a unit of time"),
            ("time [ms],u\n0,1\n0,2\n", "line 3, column `time`: 0 s does not come after"),
            ("time,u\ntrue,1\n", "line 2, column `time`: `true` is not a number"),
            ("t,u\n0,1\n", "found `t`"),
            ("time,u\n", "no row of data"),
            ("time,u,u\n0,1,1\n", "line 1, column 3: the name `u` is a duplicate"),
            ("time,,u\n0,1,1\n", "line 1, column 2: the name `` is empty"),
            ("time,\"u\n0,1\n", "line 1: a quoted cell is not closed"),
            ("time,u\n0,1\n1\n", "line 3: 1 cells, but the header has 2"),
            ("time,u\n0,1\n1,2,3\n", "line 3: 3 cells"),
            ("time,u\n0,1\n1,abc\n", "line 3, column `u`: `abc` is not a number"),
            ("time,u\n0,1\n1,\n", "line 3, column `u`: `` is not a number"),
            ("time,u\n0,NaN\n", "line 2, column `u`: `NaN` is not finite"),
            ("time,u\n0,-inf\n", "line 2, column `u`: `-inf` is not finite"),
            ("time,u\n0,1\n\n0,2\n", "line 4, column `time`: 0 s does not come after 0 s"),
            ("time,u\n1,1\n0.5,2\n", "line 3, column `time`: 0.5 s does not come after 1 s"),
            ("time,u\n1,1e999\n", "line 2, column `u`: `1e999` is not finite"),
        ];
        for (text, expected) in cases {
            let message = of(text).unwrap_err().to_string();
            assert!(message.starts_with("record.csv: "), "{message}");
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }

    #[test]
    fn byte_order_mark_windows_lines_quotes_and_units_are_understood() {
        let series =
            of("\u{feff}time,\"A1[1,1]\",x [m], \"say \"\"u\"\"\"\r\n0, 1,2,3\r\n0.5,4,5,6\r\n").unwrap();
        let names: Vec<&str> = series.channels().iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names, ["A1[1,1]", "x", "say \"u\""]);
        assert_eq!(series.channels()[1].unit.as_deref(), Some("m"));
        assert_eq!(series.channels()[2].values, [3.0, 6.0]);
        assert_eq!(series.time(), [0.0, 0.5]);
    }

    #[test]
    fn the_unit_of_the_time_column_is_converted() {
        for (unit, times) in
            [("s", [0.0, 7.0]), ("ms", [0.0, 0.007]), ("us", [0.0, 7e-6]), ("min", [0.0, 420.0])]
        {
            let series = of(&format!("time [{unit}],u\n0,1\n7,2\n")).unwrap();
            assert_eq!(series.time(), times, "{unit}");
        }
    }

    #[test]
    fn truth_values_may_be_words() {
        let series = of("time,b,u\n0,true,1\n1,False,0\n").unwrap();
        assert_eq!(series.channels()[0].values, [1.0, 0.0]);
        assert_eq!(series.channels().iter().map(|channel| channel.words).collect::<Vec<_>>(), [true, false]);
    }

    #[test]
    fn every_bit_survives_writing_and_reading() {
        let values =
            vec![0.1 + 0.2, -0.0, f64::MIN_POSITIVE, 5e-324, 1.0 / 3.0, -1e300, 1e21, 123456789.125, 1e-5];
        let mut series = TimeSeries::new((0..values.len()).map(|k| k as f64 * 0.1).collect()).unwrap();
        series.push("a,\"b\"", None, values).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.csv");
        write(&series, &path).unwrap();
        let back = read(&path).unwrap();
        assert_eq!(back.channels()[0].name, "a,\"b\"");
        let bits = |series: &TimeSeries| -> Vec<u64> {
            series.time().iter().chain(&series.channels()[0].values).map(|value| value.to_bits()).collect()
        };
        assert_eq!(bits(&back), bits(&series));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn a_file_that_is_not_there_is_named() {
        let message = read(Path::new("no/such/file.csv")).unwrap_err().to_string();
        assert!(message.starts_with("no/such/file.csv: "), "{message}");
    }
}
