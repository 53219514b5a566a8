//! Units of formulas as exponents of base units. An angle counts as a number, as in mechanics: N m and N m/rad mix.

use super::{Error, Expression, Function, Kind, Node};

/// Exponents of kg, m, s, A, K, mol, cd.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimension(pub [f64; 7]);

impl Dimension {
    /// A plain number.
    pub const NUMBER: Dimension = Dimension([0.0; 7]);

    /// Of kilogram, meter and second alone.
    pub fn new(kg: f64, m: f64, s: f64) -> Dimension {
        Dimension([kg, m, s, 0.0, 0.0, 0.0, 0.0])
    }

    /// Whether two are the same but for rounding.
    pub fn same(&self, other: &Dimension) -> bool {
        self.0.iter().zip(&other.0).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    fn combine(&self, other: &Dimension, sign: f64) -> Dimension {
        let mut found = *self;
        found.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += sign * b);
        found
    }

    fn power(&self, exponent: f64) -> Dimension {
        Dimension(self.0.map(|a| a * exponent))
    }
}

impl std::fmt::Display for Dimension {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = ["kg", "m", "s", "A", "K", "mol", "cd"];
        let mut separator = "";
        for (name, exponent) in names.iter().zip(self.0).filter(|(_, e)| e.abs() > 1e-9) {
            write!(f, "{separator}{name}")?;
            if (exponent - 1.0).abs() > 1e-9 {
                write!(f, "{}", (exponent * 1e6).round() / 1e6)?;
            }
            separator = ".";
        }
        if separator.is_empty() { f.write_str("1") } else { Ok(()) }
    }
}

impl Expression {
    /// Unit of the formula for the units of its names, in their order; none: any, as of a formula that is zero.
    ///
    /// A number other than zero has no unit: one with a unit is a parameter.
    ///
    /// # Errors
    /// A sum of different units, or a function of something that has a unit, with its place.
    pub fn dimension(&self, variables: &[Dimension]) -> Result<Option<Dimension>, Error> {
        self.root.dimension(variables)
    }
}

impl Node {
    fn dimension(&self, known: &[Dimension]) -> Result<Option<Dimension>, Error> {
        let number = Some(Dimension::NUMBER);
        let error = |problem: String| Err(Error { at: self.at, problem });
        Ok(match &self.kind {
            Kind::Number(value) => (*value != 0.0).then_some(Dimension::NUMBER),
            Kind::Variable(index) => Some(known[*index]),
            Kind::Negative(a) | Kind::Call(Function::Abs, a) => a.dimension(known)?,
            Kind::Sum(a, b) | Kind::Difference(a, b) | Kind::Minimum(a, b) | Kind::Maximum(a, b) => {
                match (a.dimension(known)?, b.dimension(known)?) {
                    (Some(a), Some(b)) if !a.same(&b) => {
                        return error(format!(
                            "{a} and {b} cannot be added or compared; a number with a unit must be a parameter"
                        ));
                    }
                    (a, b) => a.or(b),
                }
            }
            Kind::Product(a, b) => match (a.dimension(known)?, b.dimension(known)?) {
                (Some(a), Some(b)) => Some(a.combine(&b, 1.0)),
                _ => None,
            },
            Kind::Quotient(a, b) => match (a.dimension(known)?, b.dimension(known)?) {
                (Some(a), Some(b)) => Some(a.combine(&b, -1.0)),
                _ => None,
            },
            Kind::Power(a, exponent) => a.dimension(known)?.map(|a| a.power(*exponent)),
            Kind::Call(Function::Sqrt, a) => a.dimension(known)?.map(|a| a.power(0.5)),
            Kind::Call(Function::Sign, a) => a.dimension(known).map(|_| number)?,
            Kind::Call(function, a) => match a.dimension(known)? {
                Some(own) if !own.same(&Dimension::NUMBER) => {
                    let name = format!("{function:?}").to_lowercase();
                    return error(format!(
                        "{name} of {own}: it must be a plain number, divide by a parameter of this unit"
                    ));
                }
                _ => number,
            },
            Kind::Curve(a, curve) => {
                a.dimension(known)?;
                let mut found: Option<Dimension> = None;
                for height in &curve.heights {
                    // Heights that are numbers have the unit that their place asks for.
                    if matches!(height.kind, Kind::Number(_))
                        || matches!(&height.kind, Kind::Negative(a) if matches!(a.kind, Kind::Number(_)))
                    {
                        continue;
                    }
                    match (height.dimension(known)?, found) {
                        (Some(own), Some(before)) if !own.same(&before) => {
                            return error(format!("heights of a curve in {before} and {own}"));
                        }
                        (own, before) => found = before.or(own),
                    }
                }
                found
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: Dimension = Dimension([1.0, 1.0, -2.0, 0.0, 0.0, 0.0, 0.0]);

    fn unit(text: &str) -> Result<Option<Dimension>, Error> {
        let names = ["x", "v", "f", "t", "k"];
        let meter = Dimension::new(0.0, 1.0, 0.0);
        let known = [meter, Dimension::new(0.0, 1.0, -1.0), FORCE, Dimension::new(0.0, 0.0, 1.0)];
        let stiffness = Dimension::new(1.0, 0.0, -2.0);
        Expression::parse(text, &names)?.dimension(&[&known[..], &[stiffness]].concat())
    }

    #[test]
    fn units_follow_from_those_of_the_names() {
        for text in [
            "k*x",
            "k*x - f",
            "f*tanh(x/(v*t))",
            "max(0, k*x)",
            "sqrt(f^2)",
            "f*exp(-(x/(v*t))^2)",
            "k*v*t*sign(v)",
            "k*abs(x)^1.5/x^0.5",
        ] {
            let found = unit(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert!(found.is_some_and(|d| d.same(&FORCE)), "{text}: {found:?}");
        }
        assert_eq!(unit("0"), Ok(None));
        assert_eq!(unit("curve(x, -1, 3, 1, -3)"), Ok(None));
        assert!(unit("curve(x, -1, f, 1, -3)").is_ok_and(|d| d.is_some_and(|d| d.same(&FORCE))));
    }

    #[test]
    fn what_does_not_fit_is_told_with_its_place() {
        for (text, at, words) in [
            ("k*x + v", 4, "kg.m.s-2 and m.s-1"),
            ("x + 0.1", 2, "a number with a unit must be a parameter"),
            ("2*sin(x)", 2, "sin of m"),
            ("min(x, v)", 0, "m and m.s-1"),
            ("curve(x, 0, f, 1, v)", 0, "heights"),
        ] {
            let error = unit(text).expect_err(text);
            assert!(error.at == at && error.problem.contains(words), "{text}: {error}");
        }
    }
}
