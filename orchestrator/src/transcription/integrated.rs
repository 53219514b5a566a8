//! Inputs that are integrated: their rates become the inputs, so that they are continuous and their rates can cost.

use super::dynamics::{Dynamics, Entry, Point, Size, Structure};
use crate::optim::EvaluationError;

/// A system whose inputs are states: `x' = f(x, u)`, `(u / scale)' = r`; states `[x, u / scale]`, inputs `r`.
///
/// Values of the system behind: rates and outputs as they are. Without it the inputs of a phase are free at every node and
/// may jump at its ends.
pub struct Integrated {
    inner: Box<dyn Dynamics>,
    /// Of the system behind.
    size: Size,
    scales: Vec<f64>,
    structure: Structure,
    inputs: Vec<f64>,
    values: Vec<f64>,
    matrix: Vec<f64>,
    weights: Vec<f64>,
}

impl Integrated {
    /// Integrates all inputs of `inner`; each is its state times its scale, `[n_u]`.
    ///
    /// # Panics
    /// When the number of scales is not that of the inputs.
    pub fn new(inner: Box<dyn Dynamics>, scales: Vec<f64>) -> Integrated {
        let size = inner.size();
        assert_eq!(scales.len(), size.inputs, "one scale per input");
        let outer = Size { states: size.arguments(), ..size };
        let behind = inner.structure();
        let mut entries = vec![Entry::Zero; outer.values() * outer.arguments()];
        for value in 0..size.values() {
            let row = if value < size.states { value } else { value + size.inputs };
            for argument in 0..size.arguments() {
                entries[row * outer.arguments() + argument] = behind.entry(value, argument);
            }
        }
        for input in 0..size.inputs {
            entries[(size.states + input) * outer.arguments() + outer.states + input] = Entry::Constant;
        }
        Integrated {
            structure: Structure::new(outer, entries),
            inputs: vec![0.0; size.inputs],
            values: vec![0.0; size.values()],
            matrix: vec![0.0; size.arguments() * size.arguments().max(size.values())],
            weights: vec![0.0; size.values()],
            inner,
            size,
            scales,
        }
    }

    /// Inputs of the system behind, from the states.
    fn unscale(&mut self, states: &[f64]) {
        let scaled = states[self.size.states..].iter().zip(&self.scales);
        self.inputs.iter_mut().zip(scaled).for_each(|(input, (state, scale))| *input = state * scale);
    }

    /// Factor of an argument of the system behind: that of the state which it is here.
    fn factor(&self, argument: usize) -> f64 {
        argument.checked_sub(self.size.states).map_or(1.0, |input| self.scales[input])
    }

    fn write_values(&self, rates: &[f64], values: &mut [f64]) {
        let (n, m) = (self.size.states, self.size.inputs);
        values[..n].copy_from_slice(&self.values[..n]);
        values[n..n + m].copy_from_slice(rates);
        values[n + m..].copy_from_slice(&self.values[n..]);
    }
}

impl Dynamics for Integrated {
    fn size(&self) -> Size {
        Size { states: self.size.arguments(), ..self.size }
    }

    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn names(&self) -> Vec<String> {
        let names = self.inner.names();
        let (arguments, outputs) = names.split_at(self.size.arguments());
        let rates = arguments[self.size.states..].iter().map(|name| format!("rate of {name}"));
        arguments.iter().cloned().chain(rates).chain(outputs.iter().cloned()).collect()
    }

    fn nominals(&self) -> Vec<f64> {
        let nominals = self.inner.nominals();
        let (n, arguments) = (self.size.states, self.size.arguments());
        let states = (0..arguments).map(|a| nominals[a] / self.factor(a).abs());
        let rates = (n..arguments).map(|a| nominals[a] / self.factor(a).abs());
        states.chain(rates).chain(nominals[arguments..].iter().copied()).collect()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        self.unscale(at.states);
        let point = Point { states: &at.states[..self.size.states], inputs: &self.inputs, ..at };
        self.inner.evaluate(point, &mut self.values)?;
        self.write_values(at.inputs, values);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.unscale(at.states);
        let (n, m, own) = (self.size.states, self.size.inputs, self.size.arguments());
        let point = Point { states: &at.states[..n], inputs: &self.inputs, ..at };
        let matrix = &mut self.matrix[..self.size.values() * own];
        self.inner.jacobian(point, &mut self.values, matrix)?;
        self.write_values(at.inputs, values);
        let width = own + m;
        jacobian.fill(0.0);
        for value in 0..self.size.values() {
            let row = if value < n { value } else { value + m };
            for argument in 0..own {
                jacobian[row * width + argument] =
                    self.matrix[value * own + argument] * self.factor(argument);
            }
        }
        for input in 0..m {
            jacobian[(n + input) * width + own + input] = 1.0;
        }
        Ok(())
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.unscale(at.states);
        let (n, m, own) = (self.size.states, self.size.inputs, self.size.arguments());
        self.weights[..n].copy_from_slice(&weights[..n]);
        self.weights[n..].copy_from_slice(&weights[n + m..]);
        let point = Point { states: &at.states[..n], inputs: &self.inputs, ..at };
        self.inner.hessian(point, &self.weights, &mut self.matrix[..own * own])?;
        let width = own + m;
        hessian.fill(0.0);
        for i in 0..own {
            for j in 0..own {
                hessian[i * width + j] = self.matrix[i * own + j] * self.factor(i) * self.factor(j);
            }
        }
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Integrated::new(self.inner.duplicate()?, self.scales.clone())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x' = x u^2, g = x u, typed by hand.
    struct Small(Structure);

    const SIZE: Size = Size { states: 1, inputs: 1, outputs: 1 };

    impl Dynamics for Small {
        fn size(&self) -> Size {
            SIZE
        }
        fn structure(&self) -> &Structure {
            &self.0
        }
        fn names(&self) -> Vec<String> {
            ["x", "u", "g"].map(str::to_owned).to_vec()
        }
        fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
            let (x, u) = (at.states[0], at.inputs[0]);
            values.copy_from_slice(&[x * u * u, x * u]);
            Ok(())
        }
        fn jacobian(
            &mut self,
            at: Point<'_>,
            values: &mut [f64],
            jacobian: &mut [f64],
        ) -> Result<(), EvaluationError> {
            self.evaluate(at, values)?;
            let (x, u) = (at.states[0], at.inputs[0]);
            jacobian.copy_from_slice(&[u * u, 2.0 * x * u, u, x]);
            Ok(())
        }
        fn hessian(
            &mut self,
            at: Point<'_>,
            weights: &[f64],
            hessian: &mut [f64],
        ) -> Result<(), EvaluationError> {
            let (x, u) = (at.states[0], at.inputs[0]);
            let mixed = 2.0 * u * weights[0] + weights[1];
            hessian.copy_from_slice(&[0.0, mixed, mixed, 2.0 * x * weights[0]]);
            Ok(())
        }
        fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
            Ok(Box::new(Small(self.0.clone())))
        }
    }

    #[test]
    fn values_and_derivatives_are_those_of_the_system_with_scaled_inputs() {
        // States x = 3, s = 0.5 with u = 10 s, input r = 7: x' = 100 x s^2, s' = r, g = 10 x s.
        let mut system = Integrated::new(Box::new(Small(Structure::dense(SIZE))), vec![10.0]);
        assert_eq!(system.names(), ["x", "u", "rate of u", "g"]);
        let at = Point { time: 0.0, states: &[3.0, 0.5], inputs: &[7.0] };
        let (mut values, mut jacobian, mut hessian) = ([0.0; 3], [0.0; 9], [0.0; 9]);
        system.jacobian(at, &mut values, &mut jacobian).unwrap();
        assert_eq!(values, [75.0, 7.0, 15.0]);
        assert_eq!(jacobian, [25.0, 300.0, 0.0, 0.0, 0.0, 1.0, 5.0, 30.0, 0.0]);
        system.hessian(at, &[1.0, 4.0, 2.0], &mut hessian).unwrap();
        // d2/dx ds = 200 s + 2 * 10, d2/ds2 = 200 x.
        assert_eq!(hessian, [0.0, 120.0, 0.0, 120.0, 600.0, 0.0, 0.0, 0.0, 0.0]);
        let entry = |value, argument| system.structure().entry(value, argument);
        assert_eq!([entry(0, 2), entry(1, 2), entry(1, 0)], [Entry::Zero, Entry::Constant, Entry::Zero]);
    }
}
