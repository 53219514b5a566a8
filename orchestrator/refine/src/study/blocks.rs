//! The blocks of candidates while a system is simulated: their states, and the values that they change.

use std::cell::{Cell, RefCell};
use std::ops::Range;

use super::catalog::fastest;
use super::law::{Law, Point, preslide_along, shape};
use super::linear::Linear;
use super::memory::Memory;
use super::model::Study;
use crate::vocabulary::own::{MAX_STATES, Own};

/// Largest values seen at the attachments.
#[derive(Debug, Clone, Default)]
pub struct Survey {
    /// For each attachment: ranges of velocity, position, pressure force, pressure, and of the value that passes.
    pub ranges: Vec<[(f64, f64); 5]>,
    /// For each attachment: largest rate of that value; empty: not looked for.
    pub fastest: Vec<f64>,
    /// For each attachment: positions at the samples; empty: not looked for.
    pub positions: Vec<Vec<f64>>,
}

impl Survey {
    /// Adds what a trace shows, `[records]` of its step \[s\] and points `[taps][n]`.
    pub(super) fn trace(&mut self, records: &[(f64, Vec<Vec<Point>>)]) {
        let rate = |tap: usize| {
            let own = records.iter().filter_map(|(step, taps)| Some((*step, taps.get(tap)?)));
            own.map(|(step, points)| {
                let values: Vec<f64> = points.iter().map(|point| point.value).collect();
                fastest(&values, step)
            })
            .fold(0.0, f64::max)
        };
        self.fastest = (0..self.ranges.len()).map(rate).collect();
        let positions = |tap: usize| {
            let own = records.iter().filter_map(|(_, taps)| taps.get(tap)).flatten();
            own.map(|point| point.position).collect()
        };
        self.positions = (0..self.ranges.len()).map(positions).collect();
    }

    pub(super) fn see(&mut self, tap: usize, values: [f64; 5]) {
        for (range, value) in self.ranges[tap].iter_mut().zip(values) {
            *range = (range.0.min(value), range.1.max(value));
        }
    }
}

/// States of an effect of one's own after `step` \[s\] on the way between two points, with the variables at their
/// means, on both sides of a change of direction each: memories of friction follow |v|.
fn advance_along(own: &Own, [begin, end]: [Point; 2], z: &mut [f64], p: &[f64], step: f64) {
    if begin.velocity * end.velocity >= 0.0 {
        return own.advance(begin.mean(end).variables(), z, p, step);
    }
    let part = begin.velocity / (begin.velocity - end.velocity);
    let turn = begin.toward(end, part);
    own.advance(begin.mean(turn).variables(), z, p, part * step);
    own.advance(turn.mean(end).variables(), z, p, (1.0 - part) * step);
}

/// A law that acts: its parameters, its states in those of the blocks.
pub(super) type Acting = (Law, Range<usize>, Range<usize>);

/// States of the blocks and what they need besides the slots.
pub(super) struct Blocks<'a> {
    pub(super) study: &'a Study,
    pub(super) p: &'a [f64],
    /// For each tap: law, its parameters, its states in `z`.
    pub(super) laws: Vec<Vec<Acting>>,
    /// For each tap: velocity of the sign change of its friction.
    pub(super) vt: Vec<f64>,
    pub(super) z: Vec<f64>,
    /// For each of these states: what an effect with a memory has seen.
    pub(super) memories: Vec<Memory>,
    /// Time of the sample \[s\].
    pub(super) time: f64,
    /// Time of the evaluation \[s\].
    pub(super) now: Cell<f64>,
    /// For each tap: the value that came in last.
    pub(super) seen: Vec<Cell<f64>>,
    /// For each tap: what was seen at the sample, and last, with the time of that.
    pub(super) within: Vec<[Cell<Point>; 2]>,
    pub(super) survey: Option<RefCell<Survey>>,
    /// Signals that the laws depend on at every sample, `[taps][n]`; empty: not recorded.
    pub(super) trace: Vec<Vec<Point>>,
    /// States at every sample of a trace, `[n][nx]`.
    pub(super) states: Vec<Vec<f64>>,
    /// Added to a value that a free form acts on.
    pub(super) offset: Cell<f64>,
    /// Linearization; none: not recorded.
    pub(super) linear: Option<RefCell<Linear>>,
}

impl Blocks<'_> {
    /// Signals that the laws at an attachment depend on.
    pub(super) fn point(&self, tap: usize, slots: &[f64]) -> Point {
        let at = |slot: Option<usize>| slot.map_or(0.0, |slot| slots[slot]);
        let [velocity, position, pressure_force, pressure] = self.study.taps[tap].signals.map(at);
        let value = self.seen[tap].get();
        Point { velocity, position, pressure_force, pressure, time: self.time, value }
    }

    /// Puts the states to where they begin.
    pub(super) fn rest(&mut self) {
        for (law, _, states) in self.laws.iter().flatten() {
            let value = if matches!(law, Law::Memory(_)) { f64::NAN } else { 0.0 };
            self.z[states.clone()].fill(value);
        }
        self.memories.iter().for_each(Memory::clear);
    }

    /// Level that presliding acts on: declared, and whatever other laws add to it.
    pub(super) fn level(&self, tap: usize, at: &Point) -> f64 {
        let own = &self.study.taps[tap];
        let declared = own.coulomb.map_or(0.0, |level| level.of(self.p));
        let one = |(law, range, _): &Acting| {
            let v0 = if *law == Law::Stribeck { own.v0 } else { 0.0 };
            law.level(&self.p[range.clone()], &Point { velocity: at.velocity - v0, ..*at })
        };
        declared + self.laws[tap].iter().map(one).sum::<f64>()
    }

    /// The value behind an attachment.
    #[inline]
    pub(super) fn pass(&self, tap: usize, value: f64, slots: &[f64]) -> f64 {
        self.seen[tap].set(value);
        // Most attachments have no law.
        if self.laws[tap].is_empty() && self.survey.is_none() {
            return value;
        }
        self.acted_on(tap, value, slots)
    }

    /// The value behind an attachment that has laws or is surveyed.
    fn acted_on(&self, tap: usize, value: f64, slots: &[f64]) -> f64 {
        let point = self.point(tap, slots);
        if let Some(survey) = &self.survey {
            let Point { velocity, position, pressure_force, pressure, .. } = point;
            survey.borrow_mut().see(tap, [velocity, position, pressure_force, pressure, value]);
        }
        let own = &self.study.taps[tap];
        let from_sign_change = point.velocity - own.v0;
        let s = || (from_sign_change / self.vt[tap]).tanh();
        let mut value = value;
        for (law, range, states) in &self.laws[tap] {
            let p = &self.p[range.clone()];
            if let Law::Own(index) = *law {
                let (own, at) = (&self.study.own[index], Point { value, time: self.now.get(), ..point });
                let mut z = [0.0; MAX_STATES];
                z[..states.len()].copy_from_slice(&self.z[states.clone()]);
                if !states.is_empty() {
                    let sample = self.see(tap, at);
                    advance_along(own, [sample, at], &mut z[..states.len()], p, at.time - self.time);
                }
                let found = own.value(at.variables(), &z, p);
                value = if own.port.replaces() { found } else { value - self.study.taps[tap].sign * found };
            } else if let Law::Surface(index) = *law {
                let at = Point { value, time: self.now.get(), ..point };
                value += self.offset.get() - own.sign * self.study.surfaces[index].value(p, &at);
            } else if let Law::Memory(kind) = *law {
                let (memory, z) = (&self.memories[states.start], &self.z[states.clone()]);
                value = memory.pass((kind, p), z, (self.time, self.now.get()), value);
            } else if law.changes_command() {
                value = law.command(p, &point, value);
            } else if let Law::Shape(variable) = *law {
                value -= shape(variable, p, self.study.range(tap, variable), point.of(variable));
            } else {
                let (level, z) = match law {
                    Law::Presliding => {
                        let at = Point { value, time: self.now.get(), ..point };
                        let speeds = [self.see(tap, at).velocity - own.v0, from_sign_change];
                        let z = preslide_along(self.z[states.start], speeds, p[0], at.time - self.time);
                        (self.level(tap, &point), z)
                    }
                    _ => (0.0, 0.0),
                };
                // What is added to a value is added to it whatever it drives.
                let sign = if *law == Law::Bias { 1.0 } else { own.sign };
                let s = match law {
                    // Where it is found first, friction of another kind says nothing of its sign change.
                    Law::Load if p.len() == 2 => (from_sign_change / p[1]).tanh(),
                    _ if law.changes_sign_with_velocity() => s(),
                    _ => 0.0,
                };
                let at = match law {
                    Law::Stribeck => Point { velocity: from_sign_change, ..point },
                    Law::Load => Point { value, ..point },
                    Law::Caught(from) => self.point(*from, slots),
                    _ => point,
                };
                value -= sign * law.force(p, &at, s, z, level);
            }
        }
        value
    }

    /// Keeps what a tap shows; gives what it showed at the sample.
    pub(super) fn see(&self, tap: usize, at: Point) -> Point {
        let [sample, last] = &self.within[tap];
        if at.time <= self.time {
            sample.set(at);
        }
        last.set(at);
        sample.get()
    }

    /// Moves the states of the laws on, from what the attachments showed since the sample.
    pub(super) fn advance(&mut self, step: f64) {
        let taps = self.study.taps.iter().zip(&self.laws).zip(&self.within);
        for ((tap, laws), [sample, last]) in taps {
            for (law, range, states) in laws {
                let z = &mut self.z[states.clone()];
                // The motion over the step, from what the stages of the integration have shown.
                let (sample, last) = (sample.get(), last.get());
                let part = if last.time > self.time { step / (last.time - self.time) } else { 0.0 };
                match *law {
                    Law::Presliding => {
                        let end = sample.toward(last, part);
                        let speeds = [sample, end].map(|own| own.velocity - tap.v0);
                        z[0] = preslide_along(z[0], speeds, self.p[range.start], step);
                    }
                    Law::Own(index) => {
                        let way = [sample, sample.toward(last, part)];
                        advance_along(&self.study.own[index], way, z, &self.p[range.clone()], step);
                    }
                    Law::Memory(kind) => {
                        let p = &self.p[range.clone()];
                        self.memories[states.start].advance((kind, p), z, self.time, step);
                    }
                    _ => {}
                }
            }
        }
        self.time += step;
        self.now.set(self.time);
    }
}
