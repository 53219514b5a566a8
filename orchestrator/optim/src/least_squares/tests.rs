use nalgebra::DMatrix;

use super::*;

const INF: f64 = f64::INFINITY;

fn free<'a>(
    m: usize,
    n: usize,
    evaluate: &'a dyn Fn(&[f64], &mut [f64]) -> bool,
    ones: &'a [f64],
) -> Problem<'a> {
    const LOW: [f64; 4] = [-INF; 4];
    const HIGH: [f64; 4] = [INF; 4];
    Problem { residuals: m, lower: &LOW[..n], upper: &HIGH[..n], scale: &ones[..n], evaluate, jacobian: None }
}

fn rosenbrock(p: &[f64], r: &mut [f64]) -> bool {
    r.copy_from_slice(&[10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]);
    true
}

#[test]
fn the_curved_valley_is_followed_to_its_minimum() {
    let ones = [1.0; 2];
    let found = solve(&free(2, 2, &rosenbrock, &ones), &[-1.2, 1.0], &Settings::default()).unwrap();
    assert!(found.status.converged(), "{:?}", found.status);
    assert!(
        (found.parameters[0] - 1.0).abs() < 1e-9 && (found.parameters[1] - 1.0).abs() < 1e-9,
        "{found:?}"
    );
}

#[test]
fn bounds_are_kept_and_the_minimum_on_the_edge_is_that_of_the_edge() {
    // On p0 = 0.5 the best p1 is 0.25 by hand: the first residual vanishes.
    let ones = [1.0; 2];
    let problem = Problem { lower: &[-2.0, -2.0], upper: &[0.5, 2.0], ..free(2, 2, &rosenbrock, &ones) };
    let found = solve(&problem, &[-1.2, 1.0], &Settings::default()).unwrap();
    assert!(
        (found.parameters[0] - 0.5).abs() < 1e-12 && (found.parameters[1] - 0.25).abs() < 1e-9,
        "{found:?}"
    );
    assert_eq!(found.held, [true, false]);
    // A bound that does not bind is left again.
    let inside =
        solve(&Problem { upper: &[3.0, 3.0], ..problem }, &[3.0, 3.0], &Settings::default()).unwrap();
    assert!((inside.parameters[0] - 1.0).abs() < 1e-8);
}

/// Line through points with a known scatter: the textbook formulas for slope and intercept.
#[test]
fn covariance_of_a_line_is_that_of_the_textbook() {
    let x = [0.0, 1.0, 2.0, 3.0, 4.0];
    let y = [0.1, 0.9, 2.2, 2.9, 4.1];
    let evaluate = |p: &[f64], r: &mut [f64]| {
        r.iter_mut().zip(x.iter().zip(&y)).for_each(|(r, (x, y))| *r = p[0] + p[1] * x - y);
        true
    };
    let ones = [1.0; 2];
    let found = solve(&free(5, 2, &evaluate, &ones), &[0.0, 0.0], &Settings::default()).unwrap();
    let (mean, sxx) = (2.0, 10.0);
    let s2 = found.cost / 3.0;
    let covariance = found.covariance().unwrap();
    let expected = DMatrix::from_row_slice(
        2,
        2,
        &[s2 * (0.2 + mean * mean / sxx), -s2 * mean / sxx, -s2 * mean / sxx, s2 / sxx],
    );
    assert!((&covariance - expected).norm() < 1e-12, "{covariance}");
}

#[test]
fn parameters_that_only_act_together_are_named() {
    let evaluate = |p: &[f64], r: &mut [f64]| {
        (0..5).for_each(|k| r[k] = (p[0] + p[2]) * k as f64 + p[1] - (3 * k) as f64 - (k % 2) as f64);
        true
    };
    let ones = [1.0; 3];
    let found = solve(&free(5, 3, &evaluate, &ones), &[0.5, 0.0, 0.0], &Settings::default()).unwrap();
    assert_eq!(found.covariance().unwrap_err(), Error::Dependent { indices: vec![0, 2] });
}

#[test]
fn a_fixed_parameter_stays_and_has_no_variance() {
    let evaluate = |p: &[f64], r: &mut [f64]| {
        (0..6).for_each(|k| r[k] = p[0] * k as f64 + p[1] - 2.0 * k as f64 - f64::from(k as u8 % 3));
        true
    };
    let ones = [1.0; 2];
    let problem = Problem { lower: &[-INF, 0.25], upper: &[INF, 0.25], ..free(6, 2, &evaluate, &ones) };
    let found = solve(&problem, &[0.0, 7.0], &Settings::default()).unwrap();
    assert_eq!(found.parameters[1], 0.25);
    assert_eq!(found.covariance().unwrap()[(1, 1)], 0.0);
}

#[test]
fn residuals_that_cannot_be_evaluated_are_stepped_back_from() {
    // sqrt is not defined below zero; a full Gauss-Newton step from 9 toward the root at 0.01 lands there.
    let evaluate = |p: &[f64], r: &mut [f64]| {
        r[0] = p[0].sqrt() - 0.1;
        p[0] >= 0.0
    };
    let ones = [1.0];
    let found = solve(&free(1, 1, &evaluate, &ones), &[9.0], &Settings::default()).unwrap();
    assert!((found.parameters[0] - 0.01).abs() < 1e-9, "{found:?}");
    let outside = solve(&free(1, 1, &evaluate, &ones), &[-1.0], &Settings::default());
    assert!(matches!(outside, Err(Error::Start { .. })));
}

#[test]
fn several_starts_find_the_deeper_of_two_minima() {
    // (p^2 - 1)^2 + 0.01 (p - 3)^2 has a minimum near -1 and a deeper one near 1.
    let evaluate = |p: &[f64], r: &mut [f64]| {
        r.copy_from_slice(&[p[0] * p[0] - 1.0, 0.1 * (p[0] - 3.0)]);
        true
    };
    let ones = [1.0];
    let problem = free(2, 1, &evaluate, &ones);
    let one = solve(&problem, &[-1.5], &Settings::default()).unwrap();
    assert!(one.parameters[0] < 0.0);
    let (best, costs) = multi_start(&problem, &spread(&[(-2.0, 2.0)], 6), &Settings::default()).unwrap();
    assert!(best.parameters[0] > 0.0 && best.cost < one.cost);
    assert_eq!(costs.len(), 6);
}

#[test]
fn halton_points_are_those_of_the_sequence() {
    let points = spread(&[(0.0, 1.0), (0.0, 3.0)], 3);
    let expected = [[0.5, 1.0], [0.25, 2.0], [0.75, 1.0 / 3.0]];
    for (point, expected) in points.iter().zip(expected) {
        assert!(point.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-15), "{points:?}");
    }
}

#[test]
fn wrong_bounds_and_shapes_are_refused() {
    let ones = [1.0; 2];
    let problem = free(2, 2, &rosenbrock, &ones);
    let refused = solve(
        &Problem { lower: &[1.0, 0.0], upper: &[0.0, 1.0], ..problem },
        &[0.0, 0.0],
        &Settings::default(),
    );
    assert!(matches!(refused, Err(Error::Bounds { index: 0, .. })));
    let problem = free(2, 2, &rosenbrock, &ones);
    let refused = solve(&Problem { scale: &[1.0], ..problem }, &[0.0, 0.0], &Settings::default());
    assert_eq!(refused.unwrap_err(), Error::Length { what: "scale", found: 1, expected: 2 });
}
