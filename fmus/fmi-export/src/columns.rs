//! Columns of the Jacobian that were computed before they were asked for.
//!
//! Importers ask for one column after the other at the same point, in the same order at every point. FMI 2.0 has one
//! direction per call; a pass of the equations with some directions costs little more than with one. So a pass takes
//! along the knowns that were asked for next the last time. Bits do not depend on it: every direction has its own
//! arithmetic.

use crate::dual::Dual;
use crate::model::{Model, Outcome};
use crate::values::{Real, Values};

/// Directions of a pass.
const LANES: usize = 4;

/// Derivatives along some knowns at the present point.
pub(crate) struct Columns {
    duals: Values<Dual<LANES>>,
    /// Knowns of the last pass at this point, by value reference; empty where there was none.
    knowns: Vec<u32>,
    /// Known that was asked for after each, by value reference, as it was the last time.
    next: Vec<Option<u32>>,
    /// Known that was asked for last at this point.
    last: Option<u32>,
}

impl Columns {
    /// Without a pass, for an instance with these values.
    pub fn new(values: &Values<f64>) -> Self {
        let (knowns, next) = (Vec::with_capacity(LANES), vec![None; values.real.len()]);
        Self { duals: values.convert(), knowns, next, last: None }
    }

    /// The point has changed.
    #[inline]
    pub fn forget(&mut self) {
        self.knowns.clear();
        self.last = None;
    }

    /// Derivatives of all variables along `known`, where a pass has them or is worth while: that of several directions.
    /// The equations at `values` need no preparation.
    pub fn along<M: Model>(
        &mut self,
        model: &M,
        values: &Values<f64>,
        known: u32,
    ) -> Result<Option<Column<'_>>, crate::Refusal> {
        if let Some(last) = self.last.replace(known) {
            self.next[last as usize] = Some(known);
        }
        if !self.knowns.contains(&known) {
            self.expect(known);
            if self.knowns.len() == 1 {
                self.knowns.clear();
                return Ok(None);
            }
            self.pass(model, values).inspect_err(|_| self.knowns.clear())?;
        }
        let lane = self.knowns.iter().position(|other| *other == known);
        Ok(lane.map(|lane| Column { duals: &self.duals, lane }))
    }

    /// `known` and those that were asked for after it.
    fn expect(&mut self, known: u32) {
        self.knowns.clear();
        let mut one = Some(known);
        while let Some(known) = one
            && self.knowns.len() < LANES
            && !self.knowns.contains(&known)
        {
            self.knowns.push(known);
            one = self.next[known as usize];
        }
    }

    fn pass<M: Model>(&mut self, model: &M, values: &Values<f64>) -> Outcome {
        self.duals.copy_from_f64(values);
        for (lane, known) in self.knowns.iter().enumerate() {
            self.duals[Real(*known)].eps[lane] = 1.0;
        }
        model.equations(&mut self.duals)
    }
}

/// Derivatives of all variables along one known.
pub(crate) struct Column<'a> {
    duals: &'a Values<Dual<LANES>>,
    lane: usize,
}

impl Column<'_> {
    /// Values of the equations at this point.
    pub fn values(&self) -> &Values<Dual<LANES>> {
        self.duals
    }

    /// Derivative of one variable.
    #[inline]
    pub fn of(&self, unknown: Real) -> f64 {
        self.duals[unknown].eps[self.lane]
    }
}
