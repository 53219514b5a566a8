//! From a problem file to a system of loaded FMUs and a task with all names looked up.

use std::path::Path;
use std::time::{Duration, Instant};

use super::Error;
use super::catalog::{Catalog, Kind};
use super::cycle::Return;
use super::file::statement::Scaling;
use super::file::{self, Parameters, Statement};
use super::reset::{self, Jump};
use super::sampling::{self, Sampling};
use super::task::{self, Signals, Task};
use airloop_cosim::coupled::{Options, System};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_ocp::transcription::{Dynamics, Point, Size, Structure};
use airloop_optim::EvaluationError;
use airloop_series::names;

/// A problem that is ready to be transcribed.
pub struct Prepared {
    /// All but the FMU instances; threads may share it.
    pub setup: Setup,
    /// One instance of the dynamics of every phase.
    pub dynamics: Vec<Box<dyn Dynamics>>,
    /// Resets between each phase and the next, one fewer than phases; none: all states are continuous.
    pub resets: Vec<Option<Jump>>,
    /// Return from the end of the last phase to the begin of the first; none: the motion does not repeat itself.
    pub cycle: Option<Return>,
}

impl std::ops::Deref for Prepared {
    type Target = Setup;

    fn deref(&self) -> &Setup {
        &self.setup
    }
}

/// A problem with its system, names and numbers.
pub struct Setup {
    /// Content of the file.
    pub statement: Statement,
    /// The system with the parameters of the problem.
    pub graph: SystemGraph,
    /// Its variables.
    pub catalog: Catalog,
    /// The problem in numbers.
    pub task: Task,
    /// Sampled components, if there are any.
    pub sampling: Option<Sampling>,
    /// States, by index, that belong to sampled components.
    pub sampled_states: Vec<usize>,
    /// Assumptions, one sentence each.
    pub notes: Vec<String>,
    /// Time it took.
    pub load: Duration,
}

/// Reads a problem file, opens its system and looks everything up.
///
/// # Errors
/// [`Error`] names file, line, column and remedy, or what is wrong with the system.
pub fn prepare(file: &Path) -> Result<Prepared, Error> {
    let began = Instant::now();
    prepare_statement(file::read(file)?, began)
}

/// Same as [`prepare`], from what a file says.
///
/// # Errors
/// Same as [`prepare`].
pub fn prepare_statement(statement: Statement, began: Instant) -> Result<Prepared, Error> {
    let mut graph = open(&statement)?;
    let mut notes = graph.notes.clone();
    set(&statement, &mut graph, &statement.parameters)?;
    let catalog = Catalog::new(&graph);
    let (inputs, outputs) = (task::inputs(&statement, &catalog)?, task::outputs(&statement, &catalog)?);
    let sampling = sampling::sampling(&statement, &graph)?;
    let mut dynamics: Vec<Box<dyn Dynamics>> = Vec::new();
    let mut signals = Signals { states: Vec::new(), inputs, outputs };
    let scaled = statement.settings.scaling == Scaling::Nominal;
    for phase in &statement.phases {
        let mut own = graph.clone();
        set(&statement, &mut own, &phase.parameters)?;
        let system = open_dynamics(&statement, &own, &catalog, &signals)?;
        for note in system.notes().iter().filter(|note| !notes.contains(note)).cloned().collect::<Vec<_>>() {
            notes.push(note);
        }
        let size = system.size();
        let states: Vec<usize> = system.names()[..size.states]
            .iter()
            .filter_map(|name| catalog.find(name))
            .map(|found| found.0)
            .collect();
        signals.states = states;
        let shown = [&signals.states, &signals.inputs, &signals.outputs].into_iter().flatten();
        let names = shown.map(|&index| catalog.variables()[index].name.clone()).collect();
        dynamics.push(Box::new(Named { inner: Box::new(system), names, scaled }));
    }
    let mut resets = reset::resets(&statement, &catalog, &signals, |parameters, signals| {
        let mut own = graph.clone();
        set(&statement, &mut own, parameters)?;
        Ok(Box::new(open_dynamics(&statement, &own, &catalog, signals)?))
    })?;
    // The first phase is entered from the last.
    let jump = resets.drain(..1).next().flatten();
    let own = |cycle| Return::of(&statement, (&catalog, &signals), cycle, jump);
    let cycle = statement.cycle.as_ref().map(own).transpose()?;
    let task = task::task(&statement, &catalog, signals)?;
    notes.extend(task.notes.iter().cloned());
    let sampled_states = sampled_states(&graph, &catalog, &task.signals, sampling.as_ref());
    let load = began.elapsed();
    let setup = Setup { statement, graph, catalog, task, sampling, sampled_states, notes, load };
    Ok(Prepared { setup, dynamics, resets, cycle })
}

/// The system of a problem, with the parameters that its own files give.
pub(super) fn open(statement: &Statement) -> Result<SystemGraph, Error> {
    if !statement.system_file.exists() {
        let problem = format!("there is no file {}; correct `system`", statement.system_file.display());
        return Err(statement.source.error_at(statement.system.place, problem));
    }
    Ok(SystemGraph::open_for(&statement.system_file, InterfaceKind::ModelExchange)?)
}

/// Sets start values of parameters.
fn set(statement: &Statement, graph: &mut SystemGraph, values: &Parameters) -> Result<(), Error> {
    for (name, value) in values {
        let (line, column) = statement.source.line_column(name.place);
        let place = format!("{}: line {line}, column {column}", statement.source.file.display());
        graph.set_start(&name.text, &value.to_string(), &place)?;
    }
    Ok(())
}

fn open_dynamics(
    statement: &Statement,
    graph: &SystemGraph,
    catalog: &Catalog,
    signals: &Signals,
) -> Result<System, Error> {
    let path = |index: &usize| catalog.variables()[*index].path.clone();
    let states = match &statement.states {
        None => None,
        Some(named) => {
            let mut paths = Vec::new();
            for name in named {
                let (index, _) = catalog.want(&statement.source, name)?;
                if catalog.variables()[index].kind != Kind::State {
                    let known = catalog.variables().iter().filter(|one| one.kind == Kind::State);
                    let meant = names::suggestion(&name.text, known.map(|one| one.name.as_str()));
                    let problem = format!("`{}` is not a state; {meant}", name.text);
                    return Err(statement.source.error_at(name.place, problem));
                }
                paths.push(path(&index));
            }
            Some(paths)
        }
    };
    let options = Options {
        states,
        inputs: Some(signals.inputs.iter().map(path).collect()),
        outputs: signals.outputs.iter().map(path).collect(),
        time: 0.0,
    };
    Ok(System::open(graph, &options)?)
}

/// The dynamics of a phase with other outputs than those of the task.
pub(super) fn phase_dynamics(setup: &Setup, phase: usize, signals: &Signals) -> Result<System, Error> {
    let mut graph = setup.graph.clone();
    set(&setup.statement, &mut graph, &setup.statement.phases[phase].parameters)?;
    open_dynamics(&setup.statement, &graph, &setup.catalog, signals)
}

/// States of the task that belong to sampled components.
fn sampled_states(
    graph: &SystemGraph,
    catalog: &Catalog,
    signals: &Signals,
    sampling: Option<&Sampling>,
) -> Vec<usize> {
    let Some(sampling) = sampling else { return Vec::new() };
    let owned = |state: &usize| {
        let path = &catalog.variables()[signals.states[*state]].path;
        let prefix = |index: &usize| format!("{}.", graph.components[*index].name);
        graph.single || sampling.components.iter().any(|index| path.starts_with(&prefix(index)))
    };
    (0..signals.states.len()).filter(owned).collect()
}

/// Dynamics under the names of the connectors.
struct Named {
    inner: Box<dyn Dynamics>,
    names: Vec<String>,
    /// Whether nominal values are told; else the solver sees the variables as they are.
    scaled: bool,
}

impl Dynamics for Named {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn structure(&self) -> &Structure {
        self.inner.structure()
    }

    fn names(&self) -> Vec<String> {
        self.names.clone()
    }

    fn nominals(&self) -> Vec<f64> {
        match self.scaled {
            true => self.inner.nominals(),
            false => vec![1.0; self.names.len()],
        }
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        self.inner.evaluate(at, values)
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.inner.jacobian(at, values, jacobian)
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.inner.hessian(at, weights, hessian)
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Named { inner: self.inner.duplicate()?, names: self.names.clone(), scaled: self.scaled }))
    }
}
