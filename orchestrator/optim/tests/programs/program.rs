//! A program read from text, as an [`Nlp`].

use std::time::{Duration, Instant};

use airloop_optim::{Bounds, EvaluationError, Nlp};

use crate::element::Element;

/// Minimize the sum of `objective` subject to bounds on `x` and on `rows`.
#[derive(Clone, Debug)]
pub struct Program {
    pub name: String,
    pub start: Vec<f64>,
    /// Values of the known minima, the best one first.
    pub minima: Vec<f64>,
    pub bounds: Bounds,
    pub row_bounds: Bounds,
    pub objective: Vec<Element>,
    pub rows: Vec<Element>,
    /// Where the elements were differentiated last.
    at: Vec<f64>,
    /// Time in the functions.
    pub elapsed: Duration,
}

impl Program {
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            start: Vec::new(),
            minima: Vec::new(),
            bounds: Bounds::free(0),
            row_bounds: Bounds::free(0),
            objective: Vec::new(),
            rows: Vec::new(),
            at: Vec::new(),
            elapsed: Duration::ZERO,
        }
    }

    /// All variables free, from zero.
    pub fn resize(&mut self, count: usize) {
        (self.start, self.bounds) = (vec![0.0; count], Bounds::free(count));
    }

    fn differentiate(&mut self, x: &[f64]) {
        if self.at != x {
            self.objective.iter_mut().chain(&mut self.rows).for_each(|element| element.differentiate(x));
            self.at = x.to_vec();
        }
    }

    fn timed<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        let begin = Instant::now();
        let result = work(self);
        self.elapsed += begin.elapsed();
        result
    }
}

impl Nlp for Program {
    fn variables(&self) -> usize {
        self.start.len()
    }

    fn constraints(&self) -> usize {
        self.rows.len()
    }

    fn variable_bounds(&self) -> Bounds {
        self.bounds.clone()
    }

    fn constraint_bounds(&self) -> Bounds {
        self.row_bounds.clone()
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        Ok(self.timed(|own| own.objective.iter().map(|element| element.value(x)).sum()))
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        self.timed(|own| {
            own.differentiate(x);
            gradient.fill(0.0);
            for element in &own.objective {
                element.own.iter().zip(&element.gradient).for_each(|(&at, slope)| gradient[at] += slope);
            }
        });
        Ok(())
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.timed(|own| values.iter_mut().zip(&own.rows).for_each(|(value, row)| *value = row.value(x)));
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        let rows = self.rows.iter().enumerate();
        rows.flat_map(|(i, row)| row.own.iter().map(move |&j| (i, j))).collect()
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.timed(|own| {
            own.differentiate(x);
            let slopes = own.rows.iter().flat_map(|row| &row.gradient);
            values.iter_mut().zip(slopes).for_each(|(value, slope)| *value = *slope);
        });
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        self.objective.iter().chain(&self.rows).flat_map(Element::pairs).collect()
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.timed(|own| {
            own.differentiate(x);
            let of_objective = own.objective.iter().map(|element| (objective_factor, element));
            let of_rows = multipliers.iter().copied().zip(&own.rows);
            let terms = of_objective.chain(of_rows);
            let entries = terms.flat_map(|(factor, element)| element.hessian.iter().map(move |h| factor * h));
            values.iter_mut().zip(entries).for_each(|(value, entry)| *value = entry);
        });
        Ok(())
    }
}
