//! `fmi2DoStep` and its relatives: from one communication point to the next.
//!
//! Inside the step: samples at their own times (each at the start of the interval that it opens, so that one at
//! the end of the step belongs to the next step), inputs extrapolated with the given derivatives, the inner
//! integrator, state events located by bisection, time events.

use crate::ctypes::{Status, status_kind};
use crate::definition::Definition;
use crate::instance::{Instance, MAX_INPUT_ORDER};
use crate::integrator::{Workspace, dopri5, rk4};
use crate::logger::Category;
use crate::model::{Event, Model, Outcome, Refusal};
use crate::state_machine::Mode;
use crate::values::{Real, Values};

/// More state events than this in one communication step are taken for chattering.
const MAX_EVENTS_PER_STEP: usize = 10_000;
/// An event that keeps asking for another round at the same time is stopped after this many.
const MAX_EVENT_ITERATIONS: usize = 100;
/// Solver method number of Dormand-Prince in the enumeration `SolverMethod`.
const DOPRI5: i32 = 2;

/// How far a step got.
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
                self.discard(F, &format!("the model ended the simulation at t = {at} s"))
            }
            Err(Stop::Refused(refusal)) => {
                self.state.last_successful_time = self.state.values.time;
                self.refuse(F, &refusal)
            }
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
            self.state.end_rates[i] = ramp_slope(rates, n, i, elapsed);
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
            if self.logger.wants(Category::Events) {
                self.logger.log(Category::Events, &format!("event at t = {t} s"));
            }
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
            *value = self.duals[Real(*reference)].eps;
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

/// Value of the input polynomial after `elapsed` s.
fn ramp_value(base: f64, rates: &[f64], n: usize, i: usize, elapsed: f64) -> f64 {
    let mut value = base;
    let mut power = 1.0;
    for order in 0..MAX_INPUT_ORDER {
        power *= elapsed / (order + 1) as f64;
        value += rates[order * n + i] * power;
    }
    value
}

/// Slope of the input polynomial after `elapsed` s.
fn ramp_slope(rates: &[f64], n: usize, i: usize, elapsed: f64) -> f64 {
    let mut power = 1.0;
    let mut slope = 0.0;
    for order in 0..MAX_INPUT_ORDER {
        slope += rates[order * n + i] * power;
        power *= elapsed / (order + 1) as f64;
    }
    slope
}

fn set_inputs(
    values: &mut Values<f64>,
    inputs: &[Real],
    base: &[f64],
    rates: &[f64],
    n: usize,
    elapsed: f64,
) {
    for (i, input) in inputs.iter().enumerate() {
        values[*input] = ramp_value(base[i], rates, n, i, elapsed);
    }
}

enum Side {
    Start,
    End,
}

/// The inner integrator on borrowed parts of an instance.
struct InnerSolver<'a, M: Model> {
    definition: &'static Definition<M>,
    values: &'a mut Values<f64>,
    proposed: &'a mut f64,
    inputs: &'a [Real],
    rates: &'a [f64],
    work: &'a mut Workspace,
    ramped: bool,
    start: f64,
    dopri: bool,
    max_step: f64,
    tolerance: f64,
}

/// A borrowed right-hand side: states in, derivatives out.
macro_rules! right_hand_side {
    ($self:ident) => {{
        let (definition, inputs, rates) = ($self.definition, $self.inputs, $self.rates);
        let (ramped, start) = ($self.ramped, $self.start);
        let values = &mut *$self.values;
        let base: &[f64] = &$self.work.inputs;
        move |t: f64, x: &[f64], dx: &mut [f64]| -> Outcome {
            values.time = t;
            if ramped {
                set_inputs(values, inputs, base, rates, inputs.len(), t - start);
            }
            for (x, state) in x.iter().zip(definition.table.states()) {
                values[*state] = *x;
            }
            definition.model.equations(values)?;
            for (dx, derivative) in dx.iter_mut().zip(definition.table.derivatives()) {
                *dx = values[*derivative];
            }
            Ok(())
        }
    }};
}

impl<'a, M: Model> InnerSolver<'a, M> {
    fn of(instance: &'a mut Instance<M>, ramped: bool, start: f64) -> Self {
        let state = &mut instance.state;
        let (dopri, max_step, tolerance) = match instance.definition.table.solver {
            Some(p) => (
                state.values[p.method] == DOPRI5,
                state.values[p.max_step],
                state.tolerance.unwrap_or(state.values[p.tolerance]),
            ),
            None => (false, f64::INFINITY, 1e-8),
        };
        Self {
            definition: instance.definition,
            values: &mut state.values,
            proposed: &mut state.proposed_step,
            inputs: &instance.inputs,
            rates: &state.input_rates,
            work: &mut instance.work,
            ramped,
            start,
            dopri,
            max_step,
            tolerance,
        }
    }

    /// One inner step from `(t, x0)` towards `target`; gives its length, the state goes to `x1`.
    fn step(&mut self, t: f64, target: f64) -> Result<f64, Refusal> {
        let left = target - t;
        if !self.dopri {
            // Equal steps of at most max_step; the small subtraction forgives rounding of the quotient.
            let n = (left / self.max_step - 1e-9).ceil().max(1.0);
            let h = left / n;
            self.single(t, h)?;
            return Ok(h);
        }
        let mut h = if *self.proposed > 0.0 { *self.proposed } else { self.max_step / 10.0 };
        loop {
            h = h.min(self.max_step);
            let clipped = h >= left;
            let used = if clipped { left } else { h };
            let error = self.single(t, used)?;
            let factor = if error > 0.0 { (0.9 * error.powf(-0.2)).clamp(0.2, 5.0) } else { 5.0 };
            if error <= 1.0 {
                if !clipped || factor < 1.0 {
                    *self.proposed = used * factor;
                }
                return Ok(used);
            }
            h = used * if error.is_finite() { factor.min(0.9) } else { 0.2 };
            if t + h <= t {
                return Err(Refusal::Discard(format!(
                    "the inner step size fell to {h:e} s at t = {t} s; try a larger tolerance or smaller inputs"
                )));
            }
        }
    }

    /// One step of exactly `h` with the chosen method; gives its error estimate (0 for RK4).
    fn single(&mut self, t: f64, h: f64) -> Result<f64, Refusal> {
        let (dopri, tolerance) = (self.dopri, self.tolerance);
        let mut k = std::mem::take(&mut self.work.k);
        let mut stage = std::mem::take(&mut self.work.stage);
        let x0 = std::mem::take(&mut self.work.x0);
        let mut x1 = std::mem::take(&mut self.work.x1);
        let result = {
            let f = right_hand_side!(self);
            if dopri {
                dopri5(f, t, h, tolerance, &x0, &mut x1, &mut k, &mut stage)
            } else {
                rk4(f, t, h, &x0, &mut x1, &mut k, &mut stage).map(|()| 0.0)
            }
        };
        self.work.k = k;
        self.work.stage = stage;
        self.work.x0 = x0;
        self.work.x1 = x1;
        result
    }

    fn check_finite(&self, t: f64) -> Outcome {
        match self.work.x1.iter().position(|x| !x.is_finite()) {
            None => Ok(()),
            Some(i) => {
                let table = &self.definition.table;
                let name = &table.variables()[table.index_of(table.states()[i])].name;
                Err(Refusal::Discard(format!(
                    "the state `{name}` became {} at t = {t} s; try a smaller step",
                    self.work.x1[i]
                )))
            }
        }
    }

    /// Event indicators of the state at the start or end of the inner step.
    fn indicators(&mut self, t: f64, side: Side) -> Outcome {
        self.values.time = t;
        if self.ramped {
            let n = self.inputs.len();
            set_inputs(self.values, self.inputs, &self.work.inputs, self.rates, n, t - self.start);
        }
        let (x, z) = match side {
            Side::Start => (&self.work.x0, &mut self.work.z0),
            Side::End => (&self.work.x1, &mut self.work.z1),
        };
        for (x, state) in x.iter().zip(self.definition.table.states()) {
            self.values[*state] = *x;
        }
        self.definition.model.equations(self.values)?;
        self.definition.model.event_indicators(self.values, z);
        Ok(())
    }

    /// An indicator changed between the domains z > 0 and z <= 0 (FMI 2.0, section 3.1.1).
    fn crossed(&self) -> bool {
        self.work.z0.iter().zip(&self.work.z1).any(|(a, b)| (*a > 0.0) != (*b > 0.0))
    }

    /// Time of the first crossing in `(t0, t1]`; leaves the state just behind it in `x1`.
    fn locate(&mut self, t0: f64, t1: f64) -> Result<f64, Refusal> {
        let (mut before, mut behind) = (t0, t1);
        let width = |t: f64| 4.0 * f64::EPSILON * t.abs().max(t1 - t0);
        while behind - before > width(behind) {
            let middle = before + (behind - before) / 2.0;
            if middle <= before || middle >= behind {
                break;
            }
            self.single(t0, middle - t0)?;
            self.indicators(middle, Side::End)?;
            if self.crossed() {
                behind = middle;
            } else {
                before = middle;
            }
        }
        self.single(t0, behind - t0)?;
        self.indicators(behind, Side::End)?;
        Ok(behind)
    }

    /// The end of the inner step becomes the start of the next and the present state of the instance.
    fn accept(&mut self, t: f64) {
        std::mem::swap(&mut self.work.x0, &mut self.work.x1);
        std::mem::swap(&mut self.work.z0, &mut self.work.z1);
        self.values.time = t;
        if self.ramped {
            let n = self.inputs.len();
            set_inputs(self.values, self.inputs, &self.work.inputs, self.rates, n, t - self.start);
        }
        for (x, state) in self.work.x0.iter().zip(self.definition.table.states()) {
            self.values[*state] = *x;
        }
    }
}
