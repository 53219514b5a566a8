//! Points that were visited, with the values and derivatives found there: a solver asks for second derivatives where it
//! had the first, and for first ones where it had the values.
//!
//! Records stand in the order in which their points were first visited, as they are asked for in much the same order
//! again; a hash of the point's bits finds them. The oldest are replaced.

/// Records that one group of the index knows.
const RECORDS_PER_GROUP: usize = 4;
/// Bytes that are kept at most.
const MAX_BYTES: usize = 16 << 20;
/// Points that are kept at most.
const MAX_POINTS: usize = 1 << 14;

/// Extent of what is known of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Known {
    Nothing,
    Values,
    Derivatives,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Memory {
    /// Numbers of a point, and of a whole record.
    key: usize,
    width: usize,
    numbers: Vec<f64>,
    /// Of each record; empty where nothing can be kept.
    known: Vec<Known>,
    /// Record that is written next.
    head: usize,
    /// Record of the last point: its neighbors are tried first.
    last: usize,
    /// Part of the hash, and record.
    index: Vec<[(u32, u32); RECORDS_PER_GROUP]>,
}

impl Memory {
    /// For points of `key` numbers with `payload` numbers each.
    pub fn new(key: usize, payload: usize) -> Memory {
        let width = key + payload;
        let records = (MAX_BYTES / (8 * width)).min(MAX_POINTS);
        // Twice as many places in the index as records.
        let groups = (2 * records / RECORDS_PER_GROUP).max(1).next_power_of_two();
        Memory {
            key,
            width,
            numbers: vec![0.0; records * width],
            known: vec![Known::Nothing; records],
            head: 0,
            last: 0,
            index: vec![[(0, u32::MAX); RECORDS_PER_GROUP]; groups],
        }
    }

    /// An empty one of the same size.
    pub fn fresh(&self) -> Memory {
        Memory::new(self.key, self.width - self.key)
    }

    /// Record of a point, and how much is known there; a new record where it is unknown. `None` without memory.
    pub fn place(&mut self, key: &[f64]) -> Option<(usize, Known)> {
        let records = self.known.len();
        if records == 0 {
            return None;
        }
        // Points are asked for in the order in which they were first seen, or backwards.
        for record in [(self.last + 1) % records, (self.last + records - 1) % records] {
            if self.known[record] > Known::Nothing && self.is_at(record, key) {
                self.last = record;
                return Some((record, self.known[record]));
            }
        }
        let hash = hash(key);
        let (group, tag) = ((hash >> 20) as usize & (self.index.len() - 1), hash as u32);
        for &(other, record) in &self.index[group] {
            let record = record as usize;
            if other == tag && record < records && self.is_at(record, key) {
                self.last = record;
                return Some((record, self.known[record]));
            }
        }
        let record = self.head;
        self.head = (record + 1) % records;
        // Of the group, an empty place or the one with the oldest record.
        let age = |&&mut (_, other): &&mut (u32, u32)| match other as usize {
            other if other >= records => usize::MAX,
            other => (record + records - other - 1) % records,
        };
        if let Some(place) = self.index[group].iter_mut().max_by_key(age) {
            *place = (tag, record as u32);
        }
        self.numbers[record * self.width..][..self.key].copy_from_slice(key);
        self.known[record] = Known::Nothing;
        self.last = record;
        Some((record, Known::Nothing))
    }

    fn is_at(&self, record: usize, key: &[f64]) -> bool {
        let kept = &self.numbers[record * self.width..][..self.key];
        kept.iter().zip(key).all(|(a, b)| a.to_bits() == b.to_bits())
    }

    /// Numbers kept in a record.
    pub fn numbers(&self, record: usize) -> &[f64] {
        &self.numbers[record * self.width + self.key..(record + 1) * self.width]
    }

    /// Keeps values, or values and derivatives one after the other.
    pub fn keep(&mut self, record: usize, known: Known, parts: [&[f64]; 2]) {
        let target = &mut self.numbers[record * self.width + self.key..(record + 1) * self.width];
        let (values, derivatives) = target.split_at_mut(parts[0].len());
        values.copy_from_slice(parts[0]);
        if known == Known::Derivatives {
            derivatives.copy_from_slice(parts[1]);
        }
        self.known[record] = known;
    }
}

fn hash(key: &[f64]) -> u64 {
    let mix = |hash: u64, number: &f64| {
        let mixed = (hash ^ number.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^ (mixed >> 29)
    };
    key.iter().fold(0, mix)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_found_again_with_what_was_kept() {
        let mut memory = Memory::new(2, 3);
        let key = |k: usize| [k as f64 * 0.1, -(k as f64)];
        for k in 0..5000 {
            let (place, known) = memory.place(&key(k)).unwrap();
            assert_eq!(known, Known::Nothing);
            let number = k as f64;
            memory.keep(place, Known::Derivatives, [&[number], &[number + 0.5, number + 0.25]]);
        }
        let mut found = 0;
        for k in 0..5000 {
            let (place, known) = memory.place(&key(k)).unwrap();
            if known == Known::Derivatives {
                let number = k as f64;
                assert_eq!(memory.numbers(place), [number, number + 0.5, number + 0.25]);
                found += 1;
            }
        }
        assert!(found > 4900, "{found}");
    }

    #[test]
    fn the_oldest_points_are_forgotten() {
        let mut memory = Memory::new(1, 1);
        let count = 2 * MAX_POINTS;
        for k in 0..count {
            let (place, _) = memory.place(&[k as f64]).unwrap();
            memory.keep(place, Known::Values, [&[-(k as f64)], &[]]);
        }
        assert_eq!(memory.place(&[0.0]).unwrap().1, Known::Nothing);
        let known = (count - MAX_POINTS / 2..count).filter(|&k| match memory.place(&[k as f64]).unwrap() {
            (place, Known::Values) => memory.numbers(place) == [-(k as f64)],
            _ => false,
        });
        assert!(known.count() > MAX_POINTS / 2 - MAX_POINTS / 50);
    }

    #[test]
    fn zeros_of_either_sign_are_two_points() {
        let mut memory = Memory::new(1, 1);
        let (place, _) = memory.place(&[0.0]).unwrap();
        memory.keep(place, Known::Values, [&[1.0], &[]]);
        assert_eq!(memory.place(&[-0.0]).unwrap().1, Known::Nothing);
        assert_eq!(memory.place(&[0.0]).unwrap(), (place, Known::Values));
    }

    #[test]
    fn points_too_large_to_keep_are_not_kept() {
        assert_eq!(Memory::new(MAX_BYTES, 1).place(&vec![0.0; MAX_BYTES]), None);
    }
}
