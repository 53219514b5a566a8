//! Viscous friction and a constant bias.

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = coef v + value`
pub struct Viscous {
    coef: Real,
    value: Real,
}

impl Viscous {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            coef: t.parameter("viscous_coef").unit("N.s/m").about("viscous friction").real(0.0),
            value: t.parameter("offset_value").unit("N").about("constant friction bias").real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        q[self.coef] * motion.v + q[self.value]
    }
}
