//! `summary.json` of a plan: what was asked, how the solver ended, how good the plan is, and what it took.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::cycle::Closure;
use super::deliver::{COMMANDS, Delivery, Motion};
use super::feed_forward::Command;
use super::file::{Length, Rod};
use super::prepare::Setup;
use super::recheck::Recheck;
use airloop_cosim::results::summary::FmuRecord;

/// Version of the layout; it grows when a field changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// Contents of `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// [`SCHEMA_VERSION`] of the program that wrote the file.
    pub schema_version: u32,
    /// Version of airloop.
    pub airloop_version: String,
    /// Always `optimize`.
    pub command: String,
    /// Name of the problem.
    pub problem: String,
    /// Problem file.
    pub problem_file: PathBuf,
    /// Fingerprint of problem file and FMUs (GUIDs): FNV-1a, 16 hexadecimal digits.
    pub problem_hash: String,
    /// Name of the system.
    pub system: String,
    /// File of the system.
    pub system_file: PathBuf,
    /// Transcription of the last solve.
    pub transcription: String,
    /// Intervals of each phase in the last solve.
    pub intervals: Vec<usize>,
    /// Guess of the first solve.
    pub guess: String,
    /// `solved`, `acceptable`, `infeasible`, `diverging`, `iteration_limit`, `interrupted`, `stalled` or
    /// `evaluation_failed`.
    pub status: String,
    /// The same as a sentence that says what to do.
    pub message: String,
    /// Objective; null where it has no value.
    pub objective: Option<f64>,
    /// Iterations of all solves.
    pub iterations: usize,
    /// Largest defect, in the units of the states, unscaled.
    pub max_defect: f64,
    /// Largest violation of a bound or condition, in its unit.
    pub max_bound_violation: f64,
    /// The worst constraint in words, where one is violated beyond the tolerance.
    pub worst: Option<String>,
    /// The bound that stands most in the way, where the problem is infeasible.
    pub blocking: Option<String>,
    /// Durations of the phases \[s\].
    pub durations: Vec<f64>,
    /// The same by the names of the phases.
    pub phase_durations: BTreeMap<String, f64>,
    /// Norm of the difference between the states at the end of the roll-out and of the plan, SI units.
    pub open_loop_final_error: Option<FinalError<f64>>,
    /// The same difference state by state, in the unit of each.
    pub open_loop_final_state_error: Option<FinalError<BTreeMap<String, f64>>>,
    /// Limits between the nodes and events that end phases, along the continuous roll-out.
    #[serde(default)]
    pub recheck: Option<Recheck>,
    /// How a motion that repeats itself closes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cycle: Option<Closure>,
    /// Largest estimated error of a state over one interval, relative to the size of the state.
    pub max_interval_error: Option<f64>,
    /// Wall-clock times \[s\].
    pub time: Times,
    /// Every solve, in its order.
    pub passes: Vec<PassRecord>,
    /// Variables of the last solve.
    pub variables: usize,
    /// Constraints of the last solve.
    pub constraints: usize,
    /// Signals of `trajectory.csv`.
    pub signals: Vec<SignalRecord>,
    /// States of the phase portrait: one, and its rate.
    pub portrait: Option<(String, String)>,
    /// Cart-pole that the page shows.
    pub animation: Option<AnimationRecord>,
    /// Rods that the page shows.
    #[serde(default)]
    pub stick_figure: Option<StickRecord>,
    /// FMU of every component.
    pub fmus: Vec<FmuRecord>,
    /// Accuracy with which actuators deliver the planned forces, where the problem asks for it.
    pub stage2: Option<Stage2Record>,
    /// Motion of the plant under the delivered forces, for each kind of command (`optimized`, `naive`).
    pub closed_chain: Option<BTreeMap<String, ChainRecord>>,
    /// CSV files in the folder of the summary.
    pub files: Vec<String>,
    /// Figures in the folder of the summary.
    pub figures: Vec<String>,
    /// Choices made for the user, and deviations from the usual procedure, one sentence each.
    pub notes: Vec<String>,
}

/// Roll-outs of the plan through a master.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FinalError<T> {
    /// All components in continuous time, the command as the transcription sees it.
    pub continuous: Option<T>,
    /// Sampled components at their rate, the command held over each sample.
    pub sampled: Option<T>,
}

/// Accuracy with which actuators deliver planned forces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stage2Record {
    /// NRMSE fit \[%\] of each delivered force to its plan, for each kind of command (`optimized`, `naive`).
    pub fit: BTreeMap<String, BTreeMap<String, Option<f64>>>,
    /// Samples by which each delivered force is late.
    pub late: BTreeMap<String, BTreeMap<String, i64>>,
    /// Largest command of each kind.
    pub max_command: BTreeMap<String, BTreeMap<String, f64>>,
}

/// A motion of the plant under delivered forces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChainRecord {
    /// Whether it went on to the end of the plan.
    pub completed: bool,
    /// Reason why it did not.
    pub problem: Option<String>,
    /// Time at which it ended \[s\].
    pub end: f64,
    /// Largest error of a state at the end.
    pub max_final_error: f64,
    /// Reached minus planned, by state.
    pub final_error: BTreeMap<String, f64>,
}

/// Fits of a delivery.
pub fn stage2(delivery: &Delivery) -> Stage2Record {
    fn each<T>(delivery: &Delivery, of: impl Fn(&Command) -> T) -> BTreeMap<String, BTreeMap<String, T>> {
        let kinds = |commands: &[Command; 2]| {
            COMMANDS.iter().zip(commands).map(|(kind, command)| ((*kind).to_owned(), of(command))).collect()
        };
        delivery.forces.iter().map(|(name, commands)| (name.clone(), kinds(commands))).collect()
    }
    Stage2Record {
        fit: each(delivery, |command| command.fit.nrmse_percent),
        late: each(delivery, |command| command.late),
        max_command: each(delivery, |command| command.u.iter().fold(0.0, |most: f64, u| most.max(u.abs()))),
    }
}

/// Motions of a delivery, where there is a plant.
pub fn closed_chain(delivery: &Delivery) -> Option<BTreeMap<String, ChainRecord>> {
    let record = |motion: &Motion| ChainRecord {
        completed: motion.problem.is_none(),
        problem: motion.problem.clone(),
        end: motion.result.time().last().copied().unwrap_or(0.0),
        max_final_error: motion.final_error.values().fold(0.0, |most, error| most.max(error.abs())),
        final_error: motion.final_error.clone(),
    };
    let motions = delivery.motions.as_ref()?;
    Some(COMMANDS.iter().zip(motions).map(|(kind, motion)| ((*kind).to_owned(), record(motion))).collect())
}

/// Wall-clock times \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Times {
    /// Reading problem and system, unpacking and loading FMUs.
    pub load: f64,
    /// Building the nonlinear program.
    pub build: f64,
    /// Solving, functions included.
    pub solve: f64,
    /// Roll-outs.
    pub verify: f64,
    /// All of it, up to the writing of the results.
    pub total: f64,
}

/// One solve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassRecord {
    /// Transcription.
    pub transcription: String,
    /// Intervals of each phase.
    pub intervals: Vec<usize>,
    /// Outcome, as [`Summary::status`].
    pub status: String,
    /// Objective.
    pub objective: Option<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Evaluations of the functions.
    pub function_evaluations: usize,
    /// Factorizations of the KKT matrix.
    pub factorizations: usize,
    /// Wall-clock time \[s\].
    pub time: f64,
}

/// A column of `trajectory.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalRecord {
    /// Name, also of the column.
    pub name: String,
    /// `state`, `input`, `output` or `multiplier`.
    pub kind: String,
    /// Unit.
    pub unit: Option<String>,
    /// Smallest allowed value along the whole way, if there is one.
    pub min: Option<f64>,
    /// Largest allowed value along the whole way, if there is one.
    pub max: Option<f64>,
    /// Whether each value is held until the next row.
    pub held: bool,
}

/// A cart with a pole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnimationRecord {
    /// Column of the position of the cart \[m\].
    pub cart: String,
    /// Column of the angle of the pole \[rad\].
    pub angle: String,
    /// Length of the pole \[m\].
    pub length: f64,
}

/// Rods from a point that moves, each to `(x + length sin(angle), y - length cos(angle))`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StickRecord {
    /// Columns of the point \[m\].
    pub x: String,
    /// See `x`.
    pub y: String,
    /// The rods.
    pub rods: Vec<RodRecord>,
}

/// A rod.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RodRecord {
    /// Name in the figure; none: its angles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Columns of the angles \[rad\] whose mean is that of the rod.
    pub angles: Vec<String>,
    /// Its length \[m\]: a number, or a column.
    pub length: Length,
}

impl StickRecord {
    /// The rods of a problem, by the names of columns; none where it has none.
    pub fn of(setup: &Setup) -> Option<StickRecord> {
        let shown = |name: &str| {
            let found = setup.catalog.find(name);
            found.map_or(name.into(), |(index, _)| setup.catalog.variables()[index].name.clone())
        };
        let rod = |rod: &Rod| RodRecord {
            name: rod.name.clone(),
            angles: rod.angle.names().iter().map(|angle| shown(angle)).collect(),
            length: match &rod.length {
                Length::Variable(name) => Length::Variable(shown(name)),
                Length::Number(length) => Length::Number(*length),
            },
        };
        let figure = setup.statement.stick_figure.as_ref()?;
        let rods = figure.rods.iter().map(rod).collect();
        Some(StickRecord { x: shown(&figure.x.text), y: shown(&figure.y.text), rods })
    }
}

/// Reason why a summary cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file and cause, as named in each message")]
pub enum Error {
    /// File system.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// Not a summary of a plan.
    #[error("{}: this is not a summary of `airloop optimize`, schema version {SCHEMA_VERSION}: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
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
