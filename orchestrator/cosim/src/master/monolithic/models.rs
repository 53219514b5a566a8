//! A system as one differential equation whose integrator is somebody else's: Model Exchange of a whole system.

use std::collections::HashMap;

use super::coupled::{Coupled, Event, Ramp};
use super::integrate::Problem;
use crate::master::embedded::{
    Place, Value, exchanged_value, positions, put_instance, put_reals, put_values, read_variable, source_of,
    take_instance, take_reals, take_values,
};
use crate::master::exchange::slot;
use crate::master::propagation::LoopFailure;
use crate::master::{Error, Settings};
use crate::system::SystemGraph;
use crate::system::graph::Source;
use airloop_fmi::{Causality, Variability, Variable, VariableKind};

/// Outcome of an event iteration.
#[derive(Debug, Clone, PartialEq)]
pub struct EventReport {
    /// The component that asked for the end.
    pub terminated: Option<String>,
    /// The states have new values.
    pub states_changed: bool,
    /// Time \[s\] of the next time event.
    pub next_event: Option<f64>,
}

/// A derivative along one direction; see [`Models::tangent`].
#[derive(Debug, Clone, PartialEq)]
pub struct Tangent {
    /// Of the state derivatives, `[state_count]`.
    pub rates: Vec<f64>,
    /// Of the outputs of components, by (component, variable).
    values: HashMap<(usize, usize), f64>,
}

impl Tangent {
    /// Of a value; `None` for variables that are no outputs. Discrete values do not change.
    pub fn of(&self, graph: &SystemGraph, place: Place, inputs: &[f64]) -> Option<f64> {
        match (place, source_of(graph, place)) {
            (_, Ok((source, _, conversion))) => Some(conversion.factor * self.of_source(source, inputs)),
            (_, Err((component, variable))) => {
                let own = &graph.components[component].fmu.description.variables[variable];
                let known = self.values.get(&(component, variable)).copied();
                known.or((own.causality == Causality::Output).then_some(0.0))
            }
        }
    }

    fn of_source(&self, source: Source, inputs: &[f64]) -> f64 {
        match source {
            Source::Input(input) => inputs[input],
            Source::Output { component, variable } => {
                self.values.get(&(component, variable)).copied().unwrap_or(0.0)
            }
        }
    }
}

/// Whether a variable has derivatives.
fn is_smooth(variable: &Variable) -> bool {
    matches!(variable.kind, VariableKind::Real(_)) && variable.variability == Variability::Continuous
}

/// Purpose of the last evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
enum Fresh {
    Nothing,
    Derivatives,
    Results,
}

/// All Model Exchange instances of a system.
#[derive(Debug)]
pub struct Models {
    pub(super) coupled: Coupled,
    positions: Vec<usize>,
    time: f64,
    pub(super) x: Vec<f64>,
    dx: Vec<f64>,
    /// Value of each system input.
    pub(super) inputs: Vec<f64>,
    fresh: Fresh,
    /// The instances are in continuous-time mode.
    continuous: bool,
}

impl Models {
    /// Instantiates and initializes all components; they are then in event mode. `inputs`: the value of every system
    /// input, as [`super::super::Master::set_input`] takes it, `None` for that of the start.
    ///
    /// # Errors
    /// An FMU that fails, or initial values that do not settle.
    pub fn new(graph: &SystemGraph, settings: &Settings, inputs: &[(usize, f64)]) -> Result<Models, Error> {
        let ramp = |&(input, value): &(usize, f64)| Ramp { input, coefficients: [value, 0.0, 0.0, 0.0] };
        let mut coupled = Coupled::new(graph, settings, inputs.iter().map(ramp).collect())?;
        let mut x = vec![0.0; coupled.state_count()];
        coupled.states_of_models(&mut x)?;
        let mut all = coupled.input_values();
        inputs.iter().for_each(|&(input, value)| all[input] = value);
        let (time, dx) = (settings.start_time, x.clone());
        let positions = positions(graph);
        Ok(Models { coupled, positions, time, x, dx, inputs: all, fresh: Fresh::Nothing, continuous: false })
    }

    /// Sets a system input from now on.
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.inputs[input] = value;
        self.follow_inputs();
    }

    fn follow_inputs(&mut self) {
        let ramp = |(input, &value): (usize, &f64)| Ramp { input, coefficients: [value, 0.0, 0.0, 0.0] };
        let ramps = self.inputs.iter().enumerate().map(ramp).collect();
        self.coupled.set_ramps(ramps, self.time);
        self.fresh = Fresh::Nothing;
    }

    /// Adds a value to the rate of a state from now on, in the unit of the rate; `state` is below
    /// [`Models::state_count`].
    pub fn add_to_rate(&mut self, state: usize, value: f64) {
        self.coupled.add_to_rate(state, value);
        self.fresh = Fresh::Nothing;
    }

    /// Moves to a time \[s\].
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
        self.fresh = Fresh::Nothing;
    }

    /// Number of states.
    pub fn state_count(&self) -> usize {
        self.x.len()
    }

    /// Number of event indicators.
    pub fn indicator_count(&self) -> usize {
        self.coupled.indicator_count()
    }

    /// Moves to other states, `[state_count]`.
    pub fn set_states(&mut self, x: &[f64]) {
        self.x.copy_from_slice(x);
        self.fresh = Fresh::Nothing;
    }

    /// The states, `[state_count]`.
    pub fn states(&self) -> &[f64] {
        &self.x
    }

    /// State derivatives, `[state_count]`.
    ///
    /// # Errors
    /// An FMU refuses, or an algebraic loop has no solution.
    pub fn derivatives(&mut self) -> Result<&[f64], Error> {
        if self.fresh == Fresh::Nothing {
            self.evaluate().map_err(|failure| failure.at(self.time))?;
        }
        Ok(&self.dx)
    }

    fn evaluate(&mut self) -> Result<(), LoopFailure> {
        if self.continuous {
            self.coupled.derivatives(self.time, &self.x, &mut self.dx)?;
        } else {
            self.coupled.rates_at_event(&mut self.dx)?;
        }
        self.fresh = Fresh::Derivatives;
        Ok(())
    }

    /// Event indicators, `[indicator_count]`.
    ///
    /// # Errors
    /// Same as [`Models::derivatives`].
    pub fn indicators(&mut self, z: &mut [f64]) -> Result<(), Error> {
        self.derivatives()?;
        self.coupled.indicators(z).map_err(|failure| failure.at(self.time))
    }

    /// Nominal values of the states, `[state_count]`.
    ///
    /// # Errors
    /// An FMU refuses.
    pub fn nominals(&mut self, nominals: &mut [f64]) -> Result<(), Error> {
        Ok(self.coupled.nominals(nominals)?)
    }

    /// An integrator step ended here: whether it wants an event, and the component that wants the end.
    ///
    /// # Errors
    /// An FMU refuses.
    pub fn completed(&mut self) -> Result<(bool, Option<String>), Error> {
        self.derivatives()?;
        let wanted = self.coupled.completed().map_err(|failure| failure.at(self.time))?;
        let end = self.coupled.wants_end.map(|model| self.coupled.models[model].name().to_owned());
        Ok((wanted && end.is_none(), end))
    }

    /// Event iteration at the present point, from event mode or from continuous time; then continuous time.
    ///
    /// # Errors
    /// An FMU refuses, or the iteration does not end.
    pub fn event(&mut self, graph: &SystemGraph) -> Result<EventReport, Error> {
        let before = self.x.clone();
        let event = match self.continuous {
            true => self.coupled.event(graph, self.time, &mut self.x)?,
            false => self.coupled.iterate(graph, self.time, &mut self.x)?,
        };
        let terminated = match event {
            Event::Done => {
                self.continuous = true;
                None
            }
            Event::Terminated { component } => Some(component),
        };
        self.fresh = Fresh::Nothing;
        let next_event = self.coupled.next_event.map(|(time, _)| time);
        Ok(EventReport { terminated, states_changed: before != self.x, next_event })
    }

    /// A value at the present point.
    ///
    /// # Errors
    /// Same as [`Models::derivatives`].
    pub fn read(&mut self, graph: &SystemGraph, place: Place) -> Result<Value, Error> {
        if let Place::Input(_) = place {
            self.coupled.apply_inputs(self.time);
        } else if self.fresh != Fresh::Results {
            self.derivatives()?;
            self.coupled.read_results(graph, self.time)?;
            self.fresh = Fresh::Results;
        }
        match source_of(graph, place) {
            Ok((source, data_type, conversion)) => {
                let index = self.coupled.index_of(source);
                Ok(exchanged_value(&self.coupled.values, slot(data_type, index), index, conversion))
            }
            Err((component, variable)) => {
                read_variable(&mut self.coupled.models[self.positions[component]], variable)
            }
        }
    }

    /// Derivative along a direction of the inputs and states, at the present point.
    ///
    /// | argument | shape | meaning |
    /// |---|---|---|
    /// | `inputs` | `[inputs of the system]` | part of the direction |
    /// | `states` | `[state_count]` | part of the direction |
    ///
    /// Exact, by the chain rule over the components, for systems without algebraic loops.
    ///
    /// # Errors
    /// An FMU refuses.
    pub fn tangent(&mut self, graph: &SystemGraph, inputs: &[f64], states: &[f64]) -> Result<Tangent, Error> {
        self.derivatives()?;
        let mut tangent = Tangent { rates: vec![0.0; self.x.len()], values: HashMap::new() };
        // Each round settles at least one more component on every path of direct feed-through.
        for _ in 0..=graph.components.len() {
            let mut changed = false;
            for &component in &graph.order {
                changed |= self.tangent_of(graph, component, inputs, states, &mut tangent)?;
            }
            if !changed {
                break;
            }
        }
        Ok(tangent)
    }

    /// Passes one component; whether one of its outputs changed.
    fn tangent_of(
        &mut self,
        graph: &SystemGraph,
        component: usize,
        inputs: &[f64],
        states: &[f64],
        tangent: &mut Tangent,
    ) -> Result<bool, Error> {
        let position = self.positions[component];
        let description = &graph.components[component].fmu.description;
        let range = self.coupled.states_of(position);
        let reference = |variable: usize| description.variables[variable].value_reference;
        let mut knowns: Vec<u32> = description.continuous_states().map(reference).collect();
        let mut seed = states[range.clone()].to_vec();
        for connection in graph.connections.iter().filter(|connection| connection.component == component) {
            if is_smooth(&description.variables[connection.variable]) {
                knowns.push(reference(connection.variable));
                let along = tangent.of_source(connection.source, inputs);
                seed.push(connection.conversion.factor * along);
            }
        }
        let state_of =
            |variable: usize| knowns[..range.len()].iter().position(|&state| state == reference(variable));
        let rates = description.derivatives.iter().map(|unknown| unknown.variable);
        let smooth = (0..description.variables.len()).filter(|&variable| {
            let own = &description.variables[variable];
            own.causality == Causality::Output && is_smooth(own)
        });
        // An output that is a state is known; FMUs answer 0 for its derivative by itself.
        let (known, outputs): (Vec<usize>, Vec<usize>) =
            smooth.partition(|&variable| state_of(variable).is_some());
        let known = known.into_iter().filter_map(|variable| Some((variable, seed[state_of(variable)?])));
        let unknowns: Vec<u32> = rates.chain(outputs.iter().copied()).map(reference).collect();
        let mut found = vec![0.0; unknowns.len()];
        if !unknowns.is_empty() && !knowns.is_empty() {
            let model = &mut self.coupled.models[position];
            model.directional_derivative(&unknowns, &knowns, &seed, &mut found)?;
        }
        let (rates, values) = found.split_at(range.len());
        tangent.rates[range.clone()].copy_from_slice(rates);
        let mut changed = false;
        for (variable, value) in outputs.iter().copied().zip(values.iter().copied()).chain(known) {
            changed |= tangent.values.insert((component, variable), value) != Some(value);
        }
        Ok(changed)
    }

    /// The state of all instances as bytes.
    ///
    /// # Errors
    /// An FMU cannot save or serialize its state.
    pub fn save(&mut self) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::new();
        let (next, model) = self.coupled.next_event.map_or((f64::NAN, 0), |(time, model)| (time, model));
        let flag = |flag: bool| f64::from(u8::from(flag));
        put_reals(&mut bytes, &[self.time, next, model as f64, flag(self.continuous)]);
        put_reals(&mut bytes, &self.x);
        put_reals(&mut bytes, &self.inputs);
        put_values(&mut bytes, &self.coupled.values);
        for model in &mut self.coupled.models {
            put_instance(&mut bytes, model)?;
        }
        Ok(bytes)
    }

    /// Returns to a saved state; `false` for bytes that are not those of [`Models::save`] of the same system.
    ///
    /// # Errors
    /// An FMU refuses its state.
    pub fn restore(&mut self, mut bytes: &[u8]) -> Result<bool, Error> {
        let bytes = &mut bytes;
        let Some([time, next, model, continuous]) =
            take_reals(bytes).and_then(|head| <[f64; 4]>::try_from(head).ok())
        else {
            return Ok(false);
        };
        let (Some(x), Some(inputs)) = (take_reals(bytes), take_reals(bytes)) else { return Ok(false) };
        let Some(values) = take_values(bytes, &self.coupled.values) else { return Ok(false) };
        if x.len() != self.x.len() || inputs.len() != self.inputs.len() {
            return Ok(false);
        }
        for model in &mut self.coupled.models {
            if !take_instance(bytes, model)? {
                return Ok(false);
            }
        }
        (self.time, self.x, self.inputs) = (time, x, inputs);
        self.coupled.values = values;
        self.continuous = continuous != 0.0;
        self.coupled.next_event = (!next.is_nan()).then_some((next, model as usize));
        (self.coupled.wants_event, self.coupled.wants_end) = (None, None);
        self.follow_inputs();
        Ok(true)
    }
}
