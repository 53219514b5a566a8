//! A one-sided wall inside the stroke (Hunt and Crossley, Journal of Applied Mechanics 42, 1975, linear form).

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = max(0, stiffness (x - pos) + damping v)` where `x > pos`
pub struct EndStop {
    pos: Real,
    stiffness: Real,
    damping: Real,
}

impl EndStop {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            pos: t.parameter("endstop_pos").unit("m").about("position of the wall").real(0.0),
            stiffness: t
                .parameter("endstop_stiffness")
                .unit("N/m")
                .about("stiffness of the wall")
                .min(0.0)
                .real(0.0),
            damping: t
                .parameter("endstop_damping")
                .unit("N.s/m")
                .about("damping of the wall")
                .min(0.0)
                .real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        let depth = motion.x - q[self.pos];
        if depth.value() <= 0.0 {
            return S::zero();
        }
        (q[self.stiffness] * depth + q[self.damping] * motion.v).max(S::zero())
    }

    /// Moves the wall behind the part and makes it stiff enough to push.
    pub fn probe(&self, q: &mut Values<f64>) {
        q[self.pos] = -10.0;
        q[self.stiffness] += 10.0;
    }
}
