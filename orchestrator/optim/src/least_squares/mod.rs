//! Nonlinear least squares with bounds: minimize `||r(p)||^2` over `lower <= p <= upper`.
//!
//! Levenberg-Marquardt on the free parameters (Moré 1978: columns scaled by their largest norm so far, each step from a
//! QR factorization of the Jacobian, never from normal equations); a parameter at a bound that the gradient pushes
//! outwards is held there. Local: start it from several points with [`multi_start`] and [`spread`]. What the
//! residuals are, and their weights, is left to the caller. Start with [`solve`].

mod start;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};

pub use start::{multi_start, spread};

/// Fills a Jacobian (shape \[m, n\]) at parameters (shape \[n\]).
pub type FillJacobian<'a> = &'a dyn Fn(&[f64], &mut DMatrix<f64>);

/// Problem to minimize.
pub struct Problem<'a> {
    /// Number of residuals m.
    pub residuals: usize,
    /// Lower bounds, shape \[n\]; negative infinity for none. Equal bounds fix a parameter.
    pub lower: &'a [f64],
    /// Upper bounds, shape \[n\]; infinity for none.
    pub upper: &'a [f64],
    /// Usual size of each parameter, shape \[n\], above zero: difference quotients and stop tests are relative to it
    /// where a parameter is smaller.
    pub scale: &'a [f64],
    /// Fills the residuals (shape \[m\]) at parameters (shape \[n\]); false if they cannot be evaluated there.
    pub evaluate: &'a dyn Fn(&[f64], &mut [f64]) -> bool,
    /// Fills the Jacobian `dr_i/dp_j`, shape \[m, n\]; central difference quotients if there is none.
    pub jacobian: Option<FillJacobian<'a>>,
}

/// Stopping criteria.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Most steps that are accepted.
    pub max_iterations: usize,
    /// Largest cosine between the residuals and a column of the Jacobian.
    pub gradient_tolerance: f64,
    /// Relative change of the parameters in a step.
    pub step_tolerance: f64,
    /// Relative change of the sum of squares in a step, found and predicted.
    pub cost_tolerance: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            max_iterations: 200,
            gradient_tolerance: 1e-10,
            step_tolerance: 1e-12,
            cost_tolerance: 1e-15,
        }
    }
}

/// Reason why the method stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The gradient vanishes along all parameters that are free to move.
    Gradient,
    /// Parameters or sum of squares no longer change.
    Settled,
    /// No shorter step makes the sum of squares smaller, though the gradient says so: the residuals are not smooth
    /// here, or not more exact.
    Stalled,
    /// As many steps as were allowed.
    Iterations,
}

impl Status {
    /// Whether the point is a minimum as far as the method can tell.
    pub fn converged(self) -> bool {
        matches!(self, Status::Gradient | Status::Settled)
    }
}

/// The point where the method stopped.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Parameters, shape \[n\].
    pub parameters: Vec<f64>,
    /// Residuals there, shape \[m\].
    pub residuals: Vec<f64>,
    /// Jacobian there, shape \[m, n\].
    pub jacobian: DMatrix<f64>,
    /// Sum of squared residuals.
    pub cost: f64,
    /// Whether each parameter is fixed, or held at a bound that the gradient pushes against, shape \[n\].
    pub held: Vec<bool>,
    /// Reason why the method stopped.
    pub status: Status,
    /// Steps that were accepted.
    pub iterations: usize,
}

/// Reason why a problem cannot be solved.
#[derive(Debug, thiserror::Error, PartialEq)]
#[allow(missing_docs, reason = "place and value, as named in each message")]
pub enum Error {
    /// Shapes differ.
    #[error("{what} has {found} entries, there are {expected} parameters")]
    Length { what: &'static str, found: usize, expected: usize },
    /// Bounds that leave nothing between them.
    #[error(
        "parameter {index}: the lower bound {lower} is above the upper bound {upper}, or one is not a number"
    )]
    Bounds { index: usize, lower: f64, upper: f64 },
    /// A scale is not above zero.
    #[error("parameter {index}: the scale {scale} must be above zero")]
    Scale { index: usize, scale: f64 },
    /// The start has no residuals.
    #[error("the residuals cannot be evaluated at the start {start:?}; start elsewhere or narrow the bounds")]
    Start { start: Vec<f64> },
    /// Columns of the Jacobian depend on each other.
    #[error("parameters {indices:?} cannot be told apart by the data; fix one of them or take richer data")]
    Dependent { indices: Vec<usize> },
    /// Too few residuals.
    #[error("{residuals} residuals do not determine {free} parameters and their scatter; take more data")]
    Few { residuals: usize, free: usize },
}

/// Minimizes the sum of squared residuals from one start, shape \[n\], which is clipped to the bounds.
///
/// ```
/// use airloop_optim::least_squares::{Problem, Settings, solve};
/// // r = p^2 - 2 with p >= 0
/// let evaluate = |p: &[f64], r: &mut [f64]| { r[0] = p[0] * p[0] - 2.0; true };
/// let (lower, upper, scale) = (&[0.0], &[9.0], &[1.0]);
/// let problem = Problem { residuals: 1, lower, upper, scale, evaluate: &evaluate, jacobian: None };
/// let root = solve(&problem, &[5.0], &Settings::default()).unwrap();
/// assert!((root.parameters[0] - 2f64.sqrt()).abs() < 1e-9);
/// ```
///
/// # Errors
/// Shapes, bounds or scales that do not fit, or a start without residuals. That the method stops early is a
/// [`Status`].
pub fn solve(problem: &Problem, start: &[f64], settings: &Settings) -> Result<Solution, Error> {
    problem.check(start)?;
    let n = start.len();
    let mut p: Vec<f64> = problem.clip(start);
    let mut r = DVector::zeros(problem.residuals);
    if !problem.residuals_at(&p, &mut r) {
        return Err(Error::Start { start: p });
    }
    let mut jacobian = DMatrix::zeros(problem.residuals, n);
    let mut trial = r.clone();
    let mut column_scale = vec![0.0f64; n];
    let (mut damping, mut growth, mut iterations) = (1e-3, 2.0, 0);
    problem.fill_jacobian(&p, &mut jacobian);
    let finish = |p: Vec<f64>, r: DVector<f64>, jacobian: DMatrix<f64>, status, iterations| {
        let held = problem.held(&p, &jacobian, &r);
        let cost = r.norm_squared();
        Ok(Solution { parameters: p, residuals: r.data.into(), jacobian, cost, held, status, iterations })
    };
    loop {
        let held = problem.held(&p, &jacobian, &r);
        let free: Vec<usize> = (0..n).filter(|&j| !held[j]).collect();
        let cost = r.norm_squared();
        let steepest = free.iter().map(|&j| cosine(&jacobian, j, &r)).fold(0.0, f64::max);
        if steepest <= settings.gradient_tolerance || cost == 0.0 {
            return finish(p, r, jacobian, Status::Gradient, iterations);
        }
        if iterations == settings.max_iterations {
            return finish(p, r, jacobian, Status::Iterations, iterations);
        }
        for &j in &free {
            let norm = jacobian.column(j).norm();
            column_scale[j] = column_scale[j].max(norm).max(f64::MIN_POSITIVE.sqrt());
        }
        let mut scaled = jacobian.select_columns(&free);
        for (mut column, &j) in scaled.column_iter_mut().zip(&free) {
            column /= column_scale[j];
        }
        let (triangle, projected) = reduce(scaled, &r);
        let accepted = loop {
            let step = damped_step(&triangle, &projected, damping);
            let mut to = p.clone();
            for (&j, step) in free.iter().zip(step.iter()) {
                to[j] += step / column_scale[j];
            }
            let to = problem.clip(&to);
            let taken =
                DVector::from_iterator(free.len(), free.iter().map(|&j| (to[j] - p[j]) * column_scale[j]));
            let predicted = projected.norm_squared() - (&projected + &triangle * &taken).norm_squared();
            let small = free
                .iter()
                .all(|&j| (to[j] - p[j]).abs() <= settings.step_tolerance * p[j].abs().max(problem.scale[j]));
            let reduction = if problem.residuals_at(&to, &mut trial) {
                cost - trial.norm_squared()
            } else {
                f64::NEG_INFINITY
            };
            let settled = small
                || (reduction.abs() <= settings.cost_tolerance * cost
                    && predicted.abs() <= settings.cost_tolerance * cost);
            if predicted > 0.0 && reduction > 1e-4 * predicted {
                let ratio = reduction / predicted;
                damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0);
                growth = 2.0;
                p = to;
                r.copy_from(&trial);
                break !settled;
            }
            if settled {
                return finish(p, r, jacobian, Status::Settled, iterations);
            }
            damping *= growth;
            growth *= 2.0;
            if damping > 1e20 {
                return finish(p, r, jacobian, Status::Stalled, iterations);
            }
        };
        iterations += 1;
        problem.fill_jacobian(&p, &mut jacobian);
        if !accepted {
            return finish(p, r, jacobian, Status::Settled, iterations);
        }
    }
}

/// R and Q'r of the QR factorization of `jacobian`; all zero rows where there are fewer residuals than columns.
fn reduce(jacobian: DMatrix<f64>, r: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let (m, n) = jacobian.shape();
    let jacobian = if m < n { jacobian.resize_vertically(n, 0.0) } else { jacobian };
    let mut rotated = r.clone().resize_vertically(m.max(n), 0.0);
    let qr = jacobian.qr();
    qr.q_tr_mul(&mut rotated);
    (qr.r(), rotated.rows(0, n).into_owned())
}

/// Minimizer of `||R s + q||^2 + damping ||s||^2`.
fn damped_step(triangle: &DMatrix<f64>, projected: &DVector<f64>, damping: f64) -> DVector<f64> {
    let n = projected.len();
    let mut stacked = DMatrix::zeros(2 * n, n);
    stacked.view_mut((0, 0), (n, n)).copy_from(triangle);
    stacked.view_mut((n, 0), (n, n)).fill_diagonal(damping.sqrt());
    let mut right = DVector::zeros(2 * n);
    right.rows_mut(0, n).copy_from(&(-projected));
    let qr = stacked.qr();
    qr.q_tr_mul(&mut right);
    let right = right.rows(0, n).into_owned();
    qr.r().solve_upper_triangular(&right).unwrap_or_else(|| DVector::zeros(n))
}

/// Cosine of the angle between column `j` and the residuals.
fn cosine(jacobian: &DMatrix<f64>, j: usize, r: &DVector<f64>) -> f64 {
    let size = jacobian.column(j).norm() * r.norm();
    if size > 0.0 { jacobian.column(j).dot(r).abs() / size } else { 0.0 }
}

impl Problem<'_> {
    fn check(&self, start: &[f64]) -> Result<(), Error> {
        let expected = start.len();
        let sizes = [("lower", self.lower.len()), ("upper", self.upper.len()), ("scale", self.scale.len())];
        if let Some(&(what, found)) = sizes.iter().find(|(_, size)| *size != expected) {
            return Err(Error::Length { what, found, expected });
        }
        for index in 0..expected {
            let (lower, upper, scale) = (self.lower[index], self.upper[index], self.scale[index]);
            if lower.is_nan() || upper.is_nan() || lower > upper {
                return Err(Error::Bounds { index, lower, upper });
            }
            if scale.is_nan() || scale <= 0.0 {
                return Err(Error::Scale { index, scale });
            }
        }
        Ok(())
    }

    fn clip(&self, p: &[f64]) -> Vec<f64> {
        let inside = |(p, (lower, upper)): (&f64, (&f64, &f64))| p.max(*lower).min(*upper);
        p.iter().zip(self.lower.iter().zip(self.upper)).map(inside).collect()
    }

    /// Evaluates; false as well if a residual is not finite.
    fn residuals_at(&self, p: &[f64], r: &mut DVector<f64>) -> bool {
        (self.evaluate)(p, r.as_mut_slice()) && r.iter().all(|value| value.is_finite())
    }

    fn fill_jacobian(&self, p: &[f64], jacobian: &mut DMatrix<f64>) {
        if let Some(fill) = self.jacobian {
            return fill(p, jacobian);
        }
        let mut at = p.to_vec();
        let (mut above, mut below) = (DVector::zeros(self.residuals), DVector::zeros(self.residuals));
        let mut here = None;
        for j in 0..p.len() {
            if self.lower[j] == self.upper[j] {
                jacobian.column_mut(j).fill(0.0);
                continue;
            }
            // The cube root of the rounding unit balances rounding against curvature.
            let step = f64::EPSILON.cbrt() * p[j].abs().max(self.scale[j]);
            let mut side = |to: f64, r: &mut DVector<f64>| {
                at[j] = to;
                let usable = to >= self.lower[j] && to <= self.upper[j] && self.residuals_at(&at, r);
                at[j] = p[j];
                if usable {
                    return to;
                }
                let here = here.get_or_insert_with(|| {
                    let mut r = DVector::zeros(self.residuals);
                    self.residuals_at(p, &mut r);
                    r
                });
                r.copy_from(here);
                p[j]
            };
            let width = side(p[j] + step, &mut above) - side(p[j] - step, &mut below);
            let factor = if width > 0.0 { 1.0 / width } else { 0.0 };
            for (entry, (above, below)) in jacobian.column_mut(j).iter_mut().zip(above.iter().zip(&below)) {
                *entry = (above - below) * factor;
            }
        }
    }

    /// Fixed parameters, and those at a bound that a descent would leave the box through.
    fn held(&self, p: &[f64], jacobian: &DMatrix<f64>, r: &DVector<f64>) -> Vec<bool> {
        (0..p.len())
            .map(|j| {
                let slope = jacobian.column(j).dot(r);
                self.lower[j] == self.upper[j]
                    || (p[j] <= self.lower[j] && slope >= 0.0)
                    || (p[j] >= self.upper[j] && slope <= 0.0)
            })
            .collect()
    }
}

impl Solution {
    /// Covariance of the parameters, shape \[n, n\]: `s^2 (J'J)^-1` over the parameters that are not held, zero in the
    /// rows of the others, with `s^2 = ||r||^2 / (m - free)` (Ljung, System Identification, section 9.6).
    ///
    /// # Errors
    /// [`Error::Dependent`] if the data do not tell parameters apart, [`Error::Few`] for too few residuals.
    pub fn covariance(&self) -> Result<DMatrix<f64>, Error> {
        let n = self.parameters.len();
        let free: Vec<usize> = (0..n).filter(|&j| !self.held[j]).collect();
        let (m, k) = (self.residuals.len(), free.len());
        if m <= k {
            return Err(Error::Few { residuals: m, free: k });
        }
        let mut scaled = self.jacobian.select_columns(&free);
        let norms: Vec<f64> = scaled.column_iter().map(|column| column.norm()).collect();
        if let Some(unseen) = norms.iter().position(|norm| *norm == 0.0) {
            return Err(Error::Dependent { indices: vec![free[unseen]] });
        }
        for (mut column, norm) in scaled.column_iter_mut().zip(&norms) {
            column /= *norm;
        }
        let triangle = scaled.qr().r();
        if let Some(last) = (0..k).find(|&j| triangle[(j, j)].abs() < 1e-9) {
            // The column is a combination of those before it.
            let before = triangle.view((0, 0), (last, last)).into_owned();
            let weights = before.solve_upper_triangular(&triangle.view((0, last), (last, 1)).into_owned());
            let part = |j: &usize| weights.as_ref().is_none_or(|weights| weights[(*j, 0)].abs() > 1e-3);
            let indices = (0..last).filter(part).chain([last]).map(|j| free[j]).collect();
            return Err(Error::Dependent { indices });
        }
        let inverse = triangle
            .solve_upper_triangular(&DMatrix::identity(k, k))
            .ok_or_else(|| Error::Dependent { indices: free.clone() })?;
        let small = &inverse * inverse.transpose() * (self.cost / (m - k) as f64);
        let mut covariance = DMatrix::zeros(n, n);
        for (a, &i) in free.iter().enumerate() {
            for (b, &j) in free.iter().enumerate() {
                covariance[(i, j)] = small[(a, b)] / (norms[a] * norms[b]);
            }
        }
        Ok(covariance)
    }
}
