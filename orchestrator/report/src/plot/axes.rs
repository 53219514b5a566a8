//! Axes: readable ticks, and data to pixels.

/// Values from `min` to `max` on a stretch of pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Value at the beginning.
    pub min: f64,
    /// Value at the end.
    pub max: f64,
    /// Pixel at the beginning.
    pub from: f64,
    /// Pixel at the end.
    pub to: f64,
}

impl Axis {
    /// An axis for values from `min` to `max`; a range without extent is widened around its value.
    pub fn new((min, max): (f64, f64), (from, to): (f64, f64)) -> Axis {
        let (min, max) = if min.is_finite() && max.is_finite() { (min, max) } else { (0.0, 1.0) };
        let smallest = f64::max(min.abs(), max.abs()) * 1e-9;
        if max - min > smallest {
            return Axis { min, max, from, to };
        }
        let half = if min == 0.0 { 1.0 } else { 0.5 * min.abs() };
        Axis { min: min - half, max: max + half, from, to }
    }

    /// The same axis with `share` of its range added at both ends.
    pub fn padded(self, share: f64) -> Axis {
        let pad = share * (self.max - self.min);
        Axis { min: self.min - pad, max: self.max + pad, ..self }
    }

    /// Pixel of a value.
    pub fn pixel(&self, value: f64) -> f64 {
        self.from + (value - self.min) / (self.max - self.min) * (self.to - self.from)
    }

    /// Ticks of an axis that holds decimal logarithms: at powers of ten, at 2 and 5 times them too where the axis spans
    /// less than two decades; at every second or third power if there were more than about `count`.
    pub fn log_ticks(&self, count: usize) -> Vec<(f64, String)> {
        let (first, last) = (self.min.floor() as i32, self.max.ceil() as i32);
        let every = ((self.max - self.min) / count.max(1) as f64).ceil().max(1.0) as i32;
        let between: &[f64] = if self.max - self.min < 2.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        (first..=last)
            .filter(|power| power % every == 0)
            .flat_map(|power| between.iter().map(move |factor| (power, factor)))
            .map(|(power, factor)| (f64::from(power) + factor.log10(), (power, factor)))
            .filter(|(value, _)| (self.min - 1e-9..=self.max + 1e-9).contains(value))
            .map(|(value, (power, factor))| {
                let text = if (-4..6).contains(&power) {
                    let decimals = usize::try_from(-power).unwrap_or(0);
                    format!("{:.decimals$}", factor * 10f64.powi(power))
                } else {
                    format!("{factor}e{power}").replace('-', "\u{2212}")
                };
                (value, text)
            })
            .collect()
    }

    /// Ticks at round values (1, 2 or 5 times a power of ten), about `count` of them, with their labels.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        let raw = (self.max - self.min) / count.max(1) as f64;
        let power = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= raw * 0.999);
        let step = step.unwrap_or(10.0 * power);
        let first = (self.min / step - 1e-9).ceil() as i64;
        let last = (self.max / step + 1e-9).floor() as i64;
        let largest = f64::max(self.min.abs(), self.max.abs());
        (first..=last)
            .map(|k| {
                let value = k as f64 * step;
                (value, label(value, step, largest))
            })
            .collect()
    }
}

/// A tick label with as many decimals as the step needs; very large and small axes in powers of ten.
fn label(value: f64, step: f64, largest: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let text = if (1e-4..1e6).contains(&largest) {
        let decimals = (-(step * 1.001).log10().floor()).max(0.0) as usize;
        format!("{value:.decimals$}")
    } else {
        let exponent = largest.log10().floor() as i32;
        let decimals = (f64::from(exponent) - (step * 1.001).log10().floor()).max(0.0) as usize;
        format!("{:.decimals$}e{exponent}", value / 10f64.powi(exponent))
    };
    text.replace('-', "\u{2212}")
}

/// Smallest and largest finite value.
pub fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| (min.min(value), max.max(value)))
}

/// A curve in pixels: no more than four points per pixel column (first, lowest, highest, last), so that peaks stay.
pub fn curve(time: &[f64], values: &[f64], x: &Axis, y: &Axis, held: bool) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut column: Vec<(f64, f64)> = Vec::new();
    let mut flush = |column: &mut Vec<(f64, f64)>| {
        if column.len() <= 4 {
            points.append(column);
            return;
        }
        let lowest = (0..column.len()).max_by(|&a, &b| column[a].1.total_cmp(&column[b].1));
        let highest = (0..column.len()).min_by(|&a, &b| column[a].1.total_cmp(&column[b].1));
        let mut keep = vec![0, column.len() - 1];
        keep.extend(lowest.into_iter().chain(highest));
        keep.sort_unstable();
        keep.dedup();
        points.extend(keep.into_iter().map(|index| column[index]));
        column.clear();
    };
    let mut before: Option<f64> = None;
    for (&t, &value) in time.iter().zip(values) {
        let point = (x.pixel(t), y.pixel(value));
        if column.last().is_some_and(|last| last.0.floor() != point.0.floor()) {
            flush(&mut column);
        }
        if let Some(level) = before.filter(|level| held && *level != point.1) {
            column.push((point.0, level));
        }
        column.push(point);
        before = Some(point.1);
    }
    flush(&mut column);
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::new((-0.13, 0.42), (0.0, 100.0));
        let labels: Vec<String> = axis.ticks(5).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["0", "0.2", "0.4"].map(String::from));
        let labels: Vec<String> =
            Axis::new((0.0, 3.999), (0.0, 1.0)).ticks(8).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0", "3.5"].map(String::from));
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        let labels = |min: f64, max: f64| -> Vec<String> {
            Axis::new((min, max), (0.0, 1.0)).log_ticks(8).into_iter().map(|(_, label)| label).collect()
        };
        assert_eq!(labels(-1.3, 2.7), ["0.1", "1", "10", "100"]);
        assert_eq!(labels(0.0, 1.0), ["1", "2", "5", "10"]);
        assert_eq!(
            labels(-18.0, 0.0),
            ["1e\u{2212}18", "1e\u{2212}15", "1e\u{2212}12", "1e\u{2212}9", "1e\u{2212}6", "0.001", "1"]
        );
    }

    #[test]
    fn a_constant_signal_has_an_axis_with_extent() {
        for value in [0.0, 1e-12, -3.0, 5e8] {
            let axis = Axis::new((value, value), (0.0, 1.0));
            assert!(axis.min < value && value < axis.max, "{axis:?}");
            assert!(!axis.ticks(5).is_empty());
        }
        assert!(Axis::new(range([]), (0.0, 1.0)).max > 0.0);
    }

    #[test]
    fn thinning_keeps_the_peak() {
        let n = 100_000;
        let time: Vec<f64> = (0..n).map(|k| k as f64).collect();
        let mut values = vec![0.0; n];
        values[54_321] = 1.0;
        let x = Axis::new((0.0, n as f64), (0.0, 500.0));
        let y = Axis::new((0.0, 1.0), (100.0, 0.0));
        let points = curve(&time, &values, &x, &y, false);
        assert!(points.len() < 2_100, "{}", points.len());
        assert!(points.iter().any(|point| point.1 == 0.0), "the peak is gone");
    }
}
