//! Search among sums of terms for those that reproduce a free form, on its quadratic forms: every fit is a curve
//! through a few heights, weighted by the information of the records on each.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::grammar::{Axis, Formula, Shape, Term, terms};
use super::surface::Surface;
use super::surrogate::{PARTS, Quadratic, Surrogate};
use crate::engine::parallel;
use crate::order::{ascending, descending};

/// Most terms of a formula.
const TERMS: usize = 3;
/// Formulas that are carried on from one number of terms to the next.
const BEAM: usize = 8;
/// Formulas that are given on.
pub const MAX_FORMULAS_GIVEN_ON: usize = 8;
/// Most parameters: the FMU that evaluates formulas has no more.
const PARAMETERS: usize = 12;
/// Turns of a sine within the range of its variable, below which it is a line or a parabola.
const MIN_TURNS_OF_SINE: f64 = 0.15;
/// Share of the error that one more unit of complexity must save.
pub const PRICE_PER_COMPLEXITY: f64 = 0.02;

/// A formula with its errors on the quadratic form.
#[derive(Debug, Clone)]
pub struct Found {
    /// Formula, fitted.
    pub formula: Formula,
    /// Sum of squares on all parts.
    pub error: f64,
    /// The same on parts that were held out in turn.
    pub held_out: f64,
}

impl Found {
    /// Rank, least first: the logarithm of the held-out error plus a price for the complexity.
    pub fn rank(&self) -> f64 {
        0.5 * self.held_out.max(1e-300).ln() + PRICE_PER_COMPLEXITY * self.formula.complexity() as f64
    }
}

/// A quadratic form of heights as weighted differences from those that fit best.
struct Target {
    /// Heights that fit best.
    best: DVector<f64>,
    /// Upper factor of the weights.
    factor: DMatrix<f64>,
    /// Error at the best heights.
    least: f64,
}

impl Target {
    fn new(own: &Quadratic, middle: &[f64]) -> Option<Target> {
        let n = own.gradient.len();
        let size = (0..n).map(|i| own.matrix[(i, i)]).fold(0.0, f64::max);
        let mut matrix = own.matrix.clone();
        (0..n).for_each(|i| matrix[(i, i)] += 1e-10 * size.max(1e-300));
        let cholesky = Cholesky::new(matrix)?;
        let step = cholesky.solve(&-&own.gradient);
        let least = own.at(&step);
        let best = DVector::from_fn(n, |i, _| middle[i] + step[i]);
        Some(Target { best, factor: cholesky.l().transpose(), least })
    }

    fn residuals(&self, heights: &[f64]) -> DVector<f64> {
        let difference = DVector::from_fn(heights.len(), |i, _| heights[i] - self.best[i]);
        &self.factor * difference
    }
}

/// Whether every sine of a formula turns by `MIN_TURNS_OF_SINE` or more over the knots of its variable,
/// `[variables][knots]`, and has two of them for a turn: with fewer, they say nothing of what lies between.
pub fn sines_are_seen(formula: &Formula, knots: &[Vec<f64>]) -> bool {
    let mut sines = formula.by_factor().filter(|(own, _)| own.shape == Shape::Sine);
    sines.all(|(own, p)| is_seen(p[0], &knots[own.variable]))
}

/// Whether a sine with `q` radians per unit of a variable can be seen at its knots.
fn is_seen(q: f64, knots: &[f64]) -> bool {
    let turns = q.abs() * (knots[knots.len() - 1] - knots[0]) / std::f64::consts::TAU;
    (MIN_TURNS_OF_SINE..=0.5 * (knots.len() - 1) as f64).contains(&turns)
}

/// The search.
pub struct Search<'a> {
    surface: &'a Surface,
    axes: &'a [Axis],
    middle: &'a [f64],
    all: Target,
    folds: Vec<(Target, Quadratic)>,
}

impl<'a> Search<'a> {
    /// On the quadratic forms of a free form over these axes.
    pub fn new(surrogate: &'a Surrogate, surface: &'a Surface, axes: &'a [Axis]) -> Option<Search<'a>> {
        let middle = &surrogate.heights[..];
        let all = Target::new(&surrogate.reduced(&surrogate.without(None)), middle)?;
        let fold = |part: usize| -> Option<(Target, Quadratic)> {
            let rest = surrogate.reduced(&surrogate.without(Some(part)));
            Some((Target::new(&rest, middle)?, surrogate.reduced(&surrogate.parts[part])))
        };
        let folds = (0..PARTS).map(fold).collect::<Option<Vec<_>>>()?;
        Some(Search { surface, axes, middle, all, folds })
    }

    fn heights(&self, formula: &Formula) -> Vec<f64> {
        self.surface.heights_of(|at| formula.value(at))
    }

    /// Fits the parameters of a formula to a target; its error.
    fn fit(&self, formula: &mut Formula, target: &Target, rounds: usize) -> f64 {
        let mut residuals = target.residuals(&self.heights(formula));
        let mut error = residuals.norm_squared();
        let mut damping = 1e-3;
        let n = formula.p.len();
        for _ in 0..rounds {
            let mut jacobian = DMatrix::zeros(residuals.len(), n);
            for k in 0..n {
                let own = formula.p[k];
                let step = 1e-6 * own.abs().max(1e-9);
                formula.p[k] = own + step;
                let moved = target.residuals(&self.heights(formula));
                formula.p[k] = own;
                jacobian.set_column(k, &((moved - &residuals) / step));
            }
            let (matrix, right) = (jacobian.transpose() * &jacobian, -(jacobian.transpose() * &residuals));
            let mut moved = false;
            for _ in 0..6 {
                let damped = DMatrix::from_fn(n, n, |a, b| {
                    matrix[(a, b)] + if a == b { damping * matrix[(a, a)] + 1e-300 } else { 0.0 }
                });
                let Some(step) = Cholesky::new(damped).map(|own| own.solve(&right)) else {
                    damping *= 10.0;
                    continue;
                };
                let before = formula.p.clone();
                formula.p.iter_mut().zip(step.iter()).for_each(|(p, step)| *p += step);
                let trial = target.residuals(&self.heights(formula));
                let new = trial.norm_squared();
                if new.is_finite() && new < error && self.sensible(formula) {
                    moved = error - new > 1e-7 * error;
                    (residuals, error, damping) = (trial, new, (damping * 0.1f64).max(1e-12));
                    break;
                }
                formula.p = before;
                damping *= 10.0;
            }
            if !moved {
                break;
            }
        }
        target.least + error
    }

    /// Whether shapes lie within what the records show.
    fn sensible(&self, formula: &Formula) -> bool {
        let sines = sines_are_seen(formula, &self.surface.knots);
        let shapes = formula.by_factor().all(|(own, p)| {
            let (low, high) = self.axes[own.variable].range;
            let span = high - low;
            own.shape.parameters().iter().zip(p).all(|((role, _), value)| match *role {
                "m" => (low - 0.05 * span..=high + 0.05 * span).contains(value),
                "s" | "w" if own.shape == Shape::Decay => {
                    value.abs() > 0.01 * span && value.abs() < 10.0 * span
                }
                "s" | "w" => *value > 1e-4 * span && *value < 3.0 * span,
                "q" => *value > 0.0,
                _ => value.abs() < 20.0,
            })
        });
        sines && shapes
    }

    /// A formula with one more term, from every start of its shapes; the best fit.
    fn with(&self, base: &Formula, term: &Term) -> Option<Formula> {
        let mut starts: Vec<Vec<f64>> = vec![Vec::new()];
        for own in &term.factors {
            let some = own.shape.starts(self.axes[own.variable].range);
            starts = starts.iter().flat_map(|a| some.iter().map(|b| [&a[..], b].concat())).collect();
        }
        let alone = |shape: &[f64]| Formula { terms: vec![term.clone()], p: [&[1.0], shape].concat() };
        starts.retain(|shape| sines_are_seen(&alone(shape), &self.surface.knots));
        let base_residuals = self.all.residuals(&self.heights(base));
        let tried = starts.into_iter().filter_map(|shape| {
            let column = self.surface.heights_of(|at| term.shape(at, &shape));
            let column = &self.all.factor * DVector::from_vec(column);
            let size = column.norm_squared();
            let amplitude = -column.dot(&base_residuals) / size;
            let gain = amplitude * amplitude * size;
            (size > 0.0 && gain.is_finite()).then_some((gain, amplitude, shape))
        });
        let mut tried: Vec<(f64, f64, Vec<f64>)> = tried.collect();
        descending(&mut tried, |own| own.0);
        let fitted = tried.into_iter().take(3).map(|(_, amplitude, shape)| {
            let mut formula = base.clone();
            formula.terms.push(term.clone());
            formula.p.extend([&[amplitude], &shape[..]].concat());
            let error = self.fit(&mut formula, &self.all, 12);
            (error, formula)
        });
        let best = fitted.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(best.1)
    }

    /// Errors of a formula, also on parts that were held out.
    fn judged(&self, mut formula: Formula) -> Found {
        let error = self.fit(&mut formula, &self.all, 20);
        let mut held_out = 0.0;
        for (target, part) in &self.folds {
            let mut own = formula.clone();
            self.fit(&mut own, target, 8);
            let heights = self.heights(&own);
            held_out += part.at(&DVector::from_fn(heights.len(), |i, _| heights[i] - self.middle[i]));
        }
        Found { formula, error, held_out }
    }

    /// The best formulas, by rank; of each number of terms some.
    pub fn run(&self) -> Vec<Found> {
        let list = terms(self.axes);
        let mut found: Vec<Found> = Vec::new();
        let mut beam = vec![Formula { terms: Vec::new(), p: Vec::new() }];
        for _ in 0..TERMS {
            let jobs: Vec<(usize, usize)> =
                (0..beam.len()).flat_map(|b| (0..list.len()).map(move |t| (b, t))).collect();
            let next = parallel::map(jobs.len(), |j| {
                let (base, term) = (&beam[jobs[j].0], &list[jobs[j].1]);
                let count: usize = base.terms.iter().chain([term]).map(Term::count).sum();
                if base.terms.contains(term) && term.count() == 1 || count > PARAMETERS {
                    return None;
                }
                let own = self.with(base, term)?;
                let error = self.all.least + self.all.residuals(&self.heights(&own)).norm_squared();
                Some((error, own))
            });
            let mut next: Vec<(f64, Formula)> =
                next.into_iter().flatten().filter(|own| own.0.is_finite()).collect();
            let rank = |own: &(f64, Formula)| {
                0.5 * own.0.max(1e-300).ln() + PRICE_PER_COMPLEXITY * own.1.complexity() as f64
            };
            ascending(&mut next, rank);
            let mut kept: Vec<Formula> = Vec::new();
            for (_, own) in next {
                if kept.len() < 2 * BEAM && !kept.iter().any(|known| known.same_form(&own)) {
                    kept.push(own);
                }
            }
            let mut judged = parallel::map(kept.len(), |k| self.judged(kept[k].clone()));
            ascending(&mut judged, |own| own.rank());
            beam = judged.iter().take(BEAM).map(|own| own.formula.clone()).collect();
            found.extend(judged.into_iter().take(BEAM));
        }
        found.retain(|own| own.held_out.is_finite());
        ascending(&mut found, |own| own.rank());
        let mut kept: Vec<Found> = Vec::new();
        for own in found {
            if !kept.iter().any(|known| known.formula.same_form(&own.formula)) {
                kept.push(own);
            }
        }
        kept.truncate(MAX_FORMULAS_GIVEN_ON);
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::grammar::Factor;

    #[test]
    fn a_sine_is_seen_if_it_turns_and_has_two_knots_for_a_turn() {
        let knots = |size: f64, count: usize| -> Vec<f64> {
            (0..count).map(|k| size * (2.0 * k as f64 / (count - 1) as f64 - 1.0)).collect()
        };
        let knots = [knots(1.0, 6), knots(3.0, 6)];
        let formula = |q: f64| {
            let factors = [(1, Shape::Power(1)), (0, Shape::Sine)];
            let factors = factors.map(|(variable, shape)| Factor { variable, shape });
            Formula { terms: vec![Term { factors: factors.into() }], p: vec![1.0, q, 0.2] }
        };
        assert_eq!(formula(0.4).by_factor().last().unwrap().1, [0.4, 0.2]);
        assert_eq!(formula(0.4).names(), ["a", "qb", "pb"]);
        // A seventh of a turn over a width of 2 is a q of 0.47, two and a half turns are one of 7.85.
        let seen = [0.4, -0.4, 0.6, -7.5, 8.0].map(|q| sines_are_seen(&formula(q), &knots));
        assert_eq!(seen, [false, false, true, true, false]);
    }
}
