//! Communication points: start, start + h, ... and the stop time exactly.

use super::Error;

/// Communication points of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    start: f64,
    stop: f64,
    step: f64,
    /// Steps per second, if that is a whole number: then k / rate gives times that read well (0.007, not
    /// 0.007000000000000001) and agree bit by bit with times written as decimals.
    rate: Option<f64>,
    steps: u64,
    /// A remainder below this fraction of a step is rounding.
    slack: f64,
}

/// A remainder below this fraction of a step is rounding, not a step of its own.
const MIN_FRACTION_OF_STEP: f64 = 1e-6;
/// A span below this fraction of its times is rounding of them.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// Largest number of steps whose numbers are exact in a double.
const MAX_STEPS: f64 = 9.0e15;

impl Grid {
    /// Points from `start` to `stop` \[s\], `step` \[s\] apart; the last step is shortened to end at `stop`.
    ///
    /// # Errors
    /// [`Error::Setting`] for times that are not finite, a stop before the start, or a step that is not positive.
    pub fn new(start: f64, stop: f64, step: f64) -> Result<Grid, Error> {
        if !start.is_finite() {
            return Err(Error::Setting { name: "start time", value: start, allowed: "finite" });
        }
        if !(stop.is_finite() && stop >= start) {
            return Err(Error::Setting {
                name: "stop time",
                value: stop,
                allowed: "at or after the start time",
            });
        }
        if !(step.is_finite() && step > 0.0) {
            return Err(Error::Setting { name: "step", value: step, allowed: "positive" });
        }
        let ratio = (stop - start) / step;
        if ratio > MAX_STEPS || start + step == start {
            let allowed = "large enough to move the time on by it (there are too many steps)";
            return Err(Error::Setting { name: "step", value: step, allowed });
        }
        // Large times are rounded by themselves: in seconds since 1970 to 0.2 microseconds.
        let rounded = start.abs().max(stop.abs()) * f64::EPSILON / step;
        let slack = (MIN_FRACTION_OF_STEP + 2.0 * rounded).min(0.5);
        // A step that is longer than the span by far is one step; a span that is rounding is none.
        let least = u64::from(stop - start > ROUNDING * start.abs().max(stop.abs()));
        let steps = ((ratio - slack).ceil().max(0.0) as u64).max(least);
        let rate = Some((1.0 / step).round()).filter(|rate| *rate >= 1.0 && 1.0 / rate == step);
        Ok(Grid { start, stop, step, rate, steps, slack })
    }

    /// Number of steps.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Communication point k \[s\]; computed afresh, so that rounding does not add up.
    #[inline]
    pub fn time(&self, k: u64) -> f64 {
        if k >= self.steps {
            return self.stop;
        }
        let k = k as f64;
        self.start + self.rate.map_or_else(|| k * self.step, |rate| k / rate)
    }

    /// Size \[s\] of the step that begins at point k.
    #[inline]
    pub fn step_size(&self, k: u64) -> f64 {
        if k + 1 < self.steps { self.step } else { self.last_step() }
    }

    /// Size \[s\] of the last step.
    pub fn last_step(&self) -> f64 {
        let last = self.stop - self.time(self.steps.saturating_sub(1));
        if (last - self.step).abs() <= self.slack * self.step { self.step } else { last }
    }

    /// Whether the last step is shorter than the others.
    pub fn shortened(&self) -> bool {
        self.steps > 0 && self.last_step() != self.step
    }

    /// Start time \[s\].
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Stop time \[s\].
    pub fn stop(&self) -> f64 {
        self.stop
    }

    /// Communication step size \[s\].
    pub fn step(&self) -> f64 {
        self.step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_since_1970_rise_up_to_the_stop() {
        let start = 1_700_000_000.0;
        for (stop, step) in [(0.1, 0.001), (1.0, 0.003), (10.0, 0.01), (0.5, 1e-5)] {
            let grid = Grid::new(start, start + stop, step).unwrap();
            assert_eq!(grid.steps(), (stop / step - 0.05).ceil() as u64);
            let times: Vec<f64> = (0..=grid.steps()).map(|k| grid.time(k)).collect();
            assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{stop} {step}");
        }
    }

    #[test]
    fn points_of_a_millisecond_are_the_decimals() {
        let grid = Grid::new(0.0, 4.0, 0.001).unwrap();
        assert_eq!(grid.steps(), 4000);
        for k in 0..=4000 {
            let text = format!("{}.{:03}", k / 1000, k % 1000);
            assert_eq!(grid.time(k), text.parse::<f64>().unwrap(), "{text}");
        }
        assert!(!grid.shortened());
    }

    #[test]
    fn the_last_step_is_shortened_to_meet_the_stop_time() {
        let grid = Grid::new(1.0, 2.0, 0.3).unwrap();
        assert_eq!((grid.steps(), grid.time(4)), (4, 2.0));
        assert!((grid.last_step() - 0.1).abs() < 1e-12 && grid.shortened());
        assert_eq!(grid.step_size(0), 0.3);
    }

    #[test]
    fn a_step_that_is_longer_than_the_span_is_one_step() {
        for step in [10.0, 1e7, 1e9, 1e30] {
            let grid = Grid::new(0.0, 4.0, step).unwrap();
            assert_eq!((grid.steps(), grid.last_step()), (1, 4.0), "{step}");
        }
        assert_eq!(Grid::new(0.3, 0.1 + 0.2, 1e9).unwrap().steps(), 0);
    }

    #[test]
    fn rounding_makes_no_step_of_its_own() {
        for (stop, step, steps) in [(0.3, 0.1, 3), (1.0, 1.0 / 3.0, 3), (0.7, 0.07, 10), (0.0, 0.1, 0)] {
            let grid = Grid::new(0.0, stop, step).unwrap();
            assert_eq!(grid.steps(), steps, "{stop} {step}");
            assert!(!grid.shortened(), "{stop} {step}");
            assert_eq!(grid.time(steps), stop);
        }
    }

    #[test]
    fn impossible_spans_are_refused() {
        for (start, stop, step) in [
            (0.0, 1.0, 0.0),
            (0.0, 1.0, -1.0),
            (0.0, 1.0, f64::NAN),
            (1.0, 0.0, 0.1),
            (0.0, f64::INFINITY, 0.1),
            (1e9, 2e9, 1e-9),
        ] {
            assert!(
                matches!(Grid::new(start, stop, step), Err(Error::Setting { .. })),
                "{start} {stop} {step}"
            );
        }
    }
}
