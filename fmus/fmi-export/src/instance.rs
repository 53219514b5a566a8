//! One FMU instance: its state, its life cycle, and the evaluation of its equations when they are needed.

use crate::columns::Columns;
use crate::ctypes::Status;
use crate::definition::Definition;
use crate::dual::Dual;
use crate::integrator::Workspace;
use crate::logger::{Category, Logger};
use crate::model::{Model, Outcome, Refusal};
use crate::start_values::StartValues;
use crate::state_machine::Mode;
use crate::values::{Interface, Real, Values};
use crate::variables::Access;
use std::ffi::CString;
use std::path::PathBuf;

/// Highest order of input derivatives that `fmi2SetRealInputDerivatives` takes.
pub(crate) const MAX_INPUT_ORDER: usize = 3;

/// Everything that changes during a simulation: what `fmi2GetFMUstate` copies.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub mode: Mode,
    pub values: Values<f64>,
    /// Outputs must be computed before they are read.
    pub dirty: bool,
    /// [`Model::prepare`] must run before the equations.
    pub parameters_dirty: bool,
    pub start_time: f64,
    pub stop_time: Option<f64>,
    pub tolerance: Option<f64>,
    /// Number of the next sample.
    pub sample_index: u64,
    /// Model Exchange: the sample of this event has been taken.
    pub sample_taken: bool,
    /// Real values and memory before the sample of this event.
    pub pre_real: Vec<f64>,
    pub pre_memory: Vec<f64>,
    /// Input derivatives for the next step: `rates[(order - 1) * inputs + i]`.
    pub input_rates: Vec<f64>,
    /// First derivatives of the inputs at the end of the last step.
    pub end_rates: Vec<f64>,
    /// Step that the adaptive integrator proposes; 0: none yet.
    pub proposed_step: f64,
    pub last_successful_time: f64,
    pub last_step_status: Status,
    pub terminated: bool,
}

impl State {
    /// Overwrites `self` without allocating (but for longer strings).
    pub fn copy_from(&mut self, o: &State) {
        self.values.copy_from(&o.values);
        self.pre_real.copy_from_slice(&o.pre_real);
        self.pre_memory.copy_from_slice(&o.pre_memory);
        self.input_rates.copy_from_slice(&o.input_rates);
        self.end_rates.copy_from_slice(&o.end_rates);
        let State {
            mode,
            values: _,
            dirty,
            parameters_dirty,
            start_time,
            stop_time,
            tolerance,
            sample_index,
            sample_taken,
            pre_real: _,
            pre_memory: _,
            input_rates: _,
            end_rates: _,
            proposed_step,
            last_successful_time,
            last_step_status,
            terminated,
        } = o;
        self.mode = *mode;
        self.dirty = *dirty;
        self.parameters_dirty = *parameters_dirty;
        self.start_time = *start_time;
        self.stop_time = *stop_time;
        self.tolerance = *tolerance;
        self.sample_index = *sample_index;
        self.sample_taken = *sample_taken;
        self.proposed_step = *proposed_step;
        self.last_successful_time = *last_successful_time;
        self.last_step_status = *last_step_status;
        self.terminated = *terminated;
    }
}

/// An instance of model `M`, as behind an `fmi2Component`.
pub struct Instance<M: Model> {
    pub(crate) definition: &'static Definition<M>,
    /// GUID of the FMU: that of the library, or of an FMU derived from it.
    pub(crate) guid: String,
    /// Values that `fmi2Reset` restores.
    start: Values<f64>,
    pub(crate) state: State,
    pub(crate) logger: Logger,
    resources: Option<PathBuf>,
    /// Real inputs, in the order of the table.
    pub(crate) inputs: Vec<Real>,
    pub(crate) access: Access,
    pub(crate) work: Workspace,
    pub(crate) duals: Values<Dual>,
    pub(crate) columns: Columns,
    /// Strings handed to the importer; valid until its next call.
    pub(crate) returned_strings: Vec<CString>,
}

impl<M: Model> Instance<M> {
    /// Creates an instance with start values.
    ///
    /// # Errors
    /// Fails where the start values of a derived FMU do not fit, or the model can't load its resources.
    pub(crate) fn new(
        definition: &'static Definition<M>,
        derived: Option<StartValues>,
        interface: Interface,
        logger: Logger,
        resources: Option<PathBuf>,
    ) -> Result<Self, Refusal> {
        let table = &definition.table;
        let inputs: Vec<Real> = table
            .variables()
            .iter()
            .filter(|v| v.causality == crate::Causality::Input)
            .filter_map(crate::Variable::real)
            .collect();
        let mut values = table.start_values(interface);
        if let Some(derived) = &derived {
            derived.apply(table, &mut values).map_err(Refusal::Error)?;
        }
        let start = values.clone();
        let state = State {
            mode: Mode::Instantiated,
            dirty: true,
            parameters_dirty: true,
            start_time: 0.0,
            stop_time: None,
            tolerance: None,
            sample_index: 0,
            sample_taken: false,
            pre_real: values.real.clone(),
            pre_memory: values.memory.clone(),
            input_rates: vec![0.0; inputs.len() * MAX_INPUT_ORDER],
            end_rates: vec![0.0; inputs.len()],
            proposed_step: 0.0,
            last_successful_time: 0.0,
            last_step_status: Status::OK,
            terminated: false,
            values,
        };
        let mut instance = Self {
            definition,
            guid: derived.map_or_else(|| definition.guid.clone(), |derived| derived.guid),
            start,
            duals: state.values.convert(),
            columns: Columns::new(&state.values),
            work: Workspace::new(table.states().len(), table.number_of_event_indicators(), inputs.len()),
            access: Access::of(table),
            returned_strings: Vec::with_capacity(
                table.variables().iter().filter(|v| matches!(v.kind, crate::Kind::Text { .. })).count(),
            ),
            state,
            logger,
            resources,
            inputs,
        };
        instance.load_resources()?;
        Ok(instance)
    }

    fn load_resources(&mut self) -> Outcome {
        self.definition.model.load_resources(self.resources.as_deref(), &mut self.state.values)
    }

    /// Interface of the instance.
    pub(crate) fn interface(&self) -> Interface {
        self.state.values.interface
    }

    /// Brings derived parameters up to date.
    #[inline]
    pub(crate) fn prepare(&mut self) -> Outcome {
        if self.state.parameters_dirty {
            self.definition.model.prepare(&mut self.state.values)?;
            self.state.parameters_dirty = false;
        }
        Ok(())
    }

    /// True until the initialization is over: computed states still follow from what is set.
    pub(crate) fn is_before_start(&self) -> bool {
        matches!(self.state.mode, Mode::Instantiated | Mode::InitializationMode)
    }

    /// Brings derived parameters, outputs and derivatives up to date.
    #[inline]
    pub(crate) fn update(&mut self) -> Outcome {
        if self.state.dirty {
            self.columns.forget();
            self.prepare()?;
            if self.is_before_start() {
                self.definition.model.initialize(&mut self.state.values)?;
            }
            self.definition.model.equations(&mut self.state.values)?;
            self.state.dirty = false;
        }
        Ok(())
    }

    /// Logs a refusal and gives its status.
    pub(crate) fn refuse(&self, function: &str, refusal: &Refusal) -> Status {
        let (category, status, text) = match refusal {
            Refusal::Discard(text) => (Category::Discard, Status::Discard, text),
            Refusal::Error(text) => (Category::Error, Status::Error, text),
        };
        self.logger.log(category, &format!("{function}: {text}"));
        status
    }

    pub(crate) fn error(&self, function: &str, text: &str) -> Status {
        self.logger.log(Category::Error, &format!("{function}: {text}"));
        Status::Error
    }

    pub(crate) fn discard(&self, function: &str, text: &str) -> Status {
        self.logger.log(Category::Discard, &format!("{function}: {text}"));
        Status::Discard
    }

    pub(crate) fn setup_experiment(
        &mut self,
        tolerance: Option<f64>,
        start: f64,
        stop: Option<f64>,
    ) -> Status {
        const F: &str = "fmi2SetupExperiment";
        if !start.is_finite() {
            return self.error(F, &format!("the start time {start} is not finite"));
        }
        if let Some(stop) = stop
            && !(stop.is_finite() && stop >= start)
        {
            return self.error(
                F,
                &format!("the stop time {stop} must be finite and not before the start time {start}"),
            );
        }
        if let Some(tolerance) = tolerance
            && !(tolerance.is_finite() && tolerance > 0.0)
        {
            return self.error(F, &format!("the tolerance {tolerance} must be positive and finite"));
        }
        self.state.tolerance = tolerance;
        self.state.start_time = start;
        self.state.stop_time = stop;
        self.state.values.time = start;
        self.state.last_successful_time = start;
        self.state.dirty = true;
        Status::OK
    }

    pub(crate) fn enter_initialization_mode(&mut self) -> Status {
        self.state.mode = Mode::InitializationMode;
        self.state.dirty = true;
        Status::OK
    }

    pub(crate) fn exit_initialization_mode(&mut self) -> Status {
        const F: &str = "fmi2ExitInitializationMode";
        if let Err(refusal) = self.update() {
            // Initialization can't be repeated with a smaller step: every refusal is an error here.
            let (Refusal::Discard(text) | Refusal::Error(text)) = refusal;
            return self.error(F, &text);
        }
        self.state.mode = match self.interface() {
            Interface::ModelExchange => Mode::EventMode,
            Interface::CoSimulation => Mode::StepComplete,
        };
        self.state.sample_taken = false;
        Status::OK
    }

    pub(crate) fn terminate(&mut self) -> Status {
        self.state.mode = Mode::Terminated;
        Status::OK
    }

    pub(crate) fn reset(&mut self) -> Status {
        let s = &mut self.state;
        s.pre_real.copy_from_slice(&self.start.real);
        s.pre_memory.copy_from_slice(&self.start.memory);
        s.values.copy_from(&self.start);
        s.mode = Mode::Instantiated;
        s.dirty = true;
        s.parameters_dirty = true;
        s.start_time = 0.0;
        s.stop_time = None;
        s.tolerance = None;
        s.sample_index = 0;
        s.sample_taken = false;
        s.input_rates.fill(0.0);
        s.end_rates.fill(0.0);
        s.proposed_step = 0.0;
        s.last_successful_time = 0.0;
        s.last_step_status = Status::OK;
        s.terminated = false;
        match self.load_resources() {
            Ok(()) => Status::OK,
            Err(refusal) => self.refuse("fmi2Reset", &refusal),
        }
    }

    /// Time of the next sample, where the model is sampled, with its period.
    pub(crate) fn next_sample(&self) -> Option<(f64, f64)> {
        let period = self.definition.model.sample_period(&self.state.values)?;
        Some((self.state.start_time + self.state.sample_index as f64 * period, period))
    }

    /// True where a sample falls on the present time (within a millionth of the period).
    pub(crate) fn sample_is_due(&self) -> bool {
        self.next_sample().is_some_and(|(next, period)| self.state.values.time >= next - 1e-6 * period)
    }

    /// Takes the sample of the present time with the present inputs.
    pub(crate) fn take_sample(&mut self) -> Outcome {
        self.state.values.at_sample = true;
        self.state.dirty = true;
        self.update()?;
        self.definition.model.sample(&mut self.state.values);
        self.state.values.at_sample = false;
        self.state.dirty = true;
        if self.logger.wants(Category::Events) {
            let message = format!("sample {} at t = {} s", self.state.sample_index, self.state.values.time);
            self.logger.log(Category::Events, &message);
        }
        Ok(())
    }
}
