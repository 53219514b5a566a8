//! Rows of gains, as a table, and the controller as equations.

use std::fmt::Write;

use nalgebra::DMatrix;

/// Values that hold from one sample to the next. n: states and disturbances, m: inputs, p: measured signals.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Nominal states, `[n]`.
    pub states: Vec<f64>,
    /// Nominal inputs, `[m]`.
    pub inputs: Vec<f64>,
    /// Nominal measured signals, `[p]`.
    pub measured: Vec<f64>,
    /// Feedback K, `[m, n]`.
    pub feedback: DMatrix<f64>,
    /// Correction of the estimate L, `[n, p]`.
    pub correction: DMatrix<f64>,
    /// Deviations one sample later A, `[n, n]`.
    pub a: DMatrix<f64>,
    /// Effect of the inputs one sample later B, `[n, m]`.
    pub b: DMatrix<f64>,
    /// Defect of the nominal trajectory in the model equations over the next sample, `[n]`.
    pub drift: Vec<f64>,
    /// Measured signals of deviations C, `[p, n]`.
    pub output: DMatrix<f64>,
}

/// Rows of one phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhaseRows {
    /// Mode of the plant while it lasts.
    pub mode: i32,
    /// Sample of the first row; before the first one for the first phase of a plan that repeats itself.
    pub first_sample: i64,
    /// Number of rows.
    pub rows: usize,
}

/// Begin of the phases of a plan from anew.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeat {
    /// Samples after which they begin again.
    pub samples: usize,
    /// Change of the nominal states until then, `[n]`.
    pub advance: Vec<f64>,
}

/// A regulator with its estimator, one row per sample; the last row holds from there on.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    /// Time of the first sample \[s\].
    pub start: f64,
    /// Time between samples \[s\].
    pub sample_time: f64,
    /// Rows, at least one.
    pub rows: Vec<Row>,
    /// Rows of every phase, where the mode of the plant tells the phase; they reach beyond its ends. Else none.
    pub phases: Vec<PhaseRows>,
    /// Of a plan that repeats itself: after the last phase comes the first. None: the last row holds.
    pub repeat: Option<Repeat>,
    /// Lower and upper limit of every input, `[m]`.
    pub limits: Vec<(f64, f64)>,
}

/// Memory of the controller between samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    sample: usize,
    phase: usize,
    /// Times at which the phases have begun again.
    turn: usize,
    deviation: Vec<f64>,
}

impl Controller {
    /// The estimate before the first sample: on the trajectory.
    pub fn begin(&self) -> Estimate {
        Estimate { sample: 0, phase: 0, turn: 0, deviation: vec![0.0; self.rows[0].states.len()] }
    }

    /// The row of a sample in a phase of a turn.
    fn row(&self, (turn, phase): (usize, usize), sample: usize) -> &Row {
        let sample = sample as i64 - (turn * self.repeat.as_ref().map_or(0, |repeat| repeat.samples)) as i64;
        match self.phases.get(phase) {
            None => &self.rows[(sample as usize).min(self.rows.len() - 1)],
            Some(own) => {
                let before: usize = self.phases[..phase].iter().map(|phase| phase.rows).sum();
                let row = (sample - own.first_sample).clamp(0, own.rows as i64 - 1);
                &self.rows[before + row as usize]
            }
        }
    }

    /// Nominal states of a sample in a phase of a turn, `[n]`.
    fn states(&self, (turn, phase): (usize, usize), sample: usize) -> Vec<f64> {
        let mut states = self.row((turn, phase), sample).states.clone();
        for (x, by) in states.iter_mut().zip(self.repeat.iter().flat_map(|repeat| &repeat.advance)) {
            *x += turn as f64 * by;
        }
        states
    }

    /// Same as [`Controller::step`] (`measured` \[p\]; inputs \[m\] and states \[n\]), where the plant is in a mode:
    /// the next phase begins when its mode is seen, and `x0 + e` continues without a jump.
    pub fn step_in(&self, estimate: &mut Estimate, mode: i32, measured: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (turn, phase) = (estimate.turn, estimate.phase);
        let again = phase + 1 == self.phases.len() && self.repeat.is_some();
        let (next_turn, next) = if again { (turn + 1, 0) } else { (turn, phase + 1) };
        let mode_of = |phase: usize| self.phases.get(phase).map(|phase| phase.mode);
        if mode_of(next) == Some(mode) && mode_of(phase) != Some(mode) {
            (estimate.turn, estimate.phase) = (next_turn, next);
            let old = self.states((turn, phase), estimate.sample);
            let new = self.states((next_turn, next), estimate.sample);
            let nominal = old.iter().zip(&new);
            estimate.deviation.iter_mut().zip(nominal).for_each(|(e, (old, new))| *e += old - new);
        }
        self.step(estimate, measured)
    }

    /// Takes the measured signals `[p]` of a sample and gives the inputs `[m]` that are held until the next, and the
    /// estimated states `[n]`:
    /// `e = e + L (y - y0 - C e)`, `u = u0 - K e` within the limits, then `e = A e + B (u - u0) + c`.
    pub fn step(&self, estimate: &mut Estimate, measured: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let row = self.row((estimate.turn, estimate.phase), estimate.sample);
        let nominal = self.states((estimate.turn, estimate.phase), estimate.sample);
        let e = &mut estimate.deviation;
        let innovation: Vec<f64> = measured
            .iter()
            .enumerate()
            .map(|(j, y)| {
                let expected = e.iter().enumerate().fold(row.measured[j], |sum, (i, e)| {
                    sum + (e + nominal[i] - row.states[i]) * row.output[(j, i)]
                });
                y - expected
            })
            .collect();
        for (i, e) in e.iter_mut().enumerate() {
            *e = innovation.iter().enumerate().fold(*e, |sum, (j, y)| sum + y * row.correction[(i, j)]);
        }
        let inputs: Vec<f64> = (row.inputs.iter().zip(&self.limits).enumerate())
            .map(|(l, (&u0, &(low, high)))| {
                let command = e.iter().enumerate().fold(u0, |sum, (i, e)| sum - e * row.feedback[(l, i)]);
                command.max(low).min(high)
            })
            .collect();
        let states = nominal.iter().zip(e.iter()).map(|(x, e)| x + e).collect();
        *e = (0..e.len())
            .map(|i| {
                let of_states =
                    e.iter().enumerate().fold(row.drift[i], |sum, (j, e)| sum + row.a[(i, j)] * e);
                inputs
                    .iter()
                    .enumerate()
                    .fold(of_states, |sum, (l, u)| sum + row.b[(i, l)] * (u - row.inputs[l]))
            })
            .collect();
        estimate.sample += 1;
        (inputs, states)
    }

    /// The table that the FMU `tvlqr-controller` reads: a header, then a row per sample, with every digit, and of a
    /// plan that repeats itself `repeat`, the samples until it begins again and the change of the states until then.
    pub fn table(&self) -> String {
        let row = &self.rows[0];
        let mut text = String::from(if self.phases.is_empty() { "time" } else { "time,sample,mode" });
        let blocks: [(&str, usize, usize); 9] = [
            ("x", row.states.len(), 0),
            ("u", row.inputs.len(), 0),
            ("y", row.measured.len(), 0),
            ("K", row.feedback.nrows(), row.feedback.ncols()),
            ("L", row.correction.nrows(), row.correction.ncols()),
            ("A", row.a.nrows(), row.a.ncols()),
            ("B", row.b.nrows(), row.b.ncols()),
            ("c", row.drift.len(), 0),
            ("C", row.output.nrows(), row.output.ncols()),
        ];
        // Writing into a String cannot fail.
        for (letter, rows, columns) in blocks {
            for i in 1..=rows {
                let _ = match columns {
                    0 => write!(text, ",{letter}[{i}]"),
                    _ => (1..=columns).try_for_each(|j| write!(text, ",{letter}[{i}][{j}]")),
                };
            }
        }
        text.push('\n');
        let of_phase = |phase: &PhaseRows| (phase.first_sample..).take(phase.rows);
        let mut places: Vec<(i64, Option<i32>)> =
            self.phases.iter().flat_map(|phase| of_phase(phase).map(|k| (k, Some(phase.mode)))).collect();
        if self.phases.is_empty() {
            places.extend((0..self.rows.len() as i64).map(|k| (k, None)));
        }
        for (&(k, mode), row) in places.iter().zip(&self.rows) {
            let _ = write!(text, "{:?}", self.start + k as f64 * self.sample_time);
            let _ = mode.map_or(Ok(()), |mode| write!(text, ",{k},{mode}"));
            let matrix = |matrix: &DMatrix<f64>| matrix.transpose().iter().copied().collect::<Vec<f64>>();
            let parts = [
                row.states.clone(),
                row.inputs.clone(),
                row.measured.clone(),
                matrix(&row.feedback),
                matrix(&row.correction),
                matrix(&row.a),
                matrix(&row.b),
                row.drift.clone(),
                matrix(&row.output),
            ];
            let _ = parts.iter().flatten().try_for_each(|value| write!(text, ",{value:?}"));
            text.push('\n');
        }
        if let Some(repeat) = &self.repeat {
            let _ = write!(text, "repeat,{}", repeat.samples);
            let _ = repeat.advance.iter().try_for_each(|value| write!(text, ",{value:?}"));
            text.push('\n');
        }
        text
    }
}
