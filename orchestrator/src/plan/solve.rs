//! From a prepared problem and a guess to a trajectory: one solve, or a chain of them, each from the one before.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::Error;
use super::assemble;
use super::file::statement::{MeshRefinement, Statement};
use super::guess::Rough;
use super::prepare::{Prepared, Setup};
use crate::optim::{self, Iteration, Method, Nlp, Solution, Start, Status, solve_with};
use crate::transcription::{
    Complaint, Discretisation, Dynamics, Interpolation, Link, Mesh, PhaseTrajectory, Problem, Program,
    Trajectory, Transcription,
};

/// One solve of a chain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pass {
    /// Transcription.
    pub transcription: Transcription,
    /// Intervals of every phase.
    pub intervals: Vec<usize>,
}

/// How a problem is solved.
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
            transcription: pass.transcription,
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

/// What a solve of the chain came to.
#[derive(Debug, Clone)]
pub struct Done {
    /// What was solved.
    pub pass: Pass,
    /// How.
    pub solution: Solution,
    /// Wall-clock time of building the program.
    pub build: Duration,
    /// Wall-clock time of solving it.
    pub solve: Duration,
    /// Variables and constraints.
    pub size: (usize, usize),
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
    /// The trajectory of the last solve; also of one that was interrupted or failed.
    pub trajectory: Trajectory,
    /// All solves.
    pub done: Vec<Done>,
    /// Largest defect, unscaled.
    pub max_defect: f64,
    /// Largest violation of a bound or condition.
    pub max_bound_violation: f64,
    /// What is violated most, where it is by more than the tolerance.
    pub worst: Option<Complaint>,
}

impl Solved {
    /// The last solve.
    ///
    /// # Panics
    /// Never: there is at least one.
    pub fn last(&self) -> &Done {
        &self.done[self.done.len() - 1]
    }

    /// Iterations of all solves; the first row of each table is its start.
    pub fn iterations(&self) -> usize {
        self.done.iter().map(Done::iterations).sum()
    }

    /// How the last solve ended.
    pub fn status(&self) -> &Status {
        &self.last().solution.status
    }
}

/// What the caller sees while it runs.
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
const VIOLATION: f64 = 1e-8;

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
        Ok(Session {
            problem: assemble::problem(&prepared.task, &prepared.catalogue, dynamics, links, sampled),
        })
    }

    /// Solves from a guess.
    ///
    /// # Errors
    /// What keeps the solver from beginning; how it ended is in [`Solved::status`].
    pub fn solve(
        &mut self,
        setup: &Setup,
        settings: &Settings,
        begin: Begin,
        monitor: &mut Monitor,
    ) -> Result<Solved, Error> {
        for pass in &settings.passes {
            let sampling = setup.sampling.as_ref();
            let (statement, task) = (&setup.statement, &setup.task);
            assemble::check_samples(statement, task, sampling, pass.transcription, &pass.intervals)?;
        }
        let mut done = Vec::new();
        let mut found: Option<Found> = None;
        for (number, pass) in settings.passes.iter().enumerate() {
            let meshes = pass.intervals.iter().map(|&n| Mesh::uniform(n)).collect();
            let from = match found.as_ref().map(|found| &found.trajectory) {
                None => begin,
                Some(trajectory) => Begin::At(trajectory),
            };
            let next = self.one(setup, settings, (number, pass), meshes, from, monitor)?;
            let ended = !matches!(next.done.solution.status, Status::Solved | Status::Acceptable);
            done.push(next.done.clone());
            found = Some(next);
            if ended {
                break;
            }
        }
        let Some(last) = found else {
            let problem = "there is no solve at all; give at least one".into();
            return Err(Error::Place { place: "the chain of solves".into(), problem });
        };
        let Found { trajectory, max_defect, max_bound_violation, worst, .. } = last;
        Ok(Solved { trajectory, done, max_defect, max_bound_violation, worst })
    }

    fn one(
        &mut self,
        setup: &Setup,
        settings: &Settings,
        (number, pass): (usize, &Pass),
        meshes: Vec<Mesh>,
        from: Begin,
        monitor: &mut Monitor,
    ) -> Result<Found, Error> {
        let began = Instant::now();
        let guess = match &from {
            Begin::From(rough) => Some(knots(setup, rough, pass.transcription, &meshes)?),
            Begin::At(_) => None,
        };
        let discretisation = Discretisation { transcription: pass.transcription, meshes };
        let mut program = Program::new(&mut self.problem, &discretisation)?;
        let (start, method) = match (guess, from) {
            (Some(guess), _) => (Start::cold(program.vector(&guess)?), settings.method),
            (None, Begin::At(trajectory)) => (program.start(trajectory)?, Method::InteriorPoint),
            (None, Begin::From(_)) => unreachable!("a rough guess has knots"),
        };
        let size = (program.variables(), program.constraints());
        let build = began.elapsed();
        let began = Instant::now();
        let options = optim::Settings {
            method,
            tolerance: settings.tolerance,
            max_iterations: settings.max_iterations,
            ..optim::Settings::default()
        };
        let mut watch = |iteration: &Iteration| monitor(&Progress { number, pass, iteration });
        let solution = solve_with(&mut program, &start, &options, &mut watch)?;
        let solve = began.elapsed();
        let trajectory = program.trajectory(&solution.x, Some(&solution.multipliers))?;
        let complaints = program.complaints(&solution.x, 0.0)?;
        let (defects, others): (Vec<_>, Vec<_>) =
            complaints.iter().partition(|complaint| complaint.name.starts_with("defect of "));
        let largest = |list: &[&Complaint]| list.iter().map(|one| one.amount).fold(0.0, f64::max);
        let (max_defect, max_bound_violation) = (largest(&defects), largest(&others));
        // What the user asked for says more than an equation of the program.
        let worst = others.first().or(defects.first()).filter(|worst| worst.amount > VIOLATION);
        let worst = worst.map(|worst| (*worst).clone());
        let done = Done { pass: pass.clone(), solution, build, solve, size };
        Ok(Found { trajectory, done, max_defect, max_bound_violation, worst })
    }
}

/// Where a search begins.
#[derive(Debug, Clone, Copy)]
pub enum Begin<'a> {
    /// At a guess.
    From(&'a Rough),
    /// At a trajectory of the same states and inputs, with its costates where it has them.
    At(&'a Trajectory),
}

struct Found {
    trajectory: Trajectory,
    done: Done,
    max_defect: f64,
    max_bound_violation: f64,
    worst: Option<Complaint>,
}

/// A rough guess at the knots of meshes.
fn knots(
    setup: &Setup,
    rough: &Rough,
    transcription: Transcription,
    meshes: &[Mesh],
) -> Result<Trajectory, Error> {
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
