//! A formula of a few variables of a program, with its derivatives.

use airloop_expression::{Expression, Function};

use crate::jet::Jet;

/// Largest number of variables in one formula.
pub const MAX_VARIABLES: usize = 16;

/// A term of the objective, or a constraint.
#[derive(Clone, Debug)]
pub struct Element {
    formula: Expression,
    /// Variables of the program, from 0, in the order in which the formula knows them.
    pub own: Vec<usize>,
    /// Derivatives by these where they were asked for last: gradient, and lower triangle of the Hessian row by row.
    pub gradient: Vec<f64>,
    pub hessian: Vec<f64>,
}

impl Element {
    pub fn new(formula: Expression, own: Vec<usize>) -> Self {
        let count = own.len();
        assert!(count <= MAX_VARIABLES, "a formula has {count} variables; give its terms lines of their own");
        Self { formula, own, gradient: vec![0.0; count], hessian: vec![0.0; count * (count + 1) / 2] }
    }

    pub fn value(&self, x: &[f64]) -> f64 {
        let mut own = [0.0; MAX_VARIABLES];
        own.iter_mut().zip(&self.own).for_each(|(value, &at)| *value = x[at]);
        self.formula.evaluate(&own[..self.own.len()], &Function::of)
    }

    pub fn differentiate(&mut self, x: &[f64]) {
        match self.own.len() {
            0..=2 => self.differentiate_with::<2>(x),
            3..=4 => self.differentiate_with::<4>(x),
            5..=8 => self.differentiate_with::<8>(x),
            _ => self.differentiate_with::<MAX_VARIABLES>(x),
        }
    }

    fn differentiate_with<const N: usize>(&mut self, x: &[f64]) {
        let mut own = [Jet::<N>::from(0.0); N];
        own.iter_mut().zip(&self.own).enumerate().for_each(|(i, (jet, &at))| *jet = Jet::variable(x[at], i));
        let count = self.own.len();
        let jet = self.formula.evaluate(&own[..count], &Jet::<N>::call);
        self.gradient.copy_from_slice(&jet.gradient[..count]);
        let triangle = jet.hessian.iter().take(count).enumerate().flat_map(|(i, row)| &row[..=i]);
        self.hessian.iter_mut().zip(triangle).for_each(|(own, value)| *own = *value);
    }

    /// Entries of the Hessian as (row, column) of the program.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        self.own
            .iter()
            .enumerate()
            .flat_map(|(i, &row)| self.own[..=i].iter().map(move |&column| (row, column)))
    }
}
