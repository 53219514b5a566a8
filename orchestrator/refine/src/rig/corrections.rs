//! Declared parameters that may be slightly off, and how well each is known.

use std::collections::BTreeMap;

use super::catalog::{Scope, free};
use super::cylinder::{Cylinder, Stated};
use super::parameters::*;
use crate::case::{Declared, Friction, Kind};
use crate::engine::fit::Free;

/// A declared parameter that may be off.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Component and parameter, as in `[tolerance]` of a case.
    pub path: &'static str,
    /// Index of its correction in the parameter vector.
    pub index: usize,
    /// Standard deviation where a case states none: relative to the value, of poles absolute. `None`: only corrected
    /// where the records are explained to the noise.
    pub tolerance: Option<f64>,
    /// Effect of the vocabulary that changes the same, with its parameter.
    pub effect: Option<(&'static str, &'static str)>,
}

const fn entry(
    path: &'static str,
    index: usize,
    tolerance: f64,
    effect: Option<(&'static str, &'static str)>,
) -> Entry {
    Entry { path, index, tolerance: Some(tolerance), effect }
}

/// A dimension of the cylinder that takes the place of a declared actuator; its tolerance depends on the case.
const fn dimension(path: &'static str, index: usize) -> Entry {
    Entry { path, index, tolerance: None, effect: None }
}

/// Path of the bias of the cart friction, whose tolerance counts from the Coulomb level beside it.
const BIAS: &str = "cart_friction.c5";

/// Every declared parameter that may be off.
pub const TABLE: &[Entry] = &[
    entry("actuator.gain", D_ACT_GAIN, 0.01, Some(("act.gain", "gain"))),
    entry("actuator.poles", D_ACT_DECAY, 1e-4, None),
    entry("actuator.spread", D_ACT_TURN, 1e-4, None),
    entry("piston_friction.c1", D_PF_C1, 0.03, Some(("pf.coulomb", "force"))),
    entry("piston_friction.c2", D_PF_C2, 0.1, None),
    entry("piston_friction.c4", D_PF_C4, 0.03, Some(("pf.viscous", "coef"))),
    entry("cart_friction.c1", D_CF_C1, 0.03, Some(("cf.coulomb", "force"))),
    entry("cart_friction.c2", D_CF_C2, 0.1, None),
    Entry { path: "cart_friction.c3", index: D_CF_C3, tolerance: None, effect: None },
    entry(BIAS, D_CF_C5, 0.03, Some(("cf.offset", "value"))),
    entry("cart_pole.m_c", D_M_C, 0.01, Some(("cart.mass", "mass"))),
    entry("cart_pole.m_p", D_M_P, 0.01, None),
    entry("cart_pole.l", D_L, 0.01, Some(("pole.length", "delta"))),
    entry("cart_pole.b_p", D_B_P, 0.03, Some(("pole.viscous", "coef"))),
    dimension("cylinder.bore", D_CYL_BORE),
    dimension("cylinder.rod", D_CYL_ROD),
    dimension("cylinder.stroke", D_CYL_STROKE),
    dimension("cylinder.dead", D_CYL_DEAD),
    dimension("cylinder.psup", D_CYL_PSUP),
    dimension("cylinder.Avmax", D_CYL_AVMAX),
    dimension("cylinder.Kp", D_CYL_KP),
    dimension("cylinder.vhys", D_CYL_VHYS),
    dimension("cylinder.Vt", D_CYL_VT),
    dimension("cylinder.At", D_CYL_AT),
    dimension("cylinder.tdelay", D_CYL_TDELAY),
    dimension("cylinder.eta", D_CYL_ETA),
];

/// Standard deviation of declared parameters where records are explained to the noise and the case states none.
const DECLARED_SHARE: f64 = 0.01;

/// Relative standard deviation of a dimension of the cylinder that a case states, and of one that it leaves to the
/// values of the FMU.
const TOLERANCES_OF_DIMENSIONS: (f64, f64) = (0.02, 0.3);

/// A declared parameter of a case that may be off.
#[derive(Debug, Clone)]
pub struct Correction {
    /// Entry of the table.
    pub entry: Entry,
    /// Declared value; 1 for the gain of the actuator, the poles' own for poles.
    pub declared: f64,
    /// One standard deviation, relative to the value (of poles absolute), where only a share of the error is sought.
    pub tolerance: Option<f64>,
    /// Whether the case states it.
    pub stated: bool,
}

impl Correction {
    /// Whether the correction is added to the declared value, not multiplied with it.
    pub fn absolute(&self) -> bool {
        [D_ACT_DECAY, D_ACT_TURN].contains(&self.entry.index)
    }

    /// Whether it is a dimension of the cylinder that takes the place of the declared actuator.
    pub fn of_cylinder(&self) -> bool {
        self.component() == "cylinder"
    }

    /// Whether the actuator of the parameter vector `p`, the declared one or a cylinder, knows it.
    pub fn is_known(&self, p: &[f64]) -> bool {
        match self.component() {
            "actuator" => p[CYLINDER] == 0.0,
            "cylinder" => p[CYLINDER] != 0.0,
            _ => true,
        }
    }

    /// Free parameter of a search that explains the records to the noise.
    pub fn exact(&self) -> Free {
        let share = match self.tolerance {
            Some(own) if self.absolute() || self.of_cylinder() => own,
            _ if self.absolute() => 1e-4,
            _ => DECLARED_SHARE,
        };
        let prior = if self.stated { self.tolerance.unwrap_or(share) } else { share };
        Free { prior: Some(prior), ..free(self.entry.index) }
    }

    /// Free parameter of a search for a share of the error, up to `most` standard deviations.
    pub fn bounded(&self, most: f64) -> Option<Free> {
        let tolerance = self.tolerance?;
        let own = free(self.entry.index);
        let bounds = (own.bounds.0.max(-most * tolerance), own.bounds.1.min(most * tolerance));
        Some(Free { prior: Some(tolerance), bounds, step: own.step.min(0.1 * tolerance), ..own })
    }

    /// Corrected value for a correction `moved`.
    pub fn value(&self, moved: f64) -> f64 {
        if self.absolute() { self.declared + moved } else { self.declared * (1.0 + moved) }
    }

    /// Component of the path.
    pub fn component(&self) -> &'static str {
        self.entry.path.split('.').next().unwrap_or_default()
    }

    /// Parameter of the path.
    pub fn parameter(&self) -> &'static str {
        self.entry.path.split('.').nth(1).unwrap_or_default()
    }
}

/// Relative standard deviation of a dimension of the cylinder where a case gives no tolerance.
fn tolerance_of_dimension(stated: &Stated, name: &str) -> f64 {
    let known = stated.named().iter().any(|(dimension, value)| *dimension == name && value.is_some());
    if known { TOLERANCES_OF_DIMENSIONS.0 } else { TOLERANCES_OF_DIMENSIONS.1 }
}

/// The cylinder with the corrections of the parameter vector `p`.
pub fn corrected(declared: &Cylinder, p: &[f64]) -> Cylinder {
    declared.map(|name, value| {
        let own = TABLE.iter().find(|entry| entry.path.strip_prefix("cylinder.") == Some(name));
        own.map_or(value, |entry| value * (1.0 + p[entry.index]))
    })
}

/// Declared value of a path.
fn declared(model: &Declared, path: &str) -> Option<f64> {
    let friction = |c: &Friction, name: &str| match name {
        "c1" => c.c1,
        "c2" => c.c2,
        "c3" => c.c3,
        "c4" => c.c4,
        _ => c.c5,
    };
    let (component, parameter) = path.split_once('.')?;
    Some(match component {
        "actuator" => {
            let [mean, spread] = model.actuator.as_ref()?.poles();
            match parameter {
                "gain" => 1.0,
                "poles" => mean,
                _ => spread,
            }
        }
        "cylinder" => {
            let named = model.cylinder.cylinder().named();
            named.into_iter().find(|(name, _)| *name == parameter)?.1
        }
        "piston_friction" => friction(model.piston_friction.as_ref()?, parameter),
        "cart_friction" => friction(model.cart_friction.as_ref()?, parameter),
        _ => {
            let body = model.cart_pole.as_ref()?;
            match parameter {
                "m_c" => body.m_c,
                "m_p" => body.m_p,
                "l" => body.l,
                _ => body.b_p,
            }
        }
    })
}

/// Declared parameters that the records of a case may show to be off; `stated`: tolerances by path.
pub fn corrections(scope: &Scope, stated: &BTreeMap<String, f64>) -> Vec<Correction> {
    let shown = |entry: &&Entry| {
        let moved = entry.index == D_M_C || entry.path.contains("friction");
        match scope.kind {
            Kind::Actuator => entry.path.starts_with("actuator"),
            Kind::Friction => moved,
            Kind::Cartpole => true,
        }
    };
    let one = |entry: &Entry| {
        let declared = declared(scope.declared, entry.path)?;
        let own = stated.get(entry.path).copied();
        let level = scope.declared.cart_friction.as_ref().map_or(0.0, |c| c.c1);
        let usual = match entry.path.strip_prefix("cylinder.") {
            Some(name) => Some(tolerance_of_dimension(&scope.declared.cylinder, name)),
            None => entry.tolerance.map(|own| {
                if entry.path == BIAS && declared != 0.0 { own * (level / declared).abs() } else { own }
            }),
        };
        let stated = own.is_some();
        Some(Correction { entry: *entry, declared, tolerance: own.or(usual), stated })
    };
    TABLE.iter().filter(shown).filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::case::Actuator;

    fn scope(declared: &Declared) -> Scope<'_> {
        let kind = Kind::Friction;
        Scope { declared, kind, signals: BTreeSet::new(), command: 0.0, positions: (0.0, 1.0) }
    }

    #[test]
    fn a_stated_tolerance_takes_the_place_of_the_usual_one() {
        let cart = Friction { c1: 6.0, c5: -2.0, ..Friction::default() };
        let declared = Declared { cart_friction: Some(cart), ..Declared::default() };
        let tolerance = |stated: &BTreeMap<String, f64>, path: &str| {
            let all = corrections(&scope(&declared), stated);
            all.iter().find(|c| c.entry.path == path).and_then(|c| c.tolerance).unwrap()
        };
        assert_eq!(tolerance(&BTreeMap::new(), "cart_friction.c1"), 0.03);
        // 3 % of the level of 6 N are 9 % of the bias of 2 N.
        assert!((tolerance(&BTreeMap::new(), "cart_friction.c5") - 0.09).abs() < 1e-12);
        let stated = BTreeMap::from([("cart_friction.c1".to_owned(), 0.2)]);
        assert_eq!(tolerance(&stated, "cart_friction.c1"), 0.2);
    }

    #[test]
    fn poles_move_and_the_static_gain_stays() {
        let actuator = Actuator {
            sample_time: 1e-3,
            A1: [[-1.0144, 0.0216], [-0.0527, -0.9537]],
            B0: [0.6619, 0.0764],
            B1: [-0.6557, -0.0847],
        };
        let gain = |a: &Actuator| {
            let matrix = nalgebra::Matrix2::from_fn(|i, j| f64::from(i == j) + a.A1[i][j]);
            let b = nalgebra::Vector2::from_fn(|i, _| a.B0[i] + a.B1[i]);
            matrix.try_inverse().unwrap() * b
        };
        let moved = actuator.moved(0.02, -1e-4, 2e-4);
        let ([mean, spread], [new_mean, new_spread]) = (actuator.poles(), moved.poles());
        assert!((new_mean - mean + 1e-4).abs() < 1e-12 && (new_spread - spread - 2e-4).abs() < 1e-9);
        let ratio = gain(&moved).component_div(&gain(&actuator));
        assert!(ratio.iter().all(|r| (r - 1.02).abs() < 1e-9), "{ratio}");
        assert_eq!(actuator.moved(0.0, 0.0, 0.0).A1, actuator.A1);
    }
}
