//! `airloop-fuzz`: mutated files for every reader of airloop. The parent makes children of itself, one per batch of
//! inputs, with a limit on memory and on the time of one input; a child that panics, aborts, hangs or takes too much
//! memory is a fault, whose input is kept.
//!
//! Inputs follow from target, seed and number, so that a run can be repeated.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, Subcommand};

mod batch;
mod corpus;
mod input;
mod mutate;
mod runs;
mod supervise;
mod targets;

use targets::Target;

#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Mutates and reads until the time or the inputs are used up; exit code 1 if there were faults
    Run {
        /// Targets; all of them without it
        #[arg(long = "target")]
        targets: Vec<String>,
        /// Time in minutes, shared by the targets
        #[arg(long, default_value_t = 1.0)]
        minutes: f64,
        /// Inputs for each target instead of a time
        #[arg(long)]
        inputs: Option<u64>,
        /// Seed of the mutations
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Folder for inputs that made a fault
        #[arg(long, default_value = "out/fuzz")]
        keep: PathBuf,
    },
    /// Reads files again with the limits of a run; exit code 1 if one makes a fault
    Replay {
        /// Target
        target: String,
        /// Files
        files: Vec<PathBuf>,
    },
    /// Lists the targets
    Targets,
    /// One batch of inputs, in a process that the parent watches
    #[command(hide = true)]
    Batch { target: String, place: PathBuf, seed: u64, from: u64, count: u64 },
    /// One file, in a process that the parent watches
    #[command(hide = true)]
    One { target: String, place: PathBuf, file: PathBuf },
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::from(2)
        }
    }
}

fn run(command: Command) -> Result<bool, String> {
    let find = |name: &String| {
        Target::named(name).ok_or_else(|| format!("there is no target {name}; see `airloop-fuzz targets`"))
    };
    match command {
        Command::Run { targets, minutes, inputs, seed, keep } => {
            let targets = match targets.is_empty() {
                true => Target::ALL.to_vec(),
                false => targets.iter().map(find).collect::<Result<_, _>>()?,
            };
            if !(minutes > 0.0 && minutes.is_finite()) {
                return Err(format!("--minutes is {minutes}; give a time above zero"));
            }
            let share = Duration::from_secs_f64(60.0 * minutes / targets.len() as f64);
            let mut faults = 0;
            for target in targets {
                let budget = match inputs {
                    Some(inputs) => supervise::Budget::Inputs(inputs),
                    None => supervise::Budget::Time(share),
                };
                let outcome = supervise::run(target, seed, &budget, &keep)?;
                println!("{outcome}");
                faults += outcome.faults.len();
            }
            Ok(faults == 0)
        }
        Command::Replay { target, files } => {
            let target = find(&target)?;
            let mut is_good = true;
            for file in &files {
                if let Some(fault) = supervise::replay(target, file)? {
                    println!("{}: {fault}", file.display());
                    is_good = false;
                }
            }
            Ok(is_good)
        }
        Command::Targets => {
            Target::ALL.iter().for_each(|target| println!("{:12} {}", target.name, target.what));
            Ok(true)
        }
        Command::Batch { target, place, seed, from, count } => {
            batch::run(find(&target)?, &place, seed, from, count).map(|()| true)
        }
        Command::One { target, place, file } => batch::one(find(&target)?, &place, &file).map(|()| true),
    }
}
