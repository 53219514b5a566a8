//! The nonlinear program of a problem on given meshes.

use super::bounds::VariableBounds;
use super::dynamics::Dynamics;
use super::error::Error;
use super::evaluate::{Data, curvature, evaluate, node_cost, widest};
use super::joint::{Joint, Linked, States};
use super::part::{Label, Part};
use super::pattern::Pattern;
use super::probe::Probe;
use super::problem::{Duration, Limit, LimitPlace, Problem};
use super::scheme::Worker;
use super::{Mesh, Transcription};
use airloop_optim::{Bounds, EvaluationError, Nlp, Stages};

/// Settings of the transcription of a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Discretization {
    /// Transcription of all phases.
    pub transcription: Transcription,
    /// Mesh of every phase.
    pub meshes: Vec<Mesh>,
}

impl Discretization {
    /// Equal intervals, as many per phase as given.
    pub fn uniform(transcription: Transcription, intervals: &[usize]) -> Discretization {
        Discretization { transcription, meshes: intervals.iter().map(|&n| Mesh::uniform(n)).collect() }
    }
}

/// Values known at the last point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Known {
    Nothing,
    Values,
    Derivatives,
}

/// A problem of optimal control as a nonlinear program with stages.
///
/// Variables: the phases one after another, in each the nodes `(T, x, u)`, each followed by what is variable in the
/// middle of its interval; T only where the duration is free, and no input at the last node where inputs are held.
/// Constraints: in each phase, node by node, those at the node, then the defects and the other constraints of the
/// interval that follows; after all phases the links, that back to the first phase last.
///
/// Values computed at a point serve all functions asked for there. Evaluations allocate nothing, except for threads.
pub struct Program<'p> {
    pub(super) discretization: Discretization,
    pub(super) parts: Vec<Part>,
    pub(super) data: Vec<Data>,
    pub(super) workers: Vec<Vec<Worker<'p>>>,
    patterns: Vec<Pattern>,
    pub(super) joints: Vec<Joint<'p>>,
    pub(super) bounds: VariableBounds,
    constraint_bounds: Bounds,
    pub(super) variables: usize,
    at: Vec<f64>,
    known: Known,
}

impl<'p> Program<'p> {
    /// Transcribes a problem.
    ///
    /// # Errors
    /// [`Error`] says what in the problem or its meshes makes that impossible.
    pub fn new(problem: &'p mut Problem, discretization: &Discretization) -> Result<Program<'p>, Error> {
        let parts = parts(problem, discretization)?;
        let Problem { phases, links, cycle } = problem;
        let dynamics = phases.iter_mut().map(|phase| {
            let all = phase.dynamics.iter_mut();
            all.map(|one| Box::new(one.as_mut()) as Box<dyn Dynamics + 'p>).collect()
        });
        let dynamics = dynamics.collect();
        let links = (links.iter_mut().map(States::of).collect(), cycle.as_mut().map(States::of));
        Program::assemble(parts, dynamics, links, discretization)
    }

    /// Same as [`Program::new`], of a problem that becomes part of the program.
    ///
    /// # Errors
    /// Same as [`Program::new`].
    pub fn owning(mut problem: Problem, discretization: &Discretization) -> Result<Program<'static>, Error> {
        let parts = parts(&mut problem, discretization)?;
        let Problem { phases, links, cycle } = problem;
        let dynamics = phases.into_iter().map(|phase| phase.dynamics).collect();
        let links = (links.into_iter().map(States::from).collect(), cycle.map(States::from));
        Program::assemble(parts, dynamics, links, discretization)
    }

    fn assemble(
        (parts, patterns, bounds): (Vec<Part>, Vec<Pattern>, VariableBounds),
        dynamics: Vec<Vec<Box<dyn Dynamics + 'p>>>,
        (links, cycle): (Vec<Linked<'p>>, Option<Linked<'p>>),
        discretization: &Discretization,
    ) -> Result<Program<'p>, Error> {
        let mut next = parts.last().map_or(0, |part| part.end_constraint);
        let mut joints: Vec<Joint<'p>> = Vec::new();
        for (link, sides) in links.into_iter().zip(parts.windows(2)) {
            let joint = Joint::new(link, [&sides[0], &sides[1]], next, false)?;
            next += joint.constraints();
            joints.push(joint);
        }
        if let (Some(link), Some(last)) = (cycle, parts.last()) {
            let joint = Joint::new(link, [last, &parts[0]], next, true)?;
            next += joint.constraints();
            joints.push(joint);
        }
        let workers = dynamics.into_iter().zip(&parts).map(|(dynamics, part)| {
            let width = widest(&part.layout);
            dynamics.into_iter().map(|one| Worker::new(one, &part.functions, width)).collect()
        });
        let workers = workers.collect();
        let data = parts.iter().map(Data::new).collect();
        let mut constraint_bounds = Bounds::zero(next);
        set_constraint_bounds(&parts, &joints, &mut constraint_bounds);
        let variables = bounds.bounds.lower.len();
        Ok(Program {
            discretization: discretization.clone(),
            parts,
            data,
            workers,
            patterns,
            joints,
            bounds,
            constraint_bounds,
            variables,
            at: vec![f64::NAN; variables],
            known: Known::Nothing,
        })
    }

    /// The transcription and meshes it was made with.
    pub fn discretization(&self) -> &Discretization {
        &self.discretization
    }

    /// Times at which the phases begin and end at `x`, s, `[phases + 1]`.
    pub fn phase_times(&self, x: &[f64]) -> Vec<f64> {
        let mut times = vec![0.0];
        for part in &self.parts {
            times.push(times[times.len() - 1] + part.duration_at(x));
        }
        times
    }

    /// Gives limits, each by phase and place, other bounds, and leaves those that they had.
    ///
    /// # Errors
    /// [`Error::NoLimit`] where there is none, [`Error::Bounds`] where no value is left, also together with other
    /// limits; all bounds are then as before.
    pub fn set_limits(&mut self, limits: &mut [(usize, LimitPlace, [f64; 2])]) -> Result<(), Error> {
        for &(phase, place, bounds) in limits.iter() {
            let part = self.parts.get(phase);
            let limit = part.and_then(|part| Some(&part.limits[part.limit_number(place)?].name));
            let (Some(part), Some(name)) = (part, limit) else { return Err(Error::NoLimit { phase, place }) };
            if bounds.iter().any(|bound| bound.is_nan()) || bounds[0] > bounds[1] {
                let (phase, item, [lower, upper]) = (part.name.clone(), name.clone(), bounds);
                return Err(Error::Bounds { phase, item, lower, upper });
            }
        }
        self.exchange(limits);
        if let Err(error) = self.bounds.set(&self.parts) {
            limits.reverse();
            self.exchange(limits);
            limits.reverse();
            self.bounds.set(&self.parts)?;
            return Err(error);
        }
        set_constraint_bounds(&self.parts, &self.joints, &mut self.constraint_bounds);
        Ok(())
    }

    /// Exchanges the bounds of limits that exist with those given, in their order.
    fn exchange(&mut self, limits: &mut [(usize, LimitPlace, [f64; 2])]) {
        for (phase, place, [lower, upper]) in limits {
            let part = &mut self.parts[*phase];
            let Some(number) = part.limit_number(*place) else { continue };
            let limit = &mut part.limits[number];
            std::mem::swap(&mut limit.lower, lower);
            std::mem::swap(&mut limit.upper, upper);
        }
    }

    /// Makes sure that values, or derivatives too, are known at `x`.
    pub(super) fn ensure(&mut self, x: &[f64], derivatives: bool) -> Result<(), EvaluationError> {
        let wanted = if derivatives { Known::Derivatives } else { Known::Values };
        if self.known >= wanted && self.at == x {
            return Ok(());
        }
        self.known = Known::Nothing;
        self.at.copy_from_slice(x);
        let mut begin = 0.0;
        for ((part, workers), data) in self.parts.iter().zip(&mut self.workers).zip(&mut self.data) {
            evaluate(part, workers, data, x, begin, derivatives)?;
            begin += part.duration_at(x);
        }
        self.joints.iter_mut().try_for_each(|joint| joint.evaluate(x, derivatives))?;
        self.known = wanted;
        Ok(())
    }

    /// The point of the last evaluation, from which messages take their times.
    pub(super) fn last_point(&self) -> &[f64] {
        &self.at
    }
}

/// The phases made discrete, with the patterns of their derivatives and the bounds of their variables.
fn parts(
    problem: &mut Problem,
    discretization: &Discretization,
) -> Result<(Vec<Part>, Vec<Pattern>, VariableBounds), Error> {
    let count = problem.phases.len();
    if count == 0 {
        return Err(Error::NoPhases);
    }
    let fits = |what, found: usize, expected: usize| {
        let error = Error::Count { what, found, expected, phases: count };
        if found == expected { Ok(()) } else { Err(error) }
    };
    fits("meshes", discretization.meshes.len(), count)?;
    fits("links", problem.links.len(), count - 1)?;
    let (mut parts, mut patterns) = (Vec::new(), Vec::new());
    let mut next = [0; 3];
    for (phase, mesh) in problem.phases.iter_mut().zip(&discretization.meshes) {
        let part = Part::new(phase, discretization.transcription, mesh, next)?;
        next = [next[0] + part.layout.variables(), part.end_constraint, next[2] + part.layout.stages()];
        patterns.push(Pattern::new(&part, &mut Probe::new(phase.dynamics[0].as_ref()))?);
        parts.push(part);
    }
    let bounds = VariableBounds::new(&parts, next[0])?;
    Ok((parts, patterns, bounds))
}

fn set_constraint_bounds(parts: &[Part], joints: &[Joint<'_>], bounds: &mut Bounds) {
    for part in parts {
        let mut set = |row: usize, lower: f64, upper: f64| {
            (bounds.lower[row], bounds.upper[row]) = (lower, upper);
        };
        for (first, limits) in part.node_constraints.iter().zip(&part.node_rows) {
            for (row, &limit) in limits.iter().enumerate() {
                set(first + row, part.limits[limit].lower, part.limits[limit].upper);
            }
        }
        for k in 0..part.layout.intervals {
            let mut row = part.interval_constraints[k] + part.scheme.defects(part.layout.states);
            for &limit in &part.middle_rows[k] {
                set(row, part.limits[limit].lower, part.limits[limit].upper);
                row += 1;
            }
            for linear in &part.linear_rows[k] {
                set(row, linear.lower, linear.upper);
                row += 1;
            }
        }
    }
    joints.iter().for_each(|joint| joint.set_bounds(bounds));
}

impl Nlp for Program<'_> {
    fn variables(&self) -> usize {
        self.variables
    }

    fn constraints(&self) -> usize {
        self.constraint_bounds.lower.len()
    }

    fn variable_bounds(&self) -> Bounds {
        self.bounds.bounds.clone()
    }

    fn constraint_bounds(&self) -> Bounds {
        self.constraint_bounds.clone()
    }

    fn write_bounds(&self, variables: &mut Bounds, constraints: &mut Bounds) {
        let pairs = [(variables, &self.bounds.bounds), (constraints, &self.constraint_bounds)];
        for (target, own) in pairs {
            target.lower.clone_from(&own.lower);
            target.upper.clone_from(&own.upper);
        }
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        self.ensure(x, false)?;
        let mut sum = 0.0;
        for (part, data) in self.parts.iter().zip(&self.data) {
            let (running, weights) = (part.functions.running(), part.scheme.end_weights());
            for (k, node) in data.nodes.iter().enumerate() {
                let weight = node_cost(part, k, weights);
                if weight != 0.0 {
                    sum += weight * node.points.values[running];
                }
            }
            sum += data.intervals.iter().map(|interval| interval.cost).sum::<f64>();
            let last = &data.nodes[part.layout.intervals].points;
            if part.functions.has_ending() {
                sum += last.values[part.functions.ending()];
            }
            sum += part.duration_weight * part.duration_at(x);
        }
        Ok(sum)
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        self.ensure(x, true)?;
        gradient.fill(0.0);
        for (part, data) in self.parts.iter().zip(&self.data) {
            let functions = &part.functions;
            let (running, weights) = (functions.running(), part.scheme.end_weights());
            for (k, node) in data.nodes.iter().enumerate() {
                let mut add = |value: usize, weight: f64| {
                    for &a in functions.columns[value].iter().filter(|_| weight != 0.0) {
                        gradient[part.layout.point(k, a)] += weight * node.points.row(0, value)[a];
                    }
                };
                add(running, node_cost(part, k, weights));
                if k == part.layout.intervals && functions.has_ending() {
                    add(functions.ending(), 1.0);
                }
            }
            for (k, interval) in data.intervals.iter().enumerate() {
                super::block::add(&mut gradient[part.layout.interval(k)], 1.0, &interval.gradient);
            }
            if matches!(part.duration, Duration::Free { .. }) {
                gradient[part.layout.first] += part.duration_weight;
            }
        }
        Ok(())
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.ensure(x, false)?;
        for (part, data) in self.parts.iter().zip(&self.data) {
            for (first, node) in part.node_constraints.iter().zip(&data.nodes) {
                values[*first..first + node.values.len()].copy_from_slice(&node.values);
            }
            for (first, interval) in part.interval_constraints.iter().zip(&data.intervals) {
                values[*first..first + interval.values.len()].copy_from_slice(&interval.values);
            }
        }
        for joint in &self.joints {
            joint.values(x, &mut values[joint.first..]);
        }
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        let mut places = Vec::new();
        for (part, pattern) in self.parts.iter().zip(&self.patterns) {
            pattern.jacobian_places(part, &mut places);
        }
        self.joints.iter().for_each(|joint| joint.jacobian_places(&mut places));
        places
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.ensure(x, true)?;
        let mut rest = values;
        for (data, pattern) in self.data.iter().zip(&self.patterns) {
            let (own, after) = rest.split_at_mut(pattern.jacobian_entries);
            pattern.jacobian_values(data, own);
            rest = after;
        }
        for joint in &self.joints {
            let count = joint.jacobian_values(rest);
            rest = &mut rest[count..];
        }
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        let mut places = Vec::new();
        for (part, pattern) in self.parts.iter().zip(&self.patterns) {
            pattern.hessian_places(part, &mut places);
        }
        self.joints.iter().for_each(|joint| joint.hessian_places(&mut places));
        places
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.ensure(x, true)?;
        let mut begin = 0.0;
        let mut rest = values;
        for (p, part) in self.parts.iter().enumerate() {
            let (workers, data) = (&mut self.workers[p], &mut self.data[p]);
            curvature(part, workers, data, x, (objective_factor, multipliers), begin)?;
            begin += part.duration_at(x);
            let (own, after) = rest.split_at_mut(self.patterns[p].hessian_entries);
            self.patterns[p].hessian_values(part, data, own);
            rest = after;
        }
        for joint in &mut self.joints {
            let count = joint.hessian_values(multipliers, rest)?;
            rest = &mut rest[count..];
        }
        Ok(())
    }

    fn stages(&self) -> Option<Stages> {
        let mut stages = Stages { variables: Vec::new(), constraints: vec![0; self.constraints()] };
        for part in &self.parts {
            let layout = &part.layout;
            stages.variables.extend((0..layout.variables()).map(|i| part.stage + layout.stage(i)));
            for k in 0..=layout.intervals {
                let first = part.node_constraints[k];
                stages.constraints[first..first + part.node_rows[k].len()]
                    .fill(part.stage + layout.node_stage(k));
                if k < layout.intervals {
                    let first = part.interval_constraints[k];
                    stages.constraints[first..first + part.interval_rows(k)].fill(part.stage + k);
                }
            }
        }
        for joint in &self.joints {
            stages.constraints[joint.first..joint.first + joint.constraints()].fill(joint.stage);
        }
        if self.joints.len() == self.parts.len() {
            fold(&mut stages);
        }
        Some(stages)
    }

    fn variable_name(&self, variable: usize) -> String {
        super::names::variable(self, variable)
    }

    fn constraint_name(&self, constraint: usize) -> String {
        super::names::constraint(self, constraint)
    }
}

/// Folds a ring of stages into a chain: the first stage and the last become one, as do the second and the last but one,
/// so that neighbors in the ring are neighbors in the chain.
fn fold(stages: &mut Stages) {
    let last = stages.variables.iter().copied().max().unwrap_or(0);
    for stage in stages.variables.iter_mut().chain(&mut stages.constraints) {
        *stage = (*stage).min(last - *stage);
    }
}

/// Position of a constraint.
pub(super) enum Position<'a> {
    /// Limit of a part at a time.
    Limit(&'a Part, usize, f64),
    /// Defect of a state of a part over an interval that begins at a time; second defects follow the first.
    Defect(&'a Part, usize, f64),
    /// A linear constraint of a part.
    Linear(&'a Part, Label, f64),
    /// Constraint of a joint, the part it leads to, its name and the limit where it is one, at a time.
    Joint(&'a Part, String, Option<&'a Limit>, f64),
}

impl Program<'_> {
    pub(super) fn position(&self, constraint: usize) -> Option<Position<'_>> {
        let x = self.last_point();
        let begins = self.phase_times(x);
        for (part, begin) in self.parts.iter().zip(&begins) {
            if constraint >= part.end_constraint {
                continue;
            }
            let time = |s: f64| begin + s * part.duration_at(x);
            let k = part.node_constraints.partition_point(|&first| first <= constraint).checked_sub(1)?;
            let row = constraint - part.node_constraints[k];
            let s = part.fractions[k];
            if row < part.node_rows[k].len() {
                return Some(Position::Limit(part, part.node_rows[k][row], time(s)));
            }
            let row = row - part.node_rows[k].len();
            let defects = part.scheme.defects(part.layout.states);
            let Some(row) = row.checked_sub(defects) else {
                return Some(Position::Defect(part, row, time(s)));
            };
            if let Some(&limit) = part.middle_rows[k].get(row) {
                return Some(Position::Limit(part, limit, time(0.5 * (s + part.fractions[k + 1]))));
            }
            let linear = part.linear_rows[k].get(row - part.middle_rows[k].len())?;
            return Some(Position::Linear(part, linear.label, time(s)));
        }
        let (i, joint) = self.joints.iter().enumerate().rfind(|(_, joint)| joint.first <= constraint)?;
        let (name, limit) = joint.name(constraint - joint.first);
        // The link of the last phase leads to the first.
        Some(Position::Joint(&self.parts[(i + 1) % self.parts.len()], name, limit, begins[i + 1]))
    }
}
