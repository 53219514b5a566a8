//! `airloop identify compare`: which order is enough?

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::data::DataArgs;
use super::report::{percent, text_table};
use super::state_space::MethodArgs;
use crate::{folder, output, progress};
use airloop::Error;
use airloop_ident::compare::{self, Entry, Family};
use airloop_ident::record::Experiments;
use airloop_ident::score::Score;
use airloop_ident::subspace::{Order, pieces};
use airloop_ident::summary::SCHEMA_VERSION;
use airloop_report::plot;
use airloop_report::plot::fit_page::{self, Page, Table};
use airloop_report::plot::identification::{self, OrderFit, fit_against_order};
use airloop_series::{csv, file::write_whole};

/// `airloop identify compare`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage.\n\nExample: airloop identify compare chirp.csv stairs.csv --inputs u --outputs F_hat,F_p --validate check.csv -o out/compare"
)]
pub struct Args {
    /// Data to use, and the folder of the results.
    #[command(flatten)]
    pub data: DataArgs,
    /// ARX orders, as 1..8 or 3; order n has n matrices A on past outputs and n + 1 matrices B from u(k) on, so that
    /// order 1 has A1, B0 and B1 (eq. 7).
    #[arg(long, default_value = "1..8", value_name = "ORDERS", value_parser = parse_orders)]
    pub arx: Orders,
    /// State-space orders, as 1..8 or 3, with direct term.
    #[arg(long, default_value = "1..8", value_name = "ORDERS", value_parser = parse_orders)]
    pub state_space: Orders,
    /// Method by which the state-space models are estimated.
    #[command(flatten)]
    pub method: MethodArgs,
}

/// Orders from a first to a last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Orders {
    first: usize,
    last: usize,
}

impl Orders {
    fn range(self) -> RangeInclusive<usize> {
        self.first..=self.last
    }
}

fn parse_orders(text: &str) -> Result<Orders, String> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let number = |text: &str| text.trim().trim_start_matches('=').parse::<usize>().ok();
    match (number(first), number(last)) {
        (Some(first), Some(last)) if first >= 1 && first <= last && last <= 40 => Ok(Orders { first, last }),
        _ => Err("write orders from 1 to 40, as 1..8 or 3".into()),
    }
}

/// Contents of summary.json.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    schema_version: u32,
    airloop_version: &'a str,
    method: &'a str,
    inputs: &'a [String],
    outputs: &'a [String],
    sample_time: f64,
    models: &'a [Entry],
    enough: Enough,
    verdict: &'a [String],
    warnings: &'a [String],
    figures: &'a [String],
    files: [&'a str; 1],
}

/// Orders that are enough.
#[derive(Debug, Serialize)]
struct Enough {
    arx: Option<usize>,
    state_space: Option<usize>,
}

/// Runs the command.
///
/// # Errors
/// Fails if there is nothing to compare, or the results cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let names = ["compare.csv", "index.html", "summary.json"].map(str::to_owned);
    folder::check(&args.data.output, &args.data.inputs_read(), &names)?;
    let mut data = args.data.read()?;
    let mut warnings = data.notes.clone();
    if data.validation.is_empty() {
        warnings.push(hold_out(&mut data));
    }
    let mut entries = compare::arx_orders(&data, args.arx.range())?;
    let options = args.method.options(Order::Fixed(args.state_space.last), &data);
    let bar = progress(args);
    let refinement = args.method.refinement();
    let orders = args.state_space.range();
    let found = compare::state_space_orders(&data, orders, &options, refinement, || bar.inc(1));
    bar.finish_and_clear();
    entries.extend(found?);
    let verdict = compare::verdict(&entries);
    write(&args.data, &data, &entries, &verdict, &warnings)?;
    if !args.data.quiet {
        let folder = &args.data.output;
        let mut text = format!("{}\n", text_table(&table(&entries)));
        verdict.iter().for_each(|sentence| text += &format!("{sentence}\n"));
        warnings.iter().for_each(|warning| text += &format!("warning: {warning}\n"));
        text += &format!("table:   {}\n", folder.join("compare.csv").display());
        output::print(&(text + &format!("details: {}\n", folder.join("index.html").display())))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Without validation files some of the data judge; says which.
fn hold_out(data: &mut Experiments) -> String {
    let (used, kept) = pieces::held_out(&pieces::lengths(&data.estimation));
    let whole = kept.iter().all(|piece| piece.1 == 0);
    data.validation = pieces::cut(&data.estimation, &kept);
    data.estimation = pieces::cut(&data.estimation, &used);
    let what = if whole { "every second file" } else { "the last third of each file" };
    format!(
        "no validation files are given: {what} is held out from the estimation and judges the models; give others with --validate"
    )
}

/// A bar with a part for every state-space model.
fn progress(args: &Args) -> indicatif::ProgressBar {
    let count = args.state_space.range().count() as u64;
    let bar = progress::bar(args.data.quiet, Some(count), "{msg} {bar:30} {pos}/{len} {elapsed}");
    bar.set_message("state-space models");
    bar
}

fn write(
    args: &DataArgs,
    data: &Experiments,
    entries: &[Entry],
    verdict: &[String],
    warnings: &[String],
) -> Result<(), Error> {
    let folder = &args.output;
    let figures = if args.no_plots { Vec::new() } else { figures(entries) };
    let names = plot::run::unique_files(figures.iter().map(|(name, _)| name.as_str()));
    let results = folder::Results::open(folder, &[], &names)?;
    let folder = results.path();
    let order = |family| compare::enough(entries, family).map(|entry| entry.order);
    let summary = Summary {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION"),
        method: "comparison of orders",
        inputs: &data.inputs,
        outputs: &data.outputs,
        sample_time: data.sample_time,
        models: entries,
        enough: Enough { arx: order(Family::Arx), state_space: order(Family::StateSpace) },
        verdict,
        warnings,
        figures: &names,
        files: ["compare.csv"],
    };
    write_file(&folder.join("summary.json"), |out| {
        serde_json::to_writer_pretty(&mut *out, &summary)?;
        out.write_all(b"\n")
    })?;
    let table = rows(entries, &data.outputs);
    write_file(&folder.join("compare.csv"), |out| out.write_all(table.as_bytes()))?;
    for (name, (_, svg)) in names.iter().zip(&figures) {
        write_file(&folder.join(name), |out| out.write_all(svg.as_bytes()))?;
    }
    let page = Page {
        title: format!("Orders: {} from {}", data.outputs.join(", "), data.inputs.join(", ")),
        lead: "Fits on validation data; an unstable model has no simulated fit.".into(),
        remarks: vec![("Verdict".into(), verdict.to_vec()), ("Warnings".into(), warnings.to_vec())],
        tables: vec![self::table(entries), notes(entries)],
        figures: figures.into_iter().map(|(_, svg)| svg).collect(),
        ..Page::default()
    };
    write_file(&folder.join("index.html"), |out| out.write_all(fit_page::html(&page).as_bytes()))?;
    results.commit()
}

fn write_file(path: &Path, content: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), Error> {
    write_whole(path, |out| content(out))
        .map_err(|source| csv::Error::Io { path: path.into(), source }.into())
}

fn simulated(score: Option<&Score>) -> Option<f64> {
    score?.mean_fit_simulated
}

fn one_step(score: Option<&Score>) -> Option<f64> {
    score?.mean_fit_one_step
}

fn table(entries: &[Entry]) -> Table {
    let header =
        ["model", "order", "coefficients", "simulated", "one step", "estimation: simulated", "one step"];
    let row = |entry: &Entry| {
        let fit = |fit: Option<f64>, stable: bool| match entry.stable {
            None => "none".into(),
            Some(_) => percent(fit, stable),
        };
        let stable = entry.stable == Some(true);
        let (validation, estimation) = (entry.validation.as_ref(), entry.estimation.as_ref());
        vec![
            entry.family.name().into(),
            entry.order.to_string(),
            entry.parameters.to_string(),
            fit(simulated(validation), stable),
            fit(one_step(validation), true),
            fit(simulated(estimation), stable),
            fit(one_step(estimation), true),
        ]
    };
    Table {
        sentences: false,
        heading: "Mean fits [%] on validation data".into(),
        header: header.map(str::to_owned).to_vec(),
        rows: entries.iter().map(row).collect(),
    }
}

/// Remarks on single models.
fn notes(entries: &[Entry]) -> Table {
    let noted = entries.iter().filter(|entry| !entry.note.is_empty());
    Table {
        sentences: true,
        heading: "How the models were estimated".into(),
        header: vec!["model".into(), "remark".into()],
        rows: noted
            .map(|entry| vec![format!("{} {}", entry.family.name(), entry.order), entry.note.clone()])
            .collect(),
    }
}

/// compare.csv: a row per model, an empty cell where there is no fit.
fn rows(entries: &[Entry], outputs: &[String]) -> String {
    let quoted = |text: &str| -> String {
        let special = text.contains([',', '"', '\n']);
        if special { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
    };
    let mut header: Vec<String> = ["model", "order", "coefficients", "stable"].map(str::to_owned).to_vec();
    for set in ["validation", "estimation"] {
        for kind in ["simulated", "one_step"] {
            header.push(format!("{set}_{kind}_mean"));
            header.extend(outputs.iter().map(|name| quoted(&format!("{set}_{kind}_{name}"))));
        }
    }
    let mut text = header.join(",") + "\n";
    for entry in entries {
        let stable = entry.stable.map_or(String::new(), |stable| stable.to_string());
        let family = match entry.family {
            Family::Arx => "arx",
            Family::StateSpace => "state-space",
        };
        let mut cells =
            vec![family.to_owned(), entry.order.to_string(), entry.parameters.to_string(), stable];
        for score in [entry.validation.as_ref(), entry.estimation.as_ref()] {
            let kinds = [
                (simulated(score), score.map(|score| &score.fit_simulated)),
                (one_step(score), score.map(|score| &score.fit_one_step)),
            ];
            for (mean, by_output) in kinds {
                let own =
                    outputs.iter().map(|name| by_output.and_then(|fits| fits.get(name).copied().flatten()));
                let cell = |fit: Option<f64>| fit.map_or(String::new(), |fit| fit.to_string());
                cells.extend(std::iter::once(mean).chain(own).map(cell));
            }
        }
        text += &(cells.join(",") + "\n");
    }
    text
}

fn figures(entries: &[Entry]) -> Vec<(String, String)> {
    let figure = |title: &str, of: &dyn Fn(Option<&Score>) -> Option<f64>| {
        let fits = |family: Family| -> Vec<OrderFit> {
            let own = entries.iter().filter(|entry| entry.family == family && entry.stable.is_some());
            let fit = |entry: &Entry| OrderFit {
                order: entry.order,
                fit: of(entry.validation.as_ref()),
                stable: entry.stable == Some(true),
            };
            own.map(fit).collect()
        };
        let families = [Family::Arx, Family::StateSpace].map(|family| (family.name(), fits(family)));
        let families: Vec<identification::Family> = families
            .iter()
            .filter(|(_, fits)| !fits.is_empty())
            .map(|(name, fits)| identification::Family { name, fits })
            .collect();
        fit_against_order(title, "mean over outputs and files", &families)
    };
    vec![
        ("fit_simulated".into(), figure("Simulated fit on validation data", &simulated)),
        ("fit_one_step".into(), figure("One-step fit on validation data", &one_step)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_ranges_or_single_numbers() {
        assert_eq!(parse_orders("1..8"), Ok(Orders { first: 1, last: 8 }));
        assert_eq!(parse_orders("3"), Ok(Orders { first: 3, last: 3 }));
        for wrong in ["0..3", "4..2", "a", "1..", "1..99"] {
            assert!(parse_orders(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_model_that_is_missing_leaves_its_cells_empty() {
        let entry = Entry {
            family: Family::Arx,
            order: 2,
            parameters: 5,
            stable: None,
            estimation: None,
            validation: None,
            note: String::new(),
        };
        assert_eq!(rows(&[entry], &["y".into()]).lines().nth(1), Some("arx,2,5,,,,,,,,,"));
    }
}
