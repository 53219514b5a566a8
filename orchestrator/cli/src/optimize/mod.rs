//! `airloop optimize`: a motion for a system of FMUs, with a roll-out as proof.
//!
//! Exit codes: 0 solved, 20 infeasible, 21 not solved, 22 the system could not be evaluated; 1, 2 and 130 as
//! everywhere.

pub mod args;
mod many;
mod text;
mod write;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use self::args::Args;
use super::{folder, output, progress, run};
use airloop::Error;
use airloop_ocp::transcription;
use airloop_optim::Status;
use airloop_plan::deliver;
use airloop_plan::diagnose::Diagnosis;
use airloop_plan::file::{self, Statement};
use airloop_plan::guess::{self, Choice, Rough};
use airloop_plan::prepare::{Prepared, prepare_statement};
use airloop_plan::solve::{Begin, Progress, Session, Settings, Solved};
use airloop_plan::{Error as PlanError, table, verify};
use airloop_plan::{balance, cycle, departure};
use airloop_report::plot;

/// Exit code when no motion keeps the constraints near where the search ended.
pub const INFEASIBLE: u8 = 20;
/// Exit code when the search ended without an optimum.
pub const NOT_SOLVED: u8 = 21;
/// Exit code when the system could not be evaluated.
pub const NO_VALUE: u8 = 22;

/// Communication step of roll-outs \[s\] where nothing is sampled and nothing said.
const DEFAULT_STEP: f64 = 1e-3;

/// Runs the command; the exit code says how the search ended.
///
/// # Errors
/// Fails if the search cannot begin, or its results cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    if args.schema {
        output::print(&file::schema())?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(problem) = &args.problem else { return Ok(ExitCode::from(super::USAGE)) };
    let began = Instant::now();
    let stop = run::stop_flag();
    let mut statement = file::read(problem)?;
    let other = args.variant.as_ref().map(|name| file::variant(&statement, name)).transpose()?;
    let problem = other.as_ref().unwrap_or(problem);
    if other.is_some() {
        statement = file::read(problem)?;
    }
    let settings = settings(args, &mut statement)?;
    let choice = guess::choose(&statement, word(args).as_deref())?;
    let inputs: Vec<PathBuf> = match (&choice, &args.resume) {
        (Choice::File(file), None) => vec![problem.clone(), file.clone()],
        _ => vec![problem.clone()],
    };
    folder::check(&args.output, &inputs, &write::names())?;
    let found = match search(args, statement, &settings, &choice, began, &stop) {
        Err(Error::Plan(error)) if no_value(&error) => {
            output::to_stderr(&format!("error: {error}"));
            return Ok(ExitCode::from(NO_VALUE));
        }
        found => found?,
    };
    let Found { prepared, rough, solved, table, swept, loaded, instances } = &found;
    let diagnosis = match doubtful(solved) && !stop.load(Ordering::Relaxed) {
        true => diagnose(prepared, &settings, rough, solved, args.quiet, &stop)?,
        false => None,
    };
    let verifying = Instant::now();
    let verification = &prepared.statement.verification;
    let rollouts =
        (verification.run && !args.no_verification && !stop.load(Ordering::Relaxed) && finished(solved))
            .then(|| roll_out(prepared, solved, &stop))
            .transpose()?;
    let along = rollouts.as_ref().and_then(|rollouts| rollouts.continuous.as_ref().ok());
    let departure = along.and_then(|rollout| departure::departure(prepared, solved.trajectory(), rollout));
    let closure = cycle::closure(prepared, solved.trajectory(), along)?;
    let forces = match &rollouts {
        Some(_) => balance::recomputed(prepared, solved.trajectory())?,
        None => None,
    };
    let verified = verifying.elapsed();
    let delivery = match finished(solved) && departure.is_none() && !stop.load(Ordering::Relaxed) {
        true => deliver::deliver(prepared, solved.trajectory(), &stop)?,
        false => None,
    };
    let infeasible = diagnosis.is_some() || departure.is_some();
    let swept = swept.as_ref().map(|swept| swept.table(infeasible));
    let table = table.as_ref().or(swept.as_ref());
    let results = write::Results {
        prepared,
        solved,
        rollouts: rollouts.as_ref(),
        delivery: delivery.as_ref(),
        guess: choice.name(&prepared.statement),
        notes: &rough.notes,
        problem_file: problem,
        times: [*loaded, *instances, verified],
        table,
        diagnosis: diagnosis.as_ref(),
        departure: departure.as_ref(),
        closure: closure.as_ref(),
        forces: forces.as_ref(),
        began,
        plots: !args.no_plots,
    };
    let (summary, written) = results.write(&args.output)?;
    if !args.no_plots {
        plot::plan::draw(written.path())?;
    }
    written.commit()?;
    if !args.quiet {
        if let Some(table) = table {
            output::print(&table.text)?;
        }
        let refused = infeasible || !(finished(solved) || solved.status() == &Status::Interrupted);
        output::print(&text::report(&summary, &args.output, !args.no_plots, refused))?;
    }
    if let Some(departure) = departure {
        output::to_stderr(&format!("error: {}\n{departure}", write::NO_SEQUENCE));
        return Ok(ExitCode::from(INFEASIBLE));
    }
    Ok(exit(solved, diagnosis.as_ref(), &stop, &args.output))
}

/// Result of the search.
struct Found {
    prepared: Prepared,
    rough: Rough,
    solved: Solved,
    /// Table of many starts.
    table: Option<many::Table>,
    /// Outcomes of a sweep.
    swept: Option<many::Swept>,
    /// Time of loading, and of making instances.
    loaded: Duration,
    instances: Duration,
}

/// One solve, or many.
fn search(
    args: &Args,
    statement: Statement,
    settings: &Settings,
    choice: &Choice,
    began: Instant,
    stop: &AtomicBool,
) -> Result<Found, Error> {
    let bar = progress::bar(args.quiet, None, BAR);
    let mut monitor = |progress: &Progress| {
        show(&bar, progress);
        if args.verbose {
            bar.suspend(|| output::to_stderr(&text::iteration(progress)));
        }
        if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    if let Some(sweep) = &args.sweep {
        let values = many::values(sweep);
        let steps =
            airloop_plan::sweep::sweep(&statement, settings, choice, (&sweep.name, &values), &mut monitor)?;
        bar.finish_and_clear();
        let swept = Some(many::Swept::new(sweep, &steps));
        let (prepared, rough, solved) = many::last(steps)?;
        let loaded = prepared.load;
        let instances = Duration::ZERO;
        return Ok(Found { prepared, rough, solved, table: None, swept, loaded, instances });
    }
    let mut prepared = prepare_statement(statement, began)?;
    airloop_plan::start::check(&prepared.setup)?;
    if let Some(much) = airloop_plan::size::forecast(&prepared.task, settings)? {
        bar.suspend(|| output::to_stderr(&format!("note: {much}")));
    }
    let rough = guess::guess(&prepared.statement, &prepared.catalog, &prepared.task, choice)?;
    airloop_plan::size::check_samples(rough.durations.iter().sum(), write::step(&prepared))?;
    airloop_plan::vacuous::check(&mut prepared, &rough)?;
    let loaded = began.elapsed();
    if let Some(count) = args.multistart {
        let starts = (count as usize, args.seed);
        let (solved, table) = many::starts(&prepared, settings, &rough, starts, stop, &bar)?;
        bar.finish_and_clear();
        let table = Some(table);
        let instances = Duration::ZERO;
        return Ok(Found { prepared, rough, solved, table, swept: None, loaded, instances });
    }
    let mut session = Session::new(&prepared, settings.threads)?;
    let instances = began.elapsed() - loaded;
    let solved = session.solve(&prepared.setup, settings, Begin::From(&rough), &mut monitor)?;
    bar.finish_and_clear();
    Ok(Found { prepared, rough, solved, table: None, swept: None, loaded, instances })
}

/// Whether the system could not be evaluated where it has to be.
fn no_value(error: &PlanError) -> bool {
    matches!(
        error,
        PlanError::Evaluation(_)
            | PlanError::Solver(airloop_optim::Error::Start(_))
            | PlanError::Coupled(airloop_cosim::coupled::Error::Fmu(_))
            | PlanError::Transcription(
                transcription::Error::Evaluation(_)
                    | transcription::Error::Solver(airloop_optim::Error::Start(_))
            )
    )
}

/// The guess that the command line names.
fn word(args: &Args) -> Option<String> {
    let resumed = args.resume.as_ref().map(|folder| folder.join(write::TRAJECTORY).display().to_string());
    resumed.or_else(|| args.guess.clone())
}

/// Settings of the file, with what the command line says otherwise.
fn settings(args: &Args, statement: &mut Statement) -> Result<Settings, Error> {
    if let Some(choice) = args.transcription {
        statement.settings.transcription = choice.into();
    }
    let phases = statement.phases.len();
    let mut settings = Settings::of(statement);
    if let Some(intervals) = &args.intervals {
        let last = settings.passes.len() - 1;
        let counts: Vec<usize> = intervals.iter().map(|&count| count as usize).collect();
        settings.passes[last].intervals = match counts[..] {
            [one] => vec![one; phases],
            _ if counts.len() == phases => counts,
            _ => {
                let place = "--intervals".to_owned();
                let problem = format!(
                    "{} numbers for {phases} phases; give one number, or one per phase",
                    counts.len()
                );
                return Err(PlanError::Place { place, problem }.into());
            }
        };
    }
    if let Some(tolerance) = args.tolerance {
        settings.tolerance = tolerance;
    }
    if let Some(limit) = args.max_iterations {
        settings.max_iterations = limit as usize;
    }
    if let Some(duration) = args.duration {
        let quantity = |place| file::Quantity { value: duration, unit: None, place };
        match &mut statement.phases[..] {
            [phase] => phase.duration = file::phase::Duration::Quantity(quantity(phase.place)),
            _ => {
                let problem = "it sets the duration of one phase, and the problem has several".to_owned();
                return Err(PlanError::Place { place: "--duration".into(), problem }.into());
            }
        }
    }
    let processors = std::thread::available_parallelism().map_or(1, usize::from).min(8);
    settings.threads = args.threads.map_or(processors, |threads| threads as usize);
    Ok(settings)
}

/// Iterations after which a search that keeps to no feasible point is taken for infeasible, if a limit can be blamed.
const MIN_ITERATIONS_TO_BLAME_A_LIMIT: usize = 100;

/// Whether limits may be why there is no plan. Of several phases [`Solved::conflict`] says which ones are.
fn doubtful(solved: &Solved) -> bool {
    let violated = solved.worst.is_some();
    if solved.trajectory().phases.len() > 1 {
        return false;
    }
    match solved.status() {
        Status::Infeasible => true,
        Status::Stalled | Status::IterationLimit => {
            violated && solved.iterations() >= MIN_ITERATIONS_TO_BLAME_A_LIMIT
        }
        _ => false,
    }
}

/// The limit that stands in the way.
fn diagnose(
    prepared: &Prepared,
    settings: &Settings,
    rough: &Rough,
    solved: &Solved,
    quiet: bool,
    stop: &AtomicBool,
) -> Result<Option<Diagnosis>, Error> {
    let bar = progress::bar(quiet, None, BAR);
    bar.set_message("which limit stands in the way?");
    let mut monitor = |_: &Progress| {
        bar.tick();
        if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let suspect = solved.last().solution.blocking.as_ref().map(|blocking| blocking.name.as_str());
    let found =
        airloop_plan::diagnose::diagnose(prepared, settings, Begin::From(rough), suspect, &mut monitor)?;
    bar.finish_and_clear();
    Ok(found)
}

/// Whether there is a plan to roll out.
fn finished(solved: &Solved) -> bool {
    matches!(solved.status(), Status::Solved | Status::Acceptable)
}

/// Form of the line of progress.
const BAR: &str = "{spinner} {msg}";

fn show(bar: &ProgressBar, progress: &Progress) {
    let iteration = progress.iteration;
    bar.set_message(format!(
        "{} with {} intervals: iteration {}, objective {:.6e}, violation {:.1e}, optimality {:.1e}",
        file::transcription_name(progress.pass.transcription),
        progress.pass.intervals.iter().sum::<usize>(),
        iteration.number,
        iteration.objective,
        iteration.violation,
        iteration.dual_infeasibility
    ));
    bar.tick();
}

fn roll_out(prepared: &Prepared, solved: &Solved, stop: &Arc<AtomicBool>) -> Result<verify::Rollouts, Error> {
    let verification = &prepared.statement.verification;
    let said = verification.step.as_ref();
    let said = said.map(|step| airloop_plan::task::seconds(&prepared.statement.source, step)).transpose()?;
    let step = said.unwrap_or_else(|| write::step(prepared));
    let options = verify::Options { master: verification.master, step, tolerance: verification.tolerance };
    let first = &solved.trajectory().phases[0];
    let states = (&prepared.task.signals.states[..], &first.states[0][..]);
    let rolled = table::with_command(prepared, solved.trajectory(), |command| {
        verify::roll_out(&prepared.graph, &prepared.catalog, states, command, options, stop)
    });
    Ok(rolled?)
}

fn exit(solved: &Solved, diagnosis: Option<&Diagnosis>, stop: &AtomicBool, folder: &Path) -> ExitCode {
    let kept = || {
        output::to_stderr(&format!(
            "interrupted; the best point so far is in {}; go on with --resume {}",
            folder.join(write::TRAJECTORY).display(),
            folder.display()
        ));
        ExitCode::from(super::INTERRUPTED)
    };
    if let Some(diagnosis) = diagnosis {
        output::to_stderr(&format!("error: {}\n{diagnosis}", write::NO_MOTION));
        return ExitCode::from(INFEASIBLE);
    }
    match solved.status() {
        Status::Interrupted => kept(),
        Status::Solved | Status::Acceptable if stop.load(Ordering::Relaxed) => kept(),
        Status::Solved | Status::Acceptable => ExitCode::SUCCESS,
        status => {
            let worst = solved.worst.as_ref().map_or(String::new(), |worst| format!("\n{worst}"));
            output::to_stderr(&format!("error: {status}{worst}"));
            ExitCode::from(match status {
                Status::Infeasible => INFEASIBLE,
                Status::EvaluationFailed(_) => NO_VALUE,
                _ => NOT_SOLVED,
            })
        }
    }
}
