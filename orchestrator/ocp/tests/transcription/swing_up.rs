//! Optima of the swing-up over the trait.

use std::ops::ControlFlow;

use airloop_ocp::transcription::{Discretization, From, Outcome, Program, Transcription, solve_on};
use airloop_optim::{Method, Settings, Solution, Start, Status, solve};

use crate::cart_pole::swing_up;
use crate::problem::SwingUp;
use crate::same_program::PAIRS;

fn from_pump(transcription: Transcription, intervals: usize) -> Solution {
    from_guess(transcription, intervals, SwingUp::pump)
}

fn from_guess(
    transcription: Transcription,
    intervals: usize,
    guess: impl Fn(&SwingUp) -> Vec<f64>,
) -> Solution {
    let (_, typed) = PAIRS.into_iter().find(|(t, _)| *t == transcription).unwrap();
    let guess = guess(&SwingUp::new(typed, intervals));
    let mut problem = swing_up(1);
    let mut program =
        Program::new(&mut problem, &Discretization::uniform(transcription, &[intervals])).unwrap();
    solve(&mut program, &Start::cold(guess), &Settings::default()).unwrap()
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
        let solution = from_pump(transcription, 100);
        let near = |minimum: &f64| (solution.objective - minimum).abs() <= 1e-6 * minimum;
        assert_eq!(solution.status, Status::Solved);
        assert!(solution.violation <= 1e-8);
        assert!(minima.iter().any(near), "{transcription:?}: {}", solution.objective);
    }
}

#[test]
fn simplified_curvature_leads_to_the_same_optimum() {
    let guess = SwingUp::new(crate::problem::Transcription::MultipleShooting, 100).pump();
    let mut problem = swing_up(1);
    problem.phases[0].simplified_curvature = true;
    let discretization = Discretization::uniform(Transcription::MultipleShooting, &[100]);
    let mut program = Program::new(&mut problem, &discretization).unwrap();
    let solution = solve(&mut program, &Start::cold(guess), &Settings::default()).unwrap();
    assert_eq!(solution.status, Status::Solved);
    assert!((solution.objective - 1094.6922941665).abs() <= 1e-6 * 1094.7, "{}", solution.objective);
    // The end of the run is not quadratic any more; each step costs a quarter of the second derivatives.
    let exact = from_pump(Transcription::MultipleShooting, 100).iterations.len();
    assert!(solution.iterations.len() <= 2 * exact, "{} {exact}", solution.iterations.len());
}

/// The outcome on `intervals` intervals from another outcome.
fn from_outcome(transcription: Transcription, intervals: usize, from: &Outcome, method: Method) -> Outcome {
    let settings = Settings { method, ..Settings::default() };
    let discretization = Discretization::uniform(transcription, &[intervals]);
    let mut problem = swing_up(1);
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    solve_on(&mut problem, &discretization, From::Outcome(from), &settings, go_on).unwrap()
}

/// The pump guess as an outcome of a transcription.
fn outcome_from_pump(transcription: Transcription, intervals: usize) -> Outcome {
    let (_, typed) = PAIRS.into_iter().find(|(t, _)| *t == transcription).unwrap();
    let guess = SwingUp::new(typed, intervals).pump();
    let discretization = Discretization::uniform(transcription, &[intervals]);
    let mut problem = swing_up(1);
    let trajectory = {
        let mut program = Program::new(&mut problem, &discretization).unwrap();
        program.trajectory(&guess, None).unwrap()
    };
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let from = From::Guess(&trajectory);
    solve_on(&mut problem, &discretization, from, &Settings::default(), go_on).unwrap()
}

#[test]
fn a_coarse_solution_starts_a_fine_one() {
    for method in [Method::InteriorPoint, Method::Sqp] {
        let mut outcome = outcome_from_pump(Transcription::ShootingCollocation, 50);
        let mut steps = vec![outcome.solution.iterations.len() - 1];
        for (transcription, intervals) in [
            (Transcription::ShootingCollocation, 100),
            (Transcription::MultipleShooting, 100),
            (Transcription::HermiteSimpson, 100),
            (Transcription::HermiteSimpson, 200),
        ] {
            outcome = from_outcome(transcription, intervals, &outcome, method);
            assert_eq!(outcome.solution.status, Status::Solved, "{method:?} {transcription:?} {intervals}");
            assert!(outcome.violations.is_empty(), "{}", outcome.violations[0]);
            steps.push(outcome.solution.iterations.len() - 1);
        }
        // Less than from the pump guess, also where the friction, sharper than the grid, moves the minimum.
        assert!(steps[1..].iter().all(|count| *count < steps[0]), "{method:?}: {steps:?}");
    }
}

#[test]
fn the_same_mesh_again_is_solved_at_once() {
    let outcome = outcome_from_pump(Transcription::HermiteSimpson, 50);
    let again = from_outcome(Transcription::HermiteSimpson, 50, &outcome, Method::InteriorPoint);
    let count = again.solution.iterations.len() - 1;
    assert!(count <= 3, "{count} iterations");
    let gap = (again.solution.objective - outcome.solution.objective).abs();
    assert!(gap < 1e-8 * outcome.solution.objective, "{gap:e}");
}

/// Section 5 of the statement, on request: G1 and 20 perturbed G2 per transcription, with the figures printed.
#[test]
#[ignore = "a minute of optimization; `cargo test --release --test transcription -- --ignored --nocapture`"]
fn nearly_all_guesses_converge() {
    for (transcription, _) in PAIRS {
        for intervals in [50, 100] {
            let linear = from_guess(transcription, intervals, SwingUp::linear);
            println!(
                "{transcription:?} {intervals}, linear guess: {} iterations, {}, {}",
                linear.iterations.len() - 1,
                linear.objective,
                linear.status
            );
            assert_eq!(linear.status, Status::Solved);
            let (mut solved, mut iterations) = (0, Vec::new());
            for seed in 0..20 {
                let solution = from_guess(transcription, intervals, |guess| guess.perturbed(seed));
                solved += usize::from(solution.status == Status::Solved && solution.violation <= 1e-8);
                iterations.push(solution.iterations.len() - 1);
            }
            iterations.sort_unstable();
            println!(
                "{transcription:?} {intervals}, 20 perturbed: {solved} solved, iterations {} median, {} most",
                iterations[10], iterations[19]
            );
            assert!(solved >= 19);
        }
    }
}
