//! One proportional pressure-control valve with its port and the tube behind it.

use super::orifice::Air;
use super::parameters::Parameters;
use fmi_export::{Scalar, Values};

/// Polytropic exponent of the air in the valve port.
const PORT_EXPONENT: f64 = 1.2;
/// Bound on the integrator, and the time \[s\] that it looks ahead.
const INTEGRATOR_BOUND: f64 = 0.3;
const INTEGRATOR_LOOK_AHEAD: f64 = 1e-3;

/// The states of one valve.
#[derive(Clone, Copy)]
pub struct Valve<S> {
    /// Filtered pressure command \[Pa\].
    pub c: S,
    /// Integrator of the controller.
    pub q: S,
    /// Position of the spool, 1: fully open to the supply.
    pub s: S,
    /// Its rate \[1/s\].
    pub s_rate: S,
    /// Pressure at the port \[Pa\].
    pub pv: S,
}

/// Mass flows \[kg/s\].
#[derive(Clone, Copy)]
pub struct Flows<S> {
    /// From supply or to ambient, into the port.
    pub valve: S,
    /// From the port into the tube.
    pub tube: S,
}

impl<S: Scalar> Valve<S> {
    /// Flows through the spool and into the tube toward a chamber at pressure `p` \[Pa\].
    pub fn flows(&self, air: Air<S>, k: &Parameters, values: &Values<S>, p: S) -> Flows<S> {
        let o = opening(self.s, values[k.overlap]);
        let full = values[k.Cd] * values[k.Avmax];
        let supply = values[k.psup] + values[k.patm];
        let per_area =
            if o.value() >= 0.0 { air.flow(supply, self.pv) } else { air.flow(self.pv, values[k.patm]) };
        let tube = values[k.Cd] * values[k.At] * air.flow(self.pv, p);
        Flows { valve: full * o * per_area, tube }
    }

    /// Rates of the states for a pressure command `pc` \[Pa\] behind the play.
    ///
    /// `c' = (pc - c)/tau_cmd`, `e = c - pv`, `w = clip(Kp e + q, -1, 1)`, `q' = Ki e` unless it has reached its bound,
    /// `s'' = ws² (w - s) - 2 zs ws s'`, `pv' = 1.2 R T (mv - mt)/Vt`.
    pub fn rates(&self, air: Air<S>, k: &Parameters, values: &Values<S>, pc: S, flows: Flows<S>) -> Valve<S> {
        let (kp, ki, ws) = (values[k.Kp], values[k.Ki], values[k.ws]);
        let e = self.c - self.pv;
        let w = (kp * e + self.q).clamp_to(S::from(-1.0), S::from(1.0));
        let ahead = self.q + ki * e * INTEGRATOR_LOOK_AHEAD;
        let frozen = ahead.value().abs() >= INTEGRATOR_BOUND;
        Valve {
            c: (pc - self.c) / values[k.tau_cmd],
            q: if frozen { S::zero() } else { ki * e },
            s: self.s_rate,
            s_rate: ws.squared() * (w - self.s) - values[k.zs] * ws * self.s_rate * 2.0,
            pv: air.rt * (flows.valve - flows.tube) * PORT_EXPONENT / values[k.Vt],
        }
    }
}

/// Part of the full opening; negative toward ambient.
fn opening<S: Scalar>(s: S, overlap: S) -> S {
    if s.value() > overlap.value() {
        (s - overlap).min(S::from(1.0))
    } else if s.value() < -overlap.value() {
        (s + overlap).max(S::from(-1.0))
    } else {
        S::zero()
    }
}

#[cfg(test)]
mod tests {
    use super::opening;

    #[test]
    fn spool_opens_beyond_its_overlap_up_to_full() {
        let expected =
            [(0.0, 0.0), (0.02, 0.0), (-0.02, 0.0), (0.05, 0.03), (-0.05, -0.03), (2.0, 1.0), (-2.0, -1.0)];
        for (s, o) in expected {
            assert!((opening(s, 0.02_f64) - o).abs() < 1e-16, "{s}");
        }
    }
}
