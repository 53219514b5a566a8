//! `airloop run SYSTEM --study FILE`: a system on the records of a study, compared as the study compares them.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::args::RunArgs;
use super::table::table;
use super::{folder, output};
use airloop::Error;
use airloop_refine::answer::Errors;
use airloop_refine::study;
use airloop_refine::study::replay::{Replay, replay};
use airloop_series::csv;

/// File of all errors.
const SUMMARY: &str = "summary.json";

/// Errors of some records.
#[derive(Serialize)]
struct ErrorsRecord<'a> {
    rms: &'a BTreeMap<String, f64>,
    nrmse: &'a BTreeMap<String, f64>,
}

impl<'a> From<&'a Errors> for ErrorsRecord<'a> {
    fn from(own: &'a Errors) -> ErrorsRecord<'a> {
        ErrorsRecord { rms: &own.rms, nrmse: &own.nrmse }
    }
}

/// One record.
#[derive(Serialize)]
struct Record<'a> {
    name: &'a str,
    role: &'a str,
    file: String,
    #[serde(flatten)]
    errors: ErrorsRecord<'a>,
}

/// `summary.json`.
#[derive(Serialize)]
struct Summary<'a> {
    airloop_version: &'a str,
    system: String,
    study: String,
    estimation: ErrorsRecord<'a>,
    validation: ErrorsRecord<'a>,
    records: Vec<Record<'a>>,
    files: Vec<String>,
}

/// Runs the command.
///
/// # Errors
/// A file that is no study, names that the system does not have, and results that cannot be written.
pub fn run(args: &RunArgs, study: &Path) -> Result<ExitCode, Error> {
    let refuse = |problem: &str| airloop_refine::Error::Case { path: study.into(), problem: problem.into() };
    if !study.exists() {
        return Err(refuse("there is no such file or folder").into());
    }
    let Some(file) = study::find(study)? else {
        let problem = "this is no study: give a study.toml, or a folder with study.toml or dataset.toml";
        return Err(refuse(problem).into());
    };
    let found = replay(&file, &args.system, args.free_run)?;
    let names: Vec<String> =
        (0..found.records.len()).map(|k| format!("record_{}.csv", k + 1)).chain([SUMMARY.into()]).collect();
    let results = folder::Results::open(&args.output, &[args.system.clone(), study.to_owned()], &names)?;
    for (own, name) in found.records.iter().zip(&names) {
        csv::write(&own.series, &results.path().join(name))?;
    }
    let records = found.records.iter().zip(&names).map(|(own, name)| Record {
        name: &own.record,
        role: own.role.word(),
        file: name.clone(),
        errors: (&own.errors).into(),
    });
    let summary = Summary {
        airloop_version: env!("CARGO_PKG_VERSION"),
        system: args.system.display().to_string(),
        study: study.display().to_string(),
        estimation: (&found.errors[0]).into(),
        validation: (&found.errors[1]).into(),
        records: records.collect(),
        files: names.clone(),
    };
    let path = results.path().join(SUMMARY);
    airloop_series::file::write_json(&path, &summary)
        .map_err(|source| airloop_series::csv::Error::Io { path: path.clone(), source })?;
    results.commit()?;
    if !args.quiet {
        output::print(&text(&found))?;
        output::print(&format!("\nresults  {}\n", args.output.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Error over the spread of a record from which on the record stands still but for rounding, so that the ratio says
/// nothing.
const MAX_NRMSE: f64 = 1e4;

/// The errors as a table.
fn text(found: &Replay) -> String {
    let row = |name: &str, role: &str, signal: &String, errors: &Errors| {
        let known = errors.nrmse.get(signal).filter(|own| **own < MAX_NRMSE);
        vec![
            name.to_owned(),
            role.to_owned(),
            signal.clone(),
            format!("{:.5e}", errors.rms[signal]),
            known.map_or_else(|| "-".to_owned(), |own| format!("{:.2} %", 100.0 * own)),
        ]
    };
    let mut rows = Vec::new();
    for (errors, role) in found.errors.iter().zip(["estimation", "validation"]) {
        rows.extend(errors.rms.keys().map(|signal| row("all", role, signal, errors)));
    }
    for own in &found.records {
        rows.extend(own.errors.rms.keys().map(|s| row(&own.record, own.role.word(), s, &own.errors)));
    }
    table(&["record", "role", "signal", "rms", "NRMSE"], &rows, &[3, 4])
}
