//! `airloop new`: files to begin with.

use std::path::PathBuf;
use std::process::ExitCode;

use super::args::parse_assignment;
use airloop::Error;
use airloop::new_study::{self, Request};

/// `airloop new`
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Write a commented study for `airloop refine` from the columns of records and a system.
    ///
    /// Columns belong to the inputs and outputs of the system of the same name, others are named with --signal; units
    /// in the header, as in `x [mm]`, are understood. The records are copied into the folder. Of a single record the
    /// first 70 % are for estimation, the rest for validation. Of several, those are for validation whose names say so
    /// (`test`, `val`, `v`), else the last of every kind, as `stairs_3.csv` beside `stairs_1.csv` and `sine_2.csv`.
    #[command(
        after_help = "Example: airloop new study my_pendulum --from swing.csv --system airloop:pendulum --signal theta=angle"
    )]
    Study(StudyArgs),
}

/// `airloop new study`
#[derive(Debug, clap::Args)]
pub struct StudyArgs {
    /// Folder for study.toml and the records; it is made if it is not there.
    pub folder: PathBuf,
    /// CSV file of a record: first column time [s] (or for example `time [ms]`), then a column per signal. May be
    /// repeated.
    #[arg(long, value_name = "FILE", required = true)]
    pub from: Vec<PathBuf>,
    /// System: .ssd, .ssp or .fmu, or airloop:NAME for an FMU of this project, e.g. airloop:pendulum.
    #[arg(long, value_name = "SYSTEM")]
    pub system: String,
    /// Column of an input or output of another name. May be repeated.
    #[arg(long, value_name = "SIGNAL=COLUMN", value_parser = parse_assignment)]
    pub signal: Vec<(String, String)>,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Runs the command.
///
/// # Errors
/// Fails if a record or the system cannot be read, nothing can be compared, or a file is in the way.
pub fn run(command: &Command) -> Result<ExitCode, Error> {
    let Command::Study(args) = command;
    let request = Request {
        folder: args.folder.clone(),
        records: args.from.clone(),
        system: args.system.clone(),
        signals: args.signal.iter().cloned().collect(),
    };
    let (file, notes) = new_study::write(&request)?;
    if !args.quiet {
        let notes: String = notes.iter().map(|note| format!("note: {note}\n")).collect();
        super::output::print(&format!(
            "{}\n{notes}Look through it, then: airloop refine {} -o out/refine\n",
            file.display(),
            args.folder.display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
