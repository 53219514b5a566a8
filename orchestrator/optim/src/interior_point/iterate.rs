//! A point of the interior point method with its multipliers, and what follows from it: gaps to the bounds, barrier
//! terms, optimality errors, step lengths.

use crate::error::Error;
use crate::form::{Form, length};
use crate::outcome::Multipliers;

/// Weight of the term that keeps variables with one bound from running away.
const DAMPING: f64 = 1e-5;
/// Range of z gap / barrier that is kept.
const MULTIPLIER_RANGE: f64 = 1e10;

/// X = (x, s), y of the rows, multipliers of the lower and upper bounds of X.
#[derive(Clone, Debug, Default)]
pub(crate) struct Iterate {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

/// Objective and derivatives at a point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Point {
    pub objective: f64,
    pub rows: Vec<f64>,
    pub gradient: Vec<f64>,
    pub jacobian: Vec<f64>,
    pub hessian: Vec<f64>,
}

impl Point {
    /// Makes room for the values of a form.
    pub fn resize(&mut self, form: &Form) {
        self.objective = f64::NAN;
        self.rows.resize(form.m, 0.0);
        self.gradient.resize(form.total(), 0.0);
        self.jacobian.resize(form.jacobian_entries.len(), 0.0);
        self.hessian.resize(form.hessian_entries.len(), 0.0);
    }
}

/// Parts of the optimality error, scaled by the size of the multipliers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors {
    pub dual: f64,
    pub rows: f64,
    pub complementarity: f64,
}

impl Errors {
    pub fn largest(&self) -> f64 {
        self.dual.max(self.rows).max(self.complementarity)
    }
}

/// Distance to a bound, never quite zero.
fn gap(distance: f64, bound: f64) -> f64 {
    distance.max(f64::EPSILON * bound.abs().max(1.0))
}

impl Iterate {
    /// Takes over the multipliers of an earlier run.
    pub fn take_multipliers(&mut self, form: &Form, multipliers: &Multipliers) -> Result<(), Error> {
        length("the multipliers of the constraints", multipliers.constraints.len(), form.constraints())?;
        length("the multipliers of the lower bounds", multipliers.lower.len(), form.n)?;
        length("the multipliers of the upper bounds", multipliers.upper.len(), form.n)?;
        form.scaled_multipliers(&multipliers.constraints, &mut self.y);
        let sides = [(&mut self.lower, &multipliers.lower), (&mut self.upper, &multipliers.upper)];
        for (own, given) in sides {
            own.clear();
            own.extend(given.iter().map(|z| form.objective_scale * z.max(0.0)));
        }
        // A slack s = c(x) has the bounds of the constraint: its multipliers are the parts of y.
        for slack in &form.slacks {
            let y = self.y[slack.row];
            self.lower.push((-y).max(0.0));
            self.upper.push(y.max(0.0));
        }
        Ok(())
    }

    fn lower_gap(&self, form: &Form, j: usize) -> Option<f64> {
        let l = form.lower[j];
        (l.is_finite() && !form.fixed(j)).then(|| gap(self.x[j] - l, l))
    }

    fn upper_gap(&self, form: &Form, j: usize) -> Option<f64> {
        let u = form.upper[j];
        (u.is_finite() && !form.fixed(j)).then(|| gap(u - self.x[j], u))
    }

    /// +1 or -1 where only the lower or only the upper bound is there, else 0.
    fn one_sided(form: &Form, j: usize) -> f64 {
        f64::from(u8::from(form.lower[j].is_finite())) - f64::from(u8::from(form.upper[j].is_finite()))
    }

    /// Barrier terms of the first `count` of X, to be multiplied by the barrier parameter.
    pub fn barrier_terms(&self, form: &Form, count: usize) -> f64 {
        let mut sum = 0.0;
        for j in 0..count {
            let (below, above) = (self.lower_gap(form, j), self.upper_gap(form, j));
            sum -= below.map_or(0.0, f64::ln) + above.map_or(0.0, f64::ln);
            if let (Some(gap), None) | (None, Some(gap)) = (below, above) {
                sum += DAMPING * gap;
            }
        }
        sum
    }

    /// Gradient of the barrier terms, times the barrier parameter, added to `gradient`.
    pub fn add_barrier_gradient(&self, form: &Form, barrier: f64, gradient: &mut [f64]) {
        for (j, g) in gradient.iter_mut().enumerate().filter(|(j, _)| !form.fixed(*j)) {
            *g += barrier * DAMPING * Self::one_sided(form, j);
            *g -= self.lower_gap(form, j).map_or(0.0, |gap| barrier / gap);
            *g += self.upper_gap(form, j).map_or(0.0, |gap| barrier / gap);
        }
    }

    /// Diagonal that the bounds and the proximal term add to the Hessian.
    pub fn diagonal(&self, form: &Form, diagonal: &mut Vec<f64>) {
        diagonal.clear();
        diagonal.extend((0..form.total()).map(|j| {
            form.proximal(j)
                + self.lower_gap(form, j).map_or(0.0, |gap| self.lower[j] / gap)
                + self.upper_gap(form, j).map_or(0.0, |gap| self.upper[j] / gap)
        }));
    }

    /// Steps of the multipliers of the bounds that belong to the step of X.
    pub fn multiplier_steps(&self, form: &Form, step: &[f64], barrier: f64, steps: &mut [Vec<f64>; 2]) {
        let [lower, upper] = steps;
        lower.clear();
        upper.clear();
        for (j, d) in step.iter().enumerate() {
            let (z, v) = (self.lower[j], self.upper[j]);
            lower.push(self.lower_gap(form, j).map_or(0.0, |gap| (barrier - z * d) / gap - z));
            upper.push(self.upper_gap(form, j).map_or(0.0, |gap| (barrier + v * d) / gap - v));
        }
    }

    /// Longest step of X that keeps the part `1 - fraction` of every gap.
    pub fn longest_step(&self, form: &Form, step: &[f64], fraction: f64) -> f64 {
        let mut longest = 1.0f64;
        for (j, &d) in step.iter().enumerate() {
            let gap = if d < 0.0 { self.lower_gap(form, j) } else { self.upper_gap(form, j) };
            if let Some(gap) = gap
                && d != 0.0
            {
                longest = longest.min(fraction * gap / d.abs());
            }
        }
        longest
    }

    /// Longest step of the multipliers of the bounds that keeps the part `1 - fraction` of each.
    pub fn longest_multiplier_step(&self, steps: &[Vec<f64>; 2], fraction: f64) -> f64 {
        let pairs = self.lower.iter().zip(&steps[0]).chain(self.upper.iter().zip(&steps[1]));
        pairs.filter(|&(_, &d)| d < 0.0).fold(1.0, |m, (z, d)| m.min(-fraction * z / d))
    }

    /// Keeps z gap within a range around the barrier parameter, so that the Hessian stays that of a barrier.
    pub fn bound_multipliers(&mut self, form: &Form, barrier: f64) {
        for j in 0..form.total() {
            let limit = |z: f64, gap: f64| {
                z.clamp(barrier / (MULTIPLIER_RANGE * gap), MULTIPLIER_RANGE * barrier / gap)
            };
            self.lower[j] = self.lower_gap(form, j).map_or(0.0, |gap| limit(self.lower[j], gap));
            self.upper[j] = self.upper_gap(form, j).map_or(0.0, |gap| limit(self.upper[j], gap));
        }
    }

    /// All multipliers of bounds as the barrier parameter has them; ones where that is large somewhere.
    pub fn reset_multipliers(&mut self, form: &Form, barrier: f64) {
        self.set_multipliers(form, |gap| barrier / gap);
        if self.lower.iter().chain(&self.upper).any(|z| *z > 1e3) {
            self.unit_multipliers(form);
        }
    }

    /// One for every bound there is.
    pub fn unit_multipliers(&mut self, form: &Form) {
        self.set_multipliers(form, |_| 1.0);
    }

    /// Multipliers of the bounds as a function of the distance to them; 0 where there is none.
    fn set_multipliers(&mut self, form: &Form, of: impl Fn(f64) -> f64) {
        let total = form.total();
        self.lower.resize(total, 0.0);
        self.upper.resize(total, 0.0);
        for j in 0..total {
            self.lower[j] = self.lower_gap(form, j).map_or(0.0, &of);
            self.upper[j] = self.upper_gap(form, j).map_or(0.0, &of);
        }
    }

    /// Errors of the optimality conditions with the complementarity `z gap = barrier`.
    pub fn errors(&self, form: &Form, point: &Point, barrier: f64, work: &mut Vec<f64>) -> Errors {
        work.clear();
        work.extend_from_slice(&point.gradient);
        form.add_transposed(&point.jacobian, &self.y, work);
        let (mut dual, mut complementarity, mut sum, mut count) = (0.0f64, 0.0f64, 0.0, 0usize);
        for (j, g) in work.iter().enumerate().filter(|(j, _)| !form.fixed(*j)) {
            dual = dual.max((g - self.lower[j] + self.upper[j]).abs());
            for (gap, z) in
                [(self.lower_gap(form, j), self.lower[j]), (self.upper_gap(form, j), self.upper[j])]
            {
                if let Some(gap) = gap {
                    complementarity = complementarity.max((gap * z - barrier).abs());
                    sum += z;
                    count += 1;
                }
            }
        }
        let y: f64 = self.y.iter().map(|y| y.abs()).sum();
        let mean =
            |sum: f64, count: usize| if count == 0 { 1.0 } else { (sum / count as f64).max(100.0) / 100.0 };
        Errors {
            dual: dual / mean(sum + y, count + form.m),
            rows: point.rows.iter().fold(0.0, |m, c| m.max(c.abs())),
            complementarity: complementarity / mean(sum, count),
        }
    }

    /// Mean of z gap, the barrier parameter that fits the multipliers best.
    pub fn mean_complementarity(&self, form: &Form) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for j in 0..form.total() {
            for (gap, z) in
                [(self.lower_gap(form, j), self.lower[j]), (self.upper_gap(form, j), self.upper[j])]
            {
                if let Some(gap) = gap {
                    sum += gap * z;
                    count += 1;
                }
            }
        }
        if count == 0 { 0.0 } else { sum / count as f64 }
    }
}

/// Moves X into the interior of its bounds: at least `push` times the size of the bound and of the range away.
pub(crate) fn push_inside(form: &Form, x: &mut [f64], push: f64) {
    for (j, x) in x.iter_mut().enumerate() {
        let (l, u) = (form.lower[j], form.upper[j]);
        if form.fixed(j) {
            *x = l;
            continue;
        }
        let margin = |bound: f64| (push * bound.abs().max(1.0)).min(push * (u - l));
        if u.is_finite() {
            *x = x.min(u - margin(u));
        }
        if l.is_finite() {
            *x = x.max(l + margin(l));
        }
    }
}
