//! Time and iterations of the optimiser on the swing-up, single thread: `cargo bench --bench nlp [-- hs|trap|ms|sc... INTERVALS...]`.
//!
//! One row per transcription and number of intervals, from the pump guess: the shortest of several runs, building the
//! problem included. `tests/reference/swing_up_ipopt.py` gives the same rows for CasADi with IPOPT.

#[path = "../tests/swing_up/interval.rs"]
mod interval;
#[path = "../tests/swing_up/mechanics.rs"]
mod mechanics;
#[path = "../tests/swing_up/problem.rs"]
mod problem;

use std::time::Instant;

use airloop::optim::{Method, Settings, Start, solve};
use problem::{SwingUp, Transcription};

const REPETITIONS: usize = 7;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let given: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let named = |t: &Transcription| words.iter().any(|word| word == t.name());
    let all = !Transcription::ALL.iter().any(named);
    let meshes = if given.is_empty() { vec![100, 200, 400] } else { given };
    println!(
        "method         transcription  intervals  iterations  factors  objective         ms     of which functions, ms"
    );
    for method in [Method::InteriorPoint] {
        for transcription in Transcription::ALL.into_iter().filter(|t| all || named(t)) {
            for &intervals in &meshes {
                row(method, transcription, intervals);
            }
        }
    }
}

fn row(method: Method, transcription: Transcription, intervals: usize) {
    let settings = Settings { method, ..Settings::default() };
    let mut best = f64::INFINITY;
    let mut of_functions = f64::INFINITY;
    let mut last = None;
    for _ in 0..REPETITIONS {
        let begin = Instant::now();
        let mut problem = SwingUp::new(transcription, intervals);
        let start = Start::cold(problem.pump());
        let solution = solve(&mut problem, &start, &settings).expect("the problem is well posed");
        best = best.min(begin.elapsed().as_secs_f64());
        of_functions = of_functions.min(problem.elapsed.as_secs_f64());
        last = Some(solution);
    }
    let solution = last.expect("there are repetitions");
    println!(
        "{:14} {:13} {intervals:10}  {:10}  {:7}  {:.9}  {:6.2}  {:6.2}   {}",
        format!("{method:?}"),
        transcription.name(),
        solution.iterations.len() - 1,
        solution.evaluations.factorisations,
        solution.objective,
        1e3 * best,
        1e3 * of_functions,
        solution.status
    );
}
