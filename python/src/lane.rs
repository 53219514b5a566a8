//! One instance of a system whose steps the caller commands; a batch has many of them.

use std::collections::HashMap;

use airloop_cosim::master::embedded::{Place, Reader, Slaves, Value};
use airloop_cosim::master::{self, Grid, Progress, Settings};
use airloop_cosim::system::SystemGraph;
use pyo3::prelude::*;

use crate::error::{ClosedError, SettingError, raise};
use crate::run::OPEN_END;

/// Places of the values that can be read and set, by name.
pub struct Names {
    inputs: HashMap<String, usize>,
    known_inputs: Vec<String>,
    places: HashMap<String, Place>,
}

impl Names {
    /// Connectors by their plain name, and every variable as `component.variable`.
    pub fn new(graph: &SystemGraph) -> Names {
        let known_inputs: Vec<String> = graph.inputs.iter().map(|input| input.name.clone()).collect();
        let inputs = known_inputs.iter().cloned().enumerate().map(|(index, name)| (name, index)).collect();
        let mut places = HashMap::new();
        for (component, owner) in graph.components.iter().enumerate() {
            for (variable, described) in owner.fmu.description.variables.iter().enumerate() {
                places.insert(owner.path_of(variable), Place::Variable { component, variable });
                if graph.single {
                    places.insert(described.name.clone(), Place::Variable { component, variable });
                }
            }
        }
        let of_inputs =
            known_inputs.iter().enumerate().map(|(index, name)| (name.clone(), Place::Input(index)));
        places.extend(of_inputs);
        let outputs = graph.outputs.iter().enumerate();
        places.extend(outputs.map(|(index, output)| (output.name.clone(), Place::Output(index))));
        Names { inputs, known_inputs, places }
    }

    /// Index of a system input.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn input(&self, name: &str) -> PyResult<usize> {
        let found = self.inputs.get(name).copied();
        found.ok_or_else(|| crate::system::unknown("system input", name, &self.known_inputs))
    }

    /// Place of a value.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn place(&self, name: &str) -> PyResult<Place> {
        self.places.get(name).copied().ok_or_else(|| {
            SettingError::new_err(format!(
                "there is no value `{name}`; write an input or output of the system, or component.variable"
            ))
        })
    }
}

/// Slaves at a communication point, and the points to come.
pub struct Lane {
    slaves: Slaves,
    grid: Grid,
    point: u64,
    step: f64,
    /// The component that ended the simulation, in words, or the failure.
    ended: Option<String>,
}

/// A step that was not made.
pub enum Stop {
    /// The master failed.
    Failed(master::Error),
    /// A component has ended the simulation, or a step had failed before.
    Ended(String),
}

impl Stop {
    /// The exception.
    pub fn raise(self) -> PyErr {
        match self {
            Stop::Failed(error) => raise(error),
            Stop::Ended(text) => ClosedError::new_err(text),
        }
    }
}

impl Lane {
    /// Makes and initializes the instances.
    ///
    /// # Errors
    /// Same as [`Slaves::new`].
    pub fn new(graph: &SystemGraph, settings: &Settings) -> Result<Lane, master::Error> {
        let grid = settings.validate()?;
        let slaves = Slaves::new(graph, settings, &[])?;
        Ok(Lane { slaves, grid, point: 0, step: settings.step_size, ended: None })
    }

    /// Current time \[s\].
    pub fn time(&self) -> f64 {
        self.grid.time(self.point)
    }

    /// Sets a system input for the steps to come.
    #[inline]
    pub fn set(&mut self, input: usize, value: f64) {
        self.slaves.set_input(input, value);
    }

    /// Steps on by `step` \[s\], or by the step of the settings, `count` times.
    ///
    /// # Errors
    /// [`Stop`].
    #[inline]
    pub fn step(&mut self, step: Option<f64>, count: u64) -> Result<(), Stop> {
        if let Some(text) = &self.ended {
            return Err(Stop::Ended(text.clone()));
        }
        if let Some(step) = step.filter(|step| *step != self.step) {
            let now = self.time();
            self.grid = Grid::new(now, now + OPEN_END.max(1e3 * step), step).map_err(Stop::Failed)?;
            (self.point, self.step) = (0, step);
        }
        for _ in 0..count {
            if self.point >= self.grid.steps() {
                return Err(Stop::Ended(format!(
                    "the stop time {} s is reached; there is no further step",
                    self.time()
                )));
            }
            let (t, h) = (self.grid.time(self.point), self.grid.step_size(self.point));
            let stepped = self.slaves.step(t, h);
            self.point += 1;
            match stepped {
                Ok(Progress::Stepped) => {}
                Ok(Progress::Terminated { component, last_successful_time }) => {
                    let at = last_successful_time.unwrap_or(t + h);
                    let text = format!("component {component} ended the simulation at t = {at} s");
                    self.ended = Some(text);
                    return Ok(());
                }
                Err(error) => {
                    self.ended = Some(format!("a step failed before: {error}"));
                    return Err(Stop::Failed(error));
                }
            }
        }
        Ok(())
    }

    /// Whether a component ended the simulation, and which.
    pub fn ended(&self) -> Option<&str> {
        self.ended.as_deref()
    }

    /// A value at the current time.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn read(&mut self, graph: &SystemGraph, place: Place) -> Result<Value, master::Error> {
        self.slaves.read(graph, place)
    }

    /// Looks a place up for [`Lane::number`]; it serves all lanes of the same system.
    pub fn reader(&self, graph: &SystemGraph, place: Place) -> Reader {
        self.slaves.reader(graph, place)
    }

    /// A value as a number; a truth value is 0 or 1, a text NaN.
    ///
    /// # Errors
    /// The FMU refuses.
    #[inline]
    pub fn number(&mut self, reader: Reader) -> Result<f64, master::Error> {
        Ok(match self.slaves.read_by(reader)? {
            Value::Real(value) => value,
            Value::Integer(value) => value as f64,
            Value::Boolean(value) => f64::from(u8::from(value)),
            Value::String(_) => f64::NAN,
        })
    }

    /// State of all instances as bytes.
    ///
    /// # Errors
    /// An FMU cannot save its state.
    pub fn save(&mut self) -> Result<(f64, Vec<u8>), master::Error> {
        Ok((self.time(), self.slaves.save()?))
    }

    /// Returns to a saved state; `false` for bytes of another system.
    ///
    /// # Errors
    /// An FMU refuses.
    pub fn restore(&mut self, time: f64, bytes: &[u8]) -> Result<bool, master::Error> {
        let grid = Grid::new(time, time + OPEN_END.max(1e3 * self.step), self.step)?;
        let done = self.slaves.restore(bytes)?;
        if done {
            (self.grid, self.point, self.ended) = (grid, 0, None);
        }
        Ok(done)
    }
}

/// An input value that the system accepts.
///
/// # Errors
/// It is not finite, or none of those that an Integer, Boolean or Enumeration takes.
pub fn checked(graph: &SystemGraph, input: usize, value: f64) -> PyResult<f64> {
    let refuse = |allowed: String| {
        let name = &graph.inputs[input].name;
        Err(SettingError::new_err(format!("{name} = {value} is not possible: it must be {allowed}")))
    };
    if !value.is_finite() {
        return refuse("finite".to_owned());
    }
    graph.refused_number(input, value).map_or(Ok(value), refuse)
}
