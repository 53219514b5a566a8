//! The part of `summary.json` on the coupling error: what the finite communication step does to each signal.

use serde::{Deserialize, Serialize};

/// Estimated coupling error of a run, and what other masters would do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CouplingErrorRecord {
    /// Communication step \[s\] the errors belong to; the run was repeated with a half and a quarter of it.
    pub step_size: f64,
    /// Error \[%\] relative to the RMS of the signal that is good enough.
    pub goal_percent: f64,
    /// Signals that have to reach the goal.
    pub goal_signals: Vec<String>,
    /// Errors of the run, signal by signal.
    pub signals: Vec<SignalErrorRecord>,
    /// Masters that were tried at the same step, that of the run first.
    pub masters: Vec<MasterErrorRecord>,
    /// Cheapest way to the goal that was found; null if none was.
    pub recommendation: Option<RecommendationRecord>,
}

/// Degree to which three communication steps can be trusted to show the error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// The error shrinks by a power of the step: the estimate holds.
    Asymptotic,
    /// It does not: the number is the difference from the finest run and no more than a hint.
    NotAsymptotic,
    /// Too small (1e-7 of the signal) to tell from rounding and from the tolerances inside FMUs.
    Negligible,
}

/// Coupling error of one signal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalErrorRecord {
    /// Column of `result.csv`.
    pub name: String,
    /// Unit.
    pub unit: Option<String>,
    /// `output` of the system, or `connection` between components.
    pub kind: String,
    /// RMS of the error at the communication points, in the unit of the signal.
    pub rms_error: f64,
    /// The same \[%\] relative to the RMS of the signal; null if the signal is zero.
    pub relative_percent: Option<f64>,
    /// Order p of the error in the step, error ~ step^p, as observed; null if there is none.
    pub order: Option<f64>,
    /// Whether the estimate holds.
    pub standing: Standing,
}

/// One master at the communication step of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MasterErrorRecord {
    /// Options on the command line, e.g. `--master gauss-seidel --extrapolation 1`.
    pub options: String,
    /// `fmi2DoStep` calls of a run.
    pub fmu_steps: u64,
    /// Largest relative error \[%\] of the signals that have to reach the goal; null if it could not run.
    pub worst_percent: Option<f64>,
    /// Signal of that error.
    pub worst_signal: Option<String>,
    /// Whether the estimates of all those signals hold (or are negligible).
    pub trusted: bool,
    /// Communication step \[s\] that reaches the goal, at most that of the run; null if none can be told.
    pub step_for_goal: Option<f64>,
    /// Reason why the master could not run with the step, its half or its quarter.
    pub problem: Option<String>,
}

/// Master and step for the goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecommendationRecord {
    /// Options on the command line.
    pub options: String,
    /// Communication step \[s\].
    pub step_size: f64,
    /// `fmi2DoStep` calls to expect, in proportion to the step.
    pub fmu_steps: u64,
}
