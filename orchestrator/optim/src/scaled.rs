//! A problem in scaled variables: `x = d z`.

use super::nlp::{Bounds, EvaluationError, Nlp, Stages};
use super::outcome::{Multipliers, Solution, Start};

/// A problem as a function of `z = x / d`.
pub struct Scaled<N> {
    nlp: N,
    scales: Vec<f64>,
    x: Vec<f64>,
    of_jacobian: Vec<f64>,
    of_hessian: Vec<f64>,
}

impl<N: Nlp> Scaled<N> {
    /// Scales d, `[n]`, positive; missing ones count as 1.
    pub fn new(nlp: N, mut scales: Vec<f64>) -> Scaled<N> {
        scales.resize(nlp.variables(), 1.0);
        let of_jacobian = nlp.jacobian_pattern().iter().map(|&(_, j)| scales[j]).collect();
        let of_hessian = nlp.hessian_pattern().iter().map(|&(i, j)| scales[i] * scales[j]).collect();
        Scaled { nlp, x: vec![0.0; scales.len()], scales, of_jacobian, of_hessian }
    }

    /// A start of the problem as one of the scaled problem. A vector of the wrong length stays as it is.
    pub fn start(&self, start: &Start) -> Start {
        let with = |values: &[f64], power: i32| -> Vec<f64> {
            let scales = self.scales.iter().map(|scale| scale.powi(power)).chain(std::iter::repeat(1.0));
            values.iter().zip(scales).map(|(value, scale)| value * scale).collect()
        };
        let multipliers = start.multipliers.as_ref().map(|m| Multipliers {
            constraints: m.constraints.clone(),
            lower: with(&m.lower, 1),
            upper: with(&m.upper, 1),
        });
        Start { x: with(&start.x, -1), multipliers, barrier: start.barrier }
    }

    /// A solution of the scaled problem as one of the problem.
    pub fn solution(&self, mut solution: Solution) -> Solution {
        self.unscale(&mut solution);
        solution
    }

    /// Same as [`Scaled::solution`], in place.
    pub fn unscale(&self, solution: &mut Solution) {
        multiply(&mut solution.x, &self.scales);
        let Multipliers { lower, upper, .. } = &mut solution.multipliers;
        for multipliers in [lower, upper] {
            multipliers.iter_mut().zip(&self.scales).for_each(|(z, scale)| *z /= scale);
        }
    }

    /// The problem itself.
    pub fn inner(&mut self) -> &mut N {
        &mut self.nlp
    }

    /// Scales d, `[n]`.
    pub fn scales(&self) -> &[f64] {
        &self.scales
    }

    fn plain(&mut self, z: &[f64]) {
        self.x.iter_mut().zip(z.iter().zip(&self.scales)).for_each(|(x, (z, scale))| *x = z * scale);
    }
}

fn multiply(values: &mut [f64], factors: &[f64]) {
    values.iter_mut().zip(factors).for_each(|(value, factor)| *value *= factor);
}

impl<N: Nlp> Nlp for Scaled<N> {
    fn variables(&self) -> usize {
        self.nlp.variables()
    }

    fn constraints(&self) -> usize {
        self.nlp.constraints()
    }

    fn variable_bounds(&self) -> Bounds {
        let mut bounds = self.nlp.variable_bounds();
        let divide = |values: &mut [f64]| values.iter_mut().zip(&self.scales).for_each(|(v, s)| *v /= s);
        divide(&mut bounds.lower);
        divide(&mut bounds.upper);
        bounds
    }

    fn constraint_bounds(&self) -> Bounds {
        self.nlp.constraint_bounds()
    }

    fn write_bounds(&self, variables: &mut Bounds, constraints: &mut Bounds) {
        self.nlp.write_bounds(variables, constraints);
        let divide = |values: &mut [f64]| values.iter_mut().zip(&self.scales).for_each(|(v, s)| *v /= s);
        divide(&mut variables.lower);
        divide(&mut variables.upper);
    }

    fn objective(&mut self, z: &[f64]) -> Result<f64, EvaluationError> {
        self.plain(z);
        self.nlp.objective(&self.x)
    }

    fn gradient(&mut self, z: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        self.plain(z);
        self.nlp.gradient(&self.x, gradient)?;
        multiply(gradient, &self.scales);
        Ok(())
    }

    fn constraint_values(&mut self, z: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.plain(z);
        self.nlp.constraint_values(&self.x, values)
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        self.nlp.jacobian_pattern()
    }

    fn jacobian(&mut self, z: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.plain(z);
        self.nlp.jacobian(&self.x, values)?;
        multiply(values, &self.of_jacobian);
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        self.nlp.hessian_pattern()
    }

    fn hessian(
        &mut self,
        z: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.plain(z);
        self.nlp.hessian(&self.x, objective_factor, multipliers, values)?;
        multiply(values, &self.of_hessian);
        Ok(())
    }

    fn stages(&self) -> Option<Stages> {
        self.nlp.stages()
    }

    fn variable_name(&self, variable: usize) -> String {
        self.nlp.variable_name(variable)
    }

    fn constraint_name(&self, constraint: usize) -> String {
        self.nlp.constraint_name(constraint)
    }
}
