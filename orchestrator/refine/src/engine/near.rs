//! Fits near a point whose derivatives are known: a step costs one simulation of every record instead of one for every
//! parameter.
//!
//! Gauss-Newton with frozen derivatives (the chord method) ends where these, not the true ones, meet the residuals. Close to
//! the point that makes no difference; far from it the fit says so.

use super::fit::{Fit, Free, covariance, damped_step, predicted};
use super::normal::{Columns, Normal, cost, residuals};
use super::{System, stop};

/// Steps at most.
const ROUNDS: usize = 6;
/// Steps in a row that may fail.
const MAX_REFUSED: usize = 2;
/// Gain of a step, as a share of the sum of squares, below which nothing moves any more.
const MIN_GAIN: f64 = 1e-4;
/// Share of its promise that the first step has to gain for the derivatives to hold.
const MIN_GAIN_OVER_PROMISE: f64 = 0.5;

/// A fit with frozen derivatives.
pub struct Near {
    /// The fit; its covariance is that of the derivatives that were given.
    pub fit: Fit,
    /// Whether every step gained what the derivatives promise, and the last had little to gain.
    pub settled: bool,
}

/// Fits `free` and all local parameters with the derivatives `columns` of a point nearby, each \[free + locals of the
/// record\], from the start `p` and `locals`.
pub fn fit_near<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    p: &[f64],
    free: &[Free],
    locals: &[Vec<f64>],
    columns: Vec<Columns>,
) -> Near {
    let (mut p, mut locals) = (p.to_vec(), locals.to_vec());
    let mut normal = Normal::near(columns, &p, free, &locals, residuals(system, records, &p, &locals));
    let (mut damping, mut refused, mut settled, mut held_promise) = (1e-6, 0, false, true);
    for _ in 0..ROUNDS {
        if stop::asked() || refused > MAX_REFUSED || !normal.chi2.is_finite() {
            break;
        }
        let held: Vec<bool> = free
            .iter()
            .enumerate()
            .map(|(a, f)| {
                (p[f.index] <= f.bounds.0 && normal.right[a] < 0.0)
                    || (p[f.index] >= f.bounds.1 && normal.right[a] > 0.0)
            })
            .collect();
        let Some(step) = damped_step(&normal.matrix, &normal.right, damping, &held) else { break };
        let hoped = predicted(&normal.matrix, &normal.right, &step);
        if hoped < MIN_GAIN * normal.chi2 {
            settled = held_promise;
            break;
        }
        let (mut q, mut moved) = (p.clone(), locals.clone());
        for (a, f) in free.iter().enumerate() {
            q[f.index] = (p[f.index] + step[a]).clamp(f.bounds.0, f.bounds.1);
        }
        moved.iter_mut().flatten().zip(step.iter().skip(free.len())).for_each(|(own, step)| *own += step);
        let reached = residuals(system, records, &q, &moved);
        let gained = normal.chi2 - cost(&q, free, &reached);
        held_promise &= gained > MIN_GAIN_OVER_PROMISE * hoped;
        if gained > 0.0 {
            (p, locals, refused) = (q, moved, 0);
            damping = (damping * 0.1f64).max(1e-9);
            normal.moved(&p, free, reached);
        } else {
            damping = (damping * 100.0).max(1e-2);
            refused += 1;
        }
    }
    let at_bound: Vec<bool> =
        free.iter().map(|f| p[f.index] <= f.bounds.0 || p[f.index] >= f.bounds.1).collect();
    let covariance = covariance(&normal.matrix, free.len(), &at_bound);
    let chi2 = normal.chi2;
    Near { fit: Fit { parameters: p, free: free.to_vec(), locals, chi2, covariance, at_bound }, settled }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::fit::fit;
    use crate::engine::normal::columns;
    use crate::engine::system::testing::Lines;

    #[test]
    fn a_linear_system_is_fitted_in_one_step_as_with_fresh_derivatives() {
        let system = Lines::new(3.0, 0.0);
        let free = [Free { index: 0, bounds: (-10.0, 10.0), step: 1e-4, prior: None }];
        let start = vec![vec![0.0]; 2];
        let locals: Vec<&[f64]> = start.iter().map(Vec::as_slice).collect();
        let known = columns(&system, &[0, 1], &[1.0, 0.0], &free, &locals, true, None);
        let near = fit_near(&system, &[0, 1], &[0.0, 0.0], &free, &start, known);
        let fresh = fit(&system, &[0, 1], &[0.0, 0.0], &free, &start, 20);
        assert!(near.settled);
        assert!((near.fit.chi2 / fresh.chi2 - 1.0).abs() < 1e-4, "{} {}", near.fit.chi2, fresh.chi2);
        assert!((near.fit.parameters[0] - fresh.parameters[0]).abs() < 1e-2);
    }
}
