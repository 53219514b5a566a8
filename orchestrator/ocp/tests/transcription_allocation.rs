//! Evaluations of a transcribed problem allocate nothing once they are going, nor do solves after the first.

#[path = "transcription/cart_pole.rs"]
mod cart_pole;
#[allow(dead_code, reason = "what only the hand-written runs use")]
#[path = "swing_up/interval.rs"]
mod interval;
#[allow(dead_code, reason = "what only the hand-written runs use")]
#[path = "swing_up/problem.rs"]
mod problem;

use airloop_testing::allocations;

airloop_testing::count_allocations!();
use airloop_ocp::transcription::{Discretization, LimitPlace, Program, Solver, Transcription};
use airloop_optim::{Nlp, Settings, Start, Status, solve};
use std::ops::ControlFlow;

/// One test only: other tests in this process would be counted too.
#[test]
fn evaluations_allocate_nothing() {
    for transcription in [
        Transcription::Trapezoidal,
        Transcription::HermiteSimpson,
        Transcription::HermiteSimpsonSeparated,
        Transcription::MultipleShooting,
        Transcription::ShootingCollocation,
    ] {
        let mut problem = cart_pole::swing_up(1);
        let mut program = Program::new(&mut problem, &Discretization::uniform(transcription, &[10])).unwrap();
        let (n, m) = (program.variables(), program.constraints());
        let points = [0.1, 0.2].map(|size| (0..n).map(|i| size * (i as f64).sin()).collect::<Vec<f64>>());
        let y: Vec<f64> = (0..m).map(|i| (0.9 * i as f64).cos()).collect();
        let (mut gradient, mut values) = (vec![0.0; n], vec![0.0; m]);
        let mut jacobian = vec![0.0; program.jacobian_pattern().len()];
        let mut hessian = vec![0.0; program.hessian_pattern().len()];
        let mut all = |x: &[f64]| {
            program.objective(x).unwrap();
            program.constraint_values(x, &mut values).unwrap();
            program.gradient(x, &mut gradient).unwrap();
            program.jacobian(x, &mut jacobian).unwrap();
            program.hessian(x, 1.0, &y, &mut hessian).unwrap();
        };
        all(&points[0]);
        let before = allocations::count();
        all(&points[1]);
        assert_eq!(allocations::count() - before, 0, "{transcription:?}");
    }
    solves_allocate_nothing_after_the_first();
}

/// Other initial states, a start moved ahead and back, another bound that is not reached.
fn solves_allocate_nothing_after_the_first() {
    let discretization = Discretization::uniform(Transcription::HermiteSimpson, &[50]);
    let mut problem = cart_pole::swing_up(1);
    let mut program = Program::new(&mut problem, &discretization).unwrap();
    let guess = problem::SwingUp::new(problem::Transcription::HermiteSimpson, 50).pump();
    let nominal = solve(&mut program, &Start::cold(guess), &Settings::default()).unwrap();
    let trajectory = program.trajectory(&nominal.x, Some(&nominal.multipliers)).unwrap();
    let duals = program.duals(&nominal.multipliers);
    let settings = Settings::default();
    let problem = cart_pole::swing_up(1);
    let mut solver = Solver::along(problem, &discretization, &trajectory, Some(&duals), &settings).unwrap();
    let mut one = |angle: f64, force: f64| {
        solver.set_initial(&[0.0, angle, 0.0, 0.0, 0.0, 0.0]).unwrap();
        solver.set_limits(&[(0, LimitPlace::Path(1), [-force, force])]).unwrap();
        let solution = solver.solve(&mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(solution.status, Status::Solved);
        assert!(solution.iterations.len() > 3, "{} iterations", solution.iterations.len() - 1);
        solver.shift(0.0).unwrap();
    };
    one(0.02, 150.0);
    let before = allocations::count();
    for k in 0..10 {
        one(0.002 * f64::from(k), 140.0 + f64::from(k));
    }
    assert_eq!(allocations::count() - before, 0, "re-solves");
}
