//! The file of settings of `airloop stabilize` and `airloop trials`: TOML with named variables and units.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::Error;
use crate::file::value::same_schema;
use crate::file::{Entries, Parameters, Place, Placed, Quantity, Source, Text, declared};

/// Sensors, weights and limits of the controller that keeps to a plan, and the trials of its closed loop.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "airloop stabilize: settings", extend("required" = ["sensors"]))]
pub struct Settings {
    /// The file.
    #[serde(skip)]
    pub source: Source,
    /// Time between samples; default: that of the sampled components.
    pub sample_time: Option<Quantity>,
    /// Measured signals with the standard deviation of their noise, in the order of the controller's inputs.
    #[serde(default)]
    #[schemars(extend("minProperties" = 1))]
    pub sensors: Entries<Quantity>,
    /// Deviations of states and inputs that cost alike.
    #[serde(default)]
    pub deviation: Entries<Quantity>,
    /// Standard deviation after one second: of drifts of states that the model does not describe, of disturbances of
    /// inputs.
    #[serde(default)]
    pub drift: Entries<Quantity>,
    /// Standard deviation of initial states.
    #[serde(default)]
    pub initial: Entries<Quantity>,
    /// Limits of inputs.
    #[serde(default)]
    pub limits: Entries<InputLimits>,
    /// Start values of parameters of the closed loop: component.variable.
    #[serde(default)]
    pub parameters: Parameters,
    /// How a plan with several phases is followed.
    pub phases: Option<Placed<PhaseSettings>>,
    /// Model predictive control (`--nmpc`).
    pub nmpc: Option<Placed<NmpcSettings>>,
    /// Trials.
    pub trials: Option<Placed<Trials>>,
}

/// Model predictive control: horizon, solves, and what it learns of the plant.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NmpcSettings {
    /// Length of the horizon; default: 0.5 s.
    pub horizon: Option<Quantity>,
    /// Time between its steps, a multiple of the sample time; default: 5 of these.
    pub step: Option<Quantity>,
    /// Time between solves, a multiple of the step; default: 4 of these.
    pub period: Option<Quantity>,
    /// Most iterations of a solve; default: 2.
    #[schemars(range(min = 1, max = 1000))]
    pub iterations: Option<u32>,
    /// Wall-clock time after which no further iteration of a solve begins; without, results depend on the inputs alone.
    pub time_budget: Option<Quantity>,
    /// Part of the range between the bounds of a state by which plans stay inside; default: 0.025.
    pub margin: Option<f64>,
    /// Parameters that are learned: one number for all variables named, which is known to half of the width to either
    /// side.
    #[serde(default, rename = "parameter")]
    pub parameters: Vec<Perturb>,
}

/// Limits of an input.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputLimits {
    /// Smallest.
    pub min: Quantity,
    /// Largest.
    pub max: Quantity,
}

/// How a plan with several phases is followed.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseSettings {
    /// Outputs that pass through zero at the ends of all phases but the last, in a cycle of all.
    pub guards: Vec<Text>,
    /// Integer output that tells the phase; without it phases begin by time.
    pub mode: Option<Text>,
    /// Its value in every phase; in a cycle also in those of further turns, until all states are back in their places.
    pub modes: Option<Vec<i32>>,
    /// How far the trajectory of a phase goes on beyond its ends.
    pub overlap: Option<Quantity>,
    /// Time by which the regulator looks beyond the end of the plan; not in a cycle, whose gains repeat themselves.
    pub horizon: Option<Quantity>,
    /// Turns of a cycle that the closed loop is run for; default: 20. The controller goes on for ever.
    #[schemars(range(min = 1, max = 10000))]
    pub turns: Option<u32>,
}

/// Trials of the closed loop.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("required" = ["duration", "criterion"]))]
pub struct Trials {
    /// Length of a trial.
    pub duration: Quantity,
    /// Perturbations, each drawn anew in every trial.
    #[serde(default)]
    pub perturb: Vec<Perturb>,
    /// Conditions of a success. Criteria of one name hold together.
    #[serde(default, rename = "criterion")]
    #[schemars(length(min = 1))]
    pub criteria: Vec<Placed<Criterion>>,
}

/// One uniform number for all variables named.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "PerturbKeys")]
pub struct Perturb {
    /// Parameters and start values, `component.variable`.
    pub variables: Vec<Text>,
    /// Size of the perturbation.
    pub spread: Spread,
}

/// Width of a perturbation, to either side.
#[derive(Debug, Clone, PartialEq)]
pub enum Spread {
    /// Part of the value.
    Relative(f64),
    /// In the unit of the variable.
    Absolute(Quantity),
    /// One for each variable, in its unit.
    Each(Vec<Quantity>),
}

/// One uniform number for all variables named: `variables` with `relative` or `absolute`, or `widths`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PerturbKeys {
    /// Parameters and start values, component.variable.
    variables: Option<Vec<Text>>,
    /// Width to either side as a part of the value.
    relative: Option<f64>,
    /// Width to either side in the unit of the variable.
    absolute: Option<Quantity>,
    /// Variables, each with its width to either side.
    widths: Option<Entries<Quantity>>,
}

same_schema! {
    [] Perturb = PerturbKeys;
}

impl TryFrom<PerturbKeys> for Perturb {
    type Error = &'static str;

    fn try_from(keys: PerturbKeys) -> Result<Perturb, &'static str> {
        let (variables, spread) = match (keys.variables, keys.relative, keys.absolute, keys.widths) {
            (Some(variables), Some(part), None, None) => (variables, Spread::Relative(part)),
            (Some(variables), None, Some(width), None) => (variables, Spread::Absolute(width)),
            (None, None, None, Some(widths)) => {
                let (variables, widths) = widths.0.into_iter().unzip();
                (variables, Spread::Each(widths))
            }
            _ => {
                return Err(
                    "a perturbation has `variables` with either `relative` or `absolute`, or `widths` in place \
                            of `variables`",
                );
            }
        };
        Ok(Perturb { variables, spread })
    }
}

/// A signal within limits in a span of time.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [{ "required": ["min"] }, { "required": ["max"] }]))]
pub struct Criterion {
    /// Name.
    pub name: String,
    /// Signal.
    pub signal: Text,
    /// Least value.
    pub min: Option<Quantity>,
    /// Greatest value.
    pub max: Option<Quantity>,
    /// Begin of the span; default: that of the trial.
    pub from: Option<Quantity>,
    /// End of the span; default: that of the trial.
    pub to: Option<Quantity>,
}

/// Reads the file.
///
/// # Errors
/// [`Error::Io`], or [`Error::File`] with line, column, value and remedy.
pub fn read(file: &Path) -> Result<Settings, Error> {
    parse(Source::read(file)?)
}

/// Reads the text of a file.
///
/// # Errors
/// Same as [`read`].
pub fn parse(source: Source) -> Result<Settings, Error> {
    let read: Settings = declared::read(&source)?;
    match read.problem() {
        Some((place, problem)) => Err(source.error_at(place, problem)),
        None => Ok(Settings { source, ..read }),
    }
}

/// JSON schema of the file.
pub fn schema() -> String {
    airloop_series::schema::schema_of::<Settings>()
}

impl Settings {
    /// The first thing that no type rules out.
    fn problem(&self) -> Option<(Place, &'static str)> {
        if self.sensors.is_empty() {
            let problem = "nothing is measured; add a table [sensors] with signals and the standard deviation of their \
                           noise, such as theta = \"0.1 deg\"";
            return Some((Place(0), problem));
        }
        let turns =
            self.phases.iter().find(|own| own.turns.is_some_and(|turns| !(1..=10000).contains(&turns)));
        let turns = turns.map(|own| (own.place, "`turns` of [phases] is a whole number from 1 to 10000"));
        let alone = self.phases.iter().find(|own| own.mode.is_some() != own.modes.is_some());
        let alone = alone.map(|own| {
            (own.place, "`mode` and `modes` belong together: an output and its value in every phase")
        });
        let aimless = self.trials.iter().find(|trials| trials.criteria.is_empty());
        let aimless =
            aimless.map(|own| (own.place, "no trial can succeed or fail; add [[trials.criterion]]"));
        let perturbed: Vec<&Text> =
            self.trials.iter().flat_map(|trials| &trials.perturb).flat_map(|one| &one.variables).collect();
        let twice =
            (1..perturbed.len()).find(|&i| perturbed[..i].iter().any(|own| own.text == perturbed[i].text));
        let twice = twice.map(|i| {
            (
                perturbed[i].place,
                "this variable is perturbed above, too, and only the last perturbation would act",
            )
        });
        let mut criteria = self.trials.iter().flat_map(|trials| &trials.criteria);
        let open = criteria.find(|one| one.min.is_none() && one.max.is_none());
        let nmpc = self.nmpc.iter().find_map(|own| {
            let bad = |problem| Some((own.place, problem));
            match own {
                _ if own.iterations.is_some_and(|count| !(1..=1000).contains(&count)) => {
                    bad("`iterations` of [nmpc] is a whole number from 1 to 1000")
                }
                _ if own.margin.is_some_and(|margin| !(margin > 0.0 && margin < 0.5)) => {
                    bad("`margin` of [nmpc] is a part of the range between two bounds: a number above 0 and below 0.5")
                }
                _ => None,
            }
        });
        nmpc.or(turns)
            .or(alone)
            .or(aimless)
            .or(twice)
            .or(open.map(|one| (one.place, "a criterion has `min`, `max` or both")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Settings, Error> {
        parse(Source { file: "s.toml".into(), text: text.into() })
    }

    #[test]
    fn everything_is_read() {
        let text = "sample_time = \"1 ms\"\n[sensors]\nx = \"0.2 mm\"\n[limits]\nu = { min = -1, max = \"2 N\" }\n\
                    [trials]\nduration = 4\n[[trials.perturb]]\nvariables = [\"a.b\", \"a.c\"]\nrelative = 0.1\n\
                    [[trials.criterion]]\nname = \"held\"\nsignal = \"x\"\nmax = \"150 mm\"\nfrom = \"3 s\"\n";
        let settings = parsed(text).unwrap();
        assert_eq!(settings.sensors[0].1.unit.as_deref(), Some("mm"));
        assert_eq!(settings.limits[0].1.max.value, 2.0);
        let trials = settings.trials.unwrap();
        assert_eq!(
            (trials.perturb[0].variables.len(), &trials.perturb[0].spread),
            (2, &Spread::Relative(0.1))
        );
        assert_eq!((trials.criteria[0].name.as_str(), trials.criteria[0].min.is_none()), ("held", true));
    }

    #[test]
    fn the_schema_asks_for_sensors_and_names_the_keys_of_a_perturbation() {
        let schema: serde_json::Value = serde_json::from_str(&schema()).unwrap();
        assert_eq!(schema["required"][0], "sensors");
        assert!(schema["definitions"]["PerturbKeys"]["properties"]["widths"].is_object());
    }

    #[test]
    fn what_is_missing_or_unknown_is_named_with_its_place() {
        let cases = [
            ("", "line 1, column 1: nothing is measured"),
            ("[sensors]\nx = 1\n[drfit]\n", "line 3"),
            ("[sensors]\nx = true\n", "line 2, column 5"),
            ("[sensors]\nx = 1\n[trials]\nduration = 4\n", "no trial can succeed"),
            (
                "[sensors]\nx = 1\n[trials]\nduration = 4\n[[trials.perturb]]\nvariables = []\n",
                "either `relative`",
            ),
            (
                "[sensors]\nx = 1\n[trials]\nduration = 4\n[[trials.perturb]]\nvariables = [\"a\", \"b\"]\nrelative = 0.1\n\
                 [[trials.perturb]]\nvariables = [\"b\"]\nrelative = 0.1\n[[trials.criterion]]\nname = \"c\"\nsignal = \"x\"\nmax = 1\n",
                "line 9, column 14: this variable is perturbed above",
            ),
            ("[sensors]\nx = 1\n[nmpc]\nmargin = 0.6\n", "line 3, column 1: `margin` of [nmpc]"),
            ("[sensors]\nx = 1\n[nmpc]\niterations = 0\n", "from 1 to 1000"),
            ("[sensors]\nx = 1\n[phases]\nguards = []\nturns = 0\n", "from 1 to 10000"),
            ("[sensors]\nx = 1\n[nmpc]\nhorizn = 1\n", "line 4"),
        ];
        for (text, expected) in cases {
            let message = parsed(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
