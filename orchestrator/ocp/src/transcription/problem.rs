//! A problem of optimal control with one or more phases, as data.
//!
//! ```text
//! minimize   sum over phases of  integral sum w (q - r)^2 dt + sum w (q(end) - r)^2 + w T
//! subject to dx/dt = f(t, x, u), bounds on quantities q along the path and at both ends, on the rates of inputs and on
//!            the durations T, and links between a phase and the next, in periodic motions also from the last to the
//!            first
//! ```
//!
//! A quantity q is a linear combination of states, inputs and outputs. How time is made discrete is left to
//! [`super::Transcription`] and [`super::Mesh`].

use super::dynamics::Dynamics;
use super::link::Link;

/// A variable of the dynamics of a phase, by its index there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Variable {
    /// State x_i.
    State(usize),
    /// Input u_i.
    Input(usize),
    /// Output g_i.
    Output(usize),
}

/// A linear combination of variables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Quantity {
    /// Variables with their factors; a variable may occur several times.
    pub terms: Vec<(Variable, f64)>,
}

impl From<Variable> for Quantity {
    fn from(variable: Variable) -> Quantity {
        Quantity { terms: vec![(variable, 1.0)] }
    }
}

impl From<Vec<(Variable, f64)>> for Quantity {
    fn from(terms: Vec<(Variable, f64)>) -> Quantity {
        Quantity { terms }
    }
}

/// A named quantity within bounds: infinite where there is none, equal where the value is fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Name for messages, e.g. "stroke".
    pub name: String,
    /// Unit of quantity and bounds for messages, e.g. "m"; empty where there is none.
    pub unit: String,
    /// Bounded quantity.
    pub quantity: Quantity,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
}

impl Limit {
    /// A quantity between two bounds, in `unit`; infinite where there is none.
    pub fn between(name: &str, unit: &str, quantity: impl Into<Quantity>, lower: f64, upper: f64) -> Limit {
        Limit { name: name.to_owned(), unit: unit.to_owned(), quantity: quantity.into(), lower, upper }
    }

    /// A quantity that is fixed at `value`, in `unit`.
    pub fn equal(name: &str, unit: &str, quantity: impl Into<Quantity>, value: f64) -> Limit {
        Limit::between(name, unit, quantity, value, value)
    }
}

/// A limit of a phase, by its number in [`Phase::paths`], [`Phase::start`] or [`Phase::end`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LimitPlace {
    /// Along the path.
    Path(usize),
    /// At the start.
    Start(usize),
    /// At the end.
    End(usize),
}

/// Place within the mesh where a path constraint holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// At the knots.
    Nodes,
    /// In the middle of the intervals; nowhere for transcriptions that have no point there.
    Midpoints,
    /// At both.
    Everywhere,
}

/// A constraint along the path.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// Bound on the quantity.
    pub limit: Limit,
    /// Place within the mesh.
    pub place: Place,
    /// First and last fraction of the phase, 0..1, at which it holds.
    pub window: [f64; 2],
}

impl Path {
    /// A constraint that holds at knots and midpoints of the whole phase.
    pub fn everywhere(limit: Limit) -> Path {
        Path { limit, place: Place::Everywhere, window: [0.0, 1.0] }
    }

    /// A constraint that holds at the knots of the whole phase.
    pub fn at_nodes(limit: Limit) -> Path {
        Path { limit, place: Place::Nodes, window: [0.0, 1.0] }
    }
}

/// Bounds on du/dt of an input. Where the input is held over intervals they hold for its changes divided by the length
/// of the interval before the change; elsewhere for the slope of its interpolant.
#[derive(Debug, Clone, PartialEq)]
pub struct RateLimit {
    /// Name for messages.
    pub name: String,
    /// Unit of the rate.
    pub unit: String,
    /// Index of the input.
    pub input: usize,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
}

/// Cost `weight (quantity - reference)^2`, under the integral or at the end of the phase.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// Quantity that costs.
    pub quantity: Quantity,
    /// Value at which it costs nothing.
    pub reference: f64,
    /// Weight.
    pub weight: f64,
}

impl Cost {
    /// Cost `weight quantity^2`; `weight` in units of the objective over the squared unit of the quantity.
    pub fn square(quantity: impl Into<Quantity>, weight: f64) -> Cost {
        Cost { quantity: quantity.into(), reference: 0.0, weight }
    }
}

/// Duration of a phase, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Duration {
    /// Known.
    Fixed(f64),
    /// To be found, between a lower and an upper bound.
    Free {
        /// Lower bound, positive.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}

/// Method by which shooting advances the states within an interval.
#[derive(Debug, Clone, PartialEq)]
pub enum Shooting {
    /// That many steps of the classical Runge-Kutta method per interval.
    Steps(usize),
    /// A sampled block: its states are advanced exactly from sample to sample, and held, with the inputs, over each
    /// sample for all else, which takes one Runge-Kutta step per sample.
    Sampled {
        /// Indices of the states of the block; they form a linear system driven by inputs.
        states: Vec<usize>,
        /// Sample time, s.
        sample_time: f64,
    },
}

/// One phase: dynamics that do not change, on a stretch of time.
pub struct Phase {
    /// Name for messages and files.
    pub name: String,
    /// Instances of the dynamics, one per thread.
    pub dynamics: Vec<Box<dyn Dynamics>>,
    /// Duration.
    pub duration: Duration,
    /// Settings of shooting.
    pub shooting: Shooting,
    /// Multiple shooting takes the second derivatives of a Runge-Kutta step from its middle alone instead of all four
    /// stages. They are then right to the second order of the step, at a quarter of the evaluations; values and first
    /// derivatives stay exact, and so does the solution.
    pub simplified_curvature: bool,
    /// Constraints along the path.
    pub paths: Vec<Path>,
    /// Conditions at the start.
    pub start: Vec<Limit>,
    /// Conditions at the end.
    pub end: Vec<Limit>,
    /// Limits of the rates of inputs.
    pub rates: Vec<RateLimit>,
    /// Costs under the integral.
    pub integral: Vec<Cost>,
    /// Costs at the end.
    pub final_cost: Vec<Cost>,
    /// Cost of the duration, per second.
    pub duration_weight: f64,
}

impl Phase {
    /// A phase without constraints and costs.
    pub fn new(name: &str, dynamics: Vec<Box<dyn Dynamics>>, duration: Duration) -> Phase {
        Phase {
            name: name.to_owned(),
            dynamics,
            duration,
            shooting: Shooting::Steps(4),
            simplified_curvature: false,
            paths: Vec::new(),
            start: Vec::new(),
            end: Vec::new(),
            rates: Vec::new(),
            integral: Vec::new(),
            final_cost: Vec::new(),
            duration_weight: 0.0,
        }
    }
}

/// Phases in a row, and what happens between each and the next.
#[derive(Default)]
pub struct Problem {
    /// Phases.
    pub phases: Vec<Phase>,
    /// Links, one fewer than phases.
    pub links: Vec<Link>,
    /// Link of the last phase to the first, of a motion that repeats itself; none: it ends.
    pub cycle: Option<Link>,
}

impl Problem {
    /// A problem of one phase.
    pub fn single(phase: Phase) -> Problem {
        Problem { phases: vec![phase], ..Problem::default() }
    }
}
