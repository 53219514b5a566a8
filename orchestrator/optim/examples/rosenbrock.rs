//! Rosenbrock's function inside a disk, with exact derivatives: `cargo run -p airloop-optim --example rosenbrock`.

use airloop_optim::{Bounds, EvaluationError, Nlp, Settings, Start, solve};

/// `min (1 - x)^2 + 100 (y - x^2)^2` subject to `x^2 + y^2 <= 1`.
struct Rosenbrock;

impl Nlp for Rosenbrock {
    fn variables(&self) -> usize {
        2
    }

    fn constraints(&self) -> usize {
        1
    }

    fn variable_bounds(&self) -> Bounds {
        Bounds::free(2)
    }

    fn constraint_bounds(&self) -> Bounds {
        Bounds { lower: vec![f64::NEG_INFINITY], upper: vec![1.0] }
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        Ok((1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2))
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        let slope = 200.0 * (x[1] - x[0] * x[0]);
        gradient.copy_from_slice(&[-2.0 * (1.0 - x[0]) - 2.0 * x[0] * slope, slope]);
        Ok(())
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values[0] = x[0] * x[0] + x[1] * x[1];
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        vec![(0, 0), (0, 1)]
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values.copy_from_slice(&[2.0 * x[0], 2.0 * x[1]]);
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        vec![(0, 0), (1, 0), (1, 1)]
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (f, y) = (objective_factor, multipliers[0]);
        values[0] = f * (2.0 + 1200.0 * x[0] * x[0] - 400.0 * x[1]) + 2.0 * y;
        values[1] = f * -400.0 * x[0];
        values[2] = f * 200.0 + 2.0 * y;
        Ok(())
    }
}

fn main() -> Result<(), airloop_optim::Error> {
    let found = solve(
        &mut Rosenbrock,
        &Start { x: vec![0.0, 0.0], multipliers: None, barrier: None },
        &Settings::default(),
    )?;
    println!(
        "{}: ({:.6}, {:.6}) after {} iterations",
        found.status,
        found.x[0],
        found.x[1],
        found.iterations.len()
    );
    Ok(())
}
