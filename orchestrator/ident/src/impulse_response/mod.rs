//! Regularized FIR: the impulse response of every channel, and what it says of delay and order.
//!
//! `y(k) = sum_j sum_l g_j(l) u_j(k - l) + e(k)`, the coefficients of a channel normal with a covariance that decays:
//! TC `c a^max(k,l)` or DC `c a^((k+l)/2) r^|k-l|`. The hyper-parameters maximize the marginal likelihood, evaluated by
//! QR factorizations with the triangular factor of the kernel, which is known in closed form: no kernel is inverted
//! (Chen, Ohlsson and Ljung, Automatica 48, 2012; Chen and Ljung, Automatica 49, 2013).

mod evidence;
mod nelder_mead;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::diagnostics::chi_squared::two_sided_normal;
use super::rational::columns::{Column, fold_columns};
use super::rational::{Error, Experiment, check_records};
use super::record::Record;
use airloop_optim::linalg::StreamedQr;
use airloop_optim::linalg::qr::dot;

pub use evidence::{Evidence, evidence};

/// Quantile 0.995 of the normal distribution.
const TWO_SIDED_99: f64 = 2.575_829_303_548_901;

/// Prior covariance of the coefficients of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Kernel {
    /// Tuned and correlated: `c a^max(k,l)`.
    #[serde(rename = "TC")]
    Tc,
    /// Diagonal and correlated: `c a^((k+l)/2) r^|k-l|`, one hyper-parameter more.
    #[serde(rename = "DC")]
    Dc,
}

/// Settings of [`estimate`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Prior.
    pub kernel: Kernel,
    /// Coefficients per channel; 70 by default. Dynamics slower than that are not explained.
    pub length: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options { kernel: Kernel::Dc, length: 70 }
    }
}

/// Impulse response of one channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Channel {
    /// Coefficients `g(0), g(1), ..`, unit of the output per unit of the input.
    pub values: Vec<f64>,
    /// Half width of the 99 % band of every coefficient, for white noise.
    pub band_99: Vec<f64>,
    /// Decay a of the prior.
    pub decay: f64,
    /// Correlation r of neighboring coefficients in the prior.
    pub correlation: f64,
    /// First lag whose coefficient is outside the 99 % band *for all lags together*: the delay in samples; `None` if
    /// none is.
    pub first_significant: Option<usize>,
}

/// Impulse responses to all inputs of one output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImpulseResponse {
    /// Prior.
    pub kernel: Kernel,
    /// One channel per input.
    pub channels: Vec<Channel>,
    /// Standard deviation of the noise, unit of the output.
    pub noise_deviation: f64,
    /// -2 times the logarithm of the marginal likelihood, up to a constant of the data: the smaller the better a
    /// kernel.
    pub criterion: f64,
}

/// Estimates the impulse responses to all inputs, one result per output. Signals count about their means.
///
/// # Errors
/// [`Error`] for records that do not fit each other or are too short for `length` coefficients.
pub fn estimate(records: &[Record], options: &Options) -> Result<Vec<ImpulseResponse>, Error> {
    let first = records.first().ok_or(Error::NoRecord)?;
    let (n_u, n_y) = (first.inputs.len(), first.outputs.len());
    if n_u * n_y * options.length == 0 {
        return Err(Error::NothingFree);
    }
    let p = n_u * options.length;
    check_records(records, n_u, n_y, options.length + p.div_ceil(records.len()) + 2)?;
    let mean = |of: &dyn Fn(&Record) -> &Vec<f64>| {
        let count: usize = records.iter().map(Record::len).sum();
        records.iter().flat_map(|record| of(record).iter()).sum::<f64>() / count as f64
    };
    let of_u: Vec<f64> = (0..n_u).map(|j| mean(&|record| &record.inputs[j])).collect();
    let of_y: Vec<f64> = (0..n_y).map(|i| mean(&|record| &record.outputs[i])).collect();
    let mut experiments: Vec<Experiment> =
        records.iter().map(|record| Experiment::new(record, &of_u, &of_y)).collect();
    // Signals of size 1: the hyper-parameters have one scale then.
    let scale = |of: fn(&mut Experiment) -> &mut Vec<Vec<f64>>, index: usize, all: &mut [Experiment]| {
        let power = |values: &[f64]| dot(values, values);
        let samples: usize = all.iter().map(Experiment::len).sum();
        let sum: f64 = all.iter_mut().map(|experiment| power(&of(experiment)[index])).sum();
        let size = Some((sum / samples as f64).sqrt()).filter(|size| *size > 0.0).unwrap_or(1.0);
        all.iter_mut()
            .flat_map(|experiment| of(experiment)[index].iter_mut())
            .for_each(|value| *value /= size);
        size
    };
    let u_scales: Vec<f64> = (0..n_u).map(|j| scale(|e| &mut e.u, j, &mut experiments)).collect();
    let y_scales: Vec<f64> = (0..n_y).map(|i| scale(|e| &mut e.y, i, &mut experiments)).collect();
    let mut fold = StreamedQr::new(p + n_y);
    let mut rows = 0;
    for experiment in &experiments {
        let mut columns = Vec::with_capacity(p + n_y);
        for u in experiment.u.chunks(1) {
            columns.extend((0..options.length).map(|shift| Column { signal: u, shift, sign: 1.0 }));
        }
        columns.extend(experiment.y.chunks(1).map(Column::of));
        // Inputs before the record are not known: the first rows are left out.
        fold_columns(&columns, options.length - 1..experiment.len(), &DMatrix::identity(1, 1), &mut fold);
        rows += experiment.len() + 1 - options.length;
    }
    let r = fold.finish().into_r();
    let regressors = r.view((0, 0), (p, p)).into_owned();
    let found = (0..n_y).map(|i| {
        let explained = r.view((0, p + i), (p, 1)).column(0).into_owned();
        let rest: f64 = (p..=p + i).map(|row| r[(row, p + i)].powi(2)).sum();
        let problem = Marginal {
            regressors: &regressors,
            explained,
            rest,
            rows,
            length: options.length,
            kernel: options.kernel,
        };
        problem.solve(&u_scales, y_scales[i])
    });
    Ok(found.collect())
}

/// Hyper-parameters of one channel: `c` in units of the noise variance, decay `a`, correlation `r`.
#[derive(Debug, Clone, Copy)]
struct Prior {
    size: f64,
    decay: f64,
    correlation: f64,
}

impl Prior {
    /// From unbounded variables.
    fn new(variables: &[f64], kernel: Kernel) -> Prior {
        let logistic = |x: f64| 1.0 / (1.0 + (-x).exp());
        let decay = logistic(variables[1]).clamp(1e-6, 1.0 - 1e-6);
        let correlation = match kernel {
            Kernel::Tc => decay.sqrt(),
            Kernel::Dc => (2.0 * logistic(variables[2]) - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6),
        };
        Prior { size: variables[0].clamp(-40.0, 40.0).exp(), decay, correlation }
    }

    /// L with `L L^T` the kernel: row l is `sqrt(c a^l)` times an autoregression of correlation r.
    fn factor(&self, n: usize) -> DMatrix<f64> {
        let fresh = (1.0 - self.correlation * self.correlation).sqrt();
        DMatrix::from_fn(n, n, |k, m| {
            if m > k {
                return 0.0;
            }
            let start = if m == 0 { 1.0 } else { fresh };
            (self.size * self.decay.powi(k as i32)).sqrt() * start * self.correlation.powi((k - m) as i32)
        })
    }
}

/// Marginal likelihood of one output from the triangular factor of `[Phi, y]`.
struct Marginal<'a> {
    regressors: &'a DMatrix<f64>,
    explained: DVector<f64>,
    /// Sum of squares that no FIR explains.
    rest: f64,
    rows: usize,
    length: usize,
    kernel: Kernel,
}

/// Factorization for some hyper-parameters.
struct Evaluation {
    criterion: f64,
    /// Triangular factor of the whitened problem, shape \[p, p\], and its right-hand side.
    r: DMatrix<f64>,
    z: DVector<f64>,
    /// L of all channels, shape \[p, p\].
    factor: DMatrix<f64>,
    noise_variance: f64,
}

impl Marginal<'_> {
    fn variables(&self) -> usize {
        match self.kernel {
            Kernel::Tc => 2,
            Kernel::Dc => 3,
        }
    }

    /// QR of `[R L, z; I, 0]`: the noise variance is concentrated out.
    fn evaluate(&self, variables: &[f64]) -> Evaluation {
        let p = self.regressors.ncols();
        let mut factor = DMatrix::zeros(p, p);
        for (j, variables) in variables.chunks(self.variables()).enumerate() {
            let block = Prior::new(variables, self.kernel).factor(self.length);
            factor.view_mut((j * self.length, j * self.length), (self.length, self.length)).copy_from(&block);
        }
        let mut fold = StreamedQr::new(p + 1);
        let mut rows = DMatrix::zeros(p, p + 1);
        rows.view_mut((0, 0), (p, p)).copy_from(&(self.regressors * &factor));
        rows.view_mut((0, p), (p, 1)).copy_from(&self.explained);
        fold.push(&rows);
        rows.fill(0.0);
        rows.view_mut((0, 0), (p, p)).fill_with_identity();
        fold.push(&rows);
        let all = fold.finish().into_r();
        let r = all.view((0, 0), (p, p)).into_owned();
        let squares = all[(p, p)].powi(2) + self.rest;
        let noise_variance = squares / self.rows as f64;
        let determinant: f64 = r.diagonal().iter().map(|value| value.abs().ln()).sum();
        Evaluation {
            criterion: self.rows as f64 * noise_variance.max(f64::MIN_POSITIVE).ln() + 2.0 * determinant,
            z: all.view((0, p), (p, 1)).column(0).into_owned(),
            r,
            factor,
            noise_variance,
        }
    }

    fn solve(&self, u_scales: &[f64], y_scale: f64) -> ImpulseResponse {
        let n_u = u_scales.len();
        let criterion = |variables: &[f64]| self.evaluate(variables).criterion;
        // All channels alike on a coarse grid, then every hyper-parameter on its own.
        let alike = |size: f64, decay: f64| -> Vec<f64> {
            let one = [size, (decay / (1.0 - decay)).ln(), 3.0];
            (0..n_u).flat_map(|_| one[..self.variables()].to_vec()).collect()
        };
        let grid =
            [-4.0, 0.0, 4.0].into_iter().flat_map(|size| [0.6, 0.9, 0.97].map(|decay| alike(size, decay)));
        let start = grid
            .map(|variables| (criterion(&variables), variables))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(alike(0.0, 0.9), |(_, variables)| variables);
        let (variables, _) = nelder_mead::minimize(criterion, &start, 1.0, 1e-2, 60 * start.len());
        let found = self.evaluate(&variables);
        let p = found.r.ncols();
        let back = |rhs: &DMatrix<f64>| found.r.solve_upper_triangular(rhs);
        let whitened = found.r.solve_upper_triangular(&found.z).unwrap_or_else(|| DVector::zeros(p));
        let g = &found.factor * whitened;
        // Covariance sigma^2 (L R^-1) (L R^-1)^T; R is regular, there is an identity in it.
        let spread =
            back(&DMatrix::identity(p, p)).map_or(DMatrix::zeros(p, p), |inverse| &found.factor * inverse);
        let noise = found.noise_variance.sqrt();
        let together = two_sided_normal(0.01 / self.length as f64) / TWO_SIDED_99;
        let channels = (0..n_u).map(|j| {
            let scale = y_scale / u_scales[j];
            let rows = j * self.length..(j + 1) * self.length;
            let values: Vec<f64> = rows.clone().map(|row| scale * g[row]).collect();
            let band_99: Vec<f64> =
                rows.map(|row| TWO_SIDED_99 * scale * noise * spread.row(row).norm()).collect();
            let prior = Prior::new(&variables[j * self.variables()..], self.kernel);
            Channel {
                first_significant: values
                    .iter()
                    .zip(&band_99)
                    .position(|(value, band)| value.abs() > together * band),
                values,
                band_99,
                decay: prior.decay,
                correlation: prior.correlation,
            }
        });
        ImpulseResponse {
            kernel: self.kernel,
            channels: channels.collect(),
            noise_deviation: noise * y_scale,
            criterion: found.criterion,
        }
    }
}

#[cfg(test)]
mod tests;
