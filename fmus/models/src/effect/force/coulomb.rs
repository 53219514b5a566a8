//! Coulomb friction: constant, growing with the force of the pressure difference (seals), varying along the guide.

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = (force + pressure_coef abs(F_hat) + slope x) s(v)`
pub struct Coulomb {
    force: Real,
    pressure: Real,
    slope: Real,
}

impl Coulomb {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            force: t.parameter("coulomb_force").unit("N").about("Coulomb friction").real(0.0),
            pressure: t
                .parameter("pressure_coef")
                .about("growth of the Coulomb friction with abs(F_hat)")
                .real(0.0),
            slope: t
                .parameter("poscoulomb_slope")
                .unit("N/m")
                .about("growth of the Coulomb friction with the position")
                .real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        let level = q[self.force] + q[self.pressure] * motion.pressure_force.abs() + q[self.slope] * motion.x;
        level * motion.s
    }
}
