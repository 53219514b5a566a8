//! Levenberg-Marquardt for a weighted simulation or prediction error, with the weights estimated on the way.
//!
//! `min log det Lambda`, Lambda the covariance of the residuals (diagonal if the outputs are weighted one by one): the
//! maximum-likelihood criterion (Ljung, System Identification, 2nd ed., sec. 7.4 and 10.2). Every iteration minimizes
//! the sum of squares weighted by the inverse of the present Lambda; a lower sum has a lower criterion.

use nalgebra::{DMatrix, DVector};

use super::{Options, Outcome, Weighting};
use airloop_optim::linalg::{qr, triangular};

/// Residuals of all records, summed up.
#[derive(Debug, Clone)]
pub(super) struct Moments {
    /// Sum of `e e^T` over all samples, shape \[n_y, n_y\].
    pub sum: DMatrix<f64>,
    /// Number of samples.
    pub samples: usize,
}

impl Moments {
    pub(super) fn new(n_y: usize) -> Moments {
        Moments { sum: DMatrix::zeros(n_y, n_y), samples: 0 }
    }

    /// Adds residuals of shape \[n_y\]\[n\].
    pub(super) fn add(&mut self, residual: &[Vec<f64>]) {
        for (i, e_i) in residual.iter().enumerate() {
            for (l, e_l) in residual.iter().enumerate().take(i + 1) {
                let product = qr::dot(e_i, e_l);
                self.sum[(i, l)] += product;
                if l < i {
                    self.sum[(l, i)] += product;
                }
            }
        }
        self.samples += residual.first().map_or(0, Vec::len);
    }

    pub(super) fn covariance(&self) -> DMatrix<f64> {
        &self.sum / self.samples.max(1) as f64
    }

    /// Sum of the logarithms of the mean squares: what the iterations lower if every output has its own weight.
    pub(super) fn criterion(&self) -> f64 {
        self.covariance().diagonal().iter().map(|variance| variance.max(f64::MIN_POSITIVE).ln()).sum()
    }

    fn cost(&self, root: &DMatrix<f64>) -> f64 {
        (root * &self.sum * root.transpose()).trace()
    }
}

/// The derivative of the weighted residuals in triangular form: `|| R delta - z ||^2 + rest` is the weighted sum of
/// squares after a small step `delta`.
#[derive(Debug, Clone)]
pub(super) struct Linear<T> {
    pub r: DMatrix<f64>,
    pub z: DVector<f64>,
    pub rest: f64,
    /// Map from a step of the parameters to a step of the model.
    pub tangent: T,
}

impl<T> Linear<T> {
    /// From the factor of `[derivatives, residuals]`, shape \[p + 1, p + 1\].
    pub(super) fn of_factor(factor: &DMatrix<f64>, tangent: T) -> Linear<T> {
        let p = factor.ncols() - 1;
        Linear {
            r: factor.view((0, 0), (p, p)).into_owned(),
            z: factor.view((0, p), (p, 1)).column(0).into_owned(),
            rest: factor[(p, p)].powi(2),
            tangent,
        }
    }
}

/// Problem to minimize.
pub(super) trait Problem {
    /// A model.
    type Point: Clone;
    /// Directions in which it can go.
    type Tangent;
    /// Residuals with the best initial states for the weight `root^T root`; `None` where they are not finite.
    fn residuals(&self, point: &Self::Point, root: &DMatrix<f64>) -> Option<Moments>;
    /// Residuals and their derivatives, the initial states eliminated.
    fn linearize(&self, point: &Self::Point, root: &DMatrix<f64>) -> Linear<Self::Tangent>;
    /// The model after a step; `None` if it is not stable.
    fn step(&self, point: &Self::Point, tangent: &Self::Tangent, delta: &DVector<f64>)
    -> Option<Self::Point>;
    /// Mean square of every output, shape \[n_y\].
    fn power(&self) -> DVector<f64>;
}

/// `root` with `root^T root` the inverse of the covariance of the residuals. No output counts as more exact than nine
/// digits of its own size.
pub(super) fn weights(moments: &Moments, power: &DVector<f64>, weighting: Weighting) -> DMatrix<f64> {
    let mut covariance = moments.covariance();
    let n_y = covariance.nrows();
    for i in 0..n_y {
        let floor = f64::max(1e-18 * power[i], f64::MIN_POSITIVE);
        covariance[(i, i)] = covariance[(i, i)].max(floor);
    }
    let diagonal = DMatrix::from_diagonal(&covariance.diagonal().map(|variance| 1.0 / variance.sqrt()));
    match weighting {
        Weighting::Diagonal => diagonal,
        Weighting::Full => covariance
            .cholesky()
            .and_then(|factor| factor.l().solve_lower_triangular(&DMatrix::identity(n_y, n_y)))
            .unwrap_or(diagonal),
    }
}

/// Shares of a Gauss-Newton step that are tried before it is damped.
const SHARES: [f64; 3] = [1.0, 0.3, 0.1];

/// Result of the iterations.
#[derive(Debug, Clone)]
pub(super) struct Found<P> {
    pub point: P,
    pub moments: Moments,
    pub root: DMatrix<f64>,
    pub iterations: usize,
    pub outcome: Outcome,
}

/// Minimizes from a stable start. `None` if the residuals of the start are not finite.
pub(super) fn minimize<P: Problem>(
    problem: &P,
    start: P::Point,
    options: &Options,
) -> Option<Found<P::Point>> {
    let power = problem.power();
    let n_y = power.len();
    let mut point = start;
    let mut moments = problem.residuals(&point, &DMatrix::identity(n_y, n_y))?;
    let mut root = weights(&moments, &power, options.weighting);
    let mut damping = 1e-3;
    let mut slow = 0;
    for iteration in 0..options.iterations {
        let found = |point, moments, root, outcome| {
            Some(Found { point, moments, root, iterations: iteration, outcome })
        };
        let linear = problem.linearize(&point, &root);
        let p = linear.z.len();
        let explained = linear.z.norm_squared();
        let cost = explained + linear.rest;
        // Bates and Watts: the step still to go, in standard deviations of the estimate.
        let freedom = (n_y * moments.samples).saturating_sub(p).max(1) as f64;
        let offset = (explained / p.max(1) as f64).sqrt() / (linear.rest / freedom).sqrt();
        let exact = (0..n_y).all(|i| moments.covariance()[(i, i)] <= 1e-24 * power[i]);
        if offset < options.tolerance || exact {
            return found(point, moments, root, Outcome::Converged);
        }
        let try_step = |delta: &DVector<f64>| {
            let tried = problem.step(&point, &linear.tangent, delta)?;
            let moments = problem.residuals(&tried, &root)?;
            (moments.cost(&root) < cost).then_some((moments, tried))
        };
        // The Gauss-Newton step does not depend on the scale of the parameters, which damping does: coefficients of a
        // quickly sampled model are nearly collinear. Damping is for where the step leads astray.
        let newton = triangular::solve(&linear.r, &linear.z, 1e-11).0;
        let mut better = SHARES.iter().find_map(|share| try_step(&(&newton * *share)));
        while better.is_none() {
            better = try_step(&damped_step(&linear.r, &linear.z, damping));
            damping = if better.is_some() { f64::max(0.1 * damping, 1e-9) } else { 8.0 * damping };
            if damping > 1e8 {
                // No step lowers the cost: rounding hides what is left, or the border of stability is in the way.
                let outcome = if offset < 0.1 { Outcome::Converged } else { Outcome::Stalled };
                return found(point, moments, root, outcome);
            }
        }
        if let Some((next_moments, next)) = better {
            // The cost is about the number of residuals; by default a millionth of it, or a hundredth, is slow: the
            // latter is a tenth of a standard deviation.
            let gained = cost - next_moments.cost(&root);
            slow = if gained < options.tolerance * f64::max(0.01 * cost, 100.0) { slow + 1 } else { 0 };
            (moments, point) = (next_moments, next);
        }
        root = weights(&moments, &power, options.weighting);
        if slow == 2 {
            // A flat valley: the data leave a combination of the parameters open, the simulation no longer changes.
            return Some(Found { point, moments, root, iterations: iteration + 1, outcome: Outcome::Flat });
        }
    }
    Some(Found { point, moments, root, iterations: options.iterations, outcome: Outcome::IterationLimit })
}

/// `min || R delta - z ||^2 + damping || D delta ||^2`, D the norms of the columns of R.
fn damped_step(r: &DMatrix<f64>, z: &DVector<f64>, damping: f64) -> DVector<f64> {
    let p = z.len();
    let scales = triangular::column_scales(r);
    let mut stacked = DMatrix::zeros(2 * p, p);
    stacked.view_mut((0, 0), (p, p)).copy_from(r);
    for j in 0..p {
        stacked[(p + j, j)] = damping.sqrt() * scales[j];
    }
    let mut rhs = DVector::zeros(2 * p);
    rhs.rows_mut(0, p).copy_from(z);
    let qr = stacked.qr();
    qr.q_tr_mul(&mut rhs);
    let top = rhs.rows(0, p).into_owned();
    qr.unpack_r().solve_upper_triangular(&top).unwrap_or_else(|| DVector::zeros(p))
}
