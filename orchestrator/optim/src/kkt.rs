//! The KKT matrix: assembly with slacks eliminated, factorization, correction of the inertia, solution with
//! iterative refinement.

use super::error::Error;
use super::form::Form;
use crate::linalg::sparse_ldl::SparseLdl;
use crate::linalg::staged_ldl::StagedLdl;
use crate::linalg::symmetric::Inertia;

/// Up to this size a problem without stages is factorized densely.
const MAX_DENSE_SIZE: usize = 300;
const MAX_REFINEMENTS: usize = 10;
/// Backward error at which refinement ends, and above which the factorization counts as singular.
const MAX_ERROR_WHEN_REFINED: f64 = 1e-13;
const MIN_ERROR_WHEN_SINGULAR: f64 = 1e-5;

/// Added to the diagonals where pivots are not exchanged; refinement removes its effect.
const STATIC_REGULARIZATION: f64 = 1e-9;

/// Part of a step below which the next Hessian is shifted, and how the shift grows and decays. On the swing-up these
/// save a third of the iterations.
const SHORT_STEP: f64 = 0.1;
const SMALLEST_SHIFT: f64 = 1e-4;
const LARGEST_SHIFT: f64 = 1e4;
const SHIFT_GROWTH: f64 = 4.0;
const SHIFT_DECAY: f64 = 10.0;

#[derive(Debug)]
enum Ldl {
    Staged(Box<StagedLdl>),
    Sparse(Box<SparseLdl>),
}

/// `[[W + diag(d), J^T], [J, -r]]` in X = (x, s) and the rows; r = `row_shift`.
#[derive(Debug)]
pub(super) struct Kkt {
    ldl: Ldl,
    entries: Vec<(usize, usize)>,
    values: Vec<f64>,
    n: usize,
    m: usize,
    /// Numbers that were added to the diagonals at the last factorization.
    pub shift: f64,
    pub row_shift: f64,
    /// Shift that is tried first.
    pub least_shift: f64,
    /// The last shift that was needed, 0 before any.
    last: f64,
    /// Diagonal of X with shift, and which of X stay as they are.
    diagonal: Vec<f64>,
    held: Vec<bool>,
    work: Work,
    pub factorizations: usize,
}

#[derive(Debug, Default)]
struct Work {
    reduced: Vec<f64>,
    residual: Vec<f64>,
    correction: Vec<f64>,
    inverse: Vec<f64>,
    norms: Vec<f64>,
}

/// No shift makes the matrix have the inertia of a minimum.
#[derive(Debug)]
pub(super) struct Uncorrectable;

impl Kkt {
    pub fn new(form: &Form) -> Result<Self, Error> {
        let (n, m) = (form.n, form.m);
        let mut entries: Vec<(usize, usize)> = form.hessian_entries.clone();
        entries.extend(form.jacobian_entries.iter().map(|&(row, column)| (n + row, column)));
        entries.extend((0..n + m).map(|i| (i, i)));
        let ldl = match form.stages()? {
            Some(stages) => Ldl::Staged(Box::new(StagedLdl::new(&entries, &stages)?)),
            None if n + m <= MAX_DENSE_SIZE => {
                Ldl::Staged(Box::new(StagedLdl::new(&entries, &vec![0; n + m])?))
            }
            None => Ldl::Sparse(Box::new(SparseLdl::new(&entries, n + m)?)),
        };
        let values = vec![0.0; entries.len()];
        Ok(Self {
            ldl,
            entries,
            values,
            n,
            m,
            shift: 0.0,
            row_shift: 0.0,
            least_shift: 0.0,
            last: 0.0,
            diagonal: Vec::new(),
            held: Vec::new(),
            work: Work::default(),
            factorizations: 0,
        })
    }

    /// Forgets what earlier runs needed.
    pub fn restart(&mut self) {
        self.restart_shifts();
        self.factorizations = 0;
    }

    /// Forgets the shifts of another run.
    pub fn restart_shifts(&mut self) {
        (self.last, self.least_shift) = (0.0, 0.0);
    }

    /// A short part of a step says that the quadratic model reaches less far than the step: the next Hessian is
    /// shifted at least a little, the more the oftener, as a trust region would do; full steps undo it.
    pub fn adapt(&mut self, part: f64) {
        let shift = &mut self.least_shift;
        if part < SHORT_STEP {
            *shift = (SHIFT_GROWTH * *shift).clamp(SMALLEST_SHIFT, LARGEST_SHIFT);
        } else {
            *shift /= SHIFT_DECAY;
            if *shift < 0.05 * SMALLEST_SHIFT {
                *shift = 0.0;
            }
        }
    }

    /// Factorizes with the smallest shift of the Hessian found that gives the inertia of a minimum. `diagonal` is
    /// added to the Hessian of X; `held` says which of X do not move. `barrier` sets the shift of the rows where
    /// they depend on each other.
    pub fn factor(
        &mut self,
        form: &Form,
        hessian: &[f64],
        jacobian: &[f64],
        diagonal: &[f64],
        held: impl Fn(usize) -> bool,
        barrier: f64,
    ) -> Result<(), Uncorrectable> {
        self.held.clear();
        self.held.extend((0..form.total()).map(held));
        let (mut shift, mut row_shift) = (self.least_shift, 0.0);
        let dependent = 1e-8 * barrier.max(1e-12).powf(0.25);
        let wanted = Inertia { positive: self.n, negative: self.m, zero: 0 };
        loop {
            let inertia = self.try_shift(form, hessian, jacobian, diagonal, shift, row_shift);
            if inertia == wanted {
                if shift > 0.0 {
                    self.last = shift;
                }
                return Ok(());
            }
            if (inertia.zero > 0 || inertia.negative < self.m) && row_shift == 0.0 {
                row_shift = dependent;
                if inertia.zero > 0 {
                    continue;
                }
            }
            shift = match (shift, self.last) {
                (0.0, 0.0) => 1e-4,
                (0.0, last) => (last / 3.0).max(1e-20),
                (shift, 0.0) => 100.0 * shift,
                (shift, _) => 8.0 * shift,
            };
            if shift > 1e20 || !shift.is_finite() {
                self.last = 0.0;
                return Err(Uncorrectable);
            }
        }
    }

    /// Raises the shift of the matrix that was factorized last, which proved useless.
    pub fn raise(
        &mut self,
        form: &Form,
        hessian: &[f64],
        jacobian: &[f64],
        diagonal: &[f64],
        barrier: f64,
    ) -> Result<(), Uncorrectable> {
        let shift = if self.shift == 0.0 { 1e-4 } else { 8.0 * self.shift };
        let row_shift = 1e-8 * barrier.max(1e-12).powf(0.25);
        let wanted = Inertia { positive: self.n, negative: self.m, zero: 0 };
        let mut shift = shift;
        while shift < 1e20 {
            if self.try_shift(form, hessian, jacobian, diagonal, shift, row_shift) == wanted {
                return Ok(());
            }
            shift *= 8.0;
        }
        Err(Uncorrectable)
    }

    /// Factorizes again with a larger shift of the Hessian; false where the inertia is not that of a minimum.
    pub fn shift_to(
        &mut self,
        form: &Form,
        hessian: &[f64],
        jacobian: &[f64],
        diagonal: &[f64],
        shift: f64,
    ) -> bool {
        let wanted = Inertia { positive: self.n, negative: self.m, zero: 0 };
        self.try_shift(form, hessian, jacobian, diagonal, shift, self.row_shift) == wanted
    }

    /// The Hessian with a shift is positive definite in those of x that are not fixed.
    pub fn is_convex(&mut self, form: &Form, hessian: &[f64], shift: f64) -> bool {
        self.held.clear();
        self.held.extend((0..form.total()).map(|j| form.fixed(j)));
        let no_slopes = vec![0.0; form.jacobian_entries.len()];
        let nothing = vec![0.0; form.total()];
        // Without slopes the rows are the negative part of a block diagonal.
        let inertia = self.try_shift(form, hessian, &no_slopes, &nothing, shift, 1.0);
        inertia == Inertia { positive: self.n, negative: self.m, zero: 0 }
    }

    fn try_shift(
        &mut self,
        form: &Form,
        hessian: &[f64],
        jacobian: &[f64],
        diagonal: &[f64],
        shift: f64,
        row_shift: f64,
    ) -> Inertia {
        let (n, m) = (self.n, self.m);
        (self.shift, self.row_shift) = (shift, row_shift);
        self.diagonal.clear();
        self.diagonal.extend(diagonal.iter().map(|d| d + shift));
        let (curvature, rest) = self.values.split_at_mut(hessian.len());
        let (slopes, diagonals) = rest.split_at_mut(jacobian.len());
        let held = &self.held;
        for ((value, h), &(i, j)) in curvature.iter_mut().zip(hessian).zip(&self.entries) {
            *value = if held[i] || held[j] { 0.0 } else { *h };
        }
        for ((value, a), &(_, j)) in slopes.iter_mut().zip(jacobian).zip(&form.jacobian_entries) {
            *value = if held[j] { 0.0 } else { *a };
        }
        for i in 0..n {
            diagonals[i] = if held[i] { 1.0 } else { self.diagonal[i] };
        }
        diagonals[n..].fill(-row_shift);
        self.work.inverse.clear();
        for (j, slack) in form.slacks.iter().enumerate() {
            let inverse = if held[n + j] { 0.0 } else { 1.0 / self.diagonal[n + j].max(1e-16) };
            self.work.inverse.push(inverse);
            diagonals[n + slack.row] -= inverse;
        }
        debug_assert_eq!(diagonals.len(), n + m);
        self.factorizations += 1;
        match &mut self.ldl {
            Ldl::Staged(ldl) => ldl.factor(&self.values),
            Ldl::Sparse(ldl) => {
                diagonals[..n].iter_mut().for_each(|d| *d += STATIC_REGULARIZATION);
                diagonals[n..].iter_mut().for_each(|d| *d -= STATIC_REGULARIZATION);
                ldl.factor(&self.values)
            }
        }
    }

    /// Solves `(W + D) dX + J^T dy = gradient`, `J dX - r dy = rows` with the last factorization; those of X that are
    /// held stay zero. False: the solution is useless.
    pub fn solve(
        &mut self,
        form: &Form,
        jacobian: &[f64],
        right: (&[f64], &[f64]),
        step: &mut [f64],
        y: &mut [f64],
    ) -> bool {
        step.fill(0.0);
        y.fill(0.0);
        let mut work = std::mem::take(&mut self.work);
        let total = form.total();
        work.residual.clear();
        work.residual.extend_from_slice(right.0);
        work.residual.extend_from_slice(right.1);
        self.clear_held(&mut work.residual);
        let size = largest(&work.residual);
        let mut best = f64::INFINITY;
        for _ in 0..=MAX_REFINEMENTS {
            self.solve_once(form, &mut work);
            step.iter_mut().zip(&work.correction[..total]).for_each(|(d, c)| *d += c);
            y.iter_mut().zip(&work.correction[total..]).for_each(|(d, c)| *d += c);
            self.residual(form, jacobian, right, step, y, &mut work);
            self.clear_held(&mut work.residual);
            let error = largest(&work.residual) / (size + largest(&work.norms)).max(1e-300);
            if !error.is_finite() {
                best = f64::INFINITY;
                break;
            }
            let stuck = error > 0.3 * best;
            best = best.min(error);
            if best <= MAX_ERROR_WHEN_REFINED || stuck {
                break;
            }
        }
        self.work = work;
        best <= MIN_ERROR_WHEN_SINGULAR
    }

    fn clear_held(&self, vector: &mut [f64]) {
        vector.iter_mut().zip(&self.held).filter(|(_, held)| **held).for_each(|(value, _)| *value = 0.0);
    }

    /// One solution for the residual, into the correction.
    fn solve_once(&mut self, form: &Form, work: &mut Work) {
        let (n, total) = (self.n, form.total());
        let (gradient, rows) = work.residual.split_at(total);
        work.reduced.clear();
        work.reduced.extend_from_slice(&gradient[..n]);
        work.reduced.extend_from_slice(rows);
        for ((slack, inverse), g) in form.slacks.iter().zip(&work.inverse).zip(&gradient[n..]) {
            work.reduced[n + slack.row] -= slack.sign * inverse * g;
        }
        match &mut self.ldl {
            Ldl::Staged(ldl) => ldl.solve(&mut work.reduced),
            Ldl::Sparse(ldl) => ldl.solve(&mut work.reduced),
        }
        work.correction.clear();
        work.correction.extend_from_slice(&work.reduced[..n]);
        for ((slack, inverse), g) in form.slacks.iter().zip(&work.inverse).zip(&gradient[n..]) {
            work.correction.push(inverse * (g - slack.sign * work.reduced[n + slack.row]));
        }
        work.correction.extend_from_slice(&work.reduced[n..]);
    }

    /// Residual of the system before elimination, and the size of what it sums up.
    fn residual(
        &self,
        form: &Form,
        jacobian: &[f64],
        right: (&[f64], &[f64]),
        step: &[f64],
        y: &[f64],
        work: &mut Work,
    ) {
        let total = form.total();
        work.residual.clear();
        work.residual.extend_from_slice(right.0);
        work.residual.extend_from_slice(right.1);
        work.norms.clear();
        work.norms.resize(total + self.m, 0.0);
        let (r, norms) = (&mut work.residual, &mut work.norms);
        let mut subtract = |i: usize, term: f64| {
            r[i] -= term;
            norms[i] = norms[i].max(term.abs());
        };
        for (&(i, j), h) in form.hessian_entries.iter().zip(&self.values) {
            subtract(i, h * step[j]);
            if i != j {
                subtract(j, h * step[i]);
            }
        }
        for (j, (d, x)) in self.diagonal.iter().zip(step).enumerate() {
            subtract(j, d * x);
        }
        for (&(row, column), a) in form.jacobian_entries.iter().zip(jacobian) {
            subtract(column, a * y[row]);
            subtract(total + row, a * step[column]);
        }
        for (j, slack) in form.slacks.iter().enumerate() {
            subtract(self.n + j, slack.sign * y[slack.row]);
            subtract(total + slack.row, slack.sign * step[self.n + j]);
        }
        for (row, y) in y.iter().enumerate() {
            subtract(total + row, -self.row_shift * y);
        }
    }
}

fn largest(vector: &[f64]) -> f64 {
    vector.iter().fold(0.0, |m, v| if v.is_nan() { f64::NAN } else { m.max(v.abs()) })
}
