//! Time and iterations of the optimizer on the swing-up, single thread: `cargo bench -p airloop-ocp --bench nlp [--
//! hs|trap|ms|sc|sc+ms... INTERVALS...]`.
//!
//! Two rows per transcription and number of intervals, from the pump guess, equations typed by hand and through the
//! trait `Dynamics`: the shortest of several runs, building the
//! problem included. `tests/reference/swing_up_ipopt.py` gives the same rows for CasADi with IPOPT.

#![allow(missing_docs, reason = "a bench has no public items")]

#[path = "../tests/transcription/cart_pole.rs"]
mod cart_pole;
#[path = "../tests/swing_up/interval.rs"]
mod interval;
#[path = "../tests/swing_up/problem.rs"]
mod problem;

use std::time::{Duration, Instant};

use airloop_ocp::transcription;
use airloop_optim::{Method, Settings, Solution, Start, solve};
use problem::{SwingUp, Transcription};

const REPETITIONS: usize = 5;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let given: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let named = |name: &str| words.iter().any(|word| word == name);
    let all = words.iter().all(|word| word.parse::<usize>().is_ok() || word.starts_with("--"));
    let meshes = if given.is_empty() { vec![100, 200, 400] } else { given };
    println!(
        "transcription  intervals  iterations  factors  QPs     objective         ms  of which functions, ms"
    );
    for transcription in Transcription::ALL.into_iter().filter(|t| all || named(t.name())) {
        for &intervals in &meshes {
            fastest(transcription.name(), intervals, || pump(transcription, intervals));
            let name = format!("{} (trait)", transcription.name());
            fastest(&name, intervals, || over_dynamics(transcription, intervals));
        }
    }
    if all || named("sc+ms") {
        for &intervals in &meshes {
            fastest("sc+ms", intervals, || coarse_to_sampled(intervals));
        }
    }
}

/// Outcome of one way to solve, with the time in the functions.
type Run = (Solution, Duration);

fn pump(transcription: Transcription, intervals: usize) -> Run {
    let mut problem = SwingUp::new(transcription, intervals);
    let start = Start::cold(problem.pump());
    let solution = solve(&mut problem, &start, &Settings::default()).expect("the problem is well posed");
    (solution, problem.elapsed)
}

/// The same problem through the trait `Dynamics`; the time in the functions is not told apart.
fn over_dynamics(transcription: Transcription, intervals: usize) -> Run {
    let guess = SwingUp::new(transcription, intervals).pump();
    let transcription = match transcription {
        Transcription::HermiteSimpson => transcription::Transcription::HermiteSimpson,
        Transcription::Trapezoidal => transcription::Transcription::Trapezoidal,
        Transcription::MultipleShooting => transcription::Transcription::MultipleShooting,
        Transcription::ShootingCollocation => transcription::Transcription::ShootingCollocation,
    };
    let mut problem = cart_pole::swing_up(1);
    let discretization = transcription::Discretization::uniform(transcription, &[intervals]);
    let mut program = transcription::Program::new(&mut problem, &discretization).expect("it fits");
    let start = Start::cold(guess);
    let solution = solve(&mut program, &start, &Settings::default()).expect("the problem is well posed");
    (solution, Duration::ZERO)
}

/// Shooting plus collocation from the pump guess, then multiple shooting from its solution by SQP.
fn coarse_to_sampled(intervals: usize) -> Run {
    let (first, elapsed) = pump(Transcription::ShootingCollocation, intervals);
    let mut problem = SwingUp::new(Transcription::MultipleShooting, intervals);
    let settings = Settings { method: Method::Sqp, ..Settings::default() };
    let solution = solve(&mut problem, &first.restart(), &settings).expect("the problem is well posed");
    let iterations = [first.iterations, solution.iterations[1..].to_vec()].concat();
    (Solution { iterations, ..solution }, elapsed + problem.elapsed)
}

fn fastest(name: &str, intervals: usize, run: impl Fn() -> Run) {
    let mut best: Option<(Duration, Run)> = None;
    for _ in 0..REPETITIONS {
        let begin = Instant::now();
        let found = run();
        let elapsed = begin.elapsed();
        if best.as_ref().is_none_or(|(shortest, _)| elapsed < *shortest) {
            best = Some((elapsed, found));
        }
    }
    let (elapsed, (solution, of_functions)) = best.expect("there are repetitions");
    println!(
        "{name:13} {intervals:10}  {:10}  {:7}  {:3}  {:.9}  {:6.2}  {:6.2}  {}",
        solution.iterations.len() - 1,
        solution.evaluations.factorizations,
        solution.evaluations.quadratic_programs,
        solution.objective,
        1e3 * elapsed.as_secs_f64(),
        1e3 * of_functions.as_secs_f64(),
        solution.status
    );
}
