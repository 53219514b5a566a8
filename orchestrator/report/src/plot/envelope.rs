//! Long signals for the screen: lowest and highest value of every stretch of samples, in memory that does not grow.

/// Stretches of a long signal; more than a screen has pixels.
const STRETCHES: usize = 3000;

/// Several signals on one time axis, each thinned to what a figure can show.
#[derive(Debug, Clone)]
pub struct Envelope {
    /// Samples of a stretch.
    width: usize,
    samples: usize,
    now: Vec<Stretch>,
    /// Times and values, shape \[signals\]\[points\].
    curves: Vec<(Vec<f64>, Vec<f64>)>,
}

#[derive(Debug, Clone, Copy)]
struct Stretch {
    low: (f64, f64),
    high: (f64, f64),
}

const EMPTY: Stretch = Stretch { low: (0.0, f64::INFINITY), high: (0.0, f64::NEG_INFINITY) };

impl Envelope {
    /// For `signals` signals with `samples` samples each.
    pub fn new(signals: usize, samples: usize) -> Envelope {
        let width = if samples <= 2 * STRETCHES { 1 } else { samples.div_ceil(STRETCHES) };
        Envelope { width, samples: 0, now: vec![EMPTY; signals], curves: vec![Default::default(); signals] }
    }

    /// Adds a sample: a value for every signal.
    pub fn push(&mut self, time: f64, values: impl IntoIterator<Item = f64>) {
        self.samples += 1;
        let full = self.samples.is_multiple_of(self.width);
        for ((value, now), curve) in values.into_iter().zip(&mut self.now).zip(&mut self.curves) {
            if value < now.low.1 {
                now.low = (time, value);
            }
            if value > now.high.1 {
                now.high = (time, value);
            }
            if full {
                std::mem::replace(now, EMPTY).draw(curve);
            }
        }
    }

    /// Times and values of each signal.
    pub fn finish(mut self) -> Vec<(Vec<f64>, Vec<f64>)> {
        self.now.iter().zip(&mut self.curves).for_each(|(now, curve)| now.draw(curve));
        self.curves
    }
}

impl Stretch {
    fn draw(self, (times, values): &mut (Vec<f64>, Vec<f64>)) {
        let mut points = [self.low, self.high];
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (time, value) in points {
            if value.is_finite() && times.last().is_none_or(|last| *last < time) {
                times.push(time);
                values.push(value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_signals_stay_as_they_are_and_long_ones_keep_their_peaks() {
        let mut short = Envelope::new(2, 5);
        (0..5).for_each(|k| short.push(f64::from(k), [f64::from(k), -f64::from(k)]));
        let curves = short.finish();
        assert_eq!(curves[1].1, [0.0, -1.0, -2.0, -3.0, -4.0]);
        let n = 1_000_003;
        let mut long = Envelope::new(1, n);
        (0..n).for_each(|k| long.push(k as f64, [if k == 777_777 { 5.0 } else { (k % 2) as f64 }]));
        let (times, values) = long.finish().remove(0);
        assert!(times.len() <= 2 * STRETCHES && times.windows(2).all(|pair| pair[0] < pair[1]));
        let peak = values.iter().position(|value| *value == 5.0).unwrap();
        assert_eq!(times[peak], 777_777.0);
    }
}
