//! The step of an iteration: KKT system with the working set held, or a quadratic program with all bounds.

use super::active_set::Held;
use super::{Memory, Sqp, Work};
use crate::form::Form;
use crate::nlp::Bounds;
use crate::outcome::Note;
use crate::qp::{Quadratic, QuadraticSolution, QuadraticStatus, solve_quadratic};

/// Curvature of slacks that are free: their rows then hardly matter.
const SLACK_CURVATURE: f64 = 1e-8;
/// Multiplier of the wrong sign up to which a bound stays in the working set.
pub(super) const MAX_MULTIPLIER_OF_WRONG_SIGN: f64 = 1e-9;
/// Changes of the working set for one step before a quadratic program is solved.
const MAX_WORKING_SET_CHANGES: usize = 8;
/// Iterations in a row that may need a quadratic program.
const PROGRAMS_IN_A_ROW: usize = 20;
const CONVEX_SHIFTS: usize = 40;
/// Factorizations to make a step short enough, and how long in units of the radius that is.
const MAX_SHORTENINGS: usize = 5;
const LONGEST_STEP_IN_RADII: f64 = 3.0;
/// Part of the step after a shift above which more of it does not help.
const MIN_SHORTENING: f64 = 0.9;
/// The first shift, and the growth after it.
const LEAST_SHIFT: f64 = 1e-3;
const SHIFT_FACTOR: f64 = 8.0;
const MAX_SHIFT_FACTOR: f64 = 100.0;

/// Step of X with the multipliers at its end.
#[derive(Debug, Default)]
pub(super) struct Step {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub note: Note,
    /// The last factorization is that of this step, so that it can be corrected.
    pub correctable: bool,
}

impl Step {
    /// Makes room for a step of a form.
    pub fn resize(&mut self, form: &Form) {
        let total = form.total();
        for (vector, count) in
            [(&mut self.x, total), (&mut self.y, form.m), (&mut self.lower, total), (&mut self.upper, total)]
        {
            vector.resize(count, 0.0);
        }
        (self.note, self.correctable) = (Note::None, false);
    }

    /// Takes over another step of the same form.
    pub fn copy_from(&mut self, other: &Self) {
        self.x.copy_from_slice(&other.x);
        self.y.copy_from_slice(&other.y);
        self.lower.copy_from_slice(&other.lower);
        self.upper.copy_from_slice(&other.upper);
        (self.note, self.correctable) = (other.note, other.correctable);
    }
}

impl Sqp<'_, '_, '_> {
    /// Computes the step; false where neither way gives one.
    pub(super) fn compute_step(&mut self) -> bool {
        if self.working_set_step() {
            (self.memory.step.note, self.memory.step.correctable) = (Note::None, true);
            self.programs_in_a_row = 0;
            return true;
        }
        let Some(solution) = self.quadratic_step() else { return false };
        let Memory { at, active, .. } = &mut self.memory;
        active.take_solution(self.form, &at.x, &solution.x, &solution.lower, &solution.upper);
        // The KKT system with this working set has the solution to the last digits.
        let correctable = self.held_step() && self.step_is_inside();
        let step = &mut self.memory.step;
        step.correctable = correctable;
        if !correctable {
            step.x.copy_from_slice(&solution.x);
            step.y.copy_from_slice(&solution.y);
            step.lower.copy_from_slice(&solution.lower);
            step.upper.copy_from_slice(&solution.upper);
        } else {
            step.lower.iter_mut().chain(&mut step.upper).for_each(|z| *z = z.max(0.0));
        }
        step.note = Note::QuadraticProgram;
        true
    }

    /// Solves with the working set held, and again with the bounds that the step leaves held as well and those with a
    /// multiplier of the wrong sign released, until the step solves the quadratic program with all bounds (primal-dual
    /// active set; Hintermüller, Ito and Kunisch, SIAM Journal on Optimization 13, 2003). False where that does not
    /// settle; the working set is then as before.
    fn working_set_step(&mut self) -> bool {
        let mut changes = 0;
        loop {
            if !self.held_step() {
                break;
            }
            if self.is_optimal() {
                return true;
            }
            let Memory { at, active, step, before, .. } = &mut self.memory;
            if changes == 0 {
                before.held.clone_from(&active.held);
            }
            changes += 1;
            if changes > MAX_WORKING_SET_CHANGES || !active.change(self.form, &at.x, step) {
                break;
            }
        }
        if changes > 0 {
            let Memory { active, before, .. } = &mut self.memory;
            std::mem::swap(active, before);
        }
        false
    }

    /// Solves with the working set held; false where the KKT matrix cannot be made that of a minimum.
    fn held_step(&mut self) -> bool {
        let form = &*self.form;
        let Memory { point, active, work, .. } = &mut self.memory;
        work.diagonal.clear();
        work.diagonal.resize(form.n, 0.0);
        work.diagonal.resize(form.total(), SLACK_CURVATURE);
        let held = |j: usize| form.fixed(j) || active.held[j] != Held::Free;
        let factored =
            self.kkt.factor(form, &point.hessian, &point.jacobian, &work.diagonal, held, 1e-8).is_ok();
        factored && self.solve_held() && self.shorten()
    }

    /// Solves with the last factorization for the rows of the point.
    fn solve_held(&mut self) -> bool {
        let rows = std::mem::take(&mut self.memory.point.rows);
        let solved = self.correct_step(&rows);
        self.memory.point.rows = rows;
        solved
    }

    /// Shifts the Hessian until the step is no longer than the radius, as a trust region would (Moré and Sorensen, SIAM
    /// Journal on Scientific and Statistical Computing 4, 1983: the inverse length is nearly linear in the shift). Ends
    /// before where the step to the constraints is what is long. False: the step is useless.
    fn shorten(&mut self) -> bool {
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..MAX_SHORTENINGS {
            let (shift, length) = (self.kkt.shift, self.step_length());
            let enough = length <= LONGEST_STEP_IN_RADII * self.radius;
            if enough || before.is_some_and(|(_, longer)| length > MIN_SHORTENING * longer) {
                break;
            }
            let next = match before {
                None => (SHIFT_FACTOR * shift).max(LEAST_SHIFT),
                Some((other, longer)) => {
                    let slope = (1.0 / length - 1.0 / longer) / (shift - other);
                    let wanted = shift + (1.0 / self.radius - 1.0 / length) / slope;
                    wanted.clamp(2.0 * shift, MAX_SHIFT_FACTOR * shift)
                }
            };
            before = Some((shift, length));
            let form = &*self.form;
            let Memory { point, work, .. } = &self.memory;
            if !self.kkt.shift_to(form, &point.hessian, &point.jacobian, &work.diagonal, next)
                || !self.solve_held()
            {
                return false;
            }
        }
        true
    }

    /// Largest step of a variable.
    pub(super) fn step_length(&self) -> f64 {
        self.memory.step.x[..self.form.n].iter().fold(0.0, |m, d| m.max(d.abs()))
    }

    /// Solves again with the last factorization for these rows.
    pub(super) fn correct_step(&mut self, rows: &[f64]) -> bool {
        let form = &*self.form;
        let Memory { at, point, active, step, work, .. } = &mut self.memory;
        let Work { known, right, rows: of_rows, .. } = work;
        let (total, n) = (form.total(), form.n);
        // Held X go to their bound: known, so they move to the right-hand side.
        known.clear();
        known.extend((0..total).map(|j| active.to_bound(form, &at.x, j)));
        right.clear();
        right.extend_from_slice(&point.gradient);
        form.add_transposed(&point.jacobian, &at.y, right);
        of_rows.resize(form.m, 0.0);
        form.multiply(&point.jacobian, known, of_rows);
        add_product(form, &point.hessian, known, right);
        right.iter_mut().for_each(|g| *g = -*g);
        of_rows.iter_mut().zip(rows).for_each(|(r, c)| *r = -c - *r);
        if !self.kkt.solve(form, &point.jacobian, (right, of_rows), &mut step.x, &mut step.y) {
            return false;
        }
        step.x.iter_mut().zip(known.iter()).for_each(|(d, k)| *d += k);
        step.y.iter_mut().zip(&at.y).for_each(|(d, y)| *d += y);
        // Multipliers of the held bounds from the stationarity of the Lagrangian.
        right.clear();
        right.extend_from_slice(&point.gradient);
        form.add_transposed(&point.jacobian, &step.y, right);
        add_product(form, &point.hessian, &step.x, right);
        for (j, gradient) in right.iter().enumerate() {
            let shift = if j < n { self.kkt.shift } else { 0.0 };
            let z = gradient + shift * step.x[j];
            step.lower[j] = if active.held[j] == Held::Lower { z } else { 0.0 };
            step.upper[j] = if active.held[j] == Held::Upper { -z } else { 0.0 };
        }
        true
    }

    /// The step ends within all bounds.
    pub(super) fn step_is_inside(&self) -> bool {
        let Memory { at, active, step, .. } = &self.memory;
        active.inside(self.form, &at.x, &step.x)
    }

    /// The step with the working set held solves the quadratic program with all bounds.
    fn is_optimal(&mut self) -> bool {
        let step = &self.memory.step;
        let signs = step.lower.iter().chain(&step.upper).all(|z| *z >= -MAX_MULTIPLIER_OF_WRONG_SIGN);
        signs && self.step_is_inside()
    }

    /// Solution of the quadratic program with all bounds; none where it has none, or where too many in a row say
    /// that the working set does not settle.
    fn quadratic_step(&mut self) -> Option<QuadraticSolution> {
        self.programs_in_a_row += 1;
        if self.programs_in_a_row > PROGRAMS_IN_A_ROW {
            return None;
        }
        let shift = self.convex_shift()?;
        self.kkt.shift = shift;
        self.quadratic_programs += 1;
        let solution = solve_quadratic(&self.quadratic(shift)).ok()?;
        matches!(solution.status, QuadraticStatus::Solved | QuadraticStatus::Inexact).then_some(solution)
    }

    /// The quadratic program in the step of X.
    fn quadratic(&self, shift: f64) -> Quadratic {
        let (form, point, at) = (&*self.form, &self.memory.point, &self.memory.at);
        let (n, total) = (form.n, form.total());
        let curvature = form.hessian_entries.iter().zip(&point.hessian).map(|(&(i, j), &h)| (i, j, h));
        let diagonal = (0..n).map(|j| (j, j, shift));
        let slopes = form.jacobian_entries.iter().zip(&point.jacobian).map(|(&(i, j), &a)| (i, j, a));
        let slacks = form.slacks.iter().enumerate().map(|(j, slack)| (slack.row, n + j, slack.sign));
        let rows: Vec<f64> = point.rows.iter().map(|c| -c).collect();
        let gap = |bounds: &[f64]| -> Vec<f64> { (0..total).map(|j| bounds[j] - at.x[j]).collect() };
        Quadratic {
            hessian: curvature.chain(diagonal).collect(),
            gradient: point.gradient.clone(),
            rows: slopes.chain(slacks).collect(),
            row_bounds: Bounds { lower: rows.clone(), upper: rows },
            bounds: Bounds { lower: gap(&form.lower), upper: gap(&form.upper) },
        }
    }

    /// Smallest shift found with which the Hessian itself is positive definite.
    fn convex_shift(&mut self) -> Option<f64> {
        let mut shift = self.kkt.shift;
        for _ in 0..CONVEX_SHIFTS {
            if self.kkt.is_convex(self.form, &self.memory.point.hessian, shift) {
                return Some(shift);
            }
            shift = if shift == 0.0 { 1e-4 } else { 4.0 * shift };
        }
        None
    }
}

/// Adds `W x` to `sum`.
fn add_product(form: &Form, hessian: &[f64], x: &[f64], sum: &mut [f64]) {
    for (&(i, j), h) in form.hessian_entries.iter().zip(hessian) {
        sum[i] += h * x[j];
        if i != j {
            sum[j] += h * x[i];
        }
    }
}
