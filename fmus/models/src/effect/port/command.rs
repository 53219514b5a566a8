//! Changes of the value that passes: dead band, limit, gains, lag with a rate for each direction, limited rate, mode.

use fmi_export::{MemoryBlock, Real, Scalar, Table, Values};

/// In this order; each is off at its start value:
///
/// | effect | equation | off |
/// |---|---|---|
/// | dead band | `u - clip(u, -width, width)` | `deadband_width = 0` |
/// | saturation | `clip(u, -limit, limit)` | `saturation_limit = 0` |
/// | gain | `(1 + gain) u` | `gain = 0` |
/// | position gain | `(1 + posgain_slope x) u` | `posgain_slope = 0` |
/// | droop | `(1 - droop_depth (1 - exp(-t/droop_tau))) u` | `droop_depth = 0` |
/// | lag | `l' = (u - l)/tau`, `tau` by the sign of `u - l`, `abs(l') <= rate_limit` | `lag_up = 0` |
/// | mode | `q'' + 2 zeta w q' + w^2 q = w^2 u`, `w = 2 pi freq` | `mode_freq = 0` |
///
/// Lag and mode start settled at the first value.
pub struct Command {
    deadband: Real,
    limit: Real,
    gain: Real,
    slope: Real,
    depth: Real,
    tau: Real,
    up: Real,
    down: Real,
    rate: Real,
    freq: Real,
    zeta: Real,
    /// Deviations from the first value: of the lag, of the mode and its rate.
    lag: Real,
    der_lag: Real,
    mode: [Real; 2],
    der_mode: [Real; 2],
    /// First value that reaches the lag.
    first: MemoryBlock,
}

impl Command {
    pub fn declare(t: &mut Table) -> Self {
        let size = |t: &mut Table, name: &'static str, about: &'static str| {
            t.parameter(name).about(about).min(0.0).real(0.0)
        };
        let lag = t.state("lag").about("lagging value less the first one").real(0.0);
        let deflection = t.state("mode").about("value of the mode less the first one").real(0.0);
        let speed = t.state("mode_rate").about("rate of the mode").real(0.0);
        Self {
            deadband: size(t, "deadband_width", "half-width of the dead band"),
            limit: size(t, "saturation_limit", "largest value, 0: none"),
            gain: t.parameter("gain").about("gain error").real(0.0),
            slope: t.parameter("posgain_slope").about("growth of the gain with x").real(0.0),
            depth: t.parameter("droop_depth").about("share of the value that is lost in the end").real(0.0),
            tau: t.parameter("droop_tau").unit("s").about("time constant of the loss").min(1e-9).real(1.0),
            up: t
                .parameter("lag_up")
                .unit("s")
                .about("time constant of a rising value, 0: no lag")
                .min(0.0)
                .real(0.0),
            down: t
                .parameter("lag_down")
                .unit("s")
                .about("time constant of a falling value")
                .min(1e-9)
                .real(1.0),
            rate: size(t, "rate_limit", "largest rate of the lagging value, 0: none"),
            freq: {
                t.unit("Hz", &[("s", -1)]);
                t.parameter("mode_freq").unit("Hz").about("frequency of the mode, 0: none").min(0.0).real(0.0)
            },
            zeta: t.parameter("mode_zeta").about("damping of the mode").min(0.0).real(0.7),
            der_lag: t.derivative("der(lag)", lag).about("rate of the lagging value").computed(),
            der_mode: [
                t.derivative("der(mode)", deflection).about("rate of the mode").computed(),
                t.derivative("der(mode_rate)", speed).about("second rate of the mode").computed(),
            ],
            lag,
            mode: [deflection, speed],
            first: t.memory(1),
        }
    }

    /// The value in front of lag and mode.
    fn memoryless<S: Scalar>(&self, q: &Values<S>, u: S, x: S) -> S {
        let width = q[self.deadband];
        let mut value = u - u.clamp_to(-width, width);
        let limit = q[self.limit];
        if limit.value() > 0.0 {
            value = value.clamp_to(-limit, limit);
        }
        let lost = S::from(1.0) - (-(q.time / q[self.tau])).exp();
        value *= q[self.gain] + 1.0;
        value *= q[self.slope] * x + 1.0;
        value * (S::from(1.0) - q[self.depth] * lost)
    }

    /// Lag and mode rest at the first value.
    pub fn settle<S: Scalar>(&self, q: &mut Values<S>, u: S, x: S) {
        q[self.first.at(0)] = self.memoryless(q, u, x);
    }

    /// The value behind all of them; sets the rates of the states.
    pub fn passed<S: Scalar>(&self, q: &mut Values<S>, u: S, x: S) -> S {
        let first = q[self.first.at(0)];
        let mut value = self.memoryless(q, u, x);
        q[self.der_lag] = S::zero();
        if q[self.up].value() > 0.0 {
            let ahead = value - first - q[self.lag];
            let tau = if ahead.value() > 0.0 { q[self.up] } else { q[self.down] };
            let (rate, limit) = (ahead / tau, q[self.rate]);
            q[self.der_lag] = if limit.value() > 0.0 { rate.clamp_to(-limit, limit) } else { rate };
            value = first + q[self.lag];
        }
        let (freq, [deflection, speed]) = (q[self.freq], self.mode);
        [q[self.der_mode[0]], q[self.der_mode[1]]] = [S::zero(); 2];
        if freq.value() > 0.0 {
            let w = freq * std::f64::consts::TAU;
            let ahead = value - first - q[deflection];
            q[self.der_mode[0]] = q[speed];
            q[self.der_mode[1]] = w * w * ahead - q[self.zeta] * w * q[speed] * 2.0;
            value = first + q[deflection];
        }
        value
    }

    /// Lag and mode in every combination, one after the other.
    pub fn probe(&self, q: &mut Values<f64>, draw: usize) {
        (q[self.deadband], q[self.limit], q[self.rate]) = (0.0, 0.0, 0.0);
        (q[self.up], q[self.down]) = (if draw % 2 == 1 { 0.3 } else { 0.0 }, 0.2);
        q[self.freq] = if draw % 4 > 1 { 1.5 } else { 0.0 };
    }
}
