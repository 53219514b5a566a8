//! An error of the effective area of a chamber: a force proportional to its pressure.

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = -coef p`: the driving force gains `coef p`.
pub struct Area {
    coef: Real,
}

impl Area {
    pub fn declare(t: &mut Table) -> Self {
        let coef =
            t.parameter("area_coef").unit("m2").about("missing effective area").nominal(1e-4).real(0.0);
        Self { coef }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        -q[self.coef] * motion.p
    }
}
