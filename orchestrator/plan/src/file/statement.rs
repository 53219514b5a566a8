//! Content of a problem file, with places, before names and units are looked up in a system.

use std::path::PathBuf;

use super::balance::Balance;
use super::feed_forward::FeedForward;
use super::quantity::Quantity;
use super::source::{Place, Source};
use super::stick_figure::StickFigure;
use super::table::Text;
use airloop_ocp::transcription::Transcription;
use airloop_optim::Method;

/// A problem file.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// Text and path.
    pub source: Source,
    /// Title; default the name of the file.
    pub name: String,
    /// Place of `name` or of the default.
    pub system: Text,
    /// The system, resolved against the folder of the problem file.
    pub system_file: PathBuf,
    /// Start values of parameters, `component.variable` and value as text.
    pub parameters: Vec<(Text, String)>,
    /// Inputs to be found; none: those with bounds or cost.
    pub inputs: Option<Vec<Text>>,
    /// States of the problem in their order; none: all that move.
    pub states: Option<Vec<Text>>,
    /// Settings.
    pub settings: Settings,
    /// Phases in their order; a file without `[[phase]]` has one.
    pub phases: Vec<Phase>,
    /// Named guesses.
    pub guesses: Vec<Guess>,
    /// Roll-out.
    pub verification: Verification,
    /// Drawing of the page.
    pub animation: Option<Animation>,
    /// Rods that the page draws.
    pub stick_figure: Option<StickFigure>,
    /// Names of variants of the problem, and their files.
    pub variants: Vec<(Text, Text)>,
    /// Actuators that are to deliver what is planned.
    pub feed_forward: Option<FeedForward>,
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

/// `[settings]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Transcription of the last solve.
    pub transcription: Transcription,
    /// Intervals of the last solve.
    pub intervals: usize,
    /// Solves that lead there, each started from the one before.
    pub before: Vec<Pass>,
    /// Guess to start from: `linear`, or the name of a guess.
    pub guess: Option<Text>,
    /// Method of the first solve.
    pub method: Method,
    /// Stop test of the solver.
    pub tolerance: f64,
    /// Whether variables are divided by their nominal values for the solver.
    pub scaled: bool,
    /// Most iterations of one solve.
    pub max_iterations: usize,
    /// Components whose linear states are sampled; none: those with a parameter `sample_time`.
    pub sampled: Option<Vec<Text>>,
    /// Sample time; none: that of the sampled component.
    pub sample_time: Option<Quantity>,
    /// Error of a state between knots above which intervals are split, and how often.
    pub mesh: Option<MeshRefinement>,
}

/// One solve on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pass {
    /// Transcription.
    pub transcription: Transcription,
    /// Intervals.
    pub intervals: usize,
    /// Place in the file.
    pub place: Place,
}

/// Criteria for splitting intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshRefinement {
    /// Largest relative error of a state over an interval.
    pub tolerance: f64,
    /// Rounds at most.
    pub rounds: usize,
}

/// Duration of a phase.
#[derive(Debug, Clone, PartialEq)]
pub enum Duration {
    /// Given.
    Fixed(Quantity),
    /// To be found.
    Free {
        /// Shortest.
        min: Quantity,
        /// Longest.
        max: Quantity,
        /// Start of the search.
        guess: Quantity,
    },
}

/// One phase of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Phase {
    /// Name.
    pub name: String,
    /// Place in the file.
    pub place: Place,
    /// Duration.
    pub duration: Duration,
    /// Intervals; none: those of the settings.
    pub intervals: Option<usize>,
    /// Start values of parameters in this phase, such as a pinned mode.
    pub parameters: Vec<(Text, String)>,
    /// Map from the end of the phase before to the states at the start; none: they are continuous.
    pub reset: Option<Reset>,
    /// Conditions at the start; states that are not named keep the start values of the system.
    pub initial: Vec<Condition>,
    /// Conditions at the end; states that are not named are free.
    pub terminal: Vec<Condition>,
    /// Bounds along the way.
    pub bounds: Vec<Bound>,
    /// Limits of the rates of inputs.
    pub rates: Vec<Rate>,
    /// Cost.
    pub costs: Vec<Cost>,
}

/// A jump of states from the end of a phase to the start of the next, read from outputs of the system.
#[derive(Debug, Clone, PartialEq)]
pub struct Reset {
    /// Start values of parameters of the system that shows the outputs.
    pub parameters: Vec<(Text, String)>,
    /// State after, and the variable that shows it before; other states are continuous.
    pub states: Vec<(Text, Text)>,
    /// Bounds of outputs, such as impulses.
    pub bounds: Vec<Bound>,
    /// Place in the file.
    pub place: Place,
}

/// Condition on a variable at one end of a phase.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// Variable.
    pub variable: Text,
    /// Its value or range; both none: free.
    pub range: Range,
}

/// A range of values; equal ends fix the value.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Range {
    /// Smallest.
    pub min: Option<Quantity>,
    /// Largest.
    pub max: Option<Quantity>,
}

/// Part of a phase where a bound holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Where {
    /// At the nodes: states and outputs by default.
    Nodes,
    /// In the middle of the intervals.
    Midpoints,
    /// At both: inputs by default.
    Everywhere,
}

/// `lower <= sum of factor * variable <= upper` along the way.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// Name for messages; default the variable.
    pub name: Option<String>,
    /// Variables with their factors; one with factor 1 is the usual case.
    pub terms: Vec<(Text, f64)>,
    /// Range; units those of the first variable unless said.
    pub range: Range,
    /// Part of the phase where it holds; none: by the kind of the variable.
    pub at: Option<Where>,
    /// Part of the phase in which it holds, 0 to 1.
    pub during: (f64, f64),
    /// Amount by which it is stricter at the points of the mesh, so that it holds between them, in the unit of the
    /// plan.
    pub margin: f64,
    /// Place in the file.
    pub place: Place,
}

/// Limits of the rate of an input.
#[derive(Debug, Clone, PartialEq)]
pub struct Rate {
    /// Input.
    pub variable: Text,
    /// Range in the unit of the input per second.
    pub range: Range,
}

/// Quantity whose cost is taken.
#[derive(Debug, Clone, PartialEq)]
pub enum Of {
    /// Integral of `(variable - reference)^2` over the phase.
    Integral(Text, Option<Quantity>),
    /// `(variable - reference)^2` at the end.
    Final(Text, Option<Quantity>),
    /// The duration of the phase.
    Duration,
}

/// A term of the cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// Quantity whose cost is taken.
    pub of: Of,
    /// Weight.
    pub weight: f64,
    /// Place in the file.
    pub place: Place,
}

/// A guess given in the file: each named variable piecewise linear, others zero or at their conditions.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// Name.
    pub name: Text,
    /// Trajectories of variables.
    pub trajectories: Vec<GuessLine>,
    /// Start values of states along the whole way where no trajectory says otherwise: zero, or a line between the ends.
    pub others: Others,
}

/// Variables that a guess does not name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Others {
    /// Zero.
    Zero,
    /// On a line from the initial to the final condition.
    Linear,
}

/// A piecewise linear trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct GuessLine {
    /// Variable.
    pub variable: Text,
    /// Part of the whole duration, 0 to 1, increasing, `[n]`.
    pub t: Vec<f64>,
    /// Values, `[n]`.
    pub value: Vec<f64>,
    /// Unit of the values; none: that of the variable.
    pub unit: Option<String>,
}

/// `[verification]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// Whether the plan is rolled out.
    pub run: bool,
    /// Master of the sampled roll-out, as on the command line.
    pub master: airloop_cosim::master::Algorithm,
    /// Communication step; none: the sample time.
    pub step: Option<Quantity>,
    /// Relative tolerance of the integrators.
    pub tolerance: Option<f64>,
    /// Forces that are recomputed from the energy.
    pub balance: Option<Balance>,
}

/// `[animation]`: what the page draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Animation {
    /// Position of the cart.
    pub cart: Text,
    /// Angle of the pole, 0 hanging, counter-clockwise.
    pub angle: Text,
    /// Length of the pole \[m\].
    pub length: f64,
}
