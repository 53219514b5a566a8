//! Effects of the program in words and, where a formula can say them, as the files that effects of one's own are.
//!
//! Formulas say what [`crate::study::law::Law`] computes. In a search, friction at a channel changes its sign over the
//! `vt` of the attachment, and a constant and a phase are found as linear terms.

use super::own::Own;

/// An effect of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Builtin {
    /// Kind: the id of the vocabulary behind its channel.
    pub kind: &'static str,
    /// Ports where it is looked for.
    pub ports: &'static str,
    /// Description in words.
    pub words: &'static str,
    /// TOML text, where a formula can say it.
    pub toml: Option<&'static str>,
}

impl Builtin {
    /// The effect of a kind as a formula, where it has one.
    pub fn formula(kind: &str) -> Option<Own> {
        BUILTIN.iter().find(|own| own.kind == kind).and_then(Builtin::own)
    }

    /// The effect as a formula, where there is one.
    pub fn own(&self) -> Option<Own> {
        // The texts are part of the program; a test reads them all.
        self.toml.and_then(|text| Own::read(text).ok())
    }
}

const fn builtin(
    kind: &'static str,
    ports: &'static str,
    words: &'static str,
    toml: Option<&'static str>,
) -> Builtin {
    Builtin { kind, ports, words, toml }
}

macro_rules! text {
    ($kind:literal) => {
        Some(include_str!(concat!("builtin/", $kind, ".toml")))
    };
}

/// The list.
pub const BUILTIN: &[Builtin] = &[
    builtin("viscous", "force, torque", "viscous friction", text!("viscous")),
    builtin("coulomb", "force, torque", "Coulomb friction", text!("coulomb")),
    builtin("stribeck", "force, torque", "friction peak at low speed", text!("stribeck")),
    builtin(
        "presliding",
        "force, torque",
        "Coulomb friction that is a spring before it slides",
        text!("presliding"),
    ),
    builtin("asymmetry", "force, torque", "friction of one direction", text!("asymmetry")),
    builtin("poscoulomb", "force, torque", "friction that varies along the guide", text!("poscoulomb")),
    builtin(
        "periodic_friction",
        "force, torque",
        "friction that repeats along the way",
        text!("periodic_friction"),
    ),
    builtin("load_friction", "force, torque", "friction in proportion to the load", text!("load_friction")),
    builtin("pressure", "force, torque", "friction in proportion to the pressure force", None),
    builtin("quaddrag", "force, torque", "drag of air or liquid", text!("quaddrag")),
    builtin("spring", "force, torque", "spring", text!("spring")),
    builtin("cubic_spring", "force, torque", "spring that stiffens", text!("cubic_spring")),
    builtin("endstop", "force, torque", "end stop", text!("endstop")),
    builtin("lower_endstop", "force, torque", "end stop at the lower end", text!("lower_endstop")),
    builtin("cogging", "force, torque", "force that repeats along the guide", text!("cogging")),
    builtin("area", "force", "force of a chamber pressure on an area that the model lacks", None),
    builtin("offset", "any", "constant that is added", None),
    builtin("resistance", "voltage", "resistance in the way of a current", text!("resistance")),
    builtin("voltage_drop", "voltage", "voltage lost at brushes or diodes", text!("voltage_drop")),
    builtin("linear_leakage", "flow", "leak in proportion to the level", text!("linear_leakage")),
    builtin("leakage", "flow", "leak through an opening at the bottom", text!("leakage")),
    builtin("overflow", "flow", "overflow above a level", text!("overflow")),
    builtin(
        "caught_overflow",
        "flow",
        "overflow above a level, coef*max(0, x - level), of which the level that it drains into gets the share caught",
        None,
    ),
    builtin(
        "choked_flow",
        "flow",
        "leak of a gas, choked below a ratio of pressures of 0.528 (ISO 6358)",
        text!("choked_flow"),
    ),
    builtin("drift", "any", "constant that grows with time", text!("drift")),
    builtin("gain", "command, signal", "gain error", text!("gain")),
    builtin("deadband", "command, signal", "dead band", text!("deadband")),
    builtin("saturation", "command, signal", "limit", text!("saturation")),
    builtin("limits", "command, signal", "a limit for each direction", text!("limits")),
    builtin("quantization", "command, signal", "value in steps", text!("quantization")),
    builtin("posgain", "command, signal", "gain that varies with position", text!("posgain")),
    builtin("droop", "command, signal", "gain that falls with time", text!("droop")),
    builtin("delay", "command, signal", "the value some time before", None),
    builtin(
        "hysteresis",
        "command, signal",
        "play: the value moves only behind a width on either side",
        None,
    ),
    builtin("rate_limit", "command, signal", "the value follows at a limited rate", None),
    builtin("lag", "command, signal", "first-order lag", text!("lag")),
    builtin("fill", "command, signal", "lag with a time constant upwards and one downwards", text!("fill")),
    builtin("mode", "command, signal", "second-order lag: a resonance", text!("mode")),
    builtin("sensor.quantization", "sensor", "resolution of the sensor", text!("sensor_quantization")),
    builtin("sensor.offset", "sensor", "constant that the sensor adds", None),
    builtin("sensor.gain", "sensor", "gain of the sensor", None),
    builtin("sensor.delay", "sensor", "the sensor shows the value some time before", None),
    builtin("sensor.lag", "sensor", "first-order lag of the sensor", None),
    builtin("sensor.drift", "sensor", "zero of the sensor that moves with time", text!("sensor_drift")),
    builtin(
        "sensor.nonlinearity",
        "sensor",
        "curved characteristic of the sensor",
        text!("sensor_nonlinearity"),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::kinds;
    use crate::study::law::{Law, Point};

    /// Kind, law, parameters of the formula by name, parameters of the law.
    type Same = (&'static str, Law, &'static [(&'static str, f64)], &'static [f64]);

    /// Value of a formula with these parameters by name.
    fn value(kind: &str, parameters: &[(&str, f64)], at: &Point, z: f64) -> f64 {
        let own = BUILTIN.iter().find(|own| own.kind == kind).and_then(Builtin::own);
        let own = own.unwrap_or_else(|| panic!("no {kind}"));
        let of = |name: &String| parameters.iter().find(|own| own.0 == name).map_or(f64::NAN, |own| own.1);
        let p: Vec<f64> = own.parameters.iter().map(|own| of(&own.name)).collect();
        own.value(at.variables(), &[z, 0.0], &p)
    }

    #[test]
    fn every_text_is_an_effect_under_its_own_name() {
        for own in BUILTIN {
            if let Some(text) = own.toml {
                let read = Own::read(text).unwrap_or_else(|problem| panic!("{}: {problem}", own.kind));
                assert_eq!((read.kind, read.words.as_str()), (own.kind.replace('.', "_"), own.words));
            }
        }
    }

    #[test]
    fn every_kind_that_is_looked_for_is_in_the_list() {
        let channels = kinds::CHANNELS.map(str::to_owned);
        let of_channels = kinds::ids(&channels).into_iter().map(|id| id.split_once('.').unwrap().1);
        for kind in kinds::kinds_of_ports().into_iter().chain(of_channels) {
            assert!(BUILTIN.iter().any(|own| own.kind == kind), "{kind}");
        }
    }

    #[test]
    fn formulas_are_the_laws_of_the_search() {
        let laws: [Same; 28] = [
            (
                "lower_endstop",
                Law::LowerStop,
                &[("stiffness", 500.0), ("damping", 30.0), ("pos", 0.02)],
                &[500.0, 30.0, 0.02],
            ),
            ("limits", Law::Limits, &[("low", -0.4), ("high", 1.2)], &[-0.4, 1.2]),
            ("choked_flow", Law::Choked, &[("coef", 0.2), ("outside", 0.03)], &[0.2, 0.03]),
            ("viscous", Law::Viscous, &[("coef", 3.0)], &[3.0]),
            ("coulomb", Law::Coulomb, &[("force", 2.0), ("vt", 0.01)], &[2.0]),
            ("stribeck", Law::Stribeck, &[("force", 1.5), ("vs", 0.06), ("vt", 0.01)], &[1.5, 0.06]),
            ("presliding", Law::Presliding, &[("disp", 1e-3), ("level", 2.5), ("vt", 0.01)], &[1e-3]),
            ("asymmetry", Law::Asymmetry, &[("force", 1.1), ("coef", 4.0), ("vt", 0.01)], &[1.1, 4.0]),
            ("poscoulomb", Law::PositionCoulomb, &[("slope", 9.0), ("vt", 0.01)], &[9.0]),
            (
                "periodic_friction",
                Law::PeriodicCoulomb,
                &[("amp", 0.5), ("period", 0.04), ("phase", 0.927_295_218_001_612_2), ("vt", 0.01)],
                &[0.3, 0.4, 0.04],
            ),
            ("load_friction", Law::Load, &[("coef", 0.2), ("vt", 0.01)], &[0.2]),
            ("resistance", Law::Viscous, &[("coef", 3.0)], &[3.0]),
            ("voltage_drop", Law::Coulomb, &[("drop", 2.0), ("vt", 0.01)], &[2.0]),
            ("quaddrag", Law::Drag, &[("coef", 0.4)], &[0.4]),
            ("spring", Law::Spring, &[("stiffness", 20.0), ("rest", 0.03)], &[20.0, -0.6]),
            ("cubic_spring", Law::CubicSpring, &[("stiffness", 70.0), ("rest", 0.03)], &[70.0, 0.03]),
            (
                "endstop",
                Law::EndStop,
                &[("stiffness", 500.0), ("damping", 30.0), ("pos", 0.02)],
                &[500.0, 30.0, 0.02],
            ),
            (
                "cogging",
                Law::Cogging,
                &[("amp", 0.5), ("period", 0.04), ("phase", 0.927_295_218_001_612_2)],
                &[0.3, 0.4, 0.04],
            ),
            ("linear_leakage", Law::Leakage, &[("coef", 0.2)], &[0.2]),
            ("leakage", Law::Outlet, &[("coef", 0.2)], &[0.2]),
            ("overflow", Law::Overflow, &[("coef", 0.2), ("level", 0.01)], &[0.2, 0.01]),
            ("drift", Law::Drift, &[("slope", 0.2)], &[0.2]),
            ("gain", Law::Gain, &[("gain", 0.1)], &[0.1]),
            ("deadband", Law::DeadBand, &[("width", 0.5)], &[0.5]),
            ("saturation", Law::Saturation, &[("limit", 1.2)], &[1.2]),
            ("quantization", Law::Quantization, &[("step", 0.3)], &[0.3]),
            ("posgain", Law::PositionGain, &[("slope", 0.8)], &[0.8]),
            ("droop", Law::Droop, &[("depth", 0.3), ("tau", 2.0)], &[0.3, 2.0]),
        ];
        for k in 0..40 {
            let k = f64::from(k);
            let at = Point {
                velocity: 0.2 * (1.3 * k).sin(),
                position: 0.1 * (0.7 * k).cos(),
                value: 2.0 * (2.1 * k).sin(),
                time: 0.1 * k,
                ..Point::default()
            };
            let s = (at.velocity / 0.01).tanh();
            for (kind, law, parameters, p) in laws {
                let expected = if law.changes_command() {
                    law.command(p, &at, at.value)
                } else {
                    law.force(p, &at, s, 4e-4, 2.5)
                };
                let found = value(kind, parameters, &at, 4e-4);
                let most = 1e-12 * expected.abs().max(1.0);
                assert!((found - expected).abs() < most, "{kind}: {found} {expected}");
            }
        }
    }
}
