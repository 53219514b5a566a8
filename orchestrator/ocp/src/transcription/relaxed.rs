//! A program whose limits may be violated at a price: of a task that cannot be done it finds a motion that breaks few
//! limits, and so says which ones stand in the way.
//!
//! Dynamics, links, durations and initial states hold as they are. Every limit in a row of its own, and every state
//! that is fixed at the end of a phase, gets a variable `p >= 0` for each of its sides, which costs `COST_OF_VIOLATION`
//! times its value on top of the objective. Costs of this form leave most limits kept exactly.

use super::Problem;
use super::error::Error;
use super::names::Violation;
use super::program::{Discretization, Position, Program};
use super::trajectory::Trajectory;
use airloop_optim::{Bounds, EvaluationError, Monitor, Nlp, Settings, Stages, Start, Status, solve_with};

/// Cost of a violation by one unit; multipliers of limits that can be kept are below.
const COST_OF_VIOLATION: f64 = 100.0;
/// Smaller violations are not reported.
const MIN_REPORTED_VIOLATION: f64 = 1e-4;

/// Limits that a motion has to violate.
#[derive(Debug, Clone)]
pub struct Conflict {
    /// The worst violation of every limit that is broken; the first costs most in all its places.
    pub violations: Vec<Violation>,
    /// The motion.
    pub trajectory: Trajectory,
}

/// Looks for the motion that breaks limits least, near a guess. None where all can be kept, or the search does not come
/// to an end within the iterations of `settings`.
///
/// # Errors
/// [`Error`] for what is wrong before the first step.
pub fn conflict(
    problem: &mut Problem,
    discretization: &Discretization,
    guess: &Trajectory,
    settings: &Settings,
    monitor: &mut Monitor<'_>,
) -> Result<Option<Conflict>, Error> {
    let mut program = Program::new(problem, discretization)?;
    let x = program.vector(guess)?;
    let mut relaxed = Relaxed::new(&mut program, &x)?;
    let start = Start::cold(relaxed.start(&x)?);
    let solution = solve_with(&mut relaxed, &start, settings, monitor)?;
    if !matches!(solution.status, Status::Solved | Status::Acceptable) {
        return Ok(None);
    }
    let n = relaxed.program.variables();
    let costs = relaxed.costs(&solution.x[n..]);
    let x = &solution.x[..n];
    let mut violations: Vec<(f64, Violation)> = Vec::new();
    for violation in program.violations(x, MIN_REPORTED_VIOLATION)? {
        let same = |other: &&mut (f64, Violation)| {
            other.1.phase == violation.phase && other.1.name == violation.name
        };
        // They come the worst first.
        match violations.iter_mut().find(same) {
            Some(known) => known.0 += violation.amount,
            None => violations.push((violation.amount, violation)),
        }
    }
    if costs < MIN_REPORTED_VIOLATION || violations.is_empty() {
        return Ok(None);
    }
    violations.sort_by(|a, b| b.0.total_cmp(&a.0));
    let violations = violations.into_iter().map(|(_, violation)| violation).collect();
    Ok(Some(Conflict { violations, trajectory: program.trajectory(x, None)? }))
}

/// Row on which a relaxation acts.
#[derive(Clone, Copy)]
enum Relaxes {
    /// A constraint of the program.
    Row(usize),
    /// A row that stands for the bounds of a variable.
    Fixed(usize),
}

struct Relaxed<'a, 'p> {
    program: &'a mut Program<'p>,
    /// Relaxed rows with the sign with which the relaxation enters.
    relaxations: Vec<(Relaxes, f64)>,
    /// Variables whose bounds became rows, with their values.
    fixed: Vec<(usize, f64)>,
}

impl<'a, 'p> Relaxed<'a, 'p> {
    fn new(program: &'a mut Program<'p>, x: &[f64]) -> Result<Self, EvaluationError> {
        // Names of constraints need a point.
        program.objective(x)?;
        let bounds = program.constraint_bounds();
        let mut relaxations = Vec::new();
        for row in 0..program.constraints() {
            let limit = matches!(
                program.position(row),
                Some(Position::Limit(..) | Position::Joint(_, _, Some(_), _))
            );
            let sides = [(bounds.lower[row], 1.0), (bounds.upper[row], -1.0)];
            let sides = sides.iter().filter(|(bound, _)| limit && bound.is_finite());
            relaxations.extend(sides.map(|&(_, sign)| (Relaxes::Row(row), sign)));
        }
        let bounds = program.variable_bounds();
        let mut fixed = Vec::new();
        for part in &program.parts {
            let states = (0..part.layout.states)
                .map(|state| part.layout.point(part.layout.intervals, part.layout.free + state));
            let given = states.filter(|&at| bounds.lower[at] == bounds.upper[at]);
            fixed.extend(given.map(|at| (at, bounds.lower[at])));
        }
        for number in 0..fixed.len() {
            relaxations.extend([1.0, -1.0].map(|sign| (Relaxes::Fixed(number), sign)));
        }
        Ok(Relaxed { program, relaxations, fixed })
    }

    /// Variables of the program, then relaxations that make up for what is violated there.
    fn start(&mut self, x: &[f64]) -> Result<Vec<f64>, EvaluationError> {
        let mut rows = vec![0.0; self.program.constraints()];
        self.program.constraint_values(x, &mut rows)?;
        let bounds = self.constraint_bounds();
        let rows: Vec<f64> = rows.into_iter().chain(self.fixed.iter().map(|&(at, _)| x[at])).collect();
        let needed = self.relaxations.iter().map(|&(relaxes, sign)| {
            let row = self.row(relaxes);
            if sign > 0.0 { bounds.lower[row] - rows[row] } else { rows[row] - bounds.upper[row] }
        });
        Ok(x.iter().copied().chain(needed.map(|needed| needed.max(0.0))).collect())
    }

    fn row(&self, relaxes: Relaxes) -> usize {
        match relaxes {
            Relaxes::Row(row) => row,
            Relaxes::Fixed(number) => self.program.constraints() + number,
        }
    }

    /// Sum of the relaxations that matter.
    fn costs(&self, relaxations: &[f64]) -> f64 {
        relaxations.iter().filter(|one| **one > MIN_REPORTED_VIOLATION).sum()
    }
}

impl Nlp for Relaxed<'_, '_> {
    fn variables(&self) -> usize {
        self.program.variables() + self.relaxations.len()
    }

    fn constraints(&self) -> usize {
        self.program.constraints() + self.fixed.len()
    }

    fn variable_bounds(&self) -> Bounds {
        let mut bounds = self.program.variable_bounds();
        for &(at, _) in &self.fixed {
            (bounds.lower[at], bounds.upper[at]) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        bounds.lower.extend(self.relaxations.iter().map(|_| 0.0));
        bounds.upper.extend(self.relaxations.iter().map(|_| f64::INFINITY));
        bounds
    }

    fn constraint_bounds(&self) -> Bounds {
        let mut bounds = self.program.constraint_bounds();
        bounds.lower.extend(self.fixed.iter().map(|&(_, value)| value));
        bounds.upper.extend(self.fixed.iter().map(|&(_, value)| value));
        bounds
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        let (x, relaxations) = x.split_at(self.program.variables());
        Ok(self.program.objective(x)? + COST_OF_VIOLATION * relaxations.iter().sum::<f64>())
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        let n = self.program.variables();
        let (own, relaxations) = gradient.split_at_mut(n);
        relaxations.fill(COST_OF_VIOLATION);
        self.program.gradient(&x[..n], own)
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let (n, m) = (self.program.variables(), self.program.constraints());
        self.program.constraint_values(&x[..n], &mut values[..m])?;
        for (value, &(at, _)) in values[m..].iter_mut().zip(&self.fixed) {
            *value = x[at];
        }
        for (&(relaxes, sign), amount) in self.relaxations.iter().zip(&x[n..]) {
            values[self.row(relaxes)] += sign * amount;
        }
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        let (n, m) = (self.program.variables(), self.program.constraints());
        let mut places = self.program.jacobian_pattern();
        places.extend(self.fixed.iter().enumerate().map(|(number, &(at, _))| (m + number, at)));
        let of = |(i, &(relaxes, _)): (usize, &(Relaxes, f64))| (self.row(relaxes), n + i);
        places.extend(self.relaxations.iter().enumerate().map(of));
        places
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let n = self.program.variables();
        let own = values.len() - self.fixed.len() - self.relaxations.len();
        let (own, more) = values.split_at_mut(own);
        let (fixed, relaxations) = more.split_at_mut(self.fixed.len());
        fixed.fill(1.0);
        relaxations.iter_mut().zip(&self.relaxations).for_each(|(value, (_, sign))| *value = *sign);
        self.program.jacobian(&x[..n], own)
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        self.program.hessian_pattern()
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (n, m) = (self.program.variables(), self.program.constraints());
        self.program.hessian(&x[..n], objective_factor, &multipliers[..m], values)
    }

    fn stages(&self) -> Option<Stages> {
        let mut stages = self.program.stages()?;
        let fixed: Vec<usize> = self.fixed.iter().map(|&(at, _)| stages.variables[at]).collect();
        stages.constraints.extend(fixed);
        for &(relaxes, _) in &self.relaxations {
            stages.variables.push(stages.constraints[self.row(relaxes)]);
        }
        Some(stages)
    }
}
