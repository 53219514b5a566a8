//! Force of the chamber pressures on a piston (paper eq. 5).

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// `F = S1 p1 - S2 p2` (paper eq. 5).
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `p1`, `p2` | Pa | gauge pressures of the chambers |
/// | `F` | N | force on the piston, positive out of chamber 1 |
/// | `S1`, `S2` | m² | areas of the piston in the chambers |
#[allow(non_snake_case)]
pub struct PistonForce {
    p1: Real,
    p2: Real,
    F: Real,
    S1: Real,
    S2: Real,
}

impl Model for PistonForce {
    const IDENTITY: Identity = Identity {
        model_identifier: "piston_force",
        model_name: "piston-force",
        description: "Force of the chamber pressures on a piston: F = S1 p1 - S2 p2",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        let pressure = |t: &mut Table, name: &'static str, about: &'static str| {
            t.input(name).unit("Pa").about(about).nominal(1e5).real(0.0)
        };
        let p1 = pressure(t, "p1", "gauge pressure of chamber 1");
        let p2 = pressure(t, "p2", "gauge pressure of chamber 2");
        let area = |t: &mut Table, name: &'static str, about: &'static str, start: f64| {
            t.parameter(name).unit("m2").about(about).min(0.0).nominal(1e-3).real(start)
        };
        Self {
            p1,
            p2,
            F: t.output("F").unit("N").about("force of the pressures").nominal(10.0).computed(),
            S1: area(t, "S1", "area of the piston in chamber 1", 5e-4),
            S2: area(t, "S2", "area of the piston in chamber 2", 5e-4),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        q[self.F] = q[self.S1] * q[self.p1] - q[self.S2] * q[self.p2]; // eq. 5
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    #[test]
    fn each_pressure_acts_on_its_own_area() {
        let (model, table) = Table::of::<PistonForce>();
        let mut q = table.start_values(Interface::ModelExchange);
        (q[model.p1], q[model.p2], q[model.S1], q[model.S2]) = (2e5, 1e5, 4e-4, 3e-4);
        model.equations(&mut q).expect("it has a value everywhere");
        assert!((q[model.F] - 50.0).abs() < 1e-12);
    }
}
