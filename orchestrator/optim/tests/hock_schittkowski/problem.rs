//! A small problem written as formulas, as an [`Nlp`].

use airloop_optim::{Bounds, EvaluationError, Nlp};

use crate::jet::{Jet, place};

type Formula = fn(&[Jet]) -> Jet;
type Formulas = fn(&[Jet]) -> Vec<Jet>;

/// Problem with its published start and the values of its minima, the best one first.
pub struct Problem {
    pub name: &'static str,
    pub start: Vec<f64>,
    pub minima: Vec<f64>,
    bounds: Bounds,
    constraint_bounds: Bounds,
    objective: Formula,
    constraints: Formulas,
}

impl Problem {
    pub fn new(name: &'static str, start: &[f64], minima: &[f64], objective: Formula) -> Self {
        Self {
            name,
            start: start.to_vec(),
            minima: minima.to_vec(),
            bounds: Bounds::free(start.len()),
            constraint_bounds: Bounds::free(0),
            objective,
            constraints: |_| Vec::new(),
        }
    }

    /// Bounds of all variables.
    pub fn within(mut self, bounds: &[(f64, f64)]) -> Self {
        self.bounds.lower = bounds.iter().map(|b| b.0).collect();
        self.bounds.upper = bounds.iter().map(|b| b.1).collect();
        self
    }

    /// Constraints: the first `equalities` are zero, the other `inequalities` at least zero.
    pub fn subject_to(mut self, equalities: usize, inequalities: usize, constraints: Formulas) -> Self {
        self.constraint_bounds = Bounds::zero(equalities + inequalities);
        self.constraint_bounds.upper[equalities..].fill(f64::INFINITY);
        self.constraints = constraints;
        self
    }

    fn jets(&self, x: &[f64]) -> (Jet, Vec<Jet>) {
        let x: Vec<Jet> = x.iter().enumerate().map(|(i, &x)| Jet::variable(x, i)).collect();
        ((self.objective)(&x), (self.constraints)(&x))
    }
}

impl Nlp for Problem {
    fn variables(&self) -> usize {
        self.start.len()
    }

    fn constraints(&self) -> usize {
        self.constraint_bounds.lower.len()
    }

    fn variable_bounds(&self) -> Bounds {
        self.bounds.clone()
    }

    fn constraint_bounds(&self) -> Bounds {
        self.constraint_bounds.clone()
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        Ok(self.jets(x).0.value)
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        gradient.copy_from_slice(&self.jets(x).0.gradient[..x.len()]);
        Ok(())
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values.iter_mut().zip(self.jets(x).1).for_each(|(value, jet)| *value = jet.value);
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        let n = self.variables();
        (0..self.constraints()).flat_map(|i| (0..n).map(move |j| (i, j))).collect()
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        for (row, jet) in values.chunks_mut(x.len()).zip(self.jets(x).1) {
            row.copy_from_slice(&jet.gradient[..x.len()]);
        }
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        (0..self.variables()).flat_map(|i| (0..=i).map(move |j| (i, j))).collect()
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (objective, constraints) = self.jets(x);
        for (&(i, j), value) in self.hessian_pattern().iter().zip(values) {
            let at = place(i, j);
            let terms = constraints.iter().zip(multipliers).map(|(c, y)| y * c.hessian[at]);
            *value = objective_factor * objective.hessian[at] + terms.sum::<f64>();
        }
        Ok(())
    }
}
