//! All values that are exchanged, at one communication point.

use crate::results::{Column, Recorder, Slot};

/// All values of a system at a communication point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    /// Reals.
    pub reals: Vec<f64>,
    /// Integers and enumerations.
    pub integers: Vec<i64>,
    /// Booleans.
    pub booleans: Vec<bool>,
    /// Strings.
    pub strings: Vec<String>,
}

impl Values {
    /// Sets a number; Integers are rounded, a Boolean is true unless the value is 0.
    #[inline]
    pub(in crate::master) fn set(&mut self, slot: Option<Slot>, value: f64) {
        match slot {
            Some(Slot::Real(index)) => self.reals[index] = value,
            Some(Slot::Integer(index)) => self.integers[index] = value.round() as i64,
            Some(Slot::Boolean(index)) => self.booleans[index] = value != 0.0,
            None => {}
        }
    }

    /// A recorder for rows of these values, with room for about this many `steps`.
    pub(in crate::master) fn recorder(&self, columns: Vec<Column>, steps: u64) -> Recorder {
        let width = [self.reals.len(), self.integers.len(), self.booleans.len()];
        let rows = usize::try_from(steps).unwrap_or(usize::MAX).saturating_add(1);
        Recorder::new(columns, width, rows)
    }

    /// Adds a row at `time` \[s\].
    #[inline]
    pub(in crate::master) fn record(&self, rows: &mut Recorder, time: f64) {
        rows.record(time, &self.reals, &self.integers, &self.booleans);
    }

    /// Adds these values to the last row, see [`Recorder::close`].
    pub(in crate::master) fn close(&self, rows: &mut Recorder) {
        rows.close(&self.reals, &self.integers, &self.booleans);
    }

    /// Takes over all values of a buffer of the same layout, without new memory (unless there are texts).
    pub(in crate::master) fn copy_from(&mut self, from: &Values) {
        self.reals.copy_from_slice(&from.reals);
        self.integers.copy_from_slice(&from.integers);
        self.booleans.copy_from_slice(&from.booleans);
        self.strings.clone_from_slice(&from.strings);
    }

    /// The first number that differs, bit by bit; `None` inside for a text.
    pub(in crate::master) fn first_difference(&self, other: &Values) -> Option<Option<Slot>> {
        let bits = |values: &[f64]| -> Vec<u64> { values.iter().map(|value| value.to_bits()).collect() };
        let differs = |index: Option<usize>, slot: fn(usize) -> Slot| index.map(|index| Some(slot(index)));
        differs(mismatch(&bits(&self.reals), &bits(&other.reals)), Slot::Real)
            .or_else(|| differs(mismatch(&self.integers, &other.integers), Slot::Integer))
            .or_else(|| differs(mismatch(&self.booleans, &other.booleans), Slot::Boolean))
            .or_else(|| (self.strings != other.strings).then_some(None))
    }
}

fn mismatch<T: PartialEq>(a: &[T], b: &[T]) -> Option<usize> {
    a.iter().zip(b).position(|(a, b)| a != b)
}
