//! Dimensions of the cylinder that takes the place of a declared actuator: those that a case does not state are
//! fitted.

use super::cylinder::{Cylinder, Stated};
use super::parameters::*;

/// Standard deviation of a dimension that a case states, and of one that it leaves to the values of the FMU, relative.
const TOLERANCES: (f64, f64) = (0.02, 0.3);

/// Dimensions that may be off, by their name, with the index of their correction.
const TABLE: [(&str, usize); 12] = [
    ("bore", D_CYL_BORE),
    ("rod", D_CYL_ROD),
    ("stroke", D_CYL_STROKE),
    ("dead", D_CYL_DEAD),
    ("psup", D_CYL_PSUP),
    ("Avmax", D_CYL_AVMAX),
    ("Kp", D_CYL_KP),
    ("vhys", D_CYL_VHYS),
    ("Vt", D_CYL_VT),
    ("At", D_CYL_AT),
    ("tdelay", D_CYL_TDELAY),
    ("eta", D_CYL_ETA),
];

/// The cylinder with the corrections of a parameter vector.
pub fn corrected(declared: &Cylinder, p: &[f64]) -> Cylinder {
    declared.map(|name, value| {
        let own = TABLE.iter().find(|(dimension, _)| *dimension == name);
        own.map_or(value, |&(_, index)| value * (1.0 + p[index]))
    })
}

/// Relative standard deviation of a dimension where a case gives no tolerance.
pub fn tolerance(stated: &Stated, name: &str) -> f64 {
    let known = stated.named().iter().any(|(dimension, value)| *dimension == name && value.is_some());
    if known { TOLERANCES.0 } else { TOLERANCES.1 }
}
