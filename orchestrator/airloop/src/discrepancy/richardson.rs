//! Richardson's estimate: the error of a solution from those with half and a quarter of its step.
//!
//! With y(h) = y + C h^p the two differences are d1 = y(h) - y(h/2) and d2 = y(h/2) - y(h/4) = d1 / 2^p; the order p
//! follows from their RMS, and the error of y(h) is d1 / (1 - 2^-p).

use airloop_cosim::results::coupling_error::Standing;

/// Orders that masters can have, with some room for what is not smooth.
const PLAUSIBLE_ORDERS: std::ops::RangeInclusive<f64> = 0.7..=7.0;
/// Smallest cosine between the two differences: in the asymptotic range they have the same shape.
const MIN_COSINE_OF_DIFFERENCES: f64 = 0.9;
/// Relative error that cannot be told from rounding and tolerances inside FMUs.
const NEGLIGIBLE_RELATIVE_ERROR: f64 = 1e-7;

/// Error of a signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// RMS error in the unit of the signal.
    pub error: f64,
    /// Relative to the RMS of the signal; `None` if the signal is zero.
    pub relative: Option<f64>,
    /// Observed order; `None` if one of the differences is zero.
    pub order: Option<f64>,
    /// Whether the estimate holds.
    pub standing: Standing,
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    (values.map(|value| value * value).sum::<f64>() / count).sqrt()
}

/// Estimates the error of `full` from the solutions with half and a quarter of its step, at the same n times (shape
/// \[n\] each; what is longer is not looked at).
pub fn estimate(full: &[f64], half: &[f64], quarter: &[f64]) -> Estimate {
    let differences = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
    let (first, second) = (differences(full, half), differences(half, quarter));
    let (d1, d2) = (rms(first.iter().copied()), rms(second.iter().copied()));
    let size = rms(quarter.iter().copied());
    let product = first.iter().zip(&second).map(|(a, b)| a * b).sum::<f64>() / first.len().max(1) as f64;
    let order = (d1 > 0.0 && d2 > 0.0).then(|| (d1 / d2).log2());
    // From the finest run a first-order error looks a quarter smaller than it is.
    let careful = rms(differences(full, quarter).into_iter()) * 4.0 / 3.0;
    let (error, standing) = match order {
        _ if d1.max(careful) <= NEGLIGIBLE_RELATIVE_ERROR * size => (careful, Standing::Negligible),
        Some(order)
            if PLAUSIBLE_ORDERS.contains(&order) && product >= MIN_COSINE_OF_DIFFERENCES * d1 * d2 =>
        {
            (d1 / (1.0 - (-order).exp2()), Standing::Asymptotic)
        }
        _ => (careful.max(d1), Standing::NotAsymptotic),
    };
    let relative = (size > 0.0).then(|| error / size);
    Estimate { error, relative, order, standing }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// sin t plus an error of this order and size at h = 1.
    fn solution(step: f64, order: i32, size: f64) -> Vec<f64> {
        let value = |t: f64| t.sin() + size * step.powi(order) * (1.0 + t) * (2.0 * t).cos();
        (0..100).map(|k| value(0.1 * f64::from(k))).collect()
    }

    fn true_error(order: i32, size: f64) -> f64 {
        let (wrong, right) = (solution(1.0, order, size), solution(1.0, order, 0.0));
        rms(wrong.iter().zip(&right).map(|(a, b)| a - b).collect::<Vec<_>>().into_iter())
    }

    #[test]
    fn an_error_of_known_order_is_found() {
        for order in [1, 2, 4] {
            let runs = [1.0, 0.5, 0.25].map(|step| solution(step, order, 1e-3));
            let found = estimate(&runs[0], &runs[1], &runs[2]);
            assert_eq!(found.standing, Standing::Asymptotic);
            assert!((found.order.unwrap() - f64::from(order)).abs() < 1e-6, "{found:?}");
            assert!((found.error / true_error(order, 1e-3) - 1.0).abs() < 1e-6, "{found:?}");
            let size = rms(runs[2].iter().copied());
            assert!((found.relative.unwrap() - found.error / size).abs() < 1e-15);
        }
    }

    #[test]
    fn errors_that_do_not_shrink_or_change_their_shape_are_not_trusted() {
        let runs = [1.0, 0.5, 0.25].map(|step| solution(step, 1, 1e-3));
        let growing = estimate(&runs[2], &runs[1], &runs[0]);
        assert_eq!(growing.standing, Standing::NotAsymptotic, "{growing:?}");
        assert!(growing.order.unwrap() < 0.0 && growing.error > 0.0);
        let ringing: Vec<f64> =
            runs[0].iter().enumerate().map(|(k, y)| y + if k % 2 == 0 { 1e-2 } else { -1e-2 }).collect();
        assert_eq!(estimate(&ringing, &runs[1], &runs[2]).standing, Standing::NotAsymptotic);
    }

    #[test]
    fn equal_runs_and_zero_signals_have_no_order() {
        let run = solution(1.0, 1, 0.0);
        let same = estimate(&run, &run, &run);
        assert_eq!((same.error, same.order, same.standing), (0.0, None, Standing::Negligible));
        let zero = estimate(&[0.0; 3], &[0.0; 3], &[0.0; 3]);
        assert_eq!((zero.relative, zero.standing), (None, Standing::Negligible));
        let noise: Vec<f64> =
            run.iter().enumerate().map(|(k, y)| y * (1.0 + 1e-12 * (k % 3) as f64)).collect();
        assert_eq!(estimate(&noise, &run, &run).standing, Standing::Negligible);
    }
}
