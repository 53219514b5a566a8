//! A guide that is not level: the weight along it.

use fmi_export::{Real, Scalar, Table, Values};

/// `f = weight sin(angle)`; `angle > 0`: +x is uphill.
pub struct Tilt {
    angle: Real,
    weight: Real,
}

impl Tilt {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            angle: t.parameter("tilt_angle").unit("rad").about("slope of the guide, +x uphill").real(0.0),
            weight: t.parameter("tilt_weight").unit("N").about("weight of all that slides").real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>) -> S {
        q[self.weight] * q[self.angle].sin()
    }
}
