//! Further torques on a joint, as a block in series on the way of its driving torque.

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// `tau_out = tau_in - tau`, `tau` the sum of the effects that are switched on:
///
/// `tau = viscous_coef omega + coulomb_torque tanh(omega/coulomb_rate) + quaddrag_coef abs(omega) omega
///      + tilt_moment (sin(theta + tilt_angle) - sin(theta))`
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `tau_in`, `tau_out` | N m | torque before and after |
/// | `theta`, `omega` | rad, rad/s | angle (0 hanging) and angular velocity of the joint |
/// | `tau` | N m | torque of the effects |
pub struct TorqueEffect {
    tau_in: Real,
    theta: Real,
    omega: Real,
    tau_out: Real,
    tau: Real,
    viscous: Real,
    coulomb: Real,
    rate: Real,
    drag: Real,
    angle: Real,
    moment: Real,
}

impl Model for TorqueEffect {
    const IDENTITY: Identity = Identity {
        model_identifier: "torque_effect",
        model_name: "torque-effect",
        description: "Torques that a declared model lacks, in series: tau_out = tau_in - tau",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        t.unit("N.m.s2/rad2", &[("kg", 1), ("m", 2), ("rad", -2)]);
        Self {
            tau_in: t.input("tau_in").unit("N.m").about("driving torque").real(0.0),
            theta: t.input("theta").unit("rad").about("angle of the joint, 0 hanging").real(0.0),
            omega: t.input("omega").unit("rad/s").about("angular velocity of the joint").real(0.0),
            tau_out: t
                .output("tau_out")
                .unit("N.m")
                .about("driving torque less that of the effects")
                .computed(),
            tau: t.output("tau").unit("N.m").about("torque of the effects").computed(),
            viscous: t
                .parameter("viscous_coef")
                .unit("N.m.s/rad")
                .about("viscous bearing friction")
                .real(0.0),
            coulomb: t.parameter("coulomb_torque").unit("N.m").about("dry bearing friction").real(0.0),
            rate: t
                .parameter("coulomb_rate")
                .unit("rad/s")
                .about("angular velocity over which dry friction changes its sign")
                .min(1e-9)
                .real(0.05),
            drag: t.parameter("quaddrag_coef").unit("N.m.s2/rad2").about("quadratic air drag").real(0.0),
            angle: t.parameter("tilt_angle").unit("rad").about("slope of the guide, +x uphill").real(0.0),
            moment: t.parameter("tilt_moment").unit("N.m").about("weight times arm of what hangs").real(0.0),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let (theta, omega) = (q[self.theta], q[self.omega]);
        let tau = q[self.viscous] * omega
            + q[self.coulomb] * (omega / q[self.rate]).tanh()
            + q[self.drag] * omega.abs() * omega
            + q[self.moment] * ((theta + q[self.angle]).sin() - theta.sin());
        q[self.tau] = tau;
        q[self.tau_out] = q[self.tau_in] - tau;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    #[test]
    fn torques_oppose_the_motion_and_tilt_turns_the_rest_position() {
        let (m, table) = Table::of::<TorqueEffect>();
        let mut q = table.start_values(Interface::ModelExchange);
        (q[m.viscous], q[m.coulomb], q[m.drag]) = (2e-4, 3e-3, 1e-4);
        (q[m.omega], q[m.theta]) = (-4.0, 0.3);
        m.equations(&mut q).unwrap();
        assert!((q[m.tau] + (8e-4 + 3e-3 + 16e-4)).abs() < 1e-15, "{}", q[m.tau]);
        assert_eq!(q[m.tau_out], -q[m.tau]);
        // At theta = -angle the weight of a tilted pole has no arm: the block cancels the declared weight.
        (q[m.viscous], q[m.coulomb], q[m.drag]) = (0.0, 0.0, 0.0);
        (q[m.angle], q[m.moment], q[m.theta]) = (0.05, 0.2, -0.05);
        m.equations(&mut q).unwrap();
        assert!((q[m.tau] - 0.2 * f64::sin(0.05)).abs() < 1e-16);
    }
}
