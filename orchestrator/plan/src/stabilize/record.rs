//! `summary.json` of a stabilized plan and of trials, and the tables that go with it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Stabilized;
use crate::Error;
use crate::catalog::Catalog;
use crate::record::StickRecord;
use airloop_ocp::control::Monodromy;
use airloop_series::TimeSeries;

/// Version of the layout; it grows when a field changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// A signal with what the design assumes of it, in its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalRecord {
    /// Name, also of the column in `gains.csv`.
    pub name: String,
    /// `state`, `input` or `measured`.
    pub kind: String,
    /// Unit.
    pub unit: Option<String>,
    /// Deviation that costs as much as those of the others; null for measured signals.
    pub deviation: Option<f64>,
    /// Standard deviation after one second, of the drift of a state that the model does not describe, or of the
    /// disturbance of an input.
    pub drift: Option<f64>,
    /// Standard deviation of the noise of a measured signal.
    pub noise: Option<f64>,
    /// Limits of an input.
    pub limits: Option<(f64, f64)>,
}

/// A plan that repeats itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CycleRecord {
    /// Turns over which the closed loop is run.
    pub turns: usize,
    /// Time of one \[s\].
    pub period: f64,
    /// Under the inputs of the plan.
    pub open_loop: MonodromyRecord,
    /// Under the regulator, all states known.
    pub closed_loop: MonodromyRecord,
    /// Turns after which the gains repeat themselves.
    pub turns_to_periodic_gains: usize,
}

/// Derivatives of the states at the begin of a turn by those at the begin of the one before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MonodromyRecord {
    /// Poincaré multipliers, real and imaginary part, the largest first; those of free states, which are 1 without
    /// feedback, are left out there.
    pub multipliers: Vec<(f64, f64)>,
    /// Largest magnitude of a multiplier.
    pub radius: f64,
    /// The matrix row by row, states in the order of `signals`.
    pub matrix: Vec<Vec<f64>>,
}

/// The record of a monodromy matrix.
fn monodromy(own: &Monodromy) -> MonodromyRecord {
    MonodromyRecord {
        multipliers: own.multipliers.iter().map(|one| (one.re, one.im)).collect(),
        radius: own.multipliers.iter().map(|one| one.norm()).fold(0.0, f64::max),
        matrix: own.matrix.row_iter().map(|row| row.iter().copied().collect()).collect(),
    }
}

/// The cycle of a stabilized plan, if it has one.
pub fn cycle(stabilized: &Stabilized) -> Option<CycleRecord> {
    let own = stabilized.repeated.as_ref()?;
    let samples = stabilized.nominal.samples() / own.turns;
    Some(CycleRecord {
        turns: own.turns,
        period: samples as f64 * stabilized.nominal.sample_time,
        open_loop: monodromy(&own.open_loop),
        closed_loop: monodromy(&own.closed_loop),
        turns_to_periodic_gains: own.turns_to_periodic_gains,
    })
}

/// `summary.json` of `airloop stabilize`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// [`SCHEMA_VERSION`] of the program that wrote the file.
    pub schema_version: u32,
    /// Version of airloop.
    pub airloop_version: String,
    /// Always `stabilize`.
    pub command: String,
    /// Trajectory that is stabilized.
    pub trajectory_file: PathBuf,
    /// Problem of the plan.
    pub problem_file: PathBuf,
    /// Settings of the design.
    pub settings_file: PathBuf,
    /// Time between samples \[s\].
    pub sample_time: f64,
    /// Samples before the hold.
    pub samples: usize,
    /// Whether the plan ends in an equilibrium, which is held.
    pub rests: bool,
    /// States, inputs and measured signals.
    pub signals: Vec<SignalRecord>,
    /// Multipliers of a plan that repeats itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cycle: Option<CycleRecord>,
    /// Rods that the page shows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stick_figure: Option<StickRecord>,
    /// Largest distance of the closed loop from the plan without noise and perturbation, by signal.
    pub largest_error: BTreeMap<String, f64>,
    /// Wall-clock time of the design \[s\].
    pub design_time: f64,
    /// Files in the folder.
    pub files: Vec<String>,
    /// Figures in the folder.
    pub figures: Vec<String>,
    /// Choices made for the user, one sentence each.
    pub notes: Vec<String>,
}

/// Trials that keep a criterion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CriterionRecord {
    /// Name of the criterion.
    pub name: String,
    /// Closed-loop trials that keep it.
    pub closed_loop: usize,
    /// Open-loop trials that keep it.
    pub open_loop: usize,
}

/// `summary.json` of `airloop trials`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialsSummary {
    /// [`SCHEMA_VERSION`] of the program that wrote the file.
    pub schema_version: u32,
    /// Version of airloop.
    pub airloop_version: String,
    /// Always `trials`.
    pub command: String,
    /// System that was tried.
    pub system_file: PathBuf,
    /// Settings of the trials.
    pub settings_file: PathBuf,
    /// `completed` or `interrupted`.
    pub status: String,
    /// Trials asked for, of each kind.
    pub count: usize,
    /// Closed-loop trials done.
    pub closed_loop: usize,
    /// Open-loop trials done.
    pub open_loop: usize,
    /// Seed of the first.
    pub seed: u64,
    /// Factor of the perturbations.
    pub scale: f64,
    /// Master.
    pub master: String,
    /// Criteria in the order of the file.
    pub criteria: Vec<CriterionRecord>,
    /// Trials that ended early, with the reason.
    pub ended_early: Vec<String>,
    /// Perturbations that were drawn again since a variable would have left its range, with the number of draws.
    #[serde(default)]
    pub drawn_again: Vec<String>,
    /// Wall-clock time \[s\].
    pub time: f64,
    /// Files in the folder.
    pub files: Vec<String>,
    /// Figures in the folder.
    pub figures: Vec<String>,
}

/// Writes a summary.
///
/// # Errors
/// [`Error::Io`].
pub fn write<T: Serialize>(summary: &T, path: &Path) -> Result<(), Error> {
    airloop_series::file::write_json(path, summary).map_err(|source| Error::Io { file: path.into(), source })
}

/// Signals of the design.
pub fn signals(stabilized: &Stabilized, states: &[usize], catalog: &Catalog) -> Vec<SignalRecord> {
    let design = &stabilized.design;
    let record = |index: usize, kind: &str| {
        let variable = &catalog.variables()[index];
        SignalRecord {
            name: variable.name.clone(),
            kind: kind.into(),
            unit: variable.unit.clone(),
            deviation: None,
            drift: None,
            noise: None,
            limits: None,
        }
    };
    let states = states.iter().enumerate().map(|(i, &index)| SignalRecord {
        deviation: Some(design.state_deviation[i]).filter(|value| value.is_finite()),
        drift: Some(design.state_drift[i]),
        ..record(index, "state")
    });
    let inputs = stabilized.inputs.iter().enumerate().map(|(i, &index)| SignalRecord {
        deviation: Some(design.input_deviation[i]).filter(|value| value.is_finite()),
        drift: Some(design.input_drift[i]),
        limits: Some(design.limits[i]).filter(|limits| limits.0.is_finite() && limits.1.is_finite()),
        ..record(index, "input")
    });
    let measured = stabilized
        .measured
        .iter()
        .enumerate()
        .map(|(i, &index)| SignalRecord { noise: Some(design.noise[i]), ..record(index, "measured") });
    states.chain(inputs).chain(measured).collect()
}

/// Name of the column of a gain.
pub fn gain_column(input: &str, state: &str) -> String {
    format!("gain of {input} on {state}")
}

/// The plan on the samples with the feedback, a row per sample; the last row holds from there on.
///
/// # Errors
/// Names that stand twice.
pub fn gains(stabilized: &Stabilized, catalog: &Catalog) -> Result<TimeSeries, Error> {
    let rows = &stabilized.rows;
    let mut series = TimeSeries::new((0..rows.len()).map(|k| stabilized.nominal.time(k)).collect())?;
    let input = |j: usize| &catalog.variables()[stabilized.inputs[j]];
    let unit = |name: &str| catalog.find(name).and_then(|(index, _)| catalog.variables()[index].unit.clone());
    for (i, name) in stabilized.states.iter().enumerate().take(stabilized.nominal.states[0].len()) {
        series.push(name.clone(), unit(name), rows.iter().map(|row| row.states[i]).collect())?;
    }
    for j in 0..stabilized.inputs.len() {
        let values = rows.iter().map(|row| row.inputs[j]).collect();
        series.push(input(j).name.clone(), input(j).unit.clone(), values)?;
    }
    for j in 0..stabilized.inputs.len() {
        for (i, state) in stabilized.states.iter().enumerate() {
            let values = rows.iter().map(|row| row.feedback[(j, i)]).collect();
            series.push(gain_column(&input(j).name, state), None, values)?;
        }
    }
    Ok(series)
}
