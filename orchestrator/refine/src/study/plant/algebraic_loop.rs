//! Algebraic loops of a system with blocks inside: components whose outputs follow inputs that follow these outputs.
//!
//! Unknown are the values that lead back to an earlier component. Newton's method with difference quotients; the
//! factors of the Jacobian serve until the residual stops falling fast, so that a linear loop costs two passes.

use std::collections::BTreeMap;
use std::ops::Range;

use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::Source;
use airloop_cosim::system::order::loop_groups;
use nalgebra::{DMatrix, DVector, Dyn, LU};

use super::Part;
use super::instance::is_stepped;

/// Residual that counts as zero, relative to the largest value so far.
const TOLERANCE: f64 = 1e-12;
/// The same where rounding in the FMUs keeps it from falling further.
const STAGNATION: f64 = 1e-8;
/// Values below it have the tolerance of this one.
const LEAST_SIZE: f64 = 1e-6;
/// Difference steps are relative to the value, or to this one where it is smaller.
const LEAST_SHIFTED: f64 = 1e-3;
const MAX_ITERATIONS: usize = 30;
/// Ratio of a residual to the one before above which the Jacobian is made anew.
const MAX_RATIO_OF_RESIDUALS: f64 = 0.1;

/// The algebraic loops, with the outputs that lead back to an earlier component.
pub(super) fn all(
    graph: &SystemGraph,
    order: &[usize],
    slots: &BTreeMap<(usize, usize), usize>,
    parts: &[Part],
) -> Vec<AlgebraicLoop> {
    let mut found: Vec<AlgebraicLoop> = Vec::new();
    for group in loop_groups(graph) {
        let first = order.iter().position(|index| group.contains(index)).unwrap_or(0);
        let equations = group.iter().filter(|&&index| !is_stepped(&graph.components[index])).count();
        let members = first..first + equations;
        let mut unknown: Vec<usize> = Vec::new();
        for connection in &graph.connections {
            let Source::Output { component, variable } = connection.source else { continue };
            let place = |component: usize| order.iter().position(|&index| index == component);
            let (Some(from), Some(to)) = (place(component), place(connection.component)) else { continue };
            let back = members.contains(&from) && members.contains(&to) && from >= to;
            let slot = slots.get(&(component, variable)).filter(|slot| parts[from].late.1.contains(slot));
            unknown.extend(slot.filter(|_| back));
        }
        unknown.sort_unstable();
        unknown.dedup();
        if !unknown.is_empty() {
            found.push(AlgebraicLoop::new(members, unknown));
        }
    }
    found.sort_by_key(|own| own.parts.start);
    found
}

/// An algebraic loop, or several that share components.
#[derive(Debug)]
pub(super) struct AlgebraicLoop {
    /// Its components, in evaluation order.
    pub parts: Range<usize>,
    /// Slots of the values that lead back.
    pub unknown: Vec<usize>,
    factors: Option<LU<f64, Dyn, Dyn>>,
    /// Largest size that each value has had.
    largest: Vec<f64>,
    /// Values, residual, and the residual at a shifted value.
    work: [DVector<f64>; 3],
}

impl AlgebraicLoop {
    pub fn new(parts: Range<usize>, unknown: Vec<usize>) -> AlgebraicLoop {
        let work = std::array::from_fn(|_| DVector::zeros(unknown.len()));
        let largest = vec![LEAST_SIZE; unknown.len()];
        AlgebraicLoop { parts, unknown, factors: None, largest, work }
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
        // What the loop makes of values, less these.
        let mut pass = |from: &DVector<f64>, slots: &mut [f64], residual: &mut DVector<f64>| {
            unknown.iter().zip(from.iter()).for_each(|(&slot, value)| slots[slot] = *value);
            for part in members.iter_mut() {
                part.feed(slots, block)?;
                part.follow(slots)?;
            }
            let made = unknown.iter().map(|&slot| slots[slot]);
            residual.iter_mut().zip(made).zip(from).for_each(|((own, made), from)| *own = made - from);
            Ok::<(), airloop_fmi::Error>(())
        };
        let [values, residual, moved] = &mut self.work;
        let begin = unknown.iter().map(|&slot| slots[slot]);
        values
            .iter_mut()
            .zip(begin)
            .for_each(|(own, value)| *own = if value.is_finite() { value } else { 0.0 });
        let (mut before, mut smallest) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..MAX_ITERATIONS {
            pass(values, slots, residual)?;
            self.largest.iter_mut().zip(values.iter()).for_each(|(own, value)| *own = own.max(value.abs()));
            let relative = residual.iter().zip(self.largest.iter()).map(|(r, size)| r.abs() / size);
            let size = relative.fold(0.0, |a: f64, b| if b.is_nan() { f64::NAN } else { a.max(b) });
            if size <= TOLERANCE || size <= STAGNATION && size >= smallest {
                return Ok(());
            }
            smallest = smallest.min(size);
            if self.factors.is_none() || size > MAX_RATIO_OF_RESIDUALS * before {
                let n = unknown.len();
                let mut jacobian = DMatrix::zeros(n, n);
                for column in 0..n {
                    let value = values[column];
                    let shift = f64::EPSILON.sqrt() * value.abs().max(LEAST_SHIFTED);
                    values[column] += shift;
                    pass(values, slots, moved)?;
                    values[column] = value;
                    jacobian.set_column(column, &((&*moved - &*residual) / shift));
                }
                self.factors = Some(jacobian.lu());
            }
            let solved = self.factors.as_ref().is_some_and(|factors| factors.solve_mut(residual));
            if !solved || residual.iter().any(|value| !value.is_finite()) {
                break;
            }
            before = size;
            *values -= &*residual;
        }
        self.factors = None;
        unknown.iter().for_each(|&slot| slots[slot] = f64::NAN);
        Ok(())
    }
}
