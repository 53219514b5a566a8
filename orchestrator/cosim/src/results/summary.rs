//! `summary.json`: what was run, with which settings and FMUs, how it ended, how fast, and how well it fits.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::coupling_error::CouplingErrorRecord;

/// Version of the layout of `summary.json`; it grows when a field changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// Contents of `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// [`SCHEMA_VERSION`] of the program that wrote the file.
    pub schema_version: u32,
    /// Version of airloop.
    pub airloop_version: String,
    /// Name of the system.
    pub system: String,
    /// File the system was read from.
    #[serde(serialize_with = "as_text")]
    pub system_file: PathBuf,
    /// Settings the run used, after all defaults.
    pub settings: Settings,
    /// Outcome of the run.
    pub outcome: Outcome,
    /// Wall-clock times.
    pub timings: Timings,
    /// Work that the run took.
    #[serde(default)]
    pub effort: EffortRecord,
    /// Work of the integrator; only there for the monolithic master.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub integration: Option<Integration>,
    /// Adaptive communication steps; only there if they were wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<AdaptiveRecord>,
    /// FMU of every component, in evaluation order.
    pub fmus: Vec<FmuRecord>,
    /// Columns of `result.csv` that are connectors of the system.
    pub connectors: Vec<ConnectorRecord>,
    /// Measured signals with their fit; empty without a measurement.
    pub signals: Vec<SignalRecord>,
    /// Files of the figures in the folder of the summary.
    #[serde(default)]
    pub figures: Vec<String>,
    /// Estimated coupling error; only there if it was asked for and could be estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupling_error: Option<CouplingErrorRecord>,
    /// Choices made for the user, and deviations from the usual procedure, one sentence each.
    pub fallbacks: Vec<String>,
}

/// Settings of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Start time \[s\].
    pub start_time: f64,
    /// Stop time \[s\].
    pub stop_time: f64,
    /// Communication step size \[s\].
    pub step_size: f64,
    /// `gauss-seidel`, `jacobi`, `interface-jacobian` or `monolithic`.
    pub master: String,
    /// Order of the polynomials that inputs follow inside a step of `gauss-seidel` or `jacobi`.
    #[serde(default)]
    pub extrapolation: u32,
    /// Options of the interface-Jacobian master; null for others.
    #[serde(default)]
    pub coupling: Option<CouplingRecord>,
    /// `linear` or `hold`, for the inputs.
    pub interpolation: String,
    /// Relative tolerance passed to the FMUs.
    pub tolerance: Option<f64>,
    /// CSV file of the inputs.
    #[serde(serialize_with = "as_text_if_any")]
    pub input: Option<PathBuf>,
    /// CSV file of the measurement.
    #[serde(serialize_with = "as_text_if_any")]
    pub measured: Option<PathBuf>,
    /// `measured` or `zero`: start of the measured states.
    pub initial: Option<String>,
    /// Start values given on the command line, `name=value`.
    pub set: Vec<String>,
}

/// Options of the interface-Jacobian master.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CouplingRecord {
    /// Repeated steps; without meaning where `iterate` is given.
    pub corrections: u32,
    /// Relative change of the outputs at which repetition ends.
    pub iterate: Option<f64>,
    /// `ramped` or `held`.
    pub inputs: String,
}

/// Work that a run took.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct EffortRecord {
    /// `fmi2DoStep` calls of all components; repeated steps count again.
    pub fmu_steps: u64,
    /// The same by component.
    pub steps_of: BTreeMap<String, u64>,
    /// Evaluations (values and derivatives) of blocks without states inside the master.
    pub static_evaluations: u64,
    /// Rounds of Newton's method inside the master.
    pub newton_rounds: u64,
    /// Steps of coupled components, repetitions included.
    pub coupled_passes: u64,
}

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// `completed`, `terminated` (by a component), `interrupted` (by the user) or `failed`.
    pub status: String,
    /// Reason why it did not reach the stop time.
    pub message: Option<String>,
    /// Time \[s\] of the last row of the result.
    pub end_time: f64,
    /// Macro steps done.
    pub steps: u64,
}

/// Adaptive communication steps of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AdaptiveRecord {
    /// Error of one step relative to the size of the signal.
    pub tolerance: f64,
    /// Limits of the communication step \[s\].
    pub min_step: f64,
    /// See `min_step`.
    pub max_step: f64,
    /// Communication steps that were kept.
    pub accepted: u64,
    /// Steps (under `interface-jacobian`: pairs of steps) that were taken back and tried shorter.
    pub rejected: u64,
    /// Shortest communication step that was kept \[s\]; null if there is none.
    pub smallest_step: Option<f64>,
    /// Longest communication step that was kept \[s\]; null if there is none.
    pub largest_step: Option<f64>,
}

impl AdaptiveRecord {
    /// Record of a run that has not stepped yet; `tolerance` relative, steps in s.
    pub fn new(tolerance: f64, min_step: f64, max_step: f64) -> AdaptiveRecord {
        let (accepted, rejected, smallest_step, largest_step) = (0, 0, None, None);
        AdaptiveRecord { tolerance, min_step, max_step, accepted, rejected, smallest_step, largest_step }
    }

    /// Counts a communication step \[s\] that was kept.
    pub fn accept(&mut self, step: f64) {
        self.accepted += 1;
        self.smallest_step = Some(self.smallest_step.map_or(step, |smallest| smallest.min(step)));
        self.largest_step = Some(self.largest_step.map_or(step, |largest| largest.max(step)));
    }
}

/// Work of the integrator of the monolithic master.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Integration {
    /// Integration method.
    pub method: String,
    /// Relative tolerance it kept to.
    pub relative_tolerance: f64,
    /// Integrator steps.
    pub steps: u64,
    /// Steps taken back because their error was too large.
    pub rejected_steps: u64,
    /// Evaluations of the right-hand side of the whole system, those to find events included.
    pub evaluations: u64,
    /// Events at times that components announced (samples among them).
    pub time_events: u64,
    /// Events found through event indicators, or wanted by a component after a step.
    pub state_events: u64,
    /// Events because an input of the system jumped.
    pub input_events: u64,
}

/// Wall-clock times of a run.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Timings {
    /// Reading files, instantiating and initializing \[s\].
    pub initialization_s: f64,
    /// Stepping \[s\].
    pub simulation_s: f64,
    /// Macro steps per second of stepping.
    pub steps_per_second: f64,
    /// Simulated time over stepping time; above 1 is faster than real time.
    pub real_time_factor: f64,
}

impl Timings {
    /// Timings of `steps` macro steps from `start` to `end` \[s\].
    pub fn new(initialization: Duration, stepping: Duration, steps: u64, start: f64, end: f64) -> Timings {
        let simulation = stepping.as_secs_f64();
        let per_second = |amount: f64| if simulation > 0.0 { amount / simulation } else { 0.0 };
        Timings {
            initialization_s: initialization.as_secs_f64(),
            simulation_s: simulation,
            steps_per_second: per_second(steps as f64),
            real_time_factor: per_second(end - start),
        }
    }
}

/// One FMU of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FmuRecord {
    /// Component that it implements.
    pub component: String,
    /// `modelName`.
    pub model_name: String,
    /// GUID.
    pub guid: String,
    /// File.
    #[serde(serialize_with = "as_text")]
    pub path: PathBuf,
    /// `version` of the model, if given.
    pub version: Option<String>,
    /// `generationTool`, if given.
    pub generation_tool: Option<String>,
}

/// A connector of the system with a column in `result.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConnectorRecord {
    /// Name, also of the column.
    pub name: String,
    /// `input` or `output`.
    pub kind: String,
    /// Unit.
    pub unit: Option<String>,
    /// Discrete: each value is held until the next row.
    pub held: bool,
}

/// Fit of one measured signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalRecord {
    /// System connector.
    pub name: String,
    /// Unit of the connector.
    pub unit: Option<String>,
    /// Column of the measurement.
    pub column: String,
    /// Measured value in the unit of the connector = factor * column + offset.
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
    /// NRMSE fit \[%\], `100 (1 - ||y - ys|| / ||y - mean(y)||)`; null if the measured signal is constant.
    pub fit_percent: Option<f64>,
    /// RMS error in the unit of the connector.
    pub rms_error: f64,
    /// Samples compared.
    pub samples: usize,
}

/// Reason why a summary cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file and cause, as named in each message")]
pub enum Error {
    /// File system.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// Not a summary.
    #[error("{}: this is not a summary of schema version {SCHEMA_VERSION}: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
}

/// A name that is no text loses the bytes that are none; the run is worth more.
fn as_text<S: serde::Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

/// Same as [`as_text`] for a file that may not have been given.
fn as_text_if_any<S: serde::Serializer>(path: &Option<PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(to)
}

/// Writes the summary.
///
/// # Errors
/// [`Error::Io`].
pub fn write(summary: &Summary, path: &Path) -> Result<(), Error> {
    airloop_series::file::write_json(path, summary).map_err(|source| Error::Io { path: path.into(), source })
}

/// Reads a summary.
///
/// # Errors
/// [`Error::Io`], or [`Error::Json`] for another kind of file.
pub fn read(path: &Path) -> Result<Summary, Error> {
    let text = airloop_series::file::read_to_string(path)
        .map_err(|source| Error::Io { path: path.into(), source })?;
    serde_json::from_str(&text).map_err(|source| Error::Json { path: path.into(), source })
}
