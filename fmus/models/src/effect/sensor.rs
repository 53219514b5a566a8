//! A sensor as a continuous block in series with a signal: offset, gain, delay.

use fmi_export::{Boolean, Identity, MemoryBlock, Model, Outcome, Real, Refusal, Scalar, Table, Values};

/// Longest delay \[samples\].
const MAX_DELAY_SAMPLES: usize = 256;

/// `y(t) = (1 + gain) u(t - delay) + offset_value`, the past of `u` linear between samples.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `u`, `y` | any | signal and what the sensor shows |
/// | `gain` | 1 | gain error |
/// | `delay` | s | delay |
/// | `offset_value` | of `u` | constant offset |
/// | `sample_time` | s | time between the samples of the past that are kept |
/// | `starts_at_zero` | | before the start `u` was 0; else it had its first value |
///
/// In Co-Simulation the input of a step is taken to be that of its end, as a master sets it that hands on new values
/// (Gauss-Seidel); in Model Exchange it is that of the present time.
pub struct SensorEffect {
    u: Real,
    y: Real,
    gain: Real,
    delay: Real,
    offset: Real,
    sample_time: Real,
    starts_at_zero: Boolean,
    /// Signals of the last samples, youngest first.
    line: MemoryBlock,
    /// Time of the youngest sample, and the last input of Co-Simulation.
    last: MemoryBlock,
}

impl Model for SensorEffect {
    const IDENTITY: Identity = Identity {
        model_identifier: "sensor_effect",
        model_name: "sensor-effect",
        description: "What a sensor shows of a signal: y = (1 + gain) u(t - delay) + offset_value",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        Self {
            u: t.input("u").about("signal").real(0.0),
            y: t.output("y").about("what the sensor shows").computed(),
            gain: t.parameter("gain").about("gain error").real(0.0),
            delay: t.parameter("delay").unit("s").about("delay").min(0.0).nominal(0.001).real(0.0),
            offset: t.parameter("offset_value").about("constant offset, unit of u").real(0.0),
            sample_time: t
                .parameter("sample_time")
                .unit("s")
                .about("time between the samples of the past that are kept")
                .min(1e-9)
                .nominal(0.001)
                .real(0.001),
            starts_at_zero: t
                .parameter("starts_at_zero")
                .about("before the start u was 0; else it had its first value")
                .boolean(false),
            line: t.memory(MAX_DELAY_SAMPLES),
            last: t.memory(2),
        }
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let samples = q[self.delay].value() / q[self.sample_time].value();
        if samples + 1.0 > MAX_DELAY_SAMPLES as f64 {
            return Err(Refusal::Error(format!(
                "delay = {} s is {samples:.1} samples of {} s, but {} are kept; use a shorter delay or a longer sample_time",
                q[self.delay].value(),
                q[self.sample_time].value(),
                MAX_DELAY_SAMPLES - 1
            )));
        }
        Ok(())
    }

    fn initialize<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let before = if q[self.starts_at_zero] { S::zero() } else { q[self.u] };
        (0..MAX_DELAY_SAMPLES).for_each(|i| q[self.line.at(i)] = before);
        q[self.last.at(0)] = q.time - q[self.sample_time];
        q[self.last.at(1)] = q[self.u];
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        q[self.y] = (q[self.gain] + 1.0) * self.delayed(q) + q[self.offset];
        Ok(())
    }

    fn sample_period(&self, q: &Values<f64>) -> Option<f64> {
        (q[self.delay] > 0.0).then_some(q[self.sample_time])
    }

    fn sample(&self, q: &mut Values<f64>) {
        for i in (1..MAX_DELAY_SAMPLES).rev() {
            q[self.line.at(i)] = q[self.line.at(i - 1)];
        }
        q[self.line.at(0)] = if q.is_co_simulation() { q[self.last.at(1)] } else { q[self.u] };
        q[self.last.at(0)] = q.time;
        q[self.last.at(1)] = q[self.u];
    }

    /// Without delay in every other draw, so that the direct way shows.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        if draw.is_multiple_of(2) {
            q[self.delay] = 0.0;
        }
    }
}

impl SensorEffect {
    /// `u(t - delay)`.
    fn delayed<S: Scalar>(&self, q: &Values<S>) -> S {
        let samples = q[self.delay] / q[self.sample_time];
        if samples.value() <= 0.0 {
            return q[self.u];
        }
        // Samples since the youngest one that is kept.
        let since = (q.time - q[self.last.at(0)]) / q[self.sample_time];
        let back = samples - since;
        if back.value() < 0.0 {
            let young = q[self.line.at(0)];
            return young + (since - samples) / since * (q[self.u] - young);
        }
        let i = (back.value().floor() as usize).min(MAX_DELAY_SAMPLES - 2);
        let (near, far) = (q[self.line.at(i)], q[self.line.at(i + 1)]);
        near + (back - i as f64) * (far - near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    /// Outputs at the end of each step, for a ramp `u = slope t` sampled every millisecond.
    fn ramp(interface: Interface, parameters: &[(&str, f64)], slope: f64) -> Vec<f64> {
        let (model, table) = Table::of::<SensorEffect>();
        let mut q = table.start_values(interface);
        for (name, value) in parameters {
            q[table.by_name(name).and_then(|v| v.real()).unwrap()] = *value;
        }
        model.prepare(&mut q).unwrap();
        model.initialize(&mut q).unwrap();
        let mut found = Vec::new();
        for k in 0..50 {
            let (now, then) = (k as f64 * 1e-3, (k + 1) as f64 * 1e-3);
            let co_simulation = interface == Interface::CoSimulation;
            (q.time, q[model.u]) = (now, slope * if co_simulation { then } else { now });
            if q[model.delay] > 0.0 {
                model.sample(&mut q);
            }
            (q.time, q[model.u]) = (then, slope * then);
            model.equations(&mut q).unwrap();
            found.push(q[model.y]);
        }
        found
    }

    #[test]
    fn a_ramp_arrives_late_by_the_delay_in_both_interfaces() {
        for interface in [Interface::CoSimulation, Interface::ModelExchange] {
            for delay in [0.0, 0.4e-3, 1e-3, 2.7e-3] {
                let found = ramp(interface, &[("delay", delay), ("gain", 0.1), ("offset_value", 3.0)], 20.0);
                for (k, y) in found.iter().enumerate() {
                    let t = ((k + 1) as f64 * 1e-3 - delay).max(0.0);
                    assert!((y - (1.1 * 20.0 * t + 3.0)).abs() < 1e-9, "{interface:?} {delay} {k}: {y}");
                }
            }
        }
    }
}
