//! Effects with a memory on a signal inside of the system, which no record shows: they follow what the simulation
//! passes on. At the beginning of a span they have settled at the first value.

use std::cell::{Cell, RefCell};

use super::command::{Command, LagStep, ModeStep, PARTS, rises};

/// Share of a step by which times may differ that are the same.
const MAX_ROUNDING: f64 = 1e-6;

/// History of one effect beside its states.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// Time \[s\] and value that came in, from the sample on.
    entered: RefCell<Vec<(f64, f64)>>,
    /// Values that came in of which the effect has followed all to the end, and its states there.
    followed: Cell<Option<(usize, [f64; 2])>>,
    /// A line of the length that was followed last.
    line: Cell<Option<Line>>,
    /// Time \[s\] and value at the samples before: of a delay.
    past: RefCell<Vec<(f64, f64)>>,
}

/// An effect over lines of one length.
#[derive(Debug, Clone, Copy)]
struct Line {
    step: f64,
    map: Map,
}

/// Its states behind the line by those before it and both ends.
#[derive(Debug, Clone, Copy)]
enum Map {
    Lag(LagStep),
    /// Upwards and downwards over the line, and over each of [`PARTS`] of it.
    Fill([LagStep; 2], [LagStep; 2]),
    Mode(ModeStep),
    /// Largest change.
    RateLimit(f64),
    /// Width.
    Hysteresis(f64),
}

impl Memory {
    /// Forgets all that came in.
    pub(super) fn clear(&self) {
        self.entered.borrow_mut().clear();
        self.followed.set(None);
        self.past.borrow_mut().clear();
    }

    /// The value that leaves for `value` that enters at `now`; `sample`: time of the sample, `z`: states there.
    pub(super) fn pass(
        &self,
        (kind, p): (Command, &[f64]),
        z: &[f64],
        (sample, now): (f64, f64),
        value: f64,
    ) -> f64 {
        let (first, known) = {
            let mut entered = self.entered.borrow_mut();
            // What came in at this time or later was of a stage or a step that is tried again.
            while entered.last().is_some_and(|own| own.0 >= now || now <= sample) {
                entered.pop();
            }
            let known = entered.len();
            entered.push((now, value));
            self.followed.set(self.followed.get().filter(|(end, _)| *end < known));
            (entered[0].1, known)
        };
        if kind == Command::Delay {
            return self.before(now - p[0].max(0.0), [(sample, first), (now, value)]);
        }
        self.followed((kind, p), z, sample, (known, (now, value)))[0]
    }

    /// States after `step` \[s\] from the sample, by what came in since.
    pub(super) fn advance(&self, (kind, p): (Command, &[f64]), z: &mut [f64], sample: f64, step: f64) {
        let ends = |entered: &Vec<(f64, f64)>| Some((entered.first()?.1, *entered.last()?));
        let Some((from, last)) = ends(&self.entered.borrow()) else { return };
        if kind == Command::Delay {
            self.past.borrow_mut().push((sample, from));
            return;
        }
        let end = if (last.0 - sample - step).abs() < MAX_ROUNDING * step {
            last
        } else {
            let part = if last.0 > sample { step / (last.0 - sample) } else { 0.0 };
            (sample + step, from + part * (last.1 - from))
        };
        let known = self.entered.borrow().partition_point(|own| own.0 < end.0);
        let found = self.followed((kind, p), z, sample, (known, end));
        z.iter_mut().zip(found).for_each(|(z, found)| *z = found);
        // Where nothing comes in until the next sample, it stays.
        let mut entered = self.entered.borrow_mut();
        entered.clear();
        entered.push(end);
        self.followed.set(None);
    }

    /// States at the time of `end`, from the sample through the first `count` of what came in between: by lines, where
    /// three values in equal distance come in a line over each half that have the mean of the parabola.
    fn followed(
        &self,
        law: (Command, &[f64]),
        z: &[f64],
        sample: f64,
        (count, end): (usize, (f64, f64)),
    ) -> [f64; 2] {
        let entered = self.entered.borrow();
        let at = |k: usize| if k < count { entered[k] } else { end };
        let begin = [z[0], z.get(1).copied().unwrap_or(0.0)];
        if count == 0 {
            return self.follow(law, begin, [end.1; 2], end.0 - sample);
        }
        let (mut k, mut found) = self.followed.get().unwrap_or((0, begin));
        while k < count {
            let (a, m, b) = (at(k), at(k + 1), at(k + 2));
            let halves = k + 2 <= count && (a.0 + b.0 - 2.0 * m.0).abs() < MAX_ROUNDING * (b.0 - a.0);
            let lasts = k + 2 < count;
            if halves && is_smooth(law.0) {
                let middle = (4.0 * m.1 - 0.5 * (a.1 + b.1)) / 3.0;
                found = self.follow(law, found, [a.1, middle], m.0 - a.0);
                found = self.follow(law, found, [middle, b.1], b.0 - m.0);
                k += 2;
            } else {
                found = self.follow(law, found, [a.1, m.1], m.0 - a.0);
                k += 1;
            }
            if lasts {
                self.followed.set(Some((k, found)));
            }
        }
        found
    }

    /// States after `step` \[s\] in which the value goes in a line; the first is what leaves. States that are no
    /// numbers have settled at the beginning of the line.
    fn follow(&self, law: (Command, &[f64]), z: [f64; 2], ends: [f64; 2], step: f64) -> [f64; 2] {
        let same = |own: &Line| (own.step - step).abs() <= MAX_ROUNDING * step;
        let line = self.line.get().filter(same).unwrap_or_else(|| {
            let line = Line { step, map: Map::new(law, step) };
            self.line.set(Some(line));
            line
        });
        line.map.follow(if z[0].is_nan() { [ends[0], 0.0] } else { z }, ends)
    }

    /// The value at an earlier time, in lines between samples, the first one before all.
    fn before(&self, time: f64, [sample, now]: [(f64, f64); 2]) -> f64 {
        let past = self.past.borrow();
        let line = |a: (f64, f64), b: (f64, f64)| {
            let part = if b.0 > a.0 { (time - a.0) / (b.0 - a.0) } else { 1.0 };
            a.1 + part.clamp(0.0, 1.0) * (b.1 - a.1)
        };
        if time >= sample.0 {
            return line(sample, now);
        }
        let later = past.partition_point(|own| own.0 <= time);
        match later.checked_sub(1) {
            None => past.first().map_or(sample.1, |own| own.1),
            Some(k) => line(past[k], past.get(later).copied().unwrap_or(sample)),
        }
    }
}

/// Whether an effect answers a parabola as it answers lines with the same mean, nearly.
fn is_smooth(kind: Command) -> bool {
    matches!(kind, Command::Lag | Command::Fill | Command::Mode)
}

impl Map {
    fn new((kind, p): (Command, &[f64]), step: f64) -> Map {
        match kind {
            Command::Lag => Map::Lag(LagStep::new(p[0], step)),
            Command::Fill => {
                let over = |step: f64| [p[0], p[1]].map(|tau| LagStep::new(tau, step));
                Map::Fill(over(step), over(step / PARTS as f64))
            }
            Command::Mode => Map::Mode(ModeStep::new([p[0], p[1]], step)),
            Command::RateLimit => Map::RateLimit(p[0].abs() * step),
            // Delays are read from the past.
            Command::Hysteresis | Command::Delay => Map::Hysteresis(p[0].abs()),
        }
    }

    fn follow(&self, z: [f64; 2], [from, to]: [f64; 2]) -> [f64; 2] {
        let y = z[0];
        match *self {
            Map::Lag(lag) => [lag.follow(y, [from, to]), 0.0],
            Map::Mode(mode) => mode.follow(z, [from, to]),
            Map::Hysteresis(width) => [(to - width).max(y.min(to + width)), 0.0],
            Map::Fill(whole, parts) => {
                let of = |[up, down]: [LagStep; 2], y: f64, line: [f64; 2]| {
                    if rises(y, line) { up } else { down }.follow(y, line)
                };
                let end = of(whole, y, [from, to]);
                let end = if turns([from - y, to - end]) {
                    follow_in_parts(y, [from, to], |y, line| of(parts, y, line))
                } else {
                    end
                };
                [end, 0.0]
            }
            Map::RateLimit(most) => {
                let of = |most: f64, y: f64, to: f64| y + (to - y).clamp(-most, most);
                let end = of(most, y, to);
                // With the largest change all the way, or with none of it in the way: exact.
                let end = if turns([from - y, to - end]) || end == to && from != y {
                    follow_in_parts(y, [from, to], |y, line| of(most / PARTS as f64, y, line[1]))
                } else {
                    end
                };
                [end, 0.0]
            }
        }
    }
}

/// Whether the value that comes in crosses the state over a line, by its distances at both ends.
fn turns([begin, end]: [f64; 2]) -> bool {
    begin * end < 0.0
}

/// A state after a line, followed in [`PARTS`] of it.
fn follow_in_parts(y: f64, [from, to]: [f64; 2], follow: impl Fn(f64, [f64; 2]) -> f64) -> f64 {
    let at = |k: usize| from + (to - from) * k as f64 / PARTS as f64;
    (0..PARTS).fold(y, |y, k| follow(y, [at(k), at(k + 1)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Output at every sample, and half a sample later.
    fn passed(kind: Command, p: &[f64], values: &[f64], step: f64) -> Vec<[f64; 2]> {
        let (memory, mut z) = (Memory::default(), vec![f64::NAN; kind.states()]);
        let mut found = Vec::new();
        for (k, value) in values.iter().enumerate() {
            let (time, next) = (k as f64 * step, values.get(k + 1).unwrap_or(value));
            let at = |part: f64| {
                let now = (time, time + part * step);
                memory.pass((kind, p), &z, now, value + part * (next - value))
            };
            found.push([at(0.0), at(0.5)]);
            at(1.0);
            memory.advance((kind, p), &mut z, time, step);
        }
        found
    }

    #[test]
    fn a_signal_that_moves_in_lines_is_passed_on_as_a_command_is() {
        const FINE: usize = 64;
        let step = 0.01;
        let values: Vec<f64> =
            (0..300).map(|k| 1.0 + (0.05 * f64::from(k)).sin() + 0.3 * (0.21 * f64::from(k)).cos()).collect();
        // The same lines in steps so short that it does not matter where in one of them a value is crossed.
        let line = |pair: &[f64]| {
            let (from, to) = (pair[0], pair[1]);
            (0..FINE).map(move |part| from + (to - from) * part as f64 / FINE as f64)
        };
        let fine: Vec<f64> = values.windows(2).flat_map(line).collect();
        for (kind, p, most) in [
            (Command::Delay, vec![0.034], 1e-9),
            (Command::Hysteresis, vec![0.2], 1e-9),
            (Command::Lag, vec![0.05], 1e-9),
            (Command::Fill, vec![0.02, 0.09], 1e-5),
            // A sixteenth of a step at the largest rate, 3.0 each way.
            (Command::RateLimit, vec![3.0], 2.0 * 3.0 * 0.01 / 16.0),
            (Command::Mode, vec![4.0, 0.3], 1e-4),
        ] {
            let expected = kind.apply(&p, &fine, step / FINE as f64, false);
            let expected = expected.iter().step_by(FINE);
            for (k, (own, expected)) in passed(kind, &p, &values, step).iter().zip(expected).enumerate() {
                assert!((own[0] - expected).abs() < most, "{kind:?} {k}: {} {expected}", own[0]);
            }
        }
    }

    #[test]
    fn between_samples_a_delay_shorter_than_a_step_and_a_lag_have_their_closed_forms() {
        let ramp: Vec<f64> = (0..50).map(|k| 2.0 * f64::from(k) * 0.1).collect();
        let late = passed(Command::Delay, &[0.03], &ramp, 0.1);
        assert!((late[10][1] - 2.0 * (1.05 - 0.03)).abs() < 1e-12, "{:?}", late[10]);
        let lag = passed(Command::Lag, &[0.2], &ramp, 0.1);
        let at = |t: f64| 2.0 * (t - 0.2 + 0.2 * (-t / 0.2).exp());
        assert!((lag[7][0] - at(0.7)).abs() < 1e-12 && (lag[7][1] - at(0.75)).abs() < 1e-12);
    }

    #[test]
    fn what_comes_in_once_stays_until_something_else_does() {
        // A component that changes at events only is not asked for in between.
        let (memory, mut z, law) = (Memory::default(), vec![0.0], (Command::Lag, &[0.2][..]));
        memory.pass(law, &z, (0.0, 0.0), 1.0);
        for k in 0..4 {
            memory.advance(law, &mut z, 0.1 * f64::from(k), 0.1);
        }
        assert!((z[0] - (1.0 - (-2.0f64).exp())).abs() < 1e-12, "{z:?}");
    }

    #[test]
    fn whatever_was_followed_before_a_stage_of_the_integration_is_asked_for_again_is_forgotten() {
        let (law, z) = ((Command::Mode, &[4.0, 0.3][..]), [0.0, 0.0]);
        let passed = |again: bool| {
            let memory = Memory::default();
            let ask = |part: i32| memory.pass(law, &z, (0.0, 0.01 * f64::from(part)), f64::from(part * part));
            let first: Vec<f64> = (0..9).map(ask).collect();
            if again {
                let second: Vec<f64> = [3, 4, 2, 3, 4, 4, 5, 6, 7, 8].into_iter().map(ask).collect();
                assert_eq!(first[8], second[9]);
            }
            ask(9)
        };
        assert!((passed(true) - passed(false)).abs() < 1e-12);
    }
}
