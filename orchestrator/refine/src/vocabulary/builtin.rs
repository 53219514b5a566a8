//! Effects of the vocabulary that a formula can say, in the form of effects of one's own.
//!
//! Formulas use `s = tanh(v/vt)` written out, `vt` the velocity over which friction changes its sign at the attachment.

/// An effect of the vocabulary as a formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Builtin {
    /// Kind: the id of the vocabulary behind its channel.
    pub kind: &'static str,
    /// Port.
    pub port: &'static str,
    /// Formula over x, v, f, t, states and parameters.
    pub formula: &'static str,
    /// States with their rates.
    pub states: &'static str,
    /// What it is.
    pub words: &'static str,
}

const fn builtin(
    kind: &'static str,
    port: &'static str,
    formula: &'static str,
    states: &'static str,
    words: &'static str,
) -> Builtin {
    Builtin { kind, port, formula, states, words }
}

/// The list.
pub const BUILTIN: [Builtin; 17] = [
    builtin("viscous", "force, torque", "coef*v", "", "viscous friction"),
    builtin("coulomb", "force, torque", "force*tanh(v/vt)", "", "Coulomb friction"),
    builtin("stribeck", "force", "force*exp(-(v/vs)^2)*tanh(v/vt)", "", "friction peak at low speed"),
    builtin(
        "presliding",
        "force",
        "level*(z/disp - tanh(v/vt))",
        "z = v - abs(v)*z/disp",
        "Coulomb friction that is a spring before it slides",
    ),
    builtin("offset", "force, torque", "value", "", "constant force"),
    builtin(
        "asymmetry",
        "force",
        "(force*tanh(v/vt) + coef*v)*max(0, sign(v))",
        "",
        "friction of one direction",
    ),
    builtin("poscoulomb", "force", "slope*x*tanh(v/vt)", "", "friction that varies along the guide"),
    builtin("quaddrag", "torque", "coef*abs(v)*v", "", "air drag"),
    builtin("spring", "force", "stiffness*(x - rest)", "", "spring"),
    builtin(
        "endstop",
        "force",
        "max(0, sign(x - pos))*max(0, stiffness*(x - pos) + damping*v)",
        "",
        "end stop",
    ),
    builtin("cogging", "force", "amp*sin(2*pi*x/period + phase)", "", "force that repeats along the guide"),
    builtin("gain", "signal", "(1 + gain)*f", "", "gain error"),
    builtin("deadband", "signal", "f - clamp(f, -width, width)", "", "dead band"),
    builtin("saturation", "signal", "clamp(f, -limit, limit)", "", "limit"),
    builtin("posgain", "signal", "(1 + slope*x)*f", "", "gain that varies with position"),
    builtin("droop", "signal", "(1 - depth*(1 - exp(-t/tau)))*f", "", "gain that falls with time"),
    builtin("lag", "signal", "z", "z = (f - z)/tau", "first-order lag"),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::law::{Law, Point};
    use airloop_expression::Expression;

    /// Value of a built-in formula, parameters in the order of their names.
    fn value(kind: &str, names: &[&str], p: &[f64], at: &Point, z: f64) -> f64 {
        let own = BUILTIN.iter().find(|own| own.kind == kind).unwrap_or_else(|| panic!("no {kind}"));
        let all = [&["x", "v", "f", "t", "z", "vt", "level"][..], names].concat();
        let formula = Expression::parse(own.formula, &all).unwrap_or_else(|e| panic!("{kind}: {e}"));
        let known = [at.position, at.velocity, at.value, at.time, z, 0.01, 2.5];
        formula.value(&[&known[..], p].concat())
    }

    #[test]
    fn formulas_are_the_laws_of_the_search() {
        let laws: [(&str, Law, &[&str], &[f64]); 10] = [
            ("viscous", Law::Viscous, &["coef"], &[3.0]),
            ("coulomb", Law::Coulomb, &["force"], &[2.0]),
            ("stribeck", Law::Stribeck, &["force", "vs"], &[1.5, 0.06]),
            ("presliding", Law::Presliding, &["disp"], &[1e-3]),
            ("offset", Law::Offset, &["value"], &[0.7]),
            ("asymmetry", Law::Asymmetry, &["force", "coef"], &[1.1, 4.0]),
            ("poscoulomb", Law::PositionCoulomb, &["slope"], &[9.0]),
            ("quaddrag", Law::Drag, &["coef"], &[0.4]),
            ("endstop", Law::EndStop, &["stiffness", "damping", "pos"], &[500.0, 30.0, 0.02]),
            ("deadband", Law::DeadBand, &["width"], &[0.5]),
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
            for (kind, law, names, p) in laws {
                let expected = if law.changes_command() {
                    law.command(p, &at, at.value)
                } else {
                    law.force(p, &at, s, 4e-4, 2.5)
                };
                let found = value(kind, names, p, &at, 4e-4);
                assert!(
                    (found - expected).abs() < 1e-12 * expected.abs().max(1.0),
                    "{kind}: {found} {expected}"
                );
            }
            for (kind, law, names, p) in [
                ("gain", Law::Gain, ["gain", ""], [0.1, 0.0]),
                ("saturation", Law::Saturation, ["limit", ""], [1.2, 0.0]),
                ("posgain", Law::PositionGain, ["slope", ""], [0.8, 0.0]),
                ("droop", Law::Droop, ["depth", "tau"], [0.3, 2.0]),
            ] {
                let found = value(kind, &names, &p, &at, 0.0);
                assert!((found - law.command(&p, &at, at.value)).abs() < 1e-12, "{kind}");
            }
            let spring = value("spring", &["stiffness", "rest"], &[20.0, 0.03], &at, 0.0);
            assert!((spring - Law::Spring.force(&[20.0, -0.6], &at, s, 0.0, 0.0)).abs() < 1e-12);
            let (amp, phase) = (0.6, 0.3f64);
            let cogging = value("cogging", &["amp", "period", "phase"], &[amp, 0.04, phase], &at, 0.0);
            let own = Law::Cogging.force(&[amp * phase.cos(), amp * phase.sin(), 0.04], &at, s, 0.0, 0.0);
            assert!((cogging - own).abs() < 1e-12);
        }
    }
}
