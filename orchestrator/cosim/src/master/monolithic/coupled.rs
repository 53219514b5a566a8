//! Model Exchange instances of all components as one problem: right-hand side, event indicators, event iteration.
//!
//! The times of events and the recording are left to [`super`].

use std::ops::Range;

use super::integrate::Problem;
use crate::master::exchange::{Wiring, slot};
use crate::master::initialize::enter_initialization;
use crate::master::propagation::{self, LoopFailure, Scope, Transfer};
use crate::master::{Algorithm, Error, Settings, Values};
use crate::results::{Column, Slot};
use crate::system::SystemGraph;
use crate::system::graph::{DataType, Source};
use airloop_fmi::{Error as FmuError, Model, Status, VariableKind};

/// Rounds of an event iteration, beyond which it counts as endless.
const MOST_ROUNDS: u32 = 100;

/// A system input between two of its samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ramp {
    /// Index of the system input.
    pub input: usize,
    /// Value at the beginning, then factors of the elapsed time \[s\], its square and its cube.
    pub coefficients: [f64; 4],
}

impl Ramp {
    /// Value when `elapsed` \[s\] have passed.
    pub fn at(&self, elapsed: f64) -> f64 {
        let [value, slope, square, cube] = self.coefficients;
        value + ((cube * elapsed + square) * elapsed + slope) * elapsed
    }
}

/// Outcome of an event.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Event {
    /// Continuous time goes on.
    Done,
    /// A component wants the end of the simulation.
    Terminated { component: String },
}

/// All instances at one time.
#[derive(Debug)]
pub(super) struct Coupled {
    /// In evaluation order.
    pub models: Vec<Model>,
    /// Place of the states and of the indicators of each model.
    states: Vec<Range<usize>>,
    indicators: Vec<Range<usize>>,
    wiring: Wiring,
    pub values: Values,
    /// See [`Scope`].
    rates: Vec<Transfer>,
    results: Vec<Transfer>,
    all: Vec<Transfer>,
    /// Values that inputs of components depend on.
    passed_on: Vec<Slot>,
    before: Vec<u64>,
    /// System inputs with data, and the time \[s\] at which the ramps begin.
    ramps: Vec<Ramp>,
    since: f64,
    /// System inputs that feed a variable which can only be set at events.
    for_events: Vec<bool>,
    /// Time \[s\] of the next time event, and the model that wants it.
    pub next_event: Option<(f64, usize)>,
    /// Addition to each rate, `[state_count]`; empty: none.
    added: Vec<f64>,
    /// The model that asked for an event or the end after a step.
    pub wants_event: Option<usize>,
    pub wants_end: Option<usize>,
}

impl Coupled {
    /// Instantiates and initializes all components; they are then in event mode, and [`Coupled::event`] is next.
    pub fn new(graph: &SystemGraph, settings: &Settings, ramps: Vec<Ramp>) -> Result<Coupled, Error> {
        let wiring = Wiring::new(graph, settings.read_all_outputs);
        let mut values = wiring.initial_values(graph);
        ramps.iter().for_each(|ramp| values.set(wiring.inputs[ramp.input], ramp.at(0.0)));
        let mut models = Vec::with_capacity(graph.components.len());
        for &index in &graph.order {
            let component = &graph.components[index];
            let mut model = Model::instantiate(&component.fmu, &component.name, false)?;
            enter_initialization(&mut model, component, settings)?;
            models.push(model);
        }
        propagation::settle(graph, &wiring, &mut models, &mut values, settings.start_time)?;
        for model in &mut models {
            model.exit_initialization_mode()?;
        }
        let build = |scope| propagation::transfers(graph, &wiring, scope);
        let (rates, results, all) = (build(Scope::Rates), build(Scope::Results), build(Scope::All));
        let connected =
            graph.connections.iter().filter(|connection| matches!(connection.source, Source::Output { .. }));
        let passed_on: Vec<Slot> = connected
            .filter_map(|connection| {
                let owner = &graph.components[connection.component].fmu.description;
                slot(DataType::of(&owner.variables[connection.variable]), wiring.index_of(connection.source))
            })
            .collect();
        let coupled = Coupled {
            states: ranges(&models, Model::state_count),
            indicators: ranges(&models, |model| model.fmu().description.number_of_event_indicators),
            models,
            wiring,
            values,
            rates,
            results,
            all,
            before: vec![0; passed_on.len()],
            passed_on,
            ramps,
            since: settings.start_time,
            for_events: propagation::inputs_for_events(graph),
            next_event: None,
            added: Vec::new(),
            wants_event: None,
            wants_end: None,
        };
        Ok(coupled)
    }

    /// Runs one of the schedules.
    fn pass(&mut self, schedule: impl Fn(&mut Coupled) -> &mut Vec<Transfer>) -> Result<(), LoopFailure> {
        let mut transfers = std::mem::take(schedule(self));
        let outcome =
            transfers.iter_mut().try_for_each(|transfer| transfer.run(&mut self.models, &mut self.values));
        *schedule(self) = transfers;
        outcome
    }

    /// New ramps of the system inputs from `time` \[s\] on; whether that is an event: a value jumps, or feeds a
    /// variable that can only be set at events.
    pub fn set_ramps(&mut self, ramps: Vec<Ramp>, time: f64) -> bool {
        let old = std::mem::replace(&mut self.ramps, ramps);
        let elapsed = time - self.since;
        self.since = time;
        let jumps = |(old, new): (&Ramp, &Ramp)| {
            let (before, after) = (old.at(elapsed), new.at(0.0));
            (before - after).abs() > 1e-12 * before.abs().max(after.abs())
        };
        let discrete = |ramp: &Ramp| self.for_events[ramp.input];
        old.iter().zip(&self.ramps).any(jumps) || self.ramps.iter().any(discrete)
    }

    /// Values of the system inputs at `time` \[s\].
    pub fn apply_inputs(&mut self, time: f64) {
        for ramp in &self.ramps {
            self.values.set(self.wiring.inputs[ramp.input], ramp.at(time - self.since));
        }
    }

    /// Overwrites the value of a system input in the next row of the result.
    pub fn show_input(&mut self, input: usize, value: f64) {
        self.values.set(self.wiring.inputs[input], value);
    }

    /// Algebraic loops and how they are solved, one sentence each.
    pub fn notes(&self) -> Vec<String> {
        let loops = self.all.iter().filter_map(|transfer| match transfer {
            Transfer::Loop(algebraic) => Some(algebraic.notes(&self.models)),
            _ => None,
        });
        loops.flatten().collect()
    }

    /// Columns for a recorder.
    pub fn columns(&self, graph: &SystemGraph) -> Vec<Column> {
        self.wiring.columns(graph, Algorithm::Monolithic)
    }

    /// Reads all outputs at the present time.
    pub fn read_results(&mut self, graph: &SystemGraph, time: f64) -> Result<(), Error> {
        self.pass(|coupled| &mut coupled.results).map_err(|failure| failure.at(time))?;
        match self.values.reals.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(index) => {
                let path = self.wiring.name_of(Some(Slot::Real(index)), graph);
                let (component, variable) = path.split_once('.').unwrap_or(("", &path));
                let (component, variable) = (component.to_owned(), variable.to_owned());
                Err(Error::NotFinite { component, variable, value: self.values.reals[index], time })
            }
        }
    }

    /// Moves all components to `time` \[s\] and `x` without evaluating them.
    fn move_to(&mut self, time: f64, x: &[f64]) -> Result<(), FmuError> {
        for (model, states) in self.models.iter_mut().zip(&self.states) {
            model.set_time(time)?;
            if !states.is_empty() {
                model.set_continuous_states(&x[states.clone()])?;
            }
        }
        self.apply_inputs(time);
        Ok(())
    }

    /// An event at `time` \[s\]: from continuous time through event mode and back; the states may have new values.
    pub fn event(&mut self, graph: &SystemGraph, time: f64, x: &mut [f64]) -> Result<Event, Error> {
        self.move_to(time, x)?;
        for model in &mut self.models {
            model.enter_event_mode()?;
        }
        self.iterate(graph, time, x)
    }

    /// Event iteration over the whole system, from event mode to continuous time.
    pub fn iterate(&mut self, graph: &SystemGraph, time: f64, x: &mut [f64]) -> Result<Event, Error> {
        self.apply_inputs(time);
        (self.wants_event, self.wants_end) = (None, None);
        let mut rounds = 0;
        loop {
            self.pass(|coupled| &mut coupled.all).map_err(|failure| failure.at(time))?;
            self.remember_passed_on();
            let mut needed = None;
            self.next_event = None;
            for (index, model) in self.models.iter_mut().enumerate() {
                let info = model.new_discrete_states()?;
                if info.terminate_simulation {
                    return Ok(Event::Terminated { component: model.name().to_owned() });
                }
                if info.new_discrete_states_needed {
                    needed = Some(index);
                }
                let next = info
                    .next_event_time
                    .filter(|next| self.next_event.is_none_or(|(known, _)| *next < known));
                self.next_event = next.map(|next| (next, index)).or(self.next_event);
            }
            self.pass(|coupled| &mut coupled.all).map_err(|failure| failure.at(time))?;
            let changed = self.changed_since();
            if needed.is_none() && changed.is_none() {
                break;
            }
            rounds += 1;
            if rounds == MOST_ROUNDS {
                let cause = match (needed, changed) {
                    (Some(index), _) => {
                        format!("component `{}` asks for another round", self.models[index].name())
                    }
                    (None, slot) => format!("`{}` changes in every round", self.wiring.name_of(slot, graph)),
                };
                return Err(Error::EventIteration { time, rounds, cause });
            }
        }
        for (model, states) in self.models.iter_mut().zip(&self.states) {
            model.enter_continuous_time_mode()?;
            if !states.is_empty() {
                model.get_continuous_states(&mut x[states.clone()])?;
            }
        }
        Ok(Event::Done)
    }

    fn bits(&self, slot: Slot) -> u64 {
        match slot {
            Slot::Real(index) => self.values.reals[index].to_bits(),
            Slot::Integer(index) => self.values.integers[index].cast_unsigned(),
            Slot::Boolean(index) => u64::from(self.values.booleans[index]),
        }
    }

    fn remember_passed_on(&mut self) {
        for index in 0..self.passed_on.len() {
            self.before[index] = self.bits(self.passed_on[index]);
        }
    }

    fn changed_since(&self) -> Option<Slot> {
        self.passed_on
            .iter()
            .zip(&self.before)
            .find(|(slot, bits)| self.bits(**slot) != **bits)
            .map(|(slot, _)| *slot)
    }

    /// State derivatives where the instances stand, in event mode, into `dx`, `[n]`.
    pub fn rates_at_event(&mut self, dx: &mut [f64]) -> Result<(), LoopFailure> {
        self.pass(|coupled| &mut coupled.all)?;
        self.rates_of_models(dx)
    }

    /// State derivatives where the instances stand, with what is added to them, into `dx`, `[n]`.
    fn rates_of_models(&mut self, dx: &mut [f64]) -> Result<(), LoopFailure> {
        for (model, states) in self.models.iter_mut().zip(&self.states) {
            if !states.is_empty() {
                model.get_derivatives(&mut dx[states.clone()])?;
            }
        }
        dx.iter_mut().zip(&self.added).for_each(|(rate, added)| *rate += added);
        Ok(())
    }

    /// Adds a value to the rate of a state from now on.
    pub fn add_to_rate(&mut self, state: usize, value: f64) {
        self.added.resize(self.state_count(), 0.0);
        self.added[state] = value;
    }

    /// The states that the instances have, into `x`, `[n]`.
    pub fn states_of_models(&mut self, x: &mut [f64]) -> Result<(), FmuError> {
        for (model, states) in self.models.iter_mut().zip(&self.states) {
            if !states.is_empty() {
                model.get_continuous_states(&mut x[states.clone()])?;
            }
        }
        Ok(())
    }

    /// Values of the system inputs; 0 for a String.
    pub fn input_values(&self) -> Vec<f64> {
        let value = |slot: &Option<Slot>| match *slot {
            Some(Slot::Real(index)) => self.values.reals[index],
            Some(Slot::Integer(index)) => self.values.integers[index] as f64,
            Some(Slot::Boolean(index)) => f64::from(u8::from(self.values.booleans[index])),
            None => 0.0,
        };
        self.wiring.inputs.iter().map(value).collect()
    }

    /// Place of the states of a model in those of the system.
    pub fn states_of(&self, model: usize) -> Range<usize> {
        self.states[model].clone()
    }

    /// Place of a value in the buffer of its type.
    pub fn index_of(&self, source: Source) -> usize {
        self.wiring.index_of(source)
    }

    /// Nominal values of the states, `[n]`.
    pub fn nominals(&mut self, nominals: &mut [f64]) -> Result<(), FmuError> {
        for (model, states) in self.models.iter_mut().zip(&self.states) {
            if !states.is_empty() {
                model.get_nominals(&mut nominals[states.clone()])?;
            }
        }
        Ok(())
    }

    /// Number of states.
    pub fn state_count(&self) -> usize {
        self.states.last().map_or(0, |range| range.end)
    }

    /// Number of event indicators.
    pub fn indicator_count(&self) -> usize {
        self.indicators.last().map_or(0, |range| range.end)
    }

    /// Component and name of a state.
    pub fn state_name(&self, state: usize) -> (String, String) {
        let Some(index) = self.states.iter().position(|range| range.contains(&state)) else {
            return (String::new(), String::new());
        };
        let description = &self.models[index].fmu().description;
        let number = state - self.states[index].start;
        let derivative = &description.variables[description.derivatives[number].variable];
        let variable = match &derivative.kind {
            VariableKind::Real(real) => real.derivative.map(|state| &description.variables[state]),
            _ => None,
        };
        (self.models[index].name().to_owned(), variable.unwrap_or(derivative).name.clone())
    }

    /// An event indicator in words.
    pub fn indicator_name(&self, indicator: usize) -> String {
        let index = self.indicators.iter().position(|range| range.contains(&indicator)).unwrap_or(0);
        let number = indicator - self.indicators[index].start + 1;
        format!("event indicator {number} of component `{}`", self.models[index].name())
    }
}

fn ranges(models: &[Model], count: impl Fn(&Model) -> usize) -> Vec<Range<usize>> {
    let mut end = 0;
    let range = |model: &Model| {
        let start = end;
        end += count(model);
        start..end
    };
    models.iter().map(range).collect()
}

impl Problem for Coupled {
    type Error = LoopFailure;

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), LoopFailure> {
        self.move_to(t, x)?;
        self.pass(|coupled| &mut coupled.rates)?;
        self.rates_of_models(dx)
    }

    fn indicators(&mut self, z: &mut [f64]) -> Result<(), LoopFailure> {
        for (model, indicators) in self.models.iter_mut().zip(&self.indicators) {
            if !indicators.is_empty() {
                model.get_event_indicators(&mut z[indicators.clone()])?;
            }
        }
        Ok(())
    }

    fn completed(&mut self) -> Result<bool, LoopFailure> {
        for (index, model) in self.models.iter_mut().enumerate() {
            let interface = model.fmu().description.model_exchange.as_ref();
            if interface.is_some_and(|interface| interface.completed_integrator_step_not_needed) {
                continue;
            }
            let step = model.completed_integrator_step(true)?;
            if step.enter_event_mode {
                self.wants_event = Some(index);
            }
            if step.terminate_simulation {
                self.wants_end = Some(index);
            }
        }
        Ok(self.wants_event.is_some() || self.wants_end.is_some())
    }

    fn is_recoverable(error: &LoopFailure) -> bool {
        match error {
            LoopFailure::Fmu(FmuError::Call(call)) => call.status == Status::Discard,
            LoopFailure::Fmu(_) => false,
            LoopFailure::Unsolved { .. } => true,
        }
    }
}
