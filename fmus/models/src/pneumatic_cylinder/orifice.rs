//! Mass flow of air through an orifice, choked, subsonic, and linear close to equal pressures: the
//! isentropic flow of an ideal nozzle with k = 1.4 (Beater, Pneumatic Drives, Springer 2007).

use fmi_export::Scalar;

/// Pressure ratio below which the flow is choked.
const CRITICAL_PRESSURE_RATIO: f64 = 0.528;
/// Pressure ratio above which the flow is linear in the difference, so that its slope stays finite.
const LINEAR_PRESSURE_RATIO: f64 = 0.995;
/// Gas constant of air \[J/(kg K)\] that the two factors below belong to.
const R_AIR: f64 = 287.0;
/// `sqrt(k/R (2/(k+1))^((k+1)/(k-1)))`, k = 1.4.
const CHOKED_FLOW_FACTOR: f64 = 0.040418;
/// `sqrt(2 k / (R (k - 1)))`.
const SUBSONIC_FLOW_FACTOR: f64 = 0.156174;
/// [`subsonic`] at [`LINEAR_PRESSURE_RATIO`].
const FLOW_AT_LINEAR_RATIO: f64 = 0.005886990002330825;

/// Gas at the temperature of the source.
#[derive(Clone, Copy)]
pub struct Air<S> {
    /// `R T` \[J/kg\].
    pub rt: S,
    /// `sqrt(R_AIR / (R T))`, the temperature factor of the flow.
    factor: S,
}

impl<S: Scalar> Air<S> {
    /// Air of gas constant `r` \[J/(kg K)\] at temperature `t` \[K\].
    pub fn new(r: S, t: S) -> Self {
        let rt = r * t;
        Self { rt, factor: (S::from(R_AIR) / rt).sqrt() }
    }

    /// Mass flow per area \[kg/(s m²)\] from a volume at pressure `from` \[Pa\] to one at `to`; negative where `to` is
    /// the larger one.
    ///
    /// `pu` and `pd` are the larger and the smaller pressure, `r = pd / pu`: `pu / sqrt(T)` times 0.040418 for r ≤
    /// 0.528, times `0.156174 r^(1/k) sqrt(1 - r^((k-1)/k))` below 0.995, and from there on falling with `1 - r` to 0.
    pub fn flow(self, from: S, to: S) -> S {
        if from.value() >= to.value() { self.downhill(from, to) } else { -self.downhill(to, from) }
    }

    fn downhill(self, pu: S, pd: S) -> S {
        let r = pd / pu;
        let part = if r.value() <= CRITICAL_PRESSURE_RATIO {
            S::from(CHOKED_FLOW_FACTOR)
        } else if r.value() < LINEAR_PRESSURE_RATIO {
            subsonic(r)
        } else {
            (S::from(1.0) - r) * (FLOW_AT_LINEAR_RATIO / (1.0 - LINEAR_PRESSURE_RATIO))
        };
        // The factors of the page are per sqrt(T) for R_AIR.
        pu * part * self.factor
    }
}

/// `0.156174 r^(1/k) sqrt(1 - r^((k-1)/k))` with k = 7/5: both powers are of the seventh root.
fn subsonic<S: Scalar>(r: S) -> S {
    let root = (r.ln() / 7.0).exp();
    root.powi(5) * (S::from(1.0) - root.squared()).sqrt() * SUBSONIC_FLOW_FACTOR
}

#[cfg(test)]
mod tests {
    use super::*;

    fn air() -> Air<f64> {
        Air::new(287.0, 293.0)
    }

    #[test]
    fn flow_is_that_of_the_textbook_in_all_three_ranges() {
        // pu A / sqrt(T) sqrt(2k/(R(k-1)) (r^(2/k) - r^((k+1)/k))), and its maximum; constants rounded to 5 digits.
        let k: f64 = 1.4;
        let (pu, t, r_air) = (6e5, 293.0_f64, 287.0);
        let textbook = |r: f64| {
            let r = r.max((2.0 / (k + 1.0)).powf(k / (k - 1.0)));
            let bracket = r.powf(2.0 / k) - r.powf((k + 1.0) / k);
            pu / t.sqrt() * (2.0 * k / (r_air * (k - 1.0)) * bracket).sqrt()
        };
        for r in [0.1, 0.5, 0.53, 0.7, 0.9, 0.99] {
            let flow = air().flow(pu, r * pu);
            assert!((flow / textbook(r) - 1.0).abs() < 2e-5, "{r}: {flow} {}", textbook(r));
        }
        let half = air().flow(pu, 0.9975 * pu);
        assert!((half / textbook(LINEAR_PRESSURE_RATIO) - 0.5).abs() < 1e-5);
    }

    #[test]
    fn flow_turns_with_the_pressures_and_is_continuous() {
        assert_eq!(air().flow(3e5, 2e5), -air().flow(2e5, 3e5));
        assert_eq!(air().flow(3e5, 3e5), 0.0);
        for (ratio, tolerance) in [(LINEAR_PRESSURE_RATIO, 1e-10), (CRITICAL_PRESSURE_RATIO, 2e-5)] {
            let at = |r: f64| air().flow(5e5, r * 5e5);
            let jump = at(ratio * (1.0 + 1e-13)) / at(ratio * (1.0 - 1e-13)) - 1.0;
            assert!(jump.abs() < tolerance, "{ratio}: {jump}");
        }
    }
}
