//! Forward-mode dual numbers: `a + b ε` with `ε² = 0`.
//!
//! One evaluation of the equations with duals gives one directional derivative, exact to rounding. The crate
//! has its own type because the equations need a `Copy` number with few operations; a general differentiation
//! crate would bring a linear-algebra stack into every FMU library.

use crate::scalar::Scalar;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value with its derivative in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual {
    /// Value.
    pub re: f64,
    /// Derivative along the seeded direction.
    pub eps: f64,
}

impl Dual {
    /// A value with the given derivative.
    #[inline]
    pub fn new(re: f64, eps: f64) -> Self {
        Self { re, eps }
    }
}

impl From<f64> for Dual {
    #[inline]
    fn from(re: f64) -> Self {
        Self { re, eps: 0.0 }
    }
}

impl PartialOrd for Dual {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::new(self.re + o.re, self.eps + o.eps)
    }
}
impl Sub for Dual {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.re - o.re, self.eps - o.eps)
    }
}
impl Mul for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self::new(self.re * o.re, self.eps * o.re + self.re * o.eps)
    }
}
impl Div for Dual {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let q = self.re / o.re;
        Self::new(q, (self.eps - q * o.eps) / o.re)
    }
}
impl Add<f64> for Dual {
    type Output = Self;
    #[inline]
    fn add(self, o: f64) -> Self {
        Self::new(self.re + o, self.eps)
    }
}
impl Sub<f64> for Dual {
    type Output = Self;
    #[inline]
    fn sub(self, o: f64) -> Self {
        Self::new(self.re - o, self.eps)
    }
}
impl Mul<f64> for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, o: f64) -> Self {
        Self::new(self.re * o, self.eps * o)
    }
}
impl Div<f64> for Dual {
    type Output = Self;
    #[inline]
    fn div(self, o: f64) -> Self {
        Self::new(self.re / o, self.eps / o)
    }
}
impl Neg for Dual {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.re, -self.eps)
    }
}
impl AddAssign for Dual {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl SubAssign for Dual {
    #[inline]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl MulAssign for Dual {
    #[inline]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}
impl DivAssign for Dual {
    #[inline]
    fn div_assign(&mut self, o: Self) {
        *self = *self / o;
    }
}

impl Scalar for Dual {
    #[inline]
    fn value(self) -> f64 {
        self.re
    }
    #[inline]
    fn sin(self) -> Self {
        Self::new(self.re.sin(), self.eps * self.re.cos())
    }
    #[inline]
    fn cos(self) -> Self {
        Self::new(self.re.cos(), -self.eps * self.re.sin())
    }
    #[inline]
    fn tanh(self) -> Self {
        let t = self.re.tanh();
        // 1 - tanh² loses every digit where tanh rounds to 1; sech² from cosh does not.
        let sech = 1.0 / self.re.cosh();
        Self::new(t, self.eps * sech * sech)
    }
    #[inline]
    fn exp(self) -> Self {
        let e = self.re.exp();
        Self::new(e, self.eps * e)
    }
    #[inline]
    fn ln(self) -> Self {
        Self::new(self.re.ln(), self.eps / self.re)
    }
    #[inline]
    fn sqrt(self) -> Self {
        let r = self.re.sqrt();
        Self::new(r, self.eps / (2.0 * r))
    }
    #[inline]
    fn powi(self, n: i32) -> Self {
        if n == 0 {
            return Self::from(1.0);
        }
        Self::new(self.re.powi(n), self.eps * f64::from(n) * self.re.powi(n - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One expression that uses every operation, away from its singular points.
    fn expression<S: Scalar>(x: S) -> S {
        let y = (x.sin() * 2.0 + x.cos() / 3.0 - 0.1) * x.tanh();
        let mut z = (y.squared() + 1.0).sqrt() + (x * 0.3).exp() / (x.powi(3) + 2.0);
        z += (x + 2.0).ln();
        z -= -x.abs().max(S::from(0.2)).min(S::from(5.0));
        z *= x.clamp_to(S::from(-3.0), S::from(3.0));
        z /= S::from(1.5) - x * 0.1;
        z
    }

    #[test]
    fn derivative_agrees_with_a_fourth_order_difference() {
        for x in [-0.9, -0.4, 0.37, 1.9] {
            let exact = expression(Dual::new(x, 1.0)).eps;
            let h = 2e-4; // truncation h⁴ and rounding 1e-16 / h are both below 1e-11
            let f = |d: f64| expression(x + d * h);
            let difference = (f(-2.0) - 8.0 * f(-1.0) + 8.0 * f(1.0) - f(2.0)) / (12.0 * h);
            assert!((exact - difference).abs() < 1e-9 * exact.abs().max(1.0), "{x}: {exact} {difference}");
        }
    }

    #[test]
    fn slope_of_tanh_keeps_its_digits_far_from_zero() {
        let slope = Dual::new(20.0, 1.0).tanh().eps;
        let exact = 4.0 * (-40.0f64).exp(); // sech² x = 4 exp(-2x) (1 + O(exp(-2x)))
        assert!((slope / exact - 1.0).abs() < 1e-12);
    }
}
