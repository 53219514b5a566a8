//! Refined instrumental variables for the full-matrix structure `A(z) y = B(z) u` with noisy measurements.
//!
//! Every iteration filters the records by the present `A(z)^-1`, takes the simulated outputs of the present model as
//! instruments for the measured ones, and solves `Z^T (t - Phi theta) = 0` (Young, Recursive Estimation and Time-Series
//! Analysis, ch. 7: SRIV; Ljung, System Identification, sec. 7.6). Consistent whatever the color of the noise, and with
//! white measurement noise as exact as output error at convergence. The equations are solved by a QR factorization of
//! `[Z, Phi, t]`, so that no product of data matrices is formed; the initial state of every record is eliminated.

use nalgebra::{DMatrix, DVector};

use super::model::Arx;
use super::parameters::Parameters;
use super::rational::columns::Column;
use super::rational::{
    Error, Experiment, Filtered, Mask, check_records, simulate, spectral_radius, stabilized,
};
use super::record::Record;
use airloop_optim::linalg::{StreamedQr, qr, triangular};

/// Poles of a prefilter stay within this radius, also when an iterate is unstable.
pub const FILTER_RADIUS: f64 = 0.9999;

/// Settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Most iterations.
    pub iterations: usize,
    /// Ends when the step is below this many standard deviations of the estimate (root mean square).
    pub tolerance: f64,
}

impl Default for Options {
    fn default() -> Options {
        Options { iterations: 20, tolerance: 1e-3 }
    }
}

/// Result of [`estimate`].
#[derive(Debug, Clone, PartialEq)]
pub struct InstrumentalVariables {
    /// The iterate with the smallest simulation error, usually the last one.
    pub model: Arx,
    /// Free coefficients with their covariance; its first-order formula holds for white measurement noise.
    pub parameters: Parameters,
    /// Covariance of the simulation error, shape \[n_y, n_y\].
    pub noise_covariance: DMatrix<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Whether the iterations settled.
    pub converged: bool,
}

/// Estimates the free coefficients of `mask` from records, starting at `start` (usually least squares).
///
/// # Errors
/// [`Error`] for records that do not fit the model or are too short.
pub fn estimate(
    start: &Arx,
    mask: &Mask,
    records: &[Record],
    options: &Options,
) -> Result<InstrumentalVariables, Error> {
    let (n_y, n_u) = (start.output_offset.len(), start.input_offset.len());
    let p = mask.coefficients().len();
    if p == 0 {
        return Err(Error::NothingFree);
    }
    check_records(records, n_u, n_y, mask.lags() + p.div_ceil(n_y) + 1)?;
    let experiments: Vec<Experiment> = records
        .iter()
        .map(|record| Experiment::new(record, &start.input_offset, &start.output_offset))
        .collect();
    let mut best: Option<(f64, InstrumentalVariables)> = None;
    let mut parameters = mask.parameters(start);
    let mut root = DMatrix::identity(n_y, n_y);
    let mut converged = false;
    for iteration in 0..=options.iterations {
        let model = mask.model(start, &parameters);
        let filter = stabilized(&model, FILTER_RADIUS);
        let round = round(&filter, mask, &experiments, &root);
        if spectral_radius(&model) < 1.0 && round.criterion.is_finite() {
            let covariance = triangular::covariance(&round.instruments).0;
            let names = mask.names();
            let found = InstrumentalVariables {
                model,
                parameters: Parameters { names, values: parameters.clone(), covariance },
                noise_covariance: round.noise_covariance.clone(),
                iterations: iteration,
                converged,
            };
            if best.as_ref().is_none_or(|(criterion, _)| converged || round.criterion < *criterion) {
                best = Some((round.criterion, found));
            }
        }
        if converged {
            break;
        }
        let (next, _) = triangular::solve(&round.regressors, &round.target, 1e-12);
        if !next.iter().all(|value| value.is_finite()) {
            break;
        }
        // The first round weighs all outputs alike, its covariance has no scale yet.
        let step = (&round.instruments * (&next - &parameters)).norm() / (p as f64).sqrt();
        converged = iteration > 0 && step < options.tolerance;
        parameters = next;
        root = round.root;
    }
    if let Some((_, found)) = best {
        return Ok(InstrumentalVariables { converged, ..found });
    }
    // No iterate was stable: the start, drawn into the unit circle.
    let model = stabilized(start, FILTER_RADIUS);
    let round = round(&model, mask, &experiments, &root);
    Ok(InstrumentalVariables {
        parameters: Parameters { names: mask.names(), values: mask.parameters(&model), covariance: None },
        model,
        noise_covariance: round.noise_covariance,
        iterations: options.iterations,
        converged: false,
    })
}

/// Least squares of the equation error on the same rows: the usual start.
///
/// # Errors
/// [`Error`] if a record is too short or has other channels than the model.
pub fn least_squares(template: &Arx, mask: &Mask, records: &[Record]) -> Result<Arx, Error> {
    let (n_y, n_u) = (template.output_offset.len(), template.input_offset.len());
    let p = mask.coefficients().len();
    check_records(records, n_u, n_y, mask.lags() + p.div_ceil(n_y.max(1)) + 1)?;
    let mut fold = StreamedQr::new(p + 1);
    let identity = DMatrix::identity(n_y, n_y);
    // Nothing is filtered: A(z) = 1.
    let plain = Arx { a: Vec::new(), b: Vec::new(), ..template.clone() };
    for record in records {
        let experiment = Experiment::new(record, &template.input_offset, &template.output_offset);
        let filtered = Filtered::new(&plain, &experiment);
        let outputs = filtered.outputs(&experiment.y);
        let mut columns = filtered.columns(mask, &outputs);
        columns.push(Column::of(&experiment.y));
        fold.push(&filtered.eliminate(&columns, mask.lags(), &identity));
    }
    let r = fold.finish().into_r();
    let z = r.view((0, p), (p, 1)).column(0).into_owned();
    Ok(mask.model(template, &triangular::solve(&r.view((0, 0), (p, p)).into_owned(), &z, 1e-13).0))
}

/// One round of the iteration.
struct Round {
    /// Triangular factor of the weighted instruments, shape \[p, p\].
    instruments: DMatrix<f64>,
    /// `Q^T Phi` and `Q^T t`, Q the basis of the instruments.
    regressors: DMatrix<f64>,
    target: DVector<f64>,
    noise_covariance: DMatrix<f64>,
    /// Inverse standard deviations of the simulation error on the diagonal.
    root: DMatrix<f64>,
    /// Sum of the logarithms of the mean squared simulation errors.
    criterion: f64,
}

fn round(model: &Arx, mask: &Mask, experiments: &[Experiment], root: &DMatrix<f64>) -> Round {
    let p = mask.coefficients().len();
    let n_y = root.nrows();
    let mut fold = StreamedQr::new(2 * p + 1);
    let mut sum = DMatrix::<f64>::zeros(n_y, n_y);
    let mut samples = 0;
    let mut power = 0.0;
    for experiment in experiments {
        let simulation = simulate(model, experiment, root);
        for i in 0..n_y {
            for l in 0..n_y {
                sum[(i, l)] += qr::dot(&simulation.residual[i], &simulation.residual[l]);
            }
            power += qr::dot(&experiment.y[i], &experiment.y[i]);
        }
        samples += experiment.len();
        let filtered = Filtered::new(model, experiment);
        let (instruments, measured) = (filtered.outputs(&simulation.y), filtered.outputs(&experiment.y));
        let target = filtered.target(&experiment.y);
        let mut columns = filtered.columns(mask, &instruments);
        columns.extend(filtered.columns(mask, &measured));
        columns.push(Column::of(&target));
        fold.push(&filtered.eliminate(&columns, mask.lags(), root));
    }
    let r = fold.finish().into_r();
    let noise_covariance = sum / samples as f64;
    let floor = f64::max(1e-24 * power / samples as f64, f64::MIN_POSITIVE);
    let variances = noise_covariance.diagonal().map(|variance| f64::max(variance, floor));
    Round {
        instruments: r.view((0, 0), (p, p)).into_owned(),
        regressors: r.view((0, p), (p, p)).into_owned(),
        target: r.view((0, 2 * p), (p, 1)).column(0).into_owned(),
        root: DMatrix::from_diagonal(&variances.map(|variance| 1.0 / variance.sqrt())),
        criterion: variances.iter().map(|variance| variance.ln()).sum(),
        noise_covariance,
    }
}
