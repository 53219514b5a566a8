//! Trials of a stabilized system: the rows of `airloop trials`.

use std::path::{Path, PathBuf};

use airloop::simulation;
use airloop_cosim::master::Algorithm;
use airloop_plan::stabilize::settings::{self, Settings};
use airloop_plan::trials::{self, Ready, Request};

use super::limit::Limit;
use super::{Outcome, Place, Task, Work};
use crate::Error;
use crate::file::PlanFile;
use crate::table::{Cell, Column, Type};

/// Trials, closed loop first.
pub struct Trials {
    ready: Ready,
    system: PathBuf,
    settings: Settings,
    request: Request,
    open_loop: bool,
    limit: Limit,
    files: Vec<PathBuf>,
}

impl Trials {
    /// Opens a closed loop and its settings.
    ///
    /// # Errors
    /// A plan without `[trials]` or with factors, files that cannot be opened.
    pub fn open(plan: &PlanFile, base: &Path) -> Result<Trials, Error> {
        let wrong = |place: &str, problem: &str| Error::Plan { place: place.into(), problem: problem.into() };
        let table = plan.trials.as_ref().ok_or_else(|| wrong("[trials]", "add the table, with `count`"))?;
        if !(table.scale.is_finite() && table.scale >= 0.0) {
            return Err(wrong("[trials] scale", "give a finite number of at least 0"));
        }
        if !plan.factors.is_empty() || !plan.quantities.is_empty() || plan.sample.is_some() {
            return Err(wrong("trials", "the settings of the controller say what is perturbed and judged"));
        }
        let system = plan.system.as_ref();
        let system = system.ok_or_else(|| wrong("system", "name the folder of `airloop stabilize`"))?;
        let name = plan.run.master.as_deref();
        let algorithm = name.map_or(Some(Algorithm::default()), simulation::algorithm);
        let algorithm = algorithm.ok_or_else(|| wrong("[run] master", "there is no such master"))?;
        let given = table.settings.as_ref().map(|file| base.join(file));
        let airloop = |error| Error::Airloop(airloop::Error::Plan(error));
        let (system, file) = trials::sources(&base.join(system), given.as_deref()).map_err(airloop)?;
        let settings = settings::read(&file).map_err(airloop)?;
        let ready = trials::prepare(&system, &settings, algorithm).map_err(airloop)?;
        let mut files = vec![system.clone(), file];
        files.extend(plan.inputs.iter().map(|name| base.join(name)));
        let count = usize::try_from(table.count).unwrap_or(usize::MAX);
        let request = Request { count, seed: plan.seed, scale: table.scale, algorithm, threads: 1, keep: 0 };
        let (open_loop, limit) = (table.open_loop, Limit::of(plan));
        Ok(Trials { ready, system, settings, request, open_loop, limit, files })
    }

    /// Whether a task has feedback.
    fn closed(&self, task: &Task) -> bool {
        task.number < self.request.count as u64
    }
}

impl Work for Trials {
    fn columns(&self) -> Vec<Column> {
        let criteria = self.ready.criteria_names();
        let criteria = criteria.iter().map(|name| Column::new(name, Type::Integer));
        std::iter::once(Column::new("loop", Type::Text)).chain(criteria).collect()
    }

    fn inputs(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    fn count(&self) -> Option<u64> {
        Some(self.request.count as u64 * if self.open_loop { 2 } else { 1 })
    }

    fn check(&self, _: &Task) -> Result<(), Error> {
        Ok(())
    }

    fn run(&self, task: &Task, place: Place) -> Option<Outcome> {
        let closed = self.closed(task);
        let kind = Cell::Text(if closed { "closed" } else { "open" }.into());
        let columns = 1 + self.ready.criteria_names().len();
        let without_results = |mut outcome: Outcome| {
            outcome.cells[0] = kind.clone();
            outcome
        };
        let one = |ready: &Ready| {
            let trial = (closed, task.seed, false);
            self.limit.watch(place.stop, |watch| trials::one(ready, &self.request, trial, watch))
        };
        let done = match super::is_isolated(&self.ready.graph) {
            true => trials::prepare(&self.system, &self.settings, self.request.algorithm)
                .and_then(|fresh| one(&fresh)),
            false => one(&self.ready),
        };
        match done {
            Ok(None) => self.limit.stopped(place.stop, columns).map(without_results),
            Ok(Some(trial)) => {
                let kept = trial.judgment.iter().map(|(_, kept)| Cell::Integer(u64::from(*kept)));
                let cells = std::iter::once(kind.clone()).chain(kept).collect();
                let status = if trial.problem.is_some() { "failed" } else { "ok" };
                Some(Outcome { status, cause: trial.problem, ..Outcome::ok(cells) })
            }
            Err(error) => Some(without_results(Outcome::failed("failed", columns, error.to_string()))),
        }
    }
}
