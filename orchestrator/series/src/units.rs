//! Units as exponents of SI base units with factor and offset, and durations as users write them.
//!
//! A value `x` in a unit is `factor * x + offset` in base units (FMI 2.0.5 section 2.2.2). Which variable has which
//! unit is left to `fmu` and `system`.

use std::fmt;

use serde::Serialize;

/// Exponents of the base units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize)]
#[allow(non_snake_case, reason = "the names of the FMI attributes are the symbols of the units")]
pub struct Exponents {
    /// Kilogram.
    pub kg: i32,
    /// Meter.
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

/// Relation of two units.
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

/// Factors that differ by less than this, relatively, are the same: files give them with 9 to 15 digits.
const SAME_FACTOR: f64 = 1e-9;

/// Conversion of a value in unit `a` to one in unit `b`.
pub fn compatible(a: &Unit, b: &Unit) -> Compatibility {
    if a.exponents != b.exponents {
        return Compatibility::Incompatible;
    }
    let (factor, offset) = (a.factor / b.factor, (a.offset - b.offset) / b.factor);
    if (factor - 1.0).abs() < SAME_FACTOR && offset.abs() < SAME_FACTOR {
        return Compatibility::Equal;
    }
    Compatibility::Convertible { factor, offset }
}

impl fmt::Display for Exponents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for (symbol, exponent) in self.symbols() {
            match exponent {
                0 => continue,
                1 => write!(f, "{separator}{symbol}")?,
                _ => write!(f, "{separator}{symbol}{exponent}")?,
            }
            separator = ".";
        }
        if separator.is_empty() { f.write_str("1") } else { Ok(()) }
    }
}

impl Exponents {
    /// Symbol and exponent of each base unit.
    pub fn symbols(&self) -> [(&'static str, i32); 8] {
        [
            ("kg", self.kg),
            ("m", self.m),
            ("s", self.s),
            ("A", self.A),
            ("K", self.K),
            ("mol", self.mol),
            ("cd", self.cd),
            ("rad", self.rad),
        ]
    }
}

/// The unit of a usual name such as `N.m` or `kPa`, or of a product of them such as `m3/(s.V)`; `None` for other names.
pub fn lookup(name: &str) -> Option<Unit> {
    simple(name).or_else(|| product(name))
}

/// A product of simple units: factors behind `.`, `*` or a space, divisors behind `/`, each with an exponent of one
/// digit.
fn product(name: &str) -> Option<Unit> {
    let mut found = Unit { exponents: Exponents::default(), factor: 1.0, offset: 0.0 };
    let (above, below) = name.split_once('/').map_or((name, None), |(above, below)| (above, Some(below)));
    let below =
        below.map(|text| text.strip_prefix('(').and_then(|own| own.strip_suffix(')')).unwrap_or(text));
    for (text, sign) in [(Some(above), 1), (below, -1)] {
        for part in text.into_iter().flat_map(|text| text.split(['.', '*', ' ', '/'])) {
            let digits = part.trim_end_matches(|c: char| c.is_ascii_digit());
            let (symbol, power) = match simple(part) {
                Some(unit) => (unit, 1),
                None => (simple(digits.trim_end_matches('^'))?, part[digits.len()..].parse::<i32>().ok()?),
            };
            if symbol.offset != 0.0 || part.is_empty() || !(1..10).contains(&power) {
                return None;
            }
            let (e, own) = (&mut found.exponents, symbol.exponents);
            for (sum, exponent) in [
                (&mut e.kg, own.kg),
                (&mut e.m, own.m),
                (&mut e.s, own.s),
                (&mut e.A, own.A),
                (&mut e.K, own.K),
                (&mut e.mol, own.mol),
                (&mut e.cd, own.cd),
                (&mut e.rad, own.rad),
            ] {
                *sum += sign * power * exponent;
            }
            found.factor *= symbol.factor.powi(sign * power);
        }
    }
    Some(found)
}

/// A unit of the table.
fn simple(name: &str) -> Option<Unit> {
    const ONE: Exponents = Exponents { kg: 0, m: 0, s: 0, A: 0, K: 0, mol: 0, cd: 0, rad: 0 };
    let kg_m_s = |kg, m, s| Exponents { kg, m, s, ..ONE };
    let rad_s = |rad, s| Exponents { rad, s, ..ONE };
    let (exponents, factor, offset) = match name {
        "1" | "-" | "" => (ONE, 1.0, 0.0),
        "%" => (ONE, 1e-2, 0.0),
        "kg" => (kg_m_s(1, 0, 0), 1.0, 0.0),
        "g" => (kg_m_s(1, 0, 0), 1e-3, 0.0),
        "m" => (kg_m_s(0, 1, 0), 1.0, 0.0),
        "cm" => (kg_m_s(0, 1, 0), 1e-2, 0.0),
        "mm" => (kg_m_s(0, 1, 0), 1e-3, 0.0),
        "um" => (kg_m_s(0, 1, 0), 1e-6, 0.0),
        "m2" => (kg_m_s(0, 2, 0), 1.0, 0.0),
        "mm2" => (kg_m_s(0, 2, 0), 1e-6, 0.0),
        "m3" => (kg_m_s(0, 3, 0), 1.0, 0.0),
        "l" | "L" => (kg_m_s(0, 3, 0), 1e-3, 0.0),
        "s" => (kg_m_s(0, 0, 1), 1.0, 0.0),
        "ms" => (kg_m_s(0, 0, 1), 1e-3, 0.0),
        "us" => (kg_m_s(0, 0, 1), 1e-6, 0.0),
        "min" => (kg_m_s(0, 0, 1), 60.0, 0.0),
        "h" => (kg_m_s(0, 0, 1), 3600.0, 0.0),
        "Hz" | "1/s" => (kg_m_s(0, 0, -1), 1.0, 0.0),
        "m/s" => (kg_m_s(0, 1, -1), 1.0, 0.0),
        "mm/s" => (kg_m_s(0, 1, -1), 1e-3, 0.0),
        "km/h" => (kg_m_s(0, 1, -1), 1.0 / 3.6, 0.0),
        "s/m" => (kg_m_s(0, -1, 1), 1.0, 0.0),
        "m/s2" => (kg_m_s(0, 1, -2), 1.0, 0.0),
        "m3/s" => (kg_m_s(0, 3, -1), 1.0, 0.0),
        "m3/h" => (kg_m_s(0, 3, -1), 1.0 / 3600.0, 0.0),
        "l/min" | "L/min" => (kg_m_s(0, 3, -1), 1e-3 / 60.0, 0.0),
        "ml" | "mL" => (kg_m_s(0, 3, 0), 1e-6, 0.0),
        "kg/s" => (kg_m_s(1, 0, -1), 1.0, 0.0),
        "kg/m3" => (kg_m_s(1, -3, 0), 1.0, 0.0),
        "kg.m2" => (kg_m_s(1, 2, 0), 1.0, 0.0),
        "N" => (kg_m_s(1, 1, -2), 1.0, 0.0),
        "mN" => (kg_m_s(1, 1, -2), 1e-3, 0.0),
        "kN" => (kg_m_s(1, 1, -2), 1e3, 0.0),
        "mN.m" | "mN*m" | "N.mm" | "mJ" => (kg_m_s(1, 2, -2), 1e-3, 0.0),
        "N.m" | "N*m" | "J" => (kg_m_s(1, 2, -2), 1.0, 0.0),
        "N/m" => (kg_m_s(1, 0, -2), 1.0, 0.0),
        "N.s/m" | "N*s/m" => (kg_m_s(1, 0, -1), 1.0, 0.0),
        "N.m.s" | "N*m*s" => (kg_m_s(1, 2, -1), 1.0, 0.0),
        "N.m.s/rad" => (Exponents { rad: -1, ..kg_m_s(1, 2, -1) }, 1.0, 0.0),
        "W" => (kg_m_s(1, 2, -3), 1.0, 0.0),
        "Pa" => (kg_m_s(1, -1, -2), 1.0, 0.0),
        "kPa" => (kg_m_s(1, -1, -2), 1e3, 0.0),
        "MPa" => (kg_m_s(1, -1, -2), 1e6, 0.0),
        "hPa" | "mbar" => (kg_m_s(1, -1, -2), 1e2, 0.0),
        "bar" => (kg_m_s(1, -1, -2), 1e5, 0.0),
        "rad" => (rad_s(1, 0), 1.0, 0.0),
        "mrad" => (rad_s(1, 0), 1e-3, 0.0),
        "rev" => (rad_s(1, 0), std::f64::consts::TAU, 0.0),
        "rev/s" => (rad_s(1, -1), std::f64::consts::TAU, 0.0),
        "deg" => (rad_s(1, 0), std::f64::consts::PI / 180.0, 0.0),
        "rad/s" => (rad_s(1, -1), 1.0, 0.0),
        "deg/s" => (rad_s(1, -1), std::f64::consts::PI / 180.0, 0.0),
        "rpm" | "rev/min" => (rad_s(1, -1), std::f64::consts::PI / 30.0, 0.0),
        "rad/s2" => (rad_s(1, -2), 1.0, 0.0),
        "A" => (Exponents { A: 1, ..ONE }, 1.0, 0.0),
        "V" => (Exponents { A: -1, ..kg_m_s(1, 2, -3) }, 1.0, 0.0),
        "mA" => (Exponents { A: 1, ..ONE }, 1e-3, 0.0),
        "mV" => (Exponents { A: -1, ..kg_m_s(1, 2, -3) }, 1e-3, 0.0),
        "Ohm" | "ohm" => (Exponents { A: -2, ..kg_m_s(1, 2, -3) }, 1.0, 0.0),
        "H" => (Exponents { A: -2, ..kg_m_s(1, 2, -2) }, 1.0, 0.0),
        "F" => (Exponents { A: 2, ..kg_m_s(-1, -2, 4) }, 1.0, 0.0),
        "kW" => (kg_m_s(1, 2, -3), 1e3, 0.0),
        "K" => (Exponents { K: 1, ..ONE }, 1.0, 0.0),
        "degC" => (Exponents { K: 1, ..ONE }, 1.0, 273.15),
        "mol" => (Exponents { mol: 1, ..ONE }, 1.0, 0.0),
        "cd" => (Exponents { cd: 1, ..ONE }, 1.0, 0.0),
        _ => return None,
    };
    Some(Unit { exponents, factor, offset })
}

/// Number and unit of a text such as `"150 mm"`; no unit where none is written.
///
/// # Errors
/// Fault of the text, in words.
pub fn parse_quantity(text: &str) -> Result<(f64, Option<String>), String> {
    let text = text.trim();
    let hint = "write a number and a unit, such as \"150 mm\"";
    if text.is_empty() {
        return Err(format!("there is no number; {hint}"));
    }
    // The longest beginning that is a number: units such as `m` never extend it, `1e-3` does.
    let ends: Vec<usize> = text.char_indices().map(|(at, c)| at + c.len_utf8()).collect();
    let number = ends.iter().rev().find_map(|&end| {
        let digits = text[..end].trim_end();
        let plain = digits.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
        plain.then(|| digits.parse::<f64>().ok().map(|value| (value, end))).flatten()
    });
    let Some((value, end)) = number else {
        return Err(format!("`{text}` does not begin with a number; {hint}"));
    };
    if !value.is_finite() {
        return Err(format!("`{text}` is not finite"));
    }
    let unit = text[end..].trim();
    Ok((value, (!unit.is_empty()).then(|| unit.to_owned())))
}

/// A duration as written on the command line, in s: `"1ms"`, `"0.5 s"`, `"2"` (seconds).
///
/// # Errors
/// [`DurationError`] says what was written and what is allowed.
pub fn parse_duration(text: &str) -> Result<f64, DurationError> {
    let seconds = parse_time(text)?;
    if seconds < 0.0 {
        return Err(DurationError { text: text.to_owned(), reason: "it is negative" });
    }
    Ok(seconds)
}

/// A point in time as written on the command line, in s; as [`parse_duration`], but it may be negative.
///
/// # Errors
/// Same as [`parse_duration`].
pub fn parse_time(text: &str) -> Result<f64, DurationError> {
    let error = |reason| DurationError { text: text.to_owned(), reason };
    let trimmed = text.trim();
    // The unit begins at the last run of letters; an exponent such as 1e-3 ends in a digit.
    let digits = trimmed.trim_end_matches(|c: char| c.is_alphabetic() || c == 'µ');
    let factor = match &trimmed[digits.len()..] {
        "" | "s" => 1.0,
        "ms" => 1e-3,
        "us" | "µs" | "μs" => 1e-6,
        "ns" => 1e-9,
        "min" => 60.0,
        "h" => 3600.0,
        _ if digits.is_empty() => return Err(error("it has no number")),
        _ => return Err(error("the unit is none of s, ms, us, ns, min, h")),
    };
    let number: f64 =
        digits.trim_end().parse().map_err(|_| error("the part before the unit is not a number"))?;
    // Dividing by a whole number rounds once: 1ms is the double nearest to 0.001.
    let seconds = if factor < 1.0 { number / (1.0_f64 / factor).round() } else { number * factor };
    if !seconds.is_finite() {
        return Err(error("it is not finite"));
    }
    Ok(seconds)
}

/// A duration that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not a duration: {reason}; write for example 2, 0.5s, 1ms, 10us")]
pub struct DurationError {
    /// Text as given.
    pub text: String,
    /// Fault of the text.
    pub reason: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relation(a: &str, b: &str) -> Compatibility {
        compatible(&lookup(a).unwrap(), &lookup(b).unwrap())
    }

    #[test]
    fn products_of_units_are_known() {
        let same = |a: &str, b: &str, factor: f64| {
            let (a, b) = (lookup(a).unwrap(), lookup(b).unwrap());
            assert_eq!(a.exponents, b.exponents, "{a:?} {b:?}");
            assert!((a.factor / b.factor / factor - 1.0).abs() < 1e-12, "{a:?} {b:?}");
        };
        same("m3/(s.Pa)", "m3/s/Pa", 1.0);
        same("N.m.s/rad", "N*m*s/rad", 1.0);
        same("l/min", "m3/h", 0.06);
        same("mN.m", "N.m", 1e-3);
        same("mbar", "Pa", 100.0);
        same("rev/min", "rad/s", std::f64::consts::TAU / 60.0);
        same("kg.m2/s2", "J", 1.0);
        same("N s^2/m^2", "kg/m", 1.0);
        same("V/A", "Ohm", 1.0);
        for none in ["degC/s", "m/", "foo", "m3/(s.bar.x)", "N..m", "/"] {
            assert!(lookup(none).is_none(), "{none}");
        }
    }

    #[test]
    fn bar_to_kilopascal_is_a_factor_of_100() {
        let Compatibility::Convertible { factor, offset } = relation("bar", "kPa") else { panic!() };
        assert!((factor - 100.0).abs() < 1e-12 && offset == 0.0, "{factor} {offset}");
    }

    #[test]
    fn body_temperature_in_kelvin_keeps_its_offset() {
        let Compatibility::Convertible { factor, offset } = relation("degC", "K") else { panic!() };
        assert_eq!(factor * 37.0 + offset, 310.15);
    }

    #[test]
    fn force_and_torque_do_not_mix() {
        assert_eq!(relation("N", "N.m"), Compatibility::Incompatible);
        assert_eq!(relation("rad/s", "1/s"), Compatibility::Incompatible);
    }

    #[test]
    fn a_factor_written_with_ten_digits_is_the_same_unit() {
        let written = Unit { factor: 0.01745329252, ..lookup("deg").unwrap() };
        assert_eq!(compatible(&written, &lookup("deg").unwrap()), Compatibility::Equal);
    }

    #[test]
    fn compound_names_match_the_product_of_their_parts() {
        let (n, m, s) = (lookup("N").unwrap(), lookup("m").unwrap(), lookup("s").unwrap());
        let product = |f: [i32; 3]| {
            let [n, m, s] = [(n, f[0]), (m, f[1]), (s, f[2])]
                .map(|(unit, power)| unit.exponents.symbols().map(|(_, e)| e * power));
            std::array::from_fn::<i32, 8, _>(|i| n[i] + m[i] + s[i])
        };
        for (name, powers) in
            [("N.m", [1, 1, 0]), ("N.s/m", [1, -1, 1]), ("Pa", [1, -2, 0]), ("W", [1, 1, -1])]
        {
            assert_eq!(lookup(name).unwrap().exponents.symbols().map(|(_, e)| e), product(powers), "{name}");
        }
    }

    #[test]
    fn exponents_print_as_a_product_of_base_units() {
        assert_eq!(lookup("N").unwrap().exponents.to_string(), "kg.m.s-2");
        assert_eq!(lookup("1").unwrap().exponents.to_string(), "1");
    }

    #[test]
    fn durations_are_read_exactly() {
        let cases = [
            ("1ms", 1e-3),
            ("0.5 s", 0.5),
            ("2", 2.0),
            (" 10us ", 1e-5),
            ("1e-3", 1e-3),
            ("2min", 120.0),
            ("0.01ms", 1e-5),
        ];
        for (text, seconds) in cases {
            assert_eq!(parse_duration(text), Ok(seconds), "{text}");
        }
    }

    #[test]
    fn a_time_may_be_negative_where_a_duration_may_not() {
        assert_eq!(parse_time("-1.5ms"), Ok(-0.0015));
        assert!(parse_duration("-1.5ms").is_err());
    }

    #[test]
    fn a_duration_without_sense_is_refused_with_its_text() {
        for text in ["", "s", "1 parsec", "-1s", "inf", "nan", "1e999", "1,5s", "1 2"] {
            let message = parse_duration(text).expect_err(text).to_string();
            assert!(message.contains(&format!("'{text}'")), "{message}");
        }
    }

    #[test]
    fn numbers_and_units_are_told_apart() {
        for (text, value, unit) in [
            ("150 mm", 150.0, Some("mm")),
            ("2s", 2.0, Some("s")),
            ("1e-3 m", 1e-3, Some("m")),
            ("-4.5", -4.5, None),
            ("3 1/s", 3.0, Some("1/s")),
            (" 180deg ", 180.0, Some("deg")),
        ] {
            assert_eq!(parse_quantity(text), Ok((value, unit.map(str::to_owned))), "{text}");
        }
    }

    #[test]
    fn texts_without_a_number_are_refused_with_an_example() {
        for text in ["", "mm", "much", "inf m", "1e999 m"] {
            let message = parse_quantity(text).expect_err(text);
            assert!(message.contains("150 mm") || message.contains("not finite"), "{message}");
        }
    }
}
