//! Numbers with first and second derivatives, for the test problems.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Largest number of variables.
pub const MAX: usize = 10;
const PAIRS: usize = MAX * (MAX + 1) / 2;

/// Value, gradient `[MAX]` and lower triangle of the Hessian, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    pub value: f64,
    pub gradient: [f64; MAX],
    pub hessian: [f64; PAIRS],
}

/// Place of entry (i, j), i >= j, in the lower triangle.
pub fn place(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

impl Jet {
    pub fn constant(value: f64) -> Self {
        Self { value, gradient: [0.0; MAX], hessian: [0.0; PAIRS] }
    }

    pub fn variable(value: f64, i: usize) -> Self {
        let mut jet = Self::constant(value);
        jet.gradient[i] = 1.0;
        jet
    }

    /// g(self) from the value, slope and curvature of g.
    fn chain(self, value: f64, slope: f64, curvature: f64) -> Self {
        let mut out = Self::constant(value);
        for i in 0..MAX {
            out.gradient[i] = slope * self.gradient[i];
            for j in 0..=i {
                out.hessian[place(i, j)] =
                    slope * self.hessian[place(i, j)] + curvature * self.gradient[i] * self.gradient[j];
            }
        }
        out
    }

    pub fn powi(self, n: i32) -> Self {
        let (x, k) = (self.value, f64::from(n));
        self.chain(
            x.powi(n),
            k * x.powi(n - 1),
            if (0..2).contains(&n) { 0.0 } else { k * (k - 1.0) * x.powi(n - 2) },
        )
    }

    pub fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e, e)
    }

    pub fn ln(self) -> Self {
        let x = self.value;
        self.chain(x.ln(), 1.0 / x, -1.0 / (x * x))
    }

    pub fn sqrt(self) -> Self {
        let r = self.value.sqrt();
        self.chain(r, 0.5 / r, -0.25 / (r * self.value))
    }

    pub fn sin(self) -> Self {
        let (s, c) = self.value.sin_cos();
        self.chain(s, c, -s)
    }

    pub fn cos(self) -> Self {
        let (s, c) = self.value.sin_cos();
        self.chain(c, -s, -c)
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let mut out = Self::constant(self.value * other.value);
        for i in 0..MAX {
            out.gradient[i] = self.value * other.gradient[i] + self.gradient[i] * other.value;
            for j in 0..=i {
                out.hessian[place(i, j)] = self.value * other.hessian[place(i, j)]
                    + other.value * self.hessian[place(i, j)]
                    + self.gradient[i] * other.gradient[j]
                    + self.gradient[j] * other.gradient[i];
            }
        }
        out
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let mut out = self;
        out.value += other.value;
        out.gradient.iter_mut().zip(other.gradient).for_each(|(a, b)| *a += b);
        out.hessian.iter_mut().zip(other.hessian).for_each(|(a, b)| *a += b);
        out
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Div for Jet {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self * other.powi(-1)
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self.chain(factor * self.value, factor, 0.0)
    }
}

impl Add<f64> for Jet {
    type Output = Self;
    fn add(mut self, term: f64) -> Self {
        self.value += term;
        self
    }
}

impl Sub<f64> for Jet {
    type Output = Self;
    fn sub(self, term: f64) -> Self {
        self + -term
    }
}

impl Div<f64> for Jet {
    type Output = Self;
    fn div(self, divisor: f64) -> Self {
        self * (1.0 / divisor)
    }
}

impl Add<Jet> for f64 {
    type Output = Jet;
    fn add(self, jet: Jet) -> Jet {
        jet + self
    }
}

impl Sub<Jet> for f64 {
    type Output = Jet;
    fn sub(self, jet: Jet) -> Jet {
        -jet + self
    }
}

impl Mul<Jet> for f64 {
    type Output = Jet;
    fn mul(self, jet: Jet) -> Jet {
        jet * self
    }
}

impl Div<Jet> for f64 {
    type Output = Jet;
    fn div(self, jet: Jet) -> Jet {
        jet.powi(-1) * self
    }
}
