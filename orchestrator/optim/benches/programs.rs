//! The programs of `tests/programs`, one thread:
//! `cargo bench -p airloop-optim --bench programs [-- sqp] [trace] [NAME ...]`.
//!
//! Prints one line of comma-separated values per program: size, status, objective, largest violation, the KKT error,
//! iterations, evaluations, factorizations, and the least time of several solves, with the part in the functions. With
//! `trace` also every iteration, to the standard error.
//! `tests/study/programs/profile.py` puts IPOPT beside it.

#![allow(missing_docs, reason = "a bench has no public items")]

#[path = "../tests/programs/element.rs"]
mod element;
#[path = "../tests/programs/jet.rs"]
mod jet;
#[path = "../tests/programs/program.rs"]
mod program;
#[path = "../tests/programs/read.rs"]
mod read;

use std::time::{Duration, Instant};

use airloop_optim::{Method, Settings, Start, solve};

const REPETITIONS: usize = 5;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let method = if words.iter().any(|word| word == "sqp") { Method::Sqp } else { Method::InteriorPoint };
    let trace = words.iter().any(|word| word == "trace");
    let names: Vec<&String> =
        words.iter().filter(|word| !["sqp", "trace"].contains(&word.as_str())).collect();
    let settings = Settings { method, max_iterations: 3000, ..Settings::default() };
    println!(
        "name,variables,constraints,status,objective,violation,error,iterations,functions,gradients,hessians,factorizations,programs,ms,functions_ms"
    );
    for mut program in read::all() {
        if !names.is_empty() && !names.iter().any(|name| **name == program.name) {
            continue;
        }
        let start = Start::cold(program.start.clone());
        let (mut least, mut of_functions, mut found) = (Duration::MAX, Duration::ZERO, None);
        for _ in 0..REPETITIONS {
            program.elapsed = Duration::ZERO;
            let begin = Instant::now();
            let solution = solve(&mut program, &start, &settings).expect("the program is well posed");
            if begin.elapsed() < least {
                (least, of_functions) = (begin.elapsed(), program.elapsed);
            }
            found = Some(solution);
        }
        let solution = found.expect("there are repetitions");
        if trace {
            solution.iterations.iter().enumerate().for_each(|(k, row)| eprintln!("{k:4} {row:?}"));
        }
        let counts = &solution.evaluations;
        println!(
            "{},{},{},{:?},{:e},{:e},{:e},{},{},{},{},{},{},{:.4},{:.4}",
            program.name,
            program.start.len(),
            program.rows.len(),
            solution.status,
            solution.objective,
            solution.violation,
            solution.error,
            solution.iterations.len() - 1,
            counts.functions,
            counts.gradients,
            counts.hessians,
            counts.factorizations,
            counts.quadratic_programs,
            1e3 * least.as_secs_f64(),
            1e3 * of_functions.as_secs_f64()
        );
    }
}
