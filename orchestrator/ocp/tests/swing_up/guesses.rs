//! Guesses other than the pump: a straight line, and perturbed pumps.

use std::f64::consts::PI;

use crate::problem::{PUMP, SwingUp};

impl SwingUp {
    /// G1: a straight line.
    pub fn linear(&self) -> Vec<f64> {
        self.guess(&[(0.0, 0.0), (1.0, PI)], [0.0; 3])
    }

    /// G2 with its knots moved and a motion of the cart, by seed.
    pub fn perturbed(&self, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(0x1234_5678_9ABC_DEF1);
        let mut uniform = |width: f64| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            width * ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
        };
        let mut knots = PUMP;
        for knot in &mut knots[1..5] {
            knot.0 += uniform(0.05);
            knot.1 *= 1.0 + uniform(0.4);
        }
        let sines = [0; 3].map(|_| uniform(0.06));
        self.guess(&knots, sines)
    }
}
