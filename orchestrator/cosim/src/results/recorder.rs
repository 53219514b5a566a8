//! Samples of all values at the communication points.
//!
//! A row is a plain copy of the value buffers, into memory reserved before the first step. Names, units and the
//! shift of discrete variables are only applied when the run is over.

use airloop_series::TimeSeries;

/// Place of a column's value in the recorded buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// Recorded rows.
#[derive(Debug, Clone)]
pub struct Recorder {
    columns: Vec<Column>,
    time: Vec<f64>,
    reals: Vec<f64>,
    integers: Vec<i32>,
    booleans: Vec<bool>,
    width: [usize; 3],
    /// There are values after the last row.
    closed: bool,
}

/// Values reserved at most before the run (per type); longer runs grow while they run.
const RESERVED_VALUES: usize = 1 << 25;

impl Recorder {
    /// A recorder for buffers of `width` = \[Real, Integer, Boolean\] values and about `rows` rows.
    ///
    /// Up to 2^25 values (256 MiB of Reals) are reserved here; recording allocates only beyond that.
    pub fn new(columns: Vec<Column>, width: [usize; 3], rows: usize) -> Recorder {
        let values = |width: usize| rows.saturating_mul(width).min(RESERVED_VALUES);
        Recorder {
            columns,
            time: Vec::with_capacity(values(1)),
            reals: Vec::with_capacity(values(width[0])),
            integers: Vec::with_capacity(values(width[1])),
            booleans: Vec::with_capacity(values(width[2])),
            width,
            closed: false,
        }
    }

    /// Copies the values at time `time` \[s\]; the buffers have the widths given to [`Recorder::new`].
    #[inline]
    pub fn record(&mut self, time: f64, reals: &[f64], integers: &[i32], booleans: &[bool]) {
        debug_assert_eq!([reals.len(), integers.len(), booleans.len()], self.width);
        self.time.push(time);
        self.reals.extend_from_slice(reals);
        self.integers.extend_from_slice(integers);
        self.booleans.extend_from_slice(booleans);
    }

    /// Adds the values after the events of the last row, which held columns have there.
    pub fn close(&mut self, reals: &[f64], integers: &[i32], booleans: &[bool]) {
        debug_assert_eq!([reals.len(), integers.len(), booleans.len()], self.width);
        self.reals.extend_from_slice(reals);
        self.integers.extend_from_slice(integers);
        self.booleans.extend_from_slice(booleans);
        self.closed = true;
    }

    /// Number of rows so far.
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

    /// The recorded series. Held columns are moved to the start of the interval they were held over; their
    /// last row repeats the last value, or has that of [`Recorder::close`].
    ///
    /// # Errors
    /// [`airloop_series::Error`] if times or column names repeat.
    pub fn finish(&self) -> Result<TimeSeries, airloop_series::Error> {
        let rows = self.rows();
        let last = if self.closed { rows } else { rows.saturating_sub(1) };
        let mut series = TimeSeries::new(self.time.clone())?;
        for column in &self.columns {
            let values = (0..rows)
                .map(|row| {
                    let row = if column.held { (row + 1).min(last) } else { row };
                    let value = match column.slot {
                        Slot::Real(index) => self.reals[row * self.width[0] + index],
                        Slot::Integer(index) => f64::from(self.integers[row * self.width[1] + index]),
                        Slot::Boolean(index) => {
                            f64::from(u8::from(self.booleans[row * self.width[2] + index]))
                        }
                    };
                    column.factor * value + column.offset
                })
                .collect();
            series.push(column.name.clone(), column.unit.clone(), values)?;
        }
        Ok(series)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str, slot: Slot, held: bool) -> Column {
        Column { name: name.into(), unit: None, slot, factor: 1.0, offset: 0.0, held }
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
}
