//! Perturbed starts of swing-up and half step over their FMUs, one thread: `cargo bench -p airloop-plan --bench starts
//! [-- PROBLEM.toml ...] [hs|trap|ms|sc ...] [starts=N] [intervals=N] [seed=N] [guess=NAME]`.
//!
//! Every scheme from the same perturbations of the guess as `airloop optimize --multistart` draws them
//! ([`airloop_plan::guess::Rough::perturb`]): how many of them reach a minimum, how many minima there are, iterations,
//! and how the others end. Durations are fixed at their guesses for `ms` and `sc`. `make study-programs` runs it.

#![allow(missing_docs, reason = "a bench has no public items")]

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use airloop_ocp::transcription::Transcription;
use airloop_plan::multistart::{Multistart, multistart};
use airloop_plan::prepare::prepare;
use airloop_plan::solve::Settings;
use airloop_plan::{Error, guess};

const STARTS: usize = 100;
/// Examples, and the intervals of multiple shooting, which have to divide the samples of what is sampled.
const EXAMPLES: [(&str, usize); 2] = [("03_swing_up", 100), ("04_half_step", 25)];
const KINDS: [(&str, Transcription); 4] = [
    ("hs", Transcription::HermiteSimpson),
    ("trap", Transcription::Trapezoidal),
    ("ms", Transcription::MultipleShooting),
    ("sc", Transcription::ShootingCollocation),
];

fn main() -> Result<(), Error> {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let text = |name: &str| words.iter().find_map(|word| word.strip_prefix(name));
    let number = |name: &str| text(name).and_then(|value| value.parse::<usize>().ok());
    let (starts, seed) = (number("starts=").unwrap_or(STARTS), number("seed=").unwrap_or(1) as u64);
    let given = words.iter().filter(|word| word.ends_with(".toml"));
    let mut files: Vec<(PathBuf, Option<usize>)> = given.map(|word| (PathBuf::from(word), None)).collect();
    if files.is_empty() {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        files.extend(EXAMPLES.map(|(name, count)| (examples.join(name).join("problem.toml"), Some(count))));
    }
    let has = |word: &str| words.iter().any(|given| given == word);
    let all = KINDS.iter().all(|(name, _)| !has(name));
    println!("kind  solved of  minima  least iterations, median, largest  seconds  others  problem");
    for (file, shooting) in &files {
        let mut prepared = prepare(file)?;
        let choice = guess::choose(&prepared.statement, text("guess="))?;
        let rough = guess::guess(&prepared.statement, &prepared.catalog, &prepared.task, &choice)?;
        for (name, transcription) in KINDS.into_iter().filter(|(name, _)| all || has(name)) {
            // Toes that are sampled, or advanced by matrices of constants, need a fixed duration: the guess.
            if matches!(transcription, Transcription::MultipleShooting | Transcription::ShootingCollocation) {
                for phase in &mut prepared.setup.task.phases {
                    phase.duration = (phase.duration_guess, phase.duration_guess);
                }
            }
            let mut settings = Settings::of(&prepared.statement);
            let own = if transcription == Transcription::MultipleShooting { *shooting } else { None };
            for pass in &mut settings.passes {
                pass.transcription = transcription;
                if let Some(intervals) = number("intervals=").or(own) {
                    pass.intervals.fill(intervals);
                }
            }
            let begin = Instant::now();
            let found =
                multistart(&prepared, &settings, &rough, (starts, seed), &AtomicBool::new(false), &|_| ())?;
            report(name, &found, begin.elapsed().as_secs_f64(), &prepared.statement.name);
        }
    }
    Ok(())
}

/// One row; start 0 is the guess itself and does not count.
fn report(name: &str, found: &Multistart, seconds: f64, problem: &str) {
    let perturbed = &found.outcomes[1..];
    let solved = perturbed.iter().filter(|outcome| outcome.minimum.is_some()).count();
    let runs = || perturbed.iter().filter_map(|outcome| outcome.solved.as_ref().ok());
    let mut iterations: Vec<usize> = runs().map(|solved| solved.iterations()).collect();
    iterations.sort_unstable();
    let at =
        |part: usize| iterations.get(part * iterations.len().saturating_sub(1) / 2).copied().unwrap_or(0);
    let mut others: Vec<String> = perturbed
        .iter()
        .filter(|outcome| outcome.minimum.is_none())
        .map(|outcome| match &outcome.solved {
            Ok(solved) => format!("{:?}", solved.status()),
            Err(error) => error.to_string(),
        })
        .collect();
    others.sort_unstable();
    let mut counted: Vec<(String, usize)> = Vec::new();
    for other in others {
        match counted.last_mut() {
            Some((last, count)) if *last == other => *count += 1,
            _ => counted.push((other, 1)),
        }
    }
    let others: Vec<String> = counted.iter().map(|(status, count)| format!("{count} {status}")).collect();
    println!(
        "{name:4} {solved:7} {:2} {:7} {:8} {:12} {:12} {seconds:14.1}  {}  {problem}",
        perturbed.len(),
        found.minima.len(),
        at(0),
        at(1),
        at(2),
        if others.is_empty() { "-".to_owned() } else { others.join(", ") }
    );
}
