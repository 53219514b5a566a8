//! The command line: words to settings, results to a short text. No numerics here.
//!
//! Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (Ctrl-C).

pub mod args;
pub mod coupling;
pub mod export;
pub mod inspect;
pub mod inspect_system;
pub mod run;
mod table;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::{Cli, Command};

/// Exit code after Ctrl-C, as shells expect it.
pub const INTERRUPTED: u8 = 130;

/// Parses the command line, does what it says, prints what went wrong.
pub fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Run(args) => run::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut Cli::command(), "airloop", &mut std::io::stdout());
            Ok(ExitCode::SUCCESS)
        }
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("error: {error}");
        ExitCode::FAILURE
    })
}
