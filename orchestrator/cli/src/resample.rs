//! `airloop resample`: records on a uniform grid.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args as Arguments, ValueEnum};

use super::output;
use airloop::Error;
use airloop_series::uniform::{Method, uniform};
use airloop_series::units::parse_duration;
use airloop_series::{TimeSeries, csv, file, rows};

/// `airloop resample`
#[derive(Debug, Arguments)]
#[command(after_help = "Example: airloop resample record.csv --step 5ms --held u -o record_5ms.csv")]
pub struct Args {
    /// CSV files: first column `time` [s] (or for example `time [ms]`), then a column per signal.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Step of the grid, which begins at the first time of each file.
    #[arg(long, value_parser = parse_duration, value_name = "TIME")]
    pub step: f64,
    /// Between samples, for all columns but those of --held.
    #[arg(long, value_enum, default_value_t = MethodChoice::Filter)]
    pub method: MethodChoice,
    /// Columns that keep the value of their last sample, separated by commas: commands, discrete signals.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub held: Vec<String>,
    /// CSV file to write; a folder if there are several files, which keep their names.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--method`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodChoice {
    /// Straight lines, behind a zero-phase low-pass where the grid is coarser than the samples.
    Filter,
    /// Straight lines; on a coarser grid fast motion comes back as slow one.
    Linear,
    /// The last sample.
    Hold,
}

impl From<MethodChoice> for Method {
    fn from(choice: MethodChoice) -> Method {
        match choice {
            MethodChoice::Filter => Method::Filter,
            MethodChoice::Linear => Method::Linear,
            MethodChoice::Hold => Method::Hold,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// A file that cannot be read, a step or a column that does not fit, a result that would replace its source.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let several = args.files.len() > 1;
    let target = |path: &Path| match path.file_name() {
        Some(name) if several => args.output.join(name),
        _ => args.output.clone(),
    };
    for path in &args.files {
        let target = target(path);
        let refuse = |problem: String| Error::OutputFile { file: target.clone(), problem };
        let same = target.canonicalize().is_ok_and(|own| {
            args.files.iter().any(|other| other.canonicalize().is_ok_and(|other| other == own))
        });
        if same {
            return Err(refuse("this is a record that is read; give another name to -o".into()));
        }
        file::check_place(&target).map_err(|problem| refuse(problem.to_string()))?;
        if target.exists() && !is_earlier_result(path, &target, args.step) {
            return Err(refuse(
                "it is there and is not this record on this grid; give another name to -o".into(),
            ));
        }
    }
    let mut text = String::new();
    for path in &args.files {
        let target = target(path);
        let notes = write(path, &target, args.step, args.method.into(), &args.held)?;
        text += &format!("{}\n", target.display());
        notes.iter().for_each(|note| text += &format!("  {note}\n"));
    }
    if !args.quiet {
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether `target` is `source` on a grid of `step` \[s\], as an earlier run wrote it: each column by one of the
/// methods.
fn is_earlier_result(source: &Path, target: &Path, step: f64) -> bool {
    let (Ok(source), Ok(target)) = (csv::read(source), csv::read(target)) else { return false };
    let version = |method: Method| uniform(&source, step, method, &[]).ok().map(|found| found.series);
    let versions = [Method::Filter, Method::Linear, Method::Hold].map(version);
    let names =
        |series: &TimeSeries| series.channels().iter().map(|own| own.name.clone()).collect::<Vec<_>>();
    let close = |a: &[f64], b: &[f64], scale: f64| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9 * scale)
    };
    let is_of = |version: &TimeSeries, index: usize| {
        let [own, there] = [version, &target].map(|series| &series.channels()[index].values[..]);
        close(own, there, own.iter().fold(0.0, |most, value| value.abs().max(most)))
            && close(version.time(), target.time(), 1e3 * step)
    };
    let is_there = |index: usize| versions.iter().flatten().any(|version| is_of(version, index));
    names(&source) == names(&target) && (0..target.channels().len()).all(is_there)
}

/// Writes the file `path` on a grid to `target`; what was done, one sentence each.
///
/// # Errors
/// Same as [`run`].
pub fn write(
    path: &Path,
    target: &Path,
    step: f64,
    method: Method,
    held: &[String],
) -> Result<Vec<String>, Error> {
    let series = csv::read(path)?;
    let found = uniform(&series, step, method, held)
        .map_err(|problem| Error::Resample { file: path.into(), problem })?;
    let refuse =
        |source: std::io::Error| Error::OutputFile { file: target.into(), problem: source.to_string() };
    file::make_folder_of(target).map_err(refuse)?;
    file::write_whole(target, |out| write_rows(&found.series, out)).map_err(refuse)?;
    Ok(found.notes)
}

/// Writes a series with its units.
fn write_rows(series: &TimeSeries, out: &mut impl std::io::Write) -> std::io::Result<()> {
    let name = |channel: &airloop_series::Channel| match &channel.unit {
        Some(unit) => format!("{} [{unit}]", channel.name),
        None => channel.name.clone(),
    };
    let names: Vec<String> = series.channels().iter().map(name).collect();
    rows::write_header(out, names.iter().map(String::as_str))?;
    for (row, &time) in series.time().iter().enumerate() {
        // The sum of many steps has digits that the step has not.
        let time = (time * 1e12).round() / 1e12;
        rows::write_row(out, time, series.channels().iter().map(|channel| channel.values[row]))?;
    }
    Ok(())
}
