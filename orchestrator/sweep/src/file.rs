//! The file of a plan, as its author writes it.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use airloop_plan::file::{Source, declared};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;

use crate::Error;

/// Kind of the tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Simulations of a system.
    Simulate,
    /// Trials of a stabilized system.
    Trials,
    /// Commands of the program, each with a folder of its own.
    Command,
    /// Nothing, to measure what planning, running and merging cost.
    Empty,
}

/// Way in which factors are sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Every combination of levels.
    #[default]
    Grid,
    /// One value in each of `count` cells of every factor.
    LatinHypercube,
    /// Points of low discrepancy; take a power of two.
    Sobol,
    /// Sobol' points in the arrangement of Saltelli, from which the report has Sobol' indices: for each of `count`
    /// points as many tasks as there are factors, and two.
    Saltelli,
}

/// Spacing of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Even.
    #[default]
    Linear,
    /// Even in the logarithm.
    Log,
}

/// How factors are sampled, and how many tasks that gives.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Way in which factors are sampled.
    #[serde(default)]
    pub method: Method,
    /// Number of tasks; of a grid: repetitions of each combination, with seeds of their own.
    #[serde(default = "one")]
    pub count: u64,
}

fn one() -> u64 {
    1
}

/// Values of a parameter, input, state, record or setting.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// Name: component.variable, an input of the system, `run.master`, `run.step`, `run.stop`, `run.tolerance`,
    /// `run.input`, or a word in braces of a command.
    pub name: String,
    /// Values one by one.
    #[schemars(with = "Option<Vec<Scalar>>")]
    pub values: Option<Vec<toml::Value>>,
    /// Lower limit.
    pub from: Option<f64>,
    /// Upper limit.
    pub to: Option<f64>,
    /// Number of values in a grid.
    pub levels: Option<u64>,
    /// Spacing between the limits.
    #[serde(default)]
    pub scale: Scale,
    /// Folder whose entries are the values, in the order of their names.
    pub entries_of: Option<String>,
}

/// In a schema a number, a truth value or a text.
enum Scalar {}

impl JsonSchema for Scalar {
    fn schema_name() -> Cow<'static, str> {
        "Scalar".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "boolean", "string"] })
    }

    fn inline_schema() -> bool {
        true
    }
}

/// Quantity that is taken of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Of {
    /// Least value.
    Min,
    /// Largest value.
    Max,
    /// Largest absolute value.
    Peak,
    /// Root of the mean square over time.
    Rms,
    /// Last value.
    Final,
    /// First time \[s\] at which the signal crosses `level`.
    Event,
    /// Root of the mean squared difference from the measurement.
    RmsError,
    /// Fit to the measurement \[%\].
    Fit,
}

/// Direction of a crossing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Either.
    #[default]
    Any,
    /// From below.
    Rising,
    /// From above.
    Falling,
}

/// A number, or a text, of each task.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// Name of the column.
    pub name: String,
    /// Signal of a simulation.
    pub signal: Option<String>,
    /// Quantity of the signal.
    pub of: Option<Of>,
    /// Level of an event, in the unit of the signal.
    pub level: Option<f64>,
    /// Direction of an event.
    #[serde(default)]
    pub direction: Direction,
    /// JSON file that a command writes into its folder.
    pub file: Option<String>,
    /// Place in the file, e.g. /outcome/end_time.
    pub pointer: Option<String>,
    /// Whether the value is a text; default: a number.
    #[serde(default)]
    pub text: bool,
}

/// Whole signals of every simulation.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signals {
    /// Names, as in the results of `airloop run`.
    pub names: Vec<String>,
    /// Each so many rows of a simulation one is kept, and the last.
    #[serde(default = "one")]
    pub every: u64,
}

/// Settings of all simulations, with the names of `airloop run`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Start time \[s\].
    pub start: Option<f64>,
    /// Stop time \[s\].
    pub stop: Option<f64>,
    /// Communication step \[s\].
    pub step: Option<f64>,
    /// Master, as `--master` of `airloop run`.
    pub master: Option<String>,
    /// Relative tolerance of the FMUs that have one.
    pub tolerance: Option<f64>,
    /// Order of the extrapolation of inputs: 0, 1 or 2.
    pub extrapolation: Option<u32>,
    /// Record of inputs.
    pub input: Option<String>,
    /// Record to compare with.
    pub measured: Option<String>,
    /// Whether inputs are held between their samples; default: a line.
    #[serde(default)]
    pub hold: bool,
    /// Columns of another name, by connector.
    #[serde(default)]
    pub signals: BTreeMap<String, String>,
    /// Start values of every task.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Scalar>")]
    pub set: BTreeMap<String, toml::Value>,
}

/// Trials of a stabilized system.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Trials {
    /// Seeds: `seed` of the plan, and the next ones.
    pub count: u64,
    /// Factor of all perturbations.
    #[serde(default = "unchanged")]
    pub scale: f64,
    /// Whether the plan alone is tried too.
    #[serde(default = "yes")]
    pub open_loop: bool,
    /// Settings of the controller; default: those in the folder.
    pub settings: Option<String>,
}

fn unchanged() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

/// Options of `sbatch`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slurm {
    /// Time limit of a shard, as `sbatch` takes it.
    pub time: Option<String>,
    /// Memory of a shard.
    pub memory: Option<String>,
    /// Partition of the cluster.
    pub partition: Option<String>,
    /// Account that the time is charged to.
    pub account: Option<String>,
    /// Modules to load.
    #[serde(default)]
    pub modules: Vec<String>,
    /// Most shards that run at a time.
    pub at_a_time: Option<u64>,
}

/// Independent tasks: simulations over samples of their parameters, trials, or commands.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Kind of the tasks.
    pub kind: Kind,
    /// Seed from which every task gets its own.
    #[serde(default)]
    pub seed: u64,
    /// System, or folder of `airloop stabilize`.
    pub system: Option<String>,
    /// Words of a command; {task}, {seed}, {output} and the names of factors in braces are replaced.
    #[serde(default)]
    pub command: Vec<String>,
    /// Files and folders that a command reads.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// Longest time of a task \[s\].
    pub time_limit: Option<f64>,
    /// Number of shards: 1 without it.
    pub shards: Option<u64>,
    /// Settings of simulations.
    #[serde(default)]
    pub run: Run,
    /// Settings of trials.
    pub trials: Option<Trials>,
    /// How factors are sampled; without it every combination of their values, once.
    pub sample: Option<Sample>,
    /// Parameters, inputs, states, records, settings or words of a command that differ from task to task.
    #[serde(default)]
    pub factors: Vec<Factor>,
    /// Values of each task in the table of results.
    #[serde(default)]
    pub quantities: Vec<Quantity>,
    /// Whole signals that are kept.
    pub signals: Option<Signals>,
    /// Options of Slurm.
    #[serde(default)]
    pub slurm: Slurm,
}

impl PlanFile {
    /// JSON schema of a plan, for editors that complete and check TOML.
    pub fn schema() -> String {
        airloop_series::schema::schema_of::<PlanFile>()
    }

    /// Reads the text of a plan; `file` is its name in messages.
    ///
    /// # Errors
    /// [`Error::File`] with line and column.
    pub fn parse(text: &str, file: &Path) -> Result<PlanFile, Error> {
        let source = Source { file: file.into(), text: text.into() };
        declared::read(&source).map_err(|error| {
            let problem = match error {
                airloop_plan::Error::File { line, column, problem, .. } => {
                    format!("line {line}, column {column}: {problem}")
                }
                other => other.to_string(),
            };
            Error::File { file: file.into(), problem }
        })
    }
}
