//! A solver that is kept: one program, solved again and again with other states at its start, other bounds.

use super::duals::Duals;
use super::problem::{LimitPlace, Problem};
use super::program::{Discretization, Program};
use super::solve::Outcome;
use super::trajectory::Trajectory;
use super::{Error, Variable};
use airloop_optim::scaled::Scaled;
use airloop_optim::{self as optim, Method, Monitor, Multipliers, Settings, Solution, Start, Status};

/// One problem on fixed meshes, solved many times; each solve starts from the solution before, with its multipliers.
///
/// Setting bounds and states, moving the start ahead, and solving allocate nothing after the first solve, but for what
/// [`optim::Solver`] names; so do FMUs of this project. [`Solver::trajectory`] allocates what it returns.
///
/// A solve depends on the problem and the start alone: with [`Solver::start_at`] before it, it has the same bits every
/// time.
pub struct Solver {
    program: Scaled<Program<'static>>,
    solver: optim::Solver,
    /// Of a solve without and with multipliers at its start: without them there is no working set to keep.
    settings: [Settings; 2],
    /// Start of the next solve, in scaled variables.
    start: Start,
    /// The limit at the start that fixes each state of the first phase.
    initial: Vec<Option<usize>>,
    /// Memory for limits that change.
    limits: Vec<(usize, LimitPlace, [f64; 2])>,
}

impl Solver {
    /// A solver for a problem, whose variables are scaled by the nominal values of the dynamics. The first solve starts
    /// at `outcome`, an earlier one of the same problem on any mesh. Of the settings the method does not count: with
    /// multipliers at the start it is SQP, without them the interior point method.
    ///
    /// # Errors
    /// [`Error`] says what in the problem, its meshes or the start is wrong.
    pub fn new(
        problem: Problem,
        discretization: &Discretization,
        outcome: &Outcome,
        settings: &Settings,
    ) -> Result<Solver, Error> {
        Solver::along(problem, discretization, &outcome.trajectory, Some(&outcome.duals), settings)
    }

    /// Same as [`Solver::new`], from a trajectory, with or without multipliers.
    ///
    /// # Errors
    /// See [`Solver::new`].
    pub fn along(
        problem: Problem,
        discretization: &Discretization,
        trajectory: &Trajectory,
        duals: Option<&Duals>,
        settings: &Settings,
    ) -> Result<Solver, Error> {
        let mut own = Solver::without_start(problem, discretization, settings)?;
        own.start_at(trajectory, duals)?;
        Ok(own)
    }

    /// Same as [`Solver::new`], with the start that the next solve of another solver has: for a problem that differs in
    /// numbers only.
    ///
    /// # Errors
    /// [`Error::Trajectory`] where the problems differ in their variables; see also [`Solver::new`].
    pub fn like(
        other: &Solver,
        problem: Problem,
        discretization: &Discretization,
        settings: &Settings,
    ) -> Result<Solver, Error> {
        let mut own = Solver::without_start(problem, discretization, settings)?;
        if own.program.scales() != other.program.scales() {
            let reason = "its variables or their nominal values are those of another problem".to_owned();
            return Err(Error::Trajectory(reason));
        }
        own.start.clone_from(&other.start);
        Ok(own)
    }

    fn without_start(
        problem: Problem,
        discretization: &Discretization,
        settings: &Settings,
    ) -> Result<Solver, Error> {
        let initial = initial(&problem);
        let program = Program::owning(problem, discretization)?;
        let scales = program.scales();
        let mut program = Scaled::new(program, scales);
        let solver = optim::Solver::new(&mut program)?;
        let of = |method| Settings { method, ..settings.clone() };
        let settings = [of(Method::InteriorPoint), of(Method::Sqp)];
        Ok(Solver { program, solver, settings, start: Start::cold(Vec::new()), initial, limits: Vec::new() })
    }

    /// Lets the next solve start along a trajectory, with or without multipliers, instead of the last solution.
    ///
    /// # Errors
    /// [`Error::Trajectory`] where they do not fit the problem.
    pub fn start_at(&mut self, trajectory: &Trajectory, duals: Option<&Duals>) -> Result<(), Error> {
        let program = self.program.inner();
        let start = match duals {
            Some(duals) => program.warm_start(trajectory, duals)?,
            None => Start::cold(program.vector(trajectory)?),
        };
        self.start = self.program.start(&start);
        Ok(())
    }

    /// Moves the start of the next solve ahead by `seconds`, as a controller needs it whose horizon moves on.
    ///
    /// # Errors
    /// See [`Program::shift`].
    pub fn shift(&mut self, seconds: f64) -> Result<(), Error> {
        self.program.inner().shift(&mut self.start, seconds)
    }

    /// Fixes the states at the start of the first phase at `states` `[n_x]`.
    ///
    /// # Errors
    /// [`Error::Request`] where the number is wrong or a state has no limit at the start, [`Error::Bounds`] where other
    /// limits leave no room; all states are then as before.
    pub fn set_initial(&mut self, states: &[f64]) -> Result<(), Error> {
        let refuse = |reason: String| Error::Request { request: "initial states", reason };
        let count = self.initial.len();
        if states.len() != count {
            return Err(refuse(format!("{} values for {count} states", states.len())));
        }
        self.limits.clear();
        for (state, (limit, &value)) in self.initial.iter().zip(states).enumerate() {
            let Some(limit) = *limit else {
                return Err(refuse(format!(
                    "state {state} is not fixed at the start; give it an initial value"
                )));
            };
            self.limits.push((0, LimitPlace::Start(limit), [value; 2]));
        }
        self.program.inner().set_limits(&mut self.limits)
    }

    /// Gives limits, each by phase and place, other bounds.
    ///
    /// # Errors
    /// See [`Program::set_limits`].
    pub fn set_limits(&mut self, limits: &[(usize, LimitPlace, [f64; 2])]) -> Result<(), Error> {
        self.limits.clear();
        self.limits.extend_from_slice(limits);
        self.program.inner().set_limits(&mut self.limits)
    }

    /// Solves. A solution is the start of the next solve; after a run without one that start stays as it was.
    ///
    /// # Errors
    /// [`Error::Solver`] for what is wrong before the first step; how the run ends is the status of the solution.
    pub fn solve(&mut self, monitor: &mut Monitor<'_>) -> Result<&Solution, Error> {
        let settings = &self.settings[usize::from(self.start.multipliers.is_some())];
        let solution = self.solver.solve(&mut self.program, &self.start, settings, monitor)?;
        if matches!(solution.status, Status::Solved | Status::Acceptable) {
            keep(&mut self.start, solution);
        }
        self.program.unscale(self.solver.solution_mut());
        Ok(self.solver.solution())
    }

    /// The last solution, in the units of the problem; empty before the first solve.
    pub fn solution(&self) -> &Solution {
        self.solver.solution()
    }

    /// The trajectory of the last solution.
    ///
    /// # Errors
    /// Fails where the dynamics have no value at a knot, or nothing was solved yet.
    pub fn trajectory(&mut self) -> Result<Trajectory, Error> {
        let solution = solved(&self.solver, "trajectory")?;
        Ok(self.program.inner().trajectory(&solution.x, Some(&solution.multipliers))?)
    }

    /// The multipliers of the last solution as functions of time.
    ///
    /// # Errors
    /// Fails where nothing was solved yet.
    pub fn duals(&mut self) -> Result<Duals, Error> {
        let solution = solved(&self.solver, "multipliers")?;
        Ok(self.program.inner().duals(&solution.multipliers))
    }

    /// The program.
    pub fn program(&mut self) -> &mut Program<'static> {
        self.program.inner()
    }
}

/// The last solution, where there is one.
fn solved<'a>(solver: &'a optim::Solver, request: &'static str) -> Result<&'a Solution, Error> {
    let solution = solver.solution();
    match solution.x.is_empty() {
        true => Err(Error::Request { request, reason: "nothing was solved yet".to_owned() }),
        false => Ok(solution),
    }
}

/// The limit at the start of the first phase that fixes each of its states.
fn initial(problem: &Problem) -> Vec<Option<usize>> {
    let Some(phase) = problem.phases.first() else { return Vec::new() };
    let states = phase.dynamics.first().map_or(0, |dynamics| dynamics.size().states);
    let fixes = |state: usize| {
        phase.start.iter().position(|limit| {
            limit.lower == limit.upper && limit.quantity.terms == [(Variable::State(state), 1.0)]
        })
    };
    (0..states).map(fixes).collect()
}

/// Takes a solution as a start.
fn keep(start: &mut Start, solution: &Solution) {
    start.x.clone_from(&solution.x);
    let empty = || Multipliers { constraints: Vec::new(), lower: Vec::new(), upper: Vec::new() };
    let multipliers = start.multipliers.get_or_insert_with(empty);
    multipliers.constraints.clone_from(&solution.multipliers.constraints);
    multipliers.lower.clone_from(&solution.multipliers.lower);
    multipliers.upper.clone_from(&solution.multipliers.upper);
    start.barrier = Some(solution.barrier);
}
