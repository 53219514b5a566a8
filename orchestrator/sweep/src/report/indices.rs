//! Sobol' indices of a quantity: the share of its variance that a factor makes alone, and with all others.
//!
//! Estimators: first order of Saltelli (2010), total of Jansen (1999), both in A. Saltelli et al., Computer Physics
//! Communications 181 (2010), table 2. Intervals are percentiles of a bootstrap over the points.

use airloop_series::random::Random;

use crate::sample::saltelli::tasks_per_point;

/// Samples of the bootstrap.
const RESAMPLED: usize = 1000;
/// Percentiles of the intervals.
const INTERVAL: [f64; 2] = [0.025, 0.975];

/// An estimate with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Estimate.
    pub value: f64,
    /// Interval.
    pub interval: [f64; 2],
}

/// Indices of a factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indices {
    /// Share of the variance that the factor makes alone.
    pub first: Estimate,
    /// Share that would be left if all other factors were known.
    pub total: Estimate,
}

/// Indices of every factor, and the number of points that they are from. `values` are in the order of the tasks; a
/// point with a value that is not finite is left out. None where the quantity does not vary.
pub fn indices(values: &[f64], factors: usize) -> Option<(Vec<Indices>, usize)> {
    let per_point = tasks_per_point(factors) as usize;
    let whole = values.chunks_exact(per_point).filter(|point| point.iter().all(|value| value.is_finite()));
    let points: Vec<&[f64]> = whole.collect();
    let all: Vec<usize> = (0..points.len()).collect();
    let found = estimate(&points, &all, factors)?;
    let mut resampled: Vec<Vec<[f64; 2]>> = vec![Vec::with_capacity(RESAMPLED); factors];
    for sample in 0..RESAMPLED {
        let mut random = Random::numbered(0, sample as u64);
        let count = points.len() as f64;
        let drawn: Vec<usize> = all.iter().map(|_| (random.uniform() * count) as usize).collect();
        for (own, one) in resampled.iter_mut().zip(estimate(&points, &drawn, factors).into_iter().flatten()) {
            own.push(one);
        }
    }
    let of = |factor: usize, which: usize| {
        let mut sorted: Vec<f64> = resampled[factor].iter().map(|one| one[which]).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |part: f64| sorted.get((part * sorted.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        Estimate { value: found[factor][which], interval: INTERVAL.map(at) }
    };
    let indices = (0..factors).map(|factor| Indices { first: of(factor, 0), total: of(factor, 1) }).collect();
    Some((indices, points.len()))
}

/// First-order and total index of every factor from some of the points.
fn estimate(points: &[&[f64]], drawn: &[usize], factors: usize) -> Option<Vec<[f64; 2]>> {
    let count = 2.0 * drawn.len() as f64;
    let both = || drawn.iter().flat_map(|&point| &points[point][..2]);
    let mean = both().sum::<f64>() / count;
    let variance = both().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    // Below this, what varies is the rounding of the values.
    let rounding = (8.0 * f64::EPSILON * mean).powi(2);
    let varies = drawn.len() > 1 && variance > rounding;
    let of = |factor: usize| {
        let (mut first, mut total) = (0.0, 0.0);
        for &point in drawn {
            let (a, b, mixed) = (points[point][0], points[point][1], points[point][2 + factor]);
            first += (b - mean) * (mixed - a);
            total += 0.5 * (a - mixed).powi(2);
        }
        [first, total].map(|sum| sum / (drawn.len() as f64 * variance))
    };
    varies.then(|| (0..factors).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::{Method, Scale};
    use crate::sample::{Design, Range, Value};
    use std::f64::consts::PI;

    /// Constants of Ishigami's function.
    const A: f64 = 7.0;
    const B: f64 = 0.1;

    fn ishigami(points: u64) -> Vec<f64> {
        let angle = || Range::Between { limits: (-PI, PI), scale: Scale::Linear, levels: 2 };
        let design = Design::new(vec![angle(), angle(), angle()], Method::Saltelli, points, 1).unwrap();
        let value = |task: u64| {
            let x: Vec<f64> = design
                .point(task)
                .iter()
                .map(|value| match value {
                    Value::Number(number) => *number,
                    Value::Text(_) => f64::NAN,
                })
                .collect();
            x[0].sin() + A * x[1].sin().powi(2) + B * x[2].powi(4) * x[0].sin()
        };
        (0..design.count()).map(value).collect()
    }

    /// First-order and total indices in closed form.
    fn truth() -> [[f64; 2]; 3] {
        let (first, second) = (0.5 * (1.0 + B * PI.powi(4) / 5.0).powi(2), A * A / 8.0);
        let with_third = 8.0 * (B * PI.powi(4)).powi(2) / 225.0;
        let all = first + second + with_third;
        [[first, first + with_third], [second, second], [0.0, with_third]]
            .map(|own| own.map(|part| part / all))
    }

    #[test]
    fn indices_of_ishigami_come_to_the_closed_form_and_intervals_hold_it() {
        // Sobol' points: the error falls nearly as 1/N; 4096 points are wrong by some thousandths.
        for (points, tolerance) in [(512, 0.05), (4096, 0.01)] {
            let (found, used) = indices(&ishigami(points), 3).unwrap();
            assert_eq!(used as u64, points);
            for (own, truth) in found.iter().zip(truth()) {
                for (estimate, truth) in [own.first, own.total].iter().zip(truth) {
                    assert!((estimate.value - truth).abs() < tolerance, "{estimate:?} {truth}");
                    let [low, high] = estimate.interval;
                    assert!(low <= truth && truth <= high, "{estimate:?} {truth}");
                }
            }
        }
    }

    #[test]
    fn failed_tasks_cost_their_points_and_a_constant_has_no_indices() {
        let mut values = ishigami(256);
        values[7] = f64::NAN;
        assert_eq!(indices(&values, 3).unwrap().1, 255);
        assert_eq!(indices(&vec![2.5; 50], 3), None);
        assert_eq!(indices(&[], 3), None);
    }
}
