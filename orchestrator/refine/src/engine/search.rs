//! Fits of candidates, alone and together, and where to start them.

use nalgebra::{DMatrix, DVector};

use super::candidate::Candidate;
use super::fit::{Fit, Free, fit};
use super::goodness::{Null, pooled};
use super::normal::{Columns, Joint, columns, dot, residuals};
use super::{System, parallel, stop};

/// A model: the declared one with some candidates added, fitted.
#[derive(Debug, Clone)]
pub struct Model {
    /// Candidates that were added, by index.
    pub added: Vec<usize>,
    /// The fit.
    pub fit: Fit,
    /// Largest normalized power of the residual of each signal.
    pub left: Vec<(String, f64)>,
}

impl Model {
    /// Largest normalized power of all signals.
    pub fn worst(&self) -> f64 {
        self.left.iter().map(|(_, z)| *z).fold(f64::MIN, f64::max)
    }

    /// Number of parameters of the added candidates.
    pub fn size(&self, candidates: &[Candidate]) -> usize {
        self.added.iter().map(|&c| candidates[c].free.len()).sum()
    }
}

/// The search around one system.
pub struct Search<'a, S: System + ?Sized> {
    /// System.
    pub system: &'a S,
    /// Candidates.
    pub candidates: &'a [Candidate],
    /// Estimation records.
    pub records: Vec<usize>,
    /// Positions in `records` of those that candidates are screened on: one of each repeated command.
    pub screened: Vec<usize>,
    /// Null distribution.
    pub null: Null,
    /// Conditions on models beyond goodness of fit.
    pub rules: Rules<'a>,
}

/// Whether a candidate may join the effects found before.
pub type MayJoin<'a> = &'a (dyn Fn(usize, &[usize]) -> bool + Sync);
/// Whether effects with the parameters of a fit make sense.
pub type Sense<'a> = &'a (dyn Fn(&[usize], &Fit) -> bool + Sync);

/// Conditions that the models of a search have to meet; by default none.
#[derive(Clone, Copy, Default)]
pub struct Rules<'a> {
    /// Declared parameters that every fit is free to choose.
    pub always: &'a [Free],
    /// Whether a candidate may join the effects found before.
    pub may_join: Option<MayJoin<'a>>,
    /// Whether effects with the fitted parameters make sense: an effect without sense explains nothing.
    pub sense: Option<Sense<'a>>,
}

/// A start of a candidate and the sum of squares that the linear step from there predicts.
#[derive(Debug, Clone)]
pub struct Promise {
    /// Candidate.
    pub candidate: usize,
    /// Sum of squares predicted.
    pub chi2: f64,
    /// Parameter vector after the linear step.
    pub parameters: Vec<f64>,
}

/// Some records around a fitted model.
struct Around {
    /// Positions in [`Search::records`].
    screened: Vec<usize>,
    columns: Vec<Columns>,
}

/// Starts of a candidate up to which all of them are tried on all screened records.
const MAX_STARTS_ON_ALL_RECORDS: usize = 10;
/// Starts that are left of more than that.
const STARTS_LEFT: usize = 5;

impl<S: System + ?Sized> Search<'_, S> {
    /// Price of a parameter in the Bayesian information criterion: the logarithm of the number of samples.
    pub fn penalty(&self) -> f64 {
        let samples = self
            .records
            .iter()
            .map(|&record| self.system.signals(record).iter().map(|s| s.range.len()).sum::<usize>());
        (samples.sum::<usize>().max(2) as f64).ln()
    }

    /// Fits `added` candidates with `extra` free parameters from a start.
    pub fn fit(
        &self,
        added: &[usize],
        extra: &[Free],
        start: &[f64],
        locals: &[Vec<f64>],
        iterations: usize,
    ) -> Model {
        let own = added.iter().flat_map(|&c| &self.candidates[c].free);
        let free: Vec<Free> = self.rules.always.iter().chain(own).chain(extra).copied().collect();
        let mut fit = fit(self.system, &self.records, start, &free, locals, iterations);
        if fit.chi2.is_nan() {
            fit.chi2 = f64::INFINITY;
        }
        let mut left = self.left(&fit);
        if self.rules.sense.is_some_and(|sense| !sense(added, &fit)) {
            left.iter_mut().for_each(|(_, power)| *power = f64::INFINITY);
        }
        Model { added: added.to_vec(), fit, left }
    }

    /// Normalized powers of the residuals of a fit.
    pub fn left(&self, fit: &Fit) -> Vec<(String, f64)> {
        let residuals = residuals(self.system, &self.records, &fit.parameters, &fit.locals);
        self.null.normalized(&pooled(self.system, &self.records, &residuals))
    }

    /// Predicted sum of squares of every start of every candidate that `base` lacks, best first.
    pub fn screen(&self, base: &Model) -> Vec<Promise> {
        self.screen_some(base, &|_| true)
    }

    /// The same for the candidates that are `wanted`.
    pub fn screen_some(&self, base: &Model, wanted: &dyn Fn(usize) -> bool) -> Vec<Promise> {
        let fit = &base.fit;
        let around = |screened: &[usize]| Around {
            screened: screened.to_vec(),
            columns: self.screened_columns(screened, &fit.parameters, &fit.free, fit, true, None),
        };
        let all = around(&self.screened);
        let may = |c: usize| self.rules.may_join.is_none_or(|may| may(c, &base.added));
        let lacking = (0..self.candidates.len()).filter(|&c| !base.added.contains(&c) && may(c) && wanted(c));
        let mut starts: Vec<(usize, usize)> = Vec::new();
        for c in lacking {
            let own: Vec<(usize, usize)> = (0..self.candidates[c].starts.len()).map(|s| (c, s)).collect();
            if own.len() <= MAX_STARTS_ON_ALL_RECORDS {
                starts.extend(own);
                continue;
            }
            // The record with the largest misfit tells which of many starts are worth all records.
            let misfit = |j: usize| dot(&all.columns[j].residuals, &all.columns[j].residuals);
            let worst =
                (0..self.screened.len()).max_by(|&a, &b| misfit(a).total_cmp(&misfit(b)).then(b.cmp(&a)));
            let one = around(&[self.screened[worst.unwrap_or(0)]]);
            let mut ranked: Vec<(f64, (usize, usize))> =
                parallel::map(own.len(), |i| self.promise(base, &one, own[i]).map(|p| (p.chi2, own[i])))
                    .into_iter()
                    .flatten()
                    .collect();
            ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            starts.extend(ranked.into_iter().take(STARTS_LEFT).map(|(_, start)| start));
        }
        let mut promises: Vec<Promise> = parallel::map(starts.len(), |i| self.promise(base, &all, starts[i]))
            .into_iter()
            .flatten()
            .collect();
        promises.sort_by(|a, b| a.chi2.total_cmp(&b.chi2).then(a.candidate.cmp(&b.candidate)));
        promises
    }

    /// The linear step from one start.
    fn promise(&self, base: &Model, around: &Around, (candidate, start): (usize, usize)) -> Option<Promise> {
        if stop::asked() {
            return None;
        }
        let fit = &base.fit;
        let (own, start) = (&self.candidates[candidate], &self.candidates[candidate].starts[start]);
        let open: Vec<Free> = start.open.iter().map(|&position| own.free[position]).collect();
        let mut p = fit.parameters.clone();
        for &(index, value) in &start.values {
            p[index] = value;
        }
        let (m, known) = (open.len(), fit.free.len());
        let unmoved = start.idle.then(|| around.columns.iter().map(|own| &own.residuals[..]).collect());
        let moved = self.screened_columns(&around.screened, &p, &open, fit, false, unmoved);
        let mut joint = Joint::new(&moved, &around.columns, known);
        for (a, f) in fit.free.iter().enumerate() {
            if let Some(prior) = f.prior {
                joint.matrix[(m + a, m + a)] += prior.powi(-2);
                joint.right[m + a] -= fit.parameters[f.index] * prior.powi(-2);
                joint.chi2 += (fit.parameters[f.index] / prior).powi(2);
            }
        }
        // As if all records had been screened.
        let share = self.records.len() as f64 / around.screened.len() as f64;
        let mut held = vec![false; m];
        for _ in 0..=m {
            let step = solve(&joint.matrix, &joint.right, &held)?;
            let outside = (0..m).find(|&a| {
                let value = p[open[a].index] + step[a];
                !held[a] && (value < open[a].bounds.0 || value > open[a].bounds.1)
            });
            if let Some(a) = outside {
                held[a] = true;
                continue;
            }
            for (a, f) in open.iter().enumerate() {
                p[f.index] += step[a];
            }
            let promise =
                Promise { candidate, chi2: (joint.chi2 - joint.gain(&step)) * share, parameters: p };
            return joint.chi2.is_finite().then_some(promise);
        }
        None
    }

    /// Derivatives of the records at the positions `screened`.
    fn screened_columns(
        &self,
        screened: &[usize],
        p: &[f64],
        free: &[Free],
        base: &Fit,
        local_columns: bool,
        known: Option<Vec<&[f64]>>,
    ) -> Vec<Columns> {
        let records: Vec<usize> = screened.iter().map(|&i| self.records[i]).collect();
        let locals: Vec<&[f64]> = screened.iter().map(|&i| &base.locals[i][..]).collect();
        columns(self.system, &records, p, free, &locals, local_columns, known)
    }
}

/// Least-squares step with some of the first unknowns held at zero.
fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>, held: &[bool]) -> Option<DVector<f64>> {
    let open: Vec<usize> = (0..right.len()).filter(|&i| !held.get(i).copied().unwrap_or(false)).collect();
    let part = DMatrix::from_fn(open.len(), open.len(), |a, b| {
        let value = matrix[(open[a], open[b])];
        if a == b { value * (1.0 + 1e-9) + 1e-12 } else { value }
    });
    let solved = nalgebra::Cholesky::new(part)?.solve(&DVector::from_fn(open.len(), |a, _| right[open[a]]));
    let mut step = DVector::zeros(right.len());
    for (a, &i) in open.iter().enumerate() {
        step[i] = solved[a];
    }
    Some(step)
}
