//! A system of FMUs as one right-hand side with places where blocks of candidate effects can act.
//!
//! Model Exchange instances; values pass along the connections in the order of direct feed-through. A block acts on the
//! value that an input receives, so that a candidate needs no FMU of its own while the search goes on. Integration is
//! left to [`super::simulate`]. An FMU of Co-Simulation only is a sampled component: it steps from event to event, and
//! its outputs are held between them.

mod algebraic_loop;
mod assembly;
mod initialization;
mod instance;
pub mod past;
pub mod response;

use std::collections::BTreeMap;
use std::ops::Range;

use super::Problem;
use super::names::path;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Conversion, Start};
use airloop_fmi::{Causality, VariableKind};
use algebraic_loop::AlgebraicLoop;
use assembly::order;
use instance::{Pace, PartInstance};

/// Source of the value of an input of a component.
#[derive(Debug, Clone)]
struct Feed {
    reference: u32,
    /// Slot of the source; none: the start value of the input.
    source: Option<(usize, Conversion)>,
    start: f64,
    /// Attachments that act here.
    blocks: Vec<usize>,
}

/// Rate of a state to which blocks add.
#[derive(Debug)]
struct Added {
    /// Place among all states.
    state: usize,
    /// Slot of the rate, where something reads it: an accelerometer sees what is added.
    slot: Option<usize>,
    /// Attachments that act here.
    blocks: Vec<usize>,
}

/// One component.
#[derive(Debug)]
struct Part {
    instance: PartInstance,
    /// Communication step of a slave.
    pace: Pace,
    states: Range<usize>,
    /// Value references of the states; empty where their start values cannot be set.
    state_references: Vec<u32>,
    feeds: Vec<Feed>,
    feed_references: Vec<u32>,
    feed_values: Vec<f64>,
    added: Vec<Added>,
    /// Outputs that follow the states alone, and those that follow inputs: value references and first slot.
    early: (Vec<u32>, Range<usize>),
    late: (Vec<u32>, Range<usize>),
    /// Outputs that are states: slot and place among all states.
    shown: Vec<(usize, usize)>,
    /// Time of its next event \[s\].
    next_event: Option<f64>,
    /// Time from its first event to the next \[s\], where it has some.
    sample_time: Option<f64>,
    /// It wants to hear of every accepted step.
    told_of_steps: bool,
    /// Its outputs that something reads change at events only, if its states do.
    shows_events: bool,
    /// Its states, if any, and its outputs that something reads change at events only.
    only_events: bool,
    /// Event indicators: their number, and whether each was positive after the last event.
    indicators: usize,
    positive: Vec<bool>,
    /// It is in event mode.
    in_event: bool,
}

/// A parameter of the system: component in evaluation order and value reference.
pub type Parameter = (usize, u32);

/// The instances and the values that pass between them.
#[derive(Debug)]
pub struct Plant {
    parts: Vec<Part>,
    starts: Vec<Component>,
    /// Values: system inputs first, then outputs.
    pub slots: Vec<f64>,
    /// Number of system inputs, which have the first slots.
    system_inputs: usize,
    /// First slot of the further signals.
    pub extra_first: usize,
    names: BTreeMap<String, usize>,
    states: BTreeMap<String, usize>,
    /// Number of states.
    pub nx: usize,
    initialized: bool,
    /// Whether it is known which components change at events only.
    probed: bool,
    /// The states were set from outside: components that change at events only have not seen them.
    moved: bool,
    /// Step of the samples that slaves keep pace with \[s\].
    sample_step: f64,
    /// Blocks follow what slaves show, so that these step more finely than the samples.
    couples_slaves: bool,
    /// Algebraic loops.
    loops: Vec<AlgebraicLoop>,
}

impl Plant {
    /// Slot of a signal.
    pub fn slot(&self, name: &str) -> Option<usize> {
        self.names.get(name).copied()
    }

    /// Place of a state.
    pub fn state(&self, name: &str) -> Option<usize> {
        self.states.get(name).copied()
    }

    /// Names of the states in their order: that of the system where it has one.
    pub fn states_by_place(&self) -> Vec<String> {
        let mut found = vec![String::new(); self.nx];
        for (name, &place) in &self.states {
            let own = &mut found[place];
            // Of several names the one that is a signal, then the shortest.
            let better = own.is_empty()
                || (self.names.contains_key(name), std::cmp::Reverse(name.len()))
                    > (self.names.contains_key(own), std::cmp::Reverse(own.len()));
            if better {
                own.clone_from(name);
            }
        }
        found
    }

    /// Names of the slaves: components that step by themselves.
    pub fn slaves(&self) -> Vec<&str> {
        let own = self.parts.iter().filter(|part| part.instance.is_stepped());
        own.map(|part| part.instance.name()).collect()
    }

    /// Communication step of the slaves \[s\], the longest of them; none where there are none.
    pub fn communication_step(&self) -> Option<f64> {
        let own = self.parts.iter().filter(|part| part.instance.is_stepped());
        own.map(|part| part.pace.step(self.sample_step, self.couples_slaves)).max_by(f64::total_cmp)
    }

    /// Says the step of the samples \[s\], which slaves keep pace with from the next initialization on, and whether
    /// blocks follow what slaves show.
    pub fn keep_pace(&mut self, step: f64, coupled: bool) {
        self.sample_step = step;
        self.couples_slaves = coupled;
    }

    /// Names of all signals, for messages.
    pub fn signal_names(&self) -> String {
        self.names.keys().take(30).cloned().collect::<Vec<_>>().join(", ")
    }

    /// Names of all states, for messages.
    pub fn state_names(&self) -> String {
        if self.states.is_empty() {
            return "none".into();
        }
        self.states.keys().take(30).cloned().collect::<Vec<_>>().join(", ")
    }

    /// A Real parameter by name, with its start value and least and largest value.
    pub fn parameter(graph: &SystemGraph, name: &str) -> Option<(Parameter, f64, (f64, f64))> {
        let (component, variable) = path(graph, name)?;
        let declared = &graph.components[component].fmu.description.variables[variable];
        let VariableKind::Real(real) = &declared.kind else { return None };
        if declared.causality != Causality::Parameter {
            return None;
        }
        let set = graph.components[component].start_values.iter().find(|s| s.variable == variable);
        let value = match set.map(|s| &s.value) {
            Some(Start::Real(value)) => *value,
            _ => real.start?,
        };
        let place = order(graph).iter().position(|&index| index == component)?;
        let bounds = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
        Some(((place, declared.value_reference), value, bounds))
    }

    /// Sets the system inputs, in their order, to sample `k` of those that have values.
    pub fn set_inputs(&mut self, inputs: &[Option<Vec<f64>>], k: usize) {
        for (slot, values) in self.slots.iter_mut().zip(inputs) {
            if let Some(values) = values {
                *slot = values[k];
            }
        }
    }

    /// Says that the states were set from outside.
    pub fn moved(&mut self) {
        self.moved = true;
    }

    /// Whether no component has state events, and none is in an algebraic loop.
    pub fn is_smooth(&self) -> bool {
        self.loops.is_empty() && !self.has_state_events()
    }

    /// Whether the states rest between events.
    pub fn rests(&self) -> bool {
        self.parts.iter().all(|part| part.states.is_empty() || part.only_events)
    }

    /// Time of the next event \[s\].
    pub fn next_event(&self) -> Option<f64> {
        self.parts.iter().filter_map(|part| part.next_event).min_by(f64::total_cmp)
    }

    /// Whether components have state events.
    pub fn has_state_events(&self) -> bool {
        self.parts.iter().any(|part| part.indicators > 0)
    }

    /// Whether an event indicator has another sign than after the last event, where the system was evaluated last.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn crossed(&mut self) -> Result<bool, airloop_fmi::Error> {
        for part in self.parts.iter_mut().filter(|part| part.indicators > 0) {
            let Some(model) = part.instance.equations() else { continue };
            let mut values = vec![0.0; part.indicators];
            model.get_event_indicators(&mut values)?;
            if values.iter().zip(&part.positive).any(|(value, positive)| (*value > 0.0) != *positive) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The events of `time` \[s\], one component after the other; they may change the states `x`, `[nx]`. `state`: a
    /// state event, which concerns all components that have some; else those whose time has come.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn event(
        &mut self,
        (time, state): (f64, bool),
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        for part in &mut self.parts {
            let is_due = part.next_event.is_some_and(|next| next <= time) || state && part.indicators > 0;
            match &mut part.instance {
                PartInstance::Stepped(own) if is_due => own.advance(time)?,
                PartInstance::Stepped(_) => {}
                PartInstance::Equations(model) => {
                    model.set_time(time)?;
                    if !part.states.is_empty() {
                        model.set_continuous_states(&x[part.states.clone()])?;
                    }
                    if is_due {
                        model.enter_event_mode()?;
                    }
                }
            }
            part.in_event = is_due;
        }
        self.settle(time, x, block)
    }

    /// Event iterations of the components whose event is due, which are in event mode.
    fn settle(
        &mut self,
        time: f64,
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        let (slots, pace) = (&mut self.slots, (self.sample_step, self.couples_slaves));
        for part in &mut self.parts {
            part.show(x, slots)?;
        }
        // Events of components in a loop change what the others get: solved before them and after.
        for own in &mut self.loops {
            own.solve(&mut self.parts, slots, block)?;
        }
        for part in &mut self.parts {
            if let PartInstance::Stepped(own) = &part.instance {
                // Between its communication points a slave keeps the inputs that it has.
                if part.in_event {
                    part.in_event = false;
                    part.next_event = (!own.has_ended()).then(|| time + part.pace.step(pace.0, pace.1));
                    part.feed(slots, block)?;
                    part.instance.stepped().map_or(Ok(()), |own| own.take_inputs())?;
                    part.show(x, slots)?;
                }
                continue;
            }
            part.settle((time, x), slots, block)?;
        }
        for own in &mut self.loops {
            own.solve(&mut self.parts, slots, block)?;
        }
        Ok(())
    }

    /// Tells the components that want to know of an accepted step.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn step_done(&mut self) -> Result<(), airloop_fmi::Error> {
        for part in self.parts.iter_mut().filter(|part| part.told_of_steps) {
            part.instance
                .equations()
                .map_or(Ok(()), |model| model.completed_integrator_step(true).map(drop))?;
        }
        Ok(())
    }

    /// Derivatives `dx`, `[nx]`, and all outputs (in [`Plant::slots`]) at `time` \[s\] for the states `x`, `[nx]`; the
    /// system inputs stand in the first slots. `block(attachment, value, slots)` gives the value behind an attachment.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn evaluate(
        &mut self,
        time: f64,
        x: &[f64],
        dx: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        let (slots, all) = (&mut self.slots, std::mem::take(&mut self.moved));
        let changes = |part: &&mut Part| all || !part.only_events;
        for part in self.parts.iter_mut().filter(changes) {
            if let Some(model) = part.instance.equations() {
                model.set_time(time)?;
                if !part.states.is_empty() {
                    model.set_continuous_states(&x[part.states.clone()])?;
                }
            }
            part.show(x, slots)?;
        }
        let mut loops = self.loops.iter_mut().peekable();
        let mut solved = 0;
        for place in 0..self.parts.len() {
            if let Some(own) = loops.next_if(|own| own.parts.start == place) {
                own.solve(&mut self.parts, slots, block)?;
                solved = own.parts.end;
            }
            let part = &mut self.parts[place];
            if part.instance.stepped().is_some() || !all && part.only_events {
                continue;
            }
            // The solution of a loop has set the inputs of its components.
            if place >= solved {
                part.feed(slots, block)?;
                part.follow(slots)?;
            }
            if let Some(model) = part.instance.equations().filter(|_| !part.states.is_empty()) {
                model.get_derivatives(&mut dx[part.states.clone()])?;
            }
            for own in &part.added {
                let value = own.blocks.iter().fold(0.0, |value, &own| block(own, value, slots));
                dx[own.state] += value;
                if let Some(slot) = own.slot {
                    slots[slot] += value;
                }
            }
        }
        Ok(())
    }
}

impl Part {
    /// Takes its inputs, ends its event, if it is in one, and takes its outputs.
    fn settle(
        &mut self,
        (time, x): (f64, &mut [f64]),
        slots: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        self.feed(slots, block)?;
        let Some(model) = self.instance.equations() else { return Ok(()) };
        if self.in_event {
            let mut event = model.new_discrete_states()?;
            while event.new_discrete_states_needed {
                event = model.new_discrete_states()?;
            }
            // An event that stays where it is would never end.
            self.next_event = event.next_event_time.filter(|next| *next > time);
            model.enter_continuous_time_mode()?;
            self.in_event = false;
            if self.indicators > 0 {
                let mut values = vec![0.0; self.indicators];
                model.get_event_indicators(&mut values)?;
                self.positive = values.into_iter().map(|value| value > 0.0).collect();
            }
            if !self.states.is_empty() {
                model.get_continuous_states(&mut x[self.states.clone()])?;
            }
            self.show(x, slots)?;
        }
        self.follow(slots)
    }

    /// Takes the outputs that follow the states alone.
    fn show(&mut self, x: &[f64], slots: &mut [f64]) -> Result<(), airloop_fmi::Error> {
        for &(slot, state) in &self.shown {
            slots[slot] = x[state];
        }
        let early = &mut slots[self.early.1.clone()];
        match &mut self.instance {
            _ if early.is_empty() => Ok(()),
            PartInstance::Stepped(own) => {
                early.copy_from_slice(own.shown());
                Ok(())
            }
            PartInstance::Equations(model) => model.get_real(&self.early.0, early),
        }
    }

    /// Takes the outputs that follow the inputs.
    fn follow(&mut self, slots: &mut [f64]) -> Result<(), airloop_fmi::Error> {
        if self.late.0.is_empty() {
            return Ok(());
        }
        self.instance.get_real(&self.late.0, &mut slots[self.late.1.clone()])
    }

    /// Sets the inputs.
    fn feed(
        &mut self,
        slots: &[f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        if self.feeds.is_empty() {
            return Ok(());
        }
        for (feed, value) in self.feeds.iter().zip(&mut self.feed_values) {
            *value = feed.source.map_or(feed.start, |(slot, conversion)| conversion.apply(slots[slot]));
            for &attachment in &feed.blocks {
                *value = block(attachment, *value, slots);
            }
        }
        self.instance.set_real(&self.feed_references, &self.feed_values)
    }
}
