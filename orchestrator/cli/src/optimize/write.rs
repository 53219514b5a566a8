//! The folder of a plan: trajectory, command, roll-outs, iterations, summary.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use super::many::{MULTISTART, SWEEP, Table};
use crate::folder;
use airloop::Error;
use airloop_cosim::results::summary::FmuRecord;
use airloop_ocp::transcription::IntervalErrors;
use airloop_optim::{Note, Status};
use airloop_plan::balance::Recomputed;
use airloop_plan::cycle::Closure;
use airloop_plan::deliver::Delivery;
use airloop_plan::departure::Departure;
use airloop_plan::diagnose::Diagnosis;
use airloop_plan::file::transcription_name;
use airloop_plan::prepare::Prepared;
use airloop_plan::recheck::{Recheck, recheck};
use airloop_plan::record::{
    self, AnimationRecord, FinalError, PassRecord, SCHEMA_VERSION, SignalRecord, StickRecord, Summary, Times,
};
use airloop_plan::solve::{Done, Solved};
use airloop_plan::verify::{Rollout, Rollouts};
use airloop_plan::{Error as PlanError, table};
pub use airloop_report::plot::plan::TRAJECTORY;
use airloop_report::plot::plan::{CONTINUOUS, DEFECTS, FORCES, MORE_FIGURES, SAMPLED, figure_files};
use airloop_series::csv;

/// The command, for `airloop run --input`.
const COMMAND: &str = "command.csv";
/// Motions of the plant under the delivered forces of each kind of command.
const CHAINS: [&str; 2] = ["closed_chain_optimized.csv", "closed_chain_naive.csv"];
/// The iteration table.
const ITERATIONS: &str = "iterations.csv";

/// Status where a limit can be blamed.
pub const NO_MOTION: &str = "infeasible: no motion was found that keeps all limits; relax the one that is named, or give it more time";

/// Status where the events of the system do not lead through the phases.
pub const NO_SEQUENCE: &str = "infeasible: the system does not go through the phases as planned";

/// Every file that may be written.
pub fn names() -> Vec<String> {
    let files = [
        TRAJECTORY,
        COMMAND,
        ITERATIONS,
        CONTINUOUS,
        SAMPLED,
        MULTISTART,
        SWEEP,
        FORCES,
        CHAINS[0],
        CHAINS[1],
        "index.html",
        "summary.json",
    ];
    let more = MORE_FIGURES.map(str::to_owned);
    files.map(str::to_owned).into_iter().chain(figure_files(true, true)).chain(more).collect()
}

/// Files and figures of a run.
pub struct Results<'a> {
    /// The problem.
    pub prepared: &'a Prepared,
    /// The plan.
    pub solved: &'a Solved,
    /// Its roll-outs.
    pub rollouts: Option<&'a Rollouts>,
    /// Commands of actuators and what they bring about, where the problem asks for them.
    pub delivery: Option<&'a Delivery>,
    /// Name of the guess.
    pub guess: String,
    /// Notes on the guess.
    pub notes: &'a [String],
    /// Problem file.
    pub problem_file: &'a Path,
    /// Times of loading, of making instances, and of the roll-outs.
    pub times: [Duration; 3],
    /// Time at which the command began.
    pub began: Instant,
    /// Table of many solves, where there were many.
    pub table: Option<&'a Table>,
    /// The limit that stands in the way, where one does.
    pub diagnosis: Option<&'a Diagnosis>,
    /// The phase that the system does not enter or keep as planned, where there is one.
    pub departure: Option<&'a Departure>,
    /// How a motion that repeats itself closes.
    pub closure: Option<&'a Closure>,
    /// Forces of constraints recomputed from the energy.
    pub forces: Option<&'a Recomputed>,
    /// Whether figures are drawn.
    pub plots: bool,
}

/// Step \[s\] of the command: the sample time, or a millisecond.
pub fn step(prepared: &Prepared) -> f64 {
    prepared.sampling.as_ref().map_or(super::DEFAULT_STEP, |sampling| sampling.sample_time)
}

impl Results<'_> {
    /// Writes everything but the figures for `folder`; gives the summary, and the files that are still to be put there.
    ///
    /// # Errors
    /// Fails if a file or the folder cannot be made, removed or written.
    pub fn write(&self, folder: &Path) -> Result<(Summary, folder::Results), Error> {
        let plan = self.solved.trajectory();
        let trajectory = table::trajectory(self.prepared, plan)?;
        let step = step(self.prepared);
        let catalog = &self.prepared.catalog;
        let command = table::with_command(self.prepared, plan, |command| command.sampled(catalog, step))?;
        let mut tables = vec![(TRAJECTORY, trajectory), (COMMAND, command)];
        tables.push((DEFECTS, table::defects(self.prepared, plan, &self.solved.errors)?));
        let mut notes = self.solved.notes.clone();
        let rolled = self.rollouts.map(|rollouts| {
            [(CONTINUOUS, "continuous", &rollouts.continuous), (SAMPLED, "sampled", &rollouts.sampled)]
        });
        for (file, name, rollout) in rolled.into_iter().flatten() {
            match rollout {
                Ok(rollout) => {
                    notes.extend(rollout.problem.iter().map(|problem| format!("{name} roll-out: {problem}")));
                    if !rollout.states.is_empty() && !rollout.states.channels().is_empty() {
                        tables.push((file, rollout.states.clone()));
                    }
                }
                Err(error) => notes.push(format!("there is no {name} roll-out: {error}")),
            }
        }
        if let Some(delivery) = self.delivery {
            tables.push((FORCES, delivery.table.clone()));
            for (file, motion) in CHAINS.iter().zip(delivery.motions.iter().flatten()) {
                tables.push((file, motion.result.clone()));
            }
        }
        let files = tables.iter().map(|(name, _)| *name).chain([ITERATIONS]);
        let files: Vec<&str> = files.chain(self.table.map(|table| table.name)).collect();
        let summary = self.summary(&files, notes);
        let results = folder::Results::open(folder, &[], &names())?;
        let folder = results.path();
        record::write(&summary, &folder.join("summary.json")).map_err(airloop_report::plot::Error::from)?;
        for (name, series) in &tables {
            csv::write(series, &folder.join(name))?;
        }
        if let Some(table) = self.table {
            let path = folder.join(table.name);
            let written = airloop_series::file::write_whole(&path, |out| out.write_all(table.csv.as_bytes()));
            written.map_err(|source| csv::Error::Io { path, source })?;
        }
        iterations(&self.solved.done, &folder.join(ITERATIONS))?;
        Ok((summary, results))
    }

    fn summary(&self, files: &[&str], more: Vec<String>) -> Summary {
        let Results { prepared, solved, .. } = self;
        let (statement, graph, last) = (&prepared.statement, &prepared.graph, solved.last());
        let guids = graph.components.iter().map(|component| component.fmu.description.guid.as_str());
        let finite = |value: f64| value.is_finite().then_some(value);
        let sum = |pick: fn(&Done) -> Duration| solved.done.iter().map(pick).sum::<Duration>().as_secs_f64();
        let [loaded, instances, verified] = self.times.map(|time| time.as_secs_f64());
        let errors = self.rollouts.map(|rollouts| self.final_errors(rollouts));
        let norm = |errors: &BTreeMap<String, f64>| errors.values().map(|e| e * e).sum::<f64>().sqrt();
        let signals = table::records(prepared, solved.trajectory());
        let portrait = self.portrait(&signals);
        let mut figures = if self.plots { figure_files(portrait.is_some(), true) } else { Vec::new() };
        let drawn = [statement.stick_figure.is_some(), self.delivery.is_some()];
        let drawn = MORE_FIGURES.iter().zip(drawn).filter(|(_, wanted)| *wanted && self.plots);
        figures.splice(0..0, drawn.map(|(name, _)| (*name).to_owned()));
        let stick_figure = StickRecord::of(prepared);
        let animation = statement.animation.as_ref().map(|animation| AnimationRecord {
            cart: self.shown(&animation.cart.text),
            angle: self.shown(&animation.angle.text),
            length: animation.length,
        });
        Summary {
            schema_version: SCHEMA_VERSION,
            airloop_version: env!("CARGO_PKG_VERSION").into(),
            command: "optimize".into(),
            problem: statement.name.clone(),
            problem_file: self.problem_file.into(),
            problem_hash: statement.source.hash(guids),
            system: graph.name.clone(),
            system_file: statement.system_file.clone(),
            transcription: transcription_name(last.pass.transcription).into(),
            intervals: solved.trajectory().phases.iter().map(|phase| phase.intervals()).collect(),
            guess: self.guess.clone(),
            status: match (self.diagnosis, self.departure) {
                (None, None) => status_name(&last.solution.status),
                _ => "infeasible",
            }
            .into(),
            message: match (self.diagnosis, self.departure) {
                (Some(_), _) => NO_MOTION.into(),
                (None, Some(_)) => NO_SEQUENCE.into(),
                (None, None) => last.solution.status.to_string(),
            },
            objective: finite(last.solution.objective),
            iterations: solved.iterations(),
            max_defect: solved.max_defect,
            max_bound_violation: solved.max_bound_violation,
            worst: match (self.diagnosis, self.departure) {
                (Some(diagnosis), _) => Some(diagnosis.to_string()),
                (None, Some(departure)) => Some(departure.to_string()),
                (None, None) => solved.worst.as_ref().map(ToString::to_string),
            },
            blocking: last.solution.blocking.as_ref().map(|one| format!("most in the way: {one}")),
            phase_durations: solved
                .trajectory()
                .phases
                .iter()
                .map(|phase| (phase.name.clone(), phase.end() - phase.begin()))
                .collect(),
            durations: solved.trajectory().phases.iter().map(|phase| phase.end() - phase.begin()).collect(),
            open_loop_final_error: errors.as_ref().map(|errors| FinalError {
                continuous: errors.continuous.as_ref().map(norm),
                sampled: errors.sampled.as_ref().map(norm),
            }),
            open_loop_final_state_error: errors,
            recheck: self.recheck(),
            cycle: self.closure.cloned(),
            max_interval_error: solved.errors.iter().map(IntervalErrors::largest).reduce(f64::max),
            time: Times {
                load: loaded,
                build: instances + sum(|done| done.build),
                solve: sum(|done| done.solve),
                verify: verified,
                total: self.began.elapsed().as_secs_f64(),
            },
            passes: solved.done.iter().map(pass).collect(),
            variables: last.solution.x.len(),
            constraints: last.solution.multipliers.constraints.len(),
            signals,
            portrait,
            animation,
            stick_figure,
            fmus: graph.order.iter().map(|&index| fmu(graph, index)).collect(),
            stage2: self.delivery.map(record::stage2),
            closed_chain: self.delivery.and_then(record::closed_chain),
            files: files.iter().map(|&name| name.to_owned()).collect(),
            figures,
            notes: prepared.notes.iter().chain(self.notes).cloned().chain(more).collect(),
        }
    }

    /// The column of a variable.
    fn shown(&self, name: &str) -> String {
        let catalog = &self.prepared.catalog;
        catalog.find(name).map_or(name.into(), |(index, _)| catalog.variables()[index].name.clone())
    }

    /// The angle of the animation, or the first state, with the state whose unit is that of its rate.
    fn portrait(&self, signals: &[SignalRecord]) -> Option<(String, String)> {
        let states: Vec<&SignalRecord> = signals.iter().filter(|signal| signal.kind == "state").collect();
        let angle = self.prepared.statement.animation.as_ref().map(|one| self.shown(&one.angle.text));
        let x = states.iter().find(|state| Some(&state.name) == angle.as_ref()).or(states.first())?;
        let rate = format!("{}/s", x.unit.as_deref()?);
        let y = states.iter().find(|state| state.unit.as_deref() == Some(&rate))?;
        Some((x.name.clone(), y.name.clone()))
    }

    /// The continuous roll-out against the plan.
    fn recheck(&self) -> Option<Recheck> {
        let rollout = self.rollouts?.continuous.as_ref().ok()?;
        let checked = recheck(self.prepared, self.solved.trajectory(), rollout);
        Some(Recheck { forces: self.forces.cloned(), ..checked })
    }

    fn final_errors(&self, rollouts: &Rollouts) -> FinalError<BTreeMap<String, f64>> {
        let of = |rollout: &Result<Rollout, PlanError>| {
            let rollout = rollout.as_ref().ok().filter(|rollout| rollout.problem.is_none())?;
            let last = self.solved.trajectory().phases.last()?;
            let planned = last.states.last()?;
            let names = self.prepared.task.signals.states.iter();
            let names = names.map(|&index| &self.prepared.catalog.variables()[index].name);
            let errors = names.zip(planned).filter_map(|(name, planned)| {
                let reached = rollout.states.channel(name)?.values.last()?;
                Some((name.clone(), reached - planned))
            });
            Some(errors.collect::<BTreeMap<String, f64>>())
        };
        FinalError { continuous: of(&rollouts.continuous), sampled: of(&rollouts.sampled) }
    }
}

fn pass(done: &Done) -> PassRecord {
    let solution = &done.solution;
    PassRecord {
        transcription: transcription_name(done.pass.transcription).into(),
        intervals: done.pass.intervals.clone(),
        status: status_name(&solution.status).into(),
        objective: solution.objective.is_finite().then_some(solution.objective),
        iterations: done.iterations(),
        function_evaluations: solution.evaluations.functions,
        factorizations: solution.evaluations.factorizations,
        time: (done.build + done.solve).as_secs_f64(),
    }
}

/// Word of a status in summaries and tables.
pub fn status_name(status: &Status) -> &'static str {
    match status {
        Status::Solved => "solved",
        Status::Acceptable => "acceptable",
        Status::Infeasible => "infeasible",
        Status::Diverging => "diverging",
        Status::IterationLimit => "iteration_limit",
        Status::Interrupted => "interrupted",
        Status::Stalled => "stalled",
        Status::EvaluationFailed(_) => "evaluation_failed",
    }
}

fn fmu(graph: &airloop_cosim::system::SystemGraph, index: usize) -> FmuRecord {
    let component = &graph.components[index];
    let description = &component.fmu.description;
    let text = |text: &str| (!text.is_empty()).then(|| text.to_owned());
    FmuRecord {
        component: component.name.clone(),
        model_name: description.model_name.clone(),
        guid: description.guid.clone(),
        path: component.fmu.shown.clone(),
        version: text(&description.version),
        generation_tool: text(&description.generation_tool),
    }
}

/// Every iteration of every solve.
fn iterations(done: &[Done], path: &Path) -> Result<(), Error> {
    airloop_series::file::write_whole(path, |out| {
        writeln!(
            out,
            "solve,iteration,objective,violation,dual_infeasibility,barrier,step,step_length,regularization,note"
        )?;
        for (number, done) in done.iter().enumerate() {
            for row in &done.solution.iterations {
                let note = match row.note {
                    Note::None => "",
                    Note::SecondOrderCorrection => "second_order_correction",
                    Note::Restoration => "restoration",
                    Note::QuadraticProgram => "quadratic_program",
                };
                writeln!(
                    out,
                    "{},{},{:e},{:e},{:e},{:e},{:e},{:e},{:e},{note}",
                    number + 1,
                    row.number,
                    row.objective,
                    row.violation,
                    row.dual_infeasibility,
                    row.barrier,
                    row.step,
                    row.step_length,
                    row.regularization
                )?;
            }
        }
        Ok(())
    })
    .map_err(|source| csv::Error::Io { path: path.into(), source }.into())
}
