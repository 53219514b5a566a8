//! Periods of a force that repeats along the way, far shorter than the travel: proposed by what the declared model
//! leaves.
//!
//! Trying every period would take thousands of simulations. A force that is fast beside the motion shows in a speed as
//! its integral and in a position as its double integral, whatever else the system does, up to a parabola over a few
//! periods. So the residual is compared, block by block and without its parabola, with integrals of sine
//! and cosine along the way. The best periods become starts of the candidate, which the search judges as any other.

use super::fits::{Fits, Model};
use super::initial_guesses::STEP_OF_TURNS;
use super::law::Law;
use super::model::{Action, Study};
use crate::engine::{System, parallel, stop};
use crate::law::study::motion;
use crate::order::descending;

/// Numbers of periods within the travel that are compared: the least is some below the most of the catalog, so that a
/// peak there has neighbors.
const TURNS: (f64, f64) = (20.0, 600.0);
/// Samples in which the motion goes on by a period, on average, at least.
const MIN_SAMPLES_PER_PERIOD: f64 = 4.0;
/// Periods in a block, and its samples at least.
const PERIODS_PER_BLOCK: f64 = 6.0;
const MIN_BLOCK: usize = 16;
/// Periods that are proposed.
const PROPOSED: usize = 5;
/// Twice the gain in likelihood that a period must bring.
const MIN_GAIN: f64 = 50.0;

/// A record as this comparison sees it.
struct Part<'a> {
    /// Positions, `[n]`.
    positions: &'a [f64],
    /// Residuals of the model, `[outputs][n]`.
    left: Vec<&'a [f64]>,
    /// Samples after which the simulation starts anew.
    window: usize,
}

/// Adds starts to the candidates for periodic forces.
pub fn propose(study: &mut Study, scale: &[f64], declared: &Model) {
    let is_periodic =
        |c: &usize| matches!(study.candidates[*c].action, Action::Block { law: Law::Cogging, .. });
    let periodic: Vec<usize> = (0..study.candidates.len()).filter(is_periodic).collect();
    if periodic.is_empty() || stop::asked() {
        return;
    }
    let found: Vec<Vec<f64>> = {
        let fits = Fits::new(study, scale.to_vec());
        let view = fits.view(&[], &fits.pieces);
        let residuals = |r: usize| view.residuals(r, &declared.fit.parameters, &declared.fit.locals[r]);
        let left: Vec<Vec<f64>> = (0..fits.pieces.len()).map(residuals).collect();
        let motion = motion(&fits, declared);
        let one = |&c: &usize| {
            let Action::Block { tap, .. } = study.candidates[c].action else { return Vec::new() };
            let places: Vec<f64> = motion[tap].iter().map(|point| point.position).collect();
            let (mut rest, mut parts) = (&places[..], Vec::new());
            for (piece, left) in fits.pieces.iter().zip(&left) {
                let n = piece.range.len();
                let Some((own, others)) = rest.split_at_checked(n) else { return Vec::new() };
                let window = study.window(study.records[piece.record].step).unwrap_or(n);
                parts.push(Part { positions: own, left: left.chunks_exact(n.max(1)).collect(), window });
                rest = others;
            }
            periods(&parts)
        };
        periodic.iter().map(one).collect()
    };
    for (c, periods) in periodic.into_iter().zip(found) {
        study.candidates[c].starts.extend(periods.into_iter().map(|period| vec![0.0, 0.0, period]));
    }
}

/// The periods along which the records repeat best what the model leaves, best first.
fn periods(parts: &[Part]) -> Vec<f64> {
    let all = || parts.iter().flat_map(|part| part.positions);
    let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let travel = high - low;
    let pace = pace(parts);
    if !(travel > 0.0 && travel.is_finite() && pace > 0.0) {
        return Vec::new();
    }
    let most = TURNS.1.min(travel / (MIN_SAMPLES_PER_PERIOD * pace));
    let count = ((most - TURNS.0) / STEP_OF_TURNS).max(0.0) as usize;
    let period = |k: usize| travel / (TURNS.0 + STEP_OF_TURNS * k as f64);
    let gains = parallel::map(count, |k| gain(parts, period(k), pace));
    let peak = |k: &usize| {
        let around = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
        gains[*k] > MIN_GAIN && around.filter_map(|j| gains.get(j)).all(|other| *other <= gains[*k])
    };
    let mut peaks: Vec<usize> = (0..count).filter(peak).collect();
    descending(&mut peaks, |own| gains[*own]);
    peaks.into_iter().take(PROPOSED).map(period).collect()
}

/// Root mean square of the way from sample to sample.
fn pace(parts: &[Part]) -> f64 {
    let steps = parts.iter().flat_map(|part| part.positions.windows(2));
    let (sum, count) = steps.fold((0.0, 0), |(sum, n), x| (sum + (x[1] - x[0]).powi(2), n + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// Twice the gain in likelihood of a force with a period, over all outputs: of each as its integral or double integral.
fn gain(parts: &[Part], period: f64, pace: f64) -> f64 {
    let wave = std::f64::consts::TAU / period;
    let length = ((PERIODS_PER_BLOCK * period / pace) as usize).max(MIN_BLOCK);
    let outputs = parts.first().map_or(0, |part| part.left.len());
    // Of each output and order: squares of sine and cosine, their product, products with the residual; its squares.
    let mut sums = vec![[[0.0; 5]; 2]; outputs];
    let mut squares = vec![(0.0, 0usize); outputs];
    let mut waves: [[Vec<f64>; 2]; 2] = Default::default();
    let mut own = Vec::new();
    for part in parts {
        let n = part.positions.len();
        for window in (0..n).step_by(part.window.max(1)) {
            let end = (window + part.window).min(n);
            for first in (window..end).step_by(length) {
                let block = first..(first + length).min(end);
                if block.len() < MIN_BLOCK {
                    continue;
                }
                let phases = part.positions[block.clone()].iter().map(|x| (wave * x).sin_cos());
                waves.iter_mut().flatten().for_each(Vec::clear);
                let mut integrals = [[0.0; 2]; 2];
                for (sine, cosine) in phases {
                    for (k, value) in [sine, cosine].into_iter().enumerate() {
                        integrals[1][k] += integrals[0][k] + 0.5 * value;
                        integrals[0][k] += value;
                        (0..2).for_each(|order| waves[order][k].push(integrals[order][k]));
                    }
                }
                waves.iter_mut().flatten().for_each(|values| without_parabola(values));
                for (o, left) in part.left.iter().enumerate() {
                    own.clear();
                    own.extend_from_slice(&left[block.clone()]);
                    without_parabola(&mut own);
                    squares[o].0 += own.iter().map(|value| value * value).sum::<f64>();
                    squares[o].1 += block.len() - 3;
                    for (sums, [sine, cosine]) in sums[o].iter_mut().zip(&waves) {
                        for ((s, c), r) in sine.iter().zip(cosine).zip(&own) {
                            let products = [s * s, c * c, s * c, s * r, c * r];
                            sums.iter_mut().zip(products).for_each(|(sum, own)| *sum += own);
                        }
                    }
                }
            }
        }
    }
    let of_output = |(sums, (whole, count)): (&[[f64; 5]; 2], &(f64, usize))| {
        let left = sums.iter().map(|sums| whole - explained(sums)).fold(*whole, f64::min);
        let ratio = whole / left.max(1e-9 * whole);
        if ratio.is_finite() { *count as f64 * ratio.ln() } else { 0.0 }
    };
    sums.iter().zip(&squares).map(of_output).sum()
}

/// Part of the squares of a residual that sine and cosine explain.
fn explained([ss, cc, sc, sr, cr]: &[f64; 5]) -> f64 {
    let determinant = ss * cc - sc * sc;
    if determinant <= 1e-9 * ss * cc {
        return 0.0;
    }
    (cc * sr * sr - 2.0 * sc * sr * cr + ss * cr * cr) / determinant
}

/// Takes the parabola of least squares from some values.
fn without_parabola(values: &mut [f64]) {
    let n = values.len() as f64;
    let at = |k: usize| k as f64 - 0.5 * (n - 1.0);
    // Orthogonal over the samples: 1, u, u^2 less its mean.
    let bend = |u: f64| u * u - (n * n - 1.0) / 12.0;
    let (mut mean, mut slope, mut curve) = (0.0, 0.0, 0.0);
    for (k, value) in values.iter().enumerate() {
        mean += value;
        slope += at(k) * value;
        curve += bend(at(k)) * value;
    }
    mean /= n;
    slope /= n * (n * n - 1.0) / 12.0;
    curve /= n * (n * n - 1.0) * (n * n - 4.0) / 180.0;
    let parabola = |u: f64| mean + slope * u + curve * bend(u);
    values.iter_mut().enumerate().for_each(|(k, value)| *value -= parabola(at(k)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_series::random::Random;

    /// Position \[m\] of a damped mass under a command, with a force of this period \[m\] or without, and the noise of
    /// the sensor: semi-implicit Euler in fine steps.
    fn driven(period: Option<f64>, seed: u64) -> Vec<f64> {
        let (step, fine) = (2e-3, 20);
        let mut random = Random::new(seed);
        let (mut x, mut v, mut positions) = (0.0, 0.0, Vec::new());
        for k in 0..4000 {
            positions.push(x + 3e-6 * random.normal());
            for i in 0..fine {
                let t = step * (f64::from(k) + f64::from(i) / f64::from(fine));
                let wave = period.map_or(0.0, |own| 0.6 * (std::f64::consts::TAU * x / own).sin());
                v +=
                    step / f64::from(fine) * (4.0 * (1.1 * t).sin() + 2.0 * (2.7 * t).sin() - 3.0 * v - wave);
                x += step / f64::from(fine) * v;
            }
        }
        positions
    }

    #[test]
    fn a_force_with_ninety_periods_in_the_travel_is_proposed() {
        let period = 0.03;
        let [own, free] = [(Some(period), 5), (None, 6)].map(|(period, seed)| driven(period, seed));
        let left: Vec<f64> = own.iter().zip(&free).map(|(a, b)| a - b).collect();
        let (low, high) = own.iter().fold((0.0f64, 0.0f64), |(a, b), x| (a.min(*x), b.max(*x)));
        let turns = (high - low) / period;
        assert!(turns > 80.0, "{turns}");
        for window in [left.len(), 100] {
            let found = periods(&[Part { positions: &own, left: vec![&left], window }]);
            let near = |own: &f64| ((high - low) / own - turns).abs() < 0.6 * STEP_OF_TURNS;
            assert!(found.first().is_some_and(near), "{found:?}");
        }
    }

    #[test]
    fn noise_proposes_nothing() {
        let positions = driven(None, 5);
        let mut random = Random::new(9);
        let left: Vec<f64> = positions.iter().map(|_| 1e-5 * random.normal()).collect();
        let part = Part { positions: &positions, left: vec![&left], window: left.len() };
        assert!(periods(&[part]).is_empty());
    }

    #[test]
    fn a_parabola_leaves_nothing() {
        let mut values: Vec<f64> =
            (0..17).map(|k| 3.0 - 0.2 * f64::from(k) + 0.05 * f64::from(k * k)).collect();
        without_parabola(&mut values);
        assert!(values.iter().all(|value| value.abs() < 1e-12), "{values:?}");
    }
}
