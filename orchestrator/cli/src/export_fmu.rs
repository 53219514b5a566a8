//! `airloop export-fmu`: a whole system as one FMU.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::ValueEnum;

use super::args::parse_assignment;
use super::export::parse_step;
use airloop::Error;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::check::Severity;
use airloop_fmi::{Fmu, template_folder};
use airloop_system::{Master, Recipe, TEMPLATE};

/// Time that the components may take in the check before its process is ended.
const CHECK_LIMIT: Duration = Duration::from_secs(60);

/// `airloop export-fmu`
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    airloop export-fmu examples/01_run/system.ssd -o cart_pole.fmu\n  \
    airloop export-fmu system.ssd --set cart_pole.m_p=0.12 --master jacobi --step 0.5ms -o amended.fmu")]
pub struct Args {
    /// System: .ssd, .ssp, or a single .fmu.
    pub system: PathBuf,
    /// File to write.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Master that steps the components in Co-Simulation; Model Exchange has none.
    #[arg(long, value_enum, default_value_t = MasterChoice::GaussSeidel)]
    pub master: MasterChoice,
    /// Communication step size inside [s], e.g. 1ms or 0.001; a step of the importer is made of these. Default: that
    /// of the default experiment of a single FMU, else 1ms.
    #[arg(long, value_name = "TIME", value_parser = parse_step, allow_hyphen_values = true)]
    pub step: Option<f64>,
    /// Name of the model. Default: that of the system.
    #[arg(long)]
    pub name: Option<String>,
    /// Start value of a parameter, input or state, in the unit of the variable: component.variable=value (or
    /// variable=value for a single FMU). May be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_assignment)]
    pub set: Vec<(String, String)>,
    /// Check the FMU that was written as `airloop inspect --check` does. Errors make the exit code 1.
    #[arg(long)]
    pub check: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--master`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MasterChoice {
    /// Serial: each component gets the new outputs of those before it.
    GaussSeidel,
    /// Parallel: all get the outputs at the communication point.
    Jacobi,
    /// Linearly implicit, with one correction.
    InterfaceJacobian,
}

/// Runs the command.
///
/// # Errors
/// Fails if the system cannot be read, has no interface or platform in common, or the FMU not be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let mut graph = SystemGraph::open_to_read(&args.system)?;
    if !args.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("fmu")) {
        let problem = "give it a name that ends in .fmu; a system is written by `airloop export`".to_owned();
        return Err(Error::OutputFile { file: args.output.clone(), problem });
    }
    super::folder::check_file(&args.output, &[&args.system])?;
    for (name, value) in &args.set {
        graph.set_start(name, value, &format!("--set {name}={value}"))?;
    }
    let default = Recipe::new(&graph);
    let recipe = Recipe {
        name: args.name.clone().unwrap_or_else(|| default.name.clone()),
        master: match args.master {
            MasterChoice::GaussSeidel => Master::GaussSeidel,
            MasterChoice::Jacobi => Master::Jacobi,
            MasterChoice::InterfaceJacobian => Master::InterfaceJacobian,
        },
        step: args.step.unwrap_or(default.step),
        ..default
    };
    let template = template_folder::template(TEMPLATE, None)?;
    let platforms = airloop_system::write(&graph, &recipe, &template, &args.output)?;
    if !args.quiet {
        super::output::print(&format!(
            "{}: {}, components: {}, platforms: {}\n",
            args.output.display(),
            recipe.name,
            graph.components.len(),
            platforms.join(", ")
        ))?;
    }
    if !args.check {
        return Ok(ExitCode::SUCCESS);
    }
    let stop = super::run::stop_flag();
    let findings = super::inspect::check(&Fmu::open(&args.output)?, Some(CHECK_LIMIT), args.quiet, &stop)?;
    let failed = findings.iter().any(|finding| finding.severity == Severity::Error);
    if failed && args.quiet {
        super::output::print(&super::inspect::text(&findings))?;
    }
    if stop.load(std::sync::atomic::Ordering::Relaxed) {
        return Ok(ExitCode::from(super::INTERRUPTED));
    }
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}
