//! Small problems with known minima, from their published starts.

mod jet;
mod more;
mod problem;
mod three;
mod two;

use airloop_optim::{Method, Settings, Start, solve};
use problem::Problem;

fn all() -> Vec<Problem> {
    [two::problems(), three::problems(), more::problems()].into_iter().flatten().collect()
}

/// Runs every problem; how many there are, and a sentence for each that did not reach one of its minima.
fn failures(settings: &Settings) -> (usize, Vec<String>) {
    let mut failed = Vec::new();
    let problems = all();
    let count = problems.len();
    for mut problem in problems {
        let start = Start::cold(problem.start.clone());
        let solution = solve(&mut problem, &start, settings).unwrap();
        // The published minima have 9 digits or more; 1e-6 leaves room for the last of them.
        let reached = |minimum: &f64| (solution.objective - minimum).abs() <= 1e-6 * minimum.abs().max(1.0);
        let found = problem.minima.iter().any(reached) && solution.violation <= 1e-7;
        println!(
            "{:6} {:3} iterations, f = {:.9}, violation {:.1e}, error {:.1e}: {}",
            problem.name,
            solution.iterations.len() - 1,
            solution.objective,
            solution.violation,
            solution.error,
            solution.status
        );
        if !found {
            failed.push(format!("{}: f = {}, {}", problem.name, solution.objective, solution.status));
        }
    }
    (count, failed)
}

#[test]
fn interior_point_reaches_the_known_minima() {
    let (count, failed) = failures(&Settings { method: Method::InteriorPoint, ..Settings::default() });
    assert!(count >= 40);
    assert!(20 * failed.len() <= count, "{} of {count} fail:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn sqp_reaches_the_known_minima() {
    let (count, failed) = failures(&Settings { method: Method::Sqp, ..Settings::default() });
    assert!(20 * failed.len() <= count, "{} of {count} fail:\n{}", failed.len(), failed.join("\n"));
}
