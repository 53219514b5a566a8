//! `airloop refine`: what a declared model lacks, from measured records.
//!
//! Exit codes: 0 effect found, 10 nothing missing, 11 unexplained, 12 effect found that the records cannot tell from
//! others; 1 and 2 as everywhere.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as ClapArgs;

use super::{folder, output};
use crate::refine::answer::{Settings, Verdict, answer};
use crate::refine::case::Case;
use crate::refine::rig::open::open;
use crate::refine::study;
use crate::report;
use crate::{Error, report::words};

/// Exit code when nothing is missing.
pub const NOTHING: u8 = 10;
/// Exit code when something is missing that no candidate explains.
pub const UNEXPLAINED: u8 = 11;
/// Exit code when effects cannot be told apart.
pub const GROUP: u8 = 12;

/// `airloop refine`
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Exit codes: 0 effect found, 10 nothing missing, 11 unexplained, 12 effect found that these records cannot tell from others (see its group in report.json), 1 failure, 2 wrong usage.\n\nExample: airloop refine data/case -o out/refine"
)]
pub struct Args {
    /// Folder with case.toml (declared parameters, sensors, files with their role) and the records as CSV.
    pub case: PathBuf,
    /// Folder for report.json, report.md and report.html; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/refine")]
    pub output: PathBuf,
    /// Seed of the simulated noise; one seed gives one report, on any number of processors.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// Most effects that are added to the declared model.
    #[arg(long, value_name = "NUMBER", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=3))]
    pub max_effects: u8,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Runs the command; the exit code is the verdict.
///
/// # Errors
/// A case that cannot be read or searched, a report that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let names = ["report.json", "report.md", "report.html"].map(str::to_owned);
    let earlier = std::fs::read(args.output.join("report.json")).unwrap_or_default();
    let earlier: serde_json::Value = serde_json::from_slice(&earlier).unwrap_or_default();
    let ours = if earlier["score_kind"].is_string() { &names[..] } else { &[] };
    folder::check_against(&args.output, &[], &names, &ours.iter().cloned().collect())?;
    let (found, name) = match study::find(&args.case)? {
        Some(file) => {
            let found = study::answer::answer(&file, args.max_effects.into(), &|_| ())?;
            (found, file.name())
        }
        None => {
            let case = Case::read(&args.case)?;
            let rig = open(&case)?;
            let groups: Vec<String> = case.declaration.files.iter().map(|file| file.group.clone()).collect();
            let settings =
                Settings { seed: args.seed, max_effects: args.max_effects.into(), ..Settings::default() };
            (answer(&rig, &groups, &settings), case.declaration.id)
        }
    };
    folder::make(&args.output)?;
    report::write(&found, &name, &args.output)?;
    if !args.quiet {
        let rows: Vec<Vec<String>> = words::errors(&found).into_iter().map(Vec::from).collect();
        let header = ["signal", "noise", "before", "after", "before, of the signal", "in noise rms"];
        let rows = super::table::table(&header, &rows, &[1, 2, 3, 4, 5]);
        output::print(&format!("{}\n{}", words::sentence(&found), rows))?;
        output::print(&format!("{}\n", args.output.join("report.html").display()))?;
    }
    let group = found.effects.iter().any(|effect| effect.selected && effect.group.is_some());
    Ok(match found.verdict {
        Verdict::Nothing => ExitCode::from(NOTHING),
        Verdict::Unexplained => ExitCode::from(UNEXPLAINED),
        Verdict::Effect if group => ExitCode::from(GROUP),
        Verdict::Effect => ExitCode::SUCCESS,
    })
}
