//! The list of all models; nothing else lists them.

use crate::arx_actuator::{self, ArxActuator, FirstOrder};
use crate::cart_pole::CartPole;
use crate::compass_gait::CompassGait;
use crate::effect::{ExpressionEffect, ForceEffect, PortEffect, SensorEffect, SignalEffect, TorqueEffect};
use crate::friction::{self, Friction};
use crate::linear_state_space::LinearStateSpace;
use crate::pendulum::Pendulum;
use crate::piston_force::PistonForce;
use crate::pneumatic_cylinder::PneumaticCylinder;
use crate::rigid_mass::RigidMass;
use crate::testing::{AllTypes, BouncingBall, Copy};
use crate::tvlqr_controller::TvlqrController;
use fmi_export::{Definition, Identity, Model, Table};

/// One model and what its FMU holds besides the library.
pub struct Entry {
    /// Names and default experiment.
    pub identity: Identity,
    /// Cargo package of the library.
    pub package: &'static str,
    /// False for the FMUs of the tests.
    pub shipped: bool,
    /// Equations, variables and limits in Markdown.
    pub readme: &'static str,
    /// Parameter sets in addition to the start values; files `resources/<name>.ssv`.
    pub parameter_sets: Vec<ParameterSet>,
    /// Further files under `resources/`: name and content.
    pub resources: &'static [(&'static str, &'static str)],
    /// Declares the variables.
    pub table: fn() -> Table,
    /// Writes `modelDescription.xml`; takes its time, since dependencies are searched for.
    pub xml: fn() -> String,
    /// The same for FMI 3.0.
    pub xml_fmi3: fn() -> String,
}

/// Values of Real parameters under a name.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSet {
    /// Name of the set and of its file.
    pub name: &'static str,
    /// One line.
    pub description: &'static str,
    /// Parameter and value, in the parameter's unit.
    pub values: Vec<(String, f64)>,
}

/// All models, the shipped ones first.
pub fn all() -> Vec<Entry> {
    vec![
        Entry {
            parameter_sets: vec![
                first_order("cart_pole", "actuator of the cart-pole (eq. 8)", arx_actuator::CART_POLE),
                first_order("toe", "toe of the walker (eq. 12)", arx_actuator::TOE),
            ],
            ..entry::<ArxActuator>("fmu-arx-actuator", true, include_str!("../../arx-actuator/README.md"))
        },
        Entry {
            parameter_sets: vec![
                coefficients("piston", "piston in its cylinder (eq. 10)", friction::PISTON),
                coefficients("cart", "cart on its guide (eq. 11)", friction::CART),
            ],
            ..entry::<Friction>("fmu-friction", true, include_str!("../../friction/README.md"))
        },
        entry::<CartPole>("fmu-cart-pole", true, include_str!("../../cart-pole/README.md")),
        entry::<LinearStateSpace>(
            "fmu-linear-state-space",
            true,
            include_str!("../../linear-state-space/README.md"),
        ),
        entry::<PneumaticCylinder>(
            "fmu-pneumatic-cylinder",
            true,
            include_str!("../../pneumatic-cylinder/README.md"),
        ),
        entry::<CompassGait>("fmu-compass-gait", true, include_str!("../../compass-gait/README.md")),
        entry::<RigidMass>("fmu-rigid-mass", true, include_str!("../../rigid-mass/README.md")),
        entry::<Pendulum>("fmu-pendulum", true, include_str!("../../pendulum/README.md")),
        entry::<PistonForce>("fmu-piston-force", true, include_str!("../../piston-force/README.md")),
        entry::<ForceEffect>("fmu-force-effect", true, include_str!("../../force-effect/README.md")),
        entry::<TorqueEffect>("fmu-torque-effect", true, include_str!("../../torque-effect/README.md")),
        entry::<PortEffect>("fmu-port-effect", true, include_str!("../../port-effect/README.md")),
        entry::<SignalEffect>("fmu-signal-effect", true, include_str!("../../signal-effect/README.md")),
        entry::<SensorEffect>("fmu-sensor-effect", true, include_str!("../../sensor-effect/README.md")),
        entry::<ExpressionEffect>(
            "fmu-expression-effect",
            true,
            include_str!("../../expression-effect/README.md"),
        ),
        Entry {
            resources: &[("controller.csv", include_str!("../../tvlqr-controller/example.csv"))],
            ..entry::<TvlqrController>(
                "fmu-tvlqr-controller",
                true,
                include_str!("../../tvlqr-controller/README.md"),
            )
        },
        entry::<Copy>("fmu-test-copy", false, include_str!("../../test-copy/README.md")),
        entry::<BouncingBall>(
            "fmu-test-bouncing-ball",
            false,
            include_str!("../../test-bouncing-ball/README.md"),
        ),
        Entry {
            resources: &[("message.txt", "All types, and <markup> & \"quotes\".\n")],
            ..entry::<AllTypes>("fmu-test-all-types", false, include_str!("../../test-all-types/README.md"))
        },
    ]
}

fn entry<M: Model>(package: &'static str, shipped: bool, readme: &'static str) -> Entry {
    Entry {
        identity: M::IDENTITY,
        package,
        shipped,
        readme,
        parameter_sets: Vec::new(),
        resources: &[],
        table: || Table::of::<M>().1,
        xml: || Definition::<M>::new().xml(),
        xml_fmi3: || Definition::<M>::new().xml_fmi3(),
    }
}

fn first_order(name: &'static str, description: &'static str, (a1, b0, b1): FirstOrder) -> ParameterSet {
    let mut values = Vec::new();
    for (j, row) in a1.iter().enumerate() {
        values.extend(row.iter().enumerate().map(|(l, a)| (format!("A1[{},{}]", j + 1, l + 1), *a)));
    }
    for (i, b) in [b0, b1].iter().enumerate() {
        values.extend(b.iter().enumerate().map(|(j, b)| (format!("B{i}[{}]", j + 1), *b)));
    }
    ParameterSet { name, description, values }
}

fn coefficients(name: &'static str, description: &'static str, c: [f64; 5]) -> ParameterSet {
    let values = c.iter().enumerate().map(|(i, c)| (format!("c{}", i + 1), *c)).collect();
    ParameterSet { name, description, values }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::{Causality, Kind};

    #[test]
    fn parameter_sets_name_real_parameters_of_their_model() {
        for entry in all() {
            let table = (entry.table)();
            for (name, _) in entry.parameter_sets.iter().flat_map(|set| &set.values) {
                let variable = table.by_name(name).unwrap_or_else(|| panic!("{name} is unknown"));
                assert_eq!(variable.causality, Causality::Parameter);
                assert!(matches!(variable.kind, Kind::Real { .. }), "{name}");
            }
        }
    }

    #[test]
    fn start_values_are_the_first_parameter_set() {
        for entry in all() {
            let table = (entry.table)();
            for (name, value) in entry.parameter_sets.first().iter().flat_map(|set| &set.values) {
                let kind = &table.by_name(name).expect("checked by the test above").kind;
                assert!(matches!(kind, Kind::Real { start, .. } if *start == Some(*value)), "{name}");
            }
        }
    }
}
