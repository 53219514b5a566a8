//! Filter of the line search: pairs of violation and objective that a new point must improve on (Fletcher and
//! Leyffer, Mathematical Programming 91, 2002; constants of Wächter and Biegler, Mathematical Programming 106, 2006).

/// Least relative decrease of the violation, and of the objective by the violation.
pub(super) const VIOLATION_MARGIN: f64 = 1e-5;
pub(super) const OBJECTIVE_MARGIN: f64 = 1e-8;
/// Armijo's constant.
const ARMIJO: f64 = 1e-8;
const SWITCH_VIOLATION: f64 = 1.1;
const SWITCH_OBJECTIVE: f64 = 2.3;

/// Violation theta and objective phi of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measure {
    pub theta: f64,
    pub phi: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Filter {
    corners: Vec<Measure>,
    /// Points with more violation than this are never accepted.
    largest: f64,
    /// Below this violation the objective decides.
    smallest: f64,
}

/// Reference values with which a trial point is compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Current {
    pub at: Measure,
    /// Slope of the objective along the step.
    pub slope: f64,
}

/// Reason why a trial point is accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Acceptance {
    /// The objective falls enough.
    Objective,
    /// Violation or objective improve; the filter has to remember the point that is left.
    Filter,
}

impl Filter {
    pub fn new(theta: f64) -> Self {
        Self { corners: Vec::new(), largest: 1e4 * theta.max(1.0), smallest: 1e-4 * theta.max(1.0) }
    }

    /// Same as a new one, in the memory there is.
    pub fn restart(&mut self, theta: f64) {
        let corners = std::mem::take(&mut self.corners);
        *self = Self { corners, ..Self::new(theta) };
        self.clear();
    }

    /// Forgets all points but keeps the limits of the violation.
    pub fn clear(&mut self) {
        self.corners.clear();
    }

    /// No point is remembered.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// No point of the filter dominates this one.
    pub fn admits(&self, trial: Measure) -> bool {
        trial.theta <= self.largest
            && self.corners.iter().all(|c| trial.theta < c.theta || below(trial.phi, c.phi, c.phi))
    }

    /// Remembers a point that is left.
    pub fn add(&mut self, left: Measure) {
        let corner = Measure {
            theta: (1.0 - VIOLATION_MARGIN) * left.theta,
            phi: left.phi - OBJECTIVE_MARGIN * left.theta,
        };
        self.corners.retain(|c| c.theta < corner.theta || c.phi < corner.phi);
        self.corners.push(corner);
    }

    /// The slope is steep enough against the violation for the objective alone to decide.
    fn switches(&self, current: Current, length: f64) -> bool {
        current.slope < 0.0
            && length * (-current.slope).powf(SWITCH_OBJECTIVE) > current.at.theta.powf(SWITCH_VIOLATION)
    }

    /// Whether a step of this length may go to the trial point.
    pub fn accepts(&self, current: Current, length: f64, trial: Measure) -> Option<Acceptance> {
        if !trial.phi.is_finite() || !self.admits(trial) {
            return None;
        }
        let Measure { theta, phi } = current.at;
        if theta <= self.smallest && self.switches(current, length) {
            let enough = below(trial.phi, phi + ARMIJO * length * current.slope, phi);
            return enough.then_some(Acceptance::Objective);
        }
        let improves = below(trial.theta, (1.0 - VIOLATION_MARGIN) * theta, theta)
            || below(trial.phi, phi - OBJECTIVE_MARGIN * theta, phi);
        if !improves {
            return None;
        }
        let armijo =
            self.switches(current, length) && below(trial.phi, phi + ARMIJO * length * current.slope, phi);
        Some(if armijo { Acceptance::Objective } else { Acceptance::Filter })
    }

    /// Step length below which no progress is to be expected along the step.
    pub fn shortest(&self, current: Current) -> f64 {
        let (theta, slope) = (current.at.theta, current.slope);
        let mut shortest = VIOLATION_MARGIN;
        if slope < 0.0 {
            shortest = shortest.min(OBJECTIVE_MARGIN * theta / -slope);
            if theta <= self.smallest {
                shortest = shortest.min(theta.powf(SWITCH_VIOLATION) / (-slope).powf(SWITCH_OBJECTIVE));
            }
        }
        0.05 * shortest
    }
}

/// `a <= b` up to the rounding of numbers as large as `base`.
fn below(a: f64, b: f64, base: f64) -> bool {
    a - b <= 10.0 * f64::EPSILON * base.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn current(theta: f64, phi: f64, slope: f64) -> Current {
        Current { at: Measure { theta, phi }, slope }
    }

    #[test]
    fn a_feasible_point_needs_the_decrease_of_armijo() {
        let filter = Filter::new(0.0);
        let from = current(0.0, 1.0, -1.0);
        let trial = |phi| filter.accepts(from, 1.0, Measure { theta: 0.0, phi });
        assert_eq!(trial(0.5), Some(Acceptance::Objective));
        assert_eq!(trial(1.1), None);
    }

    #[test]
    fn less_violation_is_enough_far_from_the_constraints() {
        let filter = Filter::new(10.0);
        let from = current(10.0, 1.0, 5.0);
        assert_eq!(filter.accepts(from, 1.0, Measure { theta: 9.0, phi: 7.0 }), Some(Acceptance::Filter));
        assert_eq!(filter.accepts(from, 1.0, Measure { theta: 11.0, phi: 7.0 }), None);
    }

    #[test]
    fn a_dominated_point_is_refused_until_the_filter_is_cleared() {
        let mut filter = Filter::new(10.0);
        filter.add(Measure { theta: 2.0, phi: 3.0 });
        let (worse, better) = (Measure { theta: 2.5, phi: 3.5 }, Measure { theta: 1.0, phi: 9.0 });
        assert!(!filter.admits(worse) && filter.admits(better));
        filter.clear();
        assert!(filter.admits(worse));
    }

    #[test]
    fn a_point_beyond_the_largest_violation_is_refused() {
        assert!(!Filter::new(1.0).admits(Measure { theta: 1e5, phi: -1e9 }));
    }
}
