//! Output error of the full-matrix structure `y = A(z)^-1 B(z) u`.

use nalgebra::{DMatrix, DVector};

use super::denoised::denoised;
use super::equivalent;
use super::levenberg_marquardt::{Found, Linear, Moments, Problem, minimize};
use super::{Error, Options, Outcome, with_covariance};
use crate::instrumental_variables::{self, FILTER_RADIUS};
use crate::model::Arx;
use crate::parameters::Parameters;
use crate::rational::columns::Column;
use crate::rational::{Experiment, Filtered, Mask, check_records, simulate, spectral_radius, stabilized};
use crate::record::Record;
use airloop_optim::linalg::{StreamedQr, qr};

/// Most starts that are tried.
const TRIES: usize = 3;

/// Result of [`refine`].
#[derive(Debug, Clone, PartialEq)]
pub struct OutputError {
    /// The refined model; stable.
    pub model: Arx,
    /// Free coefficients with their covariance (first order, white measurement noise).
    pub parameters: Parameters,
    /// Covariance of measured minus simulated, shape \[n_y, n_y\].
    pub noise_covariance: DMatrix<f64>,
    /// RMS of measured minus simulated at the start, shape \[n_y\].
    pub start_rms: Vec<f64>,
    /// RMS of measured minus simulated at the end, shape \[n_y\].
    pub rms: Vec<f64>,
    /// Iterations in the coefficients of the structure; a full structure is refined in state-space coordinates before.
    pub iterations: usize,
    /// Outcome of the iterations.
    pub outcome: Outcome,
    /// Condition number of the derivatives, columns scaled to length 1.
    pub condition: f64,
    /// Impulses that stand for the initial state of every record, shape \[records\]\[lags\]\[n_y\]:
    /// `A(z) y = B(z) u + sum_b xi_b delta(k - b)`.
    pub initial: Vec<Vec<Vec<f64>>>,
}

/// Minimizes the simulated error of an ARX structure from `model` (usually the least-squares estimate).
///
/// Starts are `model`, least squares, refined instrumental variables from both, and the same for the records as a model
/// of high order simulates them; unstable ones are drawn into the unit circle. The one with the smallest simulated
/// error is taken, the next only if the iterations stall. The offsets stay those of `model`.
///
/// # Errors
/// [`Error`] for records that do not fit the model or are too short.
///
/// ```
/// use airloop_ident::{model::Arx, output_error, rational::Mask, record::Record};
/// use nalgebra::DMatrix;
///
/// let u: Vec<f64> = (0..200).map(|k| if k % 23 < 9 { 1.0 } else { 0.0 }).collect();
/// let mut y = vec![0.0; 200];
/// (1..200).for_each(|k| y[k] = 0.8 * y[k - 1] + u[k - 1]);
/// let records = [Record { sample_time: 0.1, inputs: vec![u], outputs: vec![y], ..Record::default() }];
/// let start = Arx {
///     sample_time: 0.1,
///     a: vec![DMatrix::from_element(1, 1, -0.5)],
///     b: vec![DMatrix::zeros(1, 1), DMatrix::from_element(1, 1, 0.5)],
///     input_offset: vec![0.0],
///     output_offset: vec![0.0],
/// };
/// let refined = output_error::refine(&start, &Mask::of(&start), &records, &Default::default())?;
/// assert!((refined.model.a[0][(0, 0)] + 0.8).abs() < 1e-9);
/// # Ok::<(), output_error::Error>(())
/// ```
pub fn refine(model: &Arx, mask: &Mask, records: &[Record], options: &Options) -> Result<OutputError, Error> {
    let (n_y, n_u) = (model.output_offset.len(), model.input_offset.len());
    let p = mask.coefficients().len();
    if p == 0 {
        return Err(Error::NothingFree);
    }
    check_records(records, n_u, n_y, mask.lags() + p.div_ceil(n_y) + 1)?;
    let problem = ArxProblem {
        mask,
        template: model,
        experiments: records
            .iter()
            .map(|record| Experiment::new(record, &model.input_offset, &model.output_offset))
            .collect(),
        largest_pole: options.largest_pole,
    };
    let given = stabilized(&mask.model(model, &mask.parameters(model)), FILTER_RADIUS);
    let identity = DMatrix::identity(n_y, n_y);
    let start_rms = problem.residuals(&given, &identity).map_or(vec![f64::NAN; n_y], |moments| rms(&moments));
    let found = from_starts(&problem, given, records, options)?;
    let linear = problem.linearize(&found.point, &found.root);
    let values = mask.parameters(&found.point);
    let parameters = Parameters { names: mask.names(), values, covariance: None };
    let (parameters, condition) = with_covariance(parameters, &linear.r);
    let initial =
        problem.experiments.iter().map(|e| simulate(&found.point, e, &found.root).impulses).collect();
    Ok(OutputError {
        noise_covariance: found.moments.covariance(),
        rms: rms(&found.moments),
        model: found.point,
        parameters,
        start_rms,
        iterations: found.iterations,
        outcome: found.outcome,
        condition,
        initial,
    })
}

/// Minimizes from the most promising start, and from the next ones as long as the iterations stall.
fn from_starts(
    problem: &ArxProblem,
    given: Arx,
    records: &[Record],
    options: &Options,
) -> Result<Found<Arx>, Error> {
    let (mask, n_y) = (problem.mask, given.output_offset.len());
    let identity = DMatrix::identity(n_y, n_y);
    let criterion =
        |model: &Arx| problem.residuals(model, &identity).map_or(f64::INFINITY, |m| m.criterion());
    let iv_options = instrumental_variables::Options { iterations: 10, ..Default::default() };
    let instruments = |start: &Arx| -> Result<Arx, Error> {
        let found = instrumental_variables::estimate(start, mask, records, &iv_options)?;
        Ok(stabilized(&found.model, FILTER_RADIUS))
    };
    let plain =
        stabilized(&instrumental_variables::least_squares(problem.template, mask, records)?, FILTER_RADIUS);
    let mut starts = vec![instruments(&plain)?, plain.clone()];
    if (mask.parameters(&given) - mask.parameters(&plain)).amax() > 1e-6 {
        starts.extend([instruments(&given)?, given]);
    }
    if let Some(simulated) = denoised(problem.template, mask, records, FILTER_RADIUS) {
        let start = instrumental_variables::least_squares(problem.template, mask, &simulated)?;
        let found = instrumental_variables::estimate(&start, mask, &simulated, &iv_options)?;
        starts.extend([stabilized(&start, FILTER_RADIUS), stabilized(&found.model, FILTER_RADIUS)]);
    }
    // At rest and without memory: always finite.
    starts.push(mask.model(problem.template, &DVector::zeros(mask.coefficients().len())));
    let mut ranked: Vec<(f64, Arx)> = starts.into_iter().map(|start| (criterion(&start), start)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Settled in better coordinates, only the last digits are left to do in those of the structure.
    let settled = ranked.first().and_then(|(_, start)| equivalent::refined(start, mask, records, options));
    if let Some(start) = settled.filter(|start| spectral_radius(start) <= options.largest_pole) {
        ranked.insert(0, (criterion(&start), start));
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let mut best: Option<Found<Arx>> = None;
    for (_, start) in ranked.into_iter().take(TRIES) {
        let found = minimize(problem, start, options);
        let settled = found.as_ref().is_some_and(|found| found.outcome != Outcome::Stalled);
        let lower = |found: &Found<Arx>| {
            best.as_ref().is_none_or(|best| found.moments.criterion() < best.moments.criterion())
        };
        if let Some(found) = found.filter(lower) {
            best = Some(found);
        }
        if settled {
            break;
        }
    }
    best.ok_or(Error::NothingFree)
}

fn rms(moments: &Moments) -> Vec<f64> {
    moments.covariance().diagonal().iter().map(|variance| variance.sqrt()).collect()
}

struct ArxProblem<'a> {
    mask: &'a Mask,
    template: &'a Arx,
    experiments: Vec<Experiment>,
    largest_pole: f64,
}

impl Problem for ArxProblem<'_> {
    type Point = Arx;
    type Tangent = ();

    fn residuals(&self, point: &Arx, root: &DMatrix<f64>) -> Option<Moments> {
        let mut moments = Moments::new(root.nrows());
        for experiment in &self.experiments {
            moments.add(&simulate(point, experiment, root).residual);
        }
        moments.sum.iter().all(|value| value.is_finite()).then_some(moments)
    }

    fn linearize(&self, point: &Arx, root: &DMatrix<f64>) -> Linear<()> {
        let p = self.mask.coefficients().len();
        let mut fold = StreamedQr::new(p + 1);
        for experiment in &self.experiments {
            let simulation = simulate(point, experiment, root);
            let filtered = Filtered::new(point, experiment);
            let outputs = filtered.outputs(&simulation.y);
            let mut columns = filtered.columns(self.mask, &outputs);
            columns.push(Column::of(&simulation.residual));
            fold.push(&filtered.eliminate(&columns, self.mask.lags(), root));
        }
        Linear::of_factor(&fold.finish().into_r(), ())
    }

    fn step(&self, point: &Arx, _: &(), delta: &DVector<f64>) -> Option<Arx> {
        let model = self.mask.model(self.template, &(self.mask.parameters(point) + delta));
        (spectral_radius(&model) <= self.largest_pole).then_some(model)
    }

    fn power(&self) -> DVector<f64> {
        let n_y = self.template.output_offset.len();
        let samples: usize = self.experiments.iter().map(Experiment::len).sum();
        DVector::from_fn(n_y, |i, _| {
            let sum: f64 = self.experiments.iter().map(|e| qr::dot(&e.y[i], &e.y[i])).sum();
            sum / samples.max(1) as f64
        })
    }
}
