//! Errors in a problem, found before it is solved.

use super::problem::LimitPlace;
use airloop_optim::EvaluationError;

/// Reason why a problem cannot be transcribed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// No phase at all.
    #[error("the problem has no phase; give at least one")]
    NoPhases,
    /// A phase without an instance of its dynamics.
    #[error("phase `{phase}` has no instance of its dynamics; give one for every thread")]
    NoDynamics {
        /// Phase.
        phase: String,
    },
    /// Instances of different sizes.
    #[error("phase `{phase}`: the instances of the dynamics differ in their numbers of variables")]
    Instances {
        /// Phase.
        phase: String,
    },
    /// A number of meshes or links that does not fit the phases.
    #[error("{found} {what} for {phases} phases; {expected} are needed")]
    Count {
        /// Items of which there are too many or too few.
        what: &'static str,
        /// Given number.
        found: usize,
        /// Right number.
        expected: usize,
        /// Number of phases.
        phases: usize,
    },
    /// A variable that does not exist.
    #[error("phase `{phase}`, `{item}`: there is no {kind} {index}; the dynamics have {count}")]
    Variable {
        /// Phase.
        phase: String,
        /// Name of the constraint or cost.
        item: String,
        /// State, input or output.
        kind: &'static str,
        /// Index, from 0.
        index: usize,
        /// Number of items.
        count: usize,
    },
    /// A limit that does not exist.
    #[error("there is no limit {place:?} in phase {phase}; the numbers are those of the problem, from 0")]
    NoLimit {
        /// Number of the phase.
        phase: usize,
        /// Place of the limit.
        place: LimitPlace,
    },
    /// A request that the problem does not allow.
    #[error("{request}: {reason}")]
    Request {
        /// Request that was made.
        request: &'static str,
        /// Reason and remedy.
        reason: String,
    },
    /// Bounds that no value satisfies, or that are NaN.
    #[error("phase `{phase}`, `{item}`: no value lies between {lower} and {upper}; correct the bounds")]
    Bounds {
        /// Phase.
        phase: String,
        /// Name of the constraint, or of two that contradict each other.
        item: String,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A number that makes no sense where it stands.
    #[error("phase `{phase}`, `{item}`: {value} is not {allowed}")]
    Value {
        /// Phase.
        phase: String,
        /// Item that has the value.
        item: String,
        /// The value.
        value: f64,
        /// Allowed values.
        allowed: &'static str,
    },
    /// Fractions of a mesh that do not increase from 0 to 1.
    #[error("knot {knot} of the mesh is at {value}; fractions increase strictly from 0 to 1")]
    Mesh {
        /// Knot, from 0.
        knot: usize,
        /// Its fraction.
        value: f64,
    },
    /// An interval that is not a whole number of samples long.
    #[error(
        "phase `{phase}`: interval {interval} of the mesh is {length} s long, which is not a whole number of samples of \
         {sample_time} s; choose a number of intervals that divides the samples of the phase, or another duration"
    )]
    Samples {
        /// Phase.
        phase: String,
        /// Interval, from 0.
        interval: usize,
        /// Its length, s.
        length: f64,
        /// Sample time, s.
        sample_time: f64,
    },
    /// A free duration where the transcription needs to know it.
    #[error(
        "phase `{phase}`: {transcription} needs a fixed duration, because {reason}; fix it, or use \
         Hermite-Simpson"
    )]
    FreeDuration {
        /// Phase.
        phase: String,
        /// Transcription.
        transcription: &'static str,
        /// Reason.
        reason: &'static str,
    },
    /// A state declared as sampled whose equation is not linear with constant coefficients.
    #[error(
        "phase `{phase}`: `{state}` is declared as sampled, but its rate is not a linear function, with constant \
         coefficients, of sampled states and inputs; only such blocks are advanced exactly"
    )]
    NotLinear {
        /// Phase.
        phase: String,
        /// Name of the state.
        state: String,
    },
    /// A link that does not fit the phases on its sides.
    #[error("link from phase `{before}` to `{after}`: {reason}")]
    Link {
        /// Phase before.
        before: String,
        /// Phase after.
        after: String,
        /// Mismatch.
        reason: String,
    },
    /// A trajectory that does not fit the problem.
    #[error("the trajectory does not fit the problem: {0}")]
    Trajectory(String),
    /// The dynamics have no value where they are needed.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The solver refuses the problem.
    #[error(transparent)]
    Solver(#[from] airloop_optim::Error),
}
