//! Coulomb-viscous friction of piston or cart as a block in series (paper eq. 2, 10, 11).

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// `F_out = F_in - f(v)` with `f = c1 tanh(c2 (v - c3)) + c4 v + c5` (paper eq. 2).
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `F_in`, `F_out` | N | force before and after the friction |
/// | `v` | m/s | velocity of the sliding part |
/// | `f` | N | friction force |
/// | `c1`, `c5` | N | Coulomb force, bias |
/// | `c2`, `c3` | s/m, m/s | slope and offset of the sign change |
/// | `c4` | N s/m | viscous friction |
///
/// The force is not zero at rest where `c3` or `c5` is not zero.
#[allow(non_snake_case)]
pub struct Friction {
    F_in: Real,
    v: Real,
    F_out: Real,
    f: Real,
    c: [Real; 5],
}

/// Eq. 10.
pub(crate) const PISTON: [f64; 5] = [1.5145, 40.8926, 0.0, 49.2734, 0.0];
/// Eq. 11.
pub(crate) const CART: [f64; 5] = [5.7910, 63.7045, 0.0064, 0.0, -2.3170];

impl Model for Friction {
    const IDENTITY: Identity = Identity {
        model_identifier: "friction",
        model_name: "friction",
        description: "Coulomb-viscous friction in series: F_out = F_in - f(v)",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        let [c1, c2, c3, c4, c5] = PISTON;
        Self {
            F_in: t.input("F_in").unit("N").about("driving force").nominal(10.0).real(0.0),
            v: t.input("v").unit("m/s").about("velocity of the sliding part").nominal(0.1).real(0.0),
            F_out: t.output("F_out").unit("N").about("driving force less friction").nominal(10.0).computed(),
            f: t.output("f").unit("N").about("friction force").nominal(10.0).computed(),
            c: [
                t.parameter("c1").unit("N").about("Coulomb friction").real(c1),
                t.parameter("c2").unit("s/m").about("slope of the sign change").nominal(50.0).real(c2),
                t.parameter("c3").unit("m/s").about("velocity of the sign change").nominal(0.01).real(c3),
                t.parameter("c4").unit("N.s/m").about("viscous friction").nominal(50.0).real(c4),
                t.parameter("c5").unit("N").about("bias").real(c5),
            ],
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let [c1, c2, c3, c4, c5] = self.c.map(|c| q[c]);
        let xdot = q[self.v];
        let f = c1 * (c2 * (xdot - c3)).tanh() + c4 * xdot + c5; // eq. 2
        q[self.f] = f;
        q[self.F_out] = q[self.F_in] - f;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    fn force(c: [f64; 5], v: f64) -> f64 {
        let (model, table) = Table::of::<Friction>();
        let mut q = table.start_values(Interface::ModelExchange);
        for (handle, value) in model.c.iter().zip(c) {
            q[*handle] = value;
        }
        q[model.v] = v;
        q[model.F_in] = 3.0;
        model.equations(&mut q).expect("friction has a value everywhere");
        assert!((q[model.F_out] - (3.0 - q[model.f])).abs() < 1e-15);
        q[model.f]
    }

    #[test]
    fn piston_and_cart_together_push_with_4_555_newton_at_rest() {
        let at_rest = force(PISTON, 0.0) + force(CART, 0.0);
        assert!((at_rest + 4.55536927).abs() < 5e-9, "{at_rest}"); // nine digits are given
    }

    #[test]
    fn coulomb_force_is_reached_far_from_the_sign_change() {
        // tanh(40) is 1 to the last digit, so only the sum of the terms is left.
        let v = 1.0;
        assert!((force(PISTON, v) - (1.5145 + 49.2734)).abs() < 1e-12);
        assert!((force(CART, -v) - (-5.7910 - 2.3170)).abs() < 1e-12);
    }
}
