//! A map that gives states other places and signs, such as the exchange of the legs after a step.

use super::link::{Reset, ResetSize};
use airloop_optim::EvaluationError;

/// State after = factor times a state before, as (state before, factor), one for each state.
pub type Relabeling = Vec<(usize, f64)>;

/// A reset, if there is one, and then new places for the states it leads to: `x+ = P R(x-)`.
pub struct Relabeled {
    reset: Option<Box<dyn Reset>>,
    places: Relabeling,
    values: Vec<f64>,
    jacobian: Vec<f64>,
    weights: Vec<f64>,
}

impl Relabeled {
    /// Of a reset between phases with the same states; none: `R` is the identity.
    ///
    /// # Panics
    /// When `places` does not give each state of the reset one, or refers to others.
    pub fn new(reset: Option<Box<dyn Reset>>, places: Relabeling) -> Relabeled {
        let n = places.len();
        let size = reset.as_ref().map_or(ResetSize { before: n, after: n, outputs: 0 }, |own| own.size());
        assert!(size.before == n && size.after == n, "one place per state");
        assert!(places.iter().all(|&(i, _)| i < n), "places are states");
        let values = n + size.outputs;
        Relabeled {
            reset,
            places,
            values: vec![0.0; values],
            jacobian: vec![0.0; values * n],
            weights: vec![0.0; values],
        }
    }

    /// Puts rows of `width` numbers in their places.
    fn place(&self, from: &[f64], width: usize, to: &mut [f64]) {
        let n = self.places.len();
        for (row, &(before, factor)) in to.chunks_mut(width).zip(&self.places) {
            row.iter_mut().zip(&from[before * width..]).for_each(|(to, from)| *to = factor * from);
        }
        to[n * width..].copy_from_slice(&from[n * width..]);
    }
}

impl Reset for Relabeled {
    fn size(&self) -> ResetSize {
        let n = self.places.len();
        ResetSize { before: n, after: n, outputs: self.values.len() - n }
    }

    fn output_names(&self) -> Vec<String> {
        self.reset.as_ref().map(|reset| reset.output_names()).unwrap_or_default()
    }

    fn evaluate(&mut self, before: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        match &mut self.reset {
            Some(reset) => reset.evaluate(before, &mut self.values)?,
            None => self.values.copy_from_slice(before),
        }
        self.place(&self.values, 1, values);
        Ok(())
    }

    fn jacobian(
        &mut self,
        before: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let n = self.places.len();
        match &mut self.reset {
            Some(reset) => reset.jacobian(before, &mut self.values, &mut self.jacobian)?,
            None => {
                self.values.copy_from_slice(before);
                self.jacobian.fill(0.0);
                (0..n).for_each(|i| self.jacobian[i * n + i] = 1.0);
            }
        }
        self.place(&self.values, 1, values);
        self.place(&self.jacobian, n, jacobian);
        Ok(())
    }

    fn hessian(
        &mut self,
        before: &[f64],
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Some(reset) = &mut self.reset else {
            hessian.fill(0.0);
            return Ok(());
        };
        let n = self.places.len();
        self.weights[..n].fill(0.0);
        for (weight, &(before, factor)) in weights.iter().zip(&self.places) {
            self.weights[before] += factor * weight;
        }
        self.weights[n..].copy_from_slice(&weights[n..]);
        reset.hessian(before, &self.weights, hessian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R(x) = (x0 x1, x1), output x0^2.
    struct Product;

    impl Reset for Product {
        fn size(&self) -> ResetSize {
            ResetSize { before: 2, after: 2, outputs: 1 }
        }
        fn output_names(&self) -> Vec<String> {
            vec!["square".into()]
        }
        fn evaluate(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
            values.copy_from_slice(&[x[0] * x[1], x[1], x[0] * x[0]]);
            Ok(())
        }
        fn jacobian(
            &mut self,
            x: &[f64],
            values: &mut [f64],
            jacobian: &mut [f64],
        ) -> Result<(), EvaluationError> {
            self.evaluate(x, values)?;
            jacobian.copy_from_slice(&[x[1], x[0], 0.0, 1.0, 2.0 * x[0], 0.0]);
            Ok(())
        }
        fn hessian(&mut self, _: &[f64], w: &[f64], hessian: &mut [f64]) -> Result<(), EvaluationError> {
            hessian.copy_from_slice(&[2.0 * w[2], w[0], w[0], 0.0]);
            Ok(())
        }
    }

    #[test]
    fn states_after_a_reset_are_exchanged_with_signs_and_outputs_stay() {
        let mut map = Relabeled::new(Some(Box::new(Product)), vec![(1, 1.0), (0, -1.0)]);
        let (mut values, mut jacobian, mut hessian) = ([0.0; 3], [0.0; 6], [0.0; 4]);
        map.jacobian(&[2.0, 3.0], &mut values, &mut jacobian).unwrap();
        assert_eq!(values, [3.0, -6.0, 4.0]);
        assert_eq!(jacobian, [0.0, 1.0, -3.0, -2.0, 4.0, 0.0]);
        map.hessian(&[2.0, 3.0], &[10.0, 7.0, 0.5], &mut hessian).unwrap();
        assert_eq!(hessian, [1.0, -7.0, -7.0, 0.0]);
    }

    #[test]
    fn without_a_reset_it_is_linear() {
        let mut map = Relabeled::new(None, vec![(0, 1.0), (2, 1.0), (1, 1.0)]);
        let (mut values, mut jacobian, mut hessian) = ([0.0; 3], [0.0; 9], [1.0; 9]);
        map.jacobian(&[1.0, 2.0, 3.0], &mut values, &mut jacobian).unwrap();
        assert_eq!(values, [1.0, 3.0, 2.0]);
        assert_eq!(jacobian, [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        map.hessian(&[1.0; 3], &[1.0; 3], &mut hessian).unwrap();
        assert_eq!(hessian, [0.0; 9]);
    }
}
