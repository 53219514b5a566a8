//! Friction laws: eq. 2, and what may be added to it.

use serde::Serialize;

/// Number of entries of a parameter vector: c1..c5, mass, and two of an extension.
pub const SIZE: usize = 8;
/// Places in a parameter vector.
pub const C1: usize = 0;
/// See [`C1`].
pub const C2: usize = 1;
/// See [`C1`].
pub const C3: usize = 2;
/// See [`C1`].
pub const C4: usize = 3;
/// See [`C1`].
pub const C5: usize = 4;
/// See [`C1`].
pub const MASS: usize = 5;
/// First parameter of an extension.
pub const E1: usize = 6;
/// Second parameter of an extension.
pub const E2: usize = 7;

/// Parameters, shape \[8\].
pub type Parameters = [f64; SIZE];

/// A friction law; `s = tanh(c2 (v - c3))`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// `c1 s + c4 v + c5` (eq. 2).
    CoulombViscous,
    /// Eq. 2 plus `force exp(-((v - c3)/vs)^2) s`: friction falls as the motion begins (Stribeck peak in the form of Bo
    /// and Pavelescu, Wear 82, 1982, with exponent 2).
    Stribeck,
    /// Eq. 2 with `c1 + coef |p|` in place of `c1`: the seal is pressed on.
    Pressure,
    /// Eq. 2 with `c1 + slope x` in place of `c1`: the guide is tighter at one end.
    PositionCoulomb,
    /// Eq. 2 plus `stiffness x`: a spring or a hose.
    Spring,
    /// Eq. 2 plus `coef v` for `v > c3`: the directions differ by more than the bias c5.
    Asymmetry,
    /// Eq. 2 with `c1 z/disp` in place of `c1 s`, `z' = w - |w| z/disp`, `w = v - c3` (Dahl, A solid friction model,
    /// Aerospace Corporation 1968): the force builds up over a distance instead of at a speed.
    Presliding,
}

impl Law {
    /// Terms that may be added to eq. 2.
    pub const EXTENSIONS: [Law; 6] =
        [Law::Stribeck, Law::Pressure, Law::PositionCoulomb, Law::Spring, Law::Asymmetry, Law::Presliding];

    /// Short name.
    pub fn id(self) -> &'static str {
        match self {
            Law::CoulombViscous => "coulomb-viscous",
            Law::Stribeck => "stribeck",
            Law::Pressure => "pressure",
            Law::PositionCoulomb => "position",
            Law::Spring => "spring",
            Law::Asymmetry => "asymmetry",
            Law::Presliding => "presliding",
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Law::CoulombViscous => "Coulomb and viscous friction (eq. 2)",
            Law::Stribeck => "a friction peak at low speed (Stribeck)",
            Law::Pressure => "Coulomb friction that grows with the pressure",
            Law::PositionCoulomb => "Coulomb friction that varies along the stroke",
            Law::Spring => "a force that varies along the stroke, like a spring",
            Law::Asymmetry => "friction that differs between the directions by more than a bias",
            Law::Presliding => "a hysteretic spring before sliding (Dahl)",
        }
    }

    /// Names and units of the parameters it adds.
    pub fn extra(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Law::CoulombViscous => &[],
            Law::Stribeck => &[("force", "N"), ("vs", "m/s")],
            Law::Pressure => &[("coef", "N/Pa")],
            Law::PositionCoulomb => &[("slope", "N/m")],
            Law::Spring => &[("stiffness", "N/m")],
            Law::Asymmetry => &[("coef", "N.s/m")],
            Law::Presliding => &[("disp", "m")],
        }
    }

    /// Friction force \[N\] at velocity `v` \[m/s\], position `x` \[m\], pressure `p` \[Pa\]; not for
    /// [`Law::Presliding`], which depends on the past ([`Dahl`]).
    #[inline]
    pub fn force(self, c: &Parameters, v: f64, x: f64, p: f64) -> f64 {
        let w = v - c[C3];
        let s = (c[C2] * w).tanh();
        let base = c[C1] * s + c[C4] * v + c[C5]; // eq. 2
        match self {
            Law::CoulombViscous | Law::Presliding => base,
            Law::Stribeck => base + c[E1] * (-(w / c[E2]).powi(2)).exp() * s,
            Law::Pressure => base + c[E1] * p.abs() * s,
            Law::PositionCoulomb => base + c[E1] * x * s,
            Law::Spring => base + c[E1] * x,
            Law::Asymmetry if w > 0.0 => base + c[E1] * v,
            Law::Asymmetry => base,
        }
    }

    /// Mean of [`Law::force`] over a velocity that is normal about `v` with standard deviation `deviation`, by the
    /// Gauss-Hermite rule of three points: exact for forces that are polynomials of degree 5 there. Velocities in m/s,
    /// position `x` in m, pressure force `p` and result in N.
    #[inline]
    pub fn mean_force(self, c: &Parameters, v: f64, deviation: f64, x: f64, p: f64) -> f64 {
        let reach = 3f64.sqrt() * deviation;
        if c[C2] * reach < 1e-3 {
            return self.force(c, v, x, p); // the mean differs by less than 1e-6 c1
        }
        let sides = self.force(c, v - reach, x, p) + self.force(c, v + reach, x, p);
        (4.0 * self.force(c, v, x, p) + sides) / 6.0
    }
}

/// The spring of [`Law::Presliding`].
#[derive(Debug, Clone, Copy)]
pub struct Dahl {
    /// Deflection over its largest value, -1 to 1.
    share: f64,
}

impl Dahl {
    /// Steady sliding at velocity `v` \[m/s\], in the direction of its sign.
    pub fn sliding(c: &Parameters, v: f64) -> Dahl {
        Dahl { share: (c[C2] * (v - c[C3])).tanh() }
    }

    /// Friction force \[N\] now.
    pub fn force(&self, c: &Parameters, v: f64) -> f64 {
        c[C1] * self.share + c[C4] * v + c[C5]
    }

    /// Moves on by `dt` \[s\] at a constant velocity `v` \[m/s\]: the exact solution of its equation.
    pub fn advance(&mut self, c: &Parameters, v: f64, dt: f64) {
        let w = v - c[C3];
        let end = w.signum();
        self.share = end + (self.share - end) * (-w.abs() * dt / c[E1]).exp();
    }
}

/// Names and units of all parameters under a law, shape \[up to 8\].
pub fn names(law: Law) -> Vec<(usize, &'static str, &'static str)> {
    let base = [("c1", "N"), ("c2", "s/m"), ("c3", "m/s"), ("c4", "N.s/m"), ("c5", "N"), ("mass", "kg")];
    let all = base.into_iter().chain(law.extra().iter().copied());
    all.enumerate().map(|(index, (name, unit))| (index, name, unit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CART: Parameters = [5.7910, 63.7045, 0.0064, 0.0, -2.3170, 0.399, 0.0, 1.0];

    #[test]
    fn extensions_without_their_force_are_equation_2() {
        for v in [-0.3, -0.01, 0.0064, 0.02, 0.4] {
            let expected = 5.7910 * f64::tanh(63.7045 * (v - 0.0064)) - 2.3170;
            for law in Law::EXTENSIONS {
                assert!((law.force(&CART, v, 0.1, 3e5) - expected).abs() < 1e-12, "{law:?} at {v}");
            }
        }
    }

    #[test]
    fn the_mean_over_an_uncertain_velocity_is_the_integral() {
        // Trapezoidal rule over six standard deviations.
        let (v, sigma) = (0.012, 0.003);
        let n = 2000;
        let (mut sum, mut weight) = (0.0, 0.0);
        for k in 0..=n {
            let z = -6.0 + 12.0 * f64::from(k) / f64::from(n);
            let w = (-0.5 * z * z).exp();
            sum += w * Law::CoulombViscous.force(&CART, v + sigma * z, 0.0, 0.0);
            weight += w;
        }
        let mean = Law::CoulombViscous.mean_force(&CART, v, sigma, 0.0, 0.0);
        let naive = Law::CoulombViscous.force(&CART, v, 0.0, 0.0);
        let correction = (naive - sum / weight).abs();
        assert!(correction > 1e-2 && (mean - sum / weight).abs() < 0.01 * correction, "{mean} {naive}");
    }

    #[test]
    fn a_dahl_spring_builds_up_over_its_distance() {
        // From rest, dF/dx = c1/disp (1 - F/c1): F = c1 (1 - exp(-x/disp)).
        let c = [2.0, 50.0, 0.0, 0.0, 0.0, 0.0, 1e-3, 0.0];
        let mut spring = Dahl { share: 0.0 };
        for _ in 0..100 {
            spring.advance(&c, 0.01, 1e-3);
        }
        assert!((spring.force(&c, 0.01) - 2.0 * (1.0 - f64::exp(-1.0))).abs() < 1e-12);
    }
}
