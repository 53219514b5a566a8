//! Transition from a phase to the next, or from the last one back to the first.

use super::problem::Limit;
use airloop_optim::EvaluationError;

/// A map from the states at the end of a phase to those at the start of the next, such as an impact.
///
/// `x+ = R(x-)` and outputs `r(x-)`, e.g. impulses; twice continuously differentiable.
pub trait Reset: Send {
    /// States before, states after, outputs.
    fn size(&self) -> ResetSize;

    /// Names of the outputs, `[outputs]`.
    fn output_names(&self) -> Vec<String>;

    /// States after, then outputs, `[after + outputs]`.
    ///
    /// # Errors
    /// Fails where the map has no value; so in the functions below.
    fn evaluate(&mut self, before: &[f64], values: &mut [f64]) -> Result<(), EvaluationError>;

    /// Values, and their derivatives by the states before, row-major `[after + outputs, before]`.
    ///
    /// # Errors
    /// See [`Reset::evaluate`].
    fn jacobian(
        &mut self,
        before: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError>;

    /// Second derivatives of `weights . values`, symmetric, all entries, row-major `[before, before]`.
    ///
    /// # Errors
    /// See [`Reset::evaluate`].
    fn hessian(
        &mut self,
        before: &[f64],
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError>;
}

impl<R: Reset + ?Sized> Reset for &mut R {
    fn size(&self) -> ResetSize {
        (**self).size()
    }

    fn output_names(&self) -> Vec<String> {
        (**self).output_names()
    }

    fn evaluate(&mut self, before: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        (**self).evaluate(before, values)
    }

    fn jacobian(
        &mut self,
        before: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        (**self).jacobian(before, values, jacobian)
    }

    fn hessian(
        &mut self,
        before: &[f64],
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        (**self).hessian(before, weights, hessian)
    }
}

/// Numbers of values of a [`Reset`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResetSize {
    /// States of the phase before.
    pub before: usize,
    /// States of the phase after.
    pub after: usize,
    /// Outputs.
    pub outputs: usize,
}

/// Continuation of the states.
pub enum StateLink {
    /// All states are continuous; both phases have the same number of them.
    Continuous,
    /// These pairs (state before, state after) are continuous, other states are free.
    Pairs(Vec<(usize, usize)>),
    /// A reset map, with limits on its outputs; a limit refers to them as [`super::Variable::Output`].
    Reset(Box<dyn Reset>, Vec<Limit>),
}

/// Link of a phase to the next, or of the last phase back to the first.
pub struct Link {
    /// States.
    pub states: StateLink,
    /// Pairs (input before, input after) that are continuous; other inputs are free to jump.
    pub inputs: Vec<(usize, usize)>,
    /// States after a reset map that are free all the same, such as the way made in a periodic motion.
    pub free: Vec<usize>,
}

impl Link {
    /// Continuous states, inputs free to jump.
    pub fn continuous() -> Link {
        Link { states: StateLink::Continuous, inputs: Vec::new(), free: Vec::new() }
    }

    /// A reset map, inputs free to jump.
    pub fn reset(reset: Box<dyn Reset>, limits: Vec<Limit>) -> Link {
        Link { states: StateLink::Reset(reset, limits), inputs: Vec::new(), free: Vec::new() }
    }
}
