//! Effects on a measured command that have a memory: computed on the samples before the simulation. Before the first sample
//! the command counts as the first, at which everything has settled: a pump need not have stood still.

/// Kind of the change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// `u(t - delay)`, linear between samples.
    Delay,
    /// Play of half-width `width`.
    Hysteresis,
    /// Second order: `freq` \[Hz\], `zeta`.
    Mode,
}

impl Command {
    /// Number of parameters.
    pub fn parameters(self) -> usize {
        if self == Command::Mode { 2 } else { 1 }
    }

    /// The changed command, `[n]` at `step` \[s\].
    pub fn apply(self, p: &[f64], values: &[f64], step: f64) -> Vec<f64> {
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
            Command::Mode => mode(values, p[0], p[1], step),
        }
    }
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

/// `y'' + 2 zeta w y' + w^2 y = w^2 u` with u held over each sample, exact.
fn mode(values: &[f64], freq: f64, zeta: f64, step: f64) -> Vec<f64> {
    let w = std::f64::consts::TAU * freq.max(1e-6);
    // Sub-steps of classical Runge-Kutta short against the mode.
    let count = (w * step / 0.2).ceil().clamp(1.0, 200.0) as usize;
    let h = step / count as f64;
    let (mut y, mut v) = (values.first().copied().unwrap_or(0.0), 0.0);
    let mut found = Vec::with_capacity(values.len());
    for &u in values {
        found.push(y);
        for _ in 0..count {
            let rate = |y: f64, v: f64| (v, w * w * (u - y) - 2.0 * zeta * w * v);
            let (a1, b1) = rate(y, v);
            let (a2, b2) = rate(y + 0.5 * h * a1, v + 0.5 * h * b1);
            let (a3, b3) = rate(y + 0.5 * h * a2, v + 0.5 * h * b2);
            let (a4, b4) = rate(y + h * a3, v + h * b3);
            y += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
            v += h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_of_one_and_a_half_samples_lies_between_two() {
        let delayed = Command::Delay.apply(&[0.015], &[1.0, 3.0, 5.0, 7.0], 0.01);
        for (value, expected) in delayed.iter().zip([1.0, 1.0, 2.0, 4.0]) {
            assert!((value - expected).abs() < 1e-12, "{delayed:?}");
        }
    }

    #[test]
    fn play_follows_behind_by_its_half_width() {
        assert_eq!(Command::Hysteresis.apply(&[1.0], &[0.0, 3.0, 2.0, 0.0], 1.0), [0.0, 2.0, 2.0, 1.0]);
        assert_eq!(Command::Hysteresis.apply(&[1.0], &[6.0, 6.5, 9.0], 1.0), [6.0, 6.0, 8.0]);
    }

    #[test]
    fn a_mode_answers_a_step_as_the_closed_form() {
        let (f, zeta): (f64, f64) = (5.0, 0.3);
        let step: Vec<f64> = (0..201).map(|k| if k == 0 { 0.0 } else { 1.0 }).collect();
        let values = &Command::Mode.apply(&[f, zeta], &step, 1e-3)[1..];
        let (w, t) = (std::f64::consts::TAU * f, 0.15);
        let wd = w * (1.0 - zeta * zeta).sqrt();
        let expected = 1.0 - (-zeta * w * t).exp() * ((wd * t).cos() + zeta * w / wd * (wd * t).sin());
        assert!((values[150] - expected).abs() < 1e-6, "{} {expected}", values[150]);
    }
}
