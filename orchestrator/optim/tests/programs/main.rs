//! Nonlinear programs with known minima, from their published starts.

mod element;
mod jet;
mod program;
mod read;

use airloop_optim::{Method, Settings, Start, solve};

/// Programs up to this size are solved here; `benches/programs.rs` solves all.
const LARGEST: usize = 100;

/// Solves every program; how many there are, and a sentence for each that did not reach one of its minima.
fn failures(settings: &Settings) -> (usize, Vec<String>) {
    let mut failed = Vec::new();
    let programs: Vec<_> = read::all().into_iter().filter(|program| program.start.len() <= LARGEST).collect();
    let count = programs.len();
    for mut program in programs {
        let start = Start::cold(program.start.clone());
        let solution = solve(&mut program, &start, settings).unwrap();
        // The published minima have 7 digits or more; 1e-6 leaves room for the last of them.
        let reached = |minimum: &f64| (solution.objective - minimum).abs() <= 1e-6 * minimum.abs().max(1.0);
        let found = program.minima.iter().any(reached) && solution.violation <= 1e-7;
        println!(
            "{:8} {:3} iterations, f = {:.9}, violation {:.1e}, error {:.1e}: {}",
            program.name,
            solution.iterations.len() - 1,
            solution.objective,
            solution.violation,
            solution.error,
            solution.status
        );
        if !found {
            failed.push(format!(
                "{}: f = {}, not {:?}, {}",
                program.name, solution.objective, program.minima, solution.status
            ));
        }
    }
    (count, failed)
}

#[test]
fn interior_point_reaches_the_known_minima() {
    let (count, failed) = failures(&Settings { method: Method::InteriorPoint, ..Settings::default() });
    assert!(count >= 100);
    assert!(20 * failed.len() <= count, "{} of {count} fail:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn sqp_reaches_the_known_minima() {
    let (count, failed) = failures(&Settings { method: Method::Sqp, ..Settings::default() });
    assert!(20 * failed.len() <= count, "{} of {count} fail:\n{}", failed.len(), failed.join("\n"));
}
