//! The peak of friction at low speed (Stribeck; in the form of Bo and Pavelescu, Wear 82, 1982, with exponent 2).

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = force exp(-((v - c3)/vs)^2) s(v)`
pub struct Stribeck {
    force: Real,
    vs: Real,
}

impl Stribeck {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            force: t.parameter("stribeck_force").unit("N").about("height of the Stribeck peak").real(0.0),
            vs: t
                .parameter("stribeck_vs")
                .unit("m/s")
                .about("width of the Stribeck peak")
                .min(1e-6)
                .real(0.05),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        q[self.force] * (-(motion.w / q[self.vs]).squared()).exp() * motion.s
    }
}
