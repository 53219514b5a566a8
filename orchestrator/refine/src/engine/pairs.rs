//! Pairs of effects that show only together, by the linear step around a model: a friction that is declared too large
//! hides two others, each of which alone would only add to it.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::fit::Free;
use super::forward_selection::{Run, Weights};
use super::normal::Normal;
use super::question::Tried;
use super::search::Model;

/// Pairs that are proposed.
const MAX_PAIRS: usize = 2;
/// Ratio of the sums of squares that a pair leaves and that the better of its two effects leaves, above which a pair is
/// none: forward selection finds it one by one. How significant it is shows under the weights of what it leaves.
const MAX_RATIO_LEFT: f64 = 0.5;

impl Run<'_> {
    /// Sets of the effects of `best` and two of those `tried`, with the parameters that the linear step predicts.
    ///
    /// Only effects that change nothing at a neutral amplitude take part, with the shapes that they were fitted with.
    pub(super) fn predicted_pairs(&self, best: &Model, tried: &[Tried]) -> Vec<(Vec<usize>, Vec<f64>)> {
        let q = self.question;
        let linear = |t: &&Tried| {
            let own = &q.candidates[t.candidate];
            !best.added.contains(&t.candidate)
                && !q.is_change(t.candidate)
                && own.starts.iter().all(|start| start.idle)
        };
        let few: Vec<&Tried> = tried.iter().filter(linear).collect();
        if few.len() < 2 || !best.fit.chi2.is_finite() {
            return Vec::new();
        }
        let mut p = best.fit.parameters.clone();
        let mut free = best.fit.free.clone();
        let mut places: Vec<Vec<usize>> = Vec::new();
        for t in &few {
            let own = &q.candidates[t.candidate];
            let open = own.starts.first().map_or(&[][..], |start| &start.open);
            for (_, one) in own.free.iter().enumerate().filter(|(k, _)| !open.contains(k)) {
                p[one.index] = t.model.fit.parameters[one.index];
            }
            places.push((free.len()..free.len() + open.len()).collect());
            free.extend(open.iter().map(|&position| own.free[position]));
        }
        let weights: Weights = self.weights(&best.fit.parameters, &best.fit.locals);
        let normal = self.with(&weights, &q.records, |search| {
            Normal::new(search.system, &q.records, &p, &free, &best.fit.locals)
        });
        let known = best.fit.free.len();
        // Shared parameters of the model, some of the new ones, local parameters.
        let step = |new: &[usize]| {
            let chosen: Vec<usize> =
                (0..known).chain(new.iter().copied()).chain(free.len()..normal.right.len()).collect();
            bounded_step(&normal, &chosen, &p, &free)
        };
        let alone: Vec<f64> =
            places.iter().map(|own| step(own).map_or(0.0, |step| gain(&normal, &step))).collect();
        let mut pairs: Vec<(f64, usize, usize, DVector<f64>)> = Vec::new();
        for i in 0..few.len() {
            for j in i + 1..few.len() {
                let both = [few[i].candidate, few[j].candidate];
                let with = |other: usize| [&best.added[..], &[other]].concat();
                let joins = (q.may_join)(both[0], &with(both[1])) && (q.may_join)(both[1], &with(both[0]));
                let Some(step) = step(&[&places[i][..], &places[j][..]].concat()).filter(|_| joins) else {
                    continue;
                };
                let gained = gain(&normal, &step);
                let left = |gain: f64| (normal.chi2 - gain).max(0.0);
                let needed = left(gained) <= MAX_RATIO_LEFT * left(alone[i].max(alone[j]));
                if gained > 0.0 && needed {
                    pairs.push((gained, i, j, step));
                }
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let set = |(_, i, j, step): (f64, usize, usize, DVector<f64>)| {
            let mut moved = p.clone();
            for (a, own) in free.iter().enumerate() {
                moved[own.index] = (moved[own.index] + step[a]).clamp(own.bounds.0, own.bounds.1);
            }
            ([&best.added[..], &[few[i].candidate, few[j].candidate]].concat(), moved)
        };
        pairs.into_iter().take(MAX_PAIRS).map(set).collect()
    }
}

/// Predicted fall of the sum of squares for a step, shape \[free + locals\].
fn gain(normal: &Normal, step: &DVector<f64>) -> f64 {
    2.0 * step.dot(&normal.right) - (&normal.matrix * step).dot(step)
}

/// The least-squares step, shape \[free + locals\], in the unknowns `chosen`, within the bounds of the shared
/// parameters `free`; none where the equations have no solution.
fn bounded_step(normal: &Normal, chosen: &[usize], p: &[f64], free: &[Free]) -> Option<DVector<f64>> {
    let mut step = DVector::zeros(normal.right.len());
    let mut open = chosen.to_vec();
    while !open.is_empty() {
        let right = &normal.right - &normal.matrix * &step;
        let part = DMatrix::from_fn(open.len(), open.len(), |a, b| {
            let value = normal.matrix[(open[a], open[b])];
            if a == b { value * (1.0 + 1e-9) + 1e-12 } else { value }
        });
        let solved = Cholesky::new(part)?.solve(&DVector::from_fn(open.len(), |a, _| right[open[a]]));
        let outside = (0..open.len()).find_map(|a| {
            let own = free.get(open[a])?;
            let value = p[own.index] + solved[a];
            let nearest = value.clamp(own.bounds.0, own.bounds.1);
            (nearest != value).then_some((a, nearest - p[own.index]))
        });
        match outside {
            Some((a, distance)) => {
                step[open[a]] = distance;
                open.remove(a);
            }
            None => {
                open.iter().zip(solved.iter()).for_each(|(&i, value)| step[i] = *value);
                break;
            }
        }
    }
    Some(step)
}
