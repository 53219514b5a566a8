//! Convex quadratic programs in the manner of Maros and Mészáros, made here with known answers: degenerate, badly
//! scaled, infeasible, unbounded.

use airloop_optim::{Bounds, Quadratic, QuadraticStatus, solve_quadratic};

const INF: f64 = f64::INFINITY;

/// Uniform numbers in -1..1, the same in every run.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A program made backwards from its solution: x, multipliers and gaps are chosen, then gradient and bounds follow,
/// so that the KKT conditions hold exactly. With `degenerate`, a third of the active bounds has no multiplier and
/// rows repeat.
fn made(seed: u64, n: usize, m: usize, degenerate: bool) -> (Quadratic, Vec<f64>) {
    let mut next = random(seed);
    let x: Vec<f64> = (0..n).map(|_| 2.0 * next()).collect();
    // P = B^T B over neighbors, positive definite through its diagonal.
    let mut hessian: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 2.5 + next())).collect();
    hessian.extend((1..n).map(|i| (i, i - 1, next())));
    let mut rows = Vec::new();
    for i in 0..m {
        let source = if degenerate && i % 4 == 3 { i - 1 } else { i };
        let mut pick = random(1000 + 31 * seed + source as u64);
        rows.extend((0..4).map(|_| (i, ((pick() + 1.0) * 0.5 * n as f64) as usize % n, pick())));
    }
    let mut product = vec![0.0; m];
    rows.iter().for_each(|&(i, j, a)| product[i] += a * x[j]);
    let mut gradient = vec![0.0; n];
    for &(i, j, p) in &hessian {
        gradient[i] -= p * x[j];
        if i != j {
            gradient[j] -= p * x[i];
        }
    }
    let mut row_bounds = Bounds::free(m);
    for (i, &value) in product.iter().enumerate() {
        let y = match i % 3 {
            0 => {
                (row_bounds.lower[i], row_bounds.upper[i]) = (value, value);
                next()
            }
            1 => {
                row_bounds.upper[i] = value;
                if degenerate && i % 2 == 0 { 0.0 } else { next().abs() }
            }
            _ => {
                (row_bounds.lower[i], row_bounds.upper[i]) = (value - 1.0, value + 2.0);
                0.0
            }
        };
        rows.iter().filter(|row| row.0 == i).for_each(|&(_, j, a)| gradient[j] -= a * y);
    }
    let mut bounds = Bounds::free(n);
    for j in 0..n {
        match j % 4 {
            0 => {
                bounds.lower[j] = x[j];
                gradient[j] += if degenerate && j % 8 == 0 { 0.0 } else { next().abs() };
            }
            1 => (bounds.lower[j], bounds.upper[j]) = (x[j] - 1.0, x[j] + 0.5),
            2 if j % 8 == 2 => {
                (bounds.lower[j], bounds.upper[j]) = (x[j], x[j]);
                gradient[j] += next();
            }
            _ => {}
        }
    }
    (Quadratic { hessian, gradient, rows, row_bounds, bounds }, x)
}

#[test]
fn programs_made_from_their_solution_give_it_back() {
    for seed in 1..=20 {
        let (problem, x) = made(seed, 40, 18, false);
        let solution = solve_quadratic(&problem).unwrap();
        assert_eq!(solution.status, QuadraticStatus::Solved, "seed {seed}");
        // Strictly convex: the solution is unique. Clarabel's tolerance is 1e-9 on the residuals.
        let gap = solution.x.iter().zip(&x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(gap < 1e-5, "seed {seed}: {gap}");
    }
}

#[test]
fn degenerate_programs_are_solved() {
    for seed in 1..=20 {
        let (problem, x) = made(seed, 40, 24, true);
        let solution = solve_quadratic(&problem).unwrap();
        assert_eq!(solution.status, QuadraticStatus::Solved, "seed {seed}");
        // Where bound and multiplier are both zero, the error of x is of the order of the root of the tolerance.
        let gap = solution.x.iter().zip(&x).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(gap < 1e-3, "seed {seed}: {gap}");
    }
}

#[test]
fn multipliers_have_the_documented_signs() {
    // min (x - 2)^2 + (y + 1)^2 with x <= 1, y >= 0, x + y = 1: x = 1, y = 0.
    let problem = Quadratic {
        hessian: vec![(0, 0, 2.0), (1, 1, 2.0)],
        gradient: vec![-4.0, 2.0],
        rows: vec![(0, 0, 1.0), (0, 1, 1.0)],
        row_bounds: Bounds { lower: vec![-INF], upper: vec![1.0] },
        bounds: Bounds { lower: vec![-INF, 0.0], upper: vec![3.0, INF] },
    };
    let s = solve_quadratic(&problem).unwrap();
    let residual = [
        2.0 * s.x[0] - 4.0 + s.y[0] - s.lower[0] + s.upper[0],
        2.0 * s.x[1] + 2.0 + s.y[0] - s.lower[1] + s.upper[1],
    ];
    assert!((s.x[0] - 1.0).abs() < 1e-7 && s.x[1].abs() < 1e-7);
    assert!((s.y[0] - 2.0).abs() < 1e-6 && (s.lower[1] - 4.0).abs() < 1e-6);
    assert!(residual.iter().all(|r| r.abs() < 1e-7), "{residual:?}");
}

#[test]
fn an_infeasible_program_is_seen() {
    let problem = Quadratic {
        hessian: vec![(0, 0, 1.0), (1, 1, 1.0)],
        gradient: vec![0.0; 2],
        rows: vec![(0, 0, 1.0), (0, 1, 1.0)],
        row_bounds: Bounds { lower: vec![3.0], upper: vec![3.0] },
        bounds: Bounds { lower: vec![0.0; 2], upper: vec![1.0; 2] },
    };
    assert_eq!(solve_quadratic(&problem).unwrap().status, QuadraticStatus::Infeasible);
}

#[test]
fn an_unbounded_program_is_seen() {
    let problem = Quadratic {
        hessian: vec![(0, 0, 1.0)],
        gradient: vec![0.0, -1.0],
        rows: vec![],
        row_bounds: Bounds::free(0),
        bounds: Bounds { lower: vec![-INF, 0.0], upper: vec![INF, INF] },
    };
    assert_eq!(solve_quadratic(&problem).unwrap().status, QuadraticStatus::Unbounded);
}

#[test]
fn a_program_without_bounds_is_a_linear_system() {
    // [[2, 1], [1, 3]] x = [1, -1]: x = [0.8, -0.6].
    let problem = Quadratic {
        hessian: vec![(0, 0, 2.0), (1, 0, 1.0), (1, 1, 3.0)],
        gradient: vec![-1.0, 1.0],
        rows: vec![],
        row_bounds: Bounds::free(0),
        bounds: Bounds::free(2),
    };
    let x = solve_quadratic(&problem).unwrap().x;
    assert!((x[0] - 0.8).abs() < 1e-9 && (x[1] + 0.6).abs() < 1e-9);
}

#[test]
fn rows_of_very_different_size_are_solved() {
    // min x^2 + y^2, 1e6 x >= 1e6, 1e-4 y <= -1e-4: (1, -1).
    let problem = Quadratic {
        hessian: vec![(0, 0, 2.0), (1, 1, 2.0)],
        gradient: vec![0.0; 2],
        rows: vec![(0, 0, 1e6), (1, 1, 1e-4)],
        row_bounds: Bounds { lower: vec![1e6, -INF], upper: vec![INF, -1e-4] },
        bounds: Bounds::free(2),
    };
    let solution = solve_quadratic(&problem).unwrap();
    assert_eq!(solution.status, QuadraticStatus::Solved);
    assert!((solution.x[0] - 1.0).abs() < 1e-6 && (solution.x[1] + 1.0).abs() < 1e-4);
}

#[test]
fn parts_that_do_not_fit_are_errors() {
    let (mut problem, _) = made(1, 8, 3, false);
    problem.rows.push((3, 0, 1.0));
    let message = solve_quadratic(&problem).unwrap_err().to_string();
    assert!(message.ends_with("of the pattern of the Jacobian is (3, 0), outside of [3, 8]"), "{message}");
}
