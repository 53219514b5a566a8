//! The next step from the error of the last: a PI controller (Gustafsson, ACM TOMS 17, 1991) between two limits.

/// Aim below the tolerance, so that most steps are accepted.
const SAFETY: f64 = 0.9;
/// Largest growth and shrinkage of a step relative to the last one.
const GROWTH: f64 = 4.0;
const SHRINKAGE: f64 = 0.1;
/// Step after one that could not be made at all, as a part of it.
const AFTER_FAILURE: f64 = 0.25;
/// Errors below this (of the tolerance) say nothing.
const SMALLEST_ERROR: f64 = 1e-8;
/// Exponents of the present and the last error, over the order of the error of one step.
const PROPORTIONAL: f64 = 0.7;
const INTEGRAL: f64 = 0.4;

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Control {
    /// Step \[s\] to try next.
    pub wanted: f64,
    /// Limits of the step \[s\].
    pub min: f64,
    pub max: f64,
    /// The error of one step grows with this power of it.
    order: f64,
    last_error: f64,
    rejected: bool,
}

impl Control {
    /// Begins with `first` \[s\].
    pub fn new(first: f64, (min, max): (f64, f64), order: u32) -> Control {
        Control {
            wanted: first.clamp(min, max),
            min,
            max,
            order: f64::from(order),
            last_error: 1.0,
            rejected: false,
        }
    }

    /// After a step of `h` \[s\] whose error (1: the tolerance) is accepted.
    pub fn accept(&mut self, h: f64, error: f64) {
        let error = error.max(SMALLEST_ERROR);
        let power = |error: f64, exponent: f64| error.powf(exponent / self.order);
        let factor = SAFETY * power(error, -PROPORTIONAL) * power(self.last_error, INTEGRAL);
        let factor = factor.clamp(SHRINKAGE, if self.rejected { 1.0 } else { GROWTH });
        // A step that was cut short by a sample or an input says little about long ones.
        if factor < 1.0 || h > 0.5 * self.wanted {
            self.wanted = (h * factor).clamp(self.min, self.max);
        }
        self.last_error = error;
        self.rejected = false;
    }

    /// After a step of `h` \[s\] with too large an error, or `None` if it could not be made; false if there is no
    /// shorter one.
    pub fn reject(&mut self, h: f64, error: Option<f64>) -> bool {
        let factor = error
            .map_or(AFTER_FAILURE, |error| (SAFETY * error.powf(-1.0 / self.order)).clamp(SHRINKAGE, SAFETY));
        self.rejected = true;
        let shorter = h > self.min * (1.0 + 1e-9);
        self.wanted = (h * factor).clamp(self.min, self.max);
        shorter
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_settles_where_the_error_meets_the_tolerance() {
        // Error (h / 1 ms)^2 of the tolerance.
        let mut control = Control::new(1e-6, (1e-9, 1.0), 2);
        for _ in 0..60 {
            let h = control.wanted;
            let error = (h / 1e-3).powi(2);
            if error <= 1.0 { control.accept(h, error) } else { assert!(control.reject(h, Some(error))) }
        }
        assert!((0.7e-3..1e-3).contains(&control.wanted), "{}", control.wanted);
    }

    #[test]
    fn the_limits_hold_and_the_shortest_step_is_the_last_resort() {
        let mut control = Control::new(1.0, (0.1, 0.4), 2);
        assert_eq!(control.wanted, 0.4);
        control.accept(0.4, 1e-9);
        assert_eq!(control.wanted, 0.4);
        assert!(control.reject(0.4, None));
        assert!(control.reject(0.1001, Some(f64::INFINITY)));
        assert_eq!(control.wanted, 0.1);
        assert!(!control.reject(0.1, Some(2.0)));
    }

    #[test]
    fn a_step_that_was_cut_short_does_not_shorten_the_next() {
        let mut control = Control::new(0.1, (1e-6, 1.0), 2);
        control.accept(1e-5, 0.3);
        assert_eq!(control.wanted, 0.1);
    }
}
