//! A mass on a line with viscous friction.

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// `m a = F + F_ext - b v`, `dx/dt = v`, `dv/dt = a`.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `F`, `F_ext` | N | driving force, further force |
/// | `x`, `v`, `a` | m, m/s, m/s² | position and its rates |
/// | `energy` | J | kinetic energy |
/// | `m` | kg | mass |
/// | `b` | N s/m | viscous friction |
#[allow(non_snake_case)]
pub struct RigidMass {
    F: Real,
    F_ext: Real,
    v: Real,
    der_x: Real,
    a: Real,
    energy: Real,
    m: Real,
    b: Real,
}

/// Smallest mass \[kg\].
const MIN_MASS: f64 = 1e-9;

impl Model for RigidMass {
    const IDENTITY: Identity = Identity {
        model_identifier: "rigid_mass",
        model_name: "rigid-mass",
        description: "Mass on a line with viscous friction",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        let F = t.input("F").unit("N").about("driving force").nominal(10.0).real(0.0);
        let F_ext = t.input("F_ext").unit("N").about("further force").nominal(10.0).real(0.0);
        let x = t.state("x").unit("m").about("position").nominal(0.1).output().real(0.0);
        let v = t.state("v").unit("m/s").about("velocity").output().real(0.0);
        Self {
            F,
            F_ext,
            v,
            der_x: t.derivative("der(x)", x).unit("m/s").about("rate of x").computed(),
            a: t.derivative("a", v).unit("m/s2").about("acceleration").output().computed(),
            energy: t.output("energy").unit("J").about("kinetic energy").computed(),
            m: t.parameter("m").unit("kg").about("mass").min(MIN_MASS).real(1.0),
            b: t.parameter("b").unit("N.s/m").about("viscous friction").min(0.0).real(0.0),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let (m, b, v) = (q[self.m], q[self.b], q[self.v]);
        q[self.a] = (q[self.F] + q[self.F_ext] - b * v) / m;
        q[self.der_x] = v;
        q[self.energy] = m * v * v * 0.5;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    #[test]
    fn forces_add_and_friction_opposes_the_motion() {
        let (model, table) = Table::of::<RigidMass>();
        let mut q = table.start_values(Interface::ModelExchange);
        for (handle, value) in
            [(model.F, 3.0), (model.F_ext, 1.0), (model.v, -0.5), (model.m, 2.0), (model.b, 6.0)]
        {
            q[handle] = value;
        }
        model.equations(&mut q).expect("the mass is positive");
        assert_eq!((q[model.a], q[model.der_x], q[model.energy]), (3.5, -0.5, 0.25));
    }
}
