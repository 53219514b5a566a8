//! `[verification.balance]`: forces of constraints that are recomputed from the energy.

use schemars::JsonSchema;
use serde::Deserialize;

use super::value::{Entries, Text};

/// Forces of constraints that are recomputed from the energy by Lagrange's equations.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Balance {
    /// Energy: kinetic, quadratic in the rates, and potential.
    pub energy: Text,
    /// Coordinates and their rates, both states.
    pub coordinates: Entries<Text>,
    /// Drives of the system: a variable, and the coordinates along which it pushes, by how much per unit.
    pub drives: Entries<Entries<f64>>,
    /// Forces, and the coordinate of the point on which each acts, along the force.
    pub forces: Entries<Text>,
}
