//! Samples of all values at the communication points.
//!
//! A row is a plain copy of the value buffers, into memory reserved before the first step. Names and units are only
//! applied when rows are written ([`Recorder::write_out`]) or the run is over ([`Recorder::finish`]).

use std::collections::HashSet;

use airloop_series::TimeSeries;

use super::journal::Journal;
use super::states::RowsSoFar;

/// Place of a column's value in the recorded buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Slot {
    /// Index into the Real values.
    Real(usize),
    /// Index into the Integer and Enumeration values.
    Integer(usize),
    /// Index into the Boolean values, written as 0 and 1.
    Boolean(usize),
}

/// One column of the result.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// `component.variable`, or the plain name of a system connector.
    pub name: String,
    /// Unit of the written values.
    pub unit: Option<String>,
    /// Place of the value.
    pub slot: Slot,
    /// Written value = factor * value + offset (unit conversion of a system connector).
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
    /// A sampled output: the value read after the step \[t_k, t_k+1\] was held over it and stands at t_k.
    pub held: bool,
}

/// Which rows a recorder keeps, and where.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Keep {
    /// Time between kept rows \[s\]; `None` keeps all. The first and the last row are always kept.
    pub interval: Option<f64>,
    /// Rows leave the memory once they are in the file of [`Recorder::write_to`].
    pub only_in_file: bool,
}

/// Recorded rows.
#[derive(Debug)]
pub struct Recorder {
    columns: Vec<Column>,
    /// Slots of the columns that are held, each once.
    held: Vec<Slot>,
    time: Vec<f64>,
    reals: Vec<f64>,
    integers: Vec<i64>,
    booleans: Vec<bool>,
    width: [usize; 3],
    keep: Keep,
    /// Time of the first row \[s\], once it is known.
    begin: Option<f64>,
    /// Intervals of [`Keep::interval`] after which the next row is kept.
    next: f64,
    /// The last row is there only until another comes.
    passing: bool,
    journal: Option<Box<Journal>>,
    /// Rows in memory that are in the journal.
    written: usize,
}

/// Values reserved at most before the run (per type); longer runs grow while they run.
const RESERVED_VALUES: usize = 1 << 25;
/// The same where rows leave the memory.
const RESERVED_IN_PASSING: usize = 1 << 16;
/// Part of the interval by which a row may come early: times are sums of steps.
const MAX_EARLY_SHARE_OF_INTERVAL: f64 = 1e-6;

impl Recorder {
    /// A recorder for buffers of `width` = \[Real, Integer, Boolean\] values and about `rows` rows.
    ///
    /// Up to 2^25 values (256 MiB of Reals) are reserved here; recording allocates only beyond that.
    pub fn new(mut columns: Vec<Column>, width: [usize; 3], rows: usize) -> Recorder {
        name_as_in_files(&mut columns);
        let mut held: Vec<Slot> = columns.iter().filter(|column| column.held).map(|c| c.slot).collect();
        held.sort_unstable();
        held.dedup();
        let mut recorder = Recorder {
            columns,
            held,
            time: Vec::new(),
            reals: Vec::new(),
            integers: Vec::new(),
            booleans: Vec::new(),
            width,
            keep: Keep::default(),
            begin: None,
            next: 0.0,
            passing: false,
            journal: None,
            written: 0,
        };
        recorder.reserve(rows, RESERVED_VALUES);
        recorder
    }

    fn reserve(&mut self, rows: usize, most: usize) {
        let values = |width: usize| rows.saturating_mul(width).min(most);
        self.time.reserve_exact(values(1));
        self.reals.reserve_exact(values(self.width[0]));
        self.integers.reserve_exact(values(self.width[1]));
        self.booleans.reserve_exact(values(self.width[2]));
    }

    /// Chooses the rows to keep, for a recorder with at most one row.
    pub fn keep(&mut self, keep: Keep) {
        self.keep = keep;
        self.begin = self.time.first().copied();
        self.next = if self.begin.is_some() { 1.0 } else { 0.0 };
        if keep.only_in_file {
            self.time.shrink_to_fit();
            self.reals.shrink_to_fit();
            self.integers.shrink_to_fit();
            self.booleans.shrink_to_fit();
            self.reserve(RESERVED_IN_PASSING, RESERVED_IN_PASSING);
        }
    }

    /// Goes on with a run that began at `start` \[s\], for a recorder with the row of the present point.
    pub fn go_on(&mut self, start: f64, rows: RowsSoFar) {
        self.begin = Some(start);
        (self.next, self.passing) = (rows.next, rows.passing);
    }

    /// The place in the rows of a run, with all rows before the last one on the disk.
    ///
    /// # Errors
    /// The file cannot be written, as on a full disk.
    pub fn so_far(&mut self) -> std::io::Result<RowsSoFar> {
        self.write_out(false)?;
        let before = match &self.journal {
            Some(journal) => journal.sync()?,
            None => self.rows().saturating_sub(1) as u64,
        };
        Ok(RowsSoFar { before, next: self.next, passing: self.passing })
    }

    /// Writes the rows to a file, too, whenever [`Recorder::write_out`] is called. A file with rows of this run is
    /// continued.
    ///
    /// # Errors
    /// The header cannot be written, or that of the file is another.
    pub fn write_to(&mut self, file: std::fs::File) -> std::io::Result<()> {
        let names = self.columns.iter().map(|column| column.name.as_str());
        self.journal = Some(Box::new(Journal::new(file, names)?));
        Ok(())
    }

    /// Copies the values at time `time` \[s\]; the buffers have the widths given to [`Recorder::new`].
    #[inline]
    pub fn record(&mut self, time: f64, reals: &[f64], integers: &[i64], booleans: &[bool]) {
        debug_assert_eq!([reals.len(), integers.len(), booleans.len()], self.width);
        if let Some(last) = self.time.len().checked_sub(1) {
            if self.passing {
                self.time.truncate(last);
                self.reals.truncate(last * self.width[0]);
                self.integers.truncate(last * self.width[1]);
                self.booleans.truncate(last * self.width[2]);
            } else {
                self.hold(last, reals, integers, booleans);
            }
        }
        if let Some(interval) = self.keep.interval {
            self.select(time, interval);
        }
        self.time.push(time);
        self.reals.extend_from_slice(reals);
        self.integers.extend_from_slice(integers);
        self.booleans.extend_from_slice(booleans);
    }

    /// Decides whether the row at `time` stays.
    fn select(&mut self, time: f64, interval: f64) {
        let intervals = (time - *self.begin.get_or_insert(time)) / interval;
        self.passing = intervals < self.next - MAX_EARLY_SHARE_OF_INTERVAL;
        if !self.passing {
            self.next = (intervals + MAX_EARLY_SHARE_OF_INTERVAL).floor() + 1.0;
        }
    }

    /// Gives the held columns of a row the values that were read after the step that begins there.
    #[inline]
    fn hold(&mut self, row: usize, reals: &[f64], integers: &[i64], booleans: &[bool]) {
        for slot in &self.held {
            match *slot {
                Slot::Real(index) => self.reals[row * self.width[0] + index] = reals[index],
                Slot::Integer(index) => self.integers[row * self.width[1] + index] = integers[index],
                Slot::Boolean(index) => self.booleans[row * self.width[2] + index] = booleans[index],
            }
        }
    }

    /// Adds the values after the events of the last row, which held columns have there.
    pub fn close(&mut self, reals: &[f64], integers: &[i64], booleans: &[bool]) {
        debug_assert_eq!([reals.len(), integers.len(), booleans.len()], self.width);
        if let Some(last) = self.time.len().checked_sub(1) {
            self.hold(last, reals, integers, booleans);
        }
    }

    /// Number of rows in memory.
    pub fn rows(&self) -> usize {
        self.time.len()
    }

    /// Whether there is no row at `time` \[s\] or later.
    pub fn ends_before(&self, time: f64) -> bool {
        self.time.last().is_none_or(|&last| time > last)
    }

    /// The columns that [`Recorder::finish`] returns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Whether rows wait for [`Recorder::write_out`] for longer than is good for whom a crash surprises.
    pub fn is_due(&self) -> bool {
        self.journal.as_ref().is_some_and(|journal| journal.is_due())
    }

    /// Writes the rows that do not change any more to the file of [`Recorder::write_to`]; `all`: the last one, too.
    ///
    /// # Errors
    /// The file cannot be written, as on a full disk.
    pub fn write_out(&mut self, all: bool) -> std::io::Result<()> {
        let Some(mut journal) = self.journal.take() else { return Ok(()) };
        let done = if all { self.rows() } else { self.rows().saturating_sub(1) };
        let outcome = (self.written..done)
            .try_for_each(|row| {
                journal.row(self.time[row], self.columns.iter().map(|column| self.value(column, row)))
            })
            .and_then(|()| journal.flush());
        self.journal = Some(journal);
        self.written = done;
        if self.keep.only_in_file && !all && done > 0 {
            self.time.drain(..done);
            self.reals.drain(..done * self.width[0]);
            self.integers.drain(..done * self.width[1]);
            self.booleans.drain(..done * self.width[2]);
            self.written = 0;
        }
        outcome
    }

    /// Value of a column as it is written.
    fn value(&self, column: &Column, row: usize) -> f64 {
        let value = match column.slot {
            Slot::Real(index) => self.reals[row * self.width[0] + index],
            Slot::Integer(index) => self.integers[row * self.width[1] + index] as f64,
            Slot::Boolean(index) => f64::from(u8::from(self.booleans[row * self.width[2] + index])),
        };
        column.factor * value + column.offset
    }

    /// The recorded series, as far as it is in memory. A value of a held column stands at the start of the interval it
    /// was held over; the last row repeats the last value, or has that of [`Recorder::close`].
    ///
    /// # Errors
    /// [`airloop_series::Error`] if times or column names repeat.
    pub fn finish(&self) -> Result<TimeSeries, airloop_series::Error> {
        let rows = self.rows();
        let channels = self.columns.iter().map(|column| {
            let values = (0..rows).map(|row| self.value(column, row)).collect();
            (column.name.clone(), column.unit.clone(), values)
        });
        TimeSeries::with_channels(self.time.clone(), channels.collect())
    }
}

/// Gives columns names that a file of rows can have: without control characters, unlike that of the time, all
/// different.
fn name_as_in_files(columns: &mut [Column]) {
    let mut taken = HashSet::from(["time".to_owned()]);
    for column in columns {
        let name: String = column.name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        column.name = name.clone();
        let mut number = 1;
        while !taken.insert(column.name.clone()) {
            number += 1;
            column.name = format!("{name} ({number})");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str, slot: Slot, held: bool) -> Column {
        Column { name: name.into(), unit: None, slot, factor: 1.0, offset: 0.0, held }
    }

    #[test]
    fn names_of_columns_are_those_that_a_file_can_have() {
        let names = ["a.x\ny", "time", "a.x\ty", "v"];
        let columns = names.map(|name| column(name, Slot::Real(0), false)).to_vec();
        let recorder = Recorder::new(columns, [1, 0, 0], 1);
        let names: Vec<&str> = recorder.columns().iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["a.x y", "time (2)", "a.x y (2)", "v"]);
    }

    #[test]
    fn a_discrete_variable_stands_at_the_start_of_the_interval_it_is_held_over() {
        let columns = vec![column("x", Slot::Real(0), false), column("y", Slot::Real(1), true)];
        let mut recorder = Recorder::new(columns, [2, 0, 0], 3);
        // y = 0 before the first step, then 10 held over [0, 1] and 20 over [1, 2].
        recorder.record(0.0, &[1.0, 0.0], &[], &[]);
        recorder.record(1.0, &[2.0, 10.0], &[], &[]);
        recorder.record(2.0, &[3.0, 20.0], &[], &[]);
        let series = recorder.finish().unwrap();
        assert_eq!(series.channel("x").unwrap().values, [1.0, 2.0, 3.0]);
        assert_eq!(series.channel("y").unwrap().values, [10.0, 20.0, 20.0]);
        // An event at the end that nothing follows.
        recorder.close(&[3.0, 30.0], &[], &[]);
        let series = recorder.finish().unwrap();
        assert_eq!(series.channel("x").unwrap().values, [1.0, 2.0, 3.0]);
        assert_eq!(series.channel("y").unwrap().values, [10.0, 20.0, 30.0]);
    }

    #[test]
    fn all_types_become_numbers_and_units_are_converted() {
        let mut millimeters = column("mm", Slot::Real(0), false);
        millimeters.factor = 1000.0;
        let columns =
            vec![column("b", Slot::Boolean(0), false), column("i", Slot::Integer(1), false), millimeters];
        let mut recorder = Recorder::new(columns, [1, 2, 1], 1);
        recorder.record(0.0, &[0.5], &[7, -3], &[true]);
        let series = recorder.finish().unwrap();
        let row: Vec<f64> = series.channels().iter().map(|channel| channel.values[0]).collect();
        assert_eq!(row, [1.0, -3.0, 500.0]);
    }

    #[test]
    fn recording_stays_within_the_reserved_memory() {
        let mut recorder = Recorder::new(vec![column("x", Slot::Real(0), false)], [1, 0, 0], 100);
        let before = recorder.reals.as_ptr();
        for k in 0..100 {
            recorder.record(k as f64, &[0.0], &[], &[]);
        }
        assert_eq!(recorder.reals.as_ptr(), before);
    }

    #[test]
    fn an_interval_keeps_first_and_last_row_and_held_values_of_their_own_step() {
        let columns = vec![column("x", Slot::Real(0), false), column("y", Slot::Real(1), true)];
        let mut recorder = Recorder::new(columns, [2, 0, 0], 12);
        recorder.keep(Keep { interval: Some(0.3), only_in_file: false });
        for k in 0..=10 {
            recorder.record(0.1 * f64::from(k), &[f64::from(k), 10.0 * f64::from(k)], &[], &[]);
        }
        let series = recorder.finish().unwrap();
        assert_eq!(series.channel("x").unwrap().values, [0.0, 3.0, 6.0, 9.0, 10.0]);
        // Each held value is that of the step that begins in the row, not of the next row that is kept.
        assert_eq!(series.channel("y").unwrap().values, [10.0, 40.0, 70.0, 100.0, 100.0]);
    }

    #[test]
    fn rows_in_a_file_are_those_of_the_series_and_leave_the_memory() {
        let columns = || vec![column("x", Slot::Real(0), false), column("y", Slot::Real(1), true)];
        let folder = tempfile::tempdir().unwrap();
        let mut texts = Vec::new();
        for only_in_file in [false, true] {
            let path = folder.path().join(format!("{only_in_file}.csv"));
            let mut recorder = Recorder::new(columns(), [2, 0, 0], 100);
            recorder.keep(Keep { interval: None, only_in_file });
            recorder.record(0.0, &[0.0, 0.0], &[], &[]);
            recorder.write_to(std::fs::File::create(&path).unwrap()).unwrap();
            for k in 1..100 {
                recorder.record(f64::from(k), &[1.0 / f64::from(k), f64::from(k)], &[], &[]);
                if k % 7 == 0 {
                    recorder.write_out(false).unwrap();
                }
                assert!(!only_in_file || recorder.rows() < 9);
            }
            recorder.write_out(true).unwrap();
            texts.push(std::fs::read_to_string(&path).unwrap());
            if !only_in_file {
                let whole = folder.path().join("whole.csv");
                airloop_series::csv::write(&recorder.finish().unwrap(), &whole).unwrap();
                texts.push(std::fs::read_to_string(whole).unwrap());
            }
        }
        assert_eq!(texts[0].lines().count(), 101);
        assert_eq!(texts[0], texts[1]);
        assert_eq!(texts[0], texts[2]);
    }
}
