//! Search for orders and delay: many ARX structures from one factorization, judged by their free simulation.
//!
//! The triangle of the largest structure holds all smaller ones. A one-step fit says little about a model that will be
//! simulated, so the ranking is by the simulated fit on records that were not used for the estimation; information
//! criteria are given for comparison.

mod simulate;

use std::ops::RangeInclusive;

use super::arx::{self, Error, Estimate, Names};
use super::model::Model;
use super::regressor::Regression;
use super::source::{Part, Source};
use super::structure::Structure;

/// Fits that differ by less \[points\] count as equal; the smaller structure then goes first.
pub const EQUAL_FIT: f64 = 0.01;
/// Simulated fits within this \[points\] of the best are not worth more coefficients: chance in the judging data makes
/// as much.
pub const FIT_MARGIN: f64 = 0.5;
/// Largest number of structures of one search.
pub const MAX_STRUCTURES: usize = 10_000;

/// Orders to try, the same for all outputs and inputs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ranges {
    /// Coefficients on past outputs.
    pub na: RangeInclusive<usize>,
    /// Coefficients on inputs.
    pub nb: RangeInclusive<usize>,
    /// Delays in samples.
    pub nk: RangeInclusive<usize>,
}

impl Ranges {
    /// All structures, small ones first.
    pub fn structures(&self, channels: (usize, usize)) -> Vec<Structure> {
        let mut all: Vec<Structure> = Vec::new();
        for na in self.na.clone() {
            for nb in self.nb.clone() {
                // Without an input there is no delay to try.
                let delays = if nb == 0 { *self.nk.start()..=*self.nk.start() } else { self.nk.clone() };
                all.extend(delays.map(|nk| Structure::uniform(channels, na, nb, nk)));
            }
        }
        all.retain(|structure| structure.parameters() > 0);
        all.sort_by_key(Structure::parameters);
        all
    }

    /// A structure that has the regressors of all of them.
    pub fn largest(&self, channels: (usize, usize)) -> Structure {
        let first = *self.nk.start();
        let span = self.nb.end() + self.nk.end() - first;
        Structure::uniform(channels, *self.na.end(), span, first)
    }
}

/// One structure of the search.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Structure.
    pub structure: Structure,
    /// Number of coefficients.
    pub parameters: usize,
    /// Whether all poles are inside the unit circle; `None` if it could not be estimated.
    pub stable: Option<bool>,
    /// Mean simulated fit over outputs and judging records \[%\]; `None` for an unstable model.
    pub fit: Option<f64>,
    /// The same by output, shape \[n_y\].
    pub fits: Vec<Option<f64>>,
    /// Akaike's criterion with correction for few data, on the estimation data.
    pub aicc: Option<f64>,
    /// Bayesian information criterion.
    pub bic: Option<f64>,
    /// Minimum description length (Ljung, eq. 16.38): loss times `1 + d ln(N) / N`, as logarithm.
    pub mdl: Option<f64>,
    /// Reason why it could not be estimated.
    pub problem: Option<String>,
}

/// Tries all structures: estimated on `estimation`, ranked by the simulated fit on `judging`, best first.
///
/// All candidates are estimated from the same equations and judged on the same samples, so that their numbers can be
/// compared. Results do not depend on the number of threads.
///
/// # Errors
/// Errors of reading the records, or data on which no structure can be estimated.
pub fn search(
    estimation: &[&dyn Source],
    judging: &[&dyn Source],
    ranges: &Ranges,
    sample_time: f64,
    offsets: (&[f64], &[f64]),
    names: Names,
) -> Result<Vec<Candidate>, Error> {
    let channels = (offsets.0.len(), offsets.1.len());
    let largest = ranges.largest(channels);
    let regression = Regression::of(estimation, &largest, offsets)?;
    let structures = ranges.structures(channels);
    let mut candidates = Vec::new();
    let mut models = Vec::new();
    for structure in structures {
        let solved = arx::solve(&regression, &structure, sample_time, offsets, names);
        let candidate = candidate(structure, &solved, channels.1);
        models.push(match solved {
            Ok(estimate) if candidate.stable == Some(true) => Some(estimate.model),
            Ok(_) | Err(Error::RankDeficient { .. } | Error::TooFew { .. }) => None,
            Err(error) => return Err(error),
        });
        candidates.push(candidate);
    }
    let stable: Vec<usize> = (0..models.len()).filter(|&index| models[index].is_some()).collect();
    let chosen: Vec<_> = models.iter().flatten().collect();
    let fits = simulate::fits(&chosen, judging, largest.lags())?;
    for (index, fits) in stable.into_iter().zip(fits) {
        let all: Option<Vec<f64>> = fits.iter().copied().collect();
        candidates[index].fit = all.map(|fits| fits.iter().sum::<f64>() / fits.len() as f64);
        candidates[index].fits = fits;
    }
    rank(&mut candidates);
    Ok(candidates)
}

/// Best first; among equals the one with fewer coefficients; those without a fit last.
fn rank(candidates: &mut [Candidate]) {
    let level =
        |candidate: &Candidate| candidate.fit.map_or(f64::NEG_INFINITY, |fit| (fit / EQUAL_FIT).round());
    candidates.sort_by(|a, b| level(b).total_cmp(&level(a)).then(a.parameters.cmp(&b.parameters)));
}

/// Index of the structure to take: the least Bayesian information criterion among those with a simulated fit within
/// [`FIT_MARGIN`] of the best; `None` if no structure is stable.
pub fn recommended(candidates: &[Candidate]) -> Option<usize> {
    let best = candidates.iter().filter_map(|candidate| candidate.fit).fold(f64::NEG_INFINITY, f64::max);
    let near = |candidate: &Candidate| candidate.fit.is_some_and(|fit| fit >= best - FIT_MARGIN);
    // Data without noise may have no criterion; then the ranking decides.
    let criterion = |index: usize| candidates[index].bic.unwrap_or(f64::NEG_INFINITY);
    (0..candidates.len())
        .filter(|&index| near(&candidates[index]))
        .min_by(|&a, &b| criterion(a).total_cmp(&criterion(b)).then(a.cmp(&b)))
}

fn candidate(structure: Structure, solved: &Result<Estimate, Error>, n_y: usize) -> Candidate {
    let parameters = structure.parameters();
    let mut candidate = Candidate {
        structure,
        parameters,
        stable: None,
        fit: None,
        fits: vec![None; n_y],
        aicc: None,
        bic: None,
        mdl: None,
        problem: None,
    };
    match solved {
        Err(error) => candidate.problem = Some(error.to_string()),
        Ok(estimate) => {
            candidate.stable = Some(estimate.model.is_stable());
            let (rows, d) = (estimate.rows as f64, parameters as f64);
            let values = rows * n_y as f64;
            // Loss: the logarithm of the determinant of the sample covariance of the equation errors.
            let scale = |equation: &arx::Equation| 1.0 - equation.terms.len() as f64 / rows;
            let freedom: f64 = estimate.equations.iter().map(|equation| scale(equation).ln()).sum();
            let loss = estimate.noise_covariance.determinant().ln() + freedom;
            let known = |value: f64| value.is_finite().then_some(value);
            candidate.aicc = known(rows * loss + 2.0 * d + 2.0 * d * (d + 1.0) / (values - d - 1.0));
            candidate.bic = known(rows * loss + d * rows.ln());
            candidate.mdl = known(loss + (d * rows.ln() / rows).ln_1p());
        }
    }
    candidate
}

/// Samples at the beginning of each record that are estimated from when no record is given to judge by: the first two
/// thirds.
pub fn estimation_share(samples: usize) -> usize {
    samples - samples / 3
}

/// Same as [`search`]; without records to judge by, the last third of each estimation record judges.
///
/// # Errors
/// Same as [`search`].
pub fn search_or_split(
    estimation: &[&dyn Source],
    judging: &[&dyn Source],
    ranges: &Ranges,
    sample_time: f64,
    offsets: (&[f64], &[f64]),
    names: Names,
) -> Result<Vec<Candidate>, Error> {
    if !judging.is_empty() {
        return search(estimation, judging, ranges, sample_time, offsets, names);
    }
    let parts = |last: bool| -> Vec<Part> {
        let cut = |samples: usize| match last {
            true => (estimation_share(samples), samples),
            false => (0, estimation_share(samples)),
        };
        let cuts = estimation.iter().map(|source| cut(source.samples()));
        estimation.iter().zip(cuts).map(|(&source, (from, to))| Part { source, from, to }).collect()
    };
    let (first, last) = (parts(false), parts(true));
    let first: Vec<&dyn Source> = first.iter().map(|part| part as &dyn Source).collect();
    let last: Vec<&dyn Source> = last.iter().map(|part| part as &dyn Source).collect();
    search(&first, &last, ranges, sample_time, offsets, names)
}

/// The structures that no range of this size may exceed.
///
/// # Errors
/// [`super::structure::Error`] for more than [`MAX_STRUCTURES`] structures, or none.
pub fn check(ranges: &Ranges, channels: (usize, usize)) -> Result<(), super::structure::Error> {
    let size = |range: &RangeInclusive<usize>| (range.end() + 1).saturating_sub(*range.start());
    let found = size(&ranges.na).saturating_mul(size(&ranges.nb)).saturating_mul(size(&ranges.nk));
    if found == 0 || found > MAX_STRUCTURES || ranges.structures(channels).is_empty() {
        return Err(super::structure::Error::Ranges { found, most: MAX_STRUCTURES });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
