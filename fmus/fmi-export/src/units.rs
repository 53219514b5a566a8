//! Units with SI base-unit exponents, as they stand under `UnitDefinitions`.

/// A unit: name, exponents of the SI base units, factor and offset to them, and display units.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Name that variables refer to, such as `N.m`.
    pub name: &'static str,
    /// Base-unit exponents: pairs of `kg m s A K mol cd rad` and exponent.
    pub exponents: &'static [(&'static str, i32)],
    /// Factor to the base units: `base = factor * value + offset`.
    pub factor: f64,
    /// Offset to the base units.
    pub offset: f64,
    /// Display units: name, factor, offset with `display = factor * value + offset`.
    pub display: &'static [(&'static str, f64, f64)],
}

const fn si(name: &'static str, exponents: &'static [(&'static str, i32)]) -> Unit {
    Unit { name, exponents, factor: 1.0, offset: 0.0, display: &[] }
}

const fn shown(
    name: &'static str,
    exponents: &'static [(&'static str, i32)],
    display: &'static [(&'static str, f64, f64)],
) -> Unit {
    Unit { name, exponents, factor: 1.0, offset: 0.0, display }
}

/// Units that models may use without declaring them.
pub const STANDARD: &[Unit] = &[
    shown("s", &[("s", 1)], &[("ms", 1e3, 0.0)]),
    shown("m", &[("m", 1)], &[("mm", 1e3, 0.0)]),
    shown("rad", &[("rad", 1)], &[("deg", 180.0 / std::f64::consts::PI, 0.0)]),
    shown("m2", &[("m", 2)], &[("mm2", 1e6, 0.0)]),
    si("kg", &[("kg", 1)]),
    si("m/s", &[("m", 1), ("s", -1)]),
    si("m/s2", &[("m", 1), ("s", -2)]),
    shown("rad/s", &[("rad", 1), ("s", -1)], &[("deg/s", 180.0 / std::f64::consts::PI, 0.0)]),
    si("rad/s2", &[("rad", 1), ("s", -2)]),
    si("s/m", &[("s", 1), ("m", -1)]),
    si("1/s", &[("s", -1)]),
    si("N", &[("kg", 1), ("m", 1), ("s", -2)]),
    si("N/s", &[("kg", 1), ("m", 1), ("s", -3)]),
    si("N.m", &[("kg", 1), ("m", 2), ("s", -2)]),
    si("N/m", &[("kg", 1), ("s", -2)]),
    si("N.s/m", &[("kg", 1), ("s", -1)]),
    si("N.m.s/rad", &[("kg", 1), ("m", 2), ("s", -1), ("rad", -1)]),
    si("J", &[("kg", 1), ("m", 2), ("s", -2)]),
    shown("Pa", &[("kg", 1), ("m", -1), ("s", -2)], &[("bar", 1e-5, 0.0), ("MPa", 1e-6, 0.0)]),
];
