//! Swing-up over the coupled FMUs, single thread, from the files to the optimum:
//! `cargo bench --bench swing_up_fmus [-- hs|trap|ms|sc ... INTERVALS ... by-hand]`.
//!
//! One row per transcription and number of intervals, from the pump guess: CPU time of opening the FMUs, of building the
//! problem and of the solver, the least of several runs. With `by-hand`, also over the equations typed by hand, without
//! FMUs. `tests/reference/swing_up_ipopt.py` gives the rows of CasADi with IPOPT; `make study-swing-up` sets them side by
//! side. Whole numbers beyond 1000 are meshes too: the sample time of 1 ms then is an interval of its own at 2000.

#![allow(missing_docs, reason = "a bench has no public items")]

#[path = "../tests/transcription/cart_pole.rs"]
mod cart_pole;
#[path = "../tests/swing_up/interval.rs"]
mod interval;
#[path = "../tests/swing_up/mechanics.rs"]
mod mechanics;
#[allow(dead_code, reason = "only the guess is used")]
#[path = "../tests/swing_up/problem.rs"]
mod problem;

use std::path::Path;

use airloop::coupled::{Options, System};
use airloop::fmu::InterfaceKind;
use airloop::optim::{Settings, Solution, Start, solve};
use airloop::system::SystemGraph;
use airloop::transcription::{Discretisation, Dynamics, Program, Transcription};

const REPETITIONS: usize = 3;
const STATES: [&str; 6] =
    ["cart_pole.x", "cart_pole.theta", "cart_pole.v", "cart_pole.omega", "actuator.z[1]", "actuator.z[2]"];
const KINDS: [(&str, Transcription, problem::Transcription); 4] = [
    ("hs", Transcription::HermiteSimpson, problem::Transcription::HermiteSimpson),
    ("trap", Transcription::Trapezoidal, problem::Transcription::Trapezoidal),
    ("ms", Transcription::MultipleShooting, problem::Transcription::MultipleShooting),
    ("sc", Transcription::ShootingCollocation, problem::Transcription::ShootingCollocation),
];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let given: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let meshes = if given.is_empty() { vec![100, 200, 400] } else { given };
    let has = |word: &str| words.iter().any(|given| given == word);
    let all = KINDS.iter().all(|(name, ..)| !has(name));
    println!(
        "source   kind  count  iterations         objective  load, ms  build, ms  solve, ms  total, ms  (CPU)"
    );
    for (name, transcription, typed) in KINDS.into_iter().filter(|(name, ..)| all || has(name)) {
        for &count in &meshes {
            let guess = problem::SwingUp::new(typed, count).pump();
            fastest("FMUs", name, count, || run(from_fmus, transcription, count, &guess));
            if has("by-hand") {
                fastest("by-hand", name, count, || run(by_hand, transcription, count, &guess));
            }
        }
    }
}

/// CPU time of this thread, ms.
fn cpu() -> f64 {
    let schedule =
        std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux tells the time of a thread");
    let nanoseconds = schedule.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
    1e-6 * nanoseconds.expect("the first number is the time on the processor")
}

fn from_fmus() -> Box<dyn Dynamics> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/01_run/system.ssd");
    let graph =
        SystemGraph::open_for(&file, InterfaceKind::ModelExchange).expect("`make fmu` builds the FMUs");
    let options = Options { states: Some(STATES.map(str::to_owned).to_vec()), ..Options::default() };
    Box::new(System::open(&graph, &options).expect("the example has continuous dynamics"))
}

fn by_hand() -> Box<dyn Dynamics> {
    Box::new(cart_pole::CartPole::new())
}

/// Times \[ms\] of loading, building and solving.
type Run = ([f64; 3], Solution);

fn run(dynamics: fn() -> Box<dyn Dynamics>, kind: Transcription, count: usize, guess: &[f64]) -> Run {
    let begin = cpu();
    let dynamics = dynamics();
    let loaded = cpu();
    let mut problem = cart_pole::swing_up(1);
    problem.phases[0].dynamics = vec![dynamics];
    let mut program =
        Program::new(&mut problem, &Discretisation::uniform(kind, &[count])).expect("well posed");
    let built = cpu();
    let solution =
        solve(&mut program, &Start::cold(guess.to_vec()), &Settings::default()).expect("well posed");
    ([loaded - begin, built - loaded, cpu() - built], solution)
}

fn fastest(source: &str, name: &str, count: usize, run: impl Fn() -> Run) {
    let runs = (0..REPETITIONS).map(|_| run());
    let total = |(times, _): &Run| times.iter().sum::<f64>();
    let best = runs.min_by(|a, b| total(a).total_cmp(&total(b))).expect("there are repetitions");
    let ([load, build, solve], solution) = &best;
    println!(
        "{source:8} {name:4} {count:6} {:11} {:17.9} {load:9.2} {build:10.2} {solve:10.2} {:10.2}  {}",
        solution.iterations.len() - 1,
        solution.objective,
        total(&best),
        solution.status
    );
}
