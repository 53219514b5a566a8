//! A reset map whose values are outputs of dynamics at the states before, such as the velocities after an impact.

use super::dynamics::{Dynamics, Point};
use super::link::{Reset, ResetSize};
use airloop_optim::EvaluationError;

/// Value of a state after the reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum After {
    /// The state before with this index.
    State(usize),
    /// An output of the dynamics.
    Output(usize),
}

/// `x+ = R(x-)` read from dynamics at the states before, with inputs that are held.
pub struct OutputReset {
    dynamics: Box<dyn Dynamics>,
    after: Vec<After>,
    outputs: Vec<usize>,
    inputs: Vec<f64>,
    values: Vec<f64>,
    jacobian: Vec<f64>,
    weights: Vec<f64>,
    hessian: Vec<f64>,
}

impl OutputReset {
    /// `after` says where each state after comes from, `outputs` which outputs of the dynamics the reset shows; the
    /// inputs of the dynamics are held at `inputs` `[n_u]`.
    ///
    /// # Panics
    /// When an index or the number of inputs does not fit the dynamics.
    pub fn new(
        dynamics: Box<dyn Dynamics>,
        after: Vec<After>,
        outputs: Vec<usize>,
        inputs: Vec<f64>,
    ) -> OutputReset {
        let size = dynamics.size();
        let fits = |after: &After| match after {
            After::State(i) => *i < size.states,
            After::Output(i) => *i < size.outputs,
        };
        assert!(
            after.iter().all(fits) && outputs.iter().all(|i| *i < size.outputs),
            "indices of the dynamics"
        );
        assert_eq!(inputs.len(), size.inputs, "one value per input");
        OutputReset {
            values: vec![0.0; size.values()],
            jacobian: vec![0.0; size.values() * size.arguments()],
            weights: vec![0.0; size.values()],
            hessian: vec![0.0; size.arguments() * size.arguments()],
            dynamics,
            after,
            outputs,
            inputs,
        }
    }

    /// Source of value `i` of the reset.
    fn origin(&self, i: usize) -> After {
        match i.checked_sub(self.after.len()) {
            None => self.after[i],
            Some(output) => After::Output(self.outputs[output]),
        }
    }

    fn write(&self, before: &[f64], values: &mut [f64]) {
        let first = self.dynamics.size().states;
        for (i, value) in values.iter_mut().enumerate() {
            *value = match self.origin(i) {
                After::State(state) => before[state],
                After::Output(output) => self.values[first + output],
            };
        }
    }
}

impl Reset for OutputReset {
    fn size(&self) -> ResetSize {
        let before = self.dynamics.size().states;
        ResetSize { before, after: self.after.len(), outputs: self.outputs.len() }
    }

    fn output_names(&self) -> Vec<String> {
        let names = self.dynamics.names();
        let first = self.dynamics.size().arguments();
        self.outputs.iter().map(|output| names[first + output].clone()).collect()
    }

    fn evaluate(&mut self, before: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let at = Point { time: 0.0, states: before, inputs: &self.inputs };
        self.dynamics.evaluate(at, &mut self.values)?;
        self.write(before, values);
        Ok(())
    }

    fn jacobian(
        &mut self,
        before: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let at = Point { time: 0.0, states: before, inputs: &self.inputs };
        self.dynamics.jacobian(at, &mut self.values, &mut self.jacobian)?;
        self.write(before, values);
        let (size, width) = (self.dynamics.size(), before.len());
        for (i, row) in jacobian.chunks_mut(width).enumerate() {
            match self.origin(i) {
                After::State(state) => {
                    row.fill(0.0);
                    row[state] = 1.0;
                }
                After::Output(output) => {
                    let first = (size.states + output) * size.arguments();
                    row.copy_from_slice(&self.jacobian[first..first + width]);
                }
            }
        }
        Ok(())
    }

    fn hessian(
        &mut self,
        before: &[f64],
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let size = self.dynamics.size();
        self.weights.fill(0.0);
        for (i, weight) in weights.iter().enumerate() {
            if let After::Output(output) = self.origin(i) {
                self.weights[size.states + output] += weight;
            }
        }
        let at = Point { time: 0.0, states: before, inputs: &self.inputs };
        self.dynamics.hessian(at, &self.weights, &mut self.hessian)?;
        let width = before.len();
        for (row, all) in hessian.chunks_mut(width).zip(self.hessian.chunks(size.arguments())) {
            row.copy_from_slice(&all[..width]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_dynamics::{Size, Structure};

    /// Two states, outputs g1 = x y, g2 = x^2 u; the rates do not matter.
    struct Products(Structure);

    const SIZE: Size = Size { states: 2, inputs: 1, outputs: 2 };

    impl Dynamics for Products {
        fn size(&self) -> Size {
            SIZE
        }
        fn structure(&self) -> &Structure {
            &self.0
        }
        fn names(&self) -> Vec<String> {
            ["x", "y", "u", "g1", "g2"].map(str::to_owned).to_vec()
        }
        fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
            let (x, y, u) = (at.states[0], at.states[1], at.inputs[0]);
            values.copy_from_slice(&[0.0, 0.0, x * y, x * x * u]);
            Ok(())
        }
        fn jacobian(
            &mut self,
            at: Point<'_>,
            values: &mut [f64],
            jacobian: &mut [f64],
        ) -> Result<(), EvaluationError> {
            self.evaluate(at, values)?;
            let (x, y, u) = (at.states[0], at.states[1], at.inputs[0]);
            jacobian[..6].fill(0.0);
            jacobian[6..].copy_from_slice(&[y, x, 0.0, 2.0 * x * u, 0.0, x * x]);
            Ok(())
        }
        fn hessian(
            &mut self,
            at: Point<'_>,
            weights: &[f64],
            hessian: &mut [f64],
        ) -> Result<(), EvaluationError> {
            let (x, u) = (at.states[0], at.inputs[0]);
            let (a, b) = (weights[2], weights[3]);
            hessian.copy_from_slice(&[2.0 * u * b, a, 2.0 * x * b, a, 0.0, 0.0, 2.0 * x * b, 0.0, 0.0]);
            Ok(())
        }
        fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
            Ok(Box::new(Products(self.0.clone())))
        }
    }

    #[test]
    fn states_are_kept_exchanged_or_read_from_outputs() {
        // After: (y, g1); shown: g2; at x = 2, y = 3 with u held at 5.
        let dynamics = Box::new(Products(Structure::dense(SIZE)));
        let mut reset =
            OutputReset::new(dynamics, vec![After::State(1), After::Output(0)], vec![1], vec![5.0]);
        assert_eq!(reset.size(), ResetSize { before: 2, after: 2, outputs: 1 });
        assert_eq!(reset.output_names(), ["g2"]);
        let (mut values, mut jacobian, mut hessian) = ([0.0; 3], [0.0; 6], [0.0; 4]);
        reset.jacobian(&[2.0, 3.0], &mut values, &mut jacobian).unwrap();
        assert_eq!(values, [3.0, 6.0, 20.0]);
        assert_eq!(jacobian, [0.0, 1.0, 3.0, 2.0, 20.0, 0.0]);
        // Weights of y, g1, g2: 7 (x y)'' + 0.5 (5 x^2)''.
        reset.hessian(&[2.0, 3.0], &[100.0, 7.0, 0.5], &mut hessian).unwrap();
        assert_eq!(hessian, [5.0, 7.0, 7.0, 0.0]);
    }
}
