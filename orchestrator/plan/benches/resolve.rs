//! Re-solves of the swing-up over its FMUs, one thread: `cargo bench -p airloop-plan --bench resolve [-- PROBLEM.toml]
//! [INTERVALS, default 50] [every] [seed=N] [draws=N] [off=PERCENT] [each]`.
//!
//! Every state at the start is off by 2 % (or as given) of the largest magnitude that it has in the plan, up or down:
//! 200 draws of the signs, or as many as given, or all there are with `every`. Each re-solve starts from the optimum of
//! the plan, with its multipliers; its time is the least of several runs, in wall-clock time. Prints median, 99th
//! percentile and largest, and the same of iterations; how many are solved, to the tolerance or to the acceptable one
//! (without exact derivatives their rounding is all that is left); how many allocate after the first; and compares each
//! optimum with solvers made anew: without multipliers from the optimum found (`from there`), and from the guess of the
//! problem file as `airloop optimize` does (`from the guess`), which may find another minimum. With `each` a line for
//! every re-solve, with its evaluations. `tests/study/swing_up.py` prints it.

#![allow(missing_docs, reason = "a bench has no public items")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use airloop_ocp::transcription;
use airloop_optim::{Evaluations, Status};
use airloop_plan::prepare::{Prepared, prepare};
use airloop_plan::solve::{Begin, Session, Settings};
use airloop_plan::{Error, guess, solver::Solver};
use airloop_series::random::Random;
use airloop_testing::allocations;

airloop_testing::count_allocations!();

const OFF: f64 = 2.0;
const DRAWS: usize = 200;
const REPETITIONS: usize = 5;
/// Objectives of one optimum differ by less than this, relatively.
const SAME_OPTIMUM: f64 = 1e-8;

/// One re-solve.
struct Resolve {
    time: Duration,
    iterations: usize,
    evaluations: Evaluations,
    objective: f64,
    status: Status,
    allocations: u64,
    /// Relative difference to a solver made anew, from the optimum found.
    from_there: f64,
    /// Objective of a solver made anew, from the guess, where it found one.
    from_guess: Option<f64>,
}

fn main() -> Result<(), Error> {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let intervals = words.iter().find_map(|word| word.parse().ok()).unwrap_or(50);
    let number = |name: &str| words.iter().find_map(|word| word.strip_prefix(name)?.parse::<usize>().ok());
    let seed = number("seed=").map_or(1, |seed| seed as u64);
    let percent = words.iter().find_map(|word| word.strip_prefix("off=")?.parse().ok()).unwrap_or(OFF);
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/03_swing_up/problem.toml");
    let file = words.iter().find(|word| word.ends_with(".toml")).map_or(example, PathBuf::from);
    let prepared = prepare(&file)?;
    let mut settings = Settings::of(&prepared.statement);
    settings.passes.iter_mut().for_each(|pass| pass.intervals.fill(intervals));
    let began = Instant::now();
    let mut solver = Solver::new(prepare(&file)?, Some(settings.clone()))?;
    println!("first solve with opening the FMUs: {:.1} ms", 1e3 * began.elapsed().as_secs_f64());

    solver.solve()?;
    let nominal = (solver.trajectory()?, solver.inner().duals()?);
    let states = &nominal.0.phases[0].states;
    let largest: Vec<f64> =
        (0..states[0].len()).map(|i| states.iter().fold(0.0, |m: f64, x| m.max(x[i].abs()))).collect();
    println!("objective of the plan: {:.9}", nominal.0.objective);
    let count = largest.len();
    let mut random = Random::new(seed);
    let mut draw = |case: usize| -> Vec<bool> {
        match words.iter().any(|word| word == "every") {
            true => (0..count).map(|i| case >> i & 1 == 1).collect(),
            false => (0..count).map(|_| random.symmetric() > 0.0).collect(),
        }
    };
    let cases =
        if words.iter().any(|word| word == "every") { 1 << count } else { number("draws=").unwrap_or(DRAWS) };
    let mut all = Vec::new();
    for case in 0..cases {
        let signs = draw(case);
        let off = |i: usize| 0.01 * percent * if signs[i] { largest[i] } else { -largest[i] };
        let initial: Vec<f64> = (0..count).map(|i| states[0][i] + off(i)).collect();
        all.push(resolve(&mut solver, &nominal, &initial, &prepared, &settings)?);
    }
    if words.iter().any(|word| word == "each") {
        all.sort_by_key(|one| one.time);
        for one in &all {
            let counts = &one.evaluations;
            println!(
                "{:7.2} ms, iterations {:3}, functions {:3}, Hessians {:3}, factorizations {:3}, programs {:2}, f {:.6}, from the guess {:.6}",
                1e3 * one.time.as_secs_f64(),
                one.iterations,
                counts.functions,
                counts.hessians,
                counts.factorizations,
                counts.quadratic_programs,
                one.objective,
                one.from_guess.unwrap_or(f64::NAN)
            );
        }
    }
    report(&mut all);
    Ok(())
}

fn resolve(
    solver: &mut Solver,
    (trajectory, duals): &(transcription::Trajectory, transcription::Duals),
    initial: &[f64],
    prepared: &Prepared,
    settings: &Settings,
) -> Result<Resolve, Error> {
    let mut time = Duration::MAX;
    let mut counted = 0;
    for _ in 0..REPETITIONS {
        solver.inner().start_at(trajectory, Some(duals))?;
        let (before, began) = (allocations::count(), Instant::now());
        solver.set_initial(initial)?;
        solver.solve()?;
        time = time.min(began.elapsed());
        counted = allocations::count() - before;
    }
    let solution = solver.inner().solution();
    let (objective, status) = (solution.objective, solution.status.clone());
    let (iterations, evaluations) = (solution.iterations.len() - 1, solution.evaluations);
    let found = solver.trajectory()?;

    let problem = Session::new(prepared, 1)?.into_problem();
    let pass = &settings.passes[settings.passes.len() - 1];
    let mesh = transcription::Discretization::uniform(pass.transcription, &pass.intervals);
    let options = airloop_optim::Settings::default();
    let mut anew = transcription::Solver::along(problem, &mesh, &found, None, &options)?;
    anew.set_initial(initial)?;
    let there = anew.solve(&mut |_| ControlFlow::Continue(()))?;
    let from_there = match &there.status {
        status if solved(status) => (there.objective - objective).abs() / objective,
        _ => f64::INFINITY,
    };

    let mut task = prepared.task.clone();
    task.phases[0].initial = initial.iter().map(|&value| (value, value)).collect();
    let choice = guess::choose(&prepared.statement, None)?;
    let rough = guess::guess(&prepared.statement, &prepared.catalog, &task, &choice)?;
    let mut session = Session::with_task(prepared, &task, 1)?;
    let go_on = &mut |_: &airloop_plan::solve::Progress| ControlFlow::Continue(());
    let cold = session.solve(&prepared.setup, settings, Begin::From(&rough), go_on)?;
    let from_guess = solved(cold.status()).then_some(cold.trajectory().objective);
    Ok(Resolve {
        time,
        iterations,
        evaluations,
        objective,
        status,
        allocations: counted,
        from_there,
        from_guess,
    })
}

fn solved(status: &Status) -> bool {
    matches!(status, Status::Solved | Status::Acceptable)
}

fn report(all: &mut [Resolve]) {
    let count = all.len();
    let at = |part: f64| ((part * count as f64).ceil() as usize).clamp(1, count) - 1;
    all.sort_by_key(|one| one.iterations);
    let [median, p99] = [0.5, 0.99].map(at);
    println!(
        "iterations: median {}, 99th percentile {}, largest {}",
        all[median].iterations,
        all[p99].iterations,
        all[count - 1].iterations
    );
    all.sort_by_key(|one| one.time);
    let ms = |one: &Resolve| 1e3 * one.time.as_secs_f64();
    let [p75, p90] = [0.75, 0.9].map(at);
    println!(
        "re-solves: {count}, median {:.2} ms, 75 % {:.2} ms, 90 % {:.2} ms, 99th percentile {:.2} ms, largest {:.2} ms",
        ms(&all[median]),
        ms(&all[p75]),
        ms(&all[p90]),
        ms(&all[p99]),
        ms(&all[count - 1])
    );
    let total = |of: fn(&Resolve) -> usize| all.iter().map(of).sum::<usize>() as f64;
    let time: f64 = all.iter().map(ms).sum();
    println!(
        "per iteration: {:.3} ms, {:.2} factorizations",
        time / total(|one| one.iterations),
        total(|one| one.evaluations.factorizations) / total(|one| one.iterations)
    );
    let number = |of: &dyn Fn(&Resolve) -> bool| all.iter().filter(|one| of(one)).count();
    println!(
        "solved: {} of {count}, {} of them to the acceptable tolerance; without allocation: {}",
        number(&|one| solved(&one.status)),
        number(&|one| one.status == Status::Acceptable),
        number(&|one| one.allocations == 0)
    );
    println!(
        "same optimum as a solver made anew from there: {} of {count}, largest relative difference {:.1e}",
        number(&|one| one.from_there <= SAME_OPTIMUM),
        all.iter().fold(0.0, |m: f64, one| m.max(one.from_there))
    );
    let gap =
        |one: &Resolve| one.from_guess.map_or(f64::INFINITY, |other| (other - one.objective) / one.objective);
    println!(
        "from the guess: the same minimum {}, a better one {}, a worse one or none {}",
        number(&|one| gap(one).abs() <= SAME_OPTIMUM),
        number(&|one| gap(one) < -SAME_OPTIMUM),
        number(&|one| gap(one) > SAME_OPTIMUM)
    );
}
