//! Points of a run from which another process goes on, with the same numbers bit for bit.
//!
//! For the masters with a fixed communication step. Slaves are initialized at the start time as always, and then get
//! the states that were saved.

use std::collections::BTreeMap;

use super::embedded::{put_reals, put_values, set_state_of, state_of, take_reals, take_values};
use super::{Error, Master, Settings};
use crate::results::Keep;
use crate::results::states::{ComponentState, RowsSoFar, SCHEMA_VERSION, States, bytes, hex};
use crate::system::SystemGraph;
use crate::system::graph::Start;

/// Refuses components that cannot save their states.
pub(super) fn refuse(graph: &SystemGraph) -> Result<(), Error> {
    for component in &graph.components {
        let interface = component.fmu.description.co_simulation.clone().unwrap_or_default();
        let missing = match () {
            () if !interface.can_get_and_set_fmu_state => "canGetAndSetFMUstate",
            () if !interface.can_serialize_fmu_state => "canSerializeFMUstate",
            () => continue,
        };
        return Err(Error::NoSavedStates { component: component.name.clone(), missing });
    }
    Ok(())
}

/// All that two runs have in common if one can go on where the other was, by name.
pub(super) fn identity(graph: &SystemGraph, settings: &Settings, keep: &Keep) -> BTreeMap<String, String> {
    let mut run = BTreeMap::new();
    let mut put = |name: String, value: String| drop(run.insert(name, value));
    let or_none = |value: Option<f64>| value.map_or("none".to_owned(), |value| value.to_string());
    put("--start".into(), settings.start_time.to_string());
    // FMUs may keep to the stop time that they were told, and save it with their state.
    put("--stop".into(), settings.stop_time.to_string());
    put("--step".into(), settings.step_size.to_string());
    put("--master".into(), settings.algorithm.to_string());
    put("--extrapolation".into(), settings.extrapolation.to_string());
    put("--corrections".into(), settings.coupling.corrections.to_string());
    put("--iterate".into(), or_none(settings.coupling.tolerance));
    put("--inputs".into(), if settings.coupling.ramped { "ramped" } else { "held" }.to_owned());
    put("--tolerance".into(), or_none(settings.tolerance));
    put("--output-step".into(), or_none(keep.interval));
    for component in &graph.components {
        let (name, description) = (&component.name, &component.fmu.description);
        put(
            format!("the FMU of component `{name}`"),
            format!("{} {}", description.model_name, description.guid),
        );
        for start in &component.start_values {
            let value = match &start.value {
                Start::Real(value) => value.to_string(),
                Start::Integer(value) => value.to_string(),
                Start::Boolean(value) => value.to_string(),
                Start::String(value) => value.clone(),
            };
            put(format!("the start value of `{}`", component.path_of(start.variable)), value);
        }
    }
    run
}

impl Master {
    /// The present point, `rows` of the result before it.
    ///
    /// # Errors
    /// An FMU cannot save or serialize its state.
    pub(super) fn save(&mut self, run: &BTreeMap<String, String>, rows: RowsSoFar) -> Result<States, Error> {
        let mut master = Vec::new();
        put_values(&mut master, &self.values);
        let mut carried = Vec::new();
        self.carry(&mut |value| carried.push(*value));
        put_reals(&mut master, &carried);
        let mut components = Vec::with_capacity(self.nodes.len());
        for node in &mut self.nodes {
            let state = hex(&state_of(node)?);
            components.push(ComponentState { component: node.name().to_owned(), state });
        }
        Ok(States {
            states_version: SCHEMA_VERSION,
            airloop_version: env!("CARGO_PKG_VERSION").into(),
            time: self.time(),
            steps: self.steps(),
            rows,
            run: run.clone(),
            components,
            master: hex(&master),
        })
    }

    /// Goes to a point that was saved.
    ///
    /// # Errors
    /// [`Error::Restart`] for states of another run or grid; an FMU refuses its state.
    pub(super) fn restore(&mut self, states: &States) -> Result<(), Error> {
        let refused = |problem: String| Err(Error::Restart(problem));
        // The last digit of a number in JSON is not sacred.
        let here = self.grid().time(states.steps);
        let rounding = 4.0 * f64::EPSILON * states.time.abs();
        if states.steps > self.grid().steps() || (here - states.time).abs() > rounding {
            return refused(format!(
                "the saved states are damaged: t = {} s after {} steps is no communication point",
                states.time, states.steps
            ));
        }
        let damaged =
            || Error::Restart("the saved states are damaged: values of the master are missing".into());
        let master = bytes(&states.master).ok_or_else(damaged)?;
        let mut rest = master.as_slice();
        let values = take_values(&mut rest, &self.values).ok_or_else(damaged)?;
        let carried = take_reals(&mut rest).ok_or_else(damaged)?;
        let mut count = 0;
        self.carry(&mut |_| count += 1);
        if states.components.len() != self.nodes.len() || carried.len() != count {
            return Err(damaged());
        }
        for (node, saved) in self.nodes.iter_mut().zip(&states.components) {
            let Some(state) = bytes(&saved.state).filter(|_| saved.component == node.name()) else {
                return refused(format!("the saved state of component `{}` is damaged", node.name()));
            };
            set_state_of(node, &state)?;
        }
        self.values = values;
        let mut carried = carried.into_iter();
        self.carry(&mut |value| *value = carried.next().unwrap_or(*value));
        self.go_to(states.steps);
        Ok(())
    }
}
