//! An instance under test: initialized and advanced in the same way for both interfaces, all values readable.

use std::fmt;
use std::sync::Arc;

use crate::description::{ModelDescription, VariableKind};
use crate::{Error, Fmu, Instance, InterfaceKind, Model, Slave, StepStatus};

/// More event iterations than this are taken for an endless loop.
const MAX_EVENT_ITERATIONS: usize = 100;

/// A step of the check takes at most this many steps inside of the FMU.
const MAX_INNER_STEPS: f64 = 100.0;

/// An instance and its time.
pub(super) struct Probe {
    runner: Runner,
    time: f64,
    step: f64,
    next_event: Option<f64>,
    indicators: Vec<f64>,
}

enum Runner {
    Slave(Slave),
    Model(Model),
}

/// A value, compared bit by bit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Value {
    Real(u64),
    Integer(i32),
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
        let step = step.map(|step| step.min(limit));
        let runner = match kind {
            InterfaceKind::CoSimulation => Runner::Slave(Slave::instantiate(fmu, "check", false)?),
            InterfaceKind::ModelExchange => Runner::Model(Model::instantiate(fmu, "check", false)?),
        };
        let indicators = vec![0.0; fmu.description.number_of_event_indicators];
        Ok(Probe { runner, time: start, step: step.unwrap_or(0.01), next_event: None, indicators })
    }

    pub(super) fn instance(&mut self) -> &mut Instance {
        match &mut self.runner {
            Runner::Slave(slave) => slave,
            Runner::Model(model) => model,
        }
    }

    /// The Model Exchange instance, if it is one.
    pub(super) fn model(&mut self) -> Option<&mut Model> {
        match &mut self.runner {
            Runner::Slave(_) => None,
            Runner::Model(model) => Some(model),
        }
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
        states.iter_mut().zip(&derivatives).for_each(|(state, rate)| *state += (end - self.time) * rate);
        self.time = end;
        model.set_time(end)?;
        model.set_continuous_states(&states)?;
        let before = self.indicators.clone();
        model.get_event_indicators(&mut self.indicators)?;
        let crossed =
            before.iter().zip(&self.indicators).any(|(before, after)| (*before > 0.0) != (*after > 0.0));
        let asked = model.completed_integrator_step(false)?;
        if asked.terminate_simulation {
            return Ok(Advance::Ended);
        }
        if crossed || asked.enter_event_mode || self.next_event.is_some_and(|event| event <= end) {
            model.enter_event_mode()?;
            return self.handle_events();
        }
        Ok(Advance::Done)
    }

    /// Event iteration, then continuous-time mode.
    fn handle_events(&mut self) -> Result<Advance, Error> {
        let Runner::Model(model) = &mut self.runner else { return Ok(Advance::Done) };
        for _ in 0..MAX_EVENT_ITERATIONS {
            let info = model.new_discrete_states()?;
            self.next_event = info.next_event_time;
            if info.terminate_simulation {
                return Ok(Advance::Ended);
            }
            if !info.new_discrete_states_needed {
                model.enter_continuous_time_mode()?;
                model.get_event_indicators(&mut self.indicators)?;
                return Ok(Advance::Done);
            }
        }
        Ok(Advance::EndlessEvents)
    }

    /// The values of all variables, in the order of the description.
    pub(super) fn values(&mut self) -> Result<Vec<Value>, Error> {
        let fmu = Arc::clone(self.instance().fmu());
        let instance = self.instance();
        let mut values = Vec::with_capacity(fmu.description.variables.len());
        for variable in &fmu.description.variables {
            let reference = [variable.value_reference];
            values.push(match variable.kind {
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
            });
        }
        Ok(values)
    }
}

/// The first variable that differs, with both values.
pub(super) fn difference(description: &ModelDescription, a: &[Value], b: &[Value]) -> Option<String> {
    let position = a.iter().zip(b).position(|(a, b)| a != b)?;
    let name = &description.variables[position].name;
    Some(format!("{name} is {} and {}", a[position], b[position]))
}
