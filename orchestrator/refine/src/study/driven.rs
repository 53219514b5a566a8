//! Recorded commands between two samples: held, or on the straight line from one to the next.

/// The system inputs that have values.
pub(super) struct Driven<'a> {
    /// For each: its place among the system inputs, its values from the beginning of the record on, whether it is held.
    inputs: Vec<(usize, &'a [f64], bool)>,
    /// Samples of the record; of what stands behind them nothing is used.
    n: usize,
    /// For each: value at the sample, and change to the next.
    steps: Vec<(f64, f64)>,
}

impl<'a> Driven<'a> {
    /// Of `inputs`, each with `past` samples before the record and its `n`.
    pub(super) fn new(
        inputs: &'a [Option<Vec<f64>>],
        held: &[bool],
        (past, n): (usize, usize),
    ) -> Driven<'a> {
        let inputs: Vec<_> = inputs
            .iter()
            .zip(held)
            .enumerate()
            .filter_map(|(slot, (values, held))| Some((slot, &values.as_ref()?[past..], *held)))
            .collect();
        let steps = vec![(0.0, 0.0); inputs.len()];
        Driven { inputs, n, steps }
    }

    /// Goes to sample `k` of the record.
    pub(super) fn at(&mut self, k: usize) {
        for ((_, values, held), step) in self.inputs.iter().zip(&mut self.steps) {
            let next = values[(k + 1).min(self.n - 1)];
            *step = (values[k], if *held { 0.0 } else { next - values[k] });
        }
    }

    /// Sets the inputs, in their order the first of `slots`, to their values this part of a step behind the sample.
    #[inline]
    pub(super) fn set(&self, slots: &mut [f64], part: f64) {
        for ((slot, ..), (here, change)) in self.inputs.iter().zip(&self.steps) {
            slots[*slot] = here + part * change;
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
        let mut driven = Driven::new(&inputs, &[false, false, true], (1, 2));
        let mut slots = [0.0; 4];
        driven.at(0);
        driven.set(&mut slots, 0.25);
        assert_eq!(slots, [1.5, 0.0, 5.0, 0.0]);
        // Behind the last sample nothing moves.
        driven.at(1);
        driven.set(&mut slots, 0.5);
        assert_eq!(slots, [3.0, 0.0, 6.0, 0.0]);
    }
}
