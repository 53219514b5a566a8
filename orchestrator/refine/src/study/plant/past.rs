//! The past of sampled components that follow system inputs alone: a delay, a filter, an identified actuator. Where a
//! record begins inside its file, they begin with what the file shows before it, not at rest at its first value.
//!
//! Components that follow anything else begin with the record: the past of the states is not known.

use super::{Part, Plant};

/// System inputs up to the begin of a simulation.
#[derive(Debug, Clone, Copy, Default)]
pub struct Before<'a> {
    /// Values, `[inputs][..]`; none where the system's start value holds.
    pub inputs: &'a [Option<Vec<f64>>],
    /// Whether an input stays where it is between its samples, `[inputs]`; else it moves in a line.
    pub held: &'a [bool],
    /// Sample at which the simulation begins.
    pub end: usize,
    /// Most samples to look back.
    pub most: usize,
    /// Time from sample to sample \[s\].
    pub step: f64,
}

/// Largest difference between a ratio of times and a whole number.
const MAX_REST: f64 = 1e-6;

/// Components that begin earlier than the others, and how much.
#[derive(Debug, Default)]
pub(super) struct Earlier {
    /// Whether a component does, by its place.
    parts: Vec<bool>,
    /// Samples.
    pub count: usize,
}

impl Earlier {
    /// Whether the component at a place begins earlier.
    pub fn holds(&self, place: usize) -> bool {
        self.count > 0 && self.parts[place]
    }
}

impl Before<'_> {
    /// Sets system inputs to their values so many samples before the begin.
    pub fn set(&self, slots: &mut [f64], back: f64) {
        let whole = (back - MAX_REST).ceil().max(0.0);
        let (k, part) = (self.end - whole as usize, (whole - back).max(0.0));
        for (slot, (values, held)) in slots.iter_mut().zip(self.inputs.iter().zip(self.held)) {
            if let Some(values) = values {
                let next = values[(k + 1).min(values.len() - 1)];
                *slot = if *held { values[k] } else { values[k] + part * (next - values[k]) };
            }
        }
    }
}

impl Plant {
    /// Components that begin earlier; `states`: those whose values at the begin are given, `[nx]`.
    pub(super) fn earlier(&self, before: &Before, states: &[Option<f64>]) -> Earlier {
        let most = before.end.min(before.most);
        if most == 0 || !self.probed {
            return Earlier::default();
        }
        let fed = |slot: usize| before.inputs.get(slot).is_some_and(Option::is_some);
        let (mut parts, mut period) = (vec![false; self.parts.len()], 1);
        for (place, part) in self.parts.iter().enumerate() {
            let in_loop = self.loops.iter().any(|own| own.parts.contains(&place));
            let given = || part.states.clone().any(|state| states.get(state).is_some_and(Option::is_some));
            if !part.only_events || part.instance.is_stepped() || in_loop || given() {
                continue;
            }
            let mut sources = part.feeds.iter().filter_map(|feed| feed.source).peekable();
            let follows = sources.peek().is_some()
                && sources.all(|(slot, _)| {
                    let by = |(own, earlier): (&Part, &bool)| *earlier && own.writes(slot);
                    fed(slot) || self.parts.iter().zip(&parts).any(by)
                });
            let samples = part.sample_time.and_then(|time| samples(time, before.step));
            if let Some(samples) = samples.filter(|_| follows) {
                parts[place] = true;
                period = least_common_multiple(period, samples);
            }
        }
        let is_any = parts.contains(&true);
        Earlier { parts, count: if is_any { most / period * period } else { 0 } }
    }

    /// Takes the components that began earlier, which are in their first event, to `time` \[s\]; they are in event mode
    /// there if an event is due.
    ///
    /// # Errors
    /// An FMU that fails.
    pub(super) fn follow_past(
        &mut self,
        before: &Before,
        earlier: &Earlier,
        time: f64,
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        if earlier.count == 0 {
            return Ok(());
        }
        let now = self.slots[..self.system_inputs].to_vec();
        let near = MAX_REST * before.step;
        let mut at = time - earlier.count as f64 * before.step;
        loop {
            // The events at the begin are one with those of the others.
            let is_begin = at > time - near;
            before.set(&mut self.slots[..self.system_inputs], ((time - at) / before.step).max(0.0));
            let mut next = time;
            for (_, part) in self.parts.iter_mut().enumerate().filter(|(place, _)| earlier.holds(*place)) {
                let due = part.next_event.is_some_and(|own| own <= at + near);
                if let Some(model) = part.instance.equations().filter(|_| due && !part.in_event) {
                    model.set_time(at)?;
                    model.enter_event_mode()?;
                    part.in_event = true;
                }
                if part.in_event && !is_begin {
                    part.settle((at, x), &mut self.slots, block)?;
                }
                next = part.next_event.map_or(next, |own| own.min(next));
            }
            if is_begin {
                break;
            }
            // An event that stays where it is would never end.
            at = if next > at + near { next } else { time };
        }
        self.slots[..self.system_inputs].copy_from_slice(&now);
        Ok(())
    }
}

impl Part {
    /// Whether an output of it has this slot.
    fn writes(&self, slot: usize) -> bool {
        self.slots().any(|own| own == slot)
    }

    /// Slots of its outputs.
    pub(super) fn slots(&self) -> impl Iterator<Item = usize> + use<'_> {
        let shown = self.shown.iter().map(|own| own.0);
        self.early.1.clone().chain(self.late.1.clone()).chain(shown)
    }
}

/// Samples of the records after which a component with this sample time has an event at a sample again; none where its
/// events would lie elsewhere than without a past.
fn samples(sample_time: f64, step: f64) -> Option<usize> {
    let whole = |ratio: f64| {
        (ratio > 0.5 && (ratio - ratio.round()).abs() < MAX_REST * ratio).then_some(ratio.round())
    };
    match whole(sample_time / step) {
        Some(samples) => Some(samples as usize),
        None => whole(step / sample_time).map(|_| 1),
    }
}

fn least_common_multiple(a: usize, b: usize) -> usize {
    let (mut large, mut small) = (a.max(b), a.min(b));
    while small > 0 {
        (large, small) = (small, large % small);
    }
    a / large * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_past_is_taken_where_events_stay_at_samples() {
        assert_eq!(
            (samples(0.03, 0.01), samples(0.001, 0.01), samples(0.01, 0.01)),
            (Some(3), Some(1), Some(1))
        );
        assert_eq!((samples(0.004, 0.01), samples(0.015, 0.01)), (None, None));
        assert_eq!((least_common_multiple(4, 6), least_common_multiple(1, 7)), (12, 7));
    }

    #[test]
    fn inputs_between_samples_are_held_or_lie_on_a_line() {
        let inputs = [Some(vec![1.0, 3.0, 7.0, 8.0]), Some(vec![1.0, 3.0, 7.0, 8.0]), None];
        let before = Before { inputs: &inputs, held: &[true, false, true], end: 3, most: 3, step: 0.1 };
        let mut slots = [0.0, 0.0, 5.0];
        for (back, expected) in [(3.0, [1.0, 1.0]), (1.5, [3.0, 5.0]), (1.0, [7.0, 7.0]), (0.0, [8.0, 8.0])] {
            before.set(&mut slots, back);
            assert_eq!(slots, [expected[0], expected[1], 5.0], "{back}");
        }
    }
}
