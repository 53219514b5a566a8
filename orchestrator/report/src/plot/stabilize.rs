//! Figures of a stabilized plan and of trials, and their pages, from the files of the folder.

use std::path::{Path, PathBuf};

use super::Error;
use super::figures::{Curve, signals, signals_of};
use super::fit_page::{Page, Table, html};
use super::plan::stick;
use super::run::{short, unique_files, write};
use airloop_plan::stabilize::record::{MonodromyRecord, Summary, TrialsSummary, gain_column};
use airloop_series::names::counted;
use airloop_series::{TimeSeries, csv};

/// The plan with its gains.
pub const GAINS: &str = "gains.csv";
/// The closed loop without noise and perturbation.
pub const CLOSED_LOOP: &str = "closed_loop.csv";
/// Trajectories of the first trials.
pub const TRAJECTORIES: &str = "trajectories.csv";

/// Signals of a stabilized plan that are drawn over the plan: measured signals, then inputs.
fn drawn(summary: &Summary) -> Vec<(&str, &str, bool)> {
    let of = |kind: &'static str| summary.signals.iter().filter(move |signal| signal.kind == kind);
    let measured =
        of("measured").map(|signal| (signal.name.as_str(), signal.unit.as_deref().unwrap_or(""), false));
    let inputs = of("input").map(|signal| (signal.name.as_str(), signal.unit.as_deref().unwrap_or(""), true));
    measured.chain(inputs).collect()
}

/// The figures of a stabilized plan that [`draw`] writes.
pub fn figure_files(summary: &Summary) -> Vec<String> {
    let more = summary.stick_figure.iter().map(|_| "stick_figure".to_owned());
    let signals = drawn(summary).into_iter().map(|(name, ..)| name.to_owned()).chain(["gains".into()]);
    let names: Vec<String> = signals.chain(more).collect();
    unique_files(names.iter().map(String::as_str))
}

/// Draws the figures of a stabilized plan and the page that shows them; returns what was written.
///
/// # Errors
/// A file cannot be read or written, or a column is missing.
pub fn draw(folder: &Path, summary: &Summary) -> Result<Vec<PathBuf>, Error> {
    let (gains, result) = (csv::read(&folder.join(GAINS))?, csv::read(&folder.join(CLOSED_LOOP))?);
    let mut figures = Vec::new();
    for (name, unit, held) in drawn(summary) {
        let reached = column(&result, name, CLOSED_LOOP)?;
        let names = [format!("{name}, closed loop"), format!("{name}, plan")];
        let mut curves = vec![Curve { time: result.time(), values: reached, held, name: &names[0] }];
        // A measured output that is no state has no column of its own in the plan.
        if let Ok(planned) = column(&gains, name, GAINS) {
            curves.push(Curve { time: gains.time(), values: planned, held, name: &names[1] });
        }
        figures.push(signals(unit, &curves));
    }
    // Each gain for the deviation that costs alike, so that all are commands.
    let mut scaled: Vec<(String, Vec<f64>)> = Vec::new();
    let inputs: Vec<_> = summary.signals.iter().filter(|signal| signal.kind == "input").collect();
    for input in &inputs {
        for state in summary.signals.iter().filter(|signal| signal.kind == "state") {
            let gain = column(&gains, &gain_column(&input.name, &state.name), GAINS)?;
            let deviation = state.deviation.unwrap_or(0.0);
            let unit = state.unit.as_deref().unwrap_or("");
            let name = format!("{} for {} {unit} of {}", input.name, short(deviation), state.name);
            scaled.push((name, gain.iter().map(|gain| gain * deviation).collect()));
        }
    }
    let curves: Vec<Curve> =
        scaled.iter().map(|(name, values)| Curve { time: gains.time(), values, held: true, name }).collect();
    let unit = inputs.first().and_then(|input| input.unit.as_deref()).unwrap_or("");
    figures.push(signals(unit, &curves));
    let mut motion = String::new();
    if let Some(record) = &summary.stick_figure {
        // As many poses a turn as a figure of one plan shows of it would be too many side by side.
        let turns = summary.cycle.as_ref().map(|cycle| cycle.turns);
        figures.push(stick::poses(&result, record, turns.map_or(stick::POSES, |turns| 2 * turns + 1)));
        motion = stick::in_motion(record, &[("closed loop", Some(&result))]);
    }
    let multipliers = summary.cycle.iter().map(|cycle| {
        let texts = |own: &MonodromyRecord| own.multipliers.iter().map(multiplier).collect::<Vec<_>>();
        let (alone, held) = (texts(&cycle.open_loop), texts(&cycle.closed_loop));
        let rows = (0..alone.len().max(held.len())).map(|i| {
            let text = |list: &[String]| list.get(i).cloned().unwrap_or_default();
            vec![(i + 1).to_string(), text(&alone), text(&held)]
        });
        Table {
            sentences: false,
            heading: format!("Poincaré multipliers of the cycle of {} s", short(cycle.period)),
            header: ["number", "as planned", "with the regulator"].map(String::from).to_vec(),
            rows: rows.collect(),
        }
    });
    let multipliers: Vec<Table> = multipliers.collect();
    let rows = summary.largest_error.iter().map(|(name, error)| {
        let unit =
            summary.signals.iter().find(|signal| signal.name == *name).and_then(|signal| signal.unit.clone());
        vec![name.clone(), short(*error), unit.unwrap_or_default()]
    });
    let page = Page {
        title: "Stabilized plan".into(),
        lead: format!(
            "Regulator with state estimator every {} s along {}.",
            summary.sample_time,
            summary.trajectory_file.display()
        ),
        remarks: vec![("Notes".into(), summary.notes.clone())],
        motion,
        tables: multipliers
            .into_iter()
            .chain([Table {
                sentences: false,
                heading: "Largest distance of the closed loop from the plan".into(),
                header: ["signal", "distance", "unit"].map(String::from).to_vec(),
                rows: rows.collect(),
            }])
            .collect(),
        figures: figures.clone(),
    };
    finish(folder, &page, summary.figures.iter().zip(&figures))
}

/// A multiplier, real part and, where there is one, imaginary part.
fn multiplier((re, im): &(f64, f64)) -> String {
    match im {
        0.0 => short(*re),
        im => format!("{} {} {}i", short(*re), if *im < 0.0 { "-" } else { "+" }, short(im.abs())),
    }
}

/// Draws the figures of trials and the page that shows them, for signals with their units; returns what was written.
///
/// # Errors
/// Same as [`draw`].
pub fn draw_trials(
    folder: &Path,
    summary: &TrialsSummary,
    shown: &[(String, Option<String>)],
) -> Result<Vec<PathBuf>, Error> {
    let trajectories = csv::read(&folder.join(TRAJECTORIES))?;
    let (mut figures, mut drawn) = (Vec::new(), 0);
    for (name, unit) in shown {
        for kind in ["closed", "open"] {
            let beginning = format!("{name}, {kind} loop, seed ");
            let of = trajectories.channels().iter().filter(|channel| channel.name.starts_with(&beginning));
            let channels: Vec<_> = of.collect();
            let curves: Vec<Curve> = channels
                .iter()
                .map(|channel| Curve {
                    time: trajectories.time(),
                    values: &channel.values,
                    held: false,
                    name: &channel.name,
                })
                .collect();
            drawn = drawn.max(curves.len());
            figures.push(signals_of(name, unit.as_deref().unwrap_or(""), &curves));
        }
    }
    let rows = summary.criteria.iter().map(|criterion| {
        vec![
            criterion.name.clone(),
            share(criterion.closed_loop, summary.closed_loop),
            share(criterion.open_loop, summary.open_loop),
        ]
    });
    let page = Page {
        title: "Trials".into(),
        lead: format!(
            "{} from seed {} with {} times the perturbation, {} master.{}",
            counted(summary.count, "trial"),
            summary.seed,
            summary.scale,
            summary.master,
            if drawn < summary.count {
                format!(" The figures show {drawn} of them: the first seeds, without those that ended early.")
            } else {
                String::new()
            }
        ),
        remarks: vec![
            ("Trials that ended early".into(), summary.ended_early.clone()),
            ("Perturbations drawn again within the ranges of the FMUs".into(), summary.drawn_again.clone()),
        ],
        tables: vec![Table {
            sentences: false,
            heading: "Trials that keep a criterion".into(),
            header: ["criterion", "closed loop", "open loop"].map(String::from).to_vec(),
            rows: rows.collect(),
        }],
        figures: figures.clone(),
        ..Page::default()
    };
    finish(folder, &page, summary.figures.iter().zip(&figures))
}

/// The figures of trials that [`draw_trials`] writes.
pub fn trial_figures(shown: &[(String, Option<String>)]) -> Vec<String> {
    let names: Vec<String> = shown
        .iter()
        .flat_map(|(name, _)| ["closed", "open"].map(|kind| format!("{name}_{kind}_loop")))
        .collect();
    unique_files(names.iter().map(String::as_str))
}

/// A part of trials in percent, with their number.
pub fn share(part: usize, whole: usize) -> String {
    match whole {
        0 => "none done".into(),
        _ => format!("{:.1} % ({part} of {whole})", 100.0 * part as f64 / whole as f64),
    }
}

fn finish<'a>(
    folder: &Path,
    page: &Page,
    figures: impl Iterator<Item = (&'a String, &'a String)>,
) -> Result<Vec<PathBuf>, Error> {
    let mut written = vec![folder.join("index.html")];
    write(&written[0], &html(page))?;
    for (name, text) in figures {
        let path = folder.join(name);
        write(&path, text)?;
        written.push(path);
    }
    Ok(written)
}

fn column<'a>(series: &'a TimeSeries, name: &str, file: &str) -> Result<&'a [f64], Error> {
    let missing = || Error::Column { file: file.into(), column: name.into() };
    series.channel(name).map(|channel| channel.values.as_slice()).ok_or_else(missing)
}
