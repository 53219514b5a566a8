//! Quality of the values of one column before any model: missing, constant, saturated, held over several rows.

/// Share of samples at a limit from which a signal counts as saturated.
const SATURATED_SHARE: f64 = 0.01;
/// Rows that a held signal must show to be called slower than the others.
const HELD_CHANGES: usize = 10;

/// Takes the values of a column one by one.
#[derive(Debug, Clone, Default)]
pub struct Channel {
    /// Samples, missing ones included.
    pub samples: usize,
    /// Samples that are missing.
    pub missing: usize,
    /// Line of the first missing one.
    pub first_missing: usize,
    /// Smallest value.
    pub min: Limit,
    /// Largest value.
    pub max: Limit,
    /// First value, the reference of the sums.
    first: f64,
    /// Sums of `x - first`, `k (x - first)` and `(x - first)^2`.
    sums: [f64; 3],
    previous: f64,
    repeats: usize,
    /// Line of the first row that repeats the one before.
    first_repeat: usize,
    /// Greatest common divisor of the distances between changes, and their number.
    change: Period,
    /// The same for the distances between values that are there.
    present: Period,
}

/// Smallest or largest value, and how often it stands there.
#[derive(Debug, Clone, Copy, Default)]
pub struct Limit {
    /// Value.
    pub value: f64,
    /// Samples at this value.
    pub count: usize,
    /// Samples at this value right after another one.
    repeats: usize,
}

impl Limit {
    fn push(&mut self, value: f64, beyond: bool, repeats: bool) {
        if beyond {
            *self = Limit { value, count: 1, repeats: 0 };
        } else if value == self.value {
            self.count += 1;
            self.repeats += usize::from(repeats);
        }
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Period {
    last: Option<usize>,
    divisor: usize,
    count: usize,
}

impl Period {
    fn push(&mut self, at: usize) {
        if let Some(last) = self.last.replace(at)
            && self.divisor != 1
        {
            let (mut a, mut b) = (at - last, self.divisor);
            while b > 0 {
                (a, b) = (b, a % b);
            }
            self.divisor = a;
        }
        self.count += 1;
    }

    /// The period, if there are enough events, and few are left out.
    fn regular(&self, samples: usize) -> usize {
        let divisor = self.divisor.max(1);
        let regular = self.count >= HELD_CHANGES && 2 * self.count * divisor >= samples;
        if regular { divisor } else { 1 }
    }
}

impl Channel {
    /// Adds the value of a row; NaN is a missing one.
    pub fn push(&mut self, value: f64, line: usize) {
        let k = self.samples;
        self.samples += 1;
        if value.is_nan() {
            if self.missing == 0 {
                self.first_missing = line;
            }
            self.missing += 1;
            return;
        }
        let known = k - self.missing.min(k);
        if known == 0 {
            self.first = value;
        }
        let repeats = known > 0 && value == self.previous;
        if repeats {
            if self.repeats == 0 {
                self.first_repeat = line;
            }
            self.repeats += 1;
        } else if known > 0 {
            self.change.push(k);
        }
        if self.missing > 0 {
            self.present.push(k);
        }
        self.min.push(value, known == 0 || value < self.min.value, repeats);
        self.max.push(value, known == 0 || value > self.max.value, repeats);
        self.previous = value;
        let deviation = value - self.first;
        self.sums[0] += deviation;
        self.sums[1] += k as f64 * deviation;
        self.sums[2] += deviation * deviation;
    }

    /// Whether there is no number at all.
    pub fn is_empty(&self) -> bool {
        self.missing == self.samples
    }

    /// Whether all values are the same.
    pub fn is_constant(&self) -> bool {
        self.min.value == self.max.value
    }

    /// Mean value, in the unit of the column; NaN is left out.
    pub fn mean(&self) -> f64 {
        self.first + self.sums[0] / self.samples as f64
    }

    /// Mean square about the mean, in the squared unit of the column.
    pub fn variance(&self) -> f64 {
        let n = self.samples as f64;
        ((self.sums[2] - self.sums[0] * self.sums[0] / n) / n).max(0.0)
    }

    /// Slope, in the unit of the column per sample, of the straight line through the values (least squares).
    pub fn slope(&self) -> f64 {
        let n = self.samples as f64;
        let middle = 0.5 * (n - 1.0);
        (self.sums[1] - middle * self.sums[0]) / (n * (n * n - 1.0) / 12.0).max(f64::MIN_POSITIVE)
    }

    /// Rows between new values: 1 unless values come at every m-th row only, and the line that shows it.
    pub fn held_over(&self) -> (usize, usize) {
        if self.missing > 0 {
            return (self.present.regular(self.samples), self.first_missing);
        }
        (self.change.regular(self.samples), self.first_repeat)
    }

    /// The limit where the signal stands still, and the share of samples there, if it looks cut off there.
    ///
    /// A command in steps stands still everywhere and is left out.
    pub fn saturated(&self) -> Option<(f64, f64)> {
        let n = self.samples as f64;
        let at_limits = self.min.count + self.max.count;
        let elsewhere = self.samples.saturating_sub(at_limits);
        let repeats_elsewhere = self.repeats.saturating_sub(self.min.repeats + self.max.repeats);
        if self.is_constant() || 5 * elsewhere < self.samples || 10 * repeats_elsewhere > elsewhere {
            return None;
        }
        [self.min, self.max]
            .into_iter()
            .filter(|limit| limit.count as f64 > SATURATED_SHARE * n && 2 * limit.repeats > limit.count)
            .max_by_key(|limit| limit.count)
            .map(|limit| (limit.value, limit.count as f64 / n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(values: impl IntoIterator<Item = f64>) -> Channel {
        let mut channel = Channel::default();
        values.into_iter().enumerate().for_each(|(k, value)| channel.push(value, k + 2));
        channel
    }

    #[test]
    fn mean_and_slope_of_a_line_are_exact() {
        let line = channel((0..1001).map(|k| 1e6 + 0.5 * f64::from(k)));
        assert_eq!((line.mean(), line.slope()), (1e6 + 250.0, 0.5));
        // (n^2 - 1) / 12 of the squared step.
        assert!((line.variance() - 0.25 * (1001.0 * 1001.0 - 1.0) / 12.0).abs() < 1e-9);
    }

    #[test]
    fn a_cut_chirp_is_saturated_and_commands_in_steps_are_not() {
        let sine = |k: i32| (0.05 * f64::from(k)).sin();
        let (value, share) = channel((0..2000).map(|k| sine(k).min(0.8))).saturated().unwrap();
        assert!(value == 0.8 && (share - 0.2048).abs() < 0.01, "{share}");
        assert_eq!(channel((0..2000).map(sine)).saturated(), None);
        assert_eq!(channel((0..2000).map(|k| sine(k).signum())).saturated(), None);
        assert_eq!(channel((0..2000).map(|k| (sine(k) * 3.0).round())).saturated(), None);
    }

    #[test]
    fn a_signal_with_a_new_value_at_every_tenth_row_is_held() {
        let sine = |k: i32| (0.05 * f64::from(k)).sin();
        assert_eq!(channel((0..2000).map(|k| sine(k / 10 * 10))).held_over(), (10, 3));
        assert_eq!(
            channel((0..2000).map(|k| if k % 4 == 0 { sine(k) } else { f64::NAN })).held_over(),
            (4, 3)
        );
        assert_eq!(channel((0..2000).map(sine)).held_over().0, 1);
        assert_eq!(channel((0..2000).map(|k| (20.0 * sine(k)).round())).held_over().0, 1);
    }
}
