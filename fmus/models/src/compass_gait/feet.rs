//! Feet that stand on the ground: the discrete part of the walker's state.

/// A set of feet, as a bit mask: foot 1 is bit 0, foot 2 is bit 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feet(u8);

impl Feet {
    /// Neither foot: flight.
    pub const NONE: Self = Self(0);
    /// Both feet: double support.
    pub const BOTH: Self = Self(3);

    /// From a number 0 (flight), 1 (foot 1), 2 (foot 2), 3 (both); others are cut to their last two bits.
    pub fn from_number(number: i32) -> Self {
        Self((number & 3) as u8)
    }

    /// 0 (flight), 1 (foot 1), 2 (foot 2), 3 (both).
    pub fn number(self) -> i32 {
        i32::from(self.0)
    }

    /// Foot `i` (0 or 1) alone.
    pub fn only(i: usize) -> Self {
        Self(1 << i)
    }

    /// True where foot `i` (0 or 1) is in the set.
    pub fn contains(self, i: usize) -> bool {
        self.0 >> i & 1 == 1
    }

    /// True where no foot is in the set.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Feet in either set.
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Feet in this set that are not in the other.
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The feet of the set, 0 before 1.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..2).filter(move |i| self.contains(*i))
    }
}
