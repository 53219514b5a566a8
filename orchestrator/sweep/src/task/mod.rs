//! Kinds of tasks behind one trait: what a plan names is opened once, then tasks run on any number of threads.

mod command;
mod empty;
mod limit;
mod named;
mod quantity;
mod simulate;
mod trials;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use airloop_cosim::system::SystemGraph;
use airloop_fmi::isolate;

use crate::Error;
use crate::file::{Kind, PlanFile};
use crate::sample::Value;
use crate::table::{Cell, Column};

/// One task.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Number, from 0.
    pub number: u64,
    /// Seed; it depends on the plan's seed and the number alone.
    pub seed: u64,
    /// Values of the factors by name.
    pub values: Vec<(String, Value)>,
}

/// Outcome of a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Results in the order of [`Work::columns`]; empty ones where a task failed.
    pub cells: Vec<Cell>,
    /// `ok`, `terminated`, `failed` or `timeout`.
    pub status: &'static str,
    /// Cause, where it is not `ok`.
    pub cause: Option<String>,
    /// Rows of [`Work::signals`], column by column; none where a task failed or its kind keeps no signals.
    pub signals: Vec<Vec<f64>>,
}

impl Outcome {
    /// A task that has results.
    fn ok(cells: Vec<Cell>) -> Outcome {
        Outcome { cells, status: "ok", cause: None, signals: Vec::new() }
    }

    /// A task that has no results.
    fn failed(status: &'static str, columns: usize, cause: String) -> Outcome {
        Outcome { cells: vec![Cell::Empty; columns], status, cause: Some(cause), signals: Vec::new() }
    }
}

/// Surroundings of a running task.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Folder of the sweep.
    pub folder: &'a Path,
    /// Set when the run is interrupted.
    pub stop: &'a AtomicBool,
}

/// A kind of tasks, opened.
pub trait Work: Sync {
    /// Columns of the factors, with their units where they are known.
    fn factor_columns(&self, plain: &[Column]) -> Vec<Column> {
        plain.to_vec()
    }

    /// Columns of the results.
    fn columns(&self) -> Vec<Column>;

    /// Columns of the signals that are kept of every task, time first; none if no signals are kept.
    fn signals(&self) -> Vec<Column> {
        Vec::new()
    }

    /// Files and folders that decide the results; those that they name in turn are found later.
    fn inputs(&self) -> Vec<PathBuf>;

    /// Number of tasks, where the kind has its own.
    fn count(&self) -> Option<u64> {
        None
    }

    /// Checks that a task could begin, as far as that is known without running it.
    ///
    /// # Errors
    /// Names and values that cannot be used.
    fn check(&self, task: &Task) -> Result<(), Error>;

    /// Runs a task; none if it was interrupted. A task that fails is an outcome with a cause.
    fn run(&self, task: &Task, place: Place) -> Option<Outcome>;
}

/// Whether an FMU of a system runs in a process of its own: then each task opens its own, so that a crash costs no
/// other task.
fn is_isolated(graph: &SystemGraph) -> bool {
    graph.components.iter().any(|one| isolate::applies_to(&one.fmu.description.generation_tool))
}

/// Opens what a plan names.
///
/// # Errors
/// A system or record that cannot be opened, or a table that the kind needs or does not take.
pub fn open(plan: &PlanFile, base: &Path) -> Result<Box<dyn Work>, Error> {
    if let Some(limit) = plan.time_limit.filter(|limit| !(*limit > 0.0 && *limit < 1e9)) {
        let problem = format!("{limit}; allowed: seconds above 0 and below 1e9");
        return Err(Error::Plan { place: "time_limit".into(), problem });
    }
    if plan.kind != Kind::Command && !plan.command.is_empty() {
        let problem = "only a plan with kind = \"command\" has one".into();
        return Err(Error::Plan { place: "command".into(), problem });
    }
    if plan.kind != Kind::Simulate && plan.signals.is_some() {
        let problem = "only a plan with kind = \"simulate\" keeps signals".into();
        return Err(Error::Plan { place: "[signals]".into(), problem });
    }
    Ok(match plan.kind {
        Kind::Simulate => Box::new(simulate::Simulate::open(plan, base)?),
        Kind::Trials => Box::new(trials::Trials::open(plan, base)?),
        Kind::Command => Box::new(command::Command::open(plan, base)?),
        Kind::Empty => Box::new(empty::Empty),
    })
}
