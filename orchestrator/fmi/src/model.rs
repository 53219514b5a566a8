//! A Model Exchange instance.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use fmi::fmi2::binding::fmi2EventInfo;

use super::error::Error;
use super::instance::Instance;
use super::open::{Fmu, InterfaceKind};

/// Answer of [`Model::new_discrete_states`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EventInfo {
    /// Event iteration must go on.
    pub new_discrete_states_needed: bool,
    /// The FMU wants the simulation to end.
    pub terminate_simulation: bool,
    /// Nominals of states changed.
    pub nominals_of_continuous_states_changed: bool,
    /// States jumped.
    pub values_of_continuous_states_changed: bool,
    /// Time of the next time event \[s\], if there is one.
    pub next_event_time: Option<f64>,
}

/// Answer of [`Model::completed_integrator_step`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StepEvent {
    /// The FMU wants event mode.
    pub enter_event_mode: bool,
    /// The FMU wants the simulation to end.
    pub terminate_simulation: bool,
}

/// A Model Exchange instance. What it shares with [`Slave`](super::Slave) is in [`Instance`], to which it derefs.
#[derive(Debug)]
pub struct Model(Instance);

impl Deref for Model {
    type Target = Instance;

    fn deref(&self) -> &Instance {
        &self.0
    }
}

impl DerefMut for Model {
    fn deref_mut(&mut self) -> &mut Instance {
        &mut self.0
    }
}

impl Model {
    /// Makes an instance called `name`; `logging` turns on the debug messages of the FMU.
    ///
    /// # Errors
    /// Same as [`Slave::instantiate`](super::Slave::instantiate), for Model Exchange.
    pub fn instantiate(fmu: &Arc<Fmu>, name: &str, logging: bool) -> Result<Model, Error> {
        Instance::new(fmu, InterfaceKind::ModelExchange, name, logging).map(Model)
    }

    /// Sets the independent variable \[s\].
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn set_time(&mut self, time: f64) -> Result<(), Error> {
        let function = "fmi2SetTime";
        let call = self.0.model_functions(function)?.set_time;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe { call(self.0.component(), time) };
        self.0.set_known_time(time);
        self.0.check(function, status)
    }

    /// Leaves continuous-time mode for event mode.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_event_mode(&mut self) -> Result<(), Error> {
        let function = "fmi2EnterEventMode";
        let call = self.0.model_functions(function)?.enter_event_mode;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe { call(self.0.component()) };
        self.0.check(function, status)
    }

    /// One event iteration.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn new_discrete_states(&mut self) -> Result<EventInfo, Error> {
        let function = "fmi2NewDiscreteStates";
        let call = self.0.model_functions(function)?.new_discrete_states;
        let mut info = fmi2EventInfo::default();
        // SAFETY: the component is alive; the pointer is to a local.
        let status = unsafe { call(self.0.component(), &raw mut info) };
        self.0.keep_rounding();
        self.0.check(function, status)?;
        Ok(EventInfo {
            new_discrete_states_needed: info.newDiscreteStatesNeeded != 0,
            terminate_simulation: info.terminateSimulation != 0,
            nominals_of_continuous_states_changed: info.nominalsOfContinuousStatesChanged != 0,
            values_of_continuous_states_changed: info.valuesOfContinuousStatesChanged != 0,
            next_event_time: (info.nextEventTimeDefined != 0).then_some(info.nextEventTime),
        })
    }

    /// Leaves event mode for continuous-time mode.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_continuous_time_mode(&mut self) -> Result<(), Error> {
        let function = "fmi2EnterContinuousTimeMode";
        let call = self.0.model_functions(function)?.enter_continuous_time_mode;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe { call(self.0.component()) };
        self.0.check(function, status)
    }

    /// Tells the FMU that an integrator step was accepted.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn completed_integrator_step(&mut self, no_set_state_prior: bool) -> Result<StepEvent, Error> {
        let function = "fmi2CompletedIntegratorStep";
        let call = self.0.model_functions(function)?.completed_integrator_step;
        let (mut event, mut end) = (0, 0);
        // SAFETY: the component is alive; the pointers are to locals.
        let status =
            unsafe { call(self.0.component(), no_set_state_prior.into(), &raw mut event, &raw mut end) };
        self.0.keep_rounding();
        self.0.check(function, status)?;
        Ok(StepEvent { enter_event_mode: event != 0, terminate_simulation: end != 0 })
    }

    /// Sets the continuous states, `[nx]` in the order of the derivatives in the model structure.
    ///
    /// # Errors
    /// Wrong length, or the FMU refuses.
    pub fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), Error> {
        let function = "fmi2SetContinuousStates";
        let call = self.0.model_functions(function)?.set_continuous_states;
        self.0.same_length(function, states.len(), self.state_count())?;
        // SAFETY: the component is alive; the array has the length passed.
        let status = unsafe { call(self.0.component(), states.as_ptr(), states.len()) };
        self.0.check(function, status)
    }

    /// Reads the continuous states, `[nx]`.
    ///
    /// # Errors
    /// Wrong length, or the FMU refuses.
    pub fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), Error> {
        let function = "fmi2GetContinuousStates";
        let call = self.0.model_functions(function)?.get_continuous_states;
        self.read(function, call, states, self.state_count())
    }

    /// Reads the derivatives of the states, `[nx]`, unit of the state per s.
    ///
    /// # Errors
    /// Wrong length, or the FMU refuses.
    pub fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), Error> {
        let function = "fmi2GetDerivatives";
        let call = self.0.model_functions(function)?.get_derivatives;
        self.read(function, call, derivatives, self.state_count())
    }

    /// Reads the nominal values of the states, `[nx]`.
    ///
    /// # Errors
    /// Wrong length, or the FMU refuses.
    pub fn get_nominals(&mut self, nominals: &mut [f64]) -> Result<(), Error> {
        let function = "fmi2GetNominalsOfContinuousStates";
        let call = self.0.model_functions(function)?.get_nominals;
        self.read(function, call, nominals, self.state_count())
    }

    /// Reads the event indicators, `[ni]`.
    ///
    /// # Errors
    /// Wrong length, or the FMU refuses.
    pub fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Result<(), Error> {
        let function = "fmi2GetEventIndicators";
        let call = self.0.model_functions(function)?.get_event_indicators;
        self.read(function, call, indicators, self.fmu().description.number_of_event_indicators)
    }

    /// Numbers of continuous states and event indicators as the library gives them (FMI 3.0); `None` where it does not.
    pub(crate) fn counts(&self) -> [Option<usize>; 2] {
        if !self.0.is_fmi3() {
            return [None; 2];
        }
        // SAFETY: the component is alive and one of FMI 3.0.
        unsafe { super::fmi3::counts(self.0.component()) }
    }

    /// Number of continuous states.
    pub fn state_count(&self) -> usize {
        self.fmu().description.derivatives.len()
    }

    fn read(
        &mut self,
        function: &'static str,
        call: unsafe extern "C" fn(fmi::fmi2::binding::fmi2Component, *mut f64, usize) -> u32,
        values: &mut [f64],
        expected: usize,
    ) -> Result<(), Error> {
        self.0.same_length(function, values.len(), expected)?;
        // SAFETY: the component is alive; the array has the length passed.
        let status = unsafe { call(self.0.component(), values.as_mut_ptr(), values.len()) };
        self.0.keep_rounding();
        self.0.check(function, status)
    }
}
