//! The swing-up of the pneumatic cart-pole with equations typed by hand: the independent check of the optimizer,
//! and of the plan over FMUs.

mod guesses;
mod interval;
mod problem;
mod stabilize;

use airloop_optim::{Method, Nlp, Settings, Solution, Start, Status, solve};
use problem::{SwingUp, Transcription};

fn run(problem: &mut SwingUp, x: Vec<f64>) -> Solution {
    solve(problem, &Start::cold(x), &Settings::default()).unwrap()
}

#[test]
fn defects_at_the_pump_guess_are_those_of_the_statement() {
    // Sum and largest of |defect| at G2, from the check values of the problem statement (computed with NumPy).
    let expected = [
        (Transcription::HermiteSimpson, 50, 113.92731408443082, 3.182004517626331),
        (Transcription::HermiteSimpson, 200, 113.68943229813941, 0.7593257953135925),
        (Transcription::Trapezoidal, 100, 113.52799204842913, 1.5133195400088313),
        (Transcription::MultipleShooting, 100, 51.94130917828066, 0.9802780605871904),
        (Transcription::MultipleShooting, 400, 54.37173572168156, 0.2503741704316278),
    ];
    for (transcription, intervals, sum, largest) in expected {
        let mut problem = SwingUp::new(transcription, intervals);
        let mut defects = vec![0.0; problem.constraints()];
        problem.constraint_values(&problem.pump(), &mut defects).unwrap();
        let found = defects.iter().map(|d| d.abs()).sum::<f64>();
        assert!((found - sum).abs() < 1e-10 * sum, "{transcription:?} {intervals}: {found}");
        let found = defects.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        assert!((found - largest).abs() < 1e-12, "{transcription:?} {intervals}: {found}");
    }
}

#[test]
fn derivatives_agree_with_central_differences() {
    for transcription in Transcription::ALL {
        let mut problem = SwingUp::new(transcription, 5);
        let (n, m) = (problem.variables(), problem.constraints());
        let x: Vec<f64> = (0..n).map(|i| 0.3 * (1.7 * i as f64).sin()).collect();
        let y: Vec<f64> = (0..m).map(|i| (0.9 * i as f64).cos()).collect();
        let (jp, hp) = (problem.jacobian_pattern(), problem.hessian_pattern());
        let gradient = |problem: &mut SwingUp, x: &[f64]| {
            let (mut g, mut j) = (vec![0.0; n], vec![0.0; jp.len()]);
            problem.gradient(x, &mut g).unwrap();
            problem.jacobian(x, &mut j).unwrap();
            jp.iter().zip(&j).for_each(|(&(row, column), value)| g[column] += y[row] * value);
            g
        };
        let lagrangian = |problem: &mut SwingUp, x: &[f64]| {
            let mut c = vec![0.0; m];
            problem.constraint_values(x, &mut c).unwrap();
            problem.objective(x).unwrap() + c.iter().zip(&y).map(|(c, y)| c * y).sum::<f64>()
        };
        let exact = gradient(&mut problem, &x);
        let mut hessian = vec![vec![0.0; n]; n];
        let mut values = vec![0.0; hp.len()];
        problem.hessian(&x, 1.0, &y, &mut values).unwrap();
        for (&(i, j), value) in hp.iter().zip(&values) {
            hessian[i][j] += value;
            if i != j {
                hessian[j][i] += value;
            }
        }
        let step = 1e-6;
        for i in 0..n {
            let mut moved = x.clone();
            moved[i] += step;
            let (up, slopes) = (lagrangian(&mut problem, &moved), gradient(&mut problem, &moved));
            moved[i] -= 2.0 * step;
            let (down, before) = (lagrangian(&mut problem, &moved), gradient(&mut problem, &moved));
            let slope = (up - down) / (2.0 * step);
            assert!(
                (slope - exact[i]).abs() < 2e-7 * (1.0 + slope.abs()),
                "{transcription:?} {i}: {slope} {}",
                exact[i]
            );
            for j in 0..n {
                let curvature = (slopes[j] - before[j]) / (2.0 * step);
                let gap = (curvature - hessian[i][j]).abs();
                assert!(
                    gap < 1e-5 * (1.0 + curvature.abs()),
                    "{transcription:?} {i} {j}: {curvature} {}",
                    hessian[i][j]
                );
            }
        }
    }
}

#[test]
fn the_optimum_is_the_reference() {
    // Section 6 of the statement: minima known at N = 100 from the pump guess.
    let references: [(Transcription, &[f64]); 4] = [
        (Transcription::HermiteSimpson, &[1085.5801989546, 1088.8114515]),
        (Transcription::Trapezoidal, &[1086.0637278, 1086.4606893559]),
        (Transcription::MultipleShooting, &[1094.6922941665]),
        (Transcription::ShootingCollocation, &[1091.4577017]),
    ];
    for (transcription, minima) in references {
        let mut problem = SwingUp::new(transcription, 100);
        let x = problem.pump();
        let solution = run(&mut problem, x);
        let near = |minimum: &f64| (solution.objective - minimum).abs() <= 1e-6 * minimum;
        assert_eq!(solution.status, Status::Solved);
        assert!(solution.violation <= 1e-8);
        assert!(minima.iter().any(near), "{transcription:?}: {}", solution.objective);
    }
}

/// Seeds of the perturbed pump guess from which no minimum is reached.
fn failing(transcription: Transcription) -> Vec<String> {
    let attempt = |seed: u64| {
        let mut problem = SwingUp::new(transcription, 50);
        let x = problem.perturbed(seed);
        let solution = run(&mut problem, x);
        let good = solution.status == Status::Solved && solution.violation <= 1e-8;
        (!good).then(|| format!("seed {seed}: {}", solution.status))
    };
    (0..20).filter_map(attempt).collect()
}

/// 20 perturbed guesses, of which 95 % have to converge.
fn perturbed_guesses_converge(transcription: Transcription) {
    let failed = failing(transcription);
    assert!(failed.len() <= 1, "{}:\n{}", transcription.name(), failed.join("\n"));
}

#[test]
fn perturbed_guesses_converge_with_hermite_simpson() {
    perturbed_guesses_converge(Transcription::HermiteSimpson);
}

#[test]
fn perturbed_guesses_converge_with_trapezoids() {
    perturbed_guesses_converge(Transcription::Trapezoidal);
}

#[test]
fn perturbed_guesses_converge_with_multiple_shooting() {
    perturbed_guesses_converge(Transcription::MultipleShooting);
}

#[test]
fn perturbed_guesses_converge_with_shooting_and_collocation() {
    perturbed_guesses_converge(Transcription::ShootingCollocation);
}

#[test]
fn the_linear_guess_converges_too() {
    for transcription in Transcription::ALL {
        let mut problem = SwingUp::new(transcription, 50);
        let x = problem.linear();
        let solution = run(&mut problem, x);
        assert_eq!(solution.status, Status::Solved, "{transcription:?}");
        assert!(solution.violation <= 1e-8);
    }
}

#[test]
fn multiple_shooting_goes_on_by_sqp_from_shooting_collocation() {
    let mut coarse = SwingUp::new(Transcription::ShootingCollocation, 100);
    let x = coarse.pump();
    let first = run(&mut coarse, x);
    let mut sampled = SwingUp::new(Transcription::MultipleShooting, 100);
    let settings = Settings { method: Method::Sqp, ..Settings::default() };
    let solution = solve(&mut sampled, &first.restart(), &settings).unwrap();
    assert_eq!(solution.status, Status::Solved);
    assert!((solution.objective - 1094.6922941665).abs() <= 1e-6 * 1094.7, "{}", solution.objective);
    let x = sampled.pump();
    let alone = run(&mut sampled, x);
    assert!(solution.iterations.len() < alone.iterations.len(), "{}", solution.iterations.len());
}

#[test]
fn too_short_a_stroke_is_infeasible_and_named() {
    let mut problem = SwingUp::new(Transcription::MultipleShooting, 50);
    problem.stroke = 0.005;
    let x = problem.pump();
    let solution = run(&mut problem, x);
    assert_eq!(solution.status, Status::Infeasible);
    let worst = solution.worst.unwrap().to_string();
    assert!(worst.starts_with("defect of "), "{worst}");
    let blocking = solution.blocking.unwrap().to_string();
    assert!(blocking.starts_with("x at t = ") && blocking.ends_with("0.005"), "{blocking}");
}

#[test]
fn without_stages_the_sparse_factorization_reaches_the_same_optimum() {
    let mut problem = SwingUp::new(Transcription::MultipleShooting, 100);
    problem.staged = false;
    let x = problem.pump();
    let solution = run(&mut problem, x);
    assert_eq!(solution.status, Status::Solved);
    assert!((solution.objective - 1094.6922941665).abs() <= 1e-6 * 1094.7, "{}", solution.objective);
}
