//! Play: a valve spool that its drive takes along only after a way.

use fmi_export::{MemoryBlock, Real, Scalar, Table, Values};

/// `h(k) = min(max(h(k-1), u - width), u + width)`
pub struct Hysteresis {
    width: Real,
    play: MemoryBlock,
}

impl Hysteresis {
    pub fn declare(t: &mut Table) -> Self {
        let width =
            t.parameter("hysteresis_width").about("half-width of the play, unit of u").min(0.0).real(0.0);
        Self { width, play: t.memory(1) }
    }

    pub fn next<S: Scalar>(&self, q: &Values<S>, u: S) -> S {
        let width = q[self.width];
        q[self.play.at(0)].max(u - width).min(u + width)
    }

    /// The play stands at this value.
    pub fn rest_at<S: Scalar>(&self, q: &mut Values<S>, u: S) {
        q[self.play.at(0)] = u;
    }

    pub fn keep(&self, q: &mut Values<f64>, play: f64) {
        q[self.play.at(0)] = play;
    }
}
