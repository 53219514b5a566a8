//! Forward-mode dual numbers: `a + b ε` with `ε² = 0`.
//!
//! One evaluation of the equations with duals gives one directional derivative, or some at once, exact to rounding. The
//! crate has its own type because the equations need a `Copy` number with few operations; a general differentiation
//! crate would bring a linear-algebra stack into every FMU library.

use crate::scalar::Scalar;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value with its derivatives in `L` directions, one unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const L: usize = 1> {
    /// Value.
    pub re: f64,
    /// Derivatives along the seeded directions.
    pub eps: [f64; L],
}

impl Dual {
    /// A value with the given derivative.
    #[inline]
    pub fn new(re: f64, eps: f64) -> Self {
        Self { re, eps: [eps] }
    }
}

impl<const L: usize> Dual<L> {
    /// A value with what `eps` gives for every direction.
    #[inline]
    fn of(re: f64, eps: impl FnMut(usize) -> f64) -> Self {
        Self { re, eps: std::array::from_fn(eps) }
    }
}

impl<const L: usize> Default for Dual<L> {
    #[inline]
    fn default() -> Self {
        Self::from(0.0)
    }
}

impl<const L: usize> From<f64> for Dual<L> {
    #[inline]
    fn from(re: f64) -> Self {
        Self { re, eps: [0.0; L] }
    }
}

impl<const L: usize> PartialOrd for Dual<L> {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl<const L: usize> Add for Dual<L> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::of(self.re + o.re, |l| self.eps[l] + o.eps[l])
    }
}
impl<const L: usize> Sub for Dual<L> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::of(self.re - o.re, |l| self.eps[l] - o.eps[l])
    }
}
impl<const L: usize> Mul for Dual<L> {
    type Output = Self;
    // The product rule.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self::of(self.re * o.re, |l| self.eps[l] * o.re + self.re * o.eps[l])
    }
}
impl<const L: usize> Div for Dual<L> {
    type Output = Self;
    // The quotient rule.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline]
    fn div(self, o: Self) -> Self {
        let q = self.re / o.re;
        Self::of(q, |l| (self.eps[l] - q * o.eps[l]) / o.re)
    }
}
impl<const L: usize> Add<f64> for Dual<L> {
    type Output = Self;
    #[inline]
    fn add(self, o: f64) -> Self {
        Self { re: self.re + o, eps: self.eps }
    }
}
impl<const L: usize> Sub<f64> for Dual<L> {
    type Output = Self;
    #[inline]
    fn sub(self, o: f64) -> Self {
        Self { re: self.re - o, eps: self.eps }
    }
}
impl<const L: usize> Mul<f64> for Dual<L> {
    type Output = Self;
    #[inline]
    fn mul(self, o: f64) -> Self {
        Self::of(self.re * o, |l| self.eps[l] * o)
    }
}
impl<const L: usize> Div<f64> for Dual<L> {
    type Output = Self;
    #[inline]
    fn div(self, o: f64) -> Self {
        Self::of(self.re / o, |l| self.eps[l] / o)
    }
}
impl<const L: usize> Neg for Dual<L> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::of(-self.re, |l| -self.eps[l])
    }
}
impl<const L: usize> AddAssign for Dual<L> {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<const L: usize> SubAssign for Dual<L> {
    #[inline]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl<const L: usize> MulAssign for Dual<L> {
    #[inline]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}
impl<const L: usize> DivAssign for Dual<L> {
    #[inline]
    fn div_assign(&mut self, o: Self) {
        *self = *self / o;
    }
}

impl<const L: usize> Scalar for Dual<L> {
    #[inline]
    fn value(self) -> f64 {
        self.re
    }
    #[inline]
    fn sin(self) -> Self {
        let slope = self.re.cos();
        Self::of(self.re.sin(), |l| self.eps[l] * slope)
    }
    #[inline]
    fn cos(self) -> Self {
        let slope = self.re.sin();
        Self::of(self.re.cos(), |l| -self.eps[l] * slope)
    }
    #[inline]
    fn tanh(self) -> Self {
        // 1 - tanh² loses every digit where tanh rounds to 1; sech² from cosh does not.
        let sech = 1.0 / self.re.cosh();
        Self::of(self.re.tanh(), |l| self.eps[l] * sech * sech)
    }
    #[inline]
    fn exp(self) -> Self {
        let e = self.re.exp();
        Self::of(e, |l| self.eps[l] * e)
    }
    #[inline]
    fn ln(self) -> Self {
        Self::of(self.re.ln(), |l| self.eps[l] / self.re)
    }
    #[inline]
    fn sqrt(self) -> Self {
        let r = self.re.sqrt();
        Self::of(r, |l| self.eps[l] / (2.0 * r))
    }
    #[inline]
    fn powi(self, n: i32) -> Self {
        if n == 0 {
            return Self::from(1.0);
        }
        let power = self.re.powi(n - 1);
        Self::of(self.re.powi(n), |l| self.eps[l] * f64::from(n) * power)
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
            let exact = expression(Dual::new(x, 1.0)).eps[0];
            let h = 2e-4; // truncation h⁴ and rounding 1e-16 / h are both below 1e-11
            let f = |d: f64| expression(x + d * h);
            let difference = (f(-2.0) - 8.0 * f(-1.0) + 8.0 * f(1.0) - f(2.0)) / (12.0 * h);
            assert!((exact - difference).abs() < 1e-9 * exact.abs().max(1.0), "{x}: {exact} {difference}");
        }
    }

    #[test]
    fn directions_together_give_the_same_bits_as_each_alone() {
        let directions = [1.0, -0.3, 0.0, 7.0];
        let together = expression(Dual { re: 0.37, eps: directions });
        for (direction, derivative) in directions.into_iter().zip(together.eps) {
            let alone = expression(Dual::new(0.37, direction));
            assert_eq!((alone.re, alone.eps), (together.re, [derivative]));
        }
    }

    #[test]
    fn slope_of_tanh_keeps_its_digits_far_from_zero() {
        let slope = Dual::new(20.0, 1.0).tanh().eps[0];
        let exact = 4.0 * (-40.0f64).exp(); // sech² x = 4 exp(-2x) (1 + O(exp(-2x)))
        assert!((slope / exact - 1.0).abs() < 1e-12);
    }
}
