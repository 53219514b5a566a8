//! Fits near a point whose derivatives are known: a step costs one simulation of every record instead of one for every
//! parameter.
//!
//! Gauss-Newton with frozen derivatives (the chord method) ends where these, not the true ones, are orthogonal to the
//! residuals. Close to the point that makes no difference; far from it the fit says so.

use super::fit::{Fit, Free, assembled, damped_step, held_at_bounds, moved_by, predicted};
use super::normal::{Columns, Normal, cost, residuals};
use super::{System, stop};

/// Steps at most.
const ROUNDS: usize = 6;
/// Steps in a row that may fail.
const MAX_REFUSED: usize = 2;
/// Gain of a step, as a share of the sum of squares, below which nothing moves any more.
const MIN_GAIN: f64 = 1e-4;
/// Share of its predicted gain that every step has to reach for the derivatives to hold.
const MIN_GAIN_OVER_PROMISE: f64 = 0.5;

/// A fit with frozen derivatives.
pub struct Near {
    /// The fit; its covariance is that of the derivatives that were given.
    pub fit: Fit,
    /// Whether every step gained as much as the derivatives predict, and the last had next to nothing left to gain.
    pub settled: bool,
}

/// Fits the shared parameters `free` and all local ones to `records`, from the start `p` and `locals`, with the
/// derivatives of a point nearby.
///
/// | name | shape | meaning |
/// |------|-------|---------|
/// | `p` | \[parameters\] | start of the shared parameters |
/// | `locals` | \[records\]\[locals\] | start of the local ones |
/// | `columns` | \[records\] of \[free + locals\]\[samples\] | derivatives of whitened residuals; the rest unread |
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
    let (mut damping, mut refused, mut settled, mut gained_as_promised) = (1e-6, 0, false, true);
    for _ in 0..ROUNDS {
        if stop::asked() || refused > MAX_REFUSED || !normal.chi2.is_finite() {
            break;
        }
        let held = held_at_bounds(&p, free, &normal.right);
        let Some(step) = damped_step(&normal.matrix, &normal.right, damping, &held) else { break };
        let hoped = predicted(&normal.matrix, &normal.right, &step);
        if hoped < MIN_GAIN * normal.chi2 {
            settled = gained_as_promised;
            break;
        }
        let (q, moved) = moved_by(&step, &p, free, &locals);
        let reached = residuals(system, records, &q, &moved);
        let gained = normal.chi2 - cost(&q, free, &reached);
        gained_as_promised &= gained > MIN_GAIN_OVER_PROMISE * hoped;
        if gained > 0.0 {
            (p, locals, refused) = (q, moved, 0);
            damping = (damping * 0.1f64).max(1e-9);
            normal.moved(&p, free, reached);
        } else {
            damping = (damping * 100.0).max(1e-2);
            refused += 1;
        }
    }
    let fit = assembled(p, free, locals, &normal.matrix, &normal.right, normal.chi2);
    Near { fit, settled }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::fit::fit;
    use crate::engine::normal::columns;
    use crate::engine::system::testing::Lines;

    const START: [f64; 2] = [0.0, 0.0];
    const FREE: [Free; 1] = [Free { index: 0, bounds: (-10.0, 10.0), step: 1e-4, prior: None }];

    /// Derivatives away from the start, those by the slope `factor` times too large.
    fn known(system: &Lines, locals: &[Vec<f64>], factor: f64) -> Vec<Columns> {
        let locals: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
        let mut found = columns(system, &[0, 1], &[1.0, 0.0], &FREE, &locals, true, None);
        found.iter_mut().flat_map(|own| &mut own.columns[0]).for_each(|value| *value *= factor);
        found
    }

    #[test]
    fn a_linear_system_is_fitted_as_with_fresh_derivatives() {
        let system = Lines::new(3.0, 0.0);
        let start = vec![vec![0.0]; 2];
        let near = fit_near(&system, &[0, 1], &START, &FREE, &start, known(&system, &start, 1.0));
        let fresh = fit(&system, &[0, 1], &START, &FREE, &start, 20);
        assert!(near.settled);
        assert!((near.fit.chi2 / fresh.chi2 - 1.0).abs() < 1e-4, "{} {}", near.fit.chi2, fresh.chi2);
        assert!((near.fit.parameters[0] - fresh.parameters[0]).abs() < 1e-2);
    }

    #[test]
    fn derivatives_that_do_not_hold_are_told() {
        // At the offsets of the records only the slope is wrong, and a tenth of its derivative leads ten times too far.
        let system = Lines::new(300.0, 0.0);
        let start = vec![vec![0.0], vec![40.0]];
        let near = fit_near(&system, &[0, 1], &START, &FREE, &start, known(&system, &start, 0.1));
        assert!(!near.settled);
    }
}
