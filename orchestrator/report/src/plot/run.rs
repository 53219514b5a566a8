//! Figures of a run folder: what to draw, from its files.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::figures::{Comparison, Curve, comparison, signals};
use super::{Error, page};
use airloop_cosim::results::summary::{self, ConnectorRecord, SignalRecord, Summary};
use airloop_series::{Interpolation, TimeSeries, csv, file};

/// Draws the figures of a run and the page that shows them; returns the page and the figures.
///
/// Reads `summary.json`, `result.csv` and, if the run had one, the measurement (its path is in the summary). With a
/// measurement there is one figure per measured signal (overlay and residual); the other connectors of the system
/// are drawn together by unit.
///
/// # Errors
/// A file cannot be read or written, or a column is missing.
pub fn draw(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let summary = summary::read(&folder.join("summary.json"))?;
    let result_file = folder.join("result.csv");
    let result = csv::read(&result_file)?;
    let mut figures = Vec::new();
    if let Some(measured_file) = summary.settings.measured.as_ref().filter(|_| !summary.signals.is_empty()) {
        let measured = csv::read(measured_file)?;
        for signal in &summary.signals {
            let held = summary.connectors.iter().any(|c| c.name == signal.name && c.held);
            let simulated = channel(&result, &signal.name, &result_file)?;
            let column = channel(&measured, &signal.column, measured_file)?;
            figures.push((signal.name.clone(), compare(signal, held, &result, simulated, &measured, column)));
        }
    }
    figures.extend(groups(&summary, &result));
    let mut written = vec![folder.join("index.html")];
    let texts: Vec<String> = figures.iter().map(|(_, text)| text.clone()).collect();
    write(&written[0], &page::page(&summary, &texts))?;
    let names = figures.iter().map(|(name, _)| name.as_str());
    for (name, (_, text)) in unique_files(names).into_iter().zip(&figures) {
        let path = folder.join(name);
        write(&path, text)?;
        written.push(path);
    }
    Ok(written)
}

/// Names of the files that [`draw`] writes next to the page, from what the summary says about signals and connectors.
pub fn figure_files(summary: &Summary) -> Vec<String> {
    let signals = summary.signals.iter().map(|signal| signal.name.clone());
    let groups = grouped(summary).into_iter().map(|(_, connectors)| group_name(&connectors));
    let names: Vec<String> = signals.chain(groups).collect();
    unique_files(names.iter().map(String::as_str))
}

/// A file name for each figure, no two alike.
pub fn unique_files<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut files: Vec<String> = Vec::new();
    for name in names {
        let stem = file_name(name);
        let numbered = (2..).map(|number| format!("{stem}-{number}.svg"));
        let free = std::iter::once(format!("{stem}.svg")).chain(numbered).find(|file| !files.contains(file));
        files.extend(free);
    }
    files
}

fn channel<'a>(series: &'a TimeSeries, name: &str, file: &Path) -> Result<&'a [f64], Error> {
    let missing = || Error::Column { file: file.into(), column: name.into() };
    series.channel(name).map(|channel| channel.values.as_slice()).ok_or_else(missing)
}

fn compare(
    signal: &SignalRecord,
    held: bool,
    result: &TimeSeries,
    simulated: &[f64],
    measured: &TimeSeries,
    column: &[f64],
) -> String {
    let (first, last) = (result.time().first(), result.time().last());
    let inside: Vec<usize> = (0..measured.len())
        .filter(|&row| first.is_some_and(|t| measured.time()[row] >= *t))
        .filter(|&row| last.is_some_and(|t| measured.time()[row] <= *t))
        .collect();
    let time: Vec<f64> = inside.iter().map(|&row| measured.time()[row]).collect();
    let values: Vec<f64> = inside.iter().map(|&row| signal.factor * column[row] + signal.offset).collect();
    let interpolation = if held { Interpolation::Hold } else { Interpolation::Linear };
    let mut at = 0;
    let residual: Vec<f64> = time
        .iter()
        .zip(&values)
        .map(|(&t, value)| {
            let position = airloop_series::resample::locate(result.time(), t, at);
            at = position.index;
            value - airloop_series::resample::value_at(simulated, position, interpolation)
        })
        .collect();
    let unit = signal.unit.as_deref().unwrap_or("");
    let fit = signal.fit_percent.map_or("fit not defined (constant)".into(), |fit| format!("fit {fit:.2} %"));
    comparison(&Comparison {
        name: &signal.name,
        unit,
        note: format!("{fit}, RMS error {} {unit}", short(signal.rms_error)).trim_end(),
        measured: Curve { time: &time, values: &values, held: false, name: "measured" },
        simulated: Curve { time: result.time(), values: simulated, held, name: "simulated" },
        residual: Curve { time: &time, values: &residual, held: false, name: "residual" },
    })
}

/// Figures of groups of connectors; nobody looks at more.
const MOST_FIGURES: usize = 60;

/// Connectors that no comparison shows, by kind and unit; outputs first. Each group is one figure, at most
/// [`MOST_FIGURES`].
fn grouped(summary: &Summary) -> Vec<(String, Vec<&ConnectorRecord>)> {
    let mut groups: BTreeMap<(bool, String), Vec<&ConnectorRecord>> = BTreeMap::new();
    for connector in &summary.connectors {
        if summary.signals.iter().any(|signal| signal.name == connector.name) {
            continue;
        }
        let key = (connector.kind == "input", connector.unit.clone().unwrap_or_default());
        groups.entry(key).or_default().push(connector);
    }
    let mut figures = Vec::new();
    for ((_, unit), connectors) in groups {
        // Without a unit nothing says that signals share a scale.
        let together = if unit.is_empty() { 1 } else { super::svg::SERIES_CLASSES };
        for some in connectors.chunks(together) {
            figures.push((unit.clone(), some.to_vec()));
        }
    }
    figures.truncate(MOST_FIGURES);
    figures
}

/// Name and text of the figure of each group.
fn groups(summary: &Summary, result: &TimeSeries) -> Vec<(String, String)> {
    let figure = |(unit, connectors): (String, Vec<&ConnectorRecord>)| {
        let curves: Vec<Curve> = connectors
            .iter()
            .filter_map(|connector| {
                let channel = result.channel(&connector.name)?;
                Some(Curve {
                    time: result.time(),
                    values: &channel.values,
                    held: connector.held,
                    name: &connector.name,
                })
            })
            .collect();
        (group_name(&connectors), signals(&unit, &curves))
    };
    grouped(summary).into_iter().map(figure).collect()
}

/// Names of the connectors, as long as that stays readable as a file name.
fn group_name(connectors: &[&ConnectorRecord]) -> String {
    let names: Vec<&str> = connectors.iter().map(|connector| connector.name.as_str()).collect();
    let joined = names.join("_");
    if joined.len() <= 60 { joined } else { format!("{}_and_{}_more", names[0], names.len() - 1) }
}

/// A number with four significant digits.
pub fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() {
        return format!("{value}");
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = (3.0 - size.log10().floor()).clamp(0.0, 8.0) as usize;
    format!("{value:.decimals$}")
}

/// A name that every file system takes.
fn file_name(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '_' };
    name.chars().map(safe).take(80).collect()
}

pub(super) fn write(path: &Path, text: &str) -> Result<(), Error> {
    file::write_whole(path, |out| out.write_all(text.as_bytes()))
        .map_err(|source| Error::Io { file: path.into(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_have_four_digits() {
        let cases =
            [(0.0, "0"), (1234.56, "1235"), (0.0123456, "0.01235"), (-2.5, "-2.500"), (1e-9, "1.000e-9")];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
    }
}
