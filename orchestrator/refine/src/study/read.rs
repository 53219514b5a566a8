//! Records of a study: columns of CSV files on a uniform grid, in the units of the system, cut into segments.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use super::columns::{Signals, factors, inputs, no_column, one};
use super::declaration::{File, ForceRule, Initial, InitialWord, Role, Segment, Signal};
use super::model::window_samples;
use super::plant::Parameter;
use super::time_grid::{Grid, grid, own_step};
use super::{names, signal, sparse};
use crate::{Error, cleaned, spikes};
use airloop_cosim::system::SystemGraph;
use airloop_series::names::counted;
use airloop_series::units::lookup;
use airloop_series::{TimeSeries, csv};
use toml::Spanned;

/// A segment on a uniform grid.
#[derive(Debug, Clone)]
pub struct Record {
    /// File and span, for messages and tables.
    pub name: String,
    /// Use of the segment.
    pub role: Role,
    /// Initial states.
    pub initial: Initial,
    /// Values of Real parameters on this record alone.
    pub parameters: Vec<(Parameter, f64)>,
    /// Step \[s\].
    pub step: f64,
    /// Samples.
    pub n: usize,
    /// System inputs, `[inputs][n]`; none where the system's start value holds.
    pub inputs: Vec<Option<Vec<f64>>>,
    /// System inputs before the segment, as far as its file and at most `n` samples reach back, `[inputs][..]`.
    pub past: Vec<Option<Vec<f64>>>,
    /// Further signals, `[extra][n]`.
    pub extra: Vec<Vec<f64>>,
    /// Measured outputs, `[outputs][n]`.
    pub outputs: Vec<Vec<f64>>,
    /// Which samples of the outputs were measured, `[outputs][n]`; none: all. Others are interpolated, and count for
    /// nothing.
    pub measured: Vec<Option<Vec<bool>>>,
    /// Units of the columns of the outputs, by the header of the file.
    pub units: Vec<Option<String>>,
    /// Measured states, `[nx][n]`, where there are columns for them.
    pub states: Vec<Option<Vec<f64>>>,
    /// Noise of the sensors of the columns in use, before any interpolation.
    pub sensors: BTreeMap<String, Sensor>,
    /// Factors from the units of columns to those of signals: inputs, states, further signals, outputs.
    pub factors: [Vec<f64>; 4],
    /// Whether the file begins and ends with it.
    pub ends: [bool; 2],
    /// Error of measured states by smoothing, `[nx][n]`; empty: not known.
    pub smoothed: Vec<Option<Vec<f64>>>,
    /// Filtered signals for the force residual.
    pub force: Option<ForceRecord>,
}

/// Noise and rounding of a sensor seen in its column, in the unit of the column.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sensor {
    /// Scatter from sample to sample.
    pub scatter: f64,
    /// Step of the sensor; 0: none that is seen.
    pub quantum: f64,
}

/// Filtered signals of a record.
#[derive(Debug, Clone)]
pub struct ForceRecord {
    /// As in [`Record`].
    pub inputs: Vec<Option<Vec<f64>>>,
    /// As in [`Record`].
    pub states: Vec<Option<Vec<f64>>>,
    /// As in [`Record`].
    pub extra: Vec<Vec<f64>>,
    /// Derivative of the velocity state, `[n]`.
    pub acceleration: Vec<f64>,
}

/// Names and columns of a system, in its order.
#[derive(Debug, Clone)]
pub struct Layout {
    /// Signals of the system inputs.
    pub inputs: Vec<Option<Signal>>,
    /// Signals of the states and their names.
    pub states: Vec<Option<Signal>>,
    /// Further signals.
    pub extra: Vec<Signal>,
    /// Columns of the outputs.
    pub outputs: Vec<Signal>,
    /// Units of the system: inputs, states, outputs.
    pub units: [Vec<Option<String>>; 3],
    /// Force residual: rule, velocity state.
    pub force: Option<(ForceRule, usize)>,
}

impl Layout {
    /// Columns of the outputs whose unit says that they integrate something.
    fn states_among_outputs(&self) -> impl Iterator<Item = &str> {
        let with_units = self.outputs.iter().zip(&self.units[2]);
        let states = with_units.filter(|(signal, unit)| {
            signal.unit.as_deref().or(unit.as_deref()).is_some_and(spikes::is_state)
        });
        states.filter_map(|(signal, _)| signal.column.as_deref())
    }

    /// Signals in use: inputs, states, further signals, outputs.
    pub fn signals(&self) -> [Vec<Option<&Signal>>; 4] {
        [
            self.inputs.iter().map(Option::as_ref).collect(),
            self.states.iter().map(Option::as_ref).collect(),
            self.extra.iter().map(Some).collect(),
            self.outputs.iter().map(Some).collect(),
        ]
    }

    /// Columns in use.
    fn columns(&self) -> impl Iterator<Item = &String> {
        self.signals().into_iter().flatten().flatten().filter_map(Signal::source)
    }
}

/// Ratio of `step_s` to the step of a file below which samples lie between its samples.
const SHORT_STEP: f64 = 0.9;
/// The same below which `step_s` is a slip.
const MIN_STEP: f64 = 0.1;

/// Steps behind the end of a file from which on `to_s` lies beyond it.
const BEYOND_THE_END: f64 = 1.5;

/// Refuses a signal whose column a file lacks, at its place in the study.
fn has_columns(file: &File, source: &TimeSeries, path: &Path) -> Result<(), Error> {
    let own = &file.declaration;
    let signals = [&own.inputs, &own.states, &own.signals].into_iter().flat_map(BTreeMap::values);
    let named = signals.filter_map(|signal| Some((signal.span(), signal.get_ref().source()?)));
    let outputs = own.outputs.values().map(|output| (output.span(), &output.get_ref().column));
    match named.chain(outputs).find(|(_, name)| source.channel(name).is_none()) {
        Some((span, name)) => {
            let problem = format!("{}: {}", path.display(), no_column(source, name));
            Err(file.refuse(&Spanned::new(span, ()), problem))
        }
        None => Ok(()),
    }
}

/// Samples that a record has at least.
const MIN_SAMPLES: usize = 16;

/// Reads the records of all segments; sentences on what was interpolated go to `notes`. A segment in which rows are
/// missing, and with them what drives the system, becomes a record before and one behind them, unless records
/// `begin_with_file`, as those of systems do whose states cannot be set.
///
/// # Errors
/// A file, column, unit or span that does not fit: place in the study, file and remedy.
pub fn records(
    file: &File,
    layout: &Layout,
    begin_with_file: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<Record>, Error> {
    let declaration = &file.declaration;
    if let Some(step) =
        declaration.step_s.as_ref().filter(|own| !(*own.get_ref() > 0.0 && own.get_ref().is_finite()))
    {
        return Err(file.refuse(step, "step_s must be above zero"));
    }
    separate(file)?;
    // An outstanding sample of a held command is intended.
    let measured = layout.signals().into_iter().flatten().flatten().filter(|signal| !signal.hold);
    let measured: Vec<&str> = measured.filter_map(Signal::source).map(String::as_str).collect();
    let compared: Vec<&str> = layout.outputs.iter().filter_map(Signal::source).map(String::as_str).collect();
    let states: Vec<&str> = layout.states_among_outputs().collect();
    let read: Vec<&str> = layout.columns().map(String::as_str).collect();
    let is_driven = layout.inputs.iter().any(Option::is_some);
    let may_be_cut = is_driven && layout.force.is_none() && !begin_with_file;
    let mut grids: BTreeMap<&str, Grid> = BTreeMap::new();
    let mut found = Vec::new();
    for spanned in &declaration.segment {
        let segment = spanned.get_ref();
        let path = file.folder.join(&segment.file);
        let refuse = |problem: String| file.refuse(spanned, format!("{}: {problem}", path.display()));
        if !grids.contains_key(segment.file.as_str()) {
            if !path.exists() {
                return Err(refuse(
                    "there is no such file; `file` is relative to the folder of the study".into(),
                ));
            }
            let series = csv::read_with_gaps(&path)?;
            has_columns(file, &series, &path)?;
            let series =
                cleaned::without(series, &segment.file, &measured, &states, notes).map_err(&refuse)?;
            let series = cleaned::emptied(series, &segment.file, &compared, notes);
            let step = stated_step(file, &segment.file, own_step(series.time()), notes)?;
            let grid = grid(series, step).map_err(&refuse)?;
            if grid.between {
                notes.push(format!(
                    "{}: its stamps are not {} s apart; between them signals lie on lines, and inputs with `hold` have their mean over each step.",
                    segment.file, significant(grid.step)
                ));
            }
            if grid.gaps > 0 {
                notes.push(format!(
                    "{}: linear interpolation bridges {} of its steps, which are longer than three times the usual one; what lies between counts for no error.",
                    segment.file, grid.gaps
                ));
            }
            let slow =
                |name: &&&str| grid.raw.channel(name).is_some_and(|own| sparse::is_sparse(&own.values));
            let mut slow: Vec<&str> = read.iter().filter(slow).copied().collect();
            slow.dedup();
            if !slow.is_empty() {
                notes.push(format!(
                    "{}: empty cells or NaN in {}; between samples the line counts (the last sample where `hold` says so), and errors count only where something was measured.",
                    segment.file,
                    slow.join(", ")
                ));
            }
            grids.insert(&segment.file, grid);
        }
        let grid = &grids[segment.file.as_str()];
        let time = grid.series.time();
        let (from, to) = (segment.from_s.unwrap_or(time[0]), segment.to_s.unwrap_or(time[time.len() - 1]));
        let near = 0.01 * grid.step;
        let first = time.partition_point(|&t| t < from - near);
        let last = time.partition_point(|&t| t <= to + near);
        if last < first + MIN_SAMPLES {
            let (begin, end) = (time[0], time[time.len() - 1]);
            // Samples, but at other times: the clock of the file has another zero.
            let before = segment.to_s.is_some_and(|to| to >= 0.0 && to < begin);
            let clock = if before || segment.from_s.is_some_and(|from| from > end) {
                "; is its clock offset against that of the segments? Times of from_s and to_s are those of the column `time`"
            } else {
                ""
            };
            return Err(refuse(format!(
                "between {from} s and {to} s there are {} samples, a segment needs at least {MIN_SAMPLES}; the file goes from {begin} s to {end} s{clock}",
                last.saturating_sub(first),
            )));
        }
        if let Some(to) = segment.to_s.filter(|to| *to > time[time.len() - 1] + BEYOND_THE_END * grid.step) {
            notes.push(format!(
                "{}: it ends at {} s, before to_s = {to} s.",
                segment.file,
                round(time[time.len() - 1], grid.step)
            ));
        }
        let initial = segment.initial.clone().unwrap_or(Initial::Word(InitialWord::Measured));
        if !may_be_cut {
            found.push(record(grid, layout, segment, first..last, initial).map_err(&refuse)?);
            continue;
        }
        let mut least = MIN_SAMPLES;
        if let Some(window) = declaration.error.windows_s {
            least = least.max(window_samples(window, grid.step));
        }
        let mut spans = grid.without_gaps(first, last);
        let whole = spans.len();
        if whole > 1 {
            spans.retain(|span| span.len() >= least);
        }
        if spans.is_empty() {
            return Err(refuse(format!(
                "rows are missing in so many places that nothing of {least} samples lies between them; name a span without gaps by from_s and to_s"
            )));
        }
        if whole > 1 {
            let places = counted(whole - 1, "place");
            notes.push(format!(
                "{}: rows are missing in {places}, and with them what drove the system: the record goes on behind each as one of its own, with initial states that are fitted.",
                segment.file,
            ));
        }
        for span in spans {
            let is_measured =
                initial == Initial::Word(InitialWord::Measured) && layout.states.iter().all(Option::is_some);
            let initial = if span.start == first || is_measured {
                initial.clone()
            } else {
                Initial::Word(InitialWord::Fit)
            };
            found.push(record(grid, layout, segment, span, initial).map_err(&refuse)?);
        }
    }
    let reaches_back = |record: &&Record| record.past.iter().flatten().any(|own| !own.is_empty());
    let inside = found.iter().filter(reaches_back).count();
    if inside > 0 {
        notes.push(format!(
            "{inside} of {} segments begin inside their file: delays, play and sampled components that follow inputs alone remember what the file shows before them. Elsewhere they begin settled at the first value.",
            found.len()
        ));
    }
    Ok(found)
}

/// The samples `span` of a file as a record.
fn record(
    grid: &Grid,
    layout: &Layout,
    segment: &Segment,
    span: Range<usize>,
    initial: Initial,
) -> Result<Record, String> {
    let (time, Range { start: first, end: last }) = (grid.series.time(), span);
    let make = |whole: bool, corner: Option<f64>| {
        one(grid, layout, if whole { 0..time.len() } else { first..last }, corner)
    };
    let past = first.saturating_sub(last - first)..first;
    let past = inputs(grid, layout, past, None)?;
    let Signals { inputs, states, extra, outputs } = make(false, None)?;
    let force = match &layout.force {
        None => None,
        Some((rule, velocity)) => {
            let Signals { inputs, states, extra, .. } = make(true, Some(rule.low_pass_hz))?;
            let trim = (rule.trim_s / grid.step).round() as usize;
            let range = if rule.whole_file { 0..time.len() } else { first..last };
            let range = (range.start + trim)..range.end.saturating_sub(trim).max(range.start + trim);
            let Some(v) = &states[*velocity] else {
                return Err("the velocity of error.force is not measured; add it to [states]".into());
            };
            let acceleration = signal::central(v, grid.step)[range.clone()].to_vec();
            let cut = |list: Vec<Option<Vec<f64>>>| {
                list.into_iter().map(|v| v.map(|v| v[range.clone()].to_vec())).collect()
            };
            let extra = extra.into_iter().map(|v| v[range.clone()].to_vec()).collect();
            Some(ForceRecord { inputs: cut(inputs), states: cut(states), extra, acceleration })
        }
    };
    let sensors = layout.columns().filter_map(|name| {
        let values = &grid.raw.channel(name)?.values;
        let values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let values = &values[..];
        let corners = layout.signals().into_iter().flatten().flatten();
        let corners = corners.filter(|own| own.source() == Some(name)).filter_map(|own| own.low_pass_hz);
        let driven = layout.inputs.iter().flatten().any(|own| own.source() == Some(name));
        let corners = corners.chain(layout.force.iter().filter(|_| driven).map(|force| force.0.low_pass_hz));
        // What a low-pass of the study takes away is noise by its own word; neighbors may hide it, as
        // interpolating encoders do.
        let removed = corners.fold(0.0f64, |most, corner| {
            most.max(
                grid.series.channel(name).map_or(0.0, |own| signal::above(&own.values, corner, grid.step)),
            )
        });
        let scatter = signal::scatter(values).max(removed);
        let sensor = Sensor { scatter, quantum: signal::quantum(values) };
        Some((name.clone(), sensor))
    });
    let sensors = sensors.collect();
    let unit = |signal: &Signal| grid.raw.channel(signal.source()?)?.unit.clone();
    Ok(Record {
        sensors,
        units: layout.outputs.iter().map(unit).collect(),
        measured: layout
            .outputs
            .iter()
            .map(|signal| {
                let own = grid.measured.get(signal.source()?)?[first..last].to_vec();
                own.contains(&false).then_some(own)
            })
            .collect(),
        factors: factors(grid, layout)?,
        name: format!(
            "{} {}-{} s",
            segment.file,
            round(time[first], grid.step),
            round(time[last - 1], grid.step)
        ),
        role: segment.role,
        initial,
        parameters: Vec::new(),
        step: grid.step,
        n: last - first,
        inputs,
        past,
        extra,
        outputs,
        states,
        ends: [first == 0, last == time.len()],
        smoothed: Vec::new(),
        force,
    })
}

/// The stated step \[s\] for a record with a step of its own \[s\]; none where none is stated, or a shorter one.
fn stated_step(file: &File, record: &str, own: f64, notes: &mut Vec<String>) -> Result<Option<f64>, Error> {
    let Some(stated) = &file.declaration.step_s else { return Ok(None) };
    let step = *stated.get_ref();
    if step < MIN_STEP * own {
        return Err(file.refuse(
            stated,
            format!(
                "step_s = {step:e} s is far shorter than the step of {record}, {} s: a slip of the unit? Leave step_s out, the integration is as fine as it needs to be",
                significant(own)
            ),
        ));
    }
    if step < SHORT_STEP * own {
        notes.push(format!(
            "{record}: step_s = {step} s is shorter than its own step of {} s, which is used: what lies between its samples is not measured, and the integration is as fine as it needs to be.",
            significant(own)
        ));
        return Ok(None);
    }
    Ok(Some(step))
}

/// Refuses validation segments that share samples with estimation segments.
fn separate(file: &File) -> Result<(), Error> {
    let segments = &file.declaration.segment;
    let of = |role: Role| segments.iter().filter(move |segment| segment.get_ref().role == role);
    for validation in of(Role::Validation) {
        let own = validation.get_ref();
        let ends = |segment: &super::declaration::Segment| {
            (segment.from_s.unwrap_or(f64::NEG_INFINITY), segment.to_s.unwrap_or(f64::INFINITY))
        };
        let (from, to) = ends(own);
        let shared = of(Role::Estimation).map(|other| other.get_ref()).find(|other| {
            let (begin, end) = ends(other);
            other.file == own.file && begin < to && from < end
        });
        if let Some(other) = shared {
            let (begin, end) = ends(other);
            let span = match (begin.is_finite(), end.is_finite()) {
                (false, false) => "the whole file".to_owned(),
                (true, false) => format!("{begin} s and later"),
                (false, true) => format!("up to {end} s"),
                (true, true) => format!("{begin} s to {end} s"),
            };
            return Err(file.refuse(
                validation,
                format!(
                    "this validation segment of {} shares samples with an estimation segment ({span}): an effect is judged on records that the fit has not seen; move from_s or to_s",
                    own.file
                ),
            ));
        }
    }
    Ok(())
}

/// A step as people write it.
fn significant(step: f64) -> f64 {
    format!("{step:.4e}").parse().unwrap_or(step)
}

/// A time as people write it: to a hundredth of the step, or finer.
fn round(time: f64, step: f64) -> f64 {
    let digits = (2.0 - step.log10().floor()).clamp(0.0, 9.0);
    let one = 10f64.powi(digits as i32);
    (time * one).round() / one
}

/// Unit of a signal of the system, where it has one.
pub fn unit(graph: &SystemGraph, name: &str) -> Option<String> {
    names::unit_of(graph, name).filter(|unit| lookup(unit).is_some())
}
