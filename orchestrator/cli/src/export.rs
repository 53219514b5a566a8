//! `airloop export`: a system, amended or not, as an SSP file for other tools.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;

use super::args::parse_assignment;
use airloop::Error;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::write::{self, Version};

/// `airloop export`
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    airloop export examples/01_run/system.ssd -o cart_pole.ssp\n  \
    airloop export system.ssd --set cart_pole.m_p=0.12 --ssp-version 1.0 -o amended.ssd")]
pub struct Args {
    /// System: .ssd or .ssp (SSP 1.0 or 2.0), or a single .fmu.
    pub system: PathBuf,
    /// File to write. An .ssd refers to the FMUs by relative paths and holds the start values; an .ssp is an archive
    /// with the FMUs and one parameter set (.ssv) per component that has start values.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Version of the SSP standard to write.
    #[arg(long, value_enum, default_value_t = VersionChoice::V2_0)]
    pub ssp_version: VersionChoice,
    /// Start value of a parameter, input or state, in the unit of the variable: component.variable=value (or
    /// variable=value for a single FMU). May be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_assignment)]
    pub set: Vec<(String, String)>,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--ssp-version`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum VersionChoice {
    /// The current one.
    #[value(name = "2.0")]
    V2_0,
    /// For tools that read no other.
    #[value(name = "1.0")]
    V1_0,
}

impl From<VersionChoice> for Version {
    fn from(choice: VersionChoice) -> Version {
        match choice {
            VersionChoice::V1_0 => Version::V1_0,
            VersionChoice::V2_0 => Version::V2_0,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Fails if the system cannot be read, amended or written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let mut graph = SystemGraph::open_to_read(&args.system)?;
    for (name, value) in &args.set {
        graph.set_start(name, value, &format!("--set {name}={value}"))?;
    }
    let version = args.ssp_version.into();
    write::write(&graph, &args.output, version)?;
    if !args.quiet {
        super::output::print(&report(&graph, args, version))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn report(graph: &SystemGraph, args: &Args, version: Version) -> String {
    let starts: usize = graph.components.iter().map(|component| component.start_values.len()).sum();
    let mut text = format!(
        "{}: SSP {version}, system {}, components: {}, start values: {starts}\n",
        args.output.display(),
        graph.name,
        graph.components.len()
    );
    for note in &graph.notes {
        text += &format!("note: {note}\n");
    }
    if let Some(step) = graph.experiment.step_size {
        text += &format!("note: SSP has no place for the step size; run the file with --step {step}\n");
    }
    text
}
