//! Everything about a model that is the same for all its instances, built once per library.
//!
//! The parts come from [`Table`], [`Structure`] and [`crate::description`]; this module only ties them together
//! and gives them their fingerprint. Dependencies and model description are for the packager: no instance needs
//! them, and the search for them costs up to a second for a model with hundreds of parameters.

use crate::description;
use crate::model::Model;
use crate::structure::Structure;
use crate::table::Table;

/// The model with its variable table.
#[derive(Clone, Debug)]
pub struct Definition<M> {
    /// Handles of the variables, and the equations.
    pub model: M,
    /// The variables.
    pub table: Table,
    /// Fingerprint of the model description without its `ModelStructure`, `{8-4-4-4-12}` hexadecimal digits.
    pub guid: String,
}

impl<M: Model> Definition<M> {
    /// Declares the model.
    ///
    /// # Panics
    /// On a table that no FMU can have: an error of the model's author, found by the first test that packages the
    /// model.
    pub fn new() -> Self {
        let (model, table) = Table::of::<M>();
        let guid = fingerprint(&description::text(&M::IDENTITY, &table, &Structure::default(), ""));
        Self { model, table, guid }
    }

    /// `ModelStructure`: unknowns and what they depend on.
    ///
    /// # Panics
    /// On equations that refuse every draw of [`Model::probe`]: again an error of the model's author.
    pub fn structure(&self) -> Structure {
        Structure::of(&self.model, &self.table)
    }

    /// Text of `modelDescription.xml`.
    ///
    /// # Panics
    /// Same as [`Definition::structure`].
    pub fn xml(&self) -> String {
        description::text(&M::IDENTITY, &self.table, &self.structure(), &self.guid)
    }

    /// Text of `modelDescription.xml` of FMI 3.0; its instantiation token is the GUID.
    ///
    /// # Panics
    /// Same as [`Definition::structure`].
    pub fn xml_fmi3(&self) -> String {
        crate::fmi3::text(&M::IDENTITY, &self.table, &self.structure(), &self.guid)
    }
}

impl<M: Model> Default for Definition<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// FNV-1a hash of 128 bits in the usual form of a GUID.
///
/// Fixed by its definition on every platform and toolchain, which the hasher of the standard library is not.
pub fn fingerprint(text: &str) -> String {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    let hash = text.bytes().fold(OFFSET, |h, byte| (h ^ u128::from(byte)).wrapping_mul(PRIME));
    let digits = format!("{hash:032x}");
    let part = |from: usize, to: usize| &digits[from..to];
    format!("{{{}-{}-{}-{}-{}}}", part(0, 8), part(8, 12), part(12, 16), part(16, 20), part(20, 32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprint_is_the_published_fnv_1a_hash() {
        // Test vectors of draft-eastlake-fnv: the empty string and "foobar".
        assert_eq!(fingerprint(""), "{6c62272e-07bb-0142-62b8-21756295c58d}");
        assert_eq!(fingerprint("foobar"), "{343e1662-793c-64bf-6f0d-3597ba446f18}");
    }
}
