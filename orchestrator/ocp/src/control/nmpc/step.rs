//! One step of the plant by the linearly implicit midpoint rule, with derivatives.
//!
//! `x+ = x + (I - h/2 J)^-1 h f`: second order with one evaluation, and stable where friction is stiff.

use super::family::Family;
use crate::transcription::Point;
use airloop_optim::EvaluationError;

/// Memory of [`Stepper::step`].
pub struct Stepper {
    n: usize,
    m: usize,
    np: usize,
    /// `I - h/2 J`, eliminated in place, `[n, n]`.
    matrix: Vec<f64>,
    by_parameters: Vec<f64>,
    /// `[h f, I + h/2 J, h J_u, h f_p]`, `[n, 1 + n + m + n_p]`.
    right: Vec<f64>,
}

/// Where a step ends, with derivatives; row-major.
pub struct Next<'a> {
    /// States, `[n]`.
    pub x: &'a mut [f64],
    /// Derivatives by the states, `[n, n]`.
    pub a: &'a mut [f64],
    /// Derivatives by the inputs, `[n, m]`.
    pub b: &'a mut [f64],
    /// Derivatives by the parameters, `[n, n_p]`; may be empty.
    pub g: &'a mut [f64],
}

impl Stepper {
    /// For the sizes of `family`.
    pub fn new(family: &Family) -> Stepper {
        let (size, np) = (family.size(), family.parameters());
        let (n, m) = (size.states, size.inputs);
        Stepper {
            n,
            m,
            np,
            matrix: vec![0.0; n * n],
            by_parameters: vec![0.0; n * np],
            right: vec![0.0; n * (1 + n + m + np)],
        }
    }

    /// One step of `h` \[s\].
    ///
    /// # Errors
    /// Functions without a value, or a step without one.
    pub fn step(
        &mut self,
        family: &mut Family,
        (at, p): (Point<'_>, &[f64]),
        h: f64,
        next: Next<'_>,
    ) -> Result<(), EvaluationError> {
        let Stepper { n, m, np, ref mut matrix, ref mut by_parameters, ref mut right } = *self;
        let np = if next.g.is_empty() { 0 } else { np };
        let (width, arguments) = (1 + n + m + np, n + m);
        let (values, jacobian) = family.evaluate(at, p, &mut by_parameters[..n * np])?;
        for i in 0..n {
            let row = &mut right[i * width..][..width];
            row[0] = h * values[i];
            for j in 0..n {
                let half = 0.5 * h * jacobian[i * arguments + j];
                let unit = if i == j { 1.0 } else { 0.0 };
                matrix[i * n + j] = unit - half;
                row[1 + j] = unit + half;
            }
            (0..m).for_each(|j| row[1 + n + j] = h * jacobian[i * arguments + n + j]);
            (0..np).for_each(|j| row[1 + n + m + j] = h * by_parameters[i * np + j]);
        }
        if !eliminate(matrix, right, n, width) {
            let function = "step of the prediction".into();
            return Err(EvaluationError { function, reason: "its matrix is singular".into() });
        }
        for i in 0..n {
            let row = &right[i * width..][..width];
            next.x[i] = at.states[i] + row[0];
            next.a[i * n..][..n].copy_from_slice(&row[1..=n]);
            next.b[i * m..][..m].copy_from_slice(&row[1 + n..][..m]);
            next.g
                .get_mut(i * np..(i + 1) * np)
                .into_iter()
                .for_each(|g| g.copy_from_slice(&row[1 + n + m..]));
        }
        Ok(())
    }
}

/// Solves `matrix X = right` in place with pivots by rows; `matrix` `[n, n]`, `right` `[n, width]`. False where it is
/// singular.
pub fn eliminate(matrix: &mut [f64], right: &mut [f64], n: usize, width: usize) -> bool {
    for k in 0..n {
        let size = |i: &usize| matrix[i * n + k].abs();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(k);
        let value = matrix[pivot * n + k];
        if !(value != 0.0 && value.is_finite()) {
            return false;
        }
        if pivot != k {
            (0..n).for_each(|j| matrix.swap(pivot * n + j, k * n + j));
            (0..width).for_each(|j| right.swap(pivot * width + j, k * width + j));
        }
        for i in k + 1..n {
            let factor = matrix[i * n + k] / value;
            if factor != 0.0 {
                (k + 1..n).for_each(|j| matrix[i * n + j] -= factor * matrix[k * n + j]);
                (0..width).for_each(|j| right[i * width + j] -= factor * right[k * width + j]);
            }
        }
    }
    for k in (0..n).rev() {
        for j in 0..width {
            let known: f64 = (k + 1..n).map(|i| matrix[k * n + i] * right[i * width + j]).sum();
            right[k * width + j] = (right[k * width + j] - known) / matrix[k * n + k];
        }
    }
    true
}
