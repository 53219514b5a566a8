//! Interface that a model author implements: the trait [`Model`].

use crate::scalar::Scalar;
use crate::table::Table;
use crate::values::{Interface, Values};
use std::path::Path;

/// Identity of the model; becomes attributes of `fmiModelDescription`.
#[derive(Clone, Debug)]
pub struct Identity {
    /// C identifier, name of the shared library (`modelIdentifier`).
    pub model_identifier: &'static str,
    /// Name shown to users (`modelName`); also the file name of the FMU.
    pub model_name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// Version of the model.
    pub version: &'static str,
    /// Author or organization.
    pub author: &'static str,
    /// Tool that made the FMU.
    pub generation_tool: &'static str,
    /// `DefaultExperiment`: stop time \[s\].
    pub stop_time: f64,
    /// `DefaultExperiment`: communication step size \[s\].
    pub step_size: f64,
}

/// Reason why the equations give no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// A smaller step or other values may work: `fmi2Discard`.
    Discard(String),
    /// The instance can't go on: `fmi2Error`.
    Error(String),
}

/// Result of every hook of a model.
pub type Outcome = Result<(), Refusal>;

/// Effect of an event; see [`Model::event`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Event {
    /// Continuous states were set to new values.
    pub states_changed: bool,
    /// The event changed something that may trigger another event at the same time.
    pub iterate: bool,
    /// The model asks the importer to end the simulation.
    pub terminate: bool,
}

/// One model: its variables, its equations and, where it has them, its samples and events.
///
/// `Self` holds the handles of the variables (given out by [`Table`]) and nothing that changes during a
/// simulation: every number that changes lives in [`Values`], which is the FMU state.
///
/// ```
/// use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};
///
/// /// dx/dt = -k x
/// struct Decay { k: Real, x: Real, der_x: Real }
///
/// impl Model for Decay {
///     const IDENTITY: Identity = Identity {
///         model_identifier: "decay", model_name: "decay", description: "dx/dt = -k x", version: "1.0",
///         author: "me", generation_tool: "fmi-export", stop_time: 1.0, step_size: 0.01,
///     };
///     fn declare(t: &mut Table) -> Self {
///         t.unit("1/s", &[("s", -1)]);
///         let k = t.parameter("k").unit("1/s").about("decay rate").min(0.0).real(1.0);
///         let x = t.state("x").about("what decays").output().real(1.0);
///         let der_x = t.derivative("der(x)", x).unit("1/s").about("rate of x").computed();
///         Decay { k, x, der_x }
///     }
///     fn equations<S: Scalar>(&self, v: &mut Values<S>) -> Outcome {
///         v[self.der_x] = -v[self.k] * v[self.x];
///         Ok(())
///     }
/// }
/// let (_, table) = Table::of::<Decay>();
/// assert_eq!(table.variables().len(), 5 + 1); // k, x, der(x) and the three solver parameters
/// ```
pub trait Model: Sized + Send + Sync + 'static {
    /// Names and default experiment.
    const IDENTITY: Identity;

    /// Declares every variable, in the order of the model description, and keeps the handles.
    fn declare(table: &mut Table) -> Self;

    /// Derived parameters: checks combinations of parameters and fills calculated parameters and memory.
    ///
    /// Called after parameters were set, before the equations are used. Generic, so that derivatives with
    /// respect to parameters go through.
    ///
    /// # Errors
    /// A combination of parameters that the model can't work with; the text names it.
    fn prepare<S: Scalar>(&self, values: &mut Values<S>) -> Outcome {
        let _ = values;
        Ok(())
    }

    /// Initial values of computed states ([`Table::computed_state`]) and of memory, from parameters, inputs and the
    /// other states.
    ///
    /// Called until the simulation starts, after [`Model::prepare`] and before the equations.
    ///
    /// # Errors
    /// A start that does not exist; the text says why.
    fn initialize<S: Scalar>(&self, values: &mut Values<S>) -> Outcome {
        let _ = values;
        Ok(())
    }

    /// Outputs, locals and state derivatives from time, inputs, states, parameters and memory.
    ///
    /// Must not read what it wrote in an earlier call.
    ///
    /// # Errors
    /// Fails where the equations have no value.
    fn equations<S: Scalar>(&self, values: &mut Values<S>) -> Outcome;

    /// Period \[s\] of the sampled update; `None`: not sampled. Samples are taken at start time + k period.
    fn sample_period(&self, values: &Values<f64>) -> Option<f64> {
        let _ = values;
        None
    }

    /// Takes one sample: discrete states, memory and held outputs move on.
    ///
    /// The equations were evaluated at this time with [`Values::at_sample`] true.
    fn sample(&self, values: &mut Values<f64>) {
        let _ = values;
    }

    /// Fills the event indicators; their number was declared by [`Table::event_indicators`].
    fn event_indicators(&self, values: &Values<f64>, indicators: &mut [f64]) {
        let _ = (values, indicators);
    }

    /// Handles whatever event condition holds now. Called at state events and time events; must do nothing
    /// when no condition holds.
    fn event(&self, values: &mut Values<f64>) -> Event {
        let _ = values;
        Event::default()
    }

    /// Description of the last event: for the log, and for the message that ends a simulation.
    fn explain_event(&self, values: &Values<f64>) -> Option<String> {
        let _ = values;
        None
    }

    /// Time \[s\] of the next time event after the present time, besides samples.
    fn next_event_time(&self, values: &Values<f64>) -> Option<f64> {
        let _ = values;
        None
    }

    /// Reads the FMU's `resources` folder, once per instantiation and reset.
    ///
    /// # Errors
    /// A resource that is missing or malformed; the text names it.
    fn load_resources(&self, folder: Option<&Path>, values: &mut Values<f64>) -> Outcome {
        let _ = (folder, values);
        Ok(())
    }

    /// Moves to another point for the search of dependencies (draw 0, 1, ...), starting from the start values.
    ///
    /// The default spreads every Real and Integer over its range. A model whose structure depends on
    /// parameters sets those here so that the draws together show every dependency.
    fn probe(&self, draw: usize, table: &Table, values: &mut Values<f64>) {
        table.spread(draw, values);
    }
}

impl<S> Values<S> {
    /// True for a Co-Simulation instance.
    pub fn is_co_simulation(&self) -> bool {
        self.interface == Interface::CoSimulation
    }
}
