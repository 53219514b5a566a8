//! `airloop export`: a system, amended or not, as an SSP file for other tools.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;

use super::args::parse_assignment;
use airloop::Error;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::write::{self, Tool, Version};
use airloop_series::units::parse_duration;

/// `airloop export`
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    airloop export examples/01_run/system.ssd -o cart_pole.ssp\n  \
    airloop export system.ssd --set cart_pole.m_p=0.12 -o amended.ssd\n  \
    airloop export examples/01_run/system.ssd --for libcosim --set u=15 -o closed.ssp")]
pub struct Args {
    /// System: .ssd or .ssp (SSP 1.0 or 2.0), or a single .fmu.
    pub system: PathBuf,
    /// File to write. An .ssd refers to the FMUs by relative paths and holds the start values; an .ssp is an archive
    /// with the FMUs and one parameter set (.ssv) per component that has start values. FMUs made with fmi-export hold
    /// these start values themselves, too, for tools that read no parameter sets.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Version of the SSP standard to write.
    #[arg(long, value_enum, default_value_t = VersionChoice::V1_0)]
    pub ssp_version: VersionChoice,
    /// Tool that reads the file.
    #[arg(long = "for", value_enum, value_name = "TOOL", default_value_t = ToolChoice::Any)]
    pub tool: ToolChoice,
    /// Communication step size that OMSimulator is to take, in seconds unless a unit follows [default: that of the
    /// system, or 1 ms].
    #[arg(long, value_name = "STEP", value_parser = parse_step, allow_hyphen_values = true)]
    pub step: Option<f64>,
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
    /// Read by all tools that read SSP.
    #[value(name = "1.0")]
    V1_0,
    /// The current one; FMPy and Ecos refuse it.
    #[value(name = "2.0")]
    V2_0,
}

/// `--for`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ToolChoice {
    /// The whole system: read by airloop, FMPy and OMSimulator, and by libcosim and Ecos if it has no inputs and
    /// outputs.
    Any,
    /// The same file; says what FMPy leaves out.
    Fmpy,
    /// The same file.
    Omsimulator,
    /// Without inputs and outputs of the system, which libcosim refuses: inputs become constant start values.
    Libcosim,
    /// Same as libcosim.
    Ecos,
}

impl From<ToolChoice> for Tool {
    fn from(choice: ToolChoice) -> Tool {
        match choice {
            ToolChoice::Any => Tool::Any,
            ToolChoice::Fmpy => Tool::Fmpy,
            ToolChoice::Omsimulator => Tool::Omsimulator,
            ToolChoice::Libcosim => Tool::Libcosim,
            ToolChoice::Ecos => Tool::Ecos,
        }
    }
}

impl From<VersionChoice> for Version {
    fn from(choice: VersionChoice) -> Version {
        match choice {
            VersionChoice::V1_0 => Version::V1_0,
            VersionChoice::V2_0 => Version::V2_0,
        }
    }
}

pub(super) fn parse_step(text: &str) -> Result<f64, String> {
    let step = parse_duration(text).map_err(|error| error.to_string())?;
    if step > 0.0 { Ok(step) } else { Err("a step is longer than 0 s".into()) }
}

/// Runs the command.
///
/// # Errors
/// Fails if the system cannot be read, amended or written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let mut graph = SystemGraph::open_to_read(&args.system)?;
    super::folder::check_file(&args.output, &[&args.system])?;
    for (name, value) in &args.set {
        graph.set_start(name, value, &format!("--set {name}={value}"))?;
    }
    graph.experiment.step_size = args.step.or(graph.experiment.step_size);
    let version = args.ssp_version.into();
    write::write_for(&graph, &args.output, version, args.tool.into())?;
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
    for note in graph.notes.iter().chain(&Tool::from(args.tool).notes(graph)) {
        text += &format!("note: {note}\n");
    }
    if let Some(step) = graph.experiment.step_size {
        text += &format!(
            "note: SSP has no place for the step size, only OMSimulator finds it in the file; elsewhere run it with {step} s\n"
        );
    }
    text
}
