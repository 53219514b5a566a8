//! The step of an iteration: KKT system with the working set held, or a quadratic program with all bounds.

use super::Sqp;
use super::active_set::{ActiveSet, Held};
use crate::form::Form;
use crate::nlp::Bounds;
use crate::outcome::Note;
use crate::qp::{Quadratic, QuadraticSolution, QuadraticStatus, solve_quadratic};

/// Curvature of slacks that are free: their rows then hardly matter.
const SLACK_CURVATURE: f64 = 1e-8;
/// Multiplier of the wrong sign up to which a bound stays in the working set.
const MAX_MULTIPLIER_OF_WRONG_SIGN: f64 = 1e-9;
/// Iterations in a row that may need a quadratic program.
const PROGRAMS_IN_A_ROW: usize = 20;
const CONVEX_SHIFTS: usize = 40;

/// Step of X with the multipliers at its end.
#[derive(Clone, Debug, Default)]
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
    pub fn new(form: &Form) -> Self {
        let total = form.total();
        Self {
            x: vec![0.0; total],
            y: vec![0.0; form.m],
            lower: vec![0.0; total],
            upper: vec![0.0; total],
            note: Note::None,
            correctable: false,
        }
    }
}

impl Sqp<'_, '_, '_> {
    /// Computes the step; false where neither way gives one.
    pub(super) fn compute_step(&mut self) -> bool {
        if self.held_step() && self.is_optimal() {
            (self.step.note, self.step.correctable) = (Note::None, true);
            self.programs_in_a_row = 0;
            return true;
        }
        let Some(solution) = self.quadratic_step() else { return false };
        let step = &solution.x;
        self.active = ActiveSet::of_solution(self.form, &self.at.x, step, &solution.lower, &solution.upper);
        // The KKT system with this working set has the solution to the last digits.
        self.step.correctable = self.held_step() && self.active.inside(self.form, &self.at.x, &self.step.x);
        if !self.step.correctable {
            self.step.x.copy_from_slice(step);
            self.step.y.copy_from_slice(&solution.y);
            self.step.lower.copy_from_slice(&solution.lower);
            self.step.upper.copy_from_slice(&solution.upper);
        } else {
            self.step.lower.iter_mut().chain(&mut self.step.upper).for_each(|z| *z = z.max(0.0));
        }
        self.step.note = Note::QuadraticProgram;
        true
    }

    /// Solves with the working set held; false where the KKT matrix cannot be made that of a minimum.
    fn held_step(&mut self) -> bool {
        let (form, active) = (&*self.form, &self.active);
        let n = form.n;
        let diagonal: Vec<f64> =
            (0..form.total()).map(|j| if j < n { 0.0 } else { SLACK_CURVATURE }).collect();
        let held = |j: usize| form.fixed(j) || active.held[j] != Held::Free;
        let (hessian, jacobian) = (&self.point.hessian, &self.point.jacobian);
        self.kkt.factor(form, hessian, jacobian, &diagonal, held, 1e-8).is_ok() && {
            let rows = self.point.rows.clone();
            self.correct_step(&rows)
        }
    }

    /// Solves again with the last factorization for these rows.
    pub(super) fn correct_step(&mut self, rows: &[f64]) -> bool {
        let form = &*self.form;
        let (total, n) = (form.total(), form.n);
        // Held X go to their bound: known, so they move to the right-hand side.
        let known: Vec<f64> = (0..total).map(|j| self.active.to_bound(form, &self.at.x, j)).collect();
        let mut right = self.point.gradient.clone();
        form.add_transposed(&self.point.jacobian, &self.at.y, &mut right);
        let mut of_rows = vec![0.0; form.m];
        form.multiply(&self.point.jacobian, &known, &mut of_rows);
        add_product(form, &self.point.hessian, &known, &mut right);
        right.iter_mut().for_each(|g| *g = -*g);
        of_rows.iter_mut().zip(rows).for_each(|(r, c)| *r = -c - *r);
        let step = &mut self.step;
        if !self.kkt.solve(form, &self.point.jacobian, (&right, &of_rows), &mut step.x, &mut step.y) {
            return false;
        }
        step.x.iter_mut().zip(&known).for_each(|(d, k)| *d += k);
        step.y.iter_mut().zip(&self.at.y).for_each(|(d, y)| *d += y);
        // Multipliers of the held bounds from the stationarity of the Lagrangian.
        self.work.clear();
        self.work.extend_from_slice(&self.point.gradient);
        form.add_transposed(&self.point.jacobian, &step.y, &mut self.work);
        add_product(form, &self.point.hessian, &step.x, &mut self.work);
        for j in 0..total {
            let shift = if j < n { self.kkt.shift } else { 0.0 };
            let z = self.work[j] + shift * step.x[j];
            step.lower[j] = if self.active.held[j] == Held::Lower { z } else { 0.0 };
            step.upper[j] = if self.active.held[j] == Held::Upper { -z } else { 0.0 };
        }
        true
    }

    /// The step with the working set held solves the quadratic program with all bounds.
    fn is_optimal(&mut self) -> bool {
        let signs =
            self.step.lower.iter().chain(&self.step.upper).all(|z| *z >= -MAX_MULTIPLIER_OF_WRONG_SIGN);
        signs && self.active.inside(self.form, &self.at.x, &self.step.x)
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
        let (form, point) = (&*self.form, &self.point);
        let (n, total) = (form.n, form.total());
        let curvature = form.hessian_entries.iter().zip(&point.hessian).map(|(&(i, j), &h)| (i, j, h));
        let diagonal = (0..n).map(|j| (j, j, shift));
        let slopes = form.jacobian_entries.iter().zip(&point.jacobian).map(|(&(i, j), &a)| (i, j, a));
        let slacks = form.slacks.iter().enumerate().map(|(j, slack)| (slack.row, n + j, slack.sign));
        let rows: Vec<f64> = point.rows.iter().map(|c| -c).collect();
        let gap = |bounds: &[f64]| -> Vec<f64> { (0..total).map(|j| bounds[j] - self.at.x[j]).collect() };
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
            if self.kkt.is_convex(self.form, &self.point.hessian, shift) {
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
