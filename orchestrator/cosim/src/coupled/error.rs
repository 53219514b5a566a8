//! Reason why a system cannot be opened as one dynamics.

/// A system that has no right-hand side through its FMUs, or names that mean nothing in it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An FMU fails before the first evaluation.
    #[error(transparent)]
    Fmu(#[from] airloop_fmi::Error),
    /// Values that depend on each other at the same instant.
    #[error(
        "the algebraic loop {} has no place in an optimization yet; break it by a state (a lag, a mass) in one of its components",
        path.join(" -> ")
    )]
    AlgebraicLoop {
        /// Its variables, the first once more at the end.
        path: Vec<String>,
    },
    /// An FMU for Co-Simulation only.
    #[error(
        "component `{component}`: {fmu} has no Model Exchange interface, which an optimization needs; export it for Model Exchange as well"
    )]
    NoModelExchange {
        /// Component.
        component: String,
        /// Its FMU.
        fmu: String,
    },
    /// A derivative that names no state.
    #[error(
        "component `{component}`: `{variable}` is listed among the derivatives but does not say of which state; its attribute `derivative` is missing in modelDescription.xml"
    )]
    Derivative {
        /// Component.
        component: String,
        /// The derivative.
        variable: String,
    },
    /// A component that changes at samples.
    #[error(
        "component `{component}` changes at time events, the next at t = {time} s: between them its rates are not those of the system; use a form with continuous states (for the actuators of this project `realization` = continuous), or another FMU"
    )]
    Sampled {
        /// Component.
        component: String,
        /// Time of its next event \[s\].
        time: f64,
    },
    /// A component ends the simulation before it begins.
    #[error("component `{component}` ends the simulation at t = {time} s, where the problem begins")]
    Terminated {
        /// Component.
        component: String,
        /// Time \[s\].
        time: f64,
    },
    /// Initialization or event iteration without end.
    #[error(
        "{what} at t = {time} s does not settle in {rounds} rounds: {cause}; set start values that fit each other"
    )]
    Unsettled {
        /// Operation during which it happened.
        what: &'static str,
        /// Time \[s\].
        time: f64,
        /// Rounds.
        rounds: usize,
        /// Quantity that still changes.
        cause: String,
    },
    /// A name that the system does not have.
    #[error("{role} `{name}`: the system has no such {role}; there are {known}")]
    Unknown {
        /// "state", "input" or "output".
        role: &'static str,
        /// Name.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A name given twice.
    #[error("{role} `{name}` is given twice; leave one out")]
    Twice {
        /// "state", "input" or "output".
        role: &'static str,
        /// Name.
        name: String,
    },
    /// A state that moves was left out.
    #[error(
        "state `{name}` is not in the list of states, but it moves and others depend on it; add it to the list"
    )]
    StateMissing {
        /// Name.
        name: String,
    },
    /// A variable that cannot be an output of the dynamics.
    #[error("output `{name}` {reason}")]
    Output {
        /// Name.
        name: String,
        /// Reason and remedy.
        reason: &'static str,
    },
    /// An input that cannot be moved continuously.
    #[error(
        "input `{name}` feeds `{variable}`, which is not a continuous Real; leave it out of the inputs, it then keeps its start value"
    )]
    Input {
        /// System input.
        name: String,
        /// Variable it feeds.
        variable: String,
    },
}
