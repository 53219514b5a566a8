//! Chamber pressures for a force command (paper eq. 3) and the force of measured pressures (eq. 5).

use fmi_export::{Boolean, Real, Scalar, Table, Values};

/// `p1 = (F_eq + u/2) / S1`, `p2 = (F_eq - u/2) / S2` (eq. 3), within what the supply gives;
/// `F_hat = S1 p1 - S2 p2` (eq. 5).
#[allow(non_snake_case)]
pub struct Pressure {
    p1_measured: Real,
    p2_measured: Real,
    p1: Real,
    p2: Real,
    saturated: Boolean,
    F_hat_measured: Real,
    S1: Real,
    S2: Real,
    pub(super) F_eq: Real,
    supply_pressure: Real,
    F_eq_used: Real,
}

/// Area of a bore of 20 mm \[m²\]; the rod is neglected.
const AREA: f64 = std::f64::consts::PI * 0.01 * 0.01;
/// Supply pressure of the paper's experiments \[Pa\].
const SUPPLY: f64 = 0.5e6;
/// Smallest area \[m²\].
const MIN_AREA: f64 = 1e-9;

/// The two inputs, declared with the inputs of the actuator.
pub fn declare_inputs(t: &mut Table) -> [Real; 2] {
    [("p1_measured", "measured pressure of chamber 1"), ("p2_measured", "measured pressure of chamber 2")]
        .map(|(name, about)| t.input(name).unit("Pa").about(about).nominal(1e5).real(0.0))
}

impl Pressure {
    /// Declares outputs and parameters.
    pub fn declare(t: &mut Table, [p1_measured, p2_measured]: [Real; 2]) -> Self {
        let pressure = |t: &mut Table, name: &'static str, about: &'static str| {
            t.output(name).unit("Pa").about(about).nominal(1e5).computed()
        };
        let area = |t: &mut Table, name: &'static str, about: &'static str| {
            t.parameter(name).unit("m2").about(about).min(MIN_AREA).nominal(3e-4).real(AREA)
        };
        Self {
            p1_measured,
            p2_measured,
            p1: pressure(t, "p1", "pressure command of chamber 1, within 0 .. supply_pressure"),
            p2: pressure(t, "p2", "pressure command of chamber 2, within 0 .. supply_pressure"),
            saturated: t.output("saturated").about("true where p1 or p2 is limited").computed_boolean(),
            F_hat_measured: t
                .output("F_hat_measured")
                .unit("N")
                .about("force of the measured pressures")
                .nominal(100.0)
                .computed(),
            S1: area(t, "S1", "sectional area of chamber 1"),
            S2: area(t, "S2", "sectional area of chamber 2"),
            F_eq: t
                .parameter("F_eq")
                .unit("N")
                .about("bias force; 0: half the supply pressure times the mean of S1 and S2")
                .min(0.0)
                .nominal(100.0)
                .real(0.0),
            supply_pressure: t
                .parameter("supply_pressure")
                .unit("Pa")
                .about("supply pressure")
                .min(0.0)
                .nominal(1e5)
                .real(SUPPLY),
            F_eq_used: t
                .calculated("F_eq_used")
                .unit("N")
                .about("bias force in use")
                .nominal(100.0)
                .computed(),
        }
    }

    /// Fills the calculated parameter.
    #[allow(non_snake_case)]
    pub fn prepare<S: Scalar>(&self, q: &mut Values<S>) {
        let (S1, S2) = (q[self.S1], q[self.S2]);
        let medial = q[self.supply_pressure] * 0.5;
        q[self.F_eq_used] = if q[self.F_eq].value() == 0.0 { medial * (S1 + S2) * 0.5 } else { q[self.F_eq] };
    }

    /// Eq. 3 and 5.
    #[allow(non_snake_case)]
    pub fn equations<S: Scalar>(&self, q: &mut Values<S>, u: S) {
        let (S1, S2, F_eq) = (q[self.S1], q[self.S2], q[self.F_eq_used]);
        let p1 = (F_eq + u * 0.5) / S1; // eq. 3
        let p2 = (F_eq - u * 0.5) / S2; // eq. 3
        let limited = |p: S| p.clamp_to(S::zero(), q[self.supply_pressure]);
        let (p1_limited, p2_limited) = (limited(p1), limited(p2));
        q[self.saturated] = p1_limited.value() != p1.value() || p2_limited.value() != p2.value();
        q[self.p1] = p1_limited;
        q[self.p2] = p2_limited;
        q[self.F_hat_measured] = S1 * q[self.p1_measured] - S2 * q[self.p2_measured]; // eq. 5
    }
}

#[cfg(test)]
mod tests {
    use crate::ArxActuator;
    use fmi_export::{Interface, Model, Table, Values};

    fn at(model: &ArxActuator, table: &Table, u: f64) -> Values<f64> {
        let mut q = table.start_values(Interface::CoSimulation);
        q[model.u] = u;
        model.prepare(&mut q).expect("the start values are legal");
        model.equations(&mut q).expect("the start values are legal");
        q
    }

    #[test]
    fn pressures_give_the_command_back_as_force() {
        let (model, table) = Table::of::<ArxActuator>();
        let p = &model.pressure;
        let q = at(&model, &table, 100.0);
        assert!(!q[p.saturated]);
        assert!((q[p.S1] * q[p.p1] - q[p.S2] * q[p.p2] - 100.0).abs() < 1e-10); // eq. 5 of eq. 3
        assert!((q[p.p1] + q[p.p2] - 0.5e6).abs() < 1e-6); // symmetric about 0.25 MPa
    }

    #[test]
    fn command_saturates_at_the_force_of_the_full_supply() {
        // 0.5 MPa on a bore of 20 mm: 157.08 N.
        let (model, table) = Table::of::<ArxActuator>();
        let p = &model.pressure;
        assert!(!at(&model, &table, 157.0)[p.saturated]);
        let q = at(&model, &table, 157.2);
        assert!(q[p.saturated]);
        assert_eq!((q[p.p1], q[p.p2]), (0.5e6, 0.0));
    }
}
