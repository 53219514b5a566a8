//! A cable or hose that pulls.

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = stiffness (x - rest)`
pub struct Spring {
    stiffness: Real,
    rest: Real,
}

impl Spring {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            stiffness: t.parameter("spring_stiffness").unit("N/m").about("stiffness of the spring").real(0.0),
            rest: t.parameter("spring_rest").unit("m").about("position where the spring is slack").real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        q[self.stiffness] * (motion.x - q[self.rest])
    }
}
