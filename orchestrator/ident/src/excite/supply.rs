//! Force that a limited supply pressure can give.

use super::{Error, check};

/// Lowest and highest force command \[N\] for which both chamber pressures stay between ambient and supply (paper
/// eq. 3): `p1 = (F_eq + u/2)/S1`, `p2 = (F_eq - u/2)/S2`, with `F_eq` = half the supply pressure times the mean area.
///
/// | name | unit | meaning |
/// |------|------|---------|
/// | `s1`, `s2` | m2 | areas of the chambers |
/// | `supply` | Pa | supply pressure above ambient |
///
/// # Errors
/// [`Error::Setting`] if one of them is not above zero.
pub fn force_limits(s1: f64, s2: f64, supply: f64) -> Result<(f64, f64), Error> {
    for (what, value, unit) in
        [("area S1", s1, "m2"), ("area S2", s2, "m2"), ("the supply pressure", supply, "Pa")]
    {
        check(what, value, unit, value > 0.0, || "it must be above zero".into())?;
    }
    let f_eq = 0.5 * supply * 0.5 * (s1 + s2);
    let lower = f64::max(-f_eq, f_eq - supply * s2); // p1 >= 0, p2 <= supply
    let upper = f64::min(supply * s1 - f_eq, f_eq); // p1 <= supply, p2 >= 0
    Ok((2.0 * lower, 2.0 * upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_the_limits_a_chamber_is_at_ambient_or_supply_pressure() {
        let (s1, s2, supply) = (3.1416e-4, 2.6389e-4, 0.5e6);
        let (lower, upper) = force_limits(s1, s2, supply).unwrap();
        let f_eq = 72.256; // by hand, in N
        let pressures = |u: f64| [(f_eq + 0.5 * u) / s1, (f_eq - 0.5 * u) / s2];
        let touches = |u: f64| pressures(u).iter().any(|p| p.abs() < 5.0 || (p - supply).abs() < 5.0);
        assert!(touches(lower) && touches(upper), "{lower} {upper}");
        for u in [lower + 0.01, 0.0, upper - 0.01] {
            assert!(pressures(u).iter().all(|p| (0.0..=supply).contains(p)), "{u}");
        }
        assert!(force_limits(0.0, s2, supply).is_err());
    }
}
