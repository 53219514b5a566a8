//! A problem file as it is declared, with places, before names and units are looked up in a system.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;

use super::balance::Balance;
use super::cycle::Cycle;
use super::feed_forward::FeedForward;
use super::guess::Guess;
use super::phase::{Bound, Condition, Cost, Duration, Phase, Rate, bounds_schema, sums_schema};
use super::quantity::Quantity;
use super::source::{Place, Source};
use super::stick_figure::StickFigure;
use super::value::{Choice, Entries, Parameters, Placed, Text, choice, choices, count, intervals, tolerance};
use crate::Error;
use airloop_cosim::master::Algorithm;
use airloop_ocp::transcription::Transcription;
use airloop_optim::Method;

/// A motion to be found for a system of FMUs.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "airloop optimize: problem file")]
#[schemars(extend("anyOf" = [{ "required": ["duration"] }, { "required": ["phase"] }]))]
pub struct Statement {
    /// Text and path.
    #[serde(skip)]
    pub source: Source,
    /// Title; default: the name of the file.
    #[serde(default)]
    pub name: String,
    /// System: .ssd, .ssp or a single .fmu, relative to the folder of this file.
    pub system: Text,
    /// The system, resolved against the folder of the problem file.
    #[serde(skip)]
    pub system_file: PathBuf,
    /// Start values of parameters: component.variable, or variable for a single FMU.
    #[serde(default)]
    pub parameters: Parameters,
    /// Inputs to be found; default: those with a bound, a rate or a cost. Others keep their start values.
    pub inputs: Option<Vec<Text>>,
    /// Order of the states; default: all that move, component by component.
    pub states: Option<Vec<Text>>,
    /// Settings of the search.
    #[serde(default)]
    pub settings: Settings,
    /// Phases in their order, in place of the keys of one.
    #[serde(default, rename = "phase")]
    #[schemars(length(min = 1))]
    pub phases: Vec<Placed<Phase>>,
    /// A motion that repeats itself.
    pub cycle: Option<Placed<Cycle>>,
    // The keys of the only phase; they move to `phases` when the file is read.
    /// "2 s", or a range in which it is to be found.
    duration: Option<Duration>,
    /// Conditions at the start; states that are not named begin at the start values of the system.
    #[serde(default)]
    initial: Entries<Condition>,
    /// Conditions at the end; states that are not named are free.
    #[serde(default, rename = "final")]
    terminal: Entries<Condition>,
    /// Bounds along the way, by variable.
    #[serde(default)]
    #[schemars(schema_with = "bounds_schema")]
    bounds: Entries<Placed<Bound>>,
    /// Bounds on sums of factor times variable.
    #[serde(default)]
    #[schemars(schema_with = "sums_schema")]
    constraint: Vec<Placed<Bound>>,
    /// Limits of the rates of inputs.
    #[serde(default)]
    rates: Entries<Rate>,
    /// Terms of the cost.
    #[serde(default)]
    cost: Vec<Placed<Cost>>,
    /// Named guesses.
    #[serde(default, rename = "guess")]
    pub guesses: Entries<Guess>,
    /// Roll-out of the plan through the system.
    #[serde(default)]
    pub verification: Verification,
    /// Cart with a pole that the page draws.
    pub animation: Option<Animation>,
    /// Rods that the page draws.
    pub stick_figure: Option<StickFigure>,
    /// Files of variants of the problem, for --variant.
    #[serde(default)]
    pub variants: Entries<Text>,
    /// Actuators that are to deliver planned forces.
    pub feed_forward: Option<FeedForward>,
}

/// Keys of the file that belong to its only phase.
const OF_ONE_PHASE: [&str; 7] = ["duration", "initial", "final", "bounds", "constraint", "rates", "cost"];

/// Reads the text of a problem file.
///
/// # Errors
/// [`Error::File`] with line, column, value and remedy.
pub fn parse(source: Source) -> Result<Statement, Error> {
    let mut read: Statement = super::declared::read(&source)?;
    let folder = source.file.parent().unwrap_or("".as_ref());
    read.system_file = folder.join(&read.system.text);
    if read.name.is_empty() {
        read.name = source.file.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
    }
    for pass in &mut read.settings.before {
        pass.transcription.get_or_insert(read.settings.transcription);
    }
    read.gather_phases(&source)?;
    let complete = read.phases.iter_mut().try_for_each(|phase| phase.complete());
    complete.and_then(|()| read.check()).map_err(|(place, problem)| source.error_at(place, problem))?;
    Ok(Statement { source, ..read })
}

impl Statement {
    /// Makes the keys of the only phase a phase, and names phases that have no name.
    fn gather_phases(&mut self, source: &Source) -> Result<(), Error> {
        if let Some((key, place)) = (!self.phases.is_empty()).then(|| source.key(&OF_ONE_PHASE)).flatten() {
            let problem = format!("`{key}` belongs to a phase where there is [[phase]]; move it there");
            return Err(source.error_at(place, problem));
        }
        for (number, phase) in self.phases.iter_mut().enumerate().filter(|(_, phase)| phase.name.is_empty()) {
            phase.name = format!("phase {}", number + 1);
        }
        if self.phases.is_empty() {
            let missing = || source.error_at(Place(0), "the file has no `duration`; add it");
            let value = Phase {
                name: "motion".into(),
                intervals: None,
                parameters: Parameters::default(),
                duration: self.duration.take().ok_or_else(missing)?,
                reset: None,
                initial: std::mem::take(&mut self.initial),
                terminal: std::mem::take(&mut self.terminal),
                bounds: std::mem::take(&mut self.bounds),
                constraint: std::mem::take(&mut self.constraint),
                rates: std::mem::take(&mut self.rates),
                costs: std::mem::take(&mut self.cost),
            };
            self.phases.push(Placed { place: Place(0), value });
        }
        Ok(())
    }

    /// Finds the first thing that no type rules out, outside the phases.
    fn check(&self) -> Result<(), (Place, String)> {
        for (name, guess) in &self.guesses {
            if name.text == "linear" {
                return Err((name.place, "the guess `linear` is built in; choose another name".into()));
            }
            guess.trajectories.iter().try_for_each(|(_, line)| line.check())?;
        }
        let mut rods = self.stick_figure.iter().flat_map(|figure| &figure.rods);
        match rods.find(|rod| rod.angle.names().is_empty()) {
            Some(rod) => Err((rod.angle.place, "a rod has an angle, or several whose mean it has".into())),
            None => Ok(()),
        }
    }
}

/// Names of the transcriptions in problem files and on the command line.
pub const TRANSCRIPTIONS: [(&str, Transcription); 5] = [
    ("trapezoidal", Transcription::Trapezoidal),
    ("hermite-simpson", Transcription::HermiteSimpson),
    ("hermite-simpson-separated", Transcription::HermiteSimpsonSeparated),
    ("multiple-shooting", Transcription::MultipleShooting),
    ("shooting-collocation", Transcription::ShootingCollocation),
];

/// Name of a transcription in problem files.
pub fn transcription_name(transcription: Transcription) -> &'static str {
    TRANSCRIPTIONS.iter().find(|(_, one)| *one == transcription).map_or("", |(name, _)| name)
}

impl Choice for Transcription {
    const CHOICES: &'static [(&'static str, Transcription)] = &TRANSCRIPTIONS;
}

impl Choice for Method {
    const CHOICES: &'static [(&'static str, Method)] =
        &[("interior-point", Method::InteriorPoint), ("sqp", Method::Sqp)];
}

impl Choice for Algorithm {
    const CHOICES: &'static [(&'static str, Algorithm)] = &[
        ("monolithic", Algorithm::Monolithic),
        ("gauss-seidel", Algorithm::GaussSeidel),
        ("jacobi", Algorithm::Jacobi),
        ("interface-jacobian", Algorithm::InterfaceJacobian),
    ];
}

/// Settings of the search.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Transcription of the last solve; default: hermite-simpson.
    #[serde(deserialize_with = "choice")]
    #[schemars(schema_with = "choices::<Transcription>")]
    pub transcription: Transcription,
    /// Intervals of the last solve; default: 100.
    #[serde(deserialize_with = "intervals")]
    #[schemars(range(min = 1))]
    pub intervals: usize,
    /// Solves that lead there, each started from the one before, such as a coarse mesh.
    #[serde(rename = "start_with")]
    pub before: Vec<Placed<Pass>>,
    /// `linear`, the name of a guess of this file, or a .csv file; default: the first guess of this file, else
    /// `linear`.
    pub guess: Option<Text>,
    /// Method of the first solve; default: interior-point.
    #[serde(deserialize_with = "choice")]
    #[schemars(schema_with = "choices::<Method>")]
    pub method: Method,
    /// Scaled KKT error at which a problem counts as solved; default: 1e-8.
    #[serde(deserialize_with = "tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// Whether variables are divided by the nominal values of the FMUs; the solver scales objective and constraints by
    /// itself.
    pub scaling: Scaling,
    /// Most iterations of one solve; default: 500.
    #[serde(deserialize_with = "count")]
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// Components that are sampled; default: those with a parameter `sample_time`.
    pub sampled: Option<Vec<Text>>,
    /// Sample time; default: that of the sampled components.
    pub sample_time: Option<Quantity>,
    /// Split intervals until the estimated error of every state is below the tolerance.
    pub mesh: Option<MeshRefinement>,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            transcription: Transcription::HermiteSimpson,
            intervals: 100,
            before: Vec::new(),
            guess: None,
            method: Method::InteriorPoint,
            tolerance: 1e-8,
            scaling: Scaling::None,
            max_iterations: 500,
            sampled: None,
            sample_time: None,
            mesh: None,
        }
    }
}

/// Magnitudes by which variables are divided for the solver.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
#[allow(missing_docs, reason = "named by themselves")]
pub enum Scaling {
    #[default]
    None,
    Nominal,
}

/// One solve on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pass {
    /// Transcription; default: that of the last solve.
    #[serde(default, deserialize_with = "choice::<_, Transcription, _>")]
    #[schemars(schema_with = "choices::<Transcription>")]
    pub transcription: Option<Transcription>,
    /// Intervals.
    #[serde(deserialize_with = "intervals")]
    #[schemars(range(min = 1))]
    pub intervals: usize,
}

/// When intervals are split.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshRefinement {
    /// Largest relative error of a state over an interval.
    #[serde(deserialize_with = "tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// Rounds at most.
    #[serde(default = "rounds", deserialize_with = "count")]
    #[schemars(range(min = 1))]
    pub rounds: usize,
}

fn rounds() -> usize {
    5
}

/// Roll-out of the plan through the system.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Verification {
    /// Whether the plan is rolled out.
    pub run: bool,
    /// Master of the sampled roll-out; default: monolithic.
    #[serde(deserialize_with = "choice")]
    #[schemars(schema_with = "choices::<Algorithm>")]
    pub master: Algorithm,
    /// Communication step; default: the sample time, or 1 ms.
    pub step: Option<Quantity>,
    /// Relative tolerance of the integrators.
    #[serde(deserialize_with = "tolerance::<_, Option<f64>>")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: Option<f64>,
    /// Forces that are recomputed from the energy.
    pub balance: Option<Balance>,
}

impl Default for Verification {
    fn default() -> Verification {
        Verification { run: true, master: Algorithm::Monolithic, step: None, tolerance: None, balance: None }
    }
}

/// A cart with a pole, drawn on the page of the results.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Animation {
    /// Position of the cart in m.
    pub cart: Text,
    /// Angle of the pole in rad, 0 hanging, counter-clockwise.
    pub angle: Text,
    /// Length of the pole in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub length: f64,
}
