//! `[verification.balance]`: forces of constraints that are recomputed from the energy.

use super::read::texts_of_pairs;
use super::table::{Text, Value};
use crate::Error;

/// `[verification.balance]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Balance {
    /// Energy: kinetic, quadratic in the rates, and potential.
    pub energy: Text,
    /// Coordinates (states) and their rates (states).
    pub coordinates: Vec<(Text, Text)>,
    /// Forces that drive the system: a variable, and the coordinates along which it pushes, by how much per unit.
    pub drives: Vec<(Text, Vec<(Text, f64)>)>,
    /// Forces, and the coordinate of the point on which each acts, along the force.
    pub forces: Vec<(Text, Text)>,
}

/// Reads the section.
pub fn read(value: Value) -> Result<Balance, Error> {
    let name = "[verification.balance]";
    let table = value.table(name)?;
    let pairs = |key: &'static str| texts_of_pairs(table.need(key)?, &format!("`{key}` of {name}"));
    let drive = |(variable, value): (Text, Value)| {
        let along = value.table(&format!("what `{}` pushes", variable.text))?.entries();
        let along = along.into_iter().map(|(name, factor)| Ok((name, factor.number()?)));
        Ok((variable, along.collect::<Result<_, Error>>()?))
    };
    let drives = table.need("drives")?.table(&format!("`drives` of {name}"))?.entries();
    let balance = Balance {
        energy: table.need("energy")?.text()?,
        coordinates: pairs("coordinates")?,
        drives: drives.into_iter().map(drive).collect::<Result<_, Error>>()?,
        forces: pairs("forces")?,
    };
    table.finish()?;
    Ok(balance)
}
