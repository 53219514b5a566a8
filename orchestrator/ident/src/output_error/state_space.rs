//! Output error and prediction error of a state-space model in local coordinates.
//!
//! All entries of A, B, C (and K) are free, which is n_x^2 directions too many: a change of the state basis changes no
//! output. Every iteration works in the directions orthogonal to those (data-driven local coordinates; McKelvey,
//! Helmersson and Ribarits, Automatica 40, 2004), so that no canonical form has to be chosen and the condition stays
//! that of the data.

use nalgebra::{DMatrix, DVector};

use super::levenberg_marquardt::{Linear, Moments, Problem, minimize};
use super::predictor::Predictor;
use super::sensitivity::Sensitivity;
use super::tangent::Tangent;
use super::{Error, Options, Outcome, with_covariance};
use crate::model::{Model, StateSpace};
use crate::parameters::Parameters;
use crate::rational::{Experiment, check_records};
use crate::record::Record;
use airloop_optim::linalg::StreamedQr;
use airloop_optim::linalg::qr::dot;
use airloop_optim::linalg::spectral;

/// Criterion to minimize.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// The error of the free simulation (output error).
    Simulation,
    /// The error of the one-step prediction, with the innovation gain K free.
    Prediction,
}

/// Settings of [`refine_state_space`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateSpaceOptions {
    /// Settings of the iterations.
    pub iterations: Options,
    /// Criterion to minimize.
    pub criterion: Criterion,
    /// Whether the direct term D is free; without it D stays as it is.
    pub direct_term: bool,
}

impl Default for StateSpaceOptions {
    fn default() -> StateSpaceOptions {
        StateSpaceOptions {
            iterations: Options::default(),
            criterion: Criterion::Simulation,
            direct_term: true,
        }
    }
}

/// Result of [`refine_state_space`].
#[derive(Debug, Clone, PartialEq)]
pub struct RefinedStateSpace {
    /// The refined model, its state balanced where that is possible; stable.
    pub model: StateSpace,
    /// Local coordinates about the model: all zero, with their covariance. They are made for uncertainty only, see
    /// [`RefinedStateSpace::at`].
    pub parameters: Parameters,
    /// Covariance of the residuals, shape \[n_y, n_y\].
    pub noise_covariance: DMatrix<f64>,
    /// RMS of the residuals at the start, shape \[n_y\].
    pub start_rms: Vec<f64>,
    /// RMS of the residuals at the end, shape \[n_y\].
    pub rms: Vec<f64>,
    /// Iterations.
    pub iterations: usize,
    /// Outcome of the iterations.
    pub outcome: Outcome,
    /// Condition number of the derivatives, columns scaled to length 1.
    pub condition: f64,
    /// Initial state of every record, shape \[records\]\[n_x\].
    pub initial: Vec<DVector<f64>>,
    tangent: Tangent,
}

impl RefinedStateSpace {
    /// The model a small way `parameters` (shape \[p\]) from the estimate.
    pub fn at(&self, parameters: &DVector<f64>) -> StateSpace {
        self.tangent.apply(&self.model, parameters)
    }
}

/// Minimizes the simulation or prediction error of a state-space model, from `model` (usually a subspace estimate).
///
/// An unstable model is drawn into the unit circle first. For [`Criterion::Prediction`] a model without gain starts at
/// K = 0. The offsets stay those of `model`.
///
/// # Errors
/// [`Error`] for records that do not fit the model or are too short.
pub fn refine_state_space(
    model: &StateSpace,
    records: &[Record],
    options: &StateSpaceOptions,
) -> Result<RefinedStateSpace, Error> {
    let (n_x, n_u, n_y) = (model.order(), model.n_u(), model.n_y());
    check_records(records, n_u, n_y, n_x + (n_x * (n_u + n_y) + n_y * n_u).div_ceil(n_y.max(1)) + 1)?;
    if n_x * (n_u + n_y) == 0 && !(options.direct_term && n_u * n_y > 0) {
        return Err(Error::NothingFree);
    }
    let limit = options.iterations.largest_pole;
    let mut start = model.clone();
    let largest = radius(&start.a);
    if largest > limit {
        start.a *= limit.min(0.9999) / largest;
    }
    start = balanced(&start).unwrap_or(start);
    start.gain = match options.criterion {
        Criterion::Simulation => None,
        Criterion::Prediction => {
            let gain = start.gain.take().unwrap_or_else(|| DMatrix::zeros(n_x, n_y));
            let stable = radius(&(&start.a - &gain * &start.c)) <= limit;
            Some(if stable { gain } else { DMatrix::zeros(n_x, n_y) })
        }
    };
    let problem = StateSpaceProblem {
        experiments: records
            .iter()
            .map(|record| Experiment::new(record, &model.input_offset, &model.output_offset))
            .collect(),
        n_y,
        direct_term: options.direct_term,
        largest_pole: limit,
    };
    let rms = |moments: &Moments| -> Vec<f64> {
        moments.covariance().diagonal().iter().map(|variance| variance.sqrt()).collect()
    };
    let identity = DMatrix::identity(n_y, n_y);
    let start_rms = problem.residuals(&start, &identity).map_or(vec![f64::NAN; n_y], |moments| rms(&moments));
    let silent = StateSpace { a: &start.a * 0.5, gain: None, ..start.clone() };
    let found = minimize(&problem, start, &options.iterations)
        .or_else(|| minimize(&problem, silent, &options.iterations))
        .ok_or(Error::NothingFree)?;
    let Linear { r, tangent, .. } = problem.linearize(&found.point, &found.root);
    let p = r.ncols();
    let names = (1..=p).map(|index| format!("direction {index}")).collect();
    let parameters = Parameters { names, values: DVector::zeros(p), covariance: None };
    let (parameters, condition) = with_covariance(parameters, &r);
    let initial = problem
        .experiments
        .iter()
        .map(|experiment| Predictor::new(&found.point).initial_state(experiment, &found.root))
        .collect();
    Ok(RefinedStateSpace {
        noise_covariance: found.moments.covariance(),
        rms: rms(&found.moments),
        model: found.point,
        parameters,
        start_rms,
        iterations: found.iterations,
        outcome: found.outcome,
        condition,
        initial,
        tangent,
    })
}

fn radius(a: &DMatrix<f64>) -> f64 {
    if a.is_empty() {
        return 0.0;
    }
    if !a.iter().all(|value| value.is_finite()) {
        return f64::INFINITY;
    }
    spectral::eigenvalues(a).iter().fold(0.0, |radius, pole| f64::max(radius, pole.norm()))
}

/// `sum_k A^k Q A^kT`, by doubling; A stable.
fn gramian(a: &DMatrix<f64>, q: DMatrix<f64>) -> DMatrix<f64> {
    let (mut power, mut sum) = (a.clone(), q);
    for _ in 0..40 {
        let more = &power * &sum * power.transpose();
        sum += &more;
        if more.amax() <= 1e-16 * sum.amax() {
            break;
        }
        power = &power * &power;
    }
    sum
}

/// The model in balanced coordinates (controllability and observability gramian equal and diagonal); `None` if it is
/// not stable or not minimal to working precision.
fn balanced(model: &StateSpace) -> Option<StateSpace> {
    if radius(&model.a) >= 1.0 {
        return None;
    }
    let reach = gramian(&model.a, &model.b * model.b.transpose());
    let see = gramian(&model.a.transpose(), model.c.transpose() * &model.c);
    let l = reach.cholesky()?.l();
    let eigen = (l.transpose() * see * &l).symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    if eigen.eigenvalues.min() <= 1e-20 * largest {
        return None;
    }
    let quarter = eigen.eigenvalues.map(|value| value.powf(-0.25));
    let t = &l * &eigen.eigenvectors * DMatrix::from_diagonal(&quarter);
    let inverse = t.clone().try_inverse()?;
    Some(StateSpace {
        a: &inverse * &model.a * &t,
        b: &inverse * &model.b,
        c: &model.c * &t,
        gain: model.gain.as_ref().map(|gain| &inverse * gain),
        ..model.clone()
    })
}

struct StateSpaceProblem {
    experiments: Vec<Experiment>,
    n_y: usize,
    direct_term: bool,
    largest_pole: f64,
}

impl Problem for StateSpaceProblem {
    type Point = StateSpace;
    type Tangent = Tangent;

    fn residuals(&self, point: &StateSpace, root: &DMatrix<f64>) -> Option<Moments> {
        let predictor = Predictor::new(point);
        let mut moments = Moments::new(self.n_y);
        for experiment in &self.experiments {
            let x0 = predictor.initial_state(experiment, root);
            moments.add(&predictor.run(experiment, &x0, |_, _, _, _| ()));
        }
        moments.sum.iter().all(|value| value.is_finite()).then_some(moments)
    }

    fn linearize(&self, point: &StateSpace, root: &DMatrix<f64>) -> Linear<Tangent> {
        let tangent = Tangent::new(point, self.direct_term);
        let predictor = Predictor::new(point);
        let sensitivity = Sensitivity::new(point, &tangent, &predictor);
        let mut all = StreamedQr::new(sensitivity.p + 1);
        for experiment in &self.experiments {
            let x0 = predictor.initial_state(experiment, root);
            sensitivity.fold(&predictor, experiment, &x0, root, &mut all);
        }
        Linear::of_factor(&all.finish().into_r(), tangent)
    }

    fn step(&self, point: &StateSpace, tangent: &Tangent, delta: &DVector<f64>) -> Option<StateSpace> {
        let next = tangent.apply(point, delta);
        let predictor = next.gain.as_ref().map(|gain| &next.a - gain * &next.c);
        let stable = radius(&next.a) <= self.largest_pole
            && predictor.is_none_or(|predictor| radius(&predictor) <= self.largest_pole);
        stable.then_some(next)
    }

    fn power(&self) -> DVector<f64> {
        let samples: usize = self.experiments.iter().map(Experiment::len).sum();
        DVector::from_fn(self.n_y, |i, _| {
            let sum: f64 = self.experiments.iter().map(|e| dot(&e.y[i], &e.y[i])).sum();
            sum / samples.max(1) as f64
        })
    }
}
