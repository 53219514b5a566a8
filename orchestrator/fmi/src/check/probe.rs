//! An instance under test: initialized and advanced in the same way for both interfaces, all values readable.

use std::fmt;
use std::sync::Arc;

use crate::description::{ModelDescription, Variable, VariableKind};
use crate::{Error, Fmu, Instance, InterfaceKind, Model, Slave, StepStatus};

/// More event iterations than this are taken for an endless loop.
const MAX_EVENT_ITERATIONS: usize = 100;

/// A step of the check takes at most this many steps inside of the FMU.
const MAX_INNER_STEPS: f64 = 100.0;

/// A time is reached where less than this is left, over the step.
const TIME_ROUNDING: f64 = 1e-9;

/// A step changes a state by at most this factor.
const MAX_GROWTH: f64 = 10.0;

/// Length of a step \[s\] where the description suggests none.
const DEFAULT_STEP: f64 = 0.01;

/// So many events in a row at one time mean that time events do not go on.
const MAX_EVENTS_AT_ONE_TIME: usize = 100;

/// An instance and its time.
pub(super) struct Probe {
    runner: Runner,
    time: f64,
    step: f64,
    next_event: Option<f64>,
    /// Event iterations in a row that named their own time as that of the next event.
    events_at_once: usize,
    indicators: Vec<f64>,
    /// Faults of events so far, by rule.
    event_faults: Vec<(&'static str, String)>,
    /// Events so far.
    events: usize,
}

enum Runner {
    Slave(Slave),
    Model(Model),
}

/// A value, compared bit by bit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Value {
    Real(u64),
    Integer(i64),
    Boolean(bool),
    String(String),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Real(bits) => write!(f, "{}", f64::from_bits(*bits)),
            Value::Integer(value) => write!(f, "{value}"),
            Value::Boolean(value) => write!(f, "{value}"),
            Value::String(value) => write!(f, "\"{value}\""),
        }
    }
}

/// Outcome of an advance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Advance {
    Done,
    /// The FMU ended the simulation, as it may.
    Ended,
    /// Event iteration did not come to rest.
    EndlessEvents,
}

impl Probe {
    pub(super) fn new(fmu: &Arc<Fmu>, kind: InterfaceKind) -> Result<Self, Error> {
        let experiment = &fmu.description.default_experiment;
        let start = experiment.start.unwrap_or(0.0);
        let span = experiment.stop.map(|stop| stop - start).filter(|span| *span > 0.0);
        let step = experiment.step_size.filter(|step| *step > 0.0).or(span.map(|span| span / 100.0));
        // An FMU may take tiny steps inside and suggest an experiment of years.
        let inner = fmu.description.co_simulation.as_ref().and_then(|slave| slave.fixed_internal_step_size);
        let limit = inner.filter(|inner| *inner > 0.0).map_or(f64::INFINITY, |inner| MAX_INNER_STEPS * inner);
        let step = step.map(|step| step.min(limit).max(inner.unwrap_or(0.0)));
        let runner = match kind {
            InterfaceKind::CoSimulation => Runner::Slave(Slave::instantiate(fmu, "check", false)?),
            InterfaceKind::ModelExchange => Runner::Model(Model::instantiate(fmu, "check", false)?),
        };
        let indicators = vec![0.0; fmu.description.number_of_event_indicators];
        Ok(Probe {
            runner,
            time: start,
            step: step.unwrap_or(DEFAULT_STEP),
            next_event: None,
            events_at_once: 0,
            indicators,
            event_faults: Vec::new(),
            events: 0,
        })
    }

    pub(super) fn instance(&mut self) -> &mut Instance {
        match &mut self.runner {
            Runner::Slave(slave) => slave,
            Runner::Model(model) => model,
        }
    }

    /// The Co-Simulation instance, if it is one.
    pub(super) fn slave(&mut self) -> Option<&mut Slave> {
        match &mut self.runner {
            Runner::Slave(slave) => Some(slave),
            Runner::Model(_) => None,
        }
    }

    /// The Model Exchange instance, if it is one.
    pub(super) fn model(&mut self) -> Option<&mut Model> {
        match &mut self.runner {
            Runner::Slave(_) => None,
            Runner::Model(model) => Some(model),
        }
    }

    /// Length of a step \[s\].
    pub(super) fn step(&self) -> f64 {
        self.step
    }

    /// Another length of the steps \[s\].
    pub(super) fn set_step(&mut self, step: f64) {
        self.step = step;
    }

    /// Time \[s\].
    pub(super) fn time(&self) -> f64 {
        self.time
    }

    /// Event indicators as last read (Model Exchange).
    pub(super) fn indicators(&self) -> &[f64] {
        &self.indicators
    }

    /// Number of events so far (Model Exchange).
    pub(super) fn events(&self) -> usize {
        self.events
    }

    /// Faults of events since the last call, each by its rule.
    pub(super) fn take_event_faults(&mut self) -> Vec<(&'static str, String)> {
        std::mem::take(&mut self.event_faults)
    }

    /// Up to and into initialization mode.
    pub(super) fn begin(&mut self) -> Result<(), Error> {
        let start = self.instance().fmu().description.default_experiment.start.unwrap_or(0.0);
        self.time = start;
        self.next_event = None;
        let instance = self.instance();
        instance.setup_experiment(None, start, None)?;
        instance.enter_initialization_mode()
    }

    /// Out of initialization mode; Model Exchange goes on into continuous-time mode.
    pub(super) fn finish(&mut self) -> Result<Advance, Error> {
        self.instance().exit_initialization_mode()?;
        match self.runner {
            Runner::Slave(_) => Ok(Advance::Done),
            Runner::Model(_) => self.handle_events(),
        }
    }

    pub(super) fn initialize(&mut self) -> Result<Advance, Error> {
        self.begin()?;
        self.finish()
    }

    /// `count` communication steps, or as many explicit Euler steps with their events.
    pub(super) fn advance(&mut self, count: usize) -> Result<Advance, Error> {
        for _ in 0..count {
            let outcome = self.single_step()?;
            if outcome != Advance::Done {
                return Ok(outcome);
            }
        }
        Ok(Advance::Done)
    }

    /// Steps up to a time \[s\] (Model Exchange).
    pub(super) fn advance_to(&mut self, time: f64) -> Result<Advance, Error> {
        let step = self.step;
        let mut outcome = Advance::Done;
        let mut count = 0.0;
        while outcome == Advance::Done && time - self.time > TIME_ROUNDING * step {
            count += 1.0;
            if count > MAX_INNER_STEPS * MAX_INNER_STEPS {
                outcome = Advance::Ended;
                break;
            }
            self.step = step.min(time - self.time);
            outcome = self.single_step()?;
        }
        self.step = step;
        Ok(outcome)
    }

    /// Time, to go back to together with a saved state.
    pub(super) fn clock(&self) -> (f64, Option<f64>) {
        (self.time, self.next_event)
    }

    pub(super) fn set_clock(&mut self, (time, next_event): (f64, Option<f64>)) -> Result<(), Error> {
        (self.time, self.next_event) = (time, next_event);
        match &mut self.runner {
            Runner::Slave(_) => Ok(()),
            Runner::Model(model) => {
                model.set_time(time)?;
                model.get_event_indicators(&mut self.indicators)
            }
        }
    }

    fn single_step(&mut self) -> Result<Advance, Error> {
        let end = self.time + self.step;
        let model = match &mut self.runner {
            Runner::Slave(slave) => {
                let status = slave.do_step(self.time, self.step, false)?;
                self.time = end;
                return Ok(if status == StepStatus::Complete { Advance::Done } else { Advance::Ended });
            }
            Runner::Model(model) => model,
        };
        let mut states = vec![0.0; model.state_count()];
        let mut derivatives = states.clone();
        model.get_continuous_states(&mut states)?;
        model.get_derivatives(&mut derivatives)?;
        let end = self.next_event.map_or(end, |event| event.min(end));
        let end = end.min(self.time + bounded_step(&states, &derivatives));
        states.iter_mut().zip(&derivatives).for_each(|(state, rate)| *state += (end - self.time) * rate);
        self.time = end;
        model.set_time(end)?;
        model.set_continuous_states(&states)?;
        let before = self.indicators.clone();
        model.get_event_indicators(&mut self.indicators)?;
        if let Some(index) = self.indicators.iter().position(|indicator| !indicator.is_finite()) {
            let message = format!("event indicator {} is {} at {end} s", index + 1, self.indicators[index]);
            self.event_faults.push(("non-finite", message));
        }
        let crossed =
            before.iter().zip(&self.indicators).any(|(before, after)| (*before > 0.0) != (*after > 0.0));
        let asked = model.completed_integrator_step(false)?;
        if asked.terminate_simulation {
            return Ok(Advance::Ended);
        }
        if crossed || asked.enter_event_mode || self.next_event.is_some_and(|event| event <= end) {
            return self.event();
        }
        Ok(Advance::Done)
    }

    /// Event mode at the present time, then continuous-time mode.
    pub(super) fn event(&mut self) -> Result<Advance, Error> {
        if let Some(model) = self.model() {
            model.enter_event_mode()?;
        }
        self.handle_events()
    }

    /// Event iteration, then continuous-time mode.
    pub(super) fn handle_events(&mut self) -> Result<Advance, Error> {
        let Runner::Model(model) = &mut self.runner else { return Ok(Advance::Done) };
        self.events += 1;
        let mut states = vec![0.0; model.state_count()];
        let mut states_after = states.clone();
        model.get_continuous_states(&mut states)?;
        let mut is_jump_announced = false;
        for _ in 0..MAX_EVENT_ITERATIONS {
            let info = model.new_discrete_states()?;
            is_jump_announced |= info.values_of_continuous_states_changed;
            self.next_event = info.next_event_time;
            if info.terminate_simulation {
                return Ok(Advance::Ended);
            }
            if !info.new_discrete_states_needed {
                model.get_continuous_states(&mut states_after)?;
                model.enter_continuous_time_mode()?;
                model.get_event_indicators(&mut self.indicators)?;
                if !is_jump_announced && bits(&states).ne(bits(&states_after)) {
                    let message = format!(
                        "the event at {} s changed a continuous state, but valuesOfContinuousStatesChanged was false",
                        self.time
                    );
                    self.event_faults.push(("state-jump", message));
                }
                self.judge_next_event();
                return Ok(Advance::Done);
            }
        }
        Ok(Advance::EndlessEvents)
    }

    /// The time of the next event lies ahead; one that does not is left out.
    fn judge_next_event(&mut self) {
        let Some(next) = self.next_event else { return };
        self.events_at_once = if next == self.time { self.events_at_once + 1 } else { 0 };
        if next.is_finite() && next >= self.time && self.events_at_once < MAX_EVENTS_AT_ONE_TIME {
            return;
        }
        self.next_event = None;
        let message = if self.events_at_once > 0 {
            format!("every event at {next} s names this time as that of the next event")
        } else {
            format!(
                "the event at {} s names {next} s as time of the next event, which does not lie ahead",
                self.time
            )
        };
        self.event_faults.push(("next-event-time", message));
    }

    /// The values of all variables, in the order of the description.
    pub(super) fn values(&mut self) -> Result<Vec<Value>, Error> {
        let fmu = Arc::clone(self.instance().fmu());
        fmu.description.variables.iter().map(|variable| self.value(variable)).collect()
    }

    /// The value of a variable.
    pub(super) fn value(&mut self, variable: &Variable) -> Result<Value, Error> {
        let instance = self.instance();
        let reference = [variable.value_reference];
        Ok(match variable.kind {
            VariableKind::Real(_) => {
                let mut value = [0.0];
                instance.get_real(&reference, &mut value)?;
                Value::Real(value[0].to_bits())
            }
            VariableKind::Integer { .. } | VariableKind::Enumeration { .. } => {
                let mut value = [0];
                instance.get_integer(&reference, &mut value)?;
                Value::Integer(value[0])
            }
            VariableKind::Boolean { .. } => {
                let mut value = [false];
                instance.get_boolean(&reference, &mut value)?;
                Value::Boolean(value[0])
            }
            VariableKind::String { .. } => Value::String(instance.get_string(&reference)?.remove(0)),
        })
    }

    /// Sets a variable.
    pub(super) fn set(&mut self, variable: &Variable, value: &Value) -> Result<(), Error> {
        let instance = self.instance();
        let reference = [variable.value_reference];
        match value {
            Value::Real(bits) => instance.set_real(&reference, &[f64::from_bits(*bits)]),
            Value::Integer(value) => instance.set_integer(&reference, &[*value]),
            Value::Boolean(value) => instance.set_boolean(&reference, &[*value]),
            Value::String(value) => instance.set_string(&reference, &[value]),
        }
    }
}

fn bits(values: &[f64]) -> impl Iterator<Item = u64> + '_ {
    values.iter().map(|value| value.to_bits())
}

/// A step of the explicit Euler method that lets no state grow to more than about ten times of what it is: a stiff
/// model would leave all numbers with the steps of its experiment, which says nothing against the model.
fn bounded_step(states: &[f64], derivatives: &[f64]) -> f64 {
    let bound = |(state, rate): (&f64, &f64)| MAX_GROWTH * state.abs().max(1.0) / rate.abs();
    states.iter().zip(derivatives).map(bound).fold(f64::INFINITY, f64::min)
}

impl Value {
    /// The number, if it is a Real.
    pub(super) fn real(&self) -> Option<f64> {
        match self {
            Value::Real(bits) => Some(f64::from_bits(*bits)),
            _ => None,
        }
    }

    /// Whether both are the same number, text or truth value; zero has two representations.
    pub(super) fn equals(&self, other: &Value) -> bool {
        match (self.real(), other.real()) {
            (Some(a), Some(b)) => a == b || self == other,
            _ => self == other,
        }
    }
}

/// The first variable that differs, with both values.
pub(super) fn difference(description: &ModelDescription, a: &[Value], b: &[Value]) -> Option<String> {
    let position = a.iter().zip(b).position(|(a, b)| a != b)?;
    let name = &description.variables[position].name;
    Some(format!("{name} is {} and {}", a[position], b[position]))
}
