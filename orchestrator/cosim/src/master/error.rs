//! Reason why a simulation cannot start or go on.

/// Reason why a simulation cannot start or go on.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "component, variable, time and step, as in each message")]
pub enum Error {
    /// Nothing to simulate.
    #[error("{}: the system has no components, so that there is nothing to simulate; add one (element `Component`)", .0.display())]
    Empty(std::path::PathBuf),
    /// A setting is out of range.
    #[error("{name} = {value} is not possible: it must be {allowed}")]
    Setting { name: &'static str, value: f64, allowed: &'static str },
    /// The last step is shorter and a slave cannot do that.
    #[error(
        "component `{component}` cannot handle steps of different length, but {stop} s is not a multiple of the step {step} s; choose another stop time or step"
    )]
    FixedStepOnly { component: String, stop: f64, step: f64 },
    /// A call into an FMU failed; its message names component, time and what to try.
    #[error(transparent)]
    Fmu(#[from] airloop_fmi::Error),
    /// A slave stopped inside a step.
    #[error(
        "component `{component}`: {function} returned {status} at t = {time} s with step {step} s{reached}; try a smaller `--step`{log}"
    )]
    Discarded {
        component: String,
        function: &'static str,
        status: &'static str,
        time: f64,
        step: f64,
        reached: String,
        log: String,
    },
    /// NaN or infinity at an output.
    #[error(
        "component `{component}`: output `{variable}` is {value} at t = {time} s; look at its inputs just before, try a smaller `--step`, and check parameters and start values"
    )]
    NotFinite { component: String, variable: String, value: f64, time: f64 },
    /// Initial values do not settle.
    #[error(
        "the outputs still change after {passes} rounds of initialization (`{variable}` is one); an FMU probably depends on an input that its `dependencies` do not list"
    )]
    Unsettled { passes: usize, variable: String },
    /// An option of another master.
    #[error("--{option} is an option of `--master {master}`; give that master or leave the option out")]
    OptionOfOther { option: &'static str, master: &'static str },
    /// The interface-Jacobian master cannot work with an FMU.
    #[error(
        "component `{component}` {reason} which the interface-Jacobian master cannot handle; use `--master gauss-seidel`"
    )]
    Unsuitable { component: String, reason: String },
    /// A coupled component cannot be solved.
    #[error(
        "the coupling of {components} {reason} at t = {time} s with step {step} s; try a smaller `--step`, or `--master gauss-seidel`"
    )]
    Coupling { components: String, reason: String, time: f64, step: f64 },
    /// Adaptive steps need more of an FMU.
    #[error("component `{component}` {reason}: leave --adaptive out and choose a --step for all steps")]
    NotAdaptive { component: String, reason: &'static str },
    /// States that are to be saved need more of an FMU.
    #[error(
        "component `{component}` cannot save its state ({missing} is not true in its modelDescription.xml), so that no run with it can be continued; leave --save-states and --restart-from out"
    )]
    NoSavedStates { component: String, missing: &'static str },
    /// States are saved at the points of a fixed grid only.
    #[error(
        "states are saved by the masters gauss-seidel, jacobi and interface-jacobian with a fixed --step; leave --save-states and --restart-from out, or choose one of them without --adaptive"
    )]
    NoPoints,
    /// Saved states do not fit.
    #[error("the run cannot be continued: {0}")]
    Restart(String),
    /// The saved states cannot be written.
    #[error("the states cannot be saved in {}: {source}; make room, or leave --save-states out", file.display())]
    SavedStates { file: std::path::PathBuf, source: std::io::Error },
    /// The shortest step is still too long.
    #[error(
        "component `{component}`: the error of `{variable}` at t = {time} s is {error:.1e} of its size even with the shortest communication step, {step} s; look for a jump or a growing oscillation there, and try a larger `--step-tolerance`, a smaller `--min-step` or another `--master`"
    )]
    StepTooShort { component: String, variable: String, time: f64, step: f64, error: f64 },
    /// [`super::Master`] cannot be monolithic.
    #[error("the monolithic master does not step slaves; run it with master::simulate::run")]
    NoSteps,
    /// An algebraic loop has no solution that was found.
    #[error(
        "algebraic loop at t = {time} s: after {iterations} iterations {problem}; residuals: {residuals}; check parameters and start values of these inputs' components, or break the loop with a delay or a filter"
    )]
    AlgebraicLoop { time: f64, iterations: usize, problem: &'static str, residuals: String },
    /// A slave does not let an algebraic loop be solved.
    #[error("component `{component}` {reason} the algebraic loop {path}; {remedy}")]
    LoopMember { component: String, reason: String, path: String, remedy: String },
    /// The integrator cannot keep the tolerance.
    #[error(
        "component `{component}`: the error of `{variable}` stays too large at t = {time} s, even with a step of {step} s; it may grow without bound or jump without an event indicator; look at its inputs just before, or try a larger `--tolerance`"
    )]
    StepUnderflow { component: String, variable: String, time: f64, step: f64 },
    /// The explicit integrator is not made for this.
    #[error(
        "component `{component}`: at t = {time} s the integrator needed {steps} steps within one interval, because of `{variable}`; the system is too stiff for the monolithic master: try `--master gauss-seidel` with a small `--step`"
    )]
    Stiff { component: String, variable: String, time: f64, steps: u64 },
    /// Events without end.
    #[error(
        "{events} events within one communication step up to t = {time} s, the last by {cause}: this looks like chattering; give the model a hysteresis, or choose a smaller `--step` if the events are real"
    )]
    Chattering { cause: String, time: f64, events: u64 },
    /// An event iteration without end.
    #[error("the event iteration at t = {time} s does not end in {rounds} rounds: {cause}")]
    EventIteration { time: f64, rounds: u32, cause: String },
    /// Curves for inputs that do not fit.
    #[error(
        "{knots} knots of the inputs for {pieces} pieces; knots rise, and there is one more of them than pieces"
    )]
    Curves { knots: usize, pieces: usize },
    /// The file of the rows cannot be written.
    #[error("the rows of the result cannot be written: {0}; make room, or choose another folder")]
    Rows(#[source] std::io::Error),
    /// Two columns of the result have one name.
    #[error("the result cannot be written: {0}")]
    Result(#[from] airloop_series::Error),
}
