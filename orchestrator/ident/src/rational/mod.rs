//! `A(z) y = B(z) u` as a simulation: what output error and instrumental variables share.
//!
//! A record that begins at any state is `A(z) y = B(z) u + sum_b xi_b delta(k - b)` with everything zero before its
//! first sample: as many impulses xi as there are lags stand for the initial state. The simulated outputs, their
//! derivatives with respect to every coefficient and the regressors of prefiltered least squares are then shifts of
//! signals that `A(z)^-1` filtered.

pub mod columns;
pub mod filter;
pub mod mask;

use nalgebra::DMatrix;

pub use mask::{Coefficient, Mask};

use crate::model::Arx;
use crate::record::Record;
use airloop_optim::linalg::StreamedQr;
use airloop_optim::linalg::spectral;
use airloop_optim::linalg::triangular::solve;
use columns::{Column, fold_columns};
use filter::Inverse;

/// Reason why records cannot be used for an estimate.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "numbers, as in each message")]
pub enum Error {
    /// No record.
    #[error("there is no record to estimate from")]
    NoRecord,
    /// The record has other channels than the model.
    #[error(
        "`{record}` has {inputs} inputs and {outputs} outputs, the model {n_u} and {n_y}; name the same columns"
    )]
    Channels { record: String, inputs: usize, outputs: usize, n_u: usize, n_y: usize },
    /// A value is not a number.
    #[error(
        "`{record}`, sample {sample} of {channel}: not a finite number; cut the record there or fill the gap"
    )]
    NotFinite { record: String, channel: String, sample: usize },
    /// Fewer samples than parameters.
    #[error(
        "`{record}` has {samples} samples, but at least {needed} are needed for this structure; use a longer record or fewer lags"
    )]
    TooShort { record: String, samples: usize, needed: usize },
    /// More outputs than one block of rows holds.
    #[error(
        "{n_y} outputs are more than the {MOST_OUTPUTS} that can be estimated together; identify them in groups"
    )]
    TooManyOutputs { n_y: usize },
    /// Nothing to estimate.
    #[error("no coefficient of the structure is free; raise na or nb")]
    NothingFree,
}

/// Outputs that one model has at most; the rows of all outputs at one time fit into a block of the QR.
const MOST_OUTPUTS: usize = 192;

/// Checks that records fit a model with `n_u` inputs and `n_y` outputs and have at least `needed` samples each.
///
/// # Errors
/// See [`Error`].
pub fn check_records(records: &[Record], n_u: usize, n_y: usize, needed: usize) -> Result<(), Error> {
    if records.is_empty() {
        return Err(Error::NoRecord);
    }
    if n_y > MOST_OUTPUTS {
        return Err(Error::TooManyOutputs { n_y });
    }
    for record in records {
        let name = || record.name.clone();
        let (inputs, outputs) = (record.inputs.len(), record.outputs.len());
        if (inputs, outputs) != (n_u, n_y) {
            return Err(Error::Channels { record: name(), inputs, outputs, n_u, n_y });
        }
        if record.len() < needed {
            return Err(Error::TooShort { record: name(), samples: record.len(), needed });
        }
        let channels = [("input", &record.inputs), ("output", &record.outputs)];
        for (kind, values) in channels {
            for (index, values) in values.iter().enumerate() {
                if let Some(sample) = values.iter().position(|value| !value.is_finite()) {
                    let channel = format!("{kind} {}", index + 1);
                    return Err(Error::NotFinite { record: name(), channel, sample });
                }
            }
        }
    }
    Ok(())
}

/// A record about the operating point of the model.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Inputs, shape \[n_u\]\[n\].
    pub u: Vec<Vec<f64>>,
    /// Outputs, shape \[n_y\]\[n\].
    pub y: Vec<Vec<f64>>,
}

impl Experiment {
    /// The record less the offsets.
    pub fn new(record: &Record, input_offset: &[f64], output_offset: &[f64]) -> Experiment {
        let about = |channels: &[Vec<f64>], offsets: &[f64]| -> Vec<Vec<f64>> {
            let less = |(values, offset): (&Vec<f64>, &f64)| values.iter().map(|v| v - offset).collect();
            channels.iter().zip(offsets).map(less).collect()
        };
        Experiment { u: about(&record.inputs, input_offset), y: about(&record.outputs, output_offset) }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.y.first().map_or(0, Vec::len)
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A simulation with the initial state that brings it closest to the measurement.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Impulses in place of the initial state, shape \[lags\]\[n_y\].
    pub impulses: Vec<Vec<f64>>,
    /// Simulated outputs about the operating point, shape \[n_y\]\[n\].
    pub y: Vec<Vec<f64>>,
    /// Measured minus simulated, shape \[n_y\]\[n\].
    pub residual: Vec<Vec<f64>>,
}

/// Simulates a record; the initial state minimizes the residual weighted by `root` (shape \[n_y, n_y\], the weight is
/// `root^T root`).
pub fn simulate(model: &Arx, experiment: &Experiment, root: &DMatrix<f64>) -> Simulation {
    let (n_y, n) = (experiment.y.len(), experiment.len());
    let lags = model.lags();
    let inverse = Inverse::new(&model.a, n_y);
    let forced = |k: usize, now: &mut [f64]| {
        for (lag, b) in model.b.iter().enumerate().take(k + 1) {
            for (u, b) in experiment.u.iter().zip(b.as_slice().chunks_exact(n_y)) {
                now.iter_mut().zip(b).for_each(|(now, b)| *now += b * u[k - lag]);
            }
        }
    };
    let difference = |y: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let of = |(measured, y): (&Vec<f64>, &Vec<f64>)| measured.iter().zip(y).map(|(m, y)| m - y).collect();
        experiment.y.iter().zip(y).map(of).collect()
    };
    let responses = inverse.impulses(n);
    let horizon = (memory(&responses) + lags).min(n);
    let rest = difference(&inverse.run(horizon, forced));
    let mut columns = initial_columns(&responses, lags);
    let states = columns.len();
    columns.push(Column::of(&rest));
    let mut fold = StreamedQr::new(states + 1);
    fold_columns(&columns, 0..horizon, root, &mut fold);
    let r = fold.finish().into_r();
    let z = r.view((0, states), (states, 1)).column(0).into_owned();
    let (found, _) = solve(&r.view((0, 0), (states, states)).into_owned(), &z, 1e-10);
    let impulses: Vec<Vec<f64>> = (0..lags).map(|b| (0..n_y).map(|i| found[b * n_y + i]).collect()).collect();
    let y = inverse.run(n, |k, now| {
        forced(k, now);
        if let Some(impulse) = impulses.get(k) {
            now.iter_mut().zip(impulse).for_each(|(now, impulse)| *now += impulse);
        }
    });
    let residual = difference(&y);
    Simulation { impulses, y, residual }
}

/// Samples until the impulse responses are negligible.
fn memory(responses: &[Vec<Vec<f64>>]) -> usize {
    responses.iter().flatten().map(Vec::len).max().unwrap_or(0)
}

/// Responses to the impulses that stand for the initial state: columns ordered by sample, then equation.
pub fn initial_columns(responses: &[Vec<Vec<f64>>], lags: usize) -> Vec<Column<'_>> {
    (0..lags)
        .flat_map(|shift| responses.iter().map(move |signal| Column { signal, shift, sign: 1.0 }))
        .collect()
}

/// A record filtered by `A(z)^-1`, for every equation.
#[derive(Debug, Clone)]
pub struct Filtered {
    /// `A(z)^-1 e_i u_j`, shape \[n_u\]\[n_y\]\[n_y\]\[n\]: signal, equation, output, sample.
    pub u: Vec<Vec<Vec<Vec<f64>>>>,
    /// Impulse responses, shape \[n_y\]\[n_y\]\[m\], as far as they are not negligible.
    pub impulses: Vec<Vec<Vec<f64>>>,
    inverse: Inverse,
}

impl Filtered {
    /// Filters inputs and impulses of an experiment.
    pub fn new(model: &Arx, experiment: &Experiment) -> Filtered {
        let inverse = Inverse::new(&model.a, experiment.y.len());
        let u = experiment.u.iter().map(|signal| inverse.columns(signal)).collect();
        let impulses = inverse.impulses(experiment.len());
        Filtered { u, impulses, inverse }
    }

    /// `A(z)^-1 e_i y_m` for outputs (measured or simulated), shape as [`Filtered::u`].
    pub fn outputs(&self, y: &[Vec<f64>]) -> Vec<Vec<Vec<Vec<f64>>>> {
        y.iter().map(|signal| self.inverse.columns(signal)).collect()
    }

    /// One column per free coefficient: derivatives of the simulated outputs if `y` are filtered simulated outputs,
    /// prefiltered regressors if they are measured ones.
    pub fn columns<'a>(&'a self, mask: &Mask, y: &'a [Vec<Vec<Vec<f64>>>]) -> Vec<Column<'a>> {
        let column = |coefficient: &Coefficient| match *coefficient {
            Coefficient::A { lag, row, column } => Column { signal: &y[column][row], shift: lag, sign: -1.0 },
            Coefficient::B { lag, row, column } => {
                Column { signal: &self.u[column][row], shift: lag, sign: 1.0 }
            }
        };
        mask.coefficients().iter().map(column).collect()
    }

    /// `A(z)^-1 y`, shape \[n_y\]\[n\].
    pub fn target(&self, y: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let n = y.first().map_or(0, Vec::len);
        self.inverse.run(n, |k, now| now.iter_mut().zip(y).for_each(|(now, y)| *now = y[k]))
    }

    /// Folds rows of `columns` with the initial state of this record eliminated: the factor of what the impulses cannot
    /// explain, shape \[columns, columns\].
    pub fn eliminate(&self, columns: &[Column], lags: usize, root: &DMatrix<f64>) -> DMatrix<f64> {
        let n = columns.iter().flat_map(|column| column.signal.first()).map(Vec::len).max().unwrap_or(0);
        let mut all = initial_columns(&self.impulses, lags);
        let states = all.len();
        all.extend_from_slice(columns);
        let horizon = (memory(&self.impulses) + lags).min(n);
        let mut fold = StreamedQr::new(all.len());
        fold_columns(&all, 0..horizon, root, &mut fold);
        let early = fold.finish().into_r();
        let mut fold = StreamedQr::new(columns.len());
        fold.push(&early.view((states, states), (columns.len(), columns.len())).into_owned());
        fold_columns(columns, horizon..n, root, &mut fold);
        fold.finish().into_r()
    }
}

/// Largest modulus of the roots of `A(z)` (below 1: stable); infinite if a coefficient is not finite.
pub fn spectral_radius(model: &Arx) -> f64 {
    let n_y = model.output_offset.len();
    let size = n_y * model.a.len();
    if size == 0 {
        return 0.0;
    }
    if !model.a.iter().chain(&model.b).flat_map(|m| m.iter()).all(|value| value.is_finite()) {
        return f64::INFINITY;
    }
    let mut companion = DMatrix::zeros(size, size);
    for (lag, a) in model.a.iter().enumerate() {
        companion.view_mut((lag * n_y, 0), (n_y, n_y)).copy_from(&-a);
        if lag + 1 < model.a.len() {
            companion.view_mut((lag * n_y, (lag + 1) * n_y), (n_y, n_y)).fill_with_identity();
        }
    }
    spectral::eigenvalues(&companion).iter().fold(0.0, |radius, pole| f64::max(radius, pole.norm()))
}

/// The model with its poles drawn toward the origin so that the largest has the modulus `radius` (0..1); a model whose
/// poles all lie within stays as it is.
pub fn stabilized(model: &Arx, radius: f64) -> Arx {
    let largest = spectral_radius(model);
    if !largest.is_finite() || largest <= radius {
        return model.clone();
    }
    let ratio = radius / largest;
    let scaled = |(lag, a): (usize, &DMatrix<f64>)| a * ratio.powi(lag as i32 + 1);
    Arx { a: model.a.iter().enumerate().map(scaled).collect(), ..model.clone() }
}
