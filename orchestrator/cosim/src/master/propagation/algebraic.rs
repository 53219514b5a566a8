//! Algebraic loops: inputs and outputs that depend on each other at the same instant.
//!
//! Unknown are the inputs in the loop; each residual is the value of its source minus the input. Damped Newton
//! iteration with directional derivatives, or finite differences where an FMU has none.

use airloop_fmi::{Error as FmuError, Instance};
use std::ops::DerefMut;

use crate::master::Error;
use crate::system::graph::Conversion;

/// An input of the loop.
#[derive(Debug, Clone)]
pub struct LoopInput {
    /// Index of the instance.
    pub instance: usize,
    pub reference: u32,
    /// Index into [`AlgebraicLoop::outputs`].
    pub source: usize,
    pub conversion: Conversion,
    /// Typical magnitude.
    pub nominal: f64,
    /// `component.variable`
    pub name: String,
}

/// An output of the loop.
#[derive(Debug, Clone)]
pub struct LoopOutput {
    /// Index of the instance.
    pub instance: usize,
    pub reference: u32,
    /// Place in the values of the system.
    pub place: usize,
}

/// Reason why no solution of a loop was found.
#[derive(Debug)]
pub enum LoopFailure {
    /// A call into an FMU failed.
    Fmu(FmuError),
    /// (input, residual) of each input, and what happened.
    Unsolved { residuals: Vec<(String, f64)>, iterations: usize, problem: &'static str },
}

impl From<FmuError> for LoopFailure {
    fn from(error: FmuError) -> LoopFailure {
        LoopFailure::Fmu(error)
    }
}

impl LoopFailure {
    /// No solution was found; `residuals` are those of the inputs.
    #[cold]
    pub fn unsolved(
        inputs: &[LoopInput],
        residuals: &[f64],
        iterations: usize,
        problem: &'static str,
    ) -> LoopFailure {
        let names = inputs.iter().map(|input| input.name.clone());
        let residuals = names.zip(residuals.iter().copied()).collect();
        LoopFailure::Unsolved { residuals, iterations, problem }
    }

    /// As an error at `time` \[s\].
    pub fn at(self, time: f64) -> Error {
        match self {
            LoopFailure::Fmu(error) => Error::Fmu(error),
            LoopFailure::Unsolved { residuals, iterations, problem } => {
                let text = |(name, residual): &(String, f64)| format!("{name}: {residual:e}");
                let residuals = residuals.iter().map(text).collect::<Vec<_>>().join(", ");
                Error::AlgebraicLoop { time, iterations, problem, residuals }
            }
        }
    }
}

/// Residual that counts as zero, in units of max(|value|, nominal).
const TOLERANCE: f64 = 1e-13;
/// Residual that is taken where rounding in the FMUs keeps it from falling further.
const STAGNATION: f64 = 1e-9;
const MOST_ITERATIONS: usize = 50;
const MOST_HALVINGS: usize = 12;

/// A loop with its memory.
#[derive(Debug)]
pub struct AlgebraicLoop {
    inputs: Vec<LoopInput>,
    outputs: Vec<LoopOutput>,
    /// Whether `unknowns` hold a guess.
    started: bool,
    /// Unknowns and their residuals, `[n]`.
    unknowns: Vec<f64>,
    residuals: Vec<f64>,
    values: Vec<f64>,
    /// `[n, n]`, rows first.
    jacobian: Vec<f64>,
    change: Vec<f64>,
    /// Unknowns before a Newton step, and those that are tried.
    base: Vec<f64>,
    trial: Vec<f64>,
    /// Newton steps so far.
    rounds: u64,
}

/// Shows a truth value as a number.
pub(in crate::master) fn carry_flag(flag: &mut bool, each: &mut dyn FnMut(&mut f64)) {
    let mut number = f64::from(u8::from(*flag));
    each(&mut number);
    *flag = number != 0.0;
}

impl AlgebraicLoop {
    pub fn new(inputs: Vec<LoopInput>, outputs: Vec<LoopOutput>) -> AlgebraicLoop {
        let n = inputs.len();
        AlgebraicLoop {
            started: false,
            unknowns: vec![0.0; n],
            residuals: vec![0.0; n],
            values: vec![0.0; outputs.len()],
            jacobian: vec![0.0; n * n],
            change: vec![0.0; n],
            base: vec![0.0; n],
            trial: vec![0.0; n],
            rounds: 0,
            inputs,
            outputs,
        }
    }

    /// Loops that are solved, and derivatives that are approximated, one sentence each.
    pub fn notes<I: DerefMut<Target = Instance>>(&self, instances: &[I]) -> Vec<String> {
        let names: Vec<&str> = self.inputs.iter().map(|input| input.name.as_str()).collect();
        let mut notes = vec![format!("an algebraic loop is solved for {}", names.join(", "))];
        let mut members: Vec<usize> = self.inputs.iter().map(|input| input.instance).collect();
        members.sort_unstable();
        members.dedup();
        for instance in members.into_iter().map(|member| &instances[member]) {
            if !has_derivatives(instance) {
                let name = instance.name();
                notes.push(format!(
                    "component `{name}` has no directional derivatives: its part of the loop is differentiated by finite differences"
                ));
            }
        }
        notes
    }

    /// Solves the loop, the first time from the present values of the system, and writes its outputs back there.
    pub fn solve<I: DerefMut<Target = Instance>>(
        &mut self,
        instances: &mut [I],
        reals: &mut [f64],
    ) -> Result<(), LoopFailure> {
        // The solution before is the best guess, and stays bit by bit where nothing changed.
        if !self.started {
            self.started = true;
            for (unknown, input) in self.unknowns.iter_mut().zip(&self.inputs) {
                *unknown = input.conversion.apply(reals[self.outputs[input.source].place]);
            }
        }
        self.trial.copy_from_slice(&self.unknowns);
        let mut size = self.evaluate(instances)?;
        for iteration in 0..MOST_ITERATIONS {
            if size <= TOLERANCE {
                return self.finish(reals);
            }
            if !size.is_finite() {
                return Err(self.unsolved(iteration, "a value in the loop is not finite"));
            }
            self.differentiate(instances)?;
            self.change.copy_from_slice(&self.residuals);
            if !solve_linear(&mut self.jacobian, &mut self.change) {
                return Err(self.unsolved(iteration, "its Jacobian is singular"));
            }
            self.rounds += 1;
            self.base.copy_from_slice(&self.unknowns);
            let mut length = 1.0;
            let mut better = false;
            for _ in 0..MOST_HALVINGS {
                for ((trial, base), change) in self.trial.iter_mut().zip(&self.base).zip(&self.change) {
                    *trial = base - length * change;
                }
                let new = self.evaluate(instances)?;
                if new < size {
                    size = new;
                    better = true;
                    break;
                }
                length *= 0.5;
            }
            if !better {
                self.trial.copy_from_slice(&self.base);
                size = self.evaluate(instances)?;
                if size <= STAGNATION {
                    return self.finish(reals);
                }
                return Err(
                    self.unsolved(iteration + 1, "no step along the Newton direction makes them smaller")
                );
            }
        }
        match size <= STAGNATION {
            true => self.finish(reals),
            false => Err(self.unsolved(MOST_ITERATIONS, "the iteration does not converge")),
        }
    }

    /// Newton steps so far.
    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Forgets the last solution: the next one begins from the present values of the system.
    pub fn forget(&mut self) {
        self.started = false;
    }

    /// Shows what the next solution begins from, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        carry_flag(&mut self.started, each);
        self.unknowns.iter_mut().for_each(each);
    }

    /// Reads the outputs without solving anything.
    pub fn read<I: DerefMut<Target = Instance>>(
        &mut self,
        instances: &mut [I],
        reals: &mut [f64],
    ) -> Result<(), FmuError> {
        for output in &self.outputs {
            instances[output.instance]
                .get_real(&[output.reference], std::slice::from_mut(&mut reals[output.place]))?;
        }
        Ok(())
    }

    fn finish(&self, reals: &mut [f64]) -> Result<(), LoopFailure> {
        self.outputs.iter().zip(&self.values).for_each(|(output, value)| reals[output.place] = *value);
        Ok(())
    }

    fn unsolved(&self, iterations: usize, problem: &'static str) -> LoopFailure {
        LoopFailure::unsolved(&self.inputs, &self.residuals, iterations, problem)
    }

    /// Sets the inputs to `trial`, reads the outputs; the largest residual in units of its magnitude.
    fn evaluate<I: DerefMut<Target = Instance>>(&mut self, instances: &mut [I]) -> Result<f64, FmuError> {
        self.unknowns.copy_from_slice(&self.trial);
        for (input, value) in self.inputs.iter().zip(&self.unknowns) {
            instances[input.instance].set_real(&[input.reference], &[*value])?;
        }
        for (output, value) in self.outputs.iter().zip(&mut self.values) {
            instances[output.instance].get_real(&[output.reference], std::slice::from_mut(value))?;
        }
        let outputs = &self.values;
        let given = |input: &LoopInput| input.conversion.apply(outputs[input.source]);
        Ok(residuals(&self.inputs, &self.unknowns, given, &mut self.residuals))
    }

    /// Derivatives of the residuals by the unknowns.
    fn differentiate<I: DerefMut<Target = Instance>>(&mut self, instances: &mut [I]) -> Result<(), FmuError> {
        let n = self.inputs.len();
        for column in 0..n {
            let input = &self.inputs[column];
            let instance = &mut instances[input.instance];
            let exact = has_derivatives(instance);
            let own = |row: usize| self.outputs[self.inputs[row].source].instance == input.instance;
            let unknown = self.unknowns[column];
            let shift = f64::EPSILON.sqrt() * unknown.abs().max(input.nominal);
            if !exact {
                instance.set_real(&[input.reference], &[unknown + shift])?;
            }
            for row in 0..n {
                let mut derivative = 0.0;
                if own(row) {
                    let output = &self.outputs[self.inputs[row].source];
                    let mut value = [0.0];
                    if exact {
                        instance.directional_derivative(
                            &[output.reference],
                            &[input.reference],
                            &[1.0],
                            &mut value,
                        )?;
                        derivative = value[0];
                    } else {
                        instance.get_real(&[output.reference], &mut value)?;
                        let moved = (unknown + shift) - unknown;
                        derivative = (value[0] - self.values[self.inputs[row].source]) / moved;
                    }
                    derivative *= self.inputs[row].conversion.factor;
                }
                self.jacobian[row * n + column] = derivative - if row == column { 1.0 } else { 0.0 };
            }
            if !exact {
                instance.set_real(&[input.reference], &[unknown])?;
            }
        }
        Ok(())
    }
}

/// Residuals: the source of each input minus the input; the largest in units of max(|value|, nominal), NaN if one is.
pub fn residuals(
    inputs: &[LoopInput],
    unknowns: &[f64],
    given: impl Fn(&LoopInput) -> f64,
    residuals: &mut [f64],
) -> f64 {
    let mut size = 0.0f64;
    for ((input, unknown), residual) in inputs.iter().zip(unknowns).zip(residuals) {
        *residual = given(input) - unknown;
        let scaled = residual.abs() / unknown.abs().max(input.nominal);
        size = if scaled.is_nan() || size.is_nan() { f64::NAN } else { size.max(scaled) };
    }
    size
}

fn has_derivatives(instance: &Instance) -> bool {
    let declared = instance.fmu().interface(instance.kind());
    declared.is_some_and(|interface| interface.provides_directional_derivative)
}

/// Solves `a x = b` in place, `a` of shape `[n, n]` by rows, with row exchanges; false if `a` is singular.
pub fn solve_linear(a: &mut [f64], b: &mut [f64]) -> bool {
    let n = b.len();
    for k in 0..n {
        let size = |row: &usize| a[row * n + k].abs();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j))).expect("the range holds k");
        let largest = size(&pivot);
        if largest.is_nan() || largest <= f64::MIN_POSITIVE {
            return false;
        }
        (k * n..k * n + n).zip(pivot * n..pivot * n + n).for_each(|(i, j)| a.swap(i, j));
        b.swap(k, pivot);
        for row in k + 1..n {
            let factor = a[row * n + k] / a[k * n + k];
            (k..n).for_each(|column| a[row * n + column] -= factor * a[k * n + column]);
            b[row] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|column| a[k * n + column] * b[column]).sum();
        b[k] = (b[k] - known) / a[k * n + k];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_systems_are_solved_with_row_exchanges() {
        let mut a = [0.0, 2.0, 1.0, 1.0, 0.0, -1.0, 3.0, 1.0, 2.0];
        let mut b = [7.0, -2.0, 11.0]; // x = 1, 2, 3
        assert!(solve_linear(&mut a, &mut b));
        for (value, expected) in b.iter().zip([1.0, 2.0, 3.0]) {
            assert!((value - expected).abs() < 1e-14, "{b:?}");
        }
        assert!(!solve_linear(&mut [1.0, 2.0, 2.0, 4.0], &mut [1.0, 2.0]));
    }
}
