//! A pendulum on a fixed joint: the pole row of the cart-pole (paper eq. 4) with the cart at rest.

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// `I alpha = tau_ext - b omega - m g l sin(theta)`, `dtheta/dt = omega`, `domega/dt = alpha`.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `tau_ext` | N m | further torque |
/// | `theta`, `omega`, `alpha` | rad, rad/s, rad/s² | angle, 0 hanging, and its rates |
/// | `energy` | J | kinetic and potential energy, 0 at rest hanging |
/// | `I` | kg m² | moment of inertia about the joint (`m_p l²` in eq. 4) |
/// | `m`, `l` | kg, m | mass, distance of its center from the joint |
/// | `g` | m/s² | gravity |
/// | `b` | N m s/rad | damping of the joint |
#[allow(non_snake_case)]
pub struct Pendulum {
    tau_ext: Real,
    theta: Real,
    omega: Real,
    der_theta: Real,
    alpha: Real,
    energy: Real,
    I: Real,
    m: Real,
    l: Real,
    g: Real,
    b: Real,
}

/// Smallest moment of inertia \[kg m²\].
const MIN_INERTIA: f64 = 1e-12;

impl Model for Pendulum {
    const IDENTITY: Identity = Identity {
        model_identifier: "pendulum",
        model_name: "pendulum",
        description: "Pendulum on a fixed joint with viscous damping",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 10.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        t.unit("kg.m2", &[("kg", 1), ("m", 2)]);
        let tau_ext = t.input("tau_ext").unit("N.m").about("further torque").nominal(0.01).real(0.0);
        let theta =
            t.state("theta").unit("rad").about("angle, 0 hanging, counter-clockwise").output().real(0.0);
        let omega = t.state("omega").unit("rad/s").about("angular velocity").output().real(0.0);
        Self {
            tau_ext,
            theta,
            omega,
            der_theta: t.derivative("der(theta)", theta).unit("rad/s").about("rate of theta").computed(),
            alpha: t
                .derivative("alpha", omega)
                .unit("rad/s2")
                .about("angular acceleration")
                .output()
                .computed(),
            energy: t
                .output("energy")
                .unit("J")
                .about("kinetic and potential energy, 0 at rest hanging")
                .computed(),
            I: t.parameter("I")
                .unit("kg.m2")
                .about("moment of inertia about the joint")
                .min(MIN_INERTIA)
                .nominal(0.004)
                .real(0.004),
            m: t.parameter("m").unit("kg").about("mass").min(0.0).real(0.1),
            l: t.parameter("l").unit("m").about("distance of the center of mass from the joint").real(0.2),
            g: t.parameter("g").unit("m/s2").about("gravity").real(9.81),
            b: t.parameter("b").unit("N.m.s/rad").about("damping of the joint").min(0.0).real(0.0006),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let (inertia, mgl, b) = (q[self.I], q[self.m] * q[self.g] * q[self.l], q[self.b]);
        let (theta, omega) = (q[self.theta], q[self.omega]);
        // Pole row of eq. 4 with x'' = 0.
        q[self.alpha] = (q[self.tau_ext] - b * omega - mgl * theta.sin()) / inertia;
        q[self.der_theta] = omega;
        q[self.energy] = inertia * omega * omega * 0.5 + mgl * (S::from(1.0) - theta.cos());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CartPole;
    use fmi_export::Interface;

    #[test]
    fn it_is_the_cart_pole_with_a_cart_too_heavy_to_move() {
        let (model, table) = Table::of::<Pendulum>();
        let mut q = table.start_values(Interface::ModelExchange);
        (q[model.theta], q[model.omega], q[model.tau_ext]) = (0.7, -2.0, 0.003);
        model.equations(&mut q).expect("the inertia is positive");
        let (cart, cart_table) = Table::of::<CartPole>();
        let handle = |name| cart_table.by_name(name).and_then(|v| v.real()).expect("a Real");
        let mut r = cart_table.start_values(Interface::ModelExchange);
        for (name, value) in [("m_c", 1e9), ("theta", 0.7), ("omega", -2.0), ("tau_ext", 0.003)] {
            r[handle(name)] = value;
        }
        cart.equations(&mut r).expect("the mass matrix is regular");
        let alpha = r[handle("alpha")];
        assert!((q[model.alpha] - alpha).abs() < 1e-6, "{} {alpha}", q[model.alpha]);
    }

    #[test]
    fn energy_falls_by_what_the_damping_takes() {
        let (model, table) = Table::of::<Pendulum>();
        let mut q = table.start_values(Interface::ModelExchange);
        (q[model.theta], q[model.omega]) = (1.2, 3.0);
        model.equations(&mut q).expect("the inertia is positive");
        // d energy / dt = I omega alpha + m g l sin(theta) omega = -b omega^2
        let power = 0.004 * 3.0 * q[model.alpha] + 0.1 * 9.81 * 0.2 * f64::sin(1.2) * 3.0;
        assert!((power + 0.0006 * 9.0).abs() < 1e-15, "{power}");
    }
}
