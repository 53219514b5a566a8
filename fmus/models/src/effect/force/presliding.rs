//! Coulomb friction that is a hysteretic spring before the part slides (Dahl, A solid friction model, Aerospace
//! Corporation 1968).

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// The declared `c1 s(v)` becomes `c1 z/disp`, `dz/dt = w - abs(w) z/disp`, `w = v - c3`; off where `disp = 0`.
pub struct Presliding {
    disp: Real,
    z: Real,
    der_z: Real,
}

impl Presliding {
    pub fn declare(t: &mut Table) -> Self {
        let z = t.state("z").unit("m").about("presliding deflection").nominal(0.001).real(0.0);
        Self {
            disp: t
                .parameter("presliding_disp")
                .unit("m")
                .about("presliding displacement, 0: none")
                .nominal(0.001)
                .min(0.0)
                .real(0.0),
            der_z: t.derivative("der(z)", z).unit("m/s").about("rate of z").nominal(0.1).computed(),
            z,
        }
    }

    pub fn rate<S: Scalar>(&self, q: &mut Values<S>, motion: &Motion<S>) {
        let disp = q[self.disp];
        q[self.der_z] =
            if disp.value() > 0.0 { motion.w - motion.w.abs() * q[self.z] / disp } else { S::zero() };
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>, c1: S) -> S {
        let disp = q[self.disp];
        if disp.value() > 0.0 { c1 * (q[self.z] / disp - motion.s) } else { S::zero() }
    }
}
