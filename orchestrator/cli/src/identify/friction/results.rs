//! The folder of a friction identification: summary, parameters, tables, figures, page, FMU.

use std::io::Write;
use std::path::Path;

use serde::Serialize;

use super::Args;
use crate::folder;
use crate::identify::data;
use crate::identify::linear_fmu::check_name;
use crate::identify::report::text_table;
use airloop::Error;
use airloop_fmi::derive::{Derivation, Value, derive};
use airloop_fmi::template_folder;
use airloop_ident::friction::predict;
use airloop_ident::friction::report::{Quality, Report};
use airloop_ident::friction::{Track, curve, law};
use airloop_ident::summary::SCHEMA_VERSION;
use airloop_report::plot::fit_page::{self, Page, Table};
use airloop_report::plot::friction::{force_velocity, residual};
use airloop_report::plot::run::{short, unique_files};
use airloop_series::{TimeSeries, csv, file::write_whole};

/// Dots drawn in a figure.
const DOTS: usize = 4000;

/// Contents of summary.json.
#[derive(Serialize)]
struct Summary<'a> {
    schema_version: u32,
    airloop_version: &'static str,
    method: &'static str,
    #[serde(flatten)]
    report: &'a Report,
    figures: Vec<String>,
    files: Vec<String>,
}

/// Refuses a name of the FMU, and a folder in which files of the user would be replaced.
///
/// # Errors
/// [`Error::LinearFmu`], [`Error::OutputFolder`].
pub fn check(args: &Args) -> Result<(), Error> {
    args.fmu.as_ref().map_or(Ok(()), |name| check_name(name))?;
    let sets = [("estimation", args.files.len()), ("validation", args.validate.len())];
    let mut names: Vec<String> = sets.into_iter().flat_map(|(set, count)| data::tables(set, count)).collect();
    names.extend(args.fmu.as_ref().map(|name| format!("{name}.fmu")));
    let figures = ["friction", "residual"].into_iter().flat_map(|kind| {
        sets.into_iter().filter(|(_, count)| *count > 0).map(move |(set, _)| format!("{kind}_{set}.svg"))
    });
    names.extend(figures.filter(|_| !args.no_plots));
    names.extend(["friction.toml", "index.html", "summary.json"].map(str::to_owned));
    let inputs: Vec<_> = args.files.iter().chain(&args.validate).cloned().collect();
    folder::check(&args.output, &inputs, &names)
}

/// Writes everything into the folder; what is printed about it.
///
/// # Errors
/// Fails if a file cannot be written.
pub fn write(report: &Report, args: &Args) -> Result<String, Error> {
    let to = &args.output;
    let figures = if args.no_plots { Vec::new() } else { figures(report) };
    let mut tables = tables("estimation", &report.estimation_tracks, report)?;
    tables.extend(tables_of_validation(report)?);
    let template = args.fmu.as_ref().map(|_| template_folder::template("friction", None)).transpose()?;
    let results = folder::Results::open(to, &[], &[])?;
    let to = results.path();
    let mut files: Vec<String> = vec!["friction.toml".into()];
    files.extend(tables.iter().map(|(name, _)| name.clone()));
    files.extend(args.fmu.as_ref().map(|name| format!("{name}.fmu")));
    let figure_files = unique_files(figures.iter().map(|(name, _)| name.as_str()));
    let summary = Summary {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION"),
        method: "friction",
        report,
        figures: figure_files.clone(),
        files,
    };
    let json = serde_json::to_string_pretty(&summary).unwrap_or_default();
    write_text(&to.join("summary.json"), &(json + "\n"))?;
    write_text(&to.join("friction.toml"), &toml(report))?;
    for (name, table) in &tables {
        csv::write(table, &to.join(name))?;
    }
    for (name, (_, svg)) in figure_files.iter().zip(&figures) {
        write_text(&to.join(name), svg)?;
    }
    let page = Page {
        title: "Friction".into(),
        lead: report.verdict.first().cloned().unwrap_or_default(),
        remarks: vec![
            ("Verdict".into(), report.verdict.clone()),
            ("Notes".into(), report.flags.iter().map(|flag| flag.message.clone()).collect()),
        ],
        tables: vec![parameter_table(report), fit_table(report), alternative_table(report)]
            .into_iter()
            .filter(|table| !table.rows.is_empty())
            .collect(),
        figures: figures.iter().map(|(_, svg)| svg.clone()).collect(),
        ..Page::default()
    };
    write_text(&to.join("index.html"), &fit_page::html(&page))?;
    if let (Some(name), Some(template)) = (&args.fmu, &template) {
        derive(template, &to.join(format!("{name}.fmu")), &derivation(name, report))?;
    }
    results.commit()?;
    Ok(text(report, args, &page))
}

fn text(report: &Report, args: &Args, page: &Page) -> String {
    let mut text = String::new();
    for table in &page.tables {
        text += &format!("{}\n", text_table(table));
    }
    for said in &report.verdict {
        text += &format!("{said}\n");
    }
    for flag in &report.flags {
        text += &format!("note: {}\n", flag.message);
    }
    text += &format!("result:  {}\n", args.output.join("summary.json").display());
    if let Some(name) = &args.fmu {
        text += &format!("FMU:     {}\n", args.output.join(format!("{name}.fmu")).display());
    }
    if !args.no_plots {
        text += &format!("figures: {}\n", args.output.join("index.html").display());
    }
    text
}

fn parameter_table(report: &Report) -> Table {
    let header = ["parameter", "value", "95 % interval", "unit", ""].map(String::from).to_vec();
    let rows = report
        .parameters
        .iter()
        .map(|(name, parameter)| {
            let interval = match parameter.ci95 {
                Some([low, high]) => format!("{} .. {}", short(low), short(high)),
                None => String::new(),
            };
            let origin = if parameter.origin == "estimated" { "" } else { parameter.origin };
            let unit = parameter.unit.to_owned();
            vec![(*name).to_owned(), short(parameter.value), interval, unit, origin.to_owned()]
        })
        .collect();
    Table { sentences: false, heading: String::new(), header, rows }
}

fn fit_table(report: &Report) -> Table {
    let unit = if report.predicted == "force" { "N" } else { "m" };
    let header = vec!["record".into(), "fit [%]".into(), format!("rms error [{unit}]"), "samples".into()];
    let rows = |set: &str, quality: &Quality| -> Vec<Vec<String>> {
        let fit = |fit: Option<f64>| fit.map_or("constant".into(), |fit| format!("{fit:.2}"));
        let one = |name: String, value: Option<f64>, rms: f64, samples: usize| {
            vec![name, fit(value), short(rms), samples.to_string()]
        };
        let all = quality.records.iter().map(|record| record.samples).sum();
        std::iter::once(one(format!("{set} (all)"), quality.fit, quality.rms, all))
            .chain(quality.records.iter().map(|r| one(r.name.clone(), r.fit, r.rms, r.samples)))
            .collect()
    };
    let mut all = rows("estimation", &report.estimation);
    all.extend(report.validation.iter().flat_map(|quality| rows("validation", quality)));
    Table { sentences: false, heading: String::new(), header, rows: all }
}

fn alternative_table(report: &Report) -> Table {
    let header =
        ["alternative", "rms on estimation", "rms on validation", "offered"].map(String::from).to_vec();
    let rows = report
        .alternatives
        .iter()
        .map(|tried| {
            let offered = if tried.offered { "yes" } else { "no" };
            let name = tried.law.id().to_owned();
            vec![name, short(tried.estimation_rms), short(tried.validation_rms), offered.to_owned()]
        })
        .collect();
    Table { sentences: false, heading: String::new(), header, rows }
}

/// The parameters as TOML.
fn toml(report: &Report) -> String {
    let mut text = format!(
        "# friction force [N]: c1 tanh(c2 (v - c3)) + c4 v + c5, v in m/s; other laws add to it\nlaw = \"{}\"\n\n[parameters]\n",
        report.law.id()
    );
    for (name, parameter) in &report.parameters {
        text += &format!("{name} = {:?} # {}\n", parameter.value, parameter.unit);
    }
    text
}

fn derivation(name: &str, report: &Report) -> Derivation {
    let value = |name: &&str| (name.to_string(), Value::Real(report.parameters[*name].value));
    let judged = report.validation.as_ref().unwrap_or(&report.estimation);
    Derivation {
        name: name.into(),
        description: format!(
            "Coulomb-viscous friction in series, identified from measurements (rms error {} N)",
            short(judged.rms)
        ),
        start: ["c1", "c2", "c3", "c4", "c5"].iter().map(value).collect(),
        resources: Vec::new(),
    }
}

fn tables_of_validation(report: &Report) -> Result<Vec<(String, TimeSeries)>, Error> {
    tables("validation", &report.validation_tracks, report)
}

/// Smoothed motion, measured and predicted force of each record.
fn tables(set: &str, tracks: &[Track], report: &Report) -> Result<Vec<(String, TimeSeries)>, Error> {
    tracks
        .iter()
        .enumerate()
        .map(|(index, track)| {
            let name =
                if tracks.len() == 1 { format!("{set}.csv") } else { format!("{set}_{}.csv", index + 1) };
            let (model, left) = forces(track, report);
            let mut table = TimeSeries::new(track.time.clone())?;
            let motion = &track.motion;
            for (name, unit, values) in [
                ("position", "m", motion.position.clone()),
                ("velocity", "m/s", motion.velocity.clone()),
                ("velocity_deviation", "m/s", motion.velocity_deviation.clone()),
                ("acceleration", "m/s2", motion.acceleration.clone()),
                ("force", "N", track.force.clone()),
                ("force_model", "N", model),
                ("residual", "N", left),
            ] {
                table.push(name, Some(unit.into()), values)?;
            }
            Ok((name, table))
        })
        .collect()
}

/// Force of the model on a track, and what it leaves of the measured one.
fn forces(track: &Track, report: &Report) -> (Vec<f64>, Vec<f64>) {
    let mut model = vec![0.0; track.len()];
    predict::force(report.law, &report.fit.parameters, track, &mut model);
    let left = track.force.iter().zip(&model).map(|(force, model)| force - model).collect();
    (model, left)
}

fn figures(report: &Report) -> Vec<(String, String)> {
    let mut figures = Vec::new();
    let sets = [("estimation", &report.estimation_tracks), ("validation", &report.validation_tracks)];
    for (set, tracks) in sets.into_iter().filter(|(_, tracks)| !tracks.is_empty()) {
        let all: usize = tracks.iter().map(Track::len).sum();
        let step = all.div_ceil(DOTS);
        let (mut friction, mut left) = (Vec::new(), Vec::new());
        for track in tracks {
            let (model, residual) = forces(track, report);
            for k in (0..track.len()).step_by(step) {
                let v = track.motion.velocity[k];
                // What the friction model is compared with: the measured force less inertia.
                let inertia = report.fit.parameters[law::MASS] * track.motion.acceleration[k];
                friction.push((v, model[k] + residual[k] - inertia));
                left.push((v, residual[k]));
            }
        }
        let low = friction.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
        let high = friction.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
        let model: Vec<_> = curve::points(&report.fit, low, high, 400)
            .iter()
            .map(|point| (point.velocity, point.force, point.half_width))
            .collect();
        let note = format!("{set}: measured (gray), model (blue) with 95 % band");
        figures.push((format!("friction_{set}"), force_velocity(&friction, &model, &note)));
        figures.push((format!("residual_{set}"), residual(&left, set)));
    }
    figures
}

fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    write_whole(path, |out| out.write_all(text.as_bytes()))
        .map_err(|source| csv::Error::Io { path: path.into(), source }.into())
}
