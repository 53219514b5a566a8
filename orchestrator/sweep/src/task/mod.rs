//! Kinds of tasks behind one trait: what a plan names is opened once, then tasks run on any number of threads.

mod command;
mod empty;
mod limit;
mod quantity;
mod simulate;
mod trials;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use airloop_cosim::system::SystemGraph;

use crate::Error;
use crate::digest;
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
}

impl Outcome {
    /// A task that has no results.
    fn failed(status: &'static str, columns: usize, cause: String) -> Outcome {
        Outcome { cells: vec![Cell::Empty; columns], status, cause: Some(cause) }
    }
}

/// Surroundings of a running task.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Folder of the sweep.
    pub folder: &'a Path,
    /// Set when the run is interrupted.
    pub stop: &'a AtomicBool,
    /// Whether FMUs run in processes of their own: then each task opens its own, so that a crash costs no other task.
    pub isolated: bool,
}

/// A kind of tasks, opened.
pub trait Work: Sync {
    /// Columns of the factors, with their units where they are known.
    fn factor_columns(&self, plain: &[Column]) -> Vec<Column> {
        plain.to_vec()
    }

    /// Columns of the results.
    fn columns(&self) -> Vec<Column>;

    /// Files and folders that decide the results.
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

/// Files of a system: its description with parameter files beside it, and the archives of its FMUs.
fn system_files(system: &Path, graph: &SystemGraph) -> Vec<PathBuf> {
    let mut files = vec![system.to_owned()];
    if system.extension().is_some_and(|kind| kind == "ssd") {
        files.extend(graph.components.iter().map(|component| component.fmu.path.clone()));
        let beside = system.parent().and_then(|folder| digest::entries(folder).ok()).unwrap_or_default();
        let is_part = |path: &PathBuf| path.extension().is_some_and(|kind| kind == "ssv" || kind == "ssm");
        files.extend(beside.into_iter().filter(is_part));
    }
    files
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
    Ok(match plan.kind {
        Kind::Simulate => Box::new(simulate::Simulate::open(plan, base)?),
        Kind::Trials => Box::new(trials::Trials::open(plan, base)?),
        Kind::Command => Box::new(command::Command::open(plan, base)?),
        Kind::Empty => Box::new(empty::Empty),
    })
}
