//! Values of formulas.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{Expression, Kind, Node};

/// Operations that formulas need of numbers; any type with them can be a value.
pub trait Number:
    Copy
    + From<f64>
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
}

impl<T> Number for T where
    T: Copy
        + From<f64>
        + PartialOrd
        + Add<Output = T>
        + Sub<Output = T>
        + Mul<Output = T>
        + Div<Output = T>
        + Neg<Output = T>
{
}

/// A function of one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Hyperbolic tangent.
    Tanh,
    /// Exponential function.
    Exp,
    /// Natural logarithm.
    Ln,
    /// Square root.
    Sqrt,
    /// Magnitude; never asked for by [`Expression::evaluate`].
    Abs,
    /// -1, 0 or 1; never asked for by [`Expression::evaluate`].
    Sign,
    /// Largest whole number that is not above; its derivative is zero.
    Floor,
    /// Integer power.
    Power(i32),
}

impl Function {
    /// Value for a number.
    pub fn of(self, x: f64) -> f64 {
        match self {
            Function::Sin => x.sin(),
            Function::Cos => x.cos(),
            Function::Tanh => x.tanh(),
            Function::Exp => x.exp(),
            Function::Ln => x.ln(),
            Function::Sqrt => x.sqrt(),
            Function::Abs => x.abs(),
            Function::Sign if x == 0.0 => 0.0,
            Function::Sign => x.signum(),
            Function::Floor => x.floor(),
            Function::Power(n) => x.powi(n),
        }
    }
}

/// Values of the names, and the functions of their type.
pub(crate) struct Point<'a, N> {
    pub variables: &'a [N],
    pub call: &'a dyn Fn(Function, N) -> N,
}

impl Expression {
    /// Value for the values of the names, in the order in which they were given; `call` computes functions of the type.
    ///
    /// Where the formula has no value (division by zero, root of a negative number) it is that of the type: not a
    /// number or infinite.
    pub fn evaluate<N: Number>(&self, variables: &[N], call: &dyn Fn(Function, N) -> N) -> N {
        self.root.evaluate(&Point { variables, call })
    }

    /// Value for plain numbers.
    pub fn value(&self, variables: &[f64]) -> f64 {
        self.evaluate(variables, &Function::of)
    }
}

impl Node {
    pub(crate) fn evaluate<N: Number>(&self, point: &Point<'_, N>) -> N {
        let zero = N::from(0.0);
        match &self.kind {
            Kind::Number(value) => N::from(*value),
            Kind::Variable(index) => point.variables[*index],
            Kind::Negative(a) => -a.evaluate(point),
            Kind::Sum(a, b) => a.evaluate(point) + b.evaluate(point),
            Kind::Difference(a, b) => a.evaluate(point) - b.evaluate(point),
            Kind::Product(a, b) => a.evaluate(point) * b.evaluate(point),
            Kind::Quotient(a, b) => a.evaluate(point) / b.evaluate(point),
            Kind::Power(a, exponent) => power(a.evaluate(point), *exponent, point),
            Kind::Call(Function::Abs, a) => {
                let a = a.evaluate(point);
                if a < zero { -a } else { a }
            }
            Kind::Call(Function::Sign, a) => {
                let a = a.evaluate(point);
                match a.partial_cmp(&zero) {
                    Some(order) => N::from(f64::from(order as i8)),
                    None => a,
                }
            }
            Kind::Call(function, a) => (point.call)(*function, a.evaluate(point)),
            Kind::Minimum(a, b) => {
                let (a, b) = (a.evaluate(point), b.evaluate(point));
                if b < a { b } else { a }
            }
            Kind::Maximum(a, b) => {
                let (a, b) = (a.evaluate(point), b.evaluate(point));
                if b > a { b } else { a }
            }
            Kind::Curve(a, curve) => curve.height(a.evaluate(point), point),
        }
    }
}

/// A power; of a negative number only with a whole exponent.
fn power<N: Number>(base: N, exponent: f64, point: &Point<'_, N>) -> N {
    if exponent.fract() == 0.0 && exponent.abs() < 1e6 {
        return (point.call)(Function::Power(exponent as i32), base);
    }
    if base == N::from(0.0) && exponent > 0.0 {
        return N::from(0.0);
    }
    if (2.0 * exponent).fract() == 0.0 && exponent.abs() < 1e6 {
        let whole = (point.call)(Function::Power(exponent.floor() as i32), base);
        return whole * (point.call)(Function::Sqrt, base);
    }
    (point.call)(Function::Exp, (point.call)(Function::Ln, base) * N::from(exponent))
}

#[cfg(test)]
mod tests {
    use super::super::Expression;

    fn value(text: &str, x: f64) -> f64 {
        Expression::parse(text, &["x"]).expect("a formula").value(&[x])
    }

    #[test]
    fn operators_bind_as_on_paper() {
        assert_eq!(value("-x^2 + 2*3 - 4/2/2", 3.0), -9.0 + 6.0 - 1.0);
        assert_eq!(value("2^3^2", 0.0), 512.0);
        assert_eq!(value("x^-2", 2.0), 0.25);
        assert_eq!(value("x^(1/2)", 9.0), 3.0);
        assert_eq!(value("(1 - -x)*(2)", 2.0), 6.0);
        assert_eq!(value("1e-3*x + .5", 1000.0), 1.5);
        assert_eq!(value("2*pi", 0.0), std::f64::consts::TAU);
    }

    #[test]
    fn functions_have_their_values() {
        let x = 0.37_f64;
        for (text, exact) in [
            ("sin(x)", x.sin()),
            ("cos(x)", x.cos()),
            ("tan(x)", x.sin() / x.cos()),
            ("tanh(x)", x.tanh()),
            ("exp(-x)", (-x).exp()),
            ("ln(x)", x.ln()),
            ("sqrt(x)", x.sqrt()),
            ("abs(-x)", x),
            ("sign(-x)", -1.0),
            ("min(x, 1)", x),
            ("max(x, 1)", 1.0),
            ("clamp(x, -0.1, 0.1)", 0.1),
            ("floor(10*x)", 3.0),
            ("floor(-10*x)", -4.0),
            ("max(0, x - 0.3)", x - 0.3),
        ] {
            assert_eq!(value(text, x), exact, "{text}");
        }
        assert_eq!(value("sign(x)", 0.0), 0.0);
        assert_eq!(value("x^1.5", 0.0), 0.0);
        assert!(value("1/x", 0.0).is_infinite() && value("sqrt(x)", -1.0).is_nan());
    }

    #[test]
    fn a_curve_is_exact_for_parabolas_and_goes_on_straight() {
        let points: Vec<String> = [-1.0, -0.4, 0.1, 0.5, 1.2, 2.0]
            .iter()
            .map(|x: &f64| format!("{x:?}, {:?}", 1.0 + 2.0 * x - 3.0 * x * x))
            .collect();
        let text = format!("curve(x, {})", points.join(", "));
        let curve = Expression::parse(&text, &["x"]).expect("a curve");
        for k in -10..=20 {
            let x = 0.1 * f64::from(k);
            let exact = 1.0 + 2.0 * x - 3.0 * x * x;
            assert!((curve.value(&[x]) - exact).abs() < 1e-13, "{x}");
        }
        // Slopes at the ends: 8 and -10.
        assert!((curve.value(&[-1.5]) - (-4.0 - 4.0)).abs() < 1e-12);
        assert!((curve.value(&[3.0]) - (-7.0 - 10.0)).abs() < 1e-12);
        let line = Expression::parse("curve(x, 0, 1, 2, a)", &["x", "a"]).expect("two points");
        assert_eq!([-1.0, 1.0, 3.0].map(|x| line.value(&[x, 5.0])), [-1.0, 3.0, 7.0]);
    }
}
