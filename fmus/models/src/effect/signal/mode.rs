//! A second-order mode in series: resonance of a valve spool or a tube.

use fmi_export::{MemoryBlock, Real, Scalar, Table, Values};

use crate::matrix::Matrix;

/// `q'' + 2 zeta w q' + w^2 q = w^2 u`, `w = 2 pi freq`, exact for a signal that is held over each sample.
pub struct Mode {
    freq: Real,
    zeta: Real,
    /// `q` and `q'/w`.
    state: MemoryBlock,
    /// Transition \[2, 2\] and input \[2\] over one sample, row by row.
    sampled: MemoryBlock,
}

impl Mode {
    pub fn declare(t: &mut Table) -> Self {
        t.unit("Hz", &[("s", -1)]);
        Self {
            freq: t
                .parameter("mode_freq")
                .unit("Hz")
                .about("frequency of the mode, 0: none")
                .nominal(10.0)
                .min(0.0)
                .real(0.0),
            zeta: t.parameter("mode_zeta").about("damping of the mode").min(0.0).real(0.7),
            state: t.memory(2),
            sampled: t.memory(6),
        }
    }

    fn is_on<S: Scalar>(&self, q: &Values<S>) -> bool {
        q[self.freq].value() > 0.0
    }

    /// The exponential of `[[0, w, 0], [-w, -2 zeta w, w], [0, 0, 0]] sample_time`.
    pub fn prepare<S: Scalar>(&self, q: &mut Values<S>, sample_time: S) {
        if !self.is_on(q) {
            return;
        }
        let angle = q[self.freq] * std::f64::consts::TAU * sample_time;
        let mut a = Matrix::<S, 3>::zero(3);
        a.set(0, 1, angle);
        a.set(1, 0, -angle);
        a.set(1, 1, -(q[self.zeta] * angle * 2.0));
        a.set(1, 2, angle);
        let e = exponential(&a);
        for i in 0..2 {
            for j in 0..3 {
                q[self.sampled.at(3 * i + j)] = e.at(i, j);
            }
        }
    }

    pub fn output<S: Scalar>(&self, q: &Values<S>, u: S) -> S {
        if self.is_on(q) { q[self.state.at(0)] } else { u }
    }

    pub fn advance(&self, q: &mut Values<f64>, u: f64) {
        let from = [q[self.state.at(0)], q[self.state.at(1)], u];
        for i in 0..2 {
            q[self.state.at(i)] = (0..3).map(|j| q[self.sampled.at(3 * i + j)] * from[j]).sum();
        }
    }

    /// The mode has settled at this value.
    pub fn rest_at<S: Scalar>(&self, q: &mut Values<S>, u: S) {
        (q[self.state.at(0)], q[self.state.at(1)]) = (u, S::zero());
    }

    pub fn switch_off(&self, q: &mut Values<f64>) {
        q[self.freq] = 0.0;
    }
}

/// Scaling to a norm below 1/2, series of order 16, squaring.
fn exponential<S: Scalar>(a: &Matrix<S, 3>) -> Matrix<S, 3> {
    let halvings = (a.norm1() * 2.0).log2().ceil().clamp(0.0, 60.0) as i32;
    let a = (*a).scaled(0.5f64.powi(halvings));
    let (mut sum, mut term) = (Matrix::identity(3), Matrix::identity(3));
    for order in 1..=16 {
        term = (term * a).scaled(1.0 / f64::from(order));
        sum = sum.plus(&term);
    }
    for _ in 0..halvings {
        sum = sum * sum;
    }
    sum
}
