//! One instance of a system FMU, without C: its life cycle, values, steps and events.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use airloop_cosim::master::embedded::{Place, Reader, Slaves, Value};
use airloop_cosim::master::monolithic::{EventReport, Integrated, Models};
use airloop_cosim::master::{Grid, Progress};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{DataType, Start, StartValue};
use airloop_fmi::InterfaceKind;
use fmi_export::Interface;
use fmi_export::state_machine::Mode;

use crate::description::accepts_any_step;
use crate::predictive::Predictive;
use crate::recipe::{Recipe, STRUCTURE, SYSTEM};
use crate::state::{Number, Saved, mode};
use crate::table::{Role, Table};

/// Steps to a stop time that nobody has stated.
const STEPS_TO_UNSTATED_STOP: f64 = 1e9;
/// A remainder below this fraction of a step is rounding.
const ROUNDING: f64 = 1e-6;

/// Reason why a call fails, in words.
pub(crate) type Refused = String;

/// Runner of the components, once they are initialized.
enum Runner {
    Slaves(Box<Slaves>),
    Models(Box<Models>),
    Integrated(Box<Integrated>),
}

impl Runner {
    /// The instances of Model Exchange.
    fn models(&mut self) -> Option<&mut Models> {
        match self {
            Runner::Slaves(_) => None,
            Runner::Models(models) => Some(models),
            Runner::Integrated(own) => Some(own.models()),
        }
    }
}

/// Outcome of a communication step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    Done,
    /// A component asked for the end.
    Ended,
}

/// An instance.
pub(crate) struct Instance {
    pub interface: Interface,
    pub mode: Mode,
    graph: SystemGraph,
    recipe: Recipe,
    table: Table,
    /// Start values of the components as in the archive.
    archived: Vec<Vec<StartValue>>,
    /// Numbers given for system inputs.
    inputs: Vec<Option<f64>>,
    /// Addition to the rate of each state.
    added: Vec<f64>,
    /// Texts given for system inputs, by value reference.
    texts: HashMap<u32, String>,
    start: f64,
    stop: Option<f64>,
    tolerance: Option<f64>,
    runner: Option<Runner>,
    /// The controller, where the FMU is one.
    predictive: Option<Box<Predictive>>,
    /// Types and readers of all variables under [`Runner::Slaves`], by value reference: importers ask after every step.
    readers: Vec<(DataType, Reader)>,
    /// Communication points inside: from `origin` \[s\], `count` steps ago.
    origin: f64,
    /// Their grid, once a step was made from this origin.
    grid: Option<(f64, Grid)>,
    count: u64,
    pub time: f64,
    pub terminated: bool,
}

/// File, GUID and interface of a system that was opened, and the system.
type Opened = (PathBuf, String, InterfaceKind, SystemGraph);

/// The system of an FMU, opened once per process: the libraries of its components stay loaded, because what a library
/// allocates once is lost each time it is unloaded.
fn opened(file: &Path, guid: &str, kind: InterfaceKind) -> Result<SystemGraph, Refused> {
    static OPENED: Mutex<Vec<Opened>> = Mutex::new(Vec::new());
    let mut all = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    let same = |known: &&Opened| known.0 == file && known.1 == guid && known.2 == kind;
    if let Some((.., graph)) = all.iter().find(same) {
        return Ok(graph.clone());
    }
    let graph = SystemGraph::open_for(file, kind).map_err(|error| error.to_string())?;
    all.push((file.to_owned(), guid.to_owned(), kind, graph.clone()));
    Ok(graph)
}

impl Instance {
    /// Opens the system in the resources of the FMU.
    pub fn open(resources: &Path, guid: &str, interface: Interface) -> Result<Instance, Refused> {
        let recipe = Recipe::read(resources)?;
        if recipe.guid != guid {
            return Err(format!("the GUID {guid} is not that of resources/system.toml, {}", recipe.guid));
        }
        let kind = match interface {
            Interface::CoSimulation if recipe.nmpc.is_some() => InterfaceKind::ModelExchange,
            Interface::ModelExchange if recipe.nmpc.is_some() => {
                return Err("a controller has no Model Exchange".into());
            }
            Interface::CoSimulation if !recipe.integrates() => InterfaceKind::CoSimulation,
            Interface::CoSimulation | Interface::ModelExchange => InterfaceKind::ModelExchange,
        };
        let graph = opened(&resources.join(SYSTEM).join(STRUCTURE), guid, kind)?;
        let table = Table::with(&graph, &recipe);
        let predictive = recipe.nmpc.as_ref().map(|nmpc| Predictive::open(&graph, nmpc, guid));
        let predictive = predictive.transpose()?.map(Box::new);
        let archived = graph.components.iter().map(|component| component.start_values.clone()).collect();
        Ok(Instance {
            interface,
            mode: Mode::Instantiated,
            inputs: vec![None; graph.inputs.len()],
            added: vec![0.0; table.states.len()],
            texts: HashMap::new(),
            graph,
            recipe,
            table,
            archived,
            start: 0.0,
            stop: None,
            tolerance: None,
            runner: None,
            predictive,
            readers: Vec::new(),
            origin: 0.0,
            grid: None,
            count: 0,
            time: 0.0,
            terminated: false,
        })
    }

    pub fn setup(&mut self, tolerance: Option<f64>, start: f64, stop: Option<f64>) -> Result<(), Refused> {
        if !start.is_finite() || stop.is_some_and(|stop| !(stop.is_finite() && stop >= start)) {
            return Err(format!(
                "start {start} and stop {stop:?} must be finite, and the stop not before the start"
            ));
        }
        (self.tolerance, self.start, self.stop) = (tolerance, start, stop);
        (self.time, self.origin) = (start, start);
        self.runner = None;
        Ok(())
    }

    pub fn reset(&mut self) {
        for (component, starts) in self.graph.components.iter_mut().zip(&self.archived) {
            component.start_values.clone_from(starts);
        }
        self.inputs.fill(None);
        self.added.fill(0.0);
        self.texts.clear();
        (self.start, self.stop, self.tolerance) = (0.0, None, None);
        (self.origin, self.count, self.time, self.terminated) = (0.0, 0, 0.0, false);
        self.runner = None;
        self.predictive.iter_mut().for_each(|controller| controller.reset());
        self.mode = Mode::Instantiated;
    }

    /// Initializes all components; at the end of initialization, or earlier where a value is asked for.
    fn running(&mut self) -> Result<&mut Runner, Refused> {
        if self.runner.is_none() {
            let stop = self.stop.unwrap_or(self.start + STEPS_TO_UNSTATED_STOP * self.recipe.step);
            let settings = self.recipe.settings(self.start, stop, self.tolerance);
            let given = self.inputs.iter().enumerate().filter_map(|(input, value)| Some((input, (*value)?)));
            let inputs: Vec<(usize, f64)> = given.collect();
            let text = |error: airloop_cosim::master::Error| error.to_string();
            self.runner = Some(match self.interface {
                Interface::CoSimulation if self.recipe.integrates() => {
                    let own = Integrated::new(&self.graph, &settings, &inputs).map_err(text)?;
                    Runner::Integrated(Box::new(own))
                }
                Interface::CoSimulation => {
                    let slaves = Slaves::new(&self.graph, &settings, &inputs).map_err(text)?;
                    if self.readers.is_empty() {
                        let variables = self.table.variables.iter();
                        let read = |place| slaves.reader(&self.graph, place);
                        self.readers =
                            variables.map(|variable| (variable.data_type, read(variable.place))).collect();
                    }
                    Runner::Slaves(Box::new(slaves))
                }
                Interface::ModelExchange => {
                    Runner::Models(Box::new(Models::new(&self.graph, &settings, &inputs).map_err(text)?))
                }
            });
            if let Some(models) = self.runner.as_mut().and_then(Runner::models) {
                let added = self.added.iter().enumerate().filter(|(_, value)| **value != 0.0);
                added.for_each(|(state, value)| models.add_to_rate(state, *value));
            }
        }
        self.runner.as_mut().ok_or_else(|| "the components are not initialized".to_owned())
    }

    pub fn exit_initialization(&mut self) -> Result<(), Refused> {
        match &mut self.predictive {
            Some(controller) => controller.start()?,
            None => self.running().map(|_| ())?,
        }
        self.mode = match self.interface {
            Interface::CoSimulation => Mode::StepComplete,
            Interface::ModelExchange => Mode::EventMode,
        };
        Ok(())
    }

    /// The value of a variable; its type must be one of `types`.
    pub fn get(&mut self, reference: u32, data_type: DataType) -> Result<Value, Refused> {
        if self.predictive.is_some() {
            self.place(reference, data_type)?;
        }
        if let Some(controller) = &self.predictive {
            return Ok(controller.get(reference as usize));
        }
        if let Some(Runner::Slaves(slaves)) = &mut self.runner
            && let Some(&(known, reader)) = self.readers.get(reference as usize)
            && known == data_type
        {
            return slaves.read_by(reader).map_err(|error| error.to_string());
        }
        let place = self.place(reference, data_type)?;
        let role = self.table.get(reference).map(|variable| variable.role);
        if let Some(Role::Added(state)) = role {
            return Ok(Value::Real(self.added[state]));
        }
        self.running()?;
        let graph = &self.graph;
        let value = match self.runner.as_mut() {
            Some(Runner::Slaves(slaves)) => slaves.read(graph, place),
            Some(Runner::Models(models)) => models.read(graph, place),
            Some(Runner::Integrated(own)) => own.models().read(graph, place),
            None => return Err("the components are not initialized".into()),
        };
        match (value.map_err(|error| error.to_string())?, role) {
            (Value::Real(rate), Some(Role::Derivative(state))) => Ok(Value::Real(rate + self.added[state])),
            (value, _) => Ok(value),
        }
    }

    fn place(&self, reference: u32, data_type: DataType) -> Result<Place, Refused> {
        match self.table.get(reference) {
            Some(variable) if variable.data_type == data_type => Ok(variable.place),
            Some(variable) => {
                Err(format!("`{}` is of type {}, not {data_type}", variable.name, variable.data_type))
            }
            None => Err(format!("there is no variable with the value reference {reference}")),
        }
    }

    /// Sets a variable: before the start all that have a start value, then the inputs.
    pub fn set(&mut self, reference: u32, value: Value) -> Result<(), Refused> {
        let data_type = match value {
            Value::Real(_) => DataType::Real,
            Value::Integer(_) => DataType::Integer,
            Value::Boolean(_) => DataType::Boolean,
            Value::String(_) => DataType::String,
        };
        let place = self.place(reference, data_type)?;
        let before = matches!(self.mode, Mode::Instantiated | Mode::InitializationMode);
        let number = match value {
            Value::Real(value) if !value.is_finite() => {
                return Err(format!(
                    "`{}` cannot be set to {value}",
                    self.table.variables[reference as usize].name
                ));
            }
            Value::Real(value) => Some(value),
            Value::Integer(value) => Some(value as f64),
            Value::Boolean(value) => Some(f64::from(u8::from(value))),
            Value::String(_) => None,
        };
        if let Some(controller) = &mut self.predictive {
            return controller.set(reference as usize, number.unwrap_or_default(), before);
        }
        if let (Some(Role::Added(state)), Some(number)) =
            (self.table.get(reference).map(|own| own.role), number)
        {
            self.added[state] = number;
            if let Some(models) = self.runner.as_mut().and_then(Runner::models) {
                models.add_to_rate(state, number);
            }
            return Ok(());
        }
        match (place, number) {
            (Place::Input(input), Some(number)) => {
                self.inputs[input] = Some(number);
                match self.runner.as_mut().filter(|_| !before) {
                    Some(Runner::Slaves(slaves)) => slaves.set_input(input, number),
                    Some(Runner::Models(models)) => models.set_input(input, number),
                    Some(Runner::Integrated(own)) => own.set_input(input, number),
                    None => self.runner = None,
                }
                return Ok(());
            }
            (Place::Input(input), None) => {
                let (name, Value::String(text)) = (self.graph.inputs[input].name.clone(), value) else {
                    return Err("a text is no number".into());
                };
                if before {
                    self.runner = None;
                    self.graph.set_start(&name, &text, "fmi2SetString").map_err(|error| error.to_string())?;
                    self.texts.insert(reference, text);
                    return Ok(());
                }
                // Importers set all inputs at every communication point; masters pass on numbers only.
                let archived = &self.table.variables[reference as usize].start;
                let is_same = match (self.texts.get(&reference), archived) {
                    (Some(given), _) => *given == text,
                    (None, Some(Value::String(archived))) => *archived == text,
                    _ => text.is_empty(),
                };
                if !is_same {
                    return Err(format!("`{name}` cannot be set to another text after the start"));
                }
                return Ok(());
            }
            _ => {}
        }
        let variable = &self.table.variables[reference as usize];
        // Some importers set the states one by one.
        if let (Role::State(state), Some(number), Mode::ContinuousTimeMode) =
            (variable.role, number, self.mode)
        {
            let (models, _) = self.models()?;
            let mut x = models.states().to_vec();
            x[state] = number;
            models.set_states(&x);
            return Ok(());
        }
        if !before || variable.start.is_none() {
            let why = if before { "it has no start value" } else { "only inputs can be, after the start" };
            return Err(format!("`{}` cannot be set: {why}", variable.name));
        }
        let Place::Variable { component, variable } = variable.place else {
            return Err(format!("`{}` cannot be set", variable.name));
        };
        let start = match value {
            Value::Real(value) => Start::Real(value),
            Value::Integer(value) => Start::Integer(value),
            Value::Boolean(value) => Start::Boolean(value),
            Value::String(value) => Start::String(value),
        };
        self.graph.components[component].set_start(variable, start);
        self.runner = None;
        Ok(())
    }

    /// A communication step of the importer: as many steps of the master as it takes.
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<Step, Refused> {
        let step = self.recipe.step;
        let slack = 1e-8 * h.abs() + 4.0 * f64::EPSILON * self.time.abs();
        if !(h > 0.0 && h.is_finite()) {
            return Err(format!("the communication step size {h} s must be positive and finite"));
        }
        if t.is_nan() || (t - self.time).abs() > slack {
            return Err(format!("the communication point {t} s is not the present time {} s", self.time));
        }
        let end = t + h;
        if self.stop.is_some_and(|stop| end > stop + slack) {
            return Err(format!("the step to {end} s goes past the stop time {:?} s", self.stop));
        }
        if let Some(controller) = &mut self.predictive {
            controller.advance(h);
            self.time = end;
            return Ok(Step::Done);
        }
        if let Some(Runner::Integrated(own)) = &mut self.runner {
            let progress = own.step(&self.graph, t, h).map_err(|error| error.to_string())?;
            return Ok(self.stepped(progress, end));
        }
        let ratio = h / step;
        let is_multiple = (ratio - ratio.round()).abs() <= ROUNDING && ratio > 0.5;
        let whole = if is_multiple { ratio.round() } else { ratio.floor() };
        let rest = if is_multiple { 0.0 } else { h - whole * step };
        if rest > 0.0 && !accepts_any_step(&self.graph) {
            return Err(format!(
                "the communication step size {h} s is no multiple of the step {step} s inside, and a component takes no \
                 other"
            ));
        }
        let grid = self.grid()?;
        for _ in 0..whole as u64 {
            if self.advance(grid.time(self.count), step)? == Step::Ended {
                return Ok(Step::Ended);
            }
            self.count += 1;
            self.time = grid.time(self.count);
        }
        if rest > 0.0 {
            if self.advance(self.time, end - self.time)? == Step::Ended {
                return Ok(Step::Ended);
            }
            (self.origin, self.count) = (end, 0);
        }
        self.time = end;
        Ok(Step::Done)
    }

    /// The grid from the present origin, made anew where that has changed.
    fn grid(&mut self) -> Result<Grid, Refused> {
        if let Some((_, grid)) = self.grid.filter(|(origin, _)| *origin == self.origin) {
            return Ok(grid);
        }
        let stop = self.origin + STEPS_TO_UNSTATED_STOP * self.recipe.step;
        let grid = Grid::new(self.origin, stop, self.recipe.step).map_err(|error| error.to_string())?;
        self.grid = Some((self.origin, grid));
        Ok(grid)
    }

    fn advance(&mut self, t: f64, h: f64) -> Result<Step, Refused> {
        let Some(Runner::Slaves(slaves)) = &mut self.runner else {
            return Err("this is no Co-Simulation".into());
        };
        let progress = slaves.step(t, h).map_err(|error| error.to_string())?;
        Ok(self.stepped(progress, t))
    }

    /// Moves to `time` \[s\] after a step, or to where it ended.
    fn stepped(&mut self, progress: Progress, time: f64) -> Step {
        match progress {
            Progress::Stepped => {
                self.time = time;
                Step::Done
            }
            Progress::Terminated { last_successful_time, .. } => {
                self.time = last_successful_time.unwrap_or(time);
                self.terminated = true;
                Step::Ended
            }
        }
    }

    /// The Model Exchange instances, after initialization.
    pub fn models(&mut self) -> Result<(&mut Models, &SystemGraph), Refused> {
        self.running()?;
        match &mut self.runner {
            Some(Runner::Models(models)) => Ok((models, &self.graph)),
            _ => Err("this is no Model Exchange".into()),
        }
    }

    pub fn table(&self) -> &Table {
        &self.table
    }

    /// Event iteration of all components.
    pub fn new_discrete_states(&mut self) -> Result<EventReport, Refused> {
        let (models, graph) = self.models()?;
        models.event(graph).map_err(|error| error.to_string())
    }

    /// Derivatives of `unknowns` by `knowns` along `seed`.
    pub fn directional(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
    ) -> Result<Vec<f64>, Refused> {
        let mut inputs = vec![0.0; self.graph.inputs.len()];
        let mut states = vec![0.0; self.table.states.len()];
        let mut added = states.clone();
        for (&known, &seed) in knowns.iter().zip(seed) {
            match self.table.get(known).map(|variable| (variable.role, variable.place)) {
                Some((Role::Input, Place::Input(input))) => inputs[input] += seed,
                Some((Role::State(state), _)) => states[state] += seed,
                Some((Role::Added(state), _)) => added[state] += seed,
                _ => {
                    return Err(format!(
                        "the variable with the value reference {known} is neither input nor state"
                    ));
                }
            }
        }
        let table = self.table.clone();
        let (models, graph) = self.models()?;
        let tangent = models.tangent(graph, &inputs, &states).map_err(|error| error.to_string())?;
        unknowns
            .iter()
            .map(|&unknown| match table.get(unknown).map(|variable| (variable.role, variable.place)) {
                Some((Role::Derivative(state), _)) => Ok(tangent.rates[state] + added[state]),
                Some((Role::State(state), _)) => Ok(states[state]),
                Some((_, place)) => tangent
                    .of(graph, place, &inputs)
                    .ok_or_else(|| format!("`{}` has no derivative", table.variables[unknown as usize].name)),
                None => Err(format!("there is no variable with the value reference {unknown}")),
            })
            .collect()
    }

    pub fn save(&mut self) -> Result<Saved, Refused> {
        if self.predictive.is_some() {
            return Err(
                "a controller that predicts cannot save its state (canGetAndSetFMUstate is false)".into()
            );
        }
        let runner = match &mut self.runner {
            None => None,
            Some(Runner::Slaves(slaves)) => Some(slaves.save().map_err(|error| error.to_string())?),
            Some(Runner::Models(models)) => Some(models.save().map_err(|error| error.to_string())?),
            Some(Runner::Integrated(own)) => Some(own.models().save().map_err(|error| error.to_string())?),
        };
        let of = |component: &airloop_cosim::system::graph::Component| {
            component.start_values.iter().map(Number::of).collect()
        };
        Ok(Saved {
            mode: self.mode as u8,
            times: [self.start, self.origin, self.time].map(f64::to_bits),
            stop: self.stop.map(f64::to_bits),
            tolerance: self.tolerance.map(f64::to_bits),
            count: self.count,
            terminated: self.terminated,
            inputs: self.inputs.iter().map(|value| value.map(f64::to_bits)).collect(),
            added: self.added.iter().map(|value| value.to_bits()).collect(),
            starts: self.graph.components.iter().map(of).collect(),
            runner,
        })
    }

    pub fn restore(&mut self, saved: &Saved) -> Result<(), Refused> {
        let foreign = || "the state is not one of this FMU".to_owned();
        let mode = mode(saved.mode).ok_or_else(foreign)?;
        if saved.inputs.len() != self.inputs.len() || saved.starts.len() != self.graph.components.len() {
            return Err(foreign());
        }
        let starts: Vec<Vec<StartValue>> = saved
            .starts
            .iter()
            .map(|starts| starts.iter().map(|(variable, number)| number.start(*variable)).collect())
            .collect();
        let same = self
            .graph
            .components
            .iter()
            .zip(&starts)
            .all(|(component, starts)| component.start_values == *starts);
        for (component, starts) in self.graph.components.iter_mut().zip(starts) {
            component.start_values = starts;
        }
        let [start, origin, time] = saved.times.map(f64::from_bits);
        (self.start, self.origin, self.time) = (start, origin, time);
        (self.stop, self.tolerance) = (saved.stop.map(f64::from_bits), saved.tolerance.map(f64::from_bits));
        (self.count, self.terminated, self.mode) = (saved.count, saved.terminated, mode);
        self.inputs = saved.inputs.iter().map(|value| value.map(f64::from_bits)).collect();
        let added = self.added.iter_mut().zip(&saved.added);
        added.for_each(|(own, bits)| *own = f64::from_bits(*bits));
        let Some(bytes) = &saved.runner else {
            self.runner = None;
            return Ok(());
        };
        // Parameters belong to the initialization of the components.
        if !same {
            self.runner = None;
        }
        let restored = match self.running()? {
            Runner::Slaves(slaves) => slaves.restore(bytes),
            Runner::Models(models) => models.restore(bytes),
            Runner::Integrated(own) => own.restore(bytes),
        };
        let added = self.added.clone();
        if let Some(models) = self.runner.as_mut().and_then(Runner::models) {
            added.iter().enumerate().for_each(|(state, value)| models.add_to_rate(state, *value));
        }
        if restored.map_err(|error| error.to_string())? { Ok(()) } else { Err(foreign()) }
    }
}
