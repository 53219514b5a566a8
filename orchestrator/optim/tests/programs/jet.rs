//! Numbers with first and second derivatives by up to N variables, for the formulas of the programs.

use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

use airloop_expression::Function;

/// Value, gradient `[N]` and lower triangle of the Hessian `[N, N]`.
#[derive(Clone, Copy, Debug)]
pub struct Jet<const N: usize> {
    pub value: f64,
    pub gradient: [f64; N],
    pub hessian: [[f64; N]; N],
}

impl<const N: usize> From<f64> for Jet<N> {
    fn from(value: f64) -> Self {
        Self { value, gradient: [0.0; N], hessian: [[0.0; N]; N] }
    }
}

impl<const N: usize> Jet<N> {
    pub fn variable(value: f64, i: usize) -> Self {
        let mut jet = Self::from(value);
        jet.gradient[i] = 1.0;
        jet
    }

    /// g(self) from the value, slope and curvature of g.
    fn chain(self, value: f64, slope: f64, curvature: f64) -> Self {
        let mut out = Self::from(value);
        for i in 0..N {
            out.gradient[i] = slope * self.gradient[i];
            for j in 0..=i {
                out.hessian[i][j] =
                    slope * self.hessian[i][j] + curvature * self.gradient[i] * self.gradient[j];
            }
        }
        out
    }

    fn powi(self, n: i32) -> Self {
        let (x, k) = (self.value, f64::from(n));
        let slope = if n == 0 { 0.0 } else { k * x.powi(n - 1) };
        let curvature = if (0..2).contains(&n) { 0.0 } else { k * (k - 1.0) * x.powi(n - 2) };
        self.chain(x.powi(n), slope, curvature)
    }

    /// A function of a formula.
    pub fn call(function: Function, x: Self) -> Self {
        let v = x.value;
        match function {
            Function::Sin => x.chain(v.sin(), v.cos(), -v.sin()),
            Function::Cos => x.chain(v.cos(), -v.sin(), -v.cos()),
            Function::Exp => x.chain(v.exp(), v.exp(), v.exp()),
            Function::Ln => x.chain(v.ln(), 1.0 / v, -1.0 / (v * v)),
            Function::Sqrt => x.chain(v.sqrt(), 0.5 / v.sqrt(), -0.25 / (v * v.sqrt())),
            Function::Tanh => {
                let (t, slope) = (v.tanh(), 1.0 - v.tanh().powi(2));
                x.chain(t, slope, -2.0 * t * slope)
            }
            Function::Power(n) => x.powi(n),
            Function::Floor => x.chain(v.floor(), 0.0, 0.0),
            Function::Abs | Function::Sign => unreachable!("evaluated without a call"),
        }
    }
}

impl<const N: usize> Mul for Jet<N> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let mut out = Self::from(self.value * other.value);
        for i in 0..N {
            out.gradient[i] = self.value * other.gradient[i] + self.gradient[i] * other.value;
            for j in 0..=i {
                out.hessian[i][j] = self.value * other.hessian[i][j]
                    + other.value * self.hessian[i][j]
                    + self.gradient[i] * other.gradient[j]
                    + self.gradient[j] * other.gradient[i];
            }
        }
        out
    }
}

impl<const N: usize> Add for Jet<N> {
    type Output = Self;
    fn add(mut self, other: Self) -> Self {
        self.value += other.value;
        for i in 0..N {
            self.gradient[i] += other.gradient[i];
            (0..=i).for_each(|j| self.hessian[i][j] += other.hessian[i][j]);
        }
        self
    }
}

impl<const N: usize> Neg for Jet<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0, 0.0)
    }
}

impl<const N: usize> Sub for Jet<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const N: usize> Div for Jet<N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        self * other.powi(-1)
    }
}

impl<const N: usize> PartialEq for Jet<N> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const N: usize> PartialOrd for Jet<N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}
