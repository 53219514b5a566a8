//! Another level and slope of friction in the positive direction.

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = force s(v) + coef v` where `v > 0`
pub struct Asymmetry {
    force: Real,
    coef: Real,
}

impl Asymmetry {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            force: t.parameter("asymmetry_force").unit("N").about("Coulomb friction where v > 0").real(0.0),
            coef: t.parameter("asymmetry_coef").unit("N.s/m").about("viscous friction where v > 0").real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        if motion.v.value() > 0.0 { q[self.force] * motion.s + q[self.coef] * motion.v } else { S::zero() }
    }
}
