//! Algebraic loops of a system with blocks inside: components whose outputs follow inputs that follow these outputs.
//!
//! Unknown are the values that lead back to an earlier component. Newton's method with difference quotients; the
//! factors of the Jacobian serve until the residual stops falling fast, so that a linear loop costs two passes.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Dyn, LU};

use super::Part;

/// Residual that counts as zero, relative to the value.
const TOLERANCE: f64 = 1e-12;
/// The same where rounding in the FMUs keeps it from falling further.
const STAGNATION: f64 = 1e-8;
/// Values below it have the tolerance of this one.
const LEAST_SIZE: f64 = 1e-6;
const MAX_ITERATIONS: usize = 30;
/// A residual that falls by less asks for a new Jacobian.
const FAST: f64 = 0.1;

/// An algebraic loop, or several that share components.
#[derive(Debug)]
pub(super) struct Ring {
    /// Its components, in evaluation order.
    pub parts: Range<usize>,
    /// Slots of the values that lead back.
    pub unknown: Vec<usize>,
    factors: Option<LU<f64, Dyn, Dyn>>,
}

impl Ring {
    pub fn new(parts: Range<usize>, unknown: Vec<usize>) -> Ring {
        Ring { parts, unknown, factors: None }
    }

    /// Solves the loop from the values that stand in the slots, and leaves the solution there: NaN where there is none.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn solve(
        &mut self,
        parts: &mut [Part],
        slots: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        let members = &mut parts[self.parts.clone()];
        let unknown = &self.unknown;
        let mut pass = |from: &DVector<f64>, slots: &mut [f64]| -> Result<DVector<f64>, airloop_fmi::Error> {
            unknown.iter().zip(from.iter()).for_each(|(&slot, value)| slots[slot] = *value);
            for part in members.iter_mut() {
                part.feed(slots, block)?;
                part.follow(slots)?;
            }
            Ok(DVector::from_iterator(unknown.len(), unknown.iter().map(|&slot| slots[slot])))
        };
        let mut values = DVector::from_iterator(unknown.len(), unknown.iter().map(|&slot| slots[slot]));
        values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
        let (mut before, mut smallest) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..MAX_ITERATIONS {
            let residual = pass(&values, slots)? - &values;
            let relative = residual.iter().zip(&values).map(|(r, v)| r.abs() / v.abs().max(LEAST_SIZE));
            let size = relative.fold(0.0, |a: f64, b| if b.is_nan() { f64::NAN } else { a.max(b) });
            if size <= TOLERANCE || size <= STAGNATION && size >= smallest {
                return Ok(());
            }
            smallest = smallest.min(size);
            if self.factors.is_none() || size > FAST * before {
                let n = unknown.len();
                let mut jacobian = DMatrix::zeros(n, n);
                for column in 0..n {
                    let mut moved = values.clone();
                    let shift = f64::EPSILON.sqrt() * values[column].abs().max(1e-3);
                    moved[column] += shift;
                    let change = (pass(&moved, slots)? - &moved) - &residual;
                    jacobian.set_column(column, &(change / shift));
                }
                self.factors = Some(jacobian.lu());
            }
            let step = self.factors.as_ref().and_then(|factors| factors.solve(&residual));
            let Some(step) = step.filter(|step| step.iter().all(|value| value.is_finite())) else { break };
            before = size;
            values -= step;
        }
        self.factors = None;
        unknown.iter().for_each(|&slot| slots[slot] = f64::NAN);
        Ok(())
    }
}
