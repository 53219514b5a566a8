//! Effects with a memory on a signal inside of the system, which no record shows: they follow what the simulation
//! passes on. At the beginning of a span they have settled at the first value.

use std::cell::RefCell;

use super::command::{Command, lag_along, mode_along};

/// Parts of the line between two points in time.
const PARTS: usize = 8;
/// Share of a step by which times may differ that are the same.
const MAX_ROUNDING: f64 = 1e-6;

/// History of one effect beside its states.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// Time \[s\] and value that came in, from the sample on.
    entered: RefCell<Vec<(f64, f64)>>,
    /// Time \[s\] and value at the samples before: of a delay.
    past: RefCell<Vec<(f64, f64)>>,
}

impl Memory {
    /// Forgets all that came in.
    pub(super) fn clear(&self) {
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
        let first = {
            let mut entered = self.entered.borrow_mut();
            let known = entered.partition_point(|own| own.0 < now);
            entered.truncate(if now <= sample { 0 } else { known });
            entered.push((now, value));
            entered[0].1
        };
        if kind == Command::Delay {
            return self.before(now - p[0].max(0.0), [(sample, first), (now, value)]);
        }
        self.followed((kind, p), z, sample, (now, value))[0]
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
        let found = self.followed((kind, p), z, sample, end);
        z.iter_mut().zip(found).for_each(|(z, found)| *z = found);
    }

    /// States at the time of `end`, from the sample through what came in between: by lines, where three values in equal
    /// distance come in a line over each half that have the mean of the parabola.
    fn followed(&self, law: (Command, &[f64]), z: &[f64], sample: f64, end: (f64, f64)) -> [f64; 2] {
        let entered = self.entered.borrow();
        let count = entered.partition_point(|own| own.0 < end.0);
        let at = |k: usize| if k < count { entered[k] } else { end };
        let mut found = [z[0], z.get(1).copied().unwrap_or(0.0)];
        let mut k = 0;
        if count == 0 {
            return follow(law, &found, [end.1; 2], end.0 - sample);
        }
        while k < count {
            let (a, m, b) = (at(k), at(k + 1), at(k + 2));
            let halves = k + 2 <= count && (a.0 + b.0 - 2.0 * m.0).abs() < MAX_ROUNDING * (b.0 - a.0);
            if halves && is_smooth(law.0) {
                let middle = (4.0 * m.1 - 0.5 * (a.1 + b.1)) / 3.0;
                found = follow(law, &found, [a.1, middle], m.0 - a.0);
                found = follow(law, &found, [middle, b.1], b.0 - m.0);
                k += 2;
            } else {
                found = follow(law, &found, [a.1, m.1], m.0 - a.0);
                k += 1;
            }
        }
        found
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

/// States after `step` \[s\] in which the value goes in a line; the first is what leaves. States that are no numbers
/// have settled at the beginning of the line. What turns where the value crosses the state goes in parts of the line.
fn follow((kind, p): (Command, &[f64]), z: &[f64], [from, to]: [f64; 2], step: f64) -> [f64; 2] {
    let turns = matches!(kind, Command::Fill | Command::RateLimit);
    let parts = if turns { PARTS } else { 1 };
    let at = |k: usize| from + (to - from) * k as f64 / parts as f64;
    let mut found = [z[0], z.get(1).copied().unwrap_or(0.0)];
    for k in 0..parts {
        found = follow_line((kind, p), &found, [at(k), at(k + 1)], step / parts as f64);
    }
    found
}

fn follow_line((kind, p): (Command, &[f64]), z: &[f64], [from, to]: [f64; 2], step: f64) -> [f64; 2] {
    let rate = z.get(1).copied().unwrap_or(0.0);
    let start = if z[0].is_nan() { [from, 0.0] } else { [z[0], rate] };
    match kind {
        Command::Delay => start,
        Command::Hysteresis => [(to - p[0].abs()).max(start[0].min(to + p[0].abs())), 0.0],
        Command::Lag => [lag_along(start[0], [from, to], [p[0]; 2], step), 0.0],
        Command::Fill => [lag_along(start[0], [from, to], [p[0], p[1]], step), 0.0],
        Command::RateLimit => {
            let most = p[0].abs() * step;
            [start[0] + (to - start[0]).clamp(-most, most), 0.0]
        }
        Command::Mode => mode_along(start, [from, to], [p[0], p[1]], step),
    }
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
}
