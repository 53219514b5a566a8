//! Design: from trajectory, weights and noise to a controller.
//!
//! The regulator minimizes the sum of weighted squares of deviations (Riccati equation backward along the trajectory
//! from the steady solution at its end); the estimator is the Kalman filter of the linearized samples (forward from
//! the initial covariance, steady in the hold). Each input may have a disturbance added to it that drifts; the
//! estimator follows it and the feedback takes it away, which is what makes up for wrong masses and frictions.

use nalgebra::{DMatrix, DVector};

use super::controller::{Controller, Row};
use super::{Error, Linearization, Nominal, Sampled, riccati};
use crate::transcription::Point;

/// A measured signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Measured {
    /// A state of the plant.
    State(usize),
    /// An output of the plant.
    Output(usize),
}

/// Requirements on the design.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Deviation of every state that costs as much as the others, `[n_x]`; infinite: no cost.
    pub state_deviation: Vec<f64>,
    /// Deviation of every input that costs as much as those, `[n_u]`.
    pub input_deviation: Vec<f64>,
    /// Measured signals, `[p]`.
    pub measured: Vec<Measured>,
    /// Standard deviation of their noise, white from sample to sample, `[p]`.
    pub noise: Vec<f64>,
    /// Drift of every state that the model does not describe: standard deviation after one second, `[n_x]`.
    pub state_drift: Vec<f64>,
    /// Drift of the disturbance of every input: standard deviation after one second, `[n_u]`; 0: none.
    pub input_drift: Vec<f64>,
    /// Standard deviation of the initial states from the trajectory, `[n_x]`.
    pub initial: Vec<f64>,
    /// Limits of the inputs, `[n_u]`.
    pub limits: Vec<(f64, f64)>,
}

impl Design {
    /// A design that suits the spans of a trajectory: deviations cost alike at a tenth of each span; every state drifts
    /// by 0.3 % of its span in a second, every input is disturbed by what drifts by a tenth of its span, and the
    /// initial states are known to a hundredth of theirs.
    pub fn of(
        nominal: &Nominal,
        measured: Vec<Measured>,
        noise: Vec<f64>,
        limits: Vec<(f64, f64)>,
    ) -> Design {
        let (states, inputs) = nominal.spans();
        let part = |spans: &[f64], part: f64| spans.iter().map(|span| part * span).collect::<Vec<f64>>();
        Design {
            state_deviation: part(&states, 0.1),
            input_deviation: part(&inputs, 0.1),
            measured,
            noise,
            state_drift: part(&states, 0.003),
            input_drift: part(&inputs, 0.1),
            initial: part(&states, 0.01),
            limits,
        }
    }

    /// Inputs with a disturbance.
    pub(super) fn disturbed(&self) -> Vec<usize> {
        (0..self.input_drift.len()).filter(|&j| self.input_drift[j] > 0.0).collect()
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let positive = |what: &str, values: &[f64], zero: bool| {
            let fits = |value: &f64| *value > 0.0 || (zero && *value == 0.0);
            match values.iter().position(|value| !fits(value)) {
                None => Ok(()),
                Some(i) => Err(Error::Setting {
                    what: format!("{what}[{}]", i + 1),
                    value: values[i],
                    allowed: if zero { "a number of at least 0" } else { "a positive number" },
                }),
            }
        };
        positive("allowed deviation of state", &self.state_deviation, false)?;
        positive("allowed deviation of input", &self.input_deviation, false)?;
        positive("noise of measured signal", &self.noise, false)?;
        positive("drift of state", &self.state_drift, true)?;
        positive("drift of the disturbance of input", &self.input_drift, true)?;
        positive("initial deviation of state", &self.initial, true)
    }
}

/// Designs the controller.
///
/// # Errors
/// Settings out of range, a measured signal that depends directly on an input, functions without a value, or Riccati
/// equations without a stabilizing solution at the end of the trajectory.
pub fn design(plant: &mut Sampled<'_>, nominal: &Nominal, design: &Design) -> Result<Controller, Error> {
    design.check()?;
    let disturbed = design.disturbed();
    let mut rows = Vec::with_capacity(nominal.samples() + 1);
    let mut linear = Vec::with_capacity(nominal.samples() + 1);
    for k in 0..=nominal.samples() {
        let at = Point { time: nominal.time(k), states: &nominal.states[k], inputs: &nominal.inputs[k] };
        let sample = plant.linearize(at)?;
        rows.push(row(plant, at, &sample, nominal.states.get(k + 1), design, &disturbed)?);
        linear.push(sample);
    }
    gains(&mut rows, &linear, nominal, design, None)?;
    Ok(Controller {
        start: nominal.start,
        sample_time: nominal.sample_time,
        rows,
        phases: Vec::new(),
        repeat: None,
        limits: design.limits.clone(),
    })
}

/// Feedback and corrections of rows that follow each other. Without a horizon \[samples\] the steady solutions stand at
/// the end; with one the regulator looks that far beyond it and the estimator has the covariance that it has reached:
/// for plants with motions that no input reaches, such as that of a foot on the ground.
pub(super) fn gains(
    rows: &mut [Row],
    linear: &[Linearization],
    nominal: &Nominal,
    design: &Design,
    horizon: Option<usize>,
) -> Result<(), Error> {
    let disturbed = design.disturbed();
    regulate(rows, linear, nominal, (design, &disturbed), horizon)?;
    estimate(rows, nominal, (design, &disturbed), horizon)
}

/// One row with all but the gains; the last row is followed by itself.
pub(super) fn row(
    plant: &mut Sampled<'_>,
    at: Point<'_>,
    sample: &Linearization,
    after: Option<&Vec<f64>>,
    design: &Design,
    disturbed: &[usize],
) -> Result<Row, Error> {
    let (n, m, extra) = (at.states.len(), at.inputs.len(), disturbed.len());
    let mut a = DMatrix::identity(n + extra, n + extra);
    a.view_mut((0, 0), (n, n)).copy_from(&sample.a);
    for (k, &j) in disturbed.iter().enumerate() {
        a.view_mut((0, n + k), (n, 1)).copy_from(&sample.b.column(j));
    }
    let mut b = DMatrix::zeros(n + extra, m);
    b.view_mut((0, 0), (n, m)).copy_from(&sample.b);
    let next = after.map_or(at.states, Vec::as_slice);
    let mut drift: Vec<f64> = sample.next.iter().zip(next).map(|(model, nominal)| model - nominal).collect();
    drift.resize(n + extra, 0.0);
    let (measured, output) = measure(plant, at, design, n + extra)?;
    let mut states = at.states.to_vec();
    states.resize(n + extra, 0.0);
    Ok(Row {
        states,
        inputs: at.inputs.to_vec(),
        measured,
        feedback: DMatrix::zeros(m, n + extra),
        correction: DMatrix::zeros(n + extra, design.measured.len()),
        a,
        b,
        drift,
        output,
    })
}

/// Nominal measured signals and their derivatives by the states.
fn measure(
    plant: &mut Sampled<'_>,
    at: Point<'_>,
    design: &Design,
    width: usize,
) -> Result<(Vec<f64>, DMatrix<f64>), Error> {
    let dynamics = plant.dynamics();
    let size = dynamics.size();
    let (n, arguments) = (size.states, size.arguments());
    let mut values = vec![0.0; size.values()];
    let mut jacobian = vec![0.0; size.values() * arguments];
    if design.measured.iter().any(|signal| matches!(signal, Measured::Output(_))) {
        dynamics.jacobian(at, &mut values, &mut jacobian).map_err(Error::at(at.time))?;
    }
    let mut signals = Vec::new();
    let mut output = DMatrix::zeros(design.measured.len(), width);
    for (row, signal) in design.measured.iter().enumerate() {
        match *signal {
            Measured::State(i) => {
                signals.push(at.states[i]);
                output[(row, i)] = 1.0;
            }
            Measured::Output(i) => {
                let slopes = &jacobian[(n + i) * arguments..][..arguments];
                if let Some(j) = slopes[n..].iter().position(|slope| *slope != 0.0) {
                    let names = dynamics.names();
                    let (signal, input) = (names[arguments + i].clone(), names[n + j].clone());
                    return Err(Error::Direct { signal, input });
                }
                signals.push(values[n + i]);
                slopes[..n].iter().enumerate().for_each(|(j, slope)| output[(row, j)] = *slope);
            }
        }
    }
    Ok((signals, output))
}

/// Feedback of all rows; disturbances are taken away by their negative.
fn regulate(
    rows: &mut [Row],
    linear: &[Linearization],
    nominal: &Nominal,
    (design, disturbed): (&Design, &[usize]),
    horizon: Option<usize>,
) -> Result<(), Error> {
    let weights = |deviations: &[f64]| {
        DMatrix::from_diagonal(&DVector::from_iterator(
            deviations.len(),
            deviations.iter().map(|d| 1.0 / (d * d)),
        ))
    };
    let (q, r) = (weights(&design.state_deviation), weights(&design.input_deviation));
    let unstable = |time: f64| Error::Riccati {
        what: "the regulator has no stabilizing gain",
        time,
        why: "the inputs do not reach every state that is not stable by itself, or such a state has no weight",
        remedy: "weights",
    };
    let end = nominal.samples();
    let (a, b) = (&linear[end].a, &linear[end].b);
    let last = match horizon {
        None => riccati::steady(a, b, &q, &r),
        Some(samples) => riccati::far(a, b, (&q, &r), samples),
    };
    let mut p = last.ok_or_else(|| unstable(nominal.time(end)))?;
    for k in (0..=end).rev() {
        let (a, b) = (&linear[k].a, &linear[k].b);
        let gain = riccati::gain(a, b, &p, &r).ok_or_else(|| unstable(nominal.time(k)))?;
        let n = a.nrows();
        rows[k].feedback.view_mut((0, 0), (gain.nrows(), n)).copy_from(&gain);
        disturbed.iter().enumerate().for_each(|(i, &j)| rows[k].feedback[(j, n + i)] = 1.0);
        if k < end {
            p = riccati::cost_before((a, b), &gain, &p, (&q, &r));
        }
    }
    Ok(())
}

/// Corrections of all rows.
fn estimate(
    rows: &mut [Row],
    nominal: &Nominal,
    (design, disturbed): (&Design, &[usize]),
    horizon: Option<usize>,
) -> Result<(), Error> {
    let squares = |values: &[f64], factor: f64| {
        DMatrix::from_diagonal(&DVector::from_iterator(values.len(), values.iter().map(|v| factor * v * v)))
    };
    let unseen = |time: f64| Error::Riccati {
        what: "the estimator has no stabilizing gain",
        time,
        why: "the measured signals do not show every state and disturbance that is not stable by itself",
        remedy: "measured signals or drifts",
    };
    let drifts: Vec<f64> = disturbed.iter().map(|&j| design.input_drift[j]).collect();
    let q = squares(&[&design.state_drift[..], &drifts].concat(), nominal.sample_time);
    let r = squares(&design.noise, 1.0);
    // The disturbance is unknown at first as far as it drifts in a second.
    let mut p = squares(&[&design.initial[..], &drifts].concat(), 1.0);
    let end = nominal.samples();
    for (k, row) in rows[..end].iter_mut().enumerate() {
        row.correction = riccati::correction(&p, &row.output, &r).ok_or_else(|| unseen(nominal.time(k)))?;
        p = riccati::corrected(&p, &row.correction, &row.output, &r);
        p = riccati::predicted(&p, &row.a, &q);
    }
    let last = &mut rows[end];
    let steady = match horizon {
        None => riccati::steady(&last.a.transpose(), &last.output.transpose(), &q, &r),
        Some(_) => Some(p),
    };
    let correction = steady.and_then(|p| riccati::correction(&p, &last.output, &r));
    last.correction = correction.ok_or_else(|| unseen(nominal.time(end)))?;
    Ok(())
}
