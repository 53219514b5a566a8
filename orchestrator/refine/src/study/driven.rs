//! Recorded commands and further signals between two samples: held, on the straight line from one to the next, or on
//! the parabola through both and what is known halfway.

/// System inputs or further signals that have values.
pub(super) struct Driven<'a> {
    inputs: Vec<Input<'a>>,
    /// Samples of the record; of what stands behind them nothing is used.
    n: usize,
    /// For each: value at the sample, change to the next, and four times the distance of the middle from the line.
    steps: Vec<[f64; 3]>,
}

/// A signal that has values.
struct Input<'a> {
    /// Its place among the signals of the system.
    slot: usize,
    /// Values from the beginning of the record on.
    values: &'a [f64],
    /// Values halfway to the next ones; none where it is held or moves in a line.
    middles: Option<&'a [f64]>,
    /// Whether it stays where it is between its samples.
    held: bool,
}

impl<'a> Driven<'a> {
    /// Of `inputs`, each with `past` samples before the record and its `n`, some with values halfway between these `n`.
    pub(super) fn new(
        inputs: &'a [Option<Vec<f64>>],
        middles: &'a [Option<Vec<f64>>],
        held: &[bool],
        (past, n): (usize, usize),
    ) -> Driven<'a> {
        let one = |(slot, values): (usize, &'a Option<Vec<f64>>)| {
            let values = &values.as_ref()?[past..];
            Some(Input { slot, values, middles: middles[slot].as_deref(), held: held[slot] })
        };
        Driven::of(inputs.iter().enumerate().filter_map(one).collect(), n)
    }

    /// Of further signals, each with its `n` samples, the first at the place `first` among the signals of the system.
    pub(super) fn further(
        signals: &'a [Vec<f64>],
        held: impl Fn(usize) -> bool,
        (first, n): (usize, usize),
    ) -> Driven<'a> {
        let one = |(index, values): (usize, &'a Vec<f64>)| Input {
            slot: first + index,
            values,
            middles: None,
            held: held(index),
        };
        Driven::of(signals.iter().enumerate().map(one).collect(), n)
    }

    fn of(inputs: Vec<Input<'a>>, n: usize) -> Driven<'a> {
        let steps = vec![[0.0; 3]; inputs.len()];
        Driven { inputs, n, steps }
    }

    /// Goes to sample `k` of the record.
    pub(super) fn at(&mut self, k: usize) {
        for (Input { values, middles, held, .. }, step) in self.inputs.iter().zip(&mut self.steps) {
            let next = values[(k + 1).min(self.n - 1)];
            let change = if *held { 0.0 } else { next - values[k] };
            let middle = middles.filter(|_| k + 1 < self.n).map(|own| own[k]);
            *step = [values[k], change, middle.map_or(0.0, |own| 4.0 * (own - values[k] - 0.5 * change))];
        }
    }

    /// Sets the signals among all of the system to their values this part of a step behind the sample.
    #[inline]
    pub(super) fn set(&self, slots: &mut [f64], part: f64) {
        for (input, [here, change, bend]) in self.inputs.iter().zip(&self.steps) {
            slots[input.slot] = here + part * (change + bend * (1.0 - part));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_held_or_moves_to_its_next_sample() {
        // One sample before the record, and one behind it that windows leave out.
        let inputs = [Some(vec![9.0, 1.0, 3.0, 8.0]), None, Some(vec![9.0, 5.0, 6.0, 8.0])];
        let middles = [None, None, None];
        let mut driven = Driven::new(&inputs, &middles, &[false, false, true], (1, 2));
        let mut slots = [0.0; 4];
        driven.at(0);
        driven.set(&mut slots, 0.25);
        assert_eq!(slots, [1.5, 0.0, 5.0, 0.0]);
        // Behind the last sample nothing moves.
        driven.at(1);
        driven.set(&mut slots, 0.5);
        assert_eq!(slots, [3.0, 0.0, 6.0, 0.0]);
    }

    #[test]
    fn a_command_with_middles_passes_through_them() {
        let (inputs, middles) = ([Some(vec![1.0, 3.0])], [Some(vec![2.5, 9.0])]);
        let mut driven = Driven::new(&inputs, &middles, &[false], (0, 2));
        let mut slots = [0.0];
        driven.at(0);
        for (part, expected) in [(0.0, 1.0), (0.5, 2.5), (1.0, 3.0)] {
            driven.set(&mut slots, part);
            assert_eq!(slots, [expected]);
        }
        // Behind the last sample nothing moves.
        driven.at(1);
        driven.set(&mut slots, 0.5);
        assert_eq!(slots, [3.0]);
    }
}
