//! The problem in the form the methods work on: equations `c(x) + S s = 0` with scaled rows, where s holds the
//! slacks, each in one row; bounds on `X = (x, s)`. Feasibility restoration is another objective on the same form.

use super::error::Error;
use super::nlp::{Bounds, EvaluationError, Nlp};
use super::outcome::{Blocking, Evaluations, Side, Violation};

/// Weight of the relaxations in the feasibility restoration.
pub(super) const RELAXATION_COST: f64 = 1e3;

/// Least gradient of the scaled objective at the start as a part of the largest, and the largest factor to get there:
/// a start may be stationary by chance. Ten times as much costs half of the iterations on `tests/programs`, and two of
/// the programs: an objective that outweighs the barrier leads away from the constraints.
const LEAST_GRADIENT: f64 = 0.01;
const LARGEST_SCALE: f64 = 1e4;

/// A variable that enters one row only, linearly: the slack of an inequality or the relaxation of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slack {
    pub row: usize,
    pub sign: f64,
    pub cost: f64,
}

/// Objective of the restoration: stay near the point where it began, `zeta / 2 |w (X - reference)|^2`.
#[derive(Debug)]
struct Proximal {
    reference: Vec<f64>,
    /// Slacks before the relaxations were added.
    slacks: usize,
    zeta: f64,
}

/// State that the form of a problem keeps from solve to solve: everything but the problem.
#[derive(Debug)]
pub(super) struct Memory {
    /// Variables of the problem; slacks follow.
    pub n: usize,
    /// Rows that bound anything.
    pub m: usize,
    /// Constraint of every row, `[m]`.
    rows: Vec<usize>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub slacks: Vec<Slack>,
    /// Values of the equality rows, unscaled, `[m]`.
    target: Vec<f64>,
    pub objective_scale: f64,
    pub row_scale: Vec<f64>,
    variable_bounds: Bounds,
    constraint_bounds: Bounds,
    /// (row, column) of the kept Jacobian entries and their place in the values of the problem.
    pub jacobian_entries: Vec<(usize, usize)>,
    jacobian_place: Vec<usize>,
    pub hessian_entries: Vec<(usize, usize)>,
    raw_constraints: Vec<f64>,
    raw_jacobian: Vec<f64>,
    raw_multipliers: Vec<f64>,
    /// Gradient and Jacobian at the start, and the largest entry of every row, from which the scales follow.
    scaling: [Vec<f64>; 3],
    proximal: Option<Proximal>,
    pub evaluations: Evaluations,
}

/// Scales of objective and rows, with the bounds of X in them.
#[derive(Clone, Debug)]
pub(super) struct Scales {
    objective: f64,
    rows: Vec<f64>,
    bounds: [Vec<f64>; 2],
}

/// A problem with its form.
pub(super) struct Form<'a> {
    nlp: &'a mut dyn Nlp,
    own: &'a mut Memory,
}

impl std::ops::Deref for Form<'_> {
    type Target = Memory;

    fn deref(&self) -> &Memory {
        self.own
    }
}

impl std::ops::DerefMut for Form<'_> {
    fn deref_mut(&mut self) -> &mut Memory {
        self.own
    }
}

impl Memory {
    /// Analyzes a problem.
    pub fn new(nlp: &dyn Nlp) -> Result<Self, Error> {
        let (n, all) = (nlp.variables(), nlp.constraints());
        let (variables, constraints) = (nlp.variable_bounds(), nlp.constraint_bounds());
        check_bounds(&variables, n, "bounds of the variables", |i| nlp.variable_name(i))?;
        check_bounds(&constraints, all, "bounds of the constraints", |i| nlp.constraint_name(i))?;
        let (mut lower, mut upper) = (variables.lower.clone(), variables.upper.clone());
        let (mut rows, mut row_of) = (Vec::new(), vec![usize::MAX; all]);
        let (mut target, mut slacks) = (Vec::new(), Vec::new());
        for (i, (&l, &u)) in constraints.lower.iter().zip(&constraints.upper).enumerate() {
            if l == f64::NEG_INFINITY && u == f64::INFINITY {
                continue;
            }
            row_of[i] = rows.len();
            target.push(if l == u { l } else { 0.0 });
            if l != u {
                slacks.push(Slack { row: rows.len(), sign: -1.0, cost: 0.0 });
                lower.push(l);
                upper.push(u);
            }
            rows.push(i);
        }
        let m = rows.len();
        check_freedom(&lower, &upper, n, m - slacks.len())?;
        let pattern = nlp.jacobian_pattern();
        check_entries("Jacobian", &pattern, all, n)?;
        let kept = |&(_, &(row, _)): &(usize, &(usize, usize))| row_of[row] != usize::MAX;
        let (jacobian_place, jacobian_entries) =
            pattern.iter().enumerate().filter(kept).map(|(at, &(i, j))| (at, (row_of[i], j))).unzip();
        let hessian_entries = nlp.hessian_pattern();
        check_entries("Hessian", &hessian_entries, n, n)?;
        Ok(Self {
            n,
            m,
            rows,
            lower,
            upper,
            slacks,
            target,
            objective_scale: 1.0,
            row_scale: vec![1.0; m],
            variable_bounds: variables,
            constraint_bounds: constraints,
            jacobian_entries,
            jacobian_place,
            hessian_entries,
            raw_constraints: vec![0.0; all],
            raw_jacobian: vec![0.0; pattern.len()],
            raw_multipliers: vec![0.0; all],
            scaling: Default::default(),
            proximal: None,
            evaluations: Evaluations::default(),
        })
    }

    /// Takes over the bounds that the problem has now; false where another set of constraints bounds anything, or is
    /// an equality, than before: the problem then has to be analyzed anew.
    pub fn take_bounds(&mut self, nlp: &dyn Nlp) -> Result<bool, Error> {
        let (n, all) = (self.n, self.raw_constraints.len());
        nlp.write_bounds(&mut self.variable_bounds, &mut self.constraint_bounds);
        let (variables, constraints) = (&self.variable_bounds, &self.constraint_bounds);
        check_bounds(variables, n, "bounds of the variables", |i| nlp.variable_name(i))?;
        check_bounds(constraints, all, "bounds of the constraints", |i| nlp.constraint_name(i))?;
        let (mut row, mut slack) = (0, 0);
        for (i, (&l, &u)) in constraints.lower.iter().zip(&constraints.upper).enumerate() {
            let bounds = l != f64::NEG_INFINITY || u != f64::INFINITY;
            if bounds != (self.rows.get(row) == Some(&i)) {
                return Ok(false);
            }
            if !bounds {
                continue;
            }
            if (l == u) == (self.slacks.get(slack).is_some_and(|slack| slack.row == row)) {
                return Ok(false);
            }
            self.target[row] = if l == u { l } else { 0.0 };
            slack += usize::from(l != u);
            row += 1;
        }
        self.lower[..n].copy_from_slice(&variables.lower);
        self.upper[..n].copy_from_slice(&variables.upper);
        check_freedom(&self.lower, &self.upper, n, self.m - self.slacks.len())?;
        self.evaluations = Evaluations::default();
        Ok(true)
    }
}

impl<'a> Form<'a> {
    /// The problem that the memory belongs to.
    pub fn new(nlp: &'a mut dyn Nlp, own: &'a mut Memory) -> Self {
        Self { nlp, own }
    }

    /// Constraints of the problem.
    pub fn constraints(&self) -> usize {
        self.raw_constraints.len()
    }

    /// Variables and slacks.
    pub fn total(&self) -> usize {
        self.n + self.slacks.len()
    }

    pub fn fixed(&self, j: usize) -> bool {
        self.lower[j] == self.upper[j]
    }

    /// Stage of every variable and row, where the problem has stages.
    pub fn stages(&self) -> Result<Option<Vec<usize>>, Error> {
        let Some(stages) = self.nlp.stages() else { return Ok(None) };
        let all = self.raw_constraints.len();
        length("stages of the variables", stages.variables.len(), self.n)?;
        length("stages of the constraints", stages.constraints.len(), all)?;
        let rows = self.rows.iter().map(|&i| stages.constraints[i]);
        Ok(Some(stages.variables.iter().copied().chain(rows).collect()))
    }

    /// Scales objective and rows so that no entry of their gradients at `x` is larger than `limit`. An objective whose
    /// gradient is small is scaled up: compared with the barrier terms it would be lost until the barrier has all but
    /// gone.
    pub fn scale(&mut self, x: &[f64], limit: f64) -> Result<(), EvaluationError> {
        let [mut gradient, mut jacobian, mut largest] = std::mem::take(&mut self.scaling);
        gradient.resize(self.total(), 0.0);
        jacobian.resize(self.jacobian_entries.len(), 0.0);
        self.objective_scale = 1.0;
        self.row_scale.fill(1.0);
        self.derivatives(x, &mut gradient, &mut jacobian)?;
        let factor = |largest: f64| if largest > limit { (limit / largest).max(1e-8) } else { 1.0 };
        largest.clear();
        largest.resize(self.m, 0.0);
        for (&(row, _), value) in self.jacobian_entries.iter().zip(&jacobian) {
            largest[row] = largest[row].max(value.abs());
        }
        let own = &mut *self.own;
        own.row_scale.iter_mut().zip(&largest).for_each(|(scale, &largest)| *scale = factor(largest));
        let steepest = gradient[..own.n].iter().fold(0.0f64, |m, g| m.max(g.abs()));
        let least = LEAST_GRADIENT * limit;
        own.objective_scale = match steepest > 0.0 && steepest < least && limit.is_finite() {
            true => (least / steepest).min(LARGEST_SCALE),
            false => factor(steepest),
        };
        for (j, slack) in own.slacks.iter().enumerate() {
            let (constraint, scale) = (own.rows[slack.row], own.row_scale[slack.row]);
            own.lower[own.n + j] = own.constraint_bounds.lower[constraint] * scale;
            own.upper[own.n + j] = own.constraint_bounds.upper[constraint] * scale;
        }
        self.scaling = [gradient, jacobian, largest];
        Ok(())
    }

    /// The scales, for another run from a point where they may be others.
    pub fn scales(&self) -> Scales {
        let bounds = [self.lower.clone(), self.upper.clone()];
        Scales { objective: self.objective_scale, rows: self.row_scale.clone(), bounds }
    }

    /// Goes back to earlier scales.
    pub fn rescale(&mut self, scales: Scales) {
        (self.objective_scale, self.row_scale) = (scales.objective, scales.rows);
        [self.lower, self.upper] = scales.bounds;
    }

    /// Scaled rows of the constraints alone, without slacks, at the variables of `x`.
    pub fn rows_at(&mut self, x: &[f64], rows: &mut [f64]) -> Result<(), EvaluationError> {
        self.nlp.constraint_values(&x[..self.own.n], &mut self.own.raw_constraints)?;
        for (row, value) in rows.iter_mut().enumerate() {
            *value = self.row_scale[row] * (self.raw_constraints[self.rows[row]] - self.target[row]);
        }
        match rows.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(row) => Err(not_finite(self.nlp.constraint_name(self.rows[row]), rows[row])),
        }
    }

    /// Objective, with the rows in `rows` `[m]`.
    pub fn functions(&mut self, x: &[f64], rows: &mut [f64]) -> Result<f64, EvaluationError> {
        self.evaluations.functions += 1;
        self.rows_at(x, rows)?;
        let mut objective = match &self.own.proximal {
            None => self.objective_scale * self.nlp.objective(&x[..self.own.n])?,
            Some(near) => {
                let terms = near.reference.iter().zip(x);
                0.5 * near.zeta * terms.map(|(r, x)| (weight(*r) * (x - r)).powi(2)).sum::<f64>()
            }
        };
        for (slack, s) in self.slacks.iter().zip(&x[self.n..]) {
            rows[slack.row] += slack.sign * s;
            objective += slack.cost * s;
        }
        if objective.is_finite() { Ok(objective) } else { Err(not_finite("the objective".into(), objective)) }
    }

    /// Gradient of the objective in X and entries of the Jacobian in x.
    pub fn derivatives(
        &mut self,
        x: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluations.gradients += 1;
        let (variables, costs) = gradient.split_at_mut(self.n);
        costs.iter_mut().zip(&self.slacks).for_each(|(g, slack)| *g = slack.cost);
        match &self.own.proximal {
            None => {
                self.nlp.gradient(&x[..self.own.n], variables)?;
                variables.iter_mut().for_each(|g| *g *= self.objective_scale);
            }
            Some(near) => {
                variables.fill(0.0);
                for ((g, r), x) in gradient.iter_mut().zip(&near.reference).zip(x) {
                    *g += near.zeta * weight(*r).powi(2) * (x - r);
                }
            }
        }
        self.nlp.jacobian(&x[..self.own.n], &mut self.own.raw_jacobian)?;
        for ((value, &place), &(row, _)) in
            jacobian.iter_mut().zip(&self.jacobian_place).zip(&self.jacobian_entries)
        {
            *value = self.row_scale[row] * self.raw_jacobian[place];
        }
        if let Some(i) = gradient.iter().position(|g| !g.is_finite()) {
            return Err(not_finite(format!("the gradient by {}", self.name(i)), gradient[i]));
        }
        if let Some(at) = jacobian.iter().position(|value| !value.is_finite()) {
            let (row, column) = self.jacobian_entries[at];
            let (row, column) = (self.nlp.constraint_name(self.rows[row]), self.nlp.variable_name(column));
            return Err(not_finite(format!("the derivative of {row} by {column}"), jacobian[at]));
        }
        Ok(())
    }

    /// Hessian of the Lagrangian in x, without the proximal term.
    pub fn hessian(&mut self, x: &[f64], y: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.evaluations.hessians += 1;
        self.unscale_multipliers(y);
        let factor = if self.proximal.is_some() { 0.0 } else { self.objective_scale };
        self.nlp.hessian(&x[..self.own.n], factor, &self.own.raw_multipliers, values)?;
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(at) => {
                let (i, j) = self.hessian_entries[at];
                let (i, j) = (self.nlp.variable_name(i), self.nlp.variable_name(j));
                Err(not_finite(format!("the Hessian by {i} and {j}"), values[at]))
            }
        }
    }

    /// Diagonal that the proximal term adds to the Hessian at variable or slack `j`.
    pub fn proximal(&self, j: usize) -> f64 {
        self.proximal
            .as_ref()
            .and_then(|near| near.reference.get(j).map(|r| near.zeta * weight(*r).powi(2)))
            .unwrap_or(0.0)
    }

    /// Relaxes every row by p, n >= 0 and replaces the objective by their sum and the distance to `reference`.
    pub fn relax(&mut self, reference: &[f64]) {
        let slacks = self.slacks.len();
        self.proximal = Some(Proximal { reference: reference.to_vec(), slacks, zeta: 0.0 });
        let own = &mut *self.own;
        for row in 0..own.m {
            for sign in [-1.0, 1.0] {
                own.slacks.push(Slack { row, sign, cost: RELAXATION_COST });
                own.lower.push(0.0);
                own.upper.push(f64::INFINITY);
            }
        }
    }

    /// Weight of the distance in the restoration, from its barrier parameter.
    pub fn set_barrier(&mut self, barrier: f64) {
        if let Some(near) = &mut self.proximal {
            near.zeta = barrier.sqrt();
        }
    }

    /// Back to the problem itself.
    pub fn unrelax(&mut self) {
        if let Some(near) = self.proximal.take() {
            let own = &mut *self.own;
            own.slacks.truncate(near.slacks);
            own.lower.truncate(own.n + near.slacks);
            own.upper.truncate(own.n + near.slacks);
        }
    }

    /// `product = A x + S s`.
    pub fn multiply(&self, jacobian: &[f64], x: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        for (&(row, column), value) in self.jacobian_entries.iter().zip(jacobian) {
            product[row] += value * x[column];
        }
        for (slack, s) in self.slacks.iter().zip(&x[self.n..]) {
            product[slack.row] += slack.sign * s;
        }
    }

    /// Adds `(A, S)^T y` to `sum`.
    pub fn add_transposed(&self, jacobian: &[f64], y: &[f64], sum: &mut [f64]) {
        for (&(row, column), value) in self.jacobian_entries.iter().zip(jacobian) {
            sum[column] += value * y[row];
        }
        for (slack, s) in self.slacks.iter().zip(&mut sum[self.n..]) {
            *s += slack.sign * y[slack.row];
        }
    }

    /// Multipliers of all constraints of the problem, `[constraints]`; the objective stays scaled.
    fn unscale_multipliers(&mut self, y: &[f64]) {
        let own = &mut *self.own;
        for ((&i, scale), y) in own.rows.iter().zip(&own.row_scale).zip(y) {
            own.raw_multipliers[i] = scale * y;
        }
    }

    /// Multipliers in the units of the problem.
    pub fn constraint_multipliers(&mut self, y: &[f64], multipliers: &mut Vec<f64>) {
        self.unscale_multipliers(y);
        multipliers.clear();
        multipliers.extend(self.raw_multipliers.iter().map(|y| y / self.objective_scale));
    }

    /// Scaled multipliers of the rows from those of the problem.
    pub fn scaled_multipliers(&self, y: &[f64], scaled: &mut Vec<f64>) {
        scaled.clear();
        let rows = self.rows.iter().zip(&self.row_scale);
        scaled.extend(rows.map(|(&i, scale)| y[i] * self.objective_scale / scale));
    }

    /// Objective in the units of the problem.
    pub fn plain_objective(&mut self, x: &[f64]) -> f64 {
        self.nlp.objective(&x[..self.own.n]).unwrap_or(f64::NAN)
    }

    /// Scaled objective of the problem itself, also while it is replaced by that of the restoration.
    pub fn own_objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        let objective = self.objective_scale * self.nlp.objective(&x[..self.own.n])?;
        if objective.is_finite() { Ok(objective) } else { Err(not_finite("the objective".into(), objective)) }
    }

    /// Slacks of the problem itself, without relaxations.
    pub fn own_slacks(&self) -> usize {
        self.proximal.as_ref().map_or(self.slacks.len(), |near| near.slacks)
    }

    /// Rows without the relaxations, added to `rows`, which holds them with.
    pub fn remove_relaxations(&self, x: &[f64], rows: &mut [f64]) {
        let own = self.own_slacks();
        for (slack, s) in self.slacks[own..].iter().zip(&x[self.n + own..]) {
            rows[slack.row] -= slack.sign * s;
        }
    }

    /// Largest row in the unit of its constraint.
    pub fn violation(&self, rows: &[f64]) -> f64 {
        rows.iter().zip(&self.row_scale).fold(0.0, |m, (c, scale)| m.max(c.abs() / scale))
    }

    /// The largest violation of the problem's own constraints and bounds, in their units; what it is where it exceeds
    /// `tolerance`.
    pub fn worst(&mut self, x: &[f64], tolerance: f64) -> (f64, Option<Violation>) {
        let x = &x[..self.n];
        if self.nlp.constraint_values(x, &mut self.own.raw_constraints).is_err() {
            return (0.0, None);
        }
        let largest = |values: &[f64], bounds: &Bounds| {
            let mut worst = (0.0, usize::MAX);
            for (i, v) in values.iter().enumerate() {
                let amount = (bounds.lower[i] - v).max(v - bounds.upper[i]);
                if amount > worst.0 || amount.is_nan() {
                    worst = (amount, i);
                }
            }
            worst
        };
        let constraint = largest(&self.raw_constraints, &self.constraint_bounds);
        let variable = largest(x, &self.variable_bounds);
        let of_variable = variable.0 > constraint.0;
        let (amount, i) = if of_variable { variable } else { constraint };
        if i == usize::MAX || amount <= tolerance {
            return (amount, None);
        }
        let (values, bounds, name) = match of_variable {
            true => (x, &self.variable_bounds, self.nlp.variable_name(i)),
            false => (&self.raw_constraints[..], &self.constraint_bounds, self.nlp.constraint_name(i)),
        };
        let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
        (amount, Some(Violation { name, value: values[i], lower, upper, amount }))
    }

    /// The bound with the largest multiplier, of a variable or of an inequality.
    pub fn blocking(&self, lower: &[f64], upper: &[f64]) -> Option<Blocking> {
        let count = self.n + self.own_slacks();
        let multiplier = |j: usize| lower[j].max(upper[j]);
        let j = (0..count).max_by(|&a, &b| multiplier(a).total_cmp(&multiplier(b)))?;
        let (side, bounds) =
            if lower[j] > upper[j] { (Side::Lower, &self.lower) } else { (Side::Upper, &self.upper) };
        let scale = j.checked_sub(self.n).map_or(1.0, |slack| self.row_scale[self.slacks[slack].row]);
        (multiplier(j) > 1e-6).then(|| Blocking { name: self.name(j), side, bound: bounds[j] / scale })
    }

    fn name(&self, i: usize) -> String {
        match i.checked_sub(self.n) {
            None => self.nlp.variable_name(i),
            Some(slack) => self.nlp.constraint_name(self.rows[self.slacks[slack].row]),
        }
    }
}

/// Weight of the distance of one variable in the restoration.
fn weight(reference: f64) -> f64 {
    1.0f64.min(1.0 / reference.abs())
}

fn not_finite(function: String, value: f64) -> EvaluationError {
    EvaluationError { function, reason: format!("its value is {value}") }
}

/// Checks that there are not more equations than variables that may move.
fn check_freedom(lower: &[f64], upper: &[f64], n: usize, equalities: usize) -> Result<(), Error> {
    let free = lower[..n].iter().zip(upper).filter(|(l, u)| l != u).count();
    if equalities > free { Err(Error::Overdetermined { equalities, free }) } else { Ok(()) }
}

/// Checks the length of a vector.
pub(super) fn length(what: &'static str, given: usize, expected: usize) -> Result<(), Error> {
    if given == expected { Ok(()) } else { Err(Error::Length { what, given, expected }) }
}

fn check_bounds(
    bounds: &Bounds,
    count: usize,
    what: &'static str,
    name: impl Fn(usize) -> String,
) -> Result<(), Error> {
    length(what, bounds.lower.len(), count)?;
    length(what, bounds.upper.len(), count)?;
    for (i, (&lower, &upper)) in bounds.lower.iter().zip(&bounds.upper).enumerate() {
        let empty = lower.is_nan() || upper.is_nan() || lower > upper;
        if empty || lower == f64::INFINITY || upper == f64::NEG_INFINITY {
            return Err(Error::Bounds { name: name(i), lower, upper });
        }
    }
    Ok(())
}

fn check_entries(
    matrix: &'static str,
    entries: &[(usize, usize)],
    rows: usize,
    columns: usize,
) -> Result<(), Error> {
    match entries.iter().position(|&(row, column)| row >= rows || column >= columns) {
        None => Ok(()),
        Some(entry) => {
            let (row, column) = entries[entry];
            Err(Error::Entry { matrix, entry, row, column, rows, columns })
        }
    }
}
