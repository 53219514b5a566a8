//! Units as products of usual ones: `N.s/m`, `N s^2/m2`, `kg.m-3`, `m3/(s.Pa)`.

use super::units::{Exponents, Unit, lookup};

/// The unit of a usual name, or of a product of usual names with whole powers; `None` where a part is not known.
///
/// Parts are separated by `.`, `*` or a space; behind `/` stands one part, or several in brackets; `/a/b` divides by
/// both. A unit with an offset (degC) counts by its factor alone within a product.
pub fn parse(text: &str) -> Option<Unit> {
    if let Some(unit) = lookup(text.trim()) {
        return Some(unit);
    }
    let mut found = Unit { exponents: Exponents::default(), factor: 1.0, offset: 0.0 };
    for (place, part) in divided(text)?.into_iter().enumerate() {
        let sign = if place == 0 { 1 } else { -1 };
        for one in part.split(['.', '*', ' ', '\u{b7}']).map(str::trim).filter(|one| !one.is_empty()) {
            let (unit, power) = powered(one)?;
            multiply(&mut found, &unit, sign * power);
        }
    }
    Some(found)
}

/// Numerator, then denominators.
fn divided(text: &str) -> Option<Vec<&str>> {
    let (mut parts, mut begin, mut depth) = (Vec::new(), 0, 0);
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            '/' if depth == 0 => {
                parts.push(&text[begin..at]);
                begin = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[begin..]);
    let plain = |part: &str| !part.contains(['(', ')']);
    let parts: Vec<&str> = parts.into_iter().map(without_brackets).collect();
    (depth == 0 && parts.iter().all(|part| plain(part) && !part.trim().is_empty())).then_some(parts)
}

fn without_brackets(part: &str) -> &str {
    part.trim().strip_prefix('(').and_then(|own| own.strip_suffix(')')).unwrap_or(part)
}

/// A name with a whole power: `m2`, `m^2`, `s-1`.
fn powered(text: &str) -> Option<(Unit, i32)> {
    if let Some(unit) = lookup(text) {
        return Some((unit, 1));
    }
    let end = text.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let power: i32 = text[end..].parse().ok()?;
    let name = &text[..end];
    let (name, power) = match name.strip_suffix(['-', '\u{2212}']) {
        Some(rest) => (rest, -power),
        None => (name, power),
    };
    Some((lookup(name.strip_suffix('^').unwrap_or(name)).filter(|_| (-9..=9).contains(&power))?, power))
}

fn multiply(found: &mut Unit, unit: &Unit, power: i32) {
    let (to, own) = (&mut found.exponents, &unit.exponents);
    to.kg += power * own.kg;
    to.m += power * own.m;
    to.s += power * own.s;
    to.A += power * own.A;
    to.K += power * own.K;
    to.mol += power * own.mol;
    to.cd += power * own.cd;
    to.rad += power * own.rad;
    found.factor *= unit.factor.powi(power);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_have_the_exponents_of_their_parts() {
        for (text, known) in [
            ("N/m", "N/m"),
            ("N s/m", "N.s/m"),
            ("kg.m.s-2", "N"),
            ("kg m^2/s^2", "N.m"),
            ("N/(m.s)", "W/m2"),
            ("N/m/s", "W/m2"),
            ("1/s", "Hz"),
        ] {
            let [own, known] = [text, known].map(|text| parse(text).unwrap_or_else(|| panic!("{text}")));
            assert_eq!(own, known, "{text}");
        }
        let slope = parse("N.s2/m2").expect("quadratic drag");
        assert_eq!(slope.exponents.symbols().map(|(_, e)| e)[..3], [1, -1, 0]);
        assert!((parse("N/mm").expect("a stiffness").factor - 1000.0).abs() < 1e-9);
        assert!((parse("mm2").expect("an area").factor - 1e-6).abs() < 1e-18);
    }

    #[test]
    fn what_is_no_unit_is_none() {
        for text in ["furlong", "N/", "N//m", "(N", "N/(m", "m^x", "m99", "/", "N)(m"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
