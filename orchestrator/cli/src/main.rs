//! The command line: words to settings, results to a short text. No numerics here.
//!
//! Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (Ctrl-C, SIGTERM, SIGHUP).

pub mod args;
pub mod coupling;
pub mod derive;
pub mod effects;
pub mod excite;
pub mod export;
pub mod export_fmu;
mod folder;
pub mod identify;
pub mod inspect;
mod inspect_report;
pub mod inspect_system;
mod inspect_worker;
pub mod interrupt;
mod isolate;
#[cfg(test)]
mod keys;
pub mod new;
pub mod optimize;
pub mod output;
mod progress;
#[cfg(test)]
mod reference;
pub mod refine;
mod refine_progress;
mod report;
pub mod resample;
mod restart;
pub mod rig;
pub mod run;
mod run_study;
pub mod stabilize;
pub mod sweep;
mod table;
pub mod trials;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::{Cli, Command};

/// Exit code of wrong usage.
pub const USAGE: u8 = 2;
/// Exit code after Ctrl-C, as shells expect it.
pub const INTERRUPTED: u8 = 130;

/// Parses the command line, does what it says, prints what went wrong.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => return usage(&message),
    };
    if !matches!(&cli.command, Command::FmuWorker) && !is_check_worker(&cli.command) {
        airloop_fmi::last_words::install();
        interrupt::install();
    }
    let outcome = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Export(args) => export::run(&args),
        Command::ExportFmu(args) => export_fmu::run(&args),
        Command::Derive(args) => derive::run(&args),
        Command::Excite(args) => excite::run(&args),
        Command::Resample(args) => resample::run(&args),
        Command::Rig { command } => rig::run(&command),
        Command::Identify { mut command } => identify::run(&mut command),
        Command::Stabilize(args) => stabilize::run(&args),
        Command::Trials(args) => trials::run(&args),
        Command::Optimize(args) => optimize::run(&args),
        Command::Refine(args) => refine::run(&args),
        Command::Sweep { command } => sweep::run(&command),
        Command::FmuWorker => Ok(isolate::work()),
        Command::New { command } => new::run(&command),
        Command::Effects { command } => effects::run(&command),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "airloop", &mut script);
            output::print(&String::from_utf8_lossy(&script)).map(|()| ExitCode::SUCCESS)
        }
    };
    airloop_fmi::last_words::end();
    for note in airloop_fmi::isolate::take_notes() {
        output::to_stderr(&format!("note: {note}"));
    }
    outcome.unwrap_or_else(|error| {
        output::to_stderr(&format!("error: {error}"));
        // A setting out of range is wrong usage, be it a word on its own or only together with others.
        let usage = matches!(
            error,
            airloop::Error::Master(airloop_cosim::master::Error::Setting { .. })
                | airloop::Error::Excite(airloop_ident::excite::Error::Setting { .. })
                | airloop::Error::Structure(_)
        );
        if usage { ExitCode::from(USAGE) } else { ExitCode::FAILURE }
    })
}

/// Whether this is the process that a check runs a library in: there the end of the process is what is looked for.
fn is_check_worker(command: &Command) -> bool {
    matches!(command, Command::Inspect(args) if args.worker.is_some())
}

/// Prints help, version, or what is wrong with the command line.
fn usage(message: &clap::Error) -> ExitCode {
    let printed = message.print().and_then(|()| std::io::Write::flush(&mut std::io::stdout()));
    match output::allow_closed(printed) {
        Ok(()) => ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(USAGE)),
        Err(error) => {
            output::to_stderr(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}
