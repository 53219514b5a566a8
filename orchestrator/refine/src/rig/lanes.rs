//! Several simulations side by side: arithmetic on a few numbers at once, and the functions that friction and pole
//! need.
//!
//! The functions are polynomials without branches or tables, so that the compiler turns them into vector instructions;
//! every lane gives the same bits whatever its neighbors are. They know no physics.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Numbers of `L` simulations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lanes<const L: usize>(pub [f64; L]);

/// One number per lane, line by line: a simulation is made of thousands of these, and with a loop in each the compiler
/// took minutes to unroll them one by one. Functions of many lines have a loop, which becomes vector instructions.
#[inline(always)]
pub fn each<const L: usize>(value: impl Fn(usize) -> f64) -> Lanes<L> {
    let mut found = [0.0; L];
    macro_rules! lanes {
        ($($lane:literal)*) => {
            const { assert!(L <= [$($lane),*].len()) };
            $(if $lane < L { found[$lane] = value($lane); })*
        };
    }
    lanes!(0 1 2 3 4 5 6 7 8);
    Lanes(found)
}

impl<const L: usize> Default for Lanes<L> {
    fn default() -> Self {
        Lanes([0.0; L])
    }
}

macro_rules! operation {
    ($trait:ident $method:ident $sign:tt) => {
        impl<const L: usize> $trait for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                each(|i| self.0[i] $sign other.0[i])
            }
        }
        impl<const L: usize> $trait<f64> for Lanes<L> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                each(|i| self.0[i] $sign other)
            }
        }
    };
}
operation!(Add add +);
operation!(Sub sub -);
operation!(Mul mul *);
operation!(Div div /);

impl<const L: usize> Neg for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        each(|i| -self.0[i])
    }
}

/// Adding it rounds a small number to an integer, which then stands in the lowest bits.
const ROUNDS: f64 = 6_755_399_441_055_744.0;

impl<const L: usize> Lanes<L> {
    /// The same number everywhere.
    #[inline(always)]
    pub fn all(value: f64) -> Self {
        Lanes([value; L])
    }

    /// Whether any lane fulfills the condition.
    pub fn any(&self, condition: impl Fn(f64) -> bool) -> bool {
        self.0.iter().any(|&value| condition(value))
    }

    /// Magnitude.
    #[inline(always)]
    pub fn abs(self) -> Self {
        each(|i| self.0[i].abs())
    }

    /// `self` where `of` is positive, else zero.
    #[inline(always)]
    pub fn where_positive(self, of: Self) -> Self {
        each(|i| if of.0[i] > 0.0 { self.0[i] } else { 0.0 })
    }

    /// Exponential function; arguments beyond 700 count as 700.
    #[inline(always)]
    pub fn exp(self) -> Self {
        let mut found = [0.0; L];
        for (own, x) in found.iter_mut().zip(self.0) {
            *own = exp(x);
        }
        Lanes(found)
    }

    /// `1 - 2/(exp(2x) + 1)`, to 4.5e-16: sum and quotient near 2 are each rounded by up to 2.2e-16.
    #[inline(always)]
    pub fn tanh(self) -> Self {
        Self::all(1.0) - Self::all(2.0) / ((self * 2.0).exp() + 1.0)
    }

    /// Sine and cosine, to 3e-16 for arguments up to some thousand.
    #[inline(always)]
    pub fn sin_cos(self) -> (Self, Self) {
        let (mut sin, mut cos) = ([0.0; L], [0.0; L]);
        for i in 0..L {
            (sin[i], cos[i]) = sin_cos(self.0[i]);
        }
        (Lanes(sin), Lanes(cos))
    }
}

/// Nearest integer of a number below 2^51; halves go to the even one.
#[inline(always)]
pub fn round(x: f64) -> f64 {
    (x + ROUNDS) - ROUNDS
}

/// `2^k` times the Taylor series of the rest, which is below ln(2)/2: the first term left out is below 2e-17.
#[inline(always)]
fn exp(x: f64) -> f64 {
    let x = if x > 700.0 { 700.0 } else { x };
    let x = if x < -700.0 { -700.0 } else { x };
    let shifted = x * std::f64::consts::LOG2_E + ROUNDS;
    let k = shifted - ROUNDS;
    // ln 2 in two parts: the product with the first is exact.
    let r = (x - k * 6.931_471_803_691_238e-1) - k * 1.908_214_929_270_587_7e-10;
    let r2 = r * r;
    let r4 = r2 * r2;
    let low = (1.0 + r) + r2 * (0.5 + r * (1.0 / 6.0));
    let middle = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0));
    let high = (1.0 / 40_320.0 + r * (1.0 / 362_880.0)) + r2 * (1.0 / 3_628_800.0 + r * (1.0 / 39_916_800.0));
    let top = 1.0 / 479_001_600.0 + r * (1.0 / 6_227_020_800.0);
    let series = low + r4 * (middle + r4 * (high + r4 * top));
    series * f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52)
}

/// Taylor series around the nearest multiple of a quarter turn.
#[inline(always)]
fn sin_cos(x: f64) -> (f64, f64) {
    let shifted = x * std::f64::consts::FRAC_2_PI + ROUNDS;
    let n = shifted - ROUNDS;
    let quarter = shifted.to_bits();
    // A quarter turn in three parts: the products with the first two are exact for up to some thousand turns.
    let r =
        ((x - n * 1.570_796_326_734_125_6) - n * 6.077_100_506_303_966e-11) - n * 2.022_266_248_795_950_6e-21;
    let z = r * r;
    let s = 1.0 / 355_687_428_096_000.0;
    let s = -1.0 / 1_307_674_368_000.0 + z * s;
    let s = 1.0 / 6_227_020_800.0 + z * s;
    let s = -1.0 / 39_916_800.0 + z * s;
    let s = 1.0 / 362_880.0 + z * s;
    let s = -1.0 / 5040.0 + z * s;
    let s = 1.0 / 120.0 + z * s;
    let s = -1.0 / 6.0 + z * s;
    let sin = r + r * z * s;
    let c = 1.0 / 20_922_789_888_000.0;
    let c = -1.0 / 87_178_291_200.0 + z * c;
    let c = 1.0 / 479_001_600.0 + z * c;
    let c = -1.0 / 3_628_800.0 + z * c;
    let c = 1.0 / 40_320.0 + z * c;
    let c = -1.0 / 720.0 + z * c;
    let c = 1.0 / 24.0 + z * c;
    let cos = 1.0 - 0.5 * z + z * z * c;
    let odd = quarter & 1 == 1;
    let (a, b) = (if odd { cos } else { sin }, if odd { sin } else { cos });
    let sign = |bit: u64| (bit & 2) << 62;
    (f64::from_bits(a.to_bits() ^ sign(quarter)), f64::from_bits(b.to_bits() ^ sign(quarter.wrapping_add(1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_those_of_the_library() {
        for k in -4000..4000 {
            let x = f64::from(k) * 0.01;
            assert!((exp(x) / x.exp() - 1.0).abs() < 5e-16, "exp {x}");
            let ((sin, cos), exact) = (sin_cos(x), x.sin_cos());
            assert!((sin - exact.0).abs() < 3e-16 && (cos - exact.1).abs() < 3e-16, "sin, cos {x}");
            assert!((Lanes([x]).tanh().0[0] - x.tanh()).abs() < 4.5e-16, "tanh {x}");
        }
        for x in [-800.0, -1e-9, 0.0, 1e-12, 900.0f64] {
            assert!((Lanes([x]).tanh().0[0] - x.tanh()).abs() < 4.5e-16, "{x}");
        }
    }

    #[test]
    fn what_is_no_number_stays_so() {
        assert!(exp(f64::NAN).is_nan() && sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
    }
}
