//! The problem in the form the methods work on: equations `c(x) + S s = 0` with scaled rows, where s holds the
//! slacks, each in one row; bounds on `X = (x, s)`. Feasibility restoration is another objective on the same form.

use super::error::Error;
use super::nlp::{Bounds, EvaluationError, Nlp};
use super::outcome::{Blocking, Evaluations, Side, Violation};

/// Weight of the relaxations in the feasibility restoration.
pub(super) const RELAXATION_COST: f64 = 1e3;

/// Least gradient of the scaled objective at the start as a part of the largest, and the largest factor to get there:
/// a start may be stationary by chance.
const LEAST_GRADIENT: f64 = 0.1;
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

pub(super) struct Form<'a> {
    nlp: &'a mut dyn Nlp,
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
    proximal: Option<Proximal>,
    pub evaluations: Evaluations,
}

impl<'a> Form<'a> {
    pub fn new(nlp: &'a mut dyn Nlp) -> Result<Self, Error> {
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
        let free = (0..n).filter(|&i| lower[i] != upper[i]).count();
        if m - slacks.len() > free {
            return Err(Error::Overdetermined { equalities: m - slacks.len(), free });
        }
        let pattern = nlp.jacobian_pattern();
        check_entries("Jacobian", &pattern, all, n)?;
        let kept = |&(_, &(row, _)): &(usize, &(usize, usize))| row_of[row] != usize::MAX;
        let (jacobian_place, jacobian_entries) =
            pattern.iter().enumerate().filter(kept).map(|(at, &(i, j))| (at, (row_of[i], j))).unzip();
        let hessian_entries = nlp.hessian_pattern();
        check_entries("Hessian", &hessian_entries, n, n)?;
        Ok(Self {
            nlp,
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
            proximal: None,
            evaluations: Evaluations::default(),
        })
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
        let (mut gradient, mut jacobian) = (vec![0.0; self.total()], vec![0.0; self.jacobian_entries.len()]);
        self.objective_scale = 1.0;
        self.row_scale.fill(1.0);
        self.derivatives(x, &mut gradient, &mut jacobian)?;
        let factor = |largest: f64| if largest > limit { (limit / largest).max(1e-8) } else { 1.0 };
        let mut largest = vec![0.0f64; self.m];
        for (&(row, _), value) in self.jacobian_entries.iter().zip(&jacobian) {
            largest[row] = largest[row].max(value.abs());
        }
        self.row_scale = largest.into_iter().map(factor).collect();
        let steepest = gradient[..self.n].iter().fold(0.0f64, |m, g| m.max(g.abs()));
        let least = LEAST_GRADIENT * limit;
        self.objective_scale = match steepest > 0.0 && steepest < least && limit.is_finite() {
            true => (least / steepest).min(LARGEST_SCALE),
            false => factor(steepest),
        };
        for (j, slack) in self.slacks.iter().enumerate() {
            self.lower[self.n + j] =
                self.constraint_bounds.lower[self.rows[slack.row]] * self.row_scale[slack.row];
            self.upper[self.n + j] =
                self.constraint_bounds.upper[self.rows[slack.row]] * self.row_scale[slack.row];
        }
        Ok(())
    }

    /// Scaled rows of the constraints alone, without slacks, at the variables of `x`.
    pub fn rows_at(&mut self, x: &[f64], rows: &mut [f64]) -> Result<(), EvaluationError> {
        self.nlp.constraint_values(&x[..self.n], &mut self.raw_constraints)?;
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
        let mut objective = match &self.proximal {
            None => self.objective_scale * self.nlp.objective(&x[..self.n])?,
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
        match &self.proximal {
            None => {
                self.nlp.gradient(&x[..self.n], variables)?;
                variables.iter_mut().for_each(|g| *g *= self.objective_scale);
            }
            Some(near) => {
                variables.fill(0.0);
                for ((g, r), x) in gradient.iter_mut().zip(&near.reference).zip(x) {
                    *g += near.zeta * weight(*r).powi(2) * (x - r);
                }
            }
        }
        self.nlp.jacobian(&x[..self.n], &mut self.raw_jacobian)?;
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
        self.nlp.hessian(&x[..self.n], factor, &self.raw_multipliers, values)?;
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
        for row in 0..self.m {
            for sign in [-1.0, 1.0] {
                self.slacks.push(Slack { row, sign, cost: RELAXATION_COST });
                self.lower.push(0.0);
                self.upper.push(f64::INFINITY);
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
            self.slacks.truncate(near.slacks);
            self.lower.truncate(self.n + near.slacks);
            self.upper.truncate(self.n + near.slacks);
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
        for ((&i, scale), y) in self.rows.iter().zip(&self.row_scale).zip(y) {
            self.raw_multipliers[i] = scale * y;
        }
    }

    /// Multipliers in the units of the problem.
    pub fn constraint_multipliers(&mut self, y: &[f64]) -> Vec<f64> {
        self.unscale_multipliers(y);
        self.raw_multipliers.iter().map(|y| y / self.objective_scale).collect()
    }

    /// Scaled multipliers of the rows from those of the problem.
    pub fn scaled_multipliers(&self, y: &[f64]) -> Vec<f64> {
        self.rows.iter().zip(&self.row_scale).map(|(&i, scale)| y[i] * self.objective_scale / scale).collect()
    }

    /// Objective in the units of the problem.
    pub fn plain_objective(&mut self, x: &[f64]) -> f64 {
        self.nlp.objective(&x[..self.n]).unwrap_or(f64::NAN)
    }

    /// Scaled objective of the problem itself, also while it is replaced by that of the restoration.
    pub fn own_objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        let objective = self.objective_scale * self.nlp.objective(&x[..self.n])?;
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

    /// The largest violation of the problem's own constraints and bounds, in their units.
    pub fn worst(&mut self, x: &[f64]) -> Option<Violation> {
        let x = &x[..self.n];
        if self.nlp.constraint_values(x, &mut self.raw_constraints).is_err() {
            return None;
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
        let ((amount, i), values, bounds, name) = if variable.0 > constraint.0 {
            (variable, x, &self.variable_bounds, self.nlp.variable_name(variable.1))
        } else if constraint.1 != usize::MAX {
            let name = self.nlp.constraint_name(constraint.1);
            (constraint, &self.raw_constraints[..], &self.constraint_bounds, name)
        } else {
            return None;
        };
        Some(Violation { name, value: values[i], lower: bounds.lower[i], upper: bounds.upper[i], amount })
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
