//! `airloop derive`: one of our FMUs with start values, name and GUID of its own.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::args::parse_assignment;
use airloop::Error;
use airloop_fmi::derive::{Derivation, Value, derive};
use airloop_fmi::{Fmu, template_folder};

/// `airloop derive`
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: airloop derive arx-actuator --set 'A1[1,1]=-1.0081' --set nk=2 -o toe.fmu")]
pub struct Args {
    /// FMU to start from: a file, or the name of one of ours such as arx-actuator (looked for in the folder of the
    /// environment variable AIRLOOP_FMUS, else next to the program, else in target/fmu).
    pub template: PathBuf,
    /// File to write. Default for the name of the model: the name of the file.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Name of the model.
    #[arg(long)]
    pub name: Option<String>,
    /// Description of the model, one sentence. Default: that of the FMU to start from.
    #[arg(long, default_value = "")]
    pub description: String,
    /// Start value of a parameter, input or state, in the unit of the variable. May be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_assignment)]
    pub set: Vec<(String, String)>,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Runs the command.
///
/// # Errors
/// Fails if the FMU cannot be read, changed or written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let template = find(&args.template)?;
    let fmu = Fmu::open(&template)?;
    super::folder::check_file(&args.output, &[&template])?;
    let start = args
        .set
        .iter()
        .map(|(name, text)| (name.clone(), Value::parse(text, name, &fmu.description)))
        .collect();
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let derivation = Derivation {
        name: args.name.clone().unwrap_or(stem),
        description: args.description.clone(),
        start,
        resources: Vec::new(),
    };
    let guid = derive(&template, &args.output, &derivation)?;
    if !args.quiet {
        super::output::print(&format!(
            "{}: {} with {} start values of its own, guid {guid}\n",
            args.output.display(),
            fmu.description.model_name,
            args.set.len()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A name without ending and folder is one of our FMUs.
fn find(template: &Path) -> Result<PathBuf, Error> {
    match template.to_str() {
        Some(name) if template.extension().is_none() && !name.contains(['/', '\\']) => {
            Ok(template_folder::template(name, None)?)
        }
        _ => Ok(template.to_owned()),
    }
}
