//! Laws subtracted from the value that passes: friction, springs, stops, leakage, offsets.

use fmi_export::{Real, Scalar, Table, Values};

use super::Point;

/// Sum of the terms, `s = tanh(w/vt)` with `w = v - v0`; each is off at its start value:
///
/// | effect | term | off |
/// |---|---|---|
/// | viscous | `viscous_coef v` | `viscous_coef = 0` |
/// | Coulomb | `coulomb_level s` | `coulomb_level = 0` |
/// | Stribeck | `stribeck_level exp(-(w/stribeck_vs)^2) s` | `stribeck_level = 0` |
/// | presliding | `presliding_level (z/disp - s)`, `z' = w - abs(w) z/disp`, `disp = presliding_disp` | `disp = 0` |
/// | asymmetry, v > 0 | `asymmetry_level s + asymmetry_coef v` | both 0 |
/// | load | `load_coef abs(load) s` | `load_coef = 0` |
/// | along the way | `poscoulomb_slope x s` | `poscoulomb_slope = 0` |
/// | drag | `drag_coef abs(v) v` | `drag_coef = 0` |
/// | offset, drift | `offset_value + drift_slope t` | both 0 |
/// | spring | `spring_stiffness (x - spring_rest)` | `spring_stiffness = 0` |
/// | cubic spring | `cubic_stiffness (x - cubic_rest)^3` | `cubic_stiffness = 0` |
/// | end stop, x > pos | `max(0, endstop_stiffness (x - endstop_pos) + endstop_damping v)` | both 0 |
/// | cogging | `cogging_amp sin(2 pi x/cogging_period + cogging_phase)` | `cogging_amp = 0` |
/// | outlet | `outlet_coef sqrt(max(x, 0))` | `outlet_coef = 0` |
/// | area | `-area_coef p` | `area_coef = 0` |
pub struct Force {
    viscous: Real,
    coulomb: Real,
    stribeck: [Real; 2],
    presliding: [Real; 2],
    asymmetry: [Real; 2],
    load: Real,
    poscoulomb: Real,
    drag: Real,
    offset: [Real; 2],
    spring: [Real; 2],
    cubic: [Real; 2],
    endstop: [Real; 3],
    cogging: [Real; 3],
    outlet: Real,
    area: Real,
    z: Real,
    der_z: Real,
}

impl Force {
    pub fn declare(t: &mut Table) -> Self {
        let any =
            |t: &mut Table, name: &'static str, about: &'static str| t.parameter(name).about(about).real(0.0);
        let above_zero = |t: &mut Table, name: &'static str, about: &'static str| {
            t.parameter(name).about(about).min(1e-30).real(1.0)
        };
        let z = t.state("z").about("presliding deflection").real(0.0);
        Self {
            viscous: any(t, "viscous_coef", "viscous coefficient"),
            coulomb: any(t, "coulomb_level", "Coulomb level"),
            stribeck: [
                any(t, "stribeck_level", "peak at low speed"),
                above_zero(t, "stribeck_vs", "velocity of the peak"),
            ],
            presliding: [
                any(t, "presliding_level", "Coulomb level that is hysteretic"),
                t.parameter("presliding_disp").about("presliding displacement, 0: none").min(0.0).real(0.0),
            ],
            asymmetry: [
                any(t, "asymmetry_level", "further Coulomb level where v > 0"),
                any(t, "asymmetry_coef", "further viscous coefficient where v > 0"),
            ],
            load: any(t, "load_coef", "Coulomb friction for each unit of the load"),
            poscoulomb: any(t, "poscoulomb_slope", "growth of the Coulomb level with x"),
            drag: any(t, "drag_coef", "quadratic drag"),
            offset: [
                any(t, "offset_value", "constant offset"),
                any(t, "drift_slope", "growth of the offset with time"),
            ],
            spring: [
                any(t, "spring_stiffness", "stiffness of a spring"),
                any(t, "spring_rest", "where the spring is slack"),
            ],
            cubic: [
                any(t, "cubic_stiffness", "stiffness of a cubic spring"),
                any(t, "cubic_rest", "where the cubic spring is slack"),
            ],
            endstop: [
                any(t, "endstop_pos", "position of the stop"),
                any(t, "endstop_stiffness", "stiffness of the stop"),
                any(t, "endstop_damping", "damping of the stop"),
            ],
            cogging: [
                any(t, "cogging_amp", "amplitude of a periodic force"),
                above_zero(t, "cogging_period", "period along x"),
                any(t, "cogging_phase", "phase of the periodic force \\[rad\\]"),
            ],
            outlet: any(t, "outlet_coef", "loss with the square root of x"),
            area: any(t, "area_coef", "error of the effective area"),
            der_z: t.derivative("der(z)", z).about("rate of z").computed(),
            z,
        }
    }

    pub fn rate<S: Scalar>(&self, q: &mut Values<S>, at: &Point<S>) {
        let disp = q[self.presliding[1]];
        q[self.der_z] = if disp.value() > 0.0 { at.w - at.w.abs() * q[self.z] / disp } else { S::zero() };
    }

    pub fn total<S: Scalar>(&self, q: &Values<S>, at: &Point<S>) -> S {
        let p = |own: Real| q[own];
        let Point { x, v, w, s, load, .. } = *at;
        let mut level = p(self.coulomb) + p(self.load) * load.abs() + p(self.poscoulomb) * x;
        level += p(self.stribeck[0]) * (-(w / p(self.stribeck[1])).powi(2)).exp();
        if v.value() > 0.0 {
            level += p(self.asymmetry[0]);
        }
        let mut coefficient = p(self.viscous) + p(self.drag) * v.abs();
        if v.value() > 0.0 {
            coefficient += p(self.asymmetry[1]);
        }
        let mut f = level * s + coefficient * v;
        let disp = p(self.presliding[1]);
        if disp.value() > 0.0 {
            f += p(self.presliding[0]) * (q[self.z] / disp - s);
        }
        f += p(self.offset[0]) + p(self.offset[1]) * q.time;
        f += p(self.spring[0]) * (x - p(self.spring[1]));
        f += p(self.cubic[0]) * (x - p(self.cubic[1])).powi(3);
        let depth = x - p(self.endstop[0]);
        if depth.value() > 0.0 {
            f += (p(self.endstop[1]) * depth + p(self.endstop[2]) * v).max(S::zero());
        }
        let turns = x / p(self.cogging[1]);
        f += p(self.cogging[0]) * (turns * std::f64::consts::TAU + p(self.cogging[2])).sin();
        if x.value() > 0.0 && p(self.outlet).value() != 0.0 {
            f += p(self.outlet) * x.sqrt();
        }
        f - p(self.area) * at.p
    }

    /// Moves the stop behind the part and makes it stiff enough to push.
    pub fn probe(&self, q: &mut Values<f64>) {
        q[self.endstop[0]] = -10.0;
        q[self.endstop[1]] += 10.0;
        q[self.presliding[1]] = 0.1;
    }
}
