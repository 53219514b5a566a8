//! The working set: bounds of X that the next step holds.

use super::step::{MAX_MULTIPLIER_OF_WRONG_SIGN, Step};
use crate::form::Form;
use crate::interior_point::Iterate;

/// A step that leaves a bound by less than this, relative to the bound, ends on it.
const BOUND_TOLERANCE: f64 = 1e-9;

/// Bound of a variable or slack that is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Held {
    #[default]
    Free,
    Lower,
    Upper,
}

#[derive(Clone, Debug, Default)]
pub(super) struct ActiveSet {
    pub held: Vec<Held>,
}

impl ActiveSet {
    /// Bounds whose multiplier is larger than the distance to them; X is put on these.
    pub fn begin(&mut self, form: &Form, at: &mut Iterate) {
        self.held.clear();
        self.held.resize(form.total(), Held::Free);
        for j in 0..form.total() {
            if form.fixed(j) {
                continue;
            }
            if at.lower[j] > at.x[j] - form.lower[j] {
                self.held[j] = Held::Lower;
                at.x[j] = form.lower[j];
            } else if at.upper[j] > form.upper[j] - at.x[j] {
                self.held[j] = Held::Upper;
                at.x[j] = form.upper[j];
            } else {
                (at.lower[j], at.upper[j]) = (0.0, 0.0);
            }
        }
    }

    /// The working set of a quadratic program's solution: multiplier larger than the gap, and X can be put there.
    pub fn take_solution(&mut self, form: &Form, x: &[f64], step: &[f64], lower: &[f64], upper: &[f64]) {
        self.held.clear();
        self.held.extend((0..form.total()).map(|j| {
            match (x[j] + step[j] - form.lower[j], form.upper[j] - x[j] - step[j]) {
                _ if form.fixed(j) => Held::Free,
                (gap, _) if lower[j] > gap => Held::Lower,
                (_, gap) if upper[j] > gap => Held::Upper,
                _ => Held::Free,
            }
        }));
    }

    /// Holds the bounds that a step leaves, releases those whose multiplier has the wrong sign; false where there is
    /// nothing to change.
    pub fn change(&mut self, form: &Form, x: &[f64], step: &Step) -> bool {
        let mut changed = false;
        for (j, held) in self.held.iter_mut().enumerate().filter(|(j, _)| !form.fixed(*j)) {
            let end = x[j] + step.x[j];
            let room = |bound: f64| BOUND_TOLERANCE * bound.abs().max(1.0);
            let next = match *held {
                Held::Free if end < form.lower[j] - room(form.lower[j]) => Held::Lower,
                Held::Free if end > form.upper[j] + room(form.upper[j]) => Held::Upper,
                Held::Lower if step.lower[j] < -MAX_MULTIPLIER_OF_WRONG_SIGN => Held::Free,
                Held::Upper if step.upper[j] < -MAX_MULTIPLIER_OF_WRONG_SIGN => Held::Free,
                same => same,
            };
            changed |= next != *held;
            *held = next;
        }
        changed
    }

    /// Distance from X to the bound that is held, 0 for those that are free.
    pub fn to_bound(&self, form: &Form, x: &[f64], j: usize) -> f64 {
        match self.held[j] {
            Held::Free => 0.0,
            Held::Lower => form.lower[j] - x[j],
            Held::Upper => form.upper[j] - x[j],
        }
    }

    /// The step ends within all bounds.
    pub fn inside(&self, form: &Form, x: &[f64], step: &[f64]) -> bool {
        (0..form.total()).all(|j| {
            let end = x[j] + step[j];
            let slack = |bound: f64| BOUND_TOLERANCE * bound.abs().max(1.0);
            end >= form.lower[j] - slack(form.lower[j]) && end <= form.upper[j] + slack(form.upper[j])
        })
    }
}
