//! Value references of FMI 3.0, which are unique among all types: those of 2.0 with a mark of the type in the upper
//! bits.

use crate::table::Kind;

/// Mark of the type, in the bits above this one.
const SHIFT: u32 = 24;

/// Object that a value reference of FMI 3.0 stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Float64.
    Real = 0,
    /// Int32.
    Integer = 1,
    /// Boolean.
    Boolean = 2,
    /// String.
    Text = 3,
    /// Enumeration, set and read as Int64.
    Enumeration = 4,
    /// The independent variable.
    Time = 5,
    /// An event indicator.
    Indicator = 6,
}

const MEANINGS: [Meaning; 7] = [
    Meaning::Real,
    Meaning::Integer,
    Meaning::Boolean,
    Meaning::Text,
    Meaning::Enumeration,
    Meaning::Time,
    Meaning::Indicator,
];

impl Meaning {
    /// The value reference of number `number` of this kind.
    pub(crate) fn reference(self, number: u32) -> u32 {
        ((self as u32) << SHIFT) | number
    }
}

/// Meaning of a value reference, and its number, which is the value reference of FMI 2.0; `None` if there is no such
/// kind.
pub(crate) fn meaning(reference: u32) -> Option<(Meaning, u32)> {
    let meaning = MEANINGS.get((reference >> SHIFT) as usize)?;
    Some((*meaning, reference & ((1 << SHIFT) - 1)))
}

/// Value reference of a variable of the table.
pub(crate) fn of(kind: &Kind) -> u32 {
    match kind {
        Kind::Real { handle, .. } => Meaning::Real.reference(handle.0),
        Kind::Integer { handle, .. } => Meaning::Integer.reference(handle.0),
        Kind::Boolean { handle, .. } => Meaning::Boolean.reference(handle.0),
        Kind::Text { handle, .. } => Meaning::Text.reference(handle.0),
        Kind::Enumeration { handle, .. } => Meaning::Enumeration.reference(handle.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_tells_its_meaning() {
        for meaning_of in MEANINGS {
            assert_eq!(meaning(meaning_of.reference(70_000)), Some((meaning_of, 70_000)));
        }
        assert_eq!(meaning(7 << SHIFT), None);
        // Reals keep their references.
        assert_eq!(Meaning::Real.reference(12), 12);
    }
}
