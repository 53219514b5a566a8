//! The dynamics of a phase, as the transcriptions see it: rates and outputs with derivatives.

/// The functions cannot be evaluated at a point; the solver steps back and tries closer to the last good point.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot evaluate {function}: {reason}")]
pub struct EvaluationError {
    /// Name of the function, e.g. "defect of interval 3".
    pub function: String,
    /// Reason of the failure, in words.
    pub reason: String,
}

/// Numbers of values of a [`Dynamics`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// States n_x.
    pub states: usize,
    /// Inputs n_u.
    pub inputs: usize,
    /// Outputs n_g: whatever costs and constraints refer to that is neither state nor input.
    pub outputs: usize,
}

impl Size {
    /// Arguments of the functions, n_x + n_u: states, then inputs.
    pub fn arguments(self) -> usize {
        self.states + self.inputs
    }

    /// Values of the functions, n_x + n_g: rates of the states, then outputs.
    pub fn values(self) -> usize {
        self.states + self.outputs
    }
}

/// Point at which the functions are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    /// Time \[s\].
    pub time: f64,
    /// States, `[n_x]`.
    pub states: &'a [f64],
    /// Inputs, `[n_u]`.
    pub inputs: &'a [f64],
}

/// Known kind of an entry of the Jacobian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entry {
    /// Always zero.
    Zero,
    /// The same at every point.
    Constant,
    /// Anything else; only such entries have second derivatives.
    Varying,
}

/// Structure of the Jacobian, row-major `[n_x + n_g, n_x + n_u]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Structure {
    size: Size,
    entries: Vec<Entry>,
}

impl Structure {
    /// Of the given entries, row-major `[n_x + n_g, n_x + n_u]`.
    ///
    /// # Panics
    /// When the number of entries is another one.
    pub fn new(size: Size, entries: Vec<Entry>) -> Structure {
        assert_eq!(entries.len(), size.values() * size.arguments(), "one entry per value and argument");
        Structure { size, entries }
    }

    /// Nothing is known: every entry may vary.
    pub fn dense(size: Size) -> Structure {
        Structure::new(size, vec![Entry::Varying; size.values() * size.arguments()])
    }

    /// Known kind of the derivative of a value by an argument.
    pub fn entry(&self, value: usize, argument: usize) -> Entry {
        self.entries[value * self.size.arguments() + argument]
    }

    /// The largest set of states that form a linear system with constant coefficients driven by the inputs alone,
    /// among `candidates`: `dz/dt = A z + B u`.
    pub fn linear_states(&self, candidates: &[usize]) -> Vec<usize> {
        let (n_x, mut chosen) = (self.size.states, candidates.to_vec());
        loop {
            let before = chosen.len();
            let kept: Vec<usize> = chosen
                .iter()
                .copied()
                .filter(|&state| {
                    (0..self.size.arguments()).all(|argument| match self.entry(state, argument) {
                        Entry::Zero => true,
                        Entry::Constant => argument >= n_x || chosen.contains(&argument),
                        Entry::Varying => false,
                    })
                })
                .collect();
            chosen = kept;
            if chosen.len() == before {
                return chosen;
            }
        }
    }
}

/// `dx/dt = f(t, x, u)` and outputs `g(t, x, u)` with exact first derivatives.
///
/// f and g are twice continuously differentiable where the solver is to converge. Where a duration is free they must
/// not depend on the time itself. The functions take `&mut self`: an instance keeps its own memory and belongs to one
/// thread at a time; [`Dynamics::duplicate`] gives more of them.
pub trait Dynamics: Send {
    /// Numbers of states, inputs and outputs.
    fn size(&self) -> Size;

    /// Known structure of the Jacobian: which entries are zero, constant or varying.
    fn structure(&self) -> &Structure;

    /// Names of states, inputs and outputs, `[n_x + n_u + n_g]`, for messages and columns.
    fn names(&self) -> Vec<String>;

    /// Typical magnitudes of states, inputs and outputs, `[n_x + n_u + n_g]`, for scaling; 1 where nothing is known.
    fn nominals(&self) -> Vec<f64> {
        let size = self.size();
        vec![1.0; size.arguments() + size.outputs]
    }

    /// Rates, then outputs, `[n_x + n_g]`.
    ///
    /// # Errors
    /// Fails where the functions have no value; the reason names the component. So in the functions below.
    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError>;

    /// Values as in [`Dynamics::evaluate`], and their derivatives by states, then inputs, row-major
    /// `[n_x + n_g, n_x + n_u]`.
    ///
    /// # Errors
    /// See [`Dynamics::evaluate`].
    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError>;

    /// Second derivatives of `weights . values`, symmetric, all entries, row-major `[n_x + n_u, n_x + n_u]`; weights
    /// `[n_x + n_g]`.
    ///
    /// # Errors
    /// See [`Dynamics::evaluate`].
    fn hessian(&mut self, at: Point<'_>, weights: &[f64], hessian: &mut [f64])
    -> Result<(), EvaluationError>;

    /// Another instance of the same functions, for another thread.
    ///
    /// # Errors
    /// When no further instance can be made.
    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError>;
}

impl<D: Dynamics + ?Sized> Dynamics for &mut D {
    fn size(&self) -> Size {
        (**self).size()
    }

    fn structure(&self) -> &Structure {
        (**self).structure()
    }

    fn names(&self) -> Vec<String> {
        (**self).names()
    }

    fn nominals(&self) -> Vec<f64> {
        (**self).nominals()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        (**self).evaluate(at, values)
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        (**self).jacobian(at, values, jacobian)
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        (**self).hessian(at, weights, hessian)
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        (**self).duplicate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_states_that_depend_on_each_other_and_inputs_are_linear() {
        // x' = v (constant), v' = f(x) + z, z1' = a z1 + b z2 + c u, z2' = d z1.
        let size = Size { states: 4, inputs: 1, outputs: 0 };
        let (o, c, v) = (Entry::Zero, Entry::Constant, Entry::Varying);
        #[rustfmt::skip]
        let entries = vec![
            o, c, o, o, o,
            v, o, c, o, o,
            o, o, c, c, c,
            o, o, c, o, o,
        ];
        let structure = Structure::new(size, entries);
        assert_eq!(structure.linear_states(&[0, 1, 2, 3]), [2, 3]);
        assert!(structure.linear_states(&[3]).is_empty());
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
