//! `airloop identify arx`: least squares of an ARX model.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::process::ExitCode;

use serde_json::{Map, Value, json};

use super::data::DataArgs;
use super::output::Results;
use super::report;
use crate::Error;
use crate::cli::output;
use crate::ident::arx::{self, Estimate, NORMAL_95, Names};
use crate::ident::model::{Linear, NamedModel};
use crate::ident::record::Experiments;
use crate::ident::source::Source;
use crate::ident::structure::Structure;
use crate::ident::summary::numbered;

/// `airloop identify arx`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage.\n\nExample: airloop identify arx chirp.csv stairs.csv --inputs u --outputs F_hat,F_p --na 1 --nb 2 --validate check.csv -o out/actuator"
)]
pub struct Args {
    /// Which data, and where the results go.
    #[command(flatten)]
    pub data: DataArgs,
    /// Number of coefficients on past outputs: one number, or a matrix with a row for each output, as "2,1;1,2".
    #[arg(long, default_value = "1", value_name = "ORDERS")]
    pub na: String,
    /// Number of coefficients on inputs, from u(k - nk) on: one number, or a row for each output and a number for each
    /// input, as "2;3".
    #[arg(long, default_value = "2", value_name = "ORDERS")]
    pub nb: String,
    /// Delay of the inputs in samples; 0 is a direct term. As --nb.
    #[arg(long, default_value = "0", value_name = "DELAYS")]
    pub nk: String,
}

/// Runs the command.
///
/// # Errors
/// What keeps it from a model, or its results from being written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let structure = Structure::parse(args.data.channels(), &args.na, &args.nb, &args.nk)?;
    let data = args.data.read()?;
    let sources: Vec<&dyn Source> = data.estimation.iter().map(|record| record as &dyn Source).collect();
    let offsets = (data.input_offset.as_slice(), data.output_offset.as_slice());
    let names = Names { inputs: &data.inputs, outputs: &data.outputs };
    let estimate = arx::estimate(&sources, &structure, data.sample_time, offsets, names)?;
    let mut results = Results::of("arx, least squares", named(&estimate, &data), &data, !args.data.no_plots);
    results.summary.structure = json!({"na": structure.na, "nb": structure.nb, "nk": structure.nk});
    results.summary.diagnostics = diagnostics(&estimate);
    let summary = results.write(&args.data.output)?;
    if !args.data.quiet {
        output::print(&report::report(&summary, &args.data.output))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn named(estimate: &Estimate, data: &Experiments) -> NamedModel {
    NamedModel {
        model: Linear::Arx(estimate.model.clone()),
        inputs: data.inputs.clone(),
        outputs: data.outputs.clone(),
        units: data.units.clone(),
    }
}

/// Uncertainty of the coefficients, in matrices like theirs.
fn diagnostics(estimate: &Estimate) -> Value {
    let deviations: Vec<Vec<f64>> = estimate.equations.iter().map(|e| e.standard_deviations()).collect();
    let slices: Vec<&[f64]> = deviations.iter().map(Vec::as_slice).collect();
    let (a, b) = arx::matrices(&estimate.structure, &slices);
    let deviations: Map<String, Value> = numbered("A", 1, &a).chain(numbered("B", 0, &b)).collect();
    let noise: Vec<Vec<f64>> = crate::ident::model::file::rows(&estimate.noise_covariance);
    json!({
        "standard_deviations": deviations,
        "interval_95_factor": NORMAL_95,
        "noise_covariance": noise,
        "condition": estimate.equations.iter().map(|equation| equation.condition).collect::<Vec<_>>(),
    })
}
