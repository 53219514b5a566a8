//! Bounded Levenberg-Marquardt over all estimation records, each with local parameters of its own.
//!
//! Derivatives cost several times what residuals cost, so they serve for several steps as long as these gain what they
//! promise.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use super::normal::{Normal, cost, gradients, residuals};
use super::{System, parallel, stop};

/// A shared parameter that is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Free {
    /// Index in the parameter vector.
    pub index: usize,
    /// Bounds of the value.
    pub bounds: (f64, f64),
    /// Length of the difference step.
    pub step: f64,
    /// Standard deviation of what is known beforehand (around the start value zero), if anything.
    pub prior: Option<f64>,
}

/// A fitted model.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Parameter vector.
    pub parameters: Vec<f64>,
    /// Shared parameters that were fitted.
    pub free: Vec<Free>,
    /// Local parameters of every record of the fit.
    pub locals: Vec<Vec<f64>>,
    /// Sum of squared residuals, priors included.
    pub chi2: f64,
    /// Covariance of the free parameters for unit residuals, shape \[free, free\]; the local ones are accounted for.
    pub covariance: DMatrix<f64>,
    /// Whether a parameter stands at a bound.
    pub at_bound: Vec<bool>,
}

impl Fit {
    /// Of fits of local parameters, each to other records.
    pub(super) fn joined(p: &[f64], parts: Vec<Fit>) -> Fit {
        Fit {
            parameters: p.to_vec(),
            free: Vec::new(),
            chi2: parts.iter().map(|own| own.chi2).sum(),
            locals: parts.into_iter().flat_map(|own| own.locals).collect(),
            covariance: DMatrix::zeros(0, 0),
            at_bound: Vec::new(),
        }
    }
}

/// Mean square of the residuals above which a fit that hardly moves is given up.
const MAX_MEAN_SQUARE: f64 = 30.0;
/// Steps that one set of derivatives serves at most.
const STEPS_PER_JACOBIAN: usize = 4;
/// Share of what a step promised that it must gain for the derivatives to serve the next.
const MIN_GAIN_OVER_PROMISE: f64 = 0.8;
/// Renewals of the derivatives after a refused step, for each round of a fit at most: they count as no rounds, and in a
/// winding valley they have no end.
const MAX_RENEWALS_PER_ROUND: usize = 4;
/// Eigenvalue of scaled normal equations, over the largest, below which a direction is not determined.
const MIN_EIGENVALUE: f64 = 1e-11;
/// Share of a parameter in such directions from which on it is not determined.
const MAX_SHARE_LEFT_OPEN: f64 = 1e-6;
/// Gain that new derivatives may still promise when the old ones gain nothing more.
const MIN_PROMISE_OF_NEW_JACOBIAN: f64 = 0.02;

/// Solves the damped equations for the parameters that are not held at a bound; zero for those that are.
pub(super) fn damped_step(
    matrix: &DMatrix<f64>,
    right: &DVector<f64>,
    damping: f64,
    held: &[bool],
) -> Option<DVector<f64>> {
    let open: Vec<usize> = (0..right.len()).filter(|&i| !held.get(i).copied().unwrap_or(false)).collect();
    let part = DMatrix::from_fn(open.len(), open.len(), |a, b| {
        let value = matrix[(open[a], open[b])];
        if a == b { value * (1.0 + damping) + f64::MIN_POSITIVE.sqrt() } else { value }
    });
    let solved = Cholesky::new(part)?.solve(&DVector::from_fn(open.len(), |a, _| right[open[a]]));
    let mut step = DVector::zeros(right.len());
    for (a, &i) in open.iter().enumerate() {
        step[i] = solved[a];
    }
    Some(step)
}

/// Fits the shared parameters `free` and all local ones to `records`, from the start `p` and `locals`.
pub fn fit<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    p: &[f64],
    free: &[Free],
    locals: &[Vec<f64>],
    iterations: usize,
) -> Fit {
    // Without shared parameters the records have nothing to do with each other.
    if free.is_empty() && records.len() > 1 {
        let one = |i: usize| fit(system, &records[i..=i], p, free, &locals[i..=i], iterations);
        return Fit::joined(p, parallel::map(records.len(), one));
    }
    let (mut p, mut locals) = (p.to_vec(), locals.to_vec());
    for f in free {
        p[f.index] = p[f.index].clamp(f.bounds.0, f.bounds.1);
    }
    let mut damping = 1e-4;
    let count = |&record: &usize| system.signals(record).last().map_or(0, |span| span.range.end);
    let samples = records.iter().map(count).sum::<usize>() as f64;
    let mut normal = Normal::new(system, records, &p, free, &locals);
    let (mut round, mut refused, mut served, mut settled, mut renewed) = (0, 0, 0, false, 0);
    while round < iterations && refused < 6 && !stop::asked() {
        let (matrix, right, chi2) = (&normal.matrix, &normal.right, normal.chi2);
        let held = held_at_bounds(&p, free, right);
        let Some(step) = damped_step(matrix, right, damping, &held) else {
            damping = (damping * 10.0).max(1e-6);
            refused += 1;
            continue;
        };
        let (q, moved) = moved_by(&step, &p, free, &locals);
        let hoped = predicted(matrix, right, &step);
        if settled && hoped < MIN_PROMISE_OF_NEW_JACOBIAN {
            break;
        }
        let reached = residuals(system, records, &q, &moved);
        let new = cost(&q, free, &reached);
        if new.is_finite() && new < chi2 {
            (p, locals, refused) = (q, moved, 0);
            damping = (damping * 0.1).max(1e-9);
            let gained = chi2 - new;
            // Far from noise and hardly moving: this model will not explain the records. With parameters that are
            // known beforehand the way is long and narrow, and slow steps say nothing.
            let narrow = free.iter().any(|f| f.prior.is_some());
            let hopeless = !narrow && new > MAX_MEAN_SQUARE * samples && gained < 3e-3 * chi2;
            settled = gained < 2e-3 + 1e-8 * chi2;
            served += 1;
            if !settled && !hopeless && served < STEPS_PER_JACOBIAN && gained > MIN_GAIN_OVER_PROMISE * hoped
            {
                normal.moved(&p, free, reached);
            } else {
                // New ones at the end, too: for the covariance.
                let new = Normal::new(system, records, &p, free, &locals);
                // Asked to end, they are not complete: those of the step before tell more.
                if stop::asked() {
                    normal.moved(&p, free, reached);
                } else {
                    normal = new;
                }
                served = 0;
                round += 1;
            }
            if hopeless {
                break;
            }
        } else {
            if chi2.is_finite() && hoped < 0.01 {
                break;
            }
            if served > 0 {
                let new = Normal::new(system, records, &p, free, &locals);
                if stop::asked() {
                    break;
                }
                normal = new;
                served = 0;
                renewed += 1;
                if renewed >= MAX_RENEWALS_PER_ROUND * iterations {
                    break;
                }
                continue;
            }
            damping = (damping * 10.0).max(1e-3);
            refused += 1;
        }
    }
    let Normal { matrix, right, chi2, .. } = normal;
    assembled(p, free, locals, &matrix, &right, chi2)
}

/// The fit at a point with its normal equations.
pub(super) fn assembled(
    p: Vec<f64>,
    free: &[Free],
    locals: Vec<Vec<f64>>,
    matrix: &DMatrix<f64>,
    right: &DVector<f64>,
    chi2: f64,
) -> Fit {
    let at_bound = free.iter().map(|f| p[f.index] <= f.bounds.0 || p[f.index] >= f.bounds.1).collect();
    let covariance = covariance(matrix, free.len(), &held_at_bounds(&p, free, right));
    Fit { parameters: p, free: free.to_vec(), locals, chi2, covariance, at_bound }
}

/// Whether each parameter stands at a bound that the gradient presses it against.
pub(super) fn held_at_bounds(p: &[f64], free: &[Free], right: &DVector<f64>) -> Vec<bool> {
    let held = |(a, f): (usize, &Free)| {
        (p[f.index] <= f.bounds.0 && right[a] < 0.0) || (p[f.index] >= f.bounds.1 && right[a] > 0.0)
    };
    free.iter().enumerate().map(held).collect()
}

/// Shared parameters, within their bounds, and local ones after a step, shape \[free + locals\].
pub(super) fn moved_by(
    step: &DVector<f64>,
    p: &[f64],
    free: &[Free],
    locals: &[Vec<f64>],
) -> (Vec<f64>, Vec<Vec<f64>>) {
    let (mut q, mut moved) = (p.to_vec(), locals.to_vec());
    for (a, f) in free.iter().enumerate() {
        q[f.index] = (p[f.index] + step[a]).clamp(f.bounds.0, f.bounds.1);
    }
    moved.iter_mut().flatten().zip(step.iter().skip(free.len())).for_each(|(own, step)| *own += step);
    (q, moved)
}

/// Covariance of the free parameters by the scatter of the records around the common optimum, for residuals that are
/// not white: each record counts as one observation of the gradient. Once the search is asked to end, that for white
/// ones.
pub fn scatter<S: System + ?Sized>(system: &S, records: &[usize], fit: &Fit) -> DMatrix<f64> {
    let gradients = gradients(system, records, &fit.parameters, &fit.free, &fit.locals);
    if stop::asked() {
        return fit.covariance.clone();
    }
    let ng = fit.free.len();
    let mut spread = DMatrix::zeros(ng, ng);
    for own in &gradients {
        spread += own * own.transpose();
    }
    let n = gradients.len() as f64;
    &fit.covariance * spread * &fit.covariance * (n / (n - 1.0).max(1.0))
}

/// Gain of a step in the linear model.
pub(super) fn predicted(matrix: &DMatrix<f64>, right: &DVector<f64>, step: &DVector<f64>) -> f64 {
    2.0 * step.dot(right) - (matrix * step).dot(step)
}

/// Inverse of a symmetric matrix with a unit diagonal over the directions that it determines; no numbers in the rows
/// and columns of what it leaves open.
fn determined(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    if matrix.iter().any(|own| !own.is_finite()) {
        return DMatrix::from_element(n, n, f64::NAN);
    }
    let own = SymmetricEigen::new(matrix);
    let least = MIN_EIGENVALUE * own.eigenvalues.amax();
    let mut inverse = DMatrix::zeros(n, n);
    let mut open = DVector::<f64>::zeros(n);
    for (value, vector) in own.eigenvalues.iter().zip(own.eigenvectors.column_iter()) {
        if *value > least {
            inverse += vector * vector.transpose() / *value;
        } else {
            open += vector.component_mul(&vector);
        }
    }
    for i in (0..n).filter(|&i| open[i] > MAX_SHARE_LEFT_OPEN) {
        inverse.row_mut(i).fill(f64::NAN);
        inverse.column_mut(i).fill(f64::NAN);
    }
    inverse
}

/// Covariance of the first `ng` parameters; those held have none.
fn covariance(matrix: &DMatrix<f64>, ng: usize, held: &[bool]) -> DMatrix<f64> {
    let open: Vec<usize> = (0..matrix.nrows()).filter(|&i| !held.get(i).copied().unwrap_or(false)).collect();
    let part = DMatrix::from_fn(open.len(), open.len(), |a, b| matrix[(open[a], open[b])]);
    let mut found = DMatrix::zeros(ng, ng);
    // Scaled to a unit diagonal: parameters differ by orders of magnitude.
    let scale: Vec<f64> = (0..open.len()).map(|a| part[(a, a)].max(1e-300).sqrt()).collect();
    let scaled = DMatrix::from_fn(open.len(), open.len(), |a, b| {
        part[(a, b)] / (scale[a] * scale[b]) + if a == b { 1e-12 } else { 0.0 }
    });
    let inverse = Cholesky::new(scaled.clone()).map_or_else(|| determined(scaled), |own| own.inverse());
    for (a, &i) in open.iter().enumerate().filter(|(_, i)| **i < ng) {
        for (b, &j) in open.iter().enumerate().filter(|(_, j)| **j < ng) {
            found[(i, j)] = inverse[(a, b)] / (scale[a] * scale[b]);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::system::testing::Lines;

    fn free(index: usize, bounds: (f64, f64)) -> Free {
        Free { index, bounds, step: 1e-4, prior: None }
    }

    #[test]
    fn a_slope_with_an_offset_per_record_has_the_closed_form_of_least_squares() {
        let system = Lines::new(3.0, 0.0);
        let start = vec![vec![0.0]; 2];
        let found = fit(&system, &[0, 1], &[0.0, 0.0], &[free(0, (-10.0, 10.0))], &start, 20);
        let (mut numerator, mut denominator) = (0.0, 0.0);
        for record in &system.values[..2] {
            let (n, mean) = (record.len() as f64, record.iter().sum::<f64>() / record.len() as f64);
            for (k, y) in record.iter().enumerate() {
                let t = k as f64 / n - (n - 1.0) / (2.0 * n);
                numerator += t * (y - mean);
                denominator += t * t;
            }
        }
        // The fit ends when a step gains less than 2e-3: some hundredths of the standard deviation.
        assert!((found.parameters[0] - numerator / denominator).abs() < 0.02 / f64::sqrt(denominator));
        assert!((found.covariance[(0, 0)] * denominator - 1.0).abs() < 1e-5);
    }

    #[test]
    fn local_parameters_alone_are_those_of_each_record_alone() {
        let system = Lines::new(3.0, 0.0);
        let found = fit(&system, &[0, 1], &[3.0, 0.0], &[], &[vec![7.0], vec![-9.0]], 20);
        for (r, own) in found.locals.iter().enumerate() {
            let values = system.predict(r, &[3.0, 0.0], &[0.0]);
            let mean = system.values[r].iter().zip(&values).map(|(y, line)| y - line).sum::<f64>() / 512.0;
            assert!((own[0] - mean).abs() < 0.02 / f64::sqrt(512.0), "{} {mean}", own[0]);
        }
        let residuals = residuals(&system, &[0, 1], &[3.0, 0.0], &found.locals);
        assert!((cost(&[3.0, 0.0], &[], &residuals) / found.chi2 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_equations_leave_open_leaves_the_rest_its_covariance() {
        // The first two parameters only as a sum, the third by itself.
        let matrix = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let found = determined(matrix);
        assert!(found[(0, 0)].is_nan() && found[(1, 1)].is_nan(), "{found}");
        assert!((found[(2, 2)] - 1.0).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_bound_is_kept_and_told() {
        let system = Lines::new(3.0, 0.0);
        let found = fit(&system, &[0, 1], &[0.0, 0.0], &[free(0, (-1.0, 2.0))], &[vec![0.0], vec![0.0]], 20);
        assert_eq!((found.parameters[0], found.at_bound[0]), (2.0, true));
    }
}
