//! Time-varying linear-quadratic regulator with its state estimator, along a trajectory from a table.
//!
//! [`gains`] reads the table, [`library`] keeps the tables of all instances.

mod gains;
mod library;
#[cfg(test)]
mod tests;

use fmi_export::{
    Boolean, Identity, Integer, Memory, MemoryBlock, Model, Outcome, Real, Refusal, Scalar, Table, Values,
};
use gains::{Gains, MAX_NU, MAX_NX, MAX_NY, Place, Row};
use library::Library;
use std::path::Path;
use std::sync::Arc;

/// Shortest sample time \[s\].
const SMALLEST_SAMPLE_TIME: f64 = 1e-9;
/// Limits of the plant's inputs that limit nothing.
const UNLIMITED: f64 = 1e15;

/// At sample k, with the row k of the table (the last row from its end on) and deviations `e` from its states:
///
/// ```text
/// e(k|k)   = e(k|k-1) + L (y + noise - y0 - C e(k|k-1))      x_hat = x0 + e(k|k)
/// u(k)     = u0 - K e(k|k), limited to [u_min, u_max]
/// e(k+1|k) = A e(k|k) + B (u(k) - u0) + c
/// ```
///
/// | name | shape | meaning |
/// |---|---|---|
/// | `y[i]` | `p` ≤ 16 | measured signals, in the units of the plant's outputs |
/// | `noise[i]` | `p` | added to `y[i]`: sensor noise for trials |
/// | `u[j]` | `m` ≤ 4 | inputs of the plant |
/// | `x_hat[i]` | `n` ≤ 16 | estimated states, then estimated disturbances of the inputs |
/// | `sample_time` | 1 | \[s\] |
/// | `mode` | 1 | mode of the plant, for tables with phases |
///
/// A table with phases has rows for each of them, beyond its ends as well: a phase begins at the first sample at which
/// `mode` is that of the next one, whenever that is, and `x0 + e` continues without a jump. Where the table says so,
/// the first phase comes after the last, with nominal states and measured signals that have moved on.
///
/// The estimate starts on the trajectory. Sampled in both interfaces; `u(k)` depends on `y(k)`.
pub struct TvlqrController {
    y: [Real; MAX_NY],
    noise: [Real; MAX_NY],
    u: [Real; MAX_NU],
    x_hat: [Real; MAX_NX],
    sample_time: Real,
    u_min: [Real; MAX_NU],
    u_max: [Real; MAX_NU],
    feedback: Boolean,
    mode: Integer,
    /// Fingerprint of the table.
    table: Memory,
    /// Number of the next sample.
    sample: Memory,
    /// Phase of the last sample, and the times at which phases had begun again.
    phase: Memory,
    turn: Memory,
    /// Predicted deviations of the next sample, from the trajectory of that phase.
    predicted: MemoryBlock,
    /// Outputs of the last sample: inputs of the plant, then the estimate.
    held: MemoryBlock,
    library: Library,
}

/// Results of one sample.
struct Sample<S> {
    /// Deviations after the correction.
    deviation: [S; MAX_NX],
    /// Inputs of the plant, limited.
    u: [S; MAX_NU],
}

impl TvlqrController {
    fn gains<S: Scalar>(&self, q: &Values<S>) -> Option<Arc<Gains>> {
        self.library.get(q[self.table].value())
    }

    /// Phase of the last sample.
    fn before<S: Scalar>(&self, q: &Values<S>) -> Place {
        Place { turn: q[self.turn].value() as i64, phase: q[self.phase].value() as usize }
    }

    /// Phase and row of the present sample.
    fn row<'g, S: Scalar>(&self, q: &Values<S>, gains: &'g Gains) -> (Place, Row<'g>) {
        let sample = q[self.sample].value() as i64;
        let place = match q[self.feedback] {
            true => gains.place_in(self.before(q), q[self.mode]),
            // Open loop: whatever the plant does.
            false => gains.place_at(sample),
        };
        (place, gains.row(place, sample))
    }

    /// Correction by the measurement, then feedback.
    fn correct<S: Scalar>(&self, q: &Values<S>, gains: &Gains, (place, row): (Place, &Row<'_>)) -> Sample<S> {
        let (n, m, p) = (gains.sizes.n, gains.sizes.m, gains.sizes.p);
        let last = self.before(q);
        let before = gains.row(last, q[self.sample].value() as i64);
        let nominal = |place: Place, row: &Row<'_>, i: usize| row.x[i] + gains.advance(place.turn, i);
        let mut deviation = [S::zero(); MAX_NX];
        for (i, e) in deviation.iter_mut().enumerate().take(n) {
            // Zero within a phase.
            *e = q[self.predicted.at(i)] + (nominal(last, &before, i) - nominal(place, row, i));
        }
        let mut innovation = [S::zero(); MAX_NY];
        for (j, innovation) in innovation.iter_mut().enumerate().take(p) {
            let expected = (0..n).fold(S::from(row.y[j]), |sum, i| {
                sum + (deviation[i] + gains.advance(place.turn, i)) * row.output[j * n + i]
            });
            *innovation = q[self.y[j]] + q[self.noise[j]] - expected;
        }
        for (i, e) in deviation.iter_mut().enumerate().take(n) {
            *e = (0..p).fold(*e, |sum, j| sum + innovation[j] * row.correction[i * p + j]);
        }
        let mut u = [S::zero(); MAX_NU];
        for (l, u) in u.iter_mut().enumerate().take(m) {
            let mut command = S::from(row.u[l]);
            if q[self.feedback] {
                command = (0..n).fold(command, |sum, i| sum - deviation[i] * row.feedback[l * n + i]);
            }
            *u = command.clamp_to(q[self.u_min[l]], q[self.u_max[l]]);
        }
        Sample { deviation, u }
    }
}

impl Model for TvlqrController {
    const IDENTITY: Identity = Identity {
        model_identifier: "tvlqr_controller",
        model_name: "tvlqr-controller",
        description: "Regulator with state estimator along a trajectory; trajectory and gains are in its resources",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        use std::array::from_fn;
        let number = |name: &str, i: usize| format!("{name}[{}]", i + 1);
        let y = from_fn(|i| t.input(number("y", i)).about(format!("measured signal {}", i + 1)).real(0.0));
        let noise = from_fn(|i| {
            let about = format!("added to y[{}]: sensor noise for trials", i + 1);
            t.input(number("noise", i)).about(about).real(0.0)
        });
        let u = from_fn(|j| {
            let about = format!("input {} of the plant; 0 beyond those of the table", j + 1);
            t.output(number("u", j)).about(about).discrete().computed()
        });
        let x_hat = from_fn(|i| {
            let about =
                format!("estimate of state {}; disturbances of the inputs stand behind the states", i + 1);
            t.output(number("x_hat", i)).about(about).discrete().computed()
        });
        let sample_time = t
            .parameter("sample_time")
            .unit("s")
            .about("time between the rows of the table")
            .min(SMALLEST_SAMPLE_TIME)
            .nominal(0.001)
            .real(0.001);
        let limit = |t: &mut Table, name: &str, what: &str, j: usize, start: f64| {
            let about = format!("{what} value of u[{}]", j + 1);
            t.parameter(number(name, j)).about(about).real(start)
        };
        let u_min = from_fn(|j| limit(t, "u_min", "smallest", j, -UNLIMITED));
        let u_max = from_fn(|j| limit(t, "u_max", "largest", j, UNLIMITED));
        let about = "false: the nominal inputs alone, open loop; the estimate goes on";
        let feedback = t.parameter("feedback").about(about).boolean(true);
        let about = "mode of the plant, which tells the phase of a table with phases";
        let mode = t.input("mode").about(about).integer(0);
        Self {
            y,
            noise,
            u,
            x_hat,
            sample_time,
            u_min,
            u_max,
            feedback,
            mode,
            table: t.memory(1).at(0),
            sample: t.memory(1).at(0),
            phase: t.memory(1).at(0),
            turn: t.memory(1).at(0),
            predicted: t.memory(MAX_NX),
            held: t.memory(MAX_NU + MAX_NX),
            library: Library::new(),
        }
    }

    fn load_resources(&self, folder: Option<&Path>, q: &mut Values<f64>) -> Outcome {
        let missing = || format!("no resources folder was given, and the table {} is there", gains::FILE);
        let folder = folder.ok_or_else(missing).map_err(Refusal::Error)?;
        q[self.table] = self.library.load(folder).map_err(Refusal::Error)?;
        Ok(())
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        for j in 0..MAX_NU {
            let (low, high) = (q[self.u_min[j]].value(), q[self.u_max[j]].value());
            if low > high {
                let j = j + 1;
                return Err(Refusal::Error(format!(
                    "u_min[{j}] = {low} is above u_max[{j}] = {high}; it must be at most that"
                )));
            }
        }
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        if !q.at_sample {
            for (j, u) in self.u.iter().enumerate() {
                q[*u] = q[self.held.at(j)];
            }
            for (i, x) in self.x_hat.iter().enumerate() {
                q[*x] = q[self.held.at(MAX_NU + i)];
            }
            return Ok(());
        }
        let Some(gains) = self.gains(q) else {
            let text = "the FMU state comes from an FMU with another table; restore one of this FMU";
            return Err(Refusal::Error(text.into()));
        };
        let (place, row) = self.row(q, &gains);
        let sample = self.correct(q, &gains, (place, &row));
        if let Some(i) = sample.deviation.iter().position(|e| !e.value().is_finite()) {
            return Err(Refusal::Error(format!(
                "the estimate x_hat[{}] is not finite at t = {} s; are all measured signals finite?",
                i + 1,
                q.time.value()
            )));
        }
        for (variable, u) in self.u.iter().zip(sample.u) {
            q[*variable] = u;
        }
        for (i, variable) in self.x_hat.iter().enumerate() {
            let nominal = row.x.get(i).map_or(0.0, |x| x + gains.advance(place.turn, i));
            q[*variable] = sample.deviation[i] + nominal;
        }
        Ok(())
    }

    fn sample_period(&self, q: &Values<f64>) -> Option<f64> {
        Some(q[self.sample_time])
    }

    fn sample(&self, q: &mut Values<f64>) {
        // Without the table the equations were refused before.
        let Some(gains) = self.gains(q) else { return };
        let (n, m) = (gains.sizes.n, gains.sizes.m);
        let (place, row) = self.row(q, &gains);
        let sample = self.correct(q, &gains, (place, &row));
        for (j, u) in self.u.iter().enumerate() {
            q[self.held.at(j)] = q[*u];
        }
        for (i, x) in self.x_hat.iter().enumerate() {
            q[self.held.at(MAX_NU + i)] = q[*x];
        }
        for i in 0..n {
            let of_states = (0..n).fold(row.c[i], |sum, j| sum + row.a[i * n + j] * sample.deviation[j]);
            let of_inputs =
                (0..m).fold(of_states, |sum, l| sum + row.b[i * m + l] * (sample.u[l] - row.u[l]));
            q[self.predicted.at(i)] = of_inputs;
        }
        q[self.sample] += 1.0;
        (q[self.phase], q[self.turn]) = (place.phase as f64, place.turn as f64);
    }

    /// Wide limits, so that every output shows what it depends on.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        for j in 0..MAX_NU {
            let small = 0.01 + 0.001 * j as f64;
            (q[self.u_min[j]], q[self.u_max[j]]) = match draw % 3 {
                0 => (-UNLIMITED, UNLIMITED),
                1 => (-UNLIMITED, -small * UNLIMITED),
                _ => (small * UNLIMITED, UNLIMITED),
            };
        }
        q[self.feedback] = true;
    }
}
