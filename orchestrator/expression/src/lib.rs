//! Formulas as text: parsed, checked by units, evaluated with any number type.
//!
//! [`Expression::parse`] reads a formula over a list of names, [`Expression::dimension`] derives its unit from theirs,
//! [`Expression::evaluate`] computes it without allocation. A dual number as type gives exact derivatives.

mod curve;
mod dimension;
mod evaluate;
mod parse;

pub use dimension::Dimension;
pub use evaluate::{Function, Number};

use curve::Curve;

/// A problem with a formula, and its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    /// Byte of the text, from 0.
    pub at: usize,
    /// Problem and remedy.
    pub problem: String,
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "column {}: {}", self.at + 1, self.problem)
    }
}

impl std::error::Error for Error {}

/// A formula over a list of names, which [`Expression::evaluate`] takes the values of in the same order.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    root: Node,
}

/// An operation and the place of its sign in the text.
#[derive(Debug, Clone, PartialEq)]
struct Node {
    at: usize,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Number(f64),
    Variable(usize),
    Negative(Box<Node>),
    Sum(Box<Node>, Box<Node>),
    Difference(Box<Node>, Box<Node>),
    Product(Box<Node>, Box<Node>),
    Quotient(Box<Node>, Box<Node>),
    /// Power with a number as exponent.
    Power(Box<Node>, f64),
    Call(Function, Box<Node>),
    Minimum(Box<Node>, Box<Node>),
    Maximum(Box<Node>, Box<Node>),
    Curve(Box<Node>, Curve),
}

impl Expression {
    /// Reads a formula; `names` are those that it may use.
    ///
    /// # Errors
    /// A name that is not there, a character or bracket out of place, a function with the wrong number of arguments.
    pub fn parse(text: &str, names: &[&str]) -> Result<Expression, Error> {
        parse::parse(text, names).map(|root| Expression { root })
    }

    /// Whether the formula uses the name of this index.
    pub fn uses(&self, variable: usize) -> bool {
        self.root.uses(variable)
    }

    /// Operations, numbers and names in the formula.
    pub fn size(&self) -> usize {
        self.root.size()
    }
}

impl Node {
    fn children(&self) -> Vec<&Node> {
        match &self.kind {
            Kind::Number(_) | Kind::Variable(_) => Vec::new(),
            Kind::Negative(a) | Kind::Power(a, _) | Kind::Call(_, a) => vec![a],
            Kind::Sum(a, b)
            | Kind::Difference(a, b)
            | Kind::Product(a, b)
            | Kind::Quotient(a, b)
            | Kind::Minimum(a, b)
            | Kind::Maximum(a, b) => vec![a, b],
            Kind::Curve(a, curve) => std::iter::once(&**a).chain(&curve.heights).collect(),
        }
    }

    fn uses(&self, variable: usize) -> bool {
        self.kind == Kind::Variable(variable) || self.children().iter().any(|node| node.uses(variable))
    }

    fn size(&self) -> usize {
        1 + self.children().iter().map(|node| node.size()).sum::<usize>()
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
