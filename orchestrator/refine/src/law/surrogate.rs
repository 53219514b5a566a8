//! The error of a system as a quadratic form of the heights of a free form, one for each fold of the records.
//!
//! Residuals and their derivatives by the heights are simulated; initial states are eliminated from both record by
//! record. A matrix, a vector and a number remain for each fold; fits, penalties and held-out errors are small linear
//! algebra from there.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::surface::Surface;
use crate::engine::System;
use crate::engine::fit::{Free, fit};
use crate::engine::near::{Near, fit_near};
use crate::engine::normal::{Columns, columns, dot};
use crate::engine::{parallel, stop};
use crate::study::law::Variable;

/// Parts of the records.
pub const PARTS: usize = 5;
/// Records from which on whole ones are held out.
const MIN_RECORDS_FOR_WHOLE: usize = 4;
/// Penalties that are tried: powers of ten around the mean curvature of the error.
const PENALTIES: [f64; 9] = [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];
/// Ratio of errors from which on another step gains nothing.
const MIN_ERROR_RATIO_OF_STEP: f64 = 0.97;
/// Rounds of a fit of initial states where known derivatives do not hold.
const LOCAL_ROUNDS: usize = 6;
/// Share of the held-out error within which more penalty wins.
const MAX_RISE_FOR_PENALTY: f64 = 0.005;

/// `chi2(d) = c + 2 g d + d A d` of a part, `d`: change of heights, then of shared parameters.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// A, shape \[n, n\].
    pub matrix: DMatrix<f64>,
    /// g, shape \[n\].
    pub gradient: DVector<f64>,
    /// c.
    pub chi2: f64,
}

impl Quadratic {
    fn zero(n: usize) -> Quadratic {
        Quadratic { matrix: DMatrix::zeros(n, n), gradient: DVector::zeros(n), chi2: 0.0 }
    }

    fn add(&mut self, other: &Quadratic) {
        self.matrix += &other.matrix;
        self.gradient += &other.gradient;
        self.chi2 += other.chi2;
    }

    /// Value for a change.
    pub fn at(&self, d: &DVector<f64>) -> f64 {
        self.chi2 + 2.0 * self.gradient.dot(d) + (&self.matrix * d).dot(d)
    }
}

/// The quadratic forms of all parts around heights.
#[derive(Debug, Clone)]
pub struct Surrogate {
    /// Heights around which the system was simulated.
    pub heights: Vec<f64>,
    /// By part.
    pub parts: Vec<Quadratic>,
    /// Number of heights.
    pub count: usize,
    /// Derivatives by the local parameters of the records, without residuals.
    locals: Vec<Columns>,
    roughness: DMatrix<f64>,
}

/// A free form that was fitted.
#[derive(Debug, Clone)]
pub struct Smooth {
    /// Heights.
    pub heights: Vec<f64>,
    /// Changes of the shared parameters.
    pub shared: Vec<f64>,
    /// Standard deviation of each height for unit residuals.
    pub deviation: Vec<f64>,
    /// Sum of squares on the parts, each predicted by the others.
    pub held_out: f64,
    /// The same without the form: the heights stay as they are and the shared parameters are fitted.
    pub without: f64,
}

impl Surrogate {
    /// Simulates around `p`, whose heights stand at `heights`; `shared`: parameters that are fitted along with them.
    /// Records of one of the `groups` are held out together; without any, by their number. `unmoved`: residuals and
    /// derivatives there by the shared and local parameters, where they are known.
    pub fn new<S: System + ?Sized>(
        system: &S,
        surface: &Surface,
        p: &[f64],
        [heights, shared]: [&[Free]; 2],
        locals: &[Vec<f64>],
        groups: Option<&[usize]>,
        unmoved: Option<&[Columns]>,
    ) -> Surrogate {
        let free: Vec<Free> = heights.iter().chain(shared).copied().collect();
        let records: Vec<usize> = (0..locals.len()).collect();
        let starts: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
        let found = match unmoved {
            None => columns(system, &records, p, &free, &starts, true, None),
            Some(known) => {
                let residuals = known.iter().map(|own| &own.residuals[..]).collect();
                let mut found = columns(system, &records, p, heights, &starts, false, Some(residuals));
                for (own, known) in found.iter_mut().zip(known) {
                    own.columns.extend(known.columns.iter().cloned());
                }
                found
            }
        };
        // A law in time is the same in every record: only another record can tell whether it is one.
        let whole = groups.is_some()
            || records.len() >= MIN_RECORDS_FOR_WHOLE
            || records.len() > 1 && surface.variables.contains(&Variable::Time);
        let pieces = parallel::map(found.len(), |r| {
            let signals: Vec<(usize, usize)> =
                system.signals(r).iter().map(|span| (span.range.start, span.range.end)).collect();
            let group = groups.map_or(r, |own| own[r]);
            parts_of(&found[r], free.len(), &signals, whole.then_some(group % PARTS))
        });
        let mut parts = vec![Quadratic::zero(free.len()); PARTS];
        for piece in &pieces {
            parts.iter_mut().zip(piece).for_each(|(sum, own)| sum.add(own));
        }
        for f in shared.iter().enumerate().filter_map(|(k, f)| Some((k + heights.len(), f, f.prior?))) {
            let (k, f, prior) = f;
            for part in &mut parts {
                part.matrix[(k, k)] += prior.powi(-2) / PARTS as f64;
                part.gradient[k] += p[f.index] * prior.powi(-2) / PARTS as f64;
                part.chi2 += (p[f.index] / prior).powi(2) / PARTS as f64;
            }
        }
        let n = free.len();
        let mut roughness = DMatrix::zeros(n, n);
        for row in surface.roughness() {
            for &(a, x) in &row {
                row.iter().for_each(|&(b, y)| roughness[(a, b)] += x * y);
            }
        }
        let middle = heights.iter().map(|f| p[f.index]).collect();
        let local =
            |mut own: Columns| Columns { residuals: Vec::new(), columns: own.columns.split_off(free.len()) };
        let locals = found.into_iter().map(local).collect();
        Surrogate { heights: middle, parts, count: heights.len(), locals, roughness }
    }

    /// All parts but one, or all.
    pub fn without(&self, part: Option<usize>) -> Quadratic {
        let mut found = Quadratic::zero(self.roughness.nrows());
        self.parts.iter().enumerate().filter(|(i, _)| Some(*i) != part).for_each(|(_, own)| found.add(own));
        found
    }

    /// Change that lowers the penalized error most.
    fn step(&self, own: &Quadratic, penalty: f64) -> Option<DVector<f64>> {
        let n = own.matrix.nrows();
        let mean = (0..self.count).map(|i| own.matrix[(i, i)]).sum::<f64>() / self.count as f64;
        let middle = DVector::from_fn(n, |i, _| self.heights.get(i).copied().unwrap_or(0.0));
        let weight = penalty * mean;
        let mut matrix = &own.matrix + &self.roughness * weight;
        let right = -&own.gradient - &self.roughness * middle * weight;
        for i in 0..n {
            matrix[(i, i)] += 1e-9 * if i < self.count { mean } else { own.matrix[(i, i)].max(1e-300) };
        }
        solve(matrix, &right)
    }

    /// Change of the shared parameters alone.
    fn shared_step(&self, own: &Quadratic) -> DVector<f64> {
        let (n, k) = (own.matrix.nrows(), self.count);
        let mut found = DVector::zeros(n);
        if n > k {
            let part = own.matrix.view((k, k), (n - k, n - k)).into_owned();
            if let Some(step) = solve(part, &-own.gradient.rows(k, n - k).into_owned()) {
                found.rows_mut(k, n - k).copy_from(&step);
            }
        }
        found
    }

    /// The free form with the penalty that predicts parts best which were held out.
    pub fn smooth(&self) -> Option<Smooth> {
        let trained: Vec<Quadratic> = (0..PARTS).map(|part| self.without(Some(part))).collect();
        let held_out = |penalty: f64| -> Option<f64> {
            let mut sum = 0.0;
            for (own, part) in trained.iter().zip(&self.parts) {
                sum += part.at(&self.step(own, penalty)?);
            }
            Some(sum).filter(|sum| sum.is_finite())
        };
        let found: Vec<(f64, f64)> =
            PENALTIES.iter().filter_map(|penalty| Some((*penalty, held_out(*penalty)?))).collect();
        let least = found.iter().map(|(_, own)| *own).fold(f64::INFINITY, f64::min);
        let (penalty, held_out) =
            found.into_iter().rev().find(|(_, own)| *own <= (1.0 + MAX_RISE_FOR_PENALTY) * least)?;
        let without =
            trained.iter().zip(&self.parts).map(|(own, part)| part.at(&self.shared_step(own))).sum();
        let all = self.without(None);
        let step = self.step(&all, penalty)?;
        let mean = (0..self.count).map(|i| all.matrix[(i, i)]).sum::<f64>() / self.count as f64;
        let mut matrix = &all.matrix + &self.roughness * (penalty * mean);
        (0..matrix.nrows()).for_each(|i| matrix[(i, i)] *= 1.0 + 1e-9);
        let covariance = Cholesky::new(matrix).map(|own| own.inverse());
        let deviation = |i: usize| covariance.as_ref().map_or(f64::NAN, |c| c[(i, i)].max(0.0).sqrt());
        Some(Smooth {
            heights: self.heights.iter().enumerate().map(|(i, h)| h + step[i]).collect(),
            shared: step.iter().skip(self.count).copied().collect(),
            deviation: (0..self.count).map(deviation).collect(),
            held_out,
            without,
        })
    }

    /// The form of a part with the shared parameters taken out: they follow the heights.
    pub fn reduced(&self, own: &Quadratic) -> Quadratic {
        let (n, k) = (own.matrix.nrows(), self.count);
        if n == k {
            return own.clone();
        }
        let shared = own.matrix.view((k, k), (n - k, n - k)).into_owned();
        let cross = own.matrix.view((0, k), (k, n - k)).into_owned();
        let right = own.gradient.rows(k, n - k).into_owned();
        let scale: Vec<f64> = (0..n - k).map(|i| shared[(i, i)].max(1e-300).sqrt()).collect();
        let scaled = DMatrix::from_fn(n - k, n - k, |a, b| {
            shared[(a, b)] / (scale[a] * scale[b]) + if a == b { 1e-9 } else { 0.0 }
        });
        let top = own.matrix.view((0, 0), (k, k)).into_owned();
        let Some(factor) = Cholesky::new(scaled) else {
            return Quadratic { matrix: top, gradient: own.gradient.rows(0, k).into_owned(), chi2: own.chi2 };
        };
        let across =
            DMatrix::from_fn(n - k, k + 1, |a, b| (if b < k { cross[(b, a)] } else { right[a] }) / scale[a]);
        let solved = factor.solve(&across);
        let taken = across.transpose() * solved;
        Quadratic {
            matrix: top - taken.view((0, 0), (k, k)),
            gradient: own.gradient.rows(0, k) - taken.view((0, k), (k, 1)).column(0),
            chi2: own.chi2 - taken[(k, k)],
        }
    }
}

/// Solves symmetric equations scaled to a unit diagonal.
fn solve(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let n = right.len();
    let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].max(1e-300).sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |a, b| {
        matrix[(a, b)] / (scale[a] * scale[b]) + if a == b { 1e-12 } else { 0.0 }
    });
    let solved = Cholesky::new(scaled)?.solve(&DVector::from_fn(n, |i, _| right[i] / scale[i]));
    Some(DVector::from_fn(n, |i, _| solved[i] / scale[i]))
}

/// A free form at its optimum in simulation.
#[derive(Debug, Clone)]
pub struct Approach {
    /// Parameter vector with the heights.
    pub parameters: Vec<f64>,
    /// Local parameters of the records.
    pub locals: Vec<Vec<f64>>,
    /// Sum of squares.
    pub chi2: f64,
    /// Quadratic forms around it.
    pub surrogate: Surrogate,
    /// The form that they ask for.
    pub smooth: Smooth,
    /// Records that are held out together.
    groups: Option<Vec<usize>>,
}

impl Approach {
    /// The quadratic forms around a point; `unmoved`: see [`Surrogate::new`].
    pub fn begin<S: System + ?Sized>(
        system: &S,
        surface: &Surface,
        p: &[f64],
        free: [&[Free]; 2],
        locals: &[Vec<f64>],
        groups: Option<Vec<usize>>,
        unmoved: Option<&[Columns]>,
    ) -> Option<Approach> {
        let surrogate = Surrogate::new(system, surface, p, free, locals, groups.as_deref(), unmoved);
        let smooth = surrogate.smooth()?;
        let (parameters, locals) = (p.to_vec(), locals.to_vec());
        Some(Approach { parameters, locals, chi2: f64::INFINITY, surrogate, smooth, groups })
    }

    /// Goes to the optimum in some steps, each simulated; `free`: heights and shared parameters.
    pub fn toward<S: System + ?Sized>(
        mut self,
        system: &S,
        surface: &Surface,
        free: [&[Free]; 2],
        rounds: usize,
    ) -> Option<Approach> {
        let records: Vec<usize> = (0..self.locals.len()).collect();
        // Initial states follow by the derivatives that are known, record by record, where these hold or suffice for a
        // gain.
        let simulated = |p: &[f64], own: &Approach| -> (f64, Vec<Vec<f64>>) {
            let near = |r: usize| {
                let (locals, known) = (&own.locals[r..=r], own.surrogate.locals[r..=r].to_vec());
                fit_near(system, &[r], p, &[], locals, known)
            };
            let mut found = parallel::map(records.len(), near);
            let chi2 = |found: &[Near]| found.iter().map(|own| own.fit.chi2).sum::<f64>();
            let gains = chi2(&found) < own.chi2;
            if !gains {
                let again = |r: usize| {
                    let near = &found[r];
                    (!near.settled).then(|| fit(system, &[r], p, &[], &near.fit.locals, LOCAL_ROUNDS))
                };
                let again = parallel::map(records.len(), again);
                for (own, again) in found.iter_mut().zip(again) {
                    if let Some(fit) = again {
                        own.fit = fit;
                    }
                }
            }
            (chi2(&found), found.into_iter().flat_map(|own| own.fit.locals).collect())
        };
        (self.chi2, self.locals) = simulated(&self.parameters, &self);
        let without = self.smooth.without;
        for _ in 0..rounds {
            let mut next = None;
            for part in [1.0, 0.5, 0.2, 0.05] {
                let mut p = self.parameters.clone();
                for (k, height) in free[0].iter().enumerate() {
                    p[height.index] += part * (self.smooth.heights[k] - self.surrogate.heights[k]);
                }
                for (own, change) in free[1].iter().zip(&self.smooth.shared) {
                    p[own.index] = (p[own.index] + part * change).clamp(own.bounds.0, own.bounds.1);
                }
                let (chi2, locals) = simulated(&p, &self);
                if chi2.is_finite() && chi2 < self.chi2 {
                    next = Some((chi2, p, locals));
                    break;
                }
            }
            let Some((chi2, p, locals)) = next else { break };
            let settled = chi2 > MIN_ERROR_RATIO_OF_STEP * self.chi2;
            (self.chi2, self.parameters, self.locals) = (chi2, p, locals);
            let groups = self.groups.as_deref();
            self.surrogate =
                Surrogate::new(system, surface, &self.parameters, free, &self.locals, groups, None);
            self.smooth = self.surrogate.smooth()?;
            // The error of the declared model is that around no form.
            self.smooth.without = without;
            if settled || stop::asked() {
                break;
            }
        }
        Some(self)
    }

    /// Place, height and half of the 95 % band at every knot, where a residual is `residual` in rms; empty for two
    /// variables.
    pub fn curve(&self, surface: &Surface, residual: f64) -> Vec<[f64; 3]> {
        let [knots] = &surface.knots[..] else { return Vec::new() };
        let heights = self.surrogate.heights.iter().zip(&self.smooth.deviation);
        knots.iter().zip(heights).map(|(x, (y, s))| [*x, *y, 1.96 * residual * s]).collect()
    }

    /// Fall of the sum of squares on held-out folds.
    pub fn gain(&self) -> f64 {
        self.smooth.without - self.smooth.held_out
    }
}

/// Quadratic forms of the parts of one record, local parameters taken out; `whole`: the part that the record is as a
/// whole.
fn parts_of(
    own: &Columns,
    shared: usize,
    signals: &[(usize, usize)],
    whole: Option<usize>,
) -> Vec<Quadratic> {
    let samples = own.residuals.len();
    if own.residuals.iter().chain(own.columns.iter().flatten()).any(|value| !value.is_finite()) {
        return vec![Quadratic::zero(shared); PARTS];
    }
    let (columns, locals) = own.columns.split_at(shared);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in locals {
        let mut column = column.clone();
        let before = dot(&column, &column);
        project(&mut column, &basis);
        let size = dot(&column, &column);
        if size > 1e-12 * before {
            column.iter_mut().for_each(|value| *value /= size.sqrt());
            basis.push(column);
        }
    }
    let mut all: Vec<Vec<f64>> = columns.iter().chain([&own.residuals]).cloned().collect();
    all.iter_mut().for_each(|column| project(column, &basis));
    let n = shared;
    let range = |part: usize, (begin, end): (usize, usize)| {
        let cut = |k: usize| begin + (end - begin) * k / PARTS;
        cut(part)..cut(part + 1)
    };
    let of = |ranges: &[std::ops::Range<usize>]| {
        let product = |a: usize, b: usize| -> f64 {
            ranges.iter().map(|range| dot(&all[a][range.clone()], &all[b][range.clone()])).sum()
        };
        let mut found = Quadratic::zero(n);
        for a in 0..n {
            for b in a..n {
                let value = product(a, b);
                found.matrix[(a, b)] = value;
                found.matrix[(b, a)] = value;
            }
            found.gradient[a] = product(a, n);
        }
        found.chi2 = product(n, n);
        found
    };
    (0..PARTS)
        .map(|part| match whole {
            Some(own) if own == part => of(std::slice::from_ref(&(0..samples))),
            Some(_) => Quadratic::zero(n),
            None => of(&signals.iter().map(|own| range(part, *own)).collect::<Vec<_>>()),
        })
        .collect()
}

/// Takes directions of unit length out of a column.
fn project(column: &mut [f64], basis: &[Vec<f64>]) {
    for direction in basis {
        let size = dot(column, direction);
        column.iter_mut().zip(direction).for_each(|(value, own)| *value -= size * own);
    }
}
