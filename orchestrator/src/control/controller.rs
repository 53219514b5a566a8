//! Rows of gains, as a table, and the controller as equations.

use std::fmt::Write;

use nalgebra::DMatrix;

/// What holds from one sample to the next. n: states and disturbances, m: inputs, p: measured signals.
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
    /// What the nominal trajectory lacks of the model's, one sample later, `[n]`.
    pub drift: Vec<f64>,
    /// Measured signals of deviations C, `[p, n]`.
    pub output: DMatrix<f64>,
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
    /// Lower and upper limit of every input, `[m]`.
    pub limits: Vec<(f64, f64)>,
}

/// What the controller remembers between samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    sample: usize,
    deviation: Vec<f64>,
}

impl Controller {
    /// The estimate before the first sample: on the trajectory.
    pub fn begin(&self) -> Estimate {
        Estimate { sample: 0, deviation: vec![0.0; self.rows[0].states.len()] }
    }

    /// Takes the measured signals `[p]` of a sample and gives the inputs `[m]` that are held until the next, and the
    /// estimated states `[n]`:
    /// `e = e + L (y - y0 - C e)`, `u = u0 - K e` within the limits, then `e = A e + B (u - u0) + c`.
    pub fn step(&self, estimate: &mut Estimate, measured: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let row = &self.rows[estimate.sample.min(self.rows.len() - 1)];
        let e = &mut estimate.deviation;
        let innovation: Vec<f64> = measured
            .iter()
            .enumerate()
            .map(|(j, y)| {
                let expected =
                    e.iter().enumerate().fold(row.measured[j], |sum, (i, e)| sum + e * row.output[(j, i)]);
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
        let states = row.states.iter().zip(e.iter()).map(|(x, e)| x + e).collect();
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

    /// The table that the FMU `tvlqr-controller` reads: a header, then a row per sample, with every digit.
    pub fn table(&self) -> String {
        let row = &self.rows[0];
        let mut text = String::from("time");
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
        for (k, row) in self.rows.iter().enumerate() {
            let _ = write!(text, "{:?}", self.start + k as f64 * self.sample_time);
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
        text
    }
}
