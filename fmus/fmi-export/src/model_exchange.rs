//! Model Exchange: time, states, derivatives, indicators, event iteration.

use crate::ctypes::{EventInfo, Status};
use crate::instance::Instance;
use crate::model::{Event, Model};
use crate::state_machine::Mode;
use crate::table::Kind;

impl<M: Model> Instance<M> {
    pub(crate) fn set_time(&mut self, time: f64) -> Status {
        if !time.is_finite() {
            return self
                .discard("fmi2SetTime", &format!("the time {time} is not finite; the old value is kept"));
        }
        self.state.values.time = time;
        self.state.dirty = true;
        Status::OK
    }

    pub(crate) fn set_continuous_states(&mut self, x: &[f64]) -> Status {
        const F: &str = "fmi2SetContinuousStates";
        let table = &self.definition.table;
        if x.len() != table.states().len() {
            return self.error(F, &format!("{} values for {} states", x.len(), table.states().len()));
        }
        if let Some(i) = x.iter().position(|x| !x.is_finite()) {
            let name = &table.variables()[table.index_of(table.states()[i])].name;
            return self
                .discard(F, &format!("`{name}`: the value {} is not finite; the old values are kept", x[i]));
        }
        for (x, state) in x.iter().zip(table.states()) {
            self.state.values[*state] = *x;
        }
        self.state.dirty = true;
        Status::OK
    }

    pub(crate) fn get_continuous_states(&mut self, x: &mut [f64]) -> Status {
        let states = self.definition.table.states();
        if x.len() != states.len() {
            return self.error(
                "fmi2GetContinuousStates",
                &format!("room for {} values, {} states", x.len(), states.len()),
            );
        }
        for (x, state) in x.iter_mut().zip(states) {
            *x = self.state.values[*state];
        }
        Status::OK
    }

    pub(crate) fn get_derivatives(&mut self, dx: &mut [f64]) -> Status {
        const F: &str = "fmi2GetDerivatives";
        let derivatives = self.definition.table.derivatives();
        if dx.len() != derivatives.len() {
            return self.error(F, &format!("room for {} values, {} states", dx.len(), derivatives.len()));
        }
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        for (dx, derivative) in dx.iter_mut().zip(derivatives) {
            *dx = self.state.values[*derivative];
        }
        Status::OK
    }

    pub(crate) fn get_event_indicators(&mut self, z: &mut [f64]) -> Status {
        const F: &str = "fmi2GetEventIndicators";
        let n = self.definition.table.number_of_event_indicators();
        if z.len() != n {
            return self.error(F, &format!("room for {} values, {n} event indicators", z.len()));
        }
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        self.definition.model.event_indicators(&self.state.values, z);
        Status::OK
    }

    pub(crate) fn get_nominals(&mut self, nominals: &mut [f64]) -> Status {
        let table = &self.definition.table;
        if nominals.len() != table.states().len() {
            return self.error(
                "fmi2GetNominalsOfContinuousStates",
                &format!("room for {} values, {} states", nominals.len(), table.states().len()),
            );
        }
        for (nominal, state) in nominals.iter_mut().zip(table.states()) {
            *nominal = match table.variables()[table.index_of(*state)].kind {
                Kind::Real { nominal: Some(n), .. } => n,
                _ => 1.0,
            };
        }
        Status::OK
    }

    pub(crate) fn enter_event_mode(&mut self) -> Status {
        self.state.mode = Mode::EventMode;
        self.state.sample_taken = false;
        let due = self.sample_is_due();
        self.state.values.at_sample = due;
        self.state.dirty |= due;
        Status::OK
    }

    /// Takes the sample that is due and handles events; may be called again after inputs changed.
    pub(crate) fn new_discrete_states(&mut self, info: &mut EventInfo) -> Status {
        const F: &str = "fmi2NewDiscreteStates";
        let before = self.state.values.time;
        let mut changed = false;
        if self.sample_is_due() {
            if self.state.sample_taken {
                self.restore_before_sample();
            } else {
                self.state.pre_real.copy_from_slice(&self.state.values.real);
                self.state.pre_memory.copy_from_slice(&self.state.values.memory);
            }
            if let Err(refusal) = self.take_sample() {
                return self.refuse(F, &refusal);
            }
            self.state.sample_taken = true;
            let states = self.definition.table.states();
            changed = states.iter().any(|s| self.state.values[*s] != self.state.pre_real[s.0 as usize]);
        }
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        let event = self.definition.model.event(&mut self.state.values);
        self.state.dirty = true;
        if event != Event::default() {
            self.log_event(before);
        }
        debug_assert_eq!(before, self.state.values.time, "an event must not move time");
        let next_sample = self.next_sample().map(
            |(next, period)| {
                if self.state.sample_taken { next + period } else { next }
            },
        );
        let next_event = self.definition.model.next_event_time(&self.state.values);
        let next = match (next_sample, next_event) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        *info = EventInfo {
            new_discrete_states_needed: i32::from(event.iterate),
            terminate_simulation: i32::from(event.terminate),
            nominals_of_continuous_states_changed: 0,
            values_of_continuous_states_changed: i32::from(changed || event.states_changed),
            next_event_time_defined: i32::from(next.is_some()),
            next_event_time: next.unwrap_or(0.0),
        };
        Status::OK
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Status {
        if self.sample_is_due() {
            // An importer that skipped fmi2NewDiscreteStates still gets its sample.
            if !self.state.sample_taken
                && let Err(refusal) = self.take_sample()
            {
                return self.refuse("fmi2EnterContinuousTimeMode", &refusal);
            }
            self.state.sample_index += 1;
        }
        self.state.sample_taken = false;
        self.state.values.at_sample = false;
        self.state.dirty = true;
        self.state.mode = Mode::ContinuousTimeMode;
        Status::OK
    }

    /// Puts states and memory back to where they were before the sample; inputs stay.
    fn restore_before_sample(&mut self) {
        for state in self.definition.table.states() {
            self.state.values[*state] = self.state.pre_real[state.0 as usize];
        }
        self.state.values.memory.copy_from_slice(&self.state.pre_memory);
    }
}
