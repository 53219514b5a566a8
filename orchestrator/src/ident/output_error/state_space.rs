//! Output error and prediction error of a state-space model in local coordinates.
//!
//! All entries of A, B, C (and K) are free, which is n_x^2 directions too many: a change of the state basis changes no
//! output. Every iteration works in the directions orthogonal to those (data-driven local coordinates; McKelvey, Helmersson
//! and Ribarits, Automatica 40, 2004), so that no canonical form has to be chosen and the condition stays that of the data.

use nalgebra::{DMatrix, DVector};

use super::levenberg_marquardt::{Linear, Moments, Problem, minimise};
use super::sensitivity::Sensitivity;
use super::{Error, Options, Outcome, with_covariance};
use crate::ident::fold::{self, Fold};
use crate::ident::model::{Model, StateSpace};
use crate::ident::parameters::Parameters;
use crate::ident::rational::{Experiment, check_records};
use crate::ident::record::Record;

/// What is minimised.
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
    /// What is minimised.
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
    /// How they ended.
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

/// Minimises the simulation or prediction error of a state-space model, from `model` (as a rule a subspace estimate).
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
    let found = minimise(&problem, start, &options.iterations)
        .or_else(|| minimise(&problem, silent, &options.iterations))
        .ok_or(Error::NothingFree)?;
    let Linear { r, tangent, .. } = problem.linearise(&found.point, &found.root);
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
    a.complex_eigenvalues().iter().fold(0.0, |radius, pole| f64::max(radius, pole.norm()))
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

/// The model in balanced coordinates (controllability and observability gramian equal and diagonal); `None` if it is not
/// stable or not minimal to working precision.
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

/// Directions in which the model can change its outputs: orthonormal columns over the entries of `[A, B, K, C]`
/// (column-major each), and the entries of D.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tangent {
    basis: DMatrix<f64>,
    with_gain: bool,
    with_direct_term: bool,
}

impl Tangent {
    fn new(model: &StateSpace, with_direct_term: bool) -> Tangent {
        let (n_x, with_gain) = (model.order(), model.gain.is_some());
        let blocks = |a: DMatrix<f64>, b: DMatrix<f64>, k: Option<DMatrix<f64>>, c: DMatrix<f64>| {
            let gain = k.map_or(Vec::new(), |k| k.as_slice().to_vec());
            [a.as_slice(), b.as_slice(), &gain, c.as_slice()].concat()
        };
        let gain = model.gain.clone();
        let rows = blocks(model.a.clone(), model.b.clone(), gain, model.c.clone()).len();
        // What a change of basis I + S does: (S A - A S, S B, S K, -C S).
        let mut changes = DMatrix::zeros(rows, rows);
        for (index, mut column) in changes.column_iter_mut().take(n_x * n_x).enumerate() {
            let mut s = DMatrix::zeros(n_x, n_x);
            s[index] = 1.0;
            let a = &s * &model.a - &model.a * &s;
            let gain = model.gain.as_ref().map(|gain| &s * gain);
            column.copy_from_slice(&blocks(a, &s * &model.b, gain, -&model.c * &s));
        }
        let free = rows.saturating_sub(n_x * n_x);
        if free == 0 {
            return Tangent { basis: DMatrix::zeros(rows, 0), with_gain, with_direct_term };
        }
        // The left singular vectors of the smallest singular values are orthogonal to all changes of basis.
        let svd = changes.svd(true, false);
        let mut order: Vec<usize> = (0..rows).collect();
        order.sort_by(|&i, &j| svd.singular_values[i].total_cmp(&svd.singular_values[j]));
        let u = svd.u.unwrap_or_else(|| DMatrix::identity(rows, rows));
        let basis = DMatrix::from_fn(rows, free, |row, column| u[(row, order[column])]);
        Tangent { basis, with_gain, with_direct_term }
    }

    /// Number of directions.
    pub(super) fn len(&self, model: &StateSpace) -> usize {
        self.basis.ncols() + if self.with_direct_term { model.d.len() } else { 0 }
    }

    /// Changes of A, B, K, C, D along direction `index`.
    pub(super) fn direction(&self, model: &StateSpace, index: usize) -> [DMatrix<f64>; 5] {
        let mut unit = DVector::zeros(self.len(model));
        unit[index] = 1.0;
        self.changes(model, &unit)
    }

    /// Changes of A, B, K, C, D after a step.
    fn changes(&self, model: &StateSpace, step: &DVector<f64>) -> [DMatrix<f64>; 5] {
        let (n_x, n_u, n_y) = (model.order(), model.d.ncols(), model.d.nrows());
        let local = &self.basis * step.rows(0, self.basis.ncols());
        let gain = if self.with_gain { n_x * n_y } else { 0 };
        let mut rest = local.as_slice();
        let mut take = |rows: usize, columns: usize, len: usize| {
            let (head, tail) = rest.split_at(len);
            rest = tail;
            if len == 0 { DMatrix::zeros(rows, columns) } else { DMatrix::from_column_slice(rows, columns, head) }
        };
        let (a, b) = (take(n_x, n_x, n_x * n_x), take(n_x, n_u, n_x * n_u));
        let (k, c) = (take(n_x, n_y, gain), take(n_y, n_x, n_y * n_x));
        let d = if self.with_direct_term {
            DMatrix::from_iterator(n_y, n_u, step.iter().skip(self.basis.ncols()).copied())
        } else {
            DMatrix::zeros(n_y, n_u)
        };
        [a, b, k, c, d]
    }

    fn apply(&self, model: &StateSpace, step: &DVector<f64>) -> StateSpace {
        let [a, b, k, c, d] = self.changes(model, step);
        StateSpace {
            a: &model.a + a,
            b: &model.b + b,
            c: &model.c + c,
            d: &model.d + d,
            gain: model.gain.as_ref().map(|gain| gain + k),
            ..model.clone()
        }
    }
}

/// `x(k+1) = F x + G u + K y`, `y_hat = C x + D u` with `F = A - K C`, `G = B - K D`; rows of the matrices one after
/// another.
pub(super) struct Predictor {
    n_x: usize,
    n_y: usize,
    /// `[F, G, K]`, shape \[n_x, n_x + n_u + n_y\].
    state: Vec<f64>,
    /// `[C, D]`, shape \[n_y, n_x + n_u\].
    output: Vec<f64>,
    pub(super) f: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
}

impl Predictor {
    fn new(model: &StateSpace) -> Predictor {
        let (n_x, n_y) = (model.order(), model.d.nrows());
        let gain = model.gain.clone().unwrap_or_else(|| DMatrix::zeros(n_x, n_y));
        let (f, g) = (&model.a - &gain * &model.c, &model.b - &gain * &model.d);
        let state = (0..n_x).flat_map(|i| f.row(i).iter().chain(&g.row(i)).chain(&gain.row(i)).copied().collect::<Vec<_>>());
        let output = (0..n_y)
            .flat_map(|i| model.c.row(i).iter().chain(&model.d.row(i)).copied().collect::<Vec<_>>());
        Predictor { n_x, n_y, state: state.collect(), output: output.collect(), c: model.c.clone(), f }
    }

    /// Residuals from an initial state; `each` sees the sample, state, inputs and residual before the state moves on.
    pub(super) fn run(
        &self,
        experiment: &Experiment,
        x0: &DVector<f64>,
        mut each: impl FnMut(usize, &[f64], &[f64], &[f64]),
    ) -> Vec<Vec<f64>> {
        let (n_x, n_y, n_u, n) = (self.n_x, self.n_y, experiment.u.len(), experiment.len());
        // State, inputs and outputs of a sample stand together.
        let mut now = vec![0.0; n_x + n_u + n_y];
        now[..n_x].copy_from_slice(x0.as_slice());
        let mut next = vec![0.0; n_x];
        let mut e = vec![0.0; n_y];
        let mut residual = vec![vec![0.0; n]; n_y];
        for k in 0..n {
            for j in 0..n_u {
                now[n_x + j] = experiment.u[j][k];
            }
            for i in 0..n_y {
                let y = experiment.y[i][k];
                now[n_x + n_u + i] = y;
                let row = &self.output[i * (n_x + n_u)..(i + 1) * (n_x + n_u)];
                e[i] = y - fold::dot(row, &now[..n_x + n_u]);
                residual[i][k] = e[i];
            }
            each(k, &now[..n_x], &now[n_x..n_x + n_u], &e);
            for (next, row) in next.iter_mut().zip(self.state.chunks_exact(n_x + n_u + n_y)) {
                *next = fold::dot(row, &now);
            }
            now[..n_x].copy_from_slice(&next);
        }
        residual
    }

    /// Samples after which the free response is negligible.
    pub(super) fn horizon(&self, n: usize) -> usize {
        let mut power = DMatrix::identity(self.n_x, self.n_x);
        for k in 0..n {
            if power.amax() < 1e-10 {
                return k;
            }
            power = &self.f * power;
        }
        n
    }

    /// Initial state that makes the weighted residual smallest.
    fn initial_state(&self, experiment: &Experiment, root: &DMatrix<f64>) -> DVector<f64> {
        let (n_x, n_y) = (self.n_x, self.n_y);
        let horizon = self.horizon(experiment.len());
        let early = Experiment {
            u: experiment.u.iter().map(|u| u[..horizon].to_vec()).collect(),
            y: experiment.y.iter().map(|y| y[..horizon].to_vec()).collect(),
        };
        let mut fold = Fold::new(n_x + 1);
        let mut free = self.c.clone();
        self.run(&early, &DVector::zeros(n_x), |_, _, _, e| {
            let rows = root * &free;
            fold.room(n_y);
            for j in 0..n_x {
                fold.column(j, n_y).copy_from_slice(rows.column(j).as_slice());
            }
            weighted(root, e, fold.column(n_x, n_y));
            fold.commit(n_y);
            free = &free * &self.f;
        });
        let r = fold.finish();
        let z = r.view((0, n_x), (n_x, 1)).column(0).into_owned();
        fold::solve(&r.view((0, 0), (n_x, n_x)).into_owned(), &z, 1e-10).0
    }
}

/// `root e`.
pub(super) fn weighted(root: &DMatrix<f64>, e: &[f64], out: &mut [f64]) {
    for (i, out) in out.iter_mut().enumerate() {
        *out = e.iter().enumerate().map(|(l, e)| root[(i, l)] * e).sum();
    }
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

    fn linearise(&self, point: &StateSpace, root: &DMatrix<f64>) -> Linear<Tangent> {
        let tangent = Tangent::new(point, self.direct_term);
        let predictor = Predictor::new(point);
        let sensitivity = Sensitivity::new(point, &tangent, &predictor);
        let mut all = Fold::new(sensitivity.p + 1);
        for experiment in &self.experiments {
            let x0 = predictor.initial_state(experiment, root);
            sensitivity.fold(&predictor, experiment, &x0, root, &mut all);
        }
        Linear::of_factor(&all.finish(), tangent)
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
            let sum: f64 = self.experiments.iter().map(|e| fold::dot(&e.y[i], &e.y[i])).sum();
            sum / samples.max(1) as f64
        })
    }
}
