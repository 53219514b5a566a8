//! A Co-Simulation instance.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use fmi::fmi2::binding::{fmi2StatusKind_fmi2LastSuccessfulTime, fmi2StatusKind_fmi2Terminated};

use super::error::Error;
use super::instance::Instance;
use super::open::{Fmu, InterfaceKind};

/// Outcome of a communication step, unless it failed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepStatus {
    /// The whole step was computed.
    Complete,
    /// The FMU stopped inside the step (`fmi2Discard`).
    Discarded {
        /// Time that it reached \[s\], if it says.
        last_successful_time: Option<f64>,
        /// Whether it wants the simulation to end.
        terminated: bool,
    },
}

/// A Co-Simulation instance. What it shares with [`Model`](super::Model) is in [`Instance`], to which it derefs.
#[derive(Debug)]
pub struct Slave(Instance);

impl Deref for Slave {
    type Target = Instance;

    fn deref(&self) -> &Instance {
        &self.0
    }
}

impl DerefMut for Slave {
    fn deref_mut(&mut self) -> &mut Instance {
        &mut self.0
    }
}

impl Slave {
    /// Makes an instance called `name`; `logging` turns on the debug messages of the FMU.
    ///
    /// # Errors
    /// The FMU has no Co-Simulation interface or no library for this platform, the library cannot be loaded, or
    /// fmi2Instantiate returned NULL (then with the FMU's messages).
    pub fn instantiate(fmu: &Arc<Fmu>, name: &str, logging: bool) -> Result<Slave, Error> {
        Instance::new(fmu, InterfaceKind::CoSimulation, name, logging).map(Slave)
    }

    /// Steps from `t` to `t + h` \[s\]. `no_set_state_prior`: the importer will not restore a state before `t`.
    ///
    /// # Errors
    /// The FMU answered fmi2Error, fmi2Fatal or fmi2Pending.
    // The good path is part of the loop of a master; everything else stays out of it.
    #[inline(always)]
    pub fn do_step(&mut self, t: f64, h: f64, no_set_state_prior: bool) -> Result<StepStatus, Error> {
        let do_step = self.0.slave_functions("fmi2DoStep")?.do_step;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe { do_step(self.0.component(), t, h, no_set_state_prior.into()) };
        super::last_words::leave();
        self.0.keep_rounding();
        if status <= super::instance::WARNING {
            self.0.set_known_time(t + h);
            return Ok(StepStatus::Complete);
        }
        self.step_not_complete(status, t, h)
    }

    #[cold]
    #[inline(never)]
    fn step_not_complete(&mut self, status: u32, t: f64, h: f64) -> Result<StepStatus, Error> {
        let functions = *self.0.slave_functions("fmi2DoStep")?;
        self.0.set_known_time(t);
        if status != super::instance::DISCARD {
            return Err(self.0.step_failure(status, h));
        }
        let (mut last, mut terminated) = (0.0, 0);
        let last_successful_time = functions.get_real_status.and_then(|get| {
            // SAFETY: as above; the pointer is to a local.
            let status =
                unsafe { get(self.0.component(), fmi2StatusKind_fmi2LastSuccessfulTime, &raw mut last) };
            (status <= super::instance::WARNING && last.is_finite()).then_some(last)
        });
        if let Some(get) = functions.get_boolean_status {
            // SAFETY: as above; the pointer is to a local.
            let status =
                unsafe { get(self.0.component(), fmi2StatusKind_fmi2Terminated, &raw mut terminated) };
            if status > super::instance::WARNING {
                terminated = 0;
            }
        }
        super::last_words::leave();
        if let Some(time) = last_successful_time {
            self.0.set_known_time(time);
        }
        Ok(StepStatus::Discarded { last_successful_time, terminated: terminated != 0 })
    }

    /// Sets derivatives of real inputs: `values[i]` is the derivative of order `order[i]` (from 1) of
    /// `references[i]` at the current communication point. All slices have the same length.
    ///
    /// # Errors
    /// Different lengths, the function is missing, or the FMU refuses.
    pub fn set_real_input_derivatives(
        &mut self,
        references: &[u32],
        order: &[i32],
        values: &[f64],
    ) -> Result<(), Error> {
        let function = "fmi2SetRealInputDerivatives";
        self.0.same_length(function, order.len(), references.len())?;
        self.0.same_length(function, values.len(), references.len())?;
        let call = self.0.slave_functions(function)?.set_real_input_derivatives;
        let call = call.ok_or_else(|| self.0.missing(function))?;
        // SAFETY: the component is alive; all three arrays have the length passed.
        let status = unsafe {
            call(self.0.component(), references.as_ptr(), references.len(), order.as_ptr(), values.as_ptr())
        };
        self.0.check_reals(function, status, references, Some(values))
    }

    /// Reads derivatives of real outputs into `values`; slices as in [`Self::set_real_input_derivatives`].
    ///
    /// # Errors
    /// Different lengths, the function is missing, or the FMU refuses.
    pub fn get_real_output_derivatives(
        &mut self,
        references: &[u32],
        order: &[i32],
        values: &mut [f64],
    ) -> Result<(), Error> {
        let function = "fmi2GetRealOutputDerivatives";
        self.0.same_length(function, order.len(), references.len())?;
        self.0.same_length(function, values.len(), references.len())?;
        let call = self.0.slave_functions(function)?.get_real_output_derivatives;
        let call = call.ok_or_else(|| self.0.missing(function))?;
        // SAFETY: the component is alive; all three arrays have the length passed.
        let status = unsafe {
            call(
                self.0.component(),
                references.as_ptr(),
                references.len(),
                order.as_ptr(),
                values.as_mut_ptr(),
            )
        };
        self.0.check_reals(function, status, references, None)
    }
}
