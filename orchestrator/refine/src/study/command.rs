//! Effects on a measured command that have a memory: computed on the samples before the simulation. Before the first
//! sample the command counts as the first, at which everything has settled: a pump need not have stood still.

/// Kind of the change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// `u(t - delay)`, linear between samples.
    Delay,
    /// Play of half-width `width`.
    Hysteresis,
    /// Second order: `freq` \[Hz\], `zeta`.
    Mode,
    /// First order: `tau` \[s\].
    Lag,
    /// First order with a time constant for a rising and one for a falling value: `up`, `down` \[s\].
    Fill,
    /// Limited rate: `rate` \[1/s\] in units of the command.
    RateLimit,
}

impl Command {
    /// Number of parameters.
    pub fn parameters(self) -> usize {
        if matches!(self, Command::Mode | Command::Fill) { 2 } else { 1 }
    }

    /// Number of states on a signal inside of the system.
    pub fn states(self) -> usize {
        if self == Command::Mode { 2 } else { 1 }
    }

    /// Whether the changed command moves between its samples even if the one before is held.
    pub fn moves_between_samples(self) -> bool {
        matches!(self, Command::Lag | Command::Fill | Command::RateLimit | Command::Mode)
    }

    /// Place in the order in which they act, as the amended system has them.
    pub fn rank(self) -> usize {
        match self {
            Command::Delay => 0,
            Command::Hysteresis => 1,
            Command::Lag => 2,
            Command::Fill => 3,
            Command::RateLimit => 4,
            Command::Mode => 5,
        }
    }

    /// The changed command, `[n]` at `step` \[s\]; `held`: between samples it stays where it is, else it moves in a
    /// line.
    pub fn apply(self, p: &[f64], values: &[f64], step: f64, held: bool) -> Vec<f64> {
        match self {
            Command::Delay => delayed(values, p[0] / step),
            Command::Hysteresis => {
                let mut out = values.first().copied().unwrap_or(0.0);
                let width = p[0].abs();
                let play = |u: &f64| {
                    out = (u - width).max(f64::min(out, u + width));
                    out
                };
                values.iter().map(play).collect()
            }
            Command::Mode => mode(values, p[0], p[1], step, held),
            Command::Lag => lag(values, p[0], p[0], step, held),
            Command::Fill => lag(values, p[0], p[1], step, held),
            Command::RateLimit => {
                let (mut out, most) = (values.first().copied().unwrap_or(0.0), p[0].abs() * step);
                let limited = |u: &f64| {
                    let found = out;
                    out += (u - out).clamp(-most, most);
                    if held { found } else { out }
                };
                values.iter().map(limited).collect()
            }
        }
    }
}

/// Parts of a sample, or of a line within one, in which a value that moves between samples is followed.
pub const PARTS: usize = 8;

/// Values at the samples and at [`PARTS`] - 1 times before the next one each: the sample where they are `held`, else on
/// the line to the next.
pub fn in_parts(values: &[f64], held: bool) -> Vec<f64> {
    let part = |k: usize, i: usize| {
        let next = values.get(k + 1).copied().filter(|_| !held).unwrap_or(values[k]);
        values[k] + (next - values[k]) * i as f64 / PARTS as f64
    };
    (0..values.len()).flat_map(|k| (0..PARTS).map(move |i| part(k, i))).collect()
}

/// Mean from each sample to the next of values in parts, by Simpson's rule.
pub fn means(fine: &[f64]) -> impl Iterator<Item = f64> {
    let at = |k: usize| fine[k.min(fine.len() - 1)];
    let two = move |k: usize| at(k) + 4.0 * at(k + 1) + at(k + 2);
    let mean = move |first: usize| (0..PARTS).step_by(2).map(|i| two(first + i)).sum::<f64>();
    (0..fine.len()).step_by(PARTS).map(move |first| mean(first) / (3 * PARTS) as f64)
}

/// Values `samples` later, linear between samples, the first value before the first sample.
pub fn delayed(values: &[f64], samples: f64) -> Vec<f64> {
    let value = |k: isize| values[(k.max(0) as usize).min(values.len() - 1)];
    let one = |k: usize| {
        let at = k as f64 - samples.max(0.0);
        let floor = at.floor();
        let (below, fraction) = (floor as isize, at - floor);
        value(below) * (1.0 - fraction) + if fraction > 0.0 { value(below + 1) * fraction } else { 0.0 }
    };
    (0..values.len()).map(one).collect()
}

/// `y' = (u - y)/tau` with `tau` by the sign of `u - y`, settled at the first value; exact but for samples in which the
/// sign changes.
fn lag(values: &[f64], up: f64, down: f64, step: f64, held: bool) -> Vec<f64> {
    let (up, down) = (LagStep::new(up, step), LagStep::new(down, step));
    let mut y = values.first().copied().unwrap_or(0.0);
    let mut found = Vec::with_capacity(values.len());
    for (k, &u) in values.iter().enumerate() {
        found.push(y);
        let next = values.get(k + 1).copied().filter(|_| !held).unwrap_or(u);
        y = if rises(y, [u, next]) { up } else { down }.follow(y, [u, next]);
    }
    found
}

/// Whether a value follows upwards while its input goes in a line.
pub(super) fn rises(y: f64, [u, next]: [f64; 2]) -> bool {
    0.5 * (u + next) > y
}

/// A lag over steps of one length in which its input goes in a line: its value after one is linear in the value before
/// and in both ends of the line.
#[derive(Debug, Clone, Copy)]
pub(super) struct LagStep {
    /// Weight of the value before.
    decay: f64,
    /// Weight of the end of the line.
    end: f64,
}

impl LagStep {
    /// Time constant `tau` and `step` \[s\].
    pub(super) fn new(tau: f64, step: f64) -> LagStep {
        if step <= 0.0 {
            return LagStep { decay: 1.0, end: 0.0 };
        }
        let steps = tau.max(1e-9) / step;
        let taken = -(-1.0 / steps).exp_m1();
        // The particular solution of a line is the line, late by the time constant.
        LagStep { decay: 1.0 - taken, end: 1.0 - steps * taken }
    }

    /// The value after the step.
    pub(super) fn follow(self, y: f64, [from, to]: [f64; 2]) -> f64 {
        self.decay * y + (1.0 - self.decay - self.end) * from + self.end * to
    }
}

/// `y'' + 2 zeta w y' + w^2 y = w^2 u` with u held over each sample or linear between samples.
fn mode(values: &[f64], freq: f64, zeta: f64, step: f64, held: bool) -> Vec<f64> {
    let along = ModeStep::new([freq, zeta], step);
    let mut z = [values.first().copied().unwrap_or(0.0), 0.0];
    let mut found = Vec::with_capacity(values.len());
    for (k, &u) in values.iter().enumerate() {
        found.push(z[0]);
        let next = values.get(k + 1).copied().filter(|_| !held).unwrap_or(u);
        z = along.follow(z, [u, next]);
    }
    found
}

/// A mode over steps of one length in which its input goes in a line: value and rate after one are linear in those
/// before and in both ends of the line.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModeStep {
    /// Value and rate after a step, by value and rate before, beginning and end of the line.
    columns: [[f64; 2]; 4],
}

impl ModeStep {
    /// Frequency \[Hz\] and damping ratio, `step` \[s\].
    pub(super) fn new(p: [f64; 2], step: f64) -> ModeStep {
        let unit = |own: usize| {
            let at = |k: usize| f64::from(u8::from(k == own));
            mode_along([at(0), at(1)], [at(2), at(3)], p, step)
        };
        ModeStep { columns: std::array::from_fn(unit) }
    }

    /// Value and rate after the step.
    pub(super) fn follow(&self, z: [f64; 2], line: [f64; 2]) -> [f64; 2] {
        let [value, rate, from, to] = &self.columns;
        let row = |i: usize| value[i] * z[0] + rate[i] * z[1] + from[i] * line[0] + to[i] * line[1];
        [row(0), row(1)]
    }
}

/// Value and rate of a mode after `step` \[s\] in which its input goes from `u` to `next` in a line.
fn mode_along([mut y, mut v]: [f64; 2], [u, next]: [f64; 2], p: [f64; 2], step: f64) -> [f64; 2] {
    let (w, zeta) = (std::f64::consts::TAU * p[0].max(1e-6), p[1]);
    // Sub-steps of classical Runge-Kutta short against the mode.
    let count = (w * step / 0.2).ceil().clamp(1.0, 200.0) as usize;
    let h = step / count as f64;
    for part in 0..count {
        let input = |ahead: f64| u + (next - u) * (part as f64 + ahead) / count as f64;
        let rate = |at: f64, y: f64, v: f64| (v, w * w * (input(at) - y) - 2.0 * zeta * w * v);
        let (a1, b1) = rate(0.0, y, v);
        let (a2, b2) = rate(0.5, y + 0.5 * h * a1, v + 0.5 * h * b1);
        let (a3, b3) = rate(0.5, y + 0.5 * h * a2, v + 0.5 * h * b2);
        let (a4, b4) = rate(1.0, y + h * a3, v + h * b3);
        y += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
        v += h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4);
    }
    [y, v]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_of_one_and_a_half_samples_lies_between_two() {
        let delayed = Command::Delay.apply(&[0.015], &[1.0, 3.0, 5.0, 7.0], 0.01, true);
        for (value, expected) in delayed.iter().zip([1.0, 1.0, 2.0, 4.0]) {
            assert!((value - expected).abs() < 1e-12, "{delayed:?}");
        }
    }

    #[test]
    fn play_follows_behind_by_its_half_width() {
        assert_eq!(Command::Hysteresis.apply(&[1.0], &[0.0, 3.0, 2.0, 0.0], 1.0, true), [0.0, 2.0, 2.0, 1.0]);
        assert_eq!(Command::Hysteresis.apply(&[1.0], &[6.0, 6.5, 9.0], 1.0, true), [6.0, 6.0, 8.0]);
    }

    #[test]
    fn a_mode_answers_a_step_as_the_closed_form() {
        let (f, zeta): (f64, f64) = (5.0, 0.3);
        let step: Vec<f64> = (0..201).map(|k| if k == 0 { 0.0 } else { 1.0 }).collect();
        let values = &Command::Mode.apply(&[f, zeta], &step, 1e-3, true)[1..];
        let (w, t) = (std::f64::consts::TAU * f, 0.15);
        let wd = w * (1.0 - zeta * zeta).sqrt();
        let expected = 1.0 - (-zeta * w * t).exp() * ((wd * t).cos() + zeta * w / wd * (wd * t).sin());
        assert!((values[150] - expected).abs() < 1e-6, "{} {expected}", values[150]);
    }

    #[test]
    fn a_lag_follows_a_ramp_late_by_its_time_constant() {
        let ramp: Vec<f64> = (0..400).map(|k| 2.0 * f64::from(k) * 0.01).collect();
        let y = Command::Lag.apply(&[0.2], &ramp, 0.01, false);
        // y = 2 (t - tau + tau exp(-t/tau))
        for k in [1, 10, 60, 399] {
            let t = k as f64 * 0.01;
            assert!((y[k] - 2.0 * (t - 0.2 + 0.2 * (-t / 0.2).exp())).abs() < 1e-12, "{k}");
        }
        let step = [0.0, 1.0, 1.0, 1.0];
        let y = Command::Lag.apply(&[0.2], &step, 0.1, true);
        assert_eq!(y[..2], [0.0, 0.0]);
        assert!((y[3] - (1.0 - (-1.0f64).exp())).abs() < 1e-12);
    }

    #[test]
    fn a_lag_and_a_limited_rate_of_a_held_command_have_their_means_between_samples() {
        let (tau, step, rate) = (0.05, 0.02, 30.0);
        let values = [0.0, 1.0, 1.0, -0.5];
        let followed = |kind: Command, p: f64| -> (Vec<f64>, Vec<f64>) {
            let fine = kind.apply(&[p], &in_parts(&values, true), step / PARTS as f64, true);
            (fine.iter().step_by(PARTS).copied().collect(), means(&fine).collect())
        };
        let (samples, means) = followed(Command::Lag, tau);
        for k in [1, 2] {
            let u = values[k];
            let expected = u + (samples[k] - u) * tau / step * (1.0 - (-step / tau).exp());
            assert!((means[k] - expected).abs() < 1e-7, "{means:?} {expected}");
        }
        // Up to 0.6 in the first sample, to 1 after two thirds of the second.
        let (_, means) = followed(Command::RateLimit, rate);
        assert!(
            (means[1] - 0.3).abs() < 1e-12 && (means[2] - (1.0 - 0.2 * 2.0 / 3.0)).abs() < 1e-3,
            "{means:?}"
        );
        assert_eq!(in_parts(&[1.0, 3.0], false)[..=PARTS][4..], [2.0, 2.25, 2.5, 2.75, 3.0]);
    }

    #[test]
    fn filling_and_emptying_take_their_own_time_and_a_rate_has_a_limit() {
        let mut u = vec![1.0; 100];
        u[0] = 0.0;
        u.extend(vec![0.0; 100]);
        let y = Command::Fill.apply(&[0.1, 0.4], &u, 0.01, true);
        assert!((y[51] - (1.0 - (-5.0f64).exp())).abs() < 1e-9);
        assert!((y[150] / y[100] - (-0.5 / 0.4f64).exp()).abs() < 1e-9);
        let y = Command::RateLimit.apply(&[3.0], &u, 0.01, true);
        assert!((y[11] - 0.3).abs() < 1e-12 && y[99] == 1.0);
    }
}
