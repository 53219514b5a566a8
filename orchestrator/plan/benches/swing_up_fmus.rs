//! The swing-up over the coupled FMUs, single thread, from the files to the optimum: `cargo bench -p airloop-plan
//! --bench swing_up_fmus [-- hs|trap|ms|sc ... INTERVALS ... by-hand calls solution=FILE]`.
//!
//! One row per transcription and number of intervals, from the pump guess: CPU time of opening the FMUs, of building
//! the problem and of the solver, the least of several runs. `by-hand` adds the equations typed by hand, without FMUs;
//! `solution=FILE` writes the variables of the last optimum, one per line. `calls` gives the CPU time of one evaluation
//! instead: of values at a new point, of first derivatives there, and of second derivatives after that.
//! `tests/study/swing_up.py` compares the rows with those of CasADi with IPOPT.

#![allow(missing_docs, reason = "a bench has no public items")]

#[path = "../../ocp/tests/transcription/cart_pole.rs"]
mod cart_pole;
#[path = "../../ocp/tests/swing_up/interval.rs"]
mod interval;
#[allow(dead_code, reason = "only the guess is used")]
#[path = "../../ocp/tests/swing_up/problem.rs"]
mod problem;

use std::path::Path;

use airloop_cosim::coupled::{Options, System};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_ocp::transcription::{Discretization, Dynamics, Point, Program, Transcription};
use airloop_optim::{Settings, Solution, Start, solve};

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
    if has("calls") {
        return calls();
    }
    let file = words.iter().find_map(|word| word.strip_prefix("solution="));
    let all = KINDS.iter().all(|(name, ..)| !has(name));
    println!(
        "source   kind  count  iterations         objective  load, ms  build, ms  solve, ms  total, ms  (CPU)"
    );
    for (name, transcription, typed) in KINDS.into_iter().filter(|(name, ..)| all || has(name)) {
        for &count in &meshes {
            let guess = problem::SwingUp::new(typed, count).pump();
            let solution = fastest("FMUs", name, count, || run(from_fmus, transcription, count, &guess));
            if let Some(file) = file {
                let lines: String = solution.x.iter().map(|value| format!("{value:e}\n")).collect();
                std::fs::write(file, lines).expect("the file can be written");
            }
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
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/01_run/system.ssd");
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
        Program::new(&mut problem, &Discretization::uniform(kind, &[count])).expect("well posed");
    let built = cpu();
    let solution =
        solve(&mut program, &Start::cold(guess.to_vec()), &Settings::default()).expect("well posed");
    ([loaded - begin, built - loaded, cpu() - built], solution)
}

fn fastest(source: &str, name: &str, count: usize, run: impl Fn() -> Run) -> Solution {
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
    best.1
}

/// Time of single evaluations.
fn calls() {
    let mut system = from_fmus();
    let size = system.size();
    let (mut values, mut jacobian) = (vec![0.0; size.values()], vec![0.0; size.values() * size.arguments()]);
    let mut hessian = vec![0.0; size.arguments() * size.arguments()];
    let weights = vec![0.7; size.values()];
    let mut total = [0.0; 3];
    const COUNT: usize = 4000;
    const REPEATED: usize = 50;
    for repetition in 0..REPEATED {
        let point = |k: usize| {
            let phase = 1e-3 * (repetition * COUNT + k) as f64;
            let (s, c) = phase.sin_cos();
            ([0.1 * s, 3.0 * c, 0.3 * s, 4.0 * c, 20.0 * s, 30.0 * c], [50.0 * s])
        };
        let points: Vec<_> = (0..COUNT).map(point).collect();
        for (kind, total) in total.iter_mut().enumerate() {
            let begin = cpu();
            for (k, (states, inputs)) in points.iter().enumerate() {
                let at = Point { time: 1e-3 * k as f64, states, inputs };
                let outcome = match kind {
                    0 => system.evaluate(at, &mut values),
                    1 => system.jacobian(at, &mut values, &mut jacobian),
                    _ => system.hessian(at, &weights, &mut hessian),
                };
                outcome.expect("the FMUs take these points");
            }
            *total += cpu() - begin;
        }
    }
    let [values, first, second] = total.map(|milliseconds| 1e6 * milliseconds / (COUNT * REPEATED) as f64);
    println!("values {values:.0} ns, first derivatives {first:.0} ns more, second {second:.0} ns more (CPU)");
}
