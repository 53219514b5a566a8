//! Times at which steps have to end: samples of components, samples or kinks of the inputs, and the stop time.

/// Times closer than this (relative to the larger end of the run) are one.
const SAME_TIME: f64 = 1e-12;
/// A remainder below this fraction of a step is rounding.
const MIN_FRACTION_OF_STEP: f64 = 1e-6;

/// A step and its middle \[s\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pair {
    pub begin: f64,
    pub middle: f64,
    pub end: f64,
}

impl Pair {
    /// Length \[s\] of the longer half.
    pub fn half(&self) -> f64 {
        (self.middle - self.begin).max(self.end - self.middle)
    }
}

/// See the module.
#[derive(Debug)]
pub(super) struct Stops {
    /// Increasing; the stop time is the last.
    fixed: Vec<f64>,
    /// The next of them.
    next: usize,
    /// Sample times \[s\]; all samples are counted from the start time.
    samples: Vec<f64>,
    start: f64,
    /// Whether halves of steps may be several whole samples (of the shortest sample time).
    spanning: bool,
    slack: f64,
}

impl Stops {
    /// Stops at `fixed` times (those outside the run do not count) and at all samples, unless steps span them.
    pub fn new(
        (start, stop): (f64, f64),
        fixed: impl Iterator<Item = f64>,
        mut samples: Vec<f64>,
        spanning: bool,
    ) -> Stops {
        let slack = SAME_TIME * start.abs().max(stop.abs());
        let mut fixed: Vec<f64> =
            fixed.filter(|&time| time > start + slack && time < stop - slack).chain([stop]).collect();
        fixed.sort_unstable_by(f64::total_cmp);
        samples.sort_unstable_by(f64::total_cmp);
        Stops { fixed, next: 0, samples, start, spanning, slack }
    }

    /// The step from `t` \[s\] whose halves come near `wanted` \[s\] and are not longer.
    pub fn pair(&mut self, t: f64, wanted: f64) -> Pair {
        while self.next + 1 < self.fixed.len() && self.fixed[self.next] <= t + self.slack {
            self.next += 1;
        }
        let mut limit = self.fixed[self.next];
        if let Some(pair) = self.whole_samples(t, wanted, limit) {
            return pair;
        }
        for &sample in &self.samples {
            let next = self.sample_time(sample, self.samples_before(t, sample) + 1.0);
            if next < limit - self.slack {
                limit = next;
            }
        }
        let parts = ((limit - t) / (2.0 * wanted) - MIN_FRACTION_OF_STEP).ceil().max(1.0);
        let end = if parts > 1.0 { t + (limit - t) / parts } else { limit };
        Pair { begin: t, middle: t + (end - t) / 2.0, end }
    }

    /// Halves of whole samples, if the step may be so long and begins at a sample.
    fn whole_samples(&self, t: f64, wanted: f64, limit: f64) -> Option<Pair> {
        let sample = *self.samples.first().filter(|_| self.spanning)?;
        let before = self.samples_before(t, sample);
        if (self.sample_time(sample, before) - t).abs() > self.slack {
            return None;
        }
        let count = (wanted / sample + MIN_FRACTION_OF_STEP)
            .floor()
            .min(((limit - t) / (2.0 * sample) + MIN_FRACTION_OF_STEP).floor());
        if count < 1.0 {
            return None;
        }
        let [middle, end] = [1.0, 2.0].map(|halves| self.sample_time(sample, before + halves * count));
        let end = if (end - limit).abs() <= self.slack { limit } else { end };
        Some(Pair { begin: t, middle, end })
    }

    /// Samples from the start to `t`, the first not counted.
    fn samples_before(&self, t: f64, sample: f64) -> f64 {
        ((t - self.start) / sample + MIN_FRACTION_OF_STEP).floor()
    }

    /// Time \[s\] of sample `k`; a whole number of samples per second gives the decimals (0.007).
    fn sample_time(&self, sample: f64, k: f64) -> f64 {
        let rate = (1.0 / sample).round();
        self.start + if rate >= 1.0 && 1.0 / rate == sample { k / rate } else { k * sample }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(stops: &mut Stops, start: f64, stop: f64, wanted: f64) -> Vec<f64> {
        let mut t = start;
        let mut ends = Vec::new();
        while t < stop {
            let pair = stops.pair(t, wanted);
            assert!(
                pair.begin < pair.middle && pair.middle < pair.end && pair.half() <= wanted * (1.0 + 1e-5)
            );
            t = pair.end;
            ends.push(t);
        }
        ends
    }

    #[test]
    fn steps_end_at_samples_inputs_and_the_stop_time() {
        let mut stops = Stops::new((0.0, 0.35), [0.0, 0.15, 0.9].into_iter(), vec![0.1], false);
        assert_eq!(ends(&mut stops, 0.0, 0.35, 1.0), [0.1, 0.15, 0.2, 0.3, 0.35]);
    }

    #[test]
    fn an_interval_is_divided_evenly() {
        let mut stops = Stops::new((0.0, 1.0), std::iter::empty(), vec![], false);
        let ends = ends(&mut stops, 0.0, 1.0, 0.2);
        assert_eq!(ends.len(), 3);
        assert!((ends[0] - 1.0 / 3.0).abs() < 1e-12 && ends[2] == 1.0);
    }

    #[test]
    fn long_steps_span_whole_samples_in_both_halves() {
        let mut stops = Stops::new((0.0, 0.011), std::iter::empty(), vec![0.001], true);
        let pair = stops.pair(0.0, 0.0025);
        assert_eq!((pair.middle, pair.end), (0.002, 0.004));
        // From a time between two samples only to the next one.
        assert_eq!(stops.pair(0.0045, 0.0025).end, 0.005);
        assert_eq!(ends(&mut stops, 0.0, 0.011, 0.0025), [0.004, 0.008, 0.010, 0.011]);
        assert_eq!(stops.pair(0.0, 0.0007).end, 0.001);
    }

    #[test]
    fn a_sample_and_an_input_at_the_same_time_but_for_rounding_are_one_stop() {
        let time = 0.1 + 0.2;
        let mut stops = Stops::new((0.0, 1.0), [time].into_iter(), vec![0.1], false);
        let ends = ends(&mut stops, 0.0, 1.0, 1.0);
        assert_eq!(ends.len(), 10);
    }
}
