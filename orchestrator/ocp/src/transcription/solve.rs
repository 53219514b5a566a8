//! Solving a problem on a mesh, and on the next one from there.

use super::defects::{IntervalErrors, interval_errors};
use super::duals::Duals;
use super::names::Violation;
use super::program::{Discretization, Program};
use super::trajectory::Trajectory;
use super::{Error, Mesh, Problem, Transcription};
use airloop_optim::scaled::Scaled;
use airloop_optim::{Monitor, Settings, Solution, Start, Status, solve_with};

/// Barrier parameter of a start from another mesh: small enough to stay near, large enough to move along bounds.
pub(super) const WARM_BARRIER: f64 = 1e-4;

/// Result of a run on one mesh.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// As the solver gives it, in the units of the problem.
    pub solution: Solution,
    /// The trajectory; also where the run did not succeed.
    pub trajectory: Trajectory,
    /// Multipliers as functions of time, for the next mesh.
    pub duals: Duals,
    /// Violations above the solver's tolerance, the worst first.
    pub violations: Vec<Violation>,
    /// Time of the phase ends and the like are in the trajectory; here the mesh it belongs to.
    pub discretization: Discretization,
}

/// From where a run starts.
#[derive(Debug, Clone, Copy)]
pub enum From<'a> {
    /// A trajectory without knowledge of multipliers.
    Guess(&'a Trajectory),
    /// An earlier outcome, on any mesh or transcription.
    Outcome(&'a Outcome),
}

/// Solves a problem on given meshes. Variables are scaled by the nominal values of the dynamics.
///
/// # Errors
/// [`Error`] for what is wrong before the first step; how the run ends is the status of the solution.
pub fn solve_on(
    problem: &mut Problem,
    discretization: &Discretization,
    from: From<'_>,
    settings: &Settings,
    monitor: &mut Monitor<'_>,
) -> Result<Outcome, Error> {
    let mut program = Program::new(problem, discretization)?;
    let start = match from {
        From::Guess(trajectory) => Start::cold(program.vector(trajectory)?),
        From::Outcome(outcome) => {
            let start = program.warm_start(&outcome.trajectory, &outcome.duals)?;
            let same = outcome.discretization == *discretization;
            let barrier = if same { outcome.solution.barrier } else { WARM_BARRIER };
            Start { barrier: Some(barrier), ..start }
        }
    };
    let scales = program.scales();
    let solution = if scales.iter().all(|&scale| scale == 1.0) {
        solve_with(&mut program, &start, settings, monitor)?
    } else {
        let mut scaled = Scaled::new(&mut program, scales);
        let start = scaled.start(&start);
        let solution = solve_with(&mut scaled, &start, settings, monitor)?;
        scaled.solution(solution)
    };
    let trajectory = program.trajectory(&solution.x, Some(&solution.multipliers))?;
    let violations = program.violations(&solution.x, settings.violation_tolerance)?;
    let duals = program.duals(&solution.multipliers);
    Ok(Outcome { solution, trajectory, duals, violations, discretization: discretization.clone() })
}

/// Criteria for a mesh that is fine enough.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// Relative error of an interval that is small enough; 1e-5.
    pub tolerance: f64,
    /// Meshes beyond the first; 6.
    pub rounds: usize,
    /// Most intervals of a phase; 2000.
    pub most_intervals: usize,
}

impl Default for Refinement {
    fn default() -> Refinement {
        Refinement { tolerance: 1e-5, rounds: 6, most_intervals: 2000 }
    }
}

/// One mesh of a refinement.
#[derive(Debug, Clone)]
pub struct Round {
    /// Result on it.
    pub outcome: Outcome,
    /// Errors between the knots, per phase.
    pub errors: Vec<IntervalErrors>,
}

/// Solves on finer and finer meshes until the errors between the knots are small enough; all rounds, the finest last.
/// Intervals are cut where the error is too large, each mesh starts from the solution before. Stops early where a run
/// does not succeed.
///
/// # Errors
/// See [`solve_on`]; [`Error::Samples`] where parts of intervals are not a whole number of samples.
pub fn refine(
    problem: &mut Problem,
    discretization: &Discretization,
    from: From<'_>,
    refinement: &Refinement,
    settings: &Settings,
    monitor: &mut Monitor<'_>,
) -> Result<Vec<Round>, Error> {
    let mut rounds: Vec<Round> = Vec::new();
    let mut discretization = discretization.clone();
    loop {
        let from = rounds.last().map_or(from, |round| From::Outcome(&round.outcome));
        let outcome = solve_on(problem, &discretization, from, settings, monitor)?;
        let errors = interval_errors(problem, &outcome.trajectory)?;
        let done = !matches!(outcome.solution.status, Status::Solved | Status::Acceptable);
        let next = refined(&discretization, &errors, refinement);
        rounds.push(Round { outcome, errors });
        match next {
            Some(next) if !done && rounds.len() <= refinement.rounds => discretization = next,
            _ => return Ok(rounds),
        }
    }
}

/// The next meshes: intervals with too large an error are cut into as many parts as the order of the method promises to
/// need, at most four. None where nothing is left to cut.
pub fn refined(
    discretization: &Discretization,
    errors: &[IntervalErrors],
    refinement: &Refinement,
) -> Option<Discretization> {
    let order = match discretization.transcription {
        Transcription::Trapezoidal => 2.0,
        _ => 4.0,
    };
    let meshes: Vec<Mesh> = discretization
        .meshes
        .iter()
        .zip(errors)
        .map(|(mesh, errors)| {
            let parts = errors.relative.iter().map(|error| {
                let needed = (error / refinement.tolerance).powf(1.0 / order).ceil();
                if needed > 1.0 { (needed as usize).clamp(2, 4) } else { 1 }
            });
            let finer = mesh.split(&parts.collect::<Vec<_>>());
            if finer.intervals() > refinement.most_intervals { mesh.clone() } else { finer }
        })
        .collect();
    if meshes == discretization.meshes {
        return None;
    }
    Some(Discretization { transcription: discretization.transcription, meshes })
}
