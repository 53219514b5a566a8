//! One file to a [`Record`]; or to a [`Survey`] alone, for files that are longer than the memory.

use std::path::Path;

use super::channel::Channel;
use super::sampling::{Clock, Sampling};
use super::{Error, Record};
use airloop_series::TimeSeries;
use airloop_series::stream::{Rows, Stream};

/// Rows that are read at once.
pub(super) const ROWS: usize = 4096;

/// Result of a first reading of a file.
#[derive(Debug, Clone)]
pub struct Survey {
    /// Name in messages.
    pub name: String,
    /// Time axis.
    pub sampling: Sampling,
    /// Columns, inputs first, shape \[n_u + n_y\].
    pub channels: Vec<Channel>,
    /// Units of the columns, where the file has them.
    pub units: Vec<Option<String>>,
}

/// Reads `columns` (inputs first, then outputs; `n_u` inputs) of a file; without `keep` the record has no values.
///
/// # Errors
/// [`Error`] with file, line and column.
pub fn file(path: &Path, columns: &[String], n_u: usize, keep: bool) -> Result<(Survey, Record), Error> {
    let name = path.display().to_string();
    let mut stream = Stream::open(path, columns)?;
    let mut clock = Clock::default();
    let mut channels = vec![Channel::default(); columns.len()];
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    let mut rows = Rows::default();
    while stream.read(&mut rows, ROWS)? > 0 {
        for (&time, &line) in rows.time.iter().zip(&rows.lines) {
            clock.push(time, line, &name)?;
        }
        for (channel, column) in channels.iter_mut().zip(&rows.columns) {
            column.iter().zip(&rows.lines).for_each(|(&value, &line)| channel.push(value, line));
        }
        if keep {
            let more = stream.rows_left();
            for (values, column) in values.iter_mut().zip(&rows.columns) {
                if values.len() + column.len() > values.capacity() {
                    values.reserve_exact(column.len() + more);
                }
                values.extend_from_slice(column);
            }
        }
    }
    let units = (0..columns.len()).map(|index| stream.unit(index).map(str::to_owned)).collect();
    let survey = finish(&name, &clock, channels, (columns, n_u), units)?;
    values.iter_mut().for_each(Vec::shrink_to_fit);
    let outputs = values.split_off(n_u);
    let Sampling { sample_time, start, .. } = survey.sampling;
    Ok((survey, Record { name, sample_time, start, inputs: values, outputs }))
}

/// See [`Record::from_series`].
pub(super) fn from_series(
    series: &TimeSeries,
    name: &str,
    inputs: &[String],
    outputs: &[String],
) -> Result<(Record, Vec<String>), Error> {
    let mut clock = Clock::default();
    for (row, &time) in series.time().iter().enumerate() {
        clock.push(time, row + 2, name)?;
    }
    let columns: Vec<String> = inputs.iter().chain(outputs).cloned().collect();
    let (mut channels, mut values, mut units) = (Vec::new(), Vec::new(), Vec::new());
    for column in &columns {
        let found = series.channel(column).ok_or_else(|| {
            let known: Vec<&str> = series.channels().iter().map(|channel| channel.name.as_str()).collect();
            Error::NoColumn { file: name.into(), column: column.clone(), columns: known.join(", ") }
        })?;
        let mut channel = Channel::default();
        found.values.iter().enumerate().for_each(|(row, &value)| channel.push(value, row + 2));
        channels.push(channel);
        values.push(found.values.clone());
        units.push(found.unit.clone());
    }
    let survey = finish(name, &clock, channels, (&columns, inputs.len()), units)?;
    let outputs = values.split_off(inputs.len());
    let Sampling { sample_time, start, .. } = survey.sampling;
    let record = Record { name: name.into(), sample_time, start, inputs: values, outputs };
    Ok((record, survey.notes(&columns)))
}

fn finish(
    name: &str,
    clock: &Clock,
    channels: Vec<Channel>,
    (columns, n_u): (&[String], usize),
    units: Vec<Option<String>>,
) -> Result<Survey, Error> {
    let file = || name.to_owned();
    for (channel, column) in channels.iter().zip(columns) {
        let column = column.clone();
        if channel.is_empty() && channel.samples > 0 {
            return Err(Error::NoNumbers { file: file(), column });
        }
        let (factor, line) = channel.held_over();
        if channel.missing > 0 && factor == 1 {
            let (missing, samples, line) = (channel.missing, channel.samples, channel.first_missing);
            return Err(Error::Missing { file: file(), line, column, missing, samples });
        }
        if channel.missing > 0 {
            return Err(Error::Rates { file: file(), line, column, factor });
        }
    }
    let sampling = clock.finish(name)?;
    let survey = Survey { name: name.into(), sampling, channels, units };
    if let Some((column, line, factor)) = survey.slow_output(columns, n_u) {
        return Err(Error::Rates { file: file(), line, column, factor });
    }
    Ok(survey)
}

impl Survey {
    /// An output that gets new values less often than some other column, with a line that shows it. A command may well
    /// be held, and an output that follows such a command at once is held as long as that one.
    fn slow_output(&self, columns: &[String], n_u: usize) -> Option<(String, usize, usize)> {
        let held: Vec<usize> = self.channels.iter().map(|channel| channel.held_over().0).collect();
        let fastest = held.iter().copied().min().unwrap_or(1);
        let slow = (n_u..columns.len())
            .find(|&index| held[index] > fastest && !held[..n_u].contains(&held[index]))?;
        Some((columns[slow].clone(), self.channels[slow].held_over().1, held[slow]))
    }

    /// Notes on the values, one sentence each.
    pub fn notes(&self, columns: &[String]) -> Vec<String> {
        let saturated = self.channels.iter().zip(columns).filter_map(|(channel, column)| {
            let (value, share) = channel.saturated()?;
            Some(format!(
                "{}: `{column}` stands at its limit {value} in {:.1} % of the rows, as if it were saturated; lower the amplitude, or leave such parts out",
                self.name,
                100.0 * share
            ))
        });
        saturated.collect()
    }
}
