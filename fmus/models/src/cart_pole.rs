//! Cart with a hanging or standing pole (paper eq. 1, 4).

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// Rigid-body dynamics of the cart-pole: `H(q) q'' + C(q, q') q' + G(q) = B u` (paper eq. 1, 4).
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `F`, `F_ext` | N | driving force, further force on the cart |
/// | `tau_ext` | N m | further torque on the pole |
/// | `x`, `v`, `a` | m, m/s, m/s² | cart |
/// | `theta`, `omega`, `alpha` | rad, rad/s, rad/s² | pole, 0 hanging, counter-clockwise |
/// | `energy` | J | kinetic and potential energy, 0 at rest with the pole hanging |
#[allow(non_snake_case)]
pub struct CartPole {
    F: Real,
    F_ext: Real,
    tau_ext: Real,
    theta: Real,
    v: Real,
    omega: Real,
    der_x: Real,
    der_theta: Real,
    a: Real,
    alpha: Real,
    energy: Real,
    m_c: Real,
    m_p: Real,
    l: Real,
    g: Real,
    b_p: Real,
}

/// Smallest mass \[kg\] and length \[m\]: the mass matrix stays regular.
const MIN_MASS_OR_LENGTH: f64 = 1e-9;

impl Model for CartPole {
    const IDENTITY: Identity = Identity {
        model_identifier: "cart_pole",
        model_name: "cart-pole",
        description: "Cart-pole: rigid-body dynamics of a cart on a line with a pole",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 4.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        let F = t.input("F").unit("N").about("driving force on the cart").nominal(10.0).real(0.0);
        let F_ext = t.input("F_ext").unit("N").about("further force on the cart").nominal(10.0).real(0.0);
        let tau_ext = t.input("tau_ext").unit("N.m").about("further torque on the pole").real(0.0);
        let x = t.state("x").unit("m").about("position of the cart").nominal(0.1).output().real(0.0);
        let theta = t
            .state("theta")
            .unit("rad")
            .about("angle of the pole, 0 hanging, pi upright, counter-clockwise")
            .output()
            .real(0.0);
        let v = t.state("v").unit("m/s").about("velocity of the cart").output().real(0.0);
        let omega = t.state("omega").unit("rad/s").about("angular velocity of the pole").output().real(0.0);
        let mass = |t: &mut Table, name: &'static str, about: &'static str, start: f64| {
            t.parameter(name).unit("kg").about(about).min(MIN_MASS_OR_LENGTH).real(start)
        };
        Self {
            F,
            F_ext,
            tau_ext,
            theta,
            v,
            omega,
            der_x: t.derivative("der(x)", x).unit("m/s").about("rate of x").computed(),
            der_theta: t.derivative("der(theta)", theta).unit("rad/s").about("rate of theta").computed(),
            a: t.derivative("a", v).unit("m/s2").about("acceleration of the cart").output().computed(),
            alpha: t
                .derivative("alpha", omega)
                .unit("rad/s2")
                .about("angular acceleration of the pole")
                .output()
                .computed(),
            energy: t
                .output("energy")
                .unit("J")
                .about("kinetic and potential energy, 0 at rest with the pole hanging")
                .computed(),
            m_c: mass(t, "m_c", "mass of the cart", 0.399),
            m_p: mass(t, "m_p", "mass of the pole", 0.1),
            l: t.parameter("l")
                .unit("m")
                .about("distance of the pole's mass from the joint")
                .min(MIN_MASS_OR_LENGTH)
                .real(0.2),
            g: t.parameter("g").unit("m/s2").about("gravity").real(9.81),
            b_p: t
                .parameter("b_p")
                .unit("N.m.s/rad")
                .about("damping of the pole's joint")
                .min(0.0)
                .real(0.0006),
        }
    }

    #[allow(non_snake_case)]
    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let (m_c, m_p, l, g, b_p) = (q[self.m_c], q[self.m_p], q[self.l], q[self.g], q[self.b_p]);
        let (xdot, thetadot) = (q[self.v], q[self.omega]);
        let (sin, cos) = (q[self.theta].sin(), q[self.theta].cos());

        // H(q) q'' = B u - C(q, q') q' - G(q), eq. 1 and 4
        let (H11, H12, H22) = (m_c + m_p, m_p * l * cos, m_p * l * l);
        let r1 = q[self.F] + q[self.F_ext] + m_p * l * thetadot * thetadot * sin;
        let r2 = q[self.tau_ext] - b_p * thetadot - m_p * g * l * sin;
        // det H = m_p l² (m_c + m_p sin²θ), written so that nothing cancels
        let det = H22 * (m_c + m_p * sin * sin);
        q[self.a] = (H22 * r1 - H12 * r2) / det;
        q[self.alpha] = (H11 * r2 - H12 * r1) / det;
        q[self.der_x] = xdot;
        q[self.der_theta] = thetadot;

        let kinetic = (H11 * xdot * xdot + H22 * thetadot * thetadot) * 0.5 + H12 * xdot * thetadot;
        q[self.energy] = kinetic + m_p * g * l * (S::from(1.0) - cos);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    fn at(state: [f64; 3], force: f64) -> (CartPole, Values<f64>) {
        let (model, table) = Table::of::<CartPole>();
        let mut q = table.start_values(Interface::ModelExchange);
        [model.theta, model.v, model.omega].iter().zip(state).for_each(|(h, s)| q[*h] = s);
        q[model.F] = force;
        model.equations(&mut q).expect("the mass matrix is regular");
        (model, q)
    }

    #[test]
    fn accelerations_satisfy_both_rows_of_eq_4() {
        let (theta, v, omega, force): (f64, f64, f64, f64) = (0.7, 0.3, -2.0, 5.0);
        let (m, q) = at([theta, v, omega], force);
        let (mc, mp, l, g, bp) = (0.399, 0.1, 0.2, 9.81, 0.0006);
        let row1 = (mc + mp) * q[m.a] + mp * l * theta.cos() * q[m.alpha]
            - mp * l * omega * theta.sin() * omega
            - force;
        let row2 =
            mp * l * theta.cos() * q[m.a] + mp * l * l * q[m.alpha] + bp * omega + mp * g * l * theta.sin();
        assert!(row1.abs() < 1e-14 && row2.abs() < 1e-14, "{row1} {row2}");
    }

    #[test]
    fn external_loads_enter_as_force_and_torque() {
        // Pole horizontal: H is diagonal, so each load moves its own coordinate only.
        let (model, table) = Table::of::<CartPole>();
        let mut q = table.start_values(Interface::ModelExchange);
        q[model.theta] = std::f64::consts::FRAC_PI_2;
        q[model.F_ext] = 2.0;
        q[model.tau_ext] = 0.1 * 9.81 * 0.2 + 0.004; // carries the pole and turns it
        model.equations(&mut q).expect("the mass matrix is regular");
        assert!((q[model.a] - 2.0 / 0.499).abs() < 1e-12);
        assert!((q[model.alpha] - 0.004 / (0.1 * 0.2 * 0.2)).abs() < 1e-12);
    }

    #[test]
    fn right_hand_side_has_the_published_value() {
        // f([0.01, 0.5, 0.1, -1, 2, 3], 10) of the swing-up statement; the forces are those of eq. 6-8, 10, 11.
        let v: f64 = 0.1;
        let friction =
            1.5145 * (40.8926 * v).tanh() + 49.2734 * v + 5.7910 * (63.7045 * (v - 0.0064)).tanh() - 2.3170;
        let (m, q) = at([0.5, v, -1.0], 3.0 + 0.0764 * 10.0 - friction);
        assert!((q[m.a] + 13.581567750692567).abs() < 1e-12, "{}", q[m.a]);
        assert!((q[m.alpha] - 36.228912437166095).abs() < 1e-12, "{}", q[m.alpha]);
    }

    #[test]
    fn energy_is_conserved_without_damping() {
        let (model, table) = Table::of::<CartPole>();
        let mut q = table.start_values(Interface::ModelExchange);
        q[model.b_p] = 0.0;
        let handles = [model.theta, model.v, model.omega];
        let rates = [model.der_theta, model.a, model.alpha];
        let mut s = [2.5, 0.2, 1.0];
        let mut rate = |s: [f64; 3]| {
            handles.iter().zip(s).for_each(|(h, s)| q[*h] = s);
            model.equations(&mut q).expect("the mass matrix is regular");
            (rates.map(|r| q[r]), q[model.energy])
        };
        let energy0 = rate(s).1;
        let h = 1e-3;
        for _ in 0..2000 {
            let axpy = |k: [f64; 3], f: f64| std::array::from_fn(|i| s[i] + f * k[i]);
            let k1 = rate(s).0;
            let k2 = rate(axpy(k1, h / 2.0)).0;
            let k3 = rate(axpy(k2, h / 2.0)).0;
            let k4 = rate(axpy(k3, h)).0;
            s = std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        let drift = (rate(s).1 - energy0).abs();
        assert!(energy0 > 0.3 && drift < 1e-9, "{energy0} {drift}"); // RK4 at 1 ms: 1e-10 over 2 s
    }
}
