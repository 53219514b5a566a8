//! Effects on a command path or a sampled signal that its model does not describe, as a sampled block in series.
//!
//! One module per effect with a state of its own. They act in the order of their modules in [`SignalEffect`]; gains,
//! limits and offsets have no state and stand here.

mod delay;
mod hysteresis;
mod mode;
#[cfg(test)]
mod tests;

use fmi_export::{Boolean, Identity, MemoryBlock, Model, Outcome, Real, Scalar, Table, Values};

use delay::Delay;
use hysteresis::Hysteresis;
use mode::Mode;

/// Longest delay \[samples\].
const MAX_DELAY_SAMPLES: usize = 256;

/// `y(k) = effects(u(k)) - backpressure_coef v(k) + offset_value`, held over the sample.
///
/// The effects act in this order; each is off at its start value:
///
/// | effect | equation | off |
/// |---|---|---|
/// | delay | `u(t - delay)`, linear between samples, before the first 0 or the first value | `delay = 0` |
/// | hysteresis | `h(k) = min(max(h(k-1), u - width), u + width)` | `hysteresis_width = 0` |
/// | dead band | `u - clip(u, -width, width)` | `deadband_width = 0` |
/// | saturation | `clip(u, -limit, limit)` | `saturation_limit = 0` |
/// | gain | `(1 + gain) u` | `gain = 0` |
/// | position gain | `(1 + posgain_slope x) u` | `posgain_slope = 0` |
/// | droop | `(1 - droop_depth (1 - exp(-t/droop_tau))) u` | `droop_depth = 0` |
/// | mode | `q'' + 2 zeta w q' + w^2 q = w^2 u`, `w = 2 pi freq` | `mode_freq = 0` |
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `u`, `y` | any | signal before and after |
/// | `x`, `v` | m, m/s | position and velocity of the piston |
pub struct SignalEffect {
    u: Real,
    x: Real,
    v: Real,
    y: Real,
    sample_time: Real,
    delay: Delay,
    hysteresis: Hysteresis,
    deadband: Real,
    limit: Real,
    gain: Real,
    slope: Real,
    droop_depth: Real,
    droop_tau: Real,
    mode: Mode,
    backpressure: Real,
    offset: Real,
    starts_at_zero: Boolean,
    held: MemoryBlock,
}

/// Values of one sample, with what the stateful effects become.
struct Sample<S> {
    play: S,
    mode_input: S,
    y: S,
}

impl SignalEffect {
    /// The output of the present sample, from inputs and memory.
    fn sampled<S: Scalar>(&self, q: &Values<S>) -> Sample<S> {
        let delayed = self.delay.output(q, q[self.u], q[self.sample_time]);
        let play = self.hysteresis.next(q, delayed);
        let mut y = play;
        let width = q[self.deadband];
        y -= y.clamp_to(-width, width);
        let limit = q[self.limit];
        if limit.value() > 0.0 {
            y = y.clamp_to(-limit, limit);
        }
        let rest = S::from(1.0) - (-(q.time / q[self.droop_tau])).exp();
        y *= q[self.gain] + 1.0;
        y *= q[self.slope] * q[self.x] + 1.0;
        y *= S::from(1.0) - q[self.droop_depth] * rest;
        let mode_input = y;
        y = self.mode.output(q, y);
        y = y - q[self.backpressure] * q[self.v] + q[self.offset];
        Sample { play, mode_input, y }
    }
}

impl Model for SignalEffect {
    const IDENTITY: Identity = Identity {
        model_identifier: "signal_effect",
        model_name: "signal-effect",
        description: "What a command path does that its model does not say: delay, play, dead band, limit, gains, mode",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        let parameter = |t: &mut Table, name: &'static str, about: &'static str| {
            t.parameter(name).about(about).min(0.0).real(0.0)
        };
        Self {
            u: t.input("u").about("signal before the effects").nominal(10.0).real(0.0),
            x: t.input("x").unit("m").about("position of the piston").nominal(0.1).real(0.0),
            v: t.input("v").unit("m/s").about("velocity of the piston").nominal(0.1).real(0.0),
            y: t.output("y").about("signal behind the effects").nominal(10.0).discrete().computed(),
            sample_time: t
                .parameter("sample_time")
                .unit("s")
                .about("time between samples")
                .min(1e-9)
                .nominal(0.001)
                .real(0.001),
            delay: Delay::declare(t, MAX_DELAY_SAMPLES),
            hysteresis: Hysteresis::declare(t),
            deadband: parameter(t, "deadband_width", "half-width of the dead band, unit of u"),
            limit: parameter(t, "saturation_limit", "largest signal, unit of u, 0: none"),
            gain: t.parameter("gain").about("gain error").real(0.0),
            slope: t.parameter("posgain_slope").about("growth of the gain with x \\[1/m\\]").real(0.0),
            droop_depth: t
                .parameter("droop_depth")
                .about("share of the signal that is lost in the end")
                .real(0.0),
            droop_tau: t
                .parameter("droop_tau")
                .unit("s")
                .about("time constant of the loss")
                .min(1e-6)
                .real(1.0),
            mode: Mode::declare(t),
            backpressure: t
                .parameter("backpressure_coef")
                .unit("N.s/m")
                .about("force lost with the velocity")
                .real(0.0),
            offset: t.parameter("offset_value").about("constant offset, unit of u").real(0.0),
            starts_at_zero: t
                .parameter("starts_at_zero")
                .about("before the start u was 0; else it had its first value, which delay, play and mode then hold")
                .boolean(true),
            held: t.memory(1),
        }
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let sample_time = q[self.sample_time];
        self.delay.check(q, sample_time)?;
        self.mode.prepare(q, sample_time);
        Ok(())
    }

    fn initialize<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        if !q[self.starts_at_zero] {
            let first = q[self.u];
            self.delay.fill(q, first);
            self.hysteresis.rest_at(q, first);
            let settled = self.sampled(q).mode_input;
            self.mode.rest_at(q, settled);
        }
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        q[self.y] = if q.at_sample { self.sampled(q).y } else { q[self.held.at(0)] };
        Ok(())
    }

    fn sample_period(&self, q: &Values<f64>) -> Option<f64> {
        Some(q[self.sample_time])
    }

    fn sample(&self, q: &mut Values<f64>) {
        let sample = self.sampled(q);
        q[self.held.at(0)] = sample.y;
        self.delay.push(q, q[self.u]);
        self.hysteresis.keep(q, sample.play);
        self.mode.advance(q, sample.mode_input);
    }

    /// Without delay and mode in every other draw, so that the direct way of the inputs shows.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        if draw.is_multiple_of(2) {
            self.delay.switch_off(q);
            self.mode.switch_off(q);
            q[self.deadband] = 0.0;
            q[self.limit] = 0.0;
        }
    }
}
