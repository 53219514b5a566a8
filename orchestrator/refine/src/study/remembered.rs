//! Outputs of simulations that were run before: derivatives at the end of one fit are asked for again at the start of
//! the next, and those of a whole record hold those of its spans.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Values of 8 bytes that the simulations of one half hold at most, keys included: 32 MB.
const MAX_VALUES: usize = 4 << 20;

/// Outputs of a simulation without the effects of the sensors, `[outputs][n]` from where it begins.
pub type Outputs = Arc<Vec<f64>>;

/// All that a simulation depends on besides the study: numbers as their bits.
pub type Key = Vec<u64>;

/// The last simulations of a study. One that is not asked for while the younger half fills up twice is forgotten.
#[derive(Debug, Default)]
pub struct Remembered(Mutex<Halves>);

#[derive(Debug, Default)]
struct Halves {
    younger: HashMap<Key, Outputs>,
    older: HashMap<Key, Outputs>,
    /// Values in the younger half.
    values: usize,
}

impl Halves {
    fn insert(&mut self, key: Key, outputs: Outputs) {
        let keys = key.len();
        self.values += keys + outputs.len();
        if let Some(before) = self.younger.insert(key, outputs) {
            self.values -= keys + before.len();
        }
        if self.values > MAX_VALUES {
            self.older = std::mem::take(&mut self.younger);
            self.values = 0;
        }
    }
}

impl Remembered {
    /// The simulation of this key with at least `count` values, where there is one; else what `simulate` gives.
    pub fn get(&self, key: Key, count: usize, simulate: impl FnOnce() -> Vec<f64>) -> Outputs {
        let long = |outputs: &&Outputs| outputs.len() >= count;
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut halves = lock();
            if let Some(found) = halves.younger.get(&key).filter(long) {
                return Arc::clone(found);
            }
            if let Some(found) = halves.older.get(&key).filter(long).cloned() {
                halves.insert(key, Arc::clone(&found));
                return found;
            }
        }
        let found = Arc::new(simulate());
        lock().insert(key, Arc::clone(&found));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times that a simulation with so many values was run, and values that are there.
    fn ask(remembered: &Remembered, key: u64, count: usize) -> (usize, usize) {
        let mut runs = 0;
        let found = remembered.get(vec![key], count, || {
            runs += 1;
            vec![key as f64; count]
        });
        assert!(found.iter().all(|value| *value == key as f64));
        (runs, found.len())
    }

    #[test]
    fn a_simulation_is_run_once_unless_it_was_too_short() {
        let remembered = Remembered::default();
        let found = [(1, 4), (1, 4), (1, 2), (1, 6), (2, 4)].map(|(key, count)| ask(&remembered, key, count));
        assert_eq!(found, [(1, 4), (0, 4), (0, 4), (1, 6), (1, 4)]);
    }

    #[test]
    fn a_simulation_that_is_not_asked_for_is_forgotten_and_another_stays() {
        let remembered = Remembered::default();
        let runs = |key: u64| ask(&remembered, key, MAX_VALUES / 3).0;
        // Three fill a half; the first is asked for in between, the second is not.
        let found = [0, 1, 2, 0, 3, 4, 0, 5, 6].map(runs);
        assert_eq!(found, [1, 1, 1, 0, 1, 1, 0, 1, 1]);
        assert_eq!([runs(0), runs(1)], [0, 1]);
    }
}
