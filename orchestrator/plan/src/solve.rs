//! From a prepared problem and a guess to a trajectory: one solve, or a chain of them, each from the one before.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::Error;
use super::assemble;
use super::cycle::Return;
use super::file::statement::{MeshRefinement, Statement};
use super::guess::Rough;
use super::prepare::{Prepared, Setup};
use super::size;
use super::task::Task;
use airloop_ocp::transcription::{
    self, Discretization, Dynamics, Interpolation, IntervalErrors, Link, Mesh, Outcome, PhaseTrajectory,
    Problem, Program, Refinement, Trajectory, Transcription, Violation, interval_errors, refined, solve_on,
};
use airloop_optim::{Iteration, Method, Solution, Status};

/// One solve of a chain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pass {
    /// Transcription.
    pub transcription: Transcription,
    /// Intervals of every phase.
    pub intervals: Vec<usize>,
}

/// Settings for solving a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The chain of solves, at least one.
    pub passes: Vec<Pass>,
    /// Method of the first solve; the later ones start near their solution.
    pub method: Method,
    /// Scaled KKT error at which a problem counts as solved.
    pub tolerance: f64,
    /// Iterations of one solve at most.
    pub max_iterations: usize,
    /// Threads that evaluate the dynamics.
    pub threads: usize,
    /// Splitting of intervals after the last solve.
    pub mesh: Option<MeshRefinement>,
}

impl Settings {
    /// The settings of a problem file.
    pub fn of(statement: &Statement) -> Settings {
        let settings = &statement.settings;
        let of_phases = |count: usize| -> Vec<usize> {
            statement.phases.iter().map(|phase| phase.intervals.unwrap_or(count)).collect()
        };
        let before = settings.before.iter().map(|pass| Pass {
            transcription: pass.transcription.unwrap_or(settings.transcription),
            intervals: vec![pass.intervals; statement.phases.len()],
        });
        let last = Pass { transcription: settings.transcription, intervals: of_phases(settings.intervals) };
        Settings {
            passes: before.chain([last]).collect(),
            method: settings.method,
            tolerance: settings.tolerance,
            max_iterations: settings.max_iterations,
            threads: 1,
            mesh: settings.mesh,
        }
    }
}

/// Outcome of a solve of the chain.
#[derive(Debug, Clone)]
pub struct Done {
    /// Settings of the solve.
    pub pass: Pass,
    /// Solution of the problem.
    pub solution: Solution,
    /// Wall-clock time up to the first iteration.
    pub build: Duration,
    /// Wall-clock time from there on.
    pub solve: Duration,
}

impl Done {
    /// Iterations; the first row of the table is the start.
    pub fn iterations(&self) -> usize {
        self.solution.iterations.len().saturating_sub(1)
    }
}

/// A plan.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The last solve; also one that was interrupted or failed.
    pub outcome: Outcome,
    /// All solves.
    pub done: Vec<Done>,
    /// Largest defect, unscaled.
    pub max_defect: f64,
    /// Largest violation of a bound or condition.
    pub max_bound_violation: f64,
    /// Largest violation, where it exceeds the tolerance.
    pub worst: Option<Violation>,
    /// Errors between the knots, phase by phase.
    pub errors: Vec<IntervalErrors>,
    /// Requests that the solver could not fulfill, one sentence each.
    pub notes: Vec<String>,
    /// Limits violated by the motion that violates limits least, where no motion was found; the worst first.
    pub conflict: Vec<Violation>,
}

impl Solved {
    /// The last solve.
    ///
    /// # Panics
    /// Never: there is at least one.
    pub fn last(&self) -> &Done {
        &self.done[self.done.len() - 1]
    }

    /// The trajectory of the last solve.
    pub fn trajectory(&self) -> &Trajectory {
        &self.outcome.trajectory
    }

    /// Iterations of all solves; the first row of each table is its start.
    pub fn iterations(&self) -> usize {
        self.done.iter().map(Done::iterations).sum()
    }

    /// Outcome of the last solve.
    pub fn status(&self) -> &Status {
        &self.last().solution.status
    }
}

/// Progress as the caller sees it.
pub struct Progress<'a> {
    /// Number of the solve, from 0.
    pub number: usize,
    /// The solve.
    pub pass: &'a Pass,
    /// The last iteration.
    pub iteration: &'a Iteration,
}

/// Called after every iteration; `Break` ends the run with the last point.
pub type Monitor<'m> = dyn FnMut(&Progress) -> ControlFlow<()> + 'm;

/// Violations of more than this, in their own units, are reported by name.
const MIN_REPORTED_VIOLATION: f64 = 1e-8;

/// Iterations after which phases that may not fit together are looked at, and of that look.
const ITERATIONS_BEFORE_CONFLICT_CHECK: usize = 150;
/// Most intervals of a phase there, and the stop test of the solver.
const MAX_INTERVALS_OF_CONFLICT_CHECK: usize = 10;
const TOLERANCE_OF_CONFLICT: f64 = 1e-6;

/// A problem with instances of its dynamics, for one or several solves.
pub struct Session {
    problem: Problem,
}

impl Session {
    /// Makes as many instances of the dynamics as there are threads.
    ///
    /// # Errors
    /// [`Error::Evaluation`] when an FMU cannot be instantiated again.
    pub fn new(prepared: &Prepared, threads: usize) -> Result<Session, Error> {
        Session::with_task(prepared, &prepared.task, threads)
    }

    /// Same as [`Session::new`], for another task on the same states, inputs and outputs.
    ///
    /// # Errors
    /// Same as [`Session::new`].
    pub fn with_task(prepared: &Prepared, task: &Task, threads: usize) -> Result<Session, Error> {
        let mut dynamics: Vec<Vec<Box<dyn Dynamics>>> = Vec::new();
        for one in &prepared.dynamics {
            dynamics.push((0..threads.max(1)).map(|_| one.duplicate()).collect::<Result<_, _>>()?);
        }
        let sampled = (&prepared.sampled_states[..], prepared.sampling.as_ref());
        let links = prepared.resets.iter().map(|reset| match reset {
            Some(jump) => jump.link(),
            None => Ok(Link::continuous()),
        });
        let links = links.collect::<Result<_, _>>()?;
        let mut problem = assemble::problem(task, &prepared.catalog, dynamics, links, sampled);
        problem.cycle = prepared.cycle.as_ref().map(Return::link).transpose()?;
        Ok(Session { problem })
    }

    /// The problem with its instances, for a solver that is kept.
    pub fn into_problem(self) -> Problem {
        self.problem
    }

    /// Solves from a guess.
    ///
    /// # Errors
    /// Fails if the solver cannot begin; how it ended is in [`Solved::status`].
    pub fn solve(
        &mut self,
        setup: &Setup,
        settings: &Settings,
        begin: Begin,
        monitor: &mut Monitor,
    ) -> Result<Solved, Error> {
        size::forecast(&setup.task, settings)?;
        for pass in &settings.passes {
            let sampling = setup.sampling.as_ref();
            let (statement, task) = (&setup.statement, &setup.task);
            assemble::check_samples(statement, task, sampling, pass.transcription, &pass.intervals)?;
        }
        let (mut done, mut notes, mut conflict) = (Vec::new(), Vec::new(), Vec::new());
        let mut found: Option<Outcome> = None;
        for (number, pass) in settings.passes.iter().enumerate() {
            let from = found.as_ref().map_or(begin, Begin::At);
            let patient = Settings {
                max_iterations: settings.max_iterations.min(ITERATIONS_BEFORE_CONFLICT_CHECK),
                ..settings.clone()
            };
            // Where phases do not fit together a search takes long and reveals little.
            let rough = match from {
                Begin::From(rough) if setup.task.phases.len() > 1 => Some(rough),
                _ => None,
            };
            let first = if rough.is_some() { &patient } else { settings };
            let mut next = self.one(setup, first, (number, &uniform(pass)), from, monitor)?;
            if let Some(rough) = rough.filter(|_| failed(&next.1.solution)) {
                conflict = self.conflict(setup, settings, pass, rough, monitor)?;
                if !conflict.is_empty() {
                    next.1.solution.status = Status::Infeasible;
                } else if next.1.solution.status == Status::IterationLimit
                    && patient.max_iterations < settings.max_iterations
                {
                    next = self.one(setup, settings, (number, &uniform(pass)), from, monitor)?;
                }
            }
            if number == 0
                && is_lost(&next.1, settings)
                && let Some(passes) = coarser(pass)
                && let Some(mut others) = self.by_way_of(setup, settings, passes, begin, monitor)?
            {
                notes.push(format!(
                    "from the guess nothing was found on the mesh asked for ({} iterations); the plan comes from \
                     coarser meshes",
                    next.1.iterations()
                ));
                let last = others.pop().unwrap_or(next);
                done.extend(others.into_iter().map(|other| other.1));
                next = last;
            }
            let ended = failed(&next.0.solution);
            done.push(next.1);
            found = Some(next.0);
            if ended {
                break;
            }
        }
        let Some(mut outcome) = found else {
            let problem = "there is no solve at all; give at least one".into();
            return Err(Error::Place { place: "the chain of solves".into(), problem });
        };
        let mut errors = interval_errors(&mut self.problem, &outcome.trajectory)?;
        for _ in 0..settings.mesh.map_or(0, |mesh| mesh.rounds) {
            let tolerance = settings.mesh.map_or(0.0, |mesh| mesh.tolerance);
            let refinement = Refinement { tolerance, ..Refinement::default() };
            let finer = refined(&outcome.discretization, &errors, &refinement);
            let Some(finer) = finer.filter(|_| !failed(&outcome.solution)) else { break };
            match self.one(setup, settings, (done.len(), &finer), Begin::At(&outcome), monitor) {
                Ok((next, one)) => {
                    done.push(one);
                    outcome = next;
                }
                Err(error) => {
                    notes.push(format!("the mesh is not refined further: {error}"));
                    break;
                }
            }
            errors = interval_errors(&mut self.problem, &outcome.trajectory)?;
        }
        let mut program = Program::new(&mut self.problem, &outcome.discretization)?;
        let violations = program.violations(&outcome.solution.x, 0.0)?;
        let (defects, others): (Vec<_>, Vec<_>) =
            violations.iter().partition(|violation| violation.name.starts_with("defect of "));
        let largest = |list: &[&Violation]| list.iter().map(|one| one.amount).fold(0.0, f64::max);
        let (max_defect, max_bound_violation) = (largest(&defects), largest(&others));
        // What the user asked for says more than an equation of the program.
        let worst = others.first().or(defects.first()).filter(|worst| worst.amount > MIN_REPORTED_VIOLATION);
        let worst = conflict.first().or(worst.copied()).cloned();
        notes.extend(
            conflict.iter().skip(1).map(|one| format!("the motion that breaks least also breaks {one}")),
        );
        Ok(Solved { outcome, done, max_defect, max_bound_violation, worst, errors, notes, conflict })
    }

    /// Limits that have to be violated, found on a coarse mesh, or on the own one where that is too coarse to tell;
    /// nothing where all limits can be kept or it cannot be told.
    fn conflict(
        &mut self,
        setup: &Setup,
        settings: &Settings,
        pass: &Pass,
        rough: &Rough,
        monitor: &mut Monitor,
    ) -> Result<Vec<Violation>, Error> {
        let options = airloop_optim::Settings {
            tolerance: TOLERANCE_OF_CONFLICT,
            max_iterations: settings.max_iterations.min(ITERATIONS_BEFORE_CONFLICT_CHECK),
            ..airloop_optim::Settings::default()
        };
        let (statement, task, sampling) = (&setup.statement, &setup.task, setup.sampling.as_ref());
        // With states in the middle of their own a motion comes nearer to what cannot be done.
        let transcription = match pass.transcription {
            Transcription::HermiteSimpson => Transcription::HermiteSimpsonSeparated,
            other => other,
        };
        for most in [MAX_INTERVALS_OF_CONFLICT_CHECK, usize::MAX] {
            let intervals: Vec<usize> = pass.intervals.iter().map(|&count| count.min(most)).collect();
            let pass = Pass { transcription, intervals };
            if assemble::check_samples(statement, task, sampling, pass.transcription, &pass.intervals)
                .is_err()
            {
                continue;
            }
            let on = uniform(&pass);
            let guess = knots(setup, rough, &on)?;
            let mut watch = |iteration: &Iteration| monitor(&Progress { number: 0, pass: &pass, iteration });
            let found = transcription::conflict(&mut self.problem, &on, &guess, &options, &mut watch)?;
            if let Some(found) = found {
                return Ok(found.violations);
            }
        }
        Ok(Vec::new())
    }

    /// Solves meshes one from the other; none where one of them fails or cannot be begun.
    fn by_way_of(
        &mut self,
        setup: &Setup,
        settings: &Settings,
        passes: Vec<Pass>,
        begin: Begin,
        monitor: &mut Monitor,
    ) -> Result<Option<Vec<(Outcome, Done)>>, Error> {
        let (statement, task, sampling) = (&setup.statement, &setup.task, setup.sampling.as_ref());
        let mut all: Vec<(Outcome, Done)> = Vec::new();
        for (number, pass) in passes.iter().enumerate() {
            // A longer interval may be no whole number of samples.
            if assemble::check_samples(statement, task, sampling, pass.transcription, &pass.intervals)
                .is_err()
            {
                return Ok(None);
            }
            let from = all.last().map_or(begin, |before| Begin::At(&before.0));
            let next = self.one(setup, settings, (number, &uniform(pass)), from, monitor)?;
            if failed(&next.0.solution) {
                return Ok(None);
            }
            all.push(next);
        }
        Ok(Some(all))
    }

    fn one(
        &mut self,
        setup: &Setup,
        settings: &Settings,
        (number, discretization): (usize, &Discretization),
        begin: Begin,
        monitor: &mut Monitor,
    ) -> Result<(Outcome, Done), Error> {
        let began = Instant::now();
        let intervals = discretization.meshes.iter().map(Mesh::intervals).collect();
        let pass = Pass { transcription: discretization.transcription, intervals };
        let guess = match begin {
            Begin::From(rough) => Some(knots(setup, rough, discretization)?),
            Begin::Along(_) | Begin::At(_) => None,
        };
        let (from, method) = match (&guess, begin) {
            (Some(guess), _) => (transcription::From::Guess(guess), settings.method),
            (None, Begin::Along(trajectory)) => (transcription::From::Guess(trajectory), settings.method),
            (None, Begin::At(outcome)) => (transcription::From::Outcome(outcome), Method::InteriorPoint),
            (None, Begin::From(_)) => unreachable!("a rough guess has knots"),
        };
        let options = airloop_optim::Settings {
            method,
            tolerance: settings.tolerance,
            max_iterations: settings.max_iterations,
            ..airloop_optim::Settings::default()
        };
        let mut build = None;
        let mut watch = |iteration: &Iteration| {
            build.get_or_insert_with(|| began.elapsed());
            monitor(&Progress { number, pass: &pass, iteration })
        };
        let outcome = solve_on(&mut self.problem, discretization, from, &options, &mut watch)?;
        let total = began.elapsed();
        let build = build.unwrap_or(total);
        let solution = outcome.solution.clone();
        Ok((outcome, Done { pass, solution, build, solve: total - build }))
    }
}

fn uniform(pass: &Pass) -> Discretization {
    Discretization::uniform(pass.transcription, &pass.intervals)
}

/// Iterations that a solve has to be allowed before coarser meshes are tried: with fewer, the caller wants an early
/// end.
const MIN_ITERATIONS_FOR_COARSER_MESHES: usize = 400;
/// Fewest intervals of a phase of a coarser mesh.
const MIN_INTERVALS_OF_COARSER_MESH: usize = 5;

/// Whether a solve from a rough guess failed to converge.
fn is_lost(done: &Done, settings: &Settings) -> bool {
    settings.max_iterations >= MIN_ITERATIONS_FOR_COARSER_MESHES
        && matches!(done.solution.status, Status::Stalled | Status::IterationLimit)
}

/// A quarter and a half of the intervals, then all; none where there are too few.
fn coarser(pass: &Pass) -> Option<Vec<Pass>> {
    let divides = |&count: &usize| count % 4 == 0 && count >= 4 * MIN_INTERVALS_OF_COARSER_MESH;
    let part = |by: usize| Pass {
        transcription: pass.transcription,
        intervals: pass.intervals.iter().map(|count| count / by).collect(),
    };
    pass.intervals.iter().all(divides).then(|| [4, 2, 1].map(part).to_vec())
}

/// Whether a solve is useless as a start for another.
fn failed(solution: &Solution) -> bool {
    !matches!(solution.status, Status::Solved | Status::Acceptable)
}

/// Starting point of a search.
#[derive(Debug, Clone, Copy)]
pub enum Begin<'a> {
    /// At a guess.
    From(&'a Rough),
    /// Along a trajectory of the same states and inputs.
    Along(&'a Trajectory),
    /// At an earlier outcome of the same problem, on any mesh and transcription.
    At(&'a Outcome),
}

/// A rough guess at the knots of meshes.
fn knots(setup: &Setup, rough: &Rough, discretization: &Discretization) -> Result<Trajectory, Error> {
    let Discretization { transcription, meshes } = discretization;
    let total: f64 = rough.durations.iter().sum();
    let interpolation = match transcription {
        Transcription::Trapezoidal => Interpolation::Linear,
        Transcription::HermiteSimpson | Transcription::HermiteSimpsonSeparated => Interpolation::Quadratic,
        Transcription::MultipleShooting | Transcription::ShootingCollocation => Interpolation::Held,
    };
    let mut begin = 0.0;
    let mut phases = Vec::new();
    for ((mesh, &duration), phase) in meshes.iter().zip(&rough.durations).zip(&setup.task.phases) {
        let part = |fraction: f64| (begin + fraction * duration) / total;
        let fractions = mesh.fractions();
        let times = fractions.iter().map(|fraction| begin + fraction * duration).collect();
        let states = fractions.iter().map(|&fraction| rough.states(part(fraction))).collect();
        let inputs = fractions.iter().map(|&fraction| rough.inputs(part(fraction))).collect();
        let mut knots = PhaseTrajectory::from_knots(&phase.name, times, states, inputs, interpolation)?;
        if interpolation == Interpolation::Quadratic {
            let middles = fractions.windows(2).map(|ends| 0.5 * (ends[0] + ends[1]));
            knots.middle_inputs = middles.map(|fraction| rough.inputs(part(fraction))).collect();
        }
        phases.push(knots);
        begin += duration;
    }
    Ok(Trajectory::guess(phases))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarser_meshes_lead_to_the_one_asked_for() {
        let meshes = |intervals: &[usize]| {
            let pass = Pass { transcription: Transcription::Trapezoidal, intervals: intervals.to_vec() };
            coarser(&pass).map(|passes| passes.into_iter().map(|pass| pass.intervals).collect::<Vec<_>>())
        };
        assert_eq!(meshes(&[400]), Some(vec![vec![100], vec![200], vec![400]]));
        assert_eq!(meshes(&[60, 20, 60]), Some(vec![vec![15, 5, 15], vec![30, 10, 30], vec![60, 20, 60]]));
        // Too few, or no whole quarter.
        assert_eq!(meshes(&[16]), None);
        assert_eq!(meshes(&[30, 20, 30]), None);
    }
}
