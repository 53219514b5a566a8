//! The components of a system at the begin of a simulation: start values, initial states, the first event.

use super::instance::PartInstance;
use super::past::Before;
use super::{Feed, Parameter, Part, Plant, Problem};
use airloop_cosim::system::graph::{Component, Start};
use airloop_fmi::Instance;

/// Places at which the rates of a component are asked for.
const PROBES: usize = 3;

impl Plant {
    /// (Re)initializes all components at `time` \[s\] with these values of parameters and the system inputs that stand
    /// in the first slots; `x`, `[nx]`, gets the states.
    ///
    /// `begin`: values of some states, `[nx]`, or no list for the start values. Where a component changes at events
    /// only, they are start values, as its first event is part of the initialization: `x` has what it made of its own,
    /// and the values of the others.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn initialize(
        &mut self,
        begin: &[Option<f64>],
        parameters: &[(Parameter, f64)],
        time: f64,
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), Problem> {
        self.initialize_after(&Before::default(), begin, parameters, time, x, block)
    }

    /// The same where something is known of the time before.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn initialize_after(
        &mut self,
        before: &Before,
        begin: &[Option<f64>],
        parameters: &[(Parameter, f64)],
        time: f64,
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), Problem> {
        self.begin(before, begin, parameters, time, x, block)?;
        if !self.probed {
            self.probed = true;
            for part in &mut self.parts {
                part.sample_time = part.next_event.map(|next| next - time);
            }
            if self.probe(time, x) || self.earlier(before, begin).count > 0 {
                self.begin(before, begin, parameters, time, x, block)?;
            }
        }
        for part in self.parts.iter().filter(|part| !part.takes_start_values()) {
            for state in part.states.clone() {
                if let Some(Some(value)) = begin.get(state) {
                    x[state] = *value;
                }
            }
        }
        self.moved = true;
        Ok(())
    }

    /// Asks the components that have time events whether their states change at events only, as those of a sampled
    /// model do: whether all rates are zero wherever the states are. Whether any was asked.
    fn probe(&mut self, time: f64, x: &[f64]) -> bool {
        let mut asked = false;
        for part in &mut self.parts {
            if part.states.is_empty() || !part.shows_events || part.next_event.is_none() {
                continue;
            }
            asked = true;
            let mut rates = vec![0.0; part.states.len()];
            let Some(model) = part.instance.equations() else { continue };
            part.only_events = (1..=PROBES).all(|round| {
                let odd = |(i, value): (usize, &f64)| {
                    value + ((7 * i + 3 * round) as f64).sin() * (1.0 + value.abs())
                };
                let states: Vec<f64> = x[part.states.clone()].iter().enumerate().map(odd).collect();
                let inputs: Vec<f64> = part.feed_values.iter().enumerate().map(odd).collect();
                let moved = model.set_time(time + 1e-6 * round as f64).is_ok()
                    && model.set_continuous_states(&states).is_ok()
                    && (inputs.is_empty() || model.set_real(&part.feed_references, &inputs).is_ok());
                moved && model.get_derivatives(&mut rates).is_ok() && rates.iter().all(|rate| *rate == 0.0)
            });
        }
        asked
    }

    /// Initializes all components; `states` as `begin` of [`Plant::initialize`].
    fn begin(
        &mut self,
        before: &Before,
        states: &[Option<f64>],
        parameters: &[(Parameter, f64)],
        time: f64,
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), Problem> {
        let earlier = self.earlier(before, states);
        let inputs = self.slots[..self.system_inputs].to_vec();
        // What a sampled component takes at its first event follows from the states of the others.
        let sampled = self.parts.iter().any(|part| part.only_events);
        // Nothing follows from what outputs were in another simulation.
        self.slots[self.system_inputs..self.extra_first].fill(0.0);
        let mut known = vec![false; self.slots.len()];
        known[..self.system_inputs].fill(true);
        for place in 0..self.parts.len() {
            let (part, component) = (&mut self.parts[place], &self.starts[place]);
            if self.initialized {
                part.instance.restart().map_err(Problem::fmu)?;
            }
            set_start_values(&mut part.instance, component)?;
            for ((_, reference), value) in parameters.iter().filter(|((owner, _), _)| *owner == place) {
                part.instance.set_real(&[*reference], &[*value]).map_err(Problem::fmu)?;
            }
            if sampled {
                for (state, reference) in part.states.clone().zip(&part.state_references) {
                    if let Some(Some(value)) = states.get(state) {
                        part.instance.set_real(&[*reference], &[*value]).map_err(Problem::fmu)?;
                    }
                }
            }
            let back = if earlier.holds(place) { earlier.count } else { 0 };
            if back > 0 {
                before.set(&mut self.slots[..self.system_inputs], back as f64);
            }
            let time = time - back as f64 * before.step;
            part.instance.setup_experiment(None, time, None).map_err(Problem::fmu)?;
            part.instance.enter_initialization_mode().map_err(Problem::fmu)?;
            match &mut part.instance {
                // A slave stays there until its inputs have their values.
                PartInstance::Stepped(own) => own.preview(time).map_err(Problem::fmu)?,
                PartInstance::Equations(model) => {
                    for (reference, value) in own_inputs(&part.feeds, &self.slots, &known) {
                        model.set_real(&[reference], &[value]).map_err(Problem::fmu)?;
                    }
                    model.exit_initialization_mode().map_err(Problem::fmu)?;
                    if !part.states.is_empty() {
                        model.get_continuous_states(&mut x[part.states.clone()]).map_err(Problem::fmu)?;
                    }
                    // States that are given hold for what others see of them, too.
                    for state in part.states.clone() {
                        x[state] = states.get(state).copied().flatten().unwrap_or(x[state]);
                    }
                    let sources = part.feeds.iter().filter_map(|feed| feed.source);
                    if sources.clone().all(|(slot, _)| known[slot]) {
                        part.show(x, &mut self.slots).map_err(Problem::fmu)?;
                        part.follow(&mut self.slots).map_err(Problem::fmu)?;
                        part.slots().for_each(|slot| known[slot] = true);
                    }
                }
            }
            // Instances leave initialization in event mode.
            part.in_event = true;
            self.slots[..self.system_inputs].copy_from_slice(&inputs);
        }
        self.initialized = true;
        // Loops begin from what their components show at their start values.
        for own in &self.loops {
            for part in &mut self.parts[own.parts.clone()] {
                part.follow(&mut self.slots).map_err(Problem::fmu)?;
            }
        }
        self.follow_past(before, &earlier, time, x, block).map_err(Problem::fmu)?;
        self.settle(time, x, block).map_err(Problem::fmu)
    }
}

impl Part {
    /// Whether its states begin at start values that are set, since its first event changes them.
    fn takes_start_values(&self) -> bool {
        self.only_events && !self.state_references.is_empty()
    }
}

/// Inputs whose sources are known, and their values in front of any block: what a component keeps of the past (the line
/// of a delay) begins with them.
fn own_inputs<'a>(
    feeds: &'a [Feed],
    slots: &'a [f64],
    known: &'a [bool],
) -> impl Iterator<Item = (u32, f64)> + 'a {
    feeds.iter().filter_map(|feed| {
        let (slot, conversion) = feed.source?;
        known[slot].then(|| (feed.reference, conversion.apply(slots[slot])))
    })
}

fn set_start_values(instance: &mut Instance, component: &Component) -> Result<(), Problem> {
    for start in &component.start_values {
        let variable = &component.fmu.description.variables[start.variable];
        let reference = [variable.value_reference];
        match &start.value {
            Start::Real(value) => instance.set_real(&reference, &[*value]),
            Start::Integer(value) => instance.set_integer(&reference, &[*value]),
            Start::Boolean(value) => instance.set_boolean(&reference, &[*value]),
            Start::String(value) => instance.set_string(&reference, &[value.as_str()]),
        }
        .map_err(Problem::fmu)?;
    }
    Ok(())
}
