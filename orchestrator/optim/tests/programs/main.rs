//! Nonlinear programs with known minima, from their published starts.

mod element;
mod jet;
mod program;
mod read;

use airloop_optim::{Method, Settings, Solution, Start, Status, solve};
use program::Program;

/// Programs up to this size are solved here; `benches/programs.rs` solves all.
const LARGEST: usize = 100;

/// Programs that are hard for interior points, line searches or Newton steps; the second method where it finds them
/// hard here.
const HARD: [(&str, Option<Method>); 12] = [
    ("BROWNBS", None),
    ("BYRDSPHR", None),
    ("HS13", None),
    ("HS101", None),
    ("HS104", None),
    ("HS109", None),
    ("HS116", None),
    ("MARATOS", None),
    ("POLAK2", None),
    ("SNAKE", None),
    // The SQP leaves for a region from which no solver of the two comes back.
    ("SPIRAL", Some(Method::Sqp)),
    ("WACHBIEG", None),
];

fn solved(program: &mut Program, settings: &Settings) -> Solution {
    let start = Start::cold(program.start.clone());
    solve(program, &start, settings).unwrap()
}

/// Solves every program; how many there are, and a sentence for each that did not reach one of its minima.
fn failures(settings: &Settings) -> (usize, Vec<String>) {
    let mut failed = Vec::new();
    let programs: Vec<_> = read::all().into_iter().filter(|program| program.start.len() <= LARGEST).collect();
    let count = programs.len();
    for mut program in programs {
        let solution = solved(&mut program, settings);
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

#[test]
fn programs_that_are_known_to_be_hard_are_solved() {
    let mut programs = read::all();
    for (name, but) in HARD {
        let program = programs.iter_mut().find(|program| program.name == name).unwrap();
        for method in [Method::InteriorPoint, Method::Sqp].into_iter().filter(|method| Some(*method) != but) {
            let solution = solved(program, &Settings { method, ..Settings::default() });
            assert_eq!(solution.status, Status::Solved, "{name} {method:?}");
            // HS13 has no multipliers at its minimum: the objective is off by the root of the tolerance.
            let minimum = program.minima[0];
            assert!(
                (solution.objective - minimum).abs() <= 1e-4 * minimum.abs().max(1.0),
                "{name} {method:?}"
            );
        }
    }
}

#[test]
fn equations_that_depend_on_each_other_are_dealt_with() {
    let text = "
program TWICE
start 3, 1, -2
minimize x1^2 + x2^2 + x3^2
zero x1 + x2 + x3 - 3
zero 2*x1 + 2*x2 + 2*x3 - 6
minimum 3

program CURVED
start 0.8, -0.1, 0
minimize x1 + x2 + x3^2
zero x1^2 + x2^2 - 1
zero (x1^2 + x2^2)^2 - 1
minimum -sqrt(2)
";
    for mut program in read::read(text) {
        for method in [Method::InteriorPoint, Method::Sqp] {
            let solution = solved(&mut program, &Settings { method, ..Settings::default() });
            assert_eq!(solution.status, Status::Solved, "{} {method:?}", program.name);
            assert!((solution.objective - program.minima[0]).abs() < 1e-7, "{} {method:?}", program.name);
        }
    }
}

#[test]
fn equations_that_contradict_each_other_are_infeasible() {
    let text = "
program CONTRADICTION
start 3, 1, -2
minimize x1^2 + x2^2 + x3^2
zero x1 + x2 + x3 - 3
zero x1 + x2 + x3 - 4
minimum 0
";
    let mut program = read::read(text).remove(0);
    for method in [Method::InteriorPoint, Method::Sqp] {
        let solution = solved(&mut program, &Settings { method, ..Settings::default() });
        assert_eq!(solution.status, Status::Infeasible, "{method:?}");
        assert!(solution.worst.is_some(), "{method:?}");
    }
}
