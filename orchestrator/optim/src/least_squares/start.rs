//! Several starts: points that fill a box evenly, and the best of the minima found from them.

use super::{Error, Problem, Settings, Solution, solve};

/// Solves from every start (each of shape \[n\]) and keeps the smallest sum of squares (the first of equals); starts
/// that cannot be evaluated are passed over.
///
/// The second value holds the sum of squares reached from each start, none where it could not be evaluated: how many
/// agree shows how far the minimum can be trusted to be the global one.
///
/// # Errors
/// Same as [`solve`]; [`Error::Start`] only if no start can be evaluated.
pub fn multi_start(
    problem: &Problem,
    starts: &[Vec<f64>],
    settings: &Settings,
) -> Result<(Solution, Vec<Option<f64>>), Error> {
    let mut best: Option<Solution> = None;
    let mut costs = Vec::with_capacity(starts.len());
    for start in starts {
        match solve(problem, start, settings) {
            Ok(found) => {
                costs.push(Some(found.cost));
                if best.as_ref().is_none_or(|best| found.cost < best.cost) {
                    best = Some(found);
                }
            }
            Err(Error::Start { .. }) => costs.push(None),
            Err(error) => return Err(error),
        }
    }
    match best {
        Some(best) => Ok((best, costs)),
        None => Err(Error::Start { start: starts.first().cloned().unwrap_or_default() }),
    }
}

/// Bases of the Halton sequence; further dimensions reuse them, shifted.
const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

/// `count` points of the Halton sequence in the box `ranges` (shape \[n\]): even cover, the same points every time.
///
/// # Panics
/// Never; infinite ranges give infinite points, which no problem can evaluate.
pub fn spread(ranges: &[(f64, f64)], count: usize) -> Vec<Vec<f64>> {
    let point = |index: usize| {
        let coordinate = |(axis, &(from, to)): (usize, &(f64, f64))| {
            let share = radical_inverse(index + 1 + axis / PRIMES.len(), PRIMES[axis % PRIMES.len()]);
            from + share * (to - from)
        };
        ranges.iter().enumerate().map(coordinate).collect()
    };
    (0..count).map(point).collect()
}

/// The digits of `index` in `base`, mirrored at the point.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while index > 0 {
        value += digit * (index % base) as f64;
        index /= base;
        digit /= base as f64;
    }
    value
}
