//! `fmi2DoStep` and its relatives: from one communication point to the next.
//!
//! Inside the step: samples at their own times (each at the start of the interval that it opens, so that one at
//! the end of the step belongs to the next step), inputs extrapolated with the given derivatives, the inner
//! integrator, state events located by bisection, time events.

use crate::ctypes::{Status, status_kind};
use crate::inner_solver::{InnerSolver, Side};
use crate::input_ramp::{set_inputs, slope_at};
use crate::instance::{Instance, MAX_INPUT_ORDER};
use crate::logger::Category;
use crate::model::{Event, Model, Refusal};
use crate::state_machine::Mode;
use crate::values::Real;

/// More state events than this in one communication step are taken for chattering.
const MAX_EVENTS_PER_STEP: usize = 10_000;
/// An event that keeps asking for another round at the same time is stopped after this many.
const MAX_EVENT_ITERATIONS: usize = 100;

/// Extent of a step: complete, or where it stopped.
enum Stop {
    /// The model asked to end the simulation at this time.
    Terminated(f64),
    Refused(Refusal),
}

impl From<Refusal> for Stop {
    fn from(refusal: Refusal) -> Self {
        Stop::Refused(refusal)
    }
}

impl<M: Model> Instance<M> {
    pub(crate) fn do_step(&mut self, t: f64, h: f64) -> Status {
        const F: &str = "fmi2DoStep";
        let now = self.state.values.time;
        if !(h > 0.0 && h.is_finite()) {
            return self.error(F, &format!("the communication step size {h} s must be positive and finite"));
        }
        let slack = 1e-8 * h + 4.0 * f64::EPSILON * now.abs();
        if t.is_nan() || (t - now).abs() > slack {
            return self.error(F, &format!("the communication point {t} s is not the present time {now} s"));
        }
        let end = t + h;
        if let Some(stop) = self.state.stop_time
            && end > stop + slack
        {
            return self
                .error(F, &format!("the step from {t} s to {end} s goes past the stop time {stop} s"));
        }
        for (i, input) in self.inputs.iter().enumerate() {
            self.work.inputs[i] = self.state.values[*input];
        }
        self.state.values.time = t;
        self.state.last_successful_time = t;
        self.state.terminated = false;
        let outcome = self.step_to(t, end);
        let status = match outcome {
            Ok(()) => {
                self.state.last_successful_time = end;
                Status::OK
            }
            Err(Stop::Terminated(at)) => {
                self.state.last_successful_time = at;
                self.state.terminated = true;
                let reason = self.definition.model.explain_event(&self.state.values);
                let reason = reason.map_or_else(String::new, |reason| format!(": {reason}"));
                self.discard(F, &format!("the model ended the simulation at t = {at} s{reason}"))
            }
            // The last completed step ended at `t`; what was reached inside this one is not for use.
            Err(Stop::Refused(refusal)) => self.refuse(F, &refusal),
        };
        self.close_input_ramps(self.state.values.time - t);
        if status == Status::Discard {
            self.state.mode = Mode::StepFailed;
        }
        self.state.last_step_status = status;
        status
    }

    /// Leaves the inputs where their ramps ended; derivatives hold for one step.
    fn close_input_ramps(&mut self, elapsed: f64) {
        let n = self.inputs.len();
        for i in 0..n {
            let rates = &self.state.input_rates;
            self.state.end_rates[i] = slope_at(rates, n, i, elapsed);
        }
        self.state.input_rates.fill(0.0);
    }

    fn step_to(&mut self, start: f64, end: f64) -> Result<(), Stop> {
        self.prepare()?;
        let ramped = self.state.input_rates.iter().any(|r| *r != 0.0);
        let mut events = 0;
        let mut t = start;
        loop {
            if self.sample_is_due() {
                self.take_sample()?;
                self.state.sample_index += 1;
            }
            let mut target = end;
            if let Some((next, period)) = self.next_sample()
                && next < end - 1e-6 * period
            {
                target = next;
            }
            let time_event = self.definition.model.next_event_time(&self.state.values);
            if let Some(at) = time_event
                && at <= target
            {
                target = at.max(t);
            }
            self.advance(start, t, target, ramped, &mut events)?;
            t = target;
            self.state.values.time = t;
            self.state.dirty = true;
            if time_event.is_some_and(|at| at <= t) {
                events += 1;
                self.handle_event(t, events)?;
            }
            if t >= end {
                // Equations that have no value here fail the step, not the reading of outputs after it.
                return Ok(self.update()?);
            }
        }
    }

    /// Integrates from `t` to `target` with the inner method; handles state events on the way.
    fn advance(
        &mut self,
        start: f64,
        mut t: f64,
        target: f64,
        ramped: bool,
        events: &mut usize,
    ) -> Result<(), Stop> {
        let has_indicators = !self.work.z0.is_empty();
        if self.work.x0.is_empty() && !has_indicators {
            if ramped {
                let n = self.inputs.len();
                set_inputs(
                    &mut self.state.values,
                    &self.inputs,
                    &self.work.inputs,
                    &self.state.input_rates,
                    n,
                    target - start,
                );
            }
            return Ok(());
        }
        self.read_states();
        let mut inner = InnerSolver::of(self, ramped, start);
        if has_indicators {
            inner.indicators(t, Side::Start)?;
        }
        while t < target {
            let h = inner.step(t, target)?;
            let mut reached = if target - (t + h) < 1e-12 * h { target } else { t + h };
            inner.check_finite(reached)?;
            let mut event = false;
            if has_indicators {
                inner.indicators(reached, Side::End)?;
                if inner.crossed() {
                    reached = inner.locate(t, reached)?;
                    event = true;
                }
            }
            inner.accept(reached);
            t = reached;
            if event {
                *events += 1;
                self.state.dirty = true;
                self.handle_event(t, *events)?;
                self.read_states();
                inner = InnerSolver::of(self, ramped, start);
                inner.indicators(t, Side::Start)?;
            }
        }
        Ok(())
    }

    fn read_states(&mut self) {
        for (x, state) in self.work.x0.iter_mut().zip(self.definition.table.states()) {
            *x = self.state.values[*state];
        }
    }

    fn handle_event(&mut self, t: f64, events: usize) -> Result<(), Stop> {
        if events > MAX_EVENTS_PER_STEP {
            return Err(Stop::Refused(Refusal::Discard(format!(
                "more than {MAX_EVENTS_PER_STEP} events in one communication step, the last at t = {t} s: \
                 the model chatters"
            ))));
        }
        for _ in 0..MAX_EVENT_ITERATIONS {
            self.update()?;
            let Event { iterate, terminate, .. } = self.definition.model.event(&mut self.state.values);
            self.state.dirty = true;
            self.log_event(t);
            if terminate {
                return Err(Stop::Terminated(t));
            }
            if !iterate {
                return Ok(());
            }
        }
        Err(Stop::Refused(Refusal::Discard(format!(
            "the event at t = {t} s did not settle in {MAX_EVENT_ITERATIONS} iterations"
        ))))
    }

    /// Says what an event was, where the importer wants to know.
    pub(crate) fn log_event(&self, t: f64) {
        if self.logger.wants(Category::Events) {
            let what = self.definition.model.explain_event(&self.state.values);
            let what = what.map_or_else(String::new, |what| format!(": {what}"));
            self.logger.log(Category::Events, &format!("event at t = {t} s{what}"));
        }
    }

    pub(crate) fn set_real_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Status {
        const F: &str = "fmi2SetRealInputDerivatives";
        let n = self.inputs.len();
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let Some(input) = self.inputs.iter().position(|i| i.value_reference() == *reference) else {
                return self.unknown_reference(F, "Real input", *reference);
            };
            let name =
                &self.definition.table.variables()[self.definition.table.index_of(self.inputs[input])].name;
            if !(1..=MAX_INPUT_ORDER as i32).contains(order) {
                return self.error(F, &format!("`{name}`: order {order} is not one of 1..{MAX_INPUT_ORDER}"));
            }
            if !value.is_finite() {
                return self.discard(
                    F,
                    &format!("`{name}`: the derivative {value} is not finite; the old value is kept"),
                );
            }
        }
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            let input = self.inputs.iter().position(|i| i.value_reference() == *reference);
            let input = input.expect("checked above");
            self.state.input_rates[(*order as usize - 1) * n + input] = *value;
        }
        Status::OK
    }

    /// First time derivatives of outputs at the communication point, exact from the equations.
    pub(crate) fn get_real_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Status {
        const F: &str = "fmi2GetRealOutputDerivatives";
        for (reference, order) in references.iter().zip(orders) {
            let variable = self.definition.table.real_variable(*reference);
            let Some(variable) = variable.filter(|v| v.causality == crate::Causality::Output) else {
                return self.unknown_reference(F, "Real output", *reference);
            };
            if *order != 1 {
                return self.error(F, &format!("`{}`: order {order} is not 1", variable.name));
            }
        }
        if let Err(refusal) = self.update().and_then(|()| self.seed_time_direction()) {
            return self.refuse(F, &refusal);
        }
        for (reference, value) in references.iter().zip(values) {
            [*value] = self.duals[Real(*reference)].eps;
        }
        Status::OK
    }

    /// `fmi2GetRealStatus`, `fmi2GetBooleanStatus` and `fmi2GetStatus` of the last step.
    pub(crate) fn step_status(&self, kind: i32) -> Option<StepStatus> {
        match kind {
            status_kind::DO_STEP_STATUS => Some(StepStatus::DoStep(self.state.last_step_status)),
            status_kind::PENDING_STATUS => Some(StepStatus::Pending),
            status_kind::LAST_SUCCESSFUL_TIME => {
                Some(StepStatus::LastSuccessfulTime(self.state.last_successful_time))
            }
            status_kind::TERMINATED => Some(StepStatus::Terminated(self.state.terminated)),
            _ => None,
        }
    }
}

/// Answer to the status functions.
pub(crate) enum StepStatus {
    DoStep(Status),
    Pending,
    LastSuccessfulTime(f64),
    Terminated(bool),
}
