//! Effects of the list in place of a law: a formula may be a sum of effects that the vocabulary holds at the port, or
//! imitate one. Sets of effects there that reproduce the law over the motion of the records are fitted in simulation;
//! one that does as well as the law is the answer.

use std::collections::BTreeSet;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::formula::PRICE_PER_COMPLEXITY;
use super::study::{extended, motion};
use crate::answer::Answer;
use crate::engine::{System, stop};
use crate::order::ascending;
use crate::study::changed;
use crate::study::colored;
use crate::study::declaration::Role;
use crate::study::errors::errors;
use crate::study::exact;
use crate::study::explain::Judge;
use crate::study::fits::{Fits, Model, pieces};
use crate::study::law::{Law, Point};
use crate::study::model::{Action, Study};
use crate::study::physical::physical;
use crate::study::search::{self, Say, Selection};
use crate::vocabulary::Own;

/// Most effects in place of a law.
const MAX_EFFECTS: usize = 4;
/// Samples over which effects reproduce a law.
const SAMPLES: usize = 2000;
/// Sets that are carried on from one number of effects to the next.
const BEAM: usize = 60;
/// Sets of each number of effects that are fitted in simulation.
const FITTED: usize = 3;
/// Difference of a set from the law, in rms over that of the law, from which on it is not fitted.
const MAX_DIFFERENCE: f64 = 0.2;
/// Ratio of that difference to the least among sets of as many effects, up to which they are fitted.
const MAX_OVER_LEAST: f64 = 3.0;
/// Ratio of the error with effects to that with the law, up to which they do as well.
const MAX_ERROR_OVER_LAW: f64 = 1.005;
/// The same on validation records.
const MAX_VALIDATION_ERROR_OVER_LAW: f64 = 1.05;
/// Parameters of a free form that is the law itself.
const PARAMETERS_OF_CURVE: usize = 12;
/// Share of a value by which it may lie outside of its bounds before the fit in simulation.
const MAX_OUTSIDE_OF_BOUNDS: f64 = 0.1;
/// Factor of a law that changes its sign with the velocity, up to the name of its parameter.
const SIGN_CHANGE: &str = "tanh(v/";
/// Halvings of the steps in which shapes are improved.
const HALVINGS: usize = 6;

/// A candidate with values of its entries; zeros stand for those that a linear fit finds.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    candidate: usize,
    p: Vec<f64>,
}

/// The velocity over which friction of a law changes its sign, where nobody declares one at its port: port and value.
pub fn sign_change(study: &Study, with_law: &Model) -> Option<(usize, f64)> {
    let &[c] = &with_law.added[..] else { return None };
    let Action::Block { law: Law::Own(index), tap } = study.candidates[c].action else { return None };
    if study.taps[tap].attachment.vt.is_some() {
        return None;
    }
    let own = &study.own[index];
    let (_, rest) = own.formula.split_once(SIGN_CHANGE)?;
    let name = rest.split_once(')')?.0;
    let k = own.parameters.iter().position(|parameter| parameter.name == name)?;
    let value = with_law.fit.parameters[study.candidates[c].entries.start + k].abs();
    (value > 0.0).then_some((tap, value))
}

/// A law and the motion over which effects are to reproduce it.
struct Target<'a> {
    study: &'a Study,
    tap: usize,
    points: Vec<Point>,
    /// Change by the law: it is taken off the value that passes, `[n]`.
    values: Vec<f64>,
    /// Friction needs no Coulomb friction beside it that tells where it changes its sign.
    alone: bool,
    /// Effects beside which the law stands: candidates.
    beside: &'a [usize],
}

/// Effects of the list at the port of a law that do as well as it, with the effects that it stands beside and the model
/// of the answer in `found`: a selection in place of the law. `declared`: the model without it.
pub fn in_place_of(
    study: &Study,
    scale: &[f64],
    judge: &Judge,
    (declared, with_law): (&Model, &Model),
    found: &Answer,
    say: Say,
) -> Option<Selection> {
    let law = found.law.as_ref()?;
    let (&c, beside) = with_law.added.split_last()?;
    let Action::Block { law: Law::Own(index), tap } = study.candidates[c].action else { return None };
    if stop::asked() {
        return None;
    }
    say("effects of the list in place of the law");
    let plain = Fits::new(study, scale.to_vec());
    let corrections = changed::corrected(study, &with_law.fit);
    // As the law was weighed: by the noise where it leaves no more.
    let units = colored::left(&plain, judge, with_law).unwrap_or_else(|| scale.to_vec());
    let fits = Fits { corrections: corrections.clone(), ..Fits::new(study, units) };
    let reference = fits.fit_from(with_law.added.clone(), &with_law.fit.parameters, &with_law.fit.locals)?;
    let values = &with_law.fit.parameters[study.candidates[c].entries.clone()];
    let target = Target { beside, ..Target::new(&fits, &reference, tap, &study.own[index], values)? };
    let known = if law.named { values.len() } else { PARAMETERS_OF_CURVE };
    let best = target.fitted(&fits, &reference, c, known)?;
    // Records that took no part have the last word.
    let validation = pieces(study, Role::Validation);
    let error = |model: &Model| {
        let found = errors(&plain, &model.added, &validation, &model.fit.parameters, None);
        let outputs = study.outputs.iter().zip(scale);
        let sum: f64 = outputs.map(|(o, s)| (found.rms.get(&o.name).unwrap_or(&0.0) / s).powi(2)).sum();
        sum.sqrt()
    };
    if error(&best) > MAX_VALIDATION_ERROR_OVER_LAW * error(&reference) {
        return None;
    }
    let declared = extended(declared, study);
    let selection = search::proposed(&fits, judge, &declared, best, say);
    let scaled = Fits { corrections, ..Fits::new(study, scale.to_vec()) };
    let in_scale = |model: &Model| {
        let view = scaled.view(&model.added, &scaled.pieces);
        let residuals = |r: usize| view.residuals(r, &model.fit.parameters, &model.fit.locals[r]);
        let chi2: f64 = (0..scaled.pieces.len()).flat_map(residuals).map(|own| own * own).sum();
        Model { error: scaled.rms(chi2), ..model.clone() }
    };
    let equals = selection.equals.iter().map(|(lacking, model)| (*lacking, in_scale(model))).collect();
    let own = &selection.best;
    let white = judge.explained(&plain, own);
    let exact = white || colored::left(&plain, judge, own).is_some();
    let best = if white {
        exact::refitted(&scaled, own)
    } else if exact {
        in_scale(&fits.with_covariance(own))
    } else {
        scaled.fit_from(own.added.clone(), &own.fit.parameters, &own.fit.locals)?
    };
    let best = Model { held_out: own.held_out, parts: own.parts.clone(), ..best };
    physical(study, &best).then_some(Selection { best, equals, exact, ..selection })
}

impl<'a> Target<'a> {
    fn new(fits: &Fits<'a>, model: &Model, tap: usize, own: &Own, p: &[f64]) -> Option<Target<'a>> {
        let study = fits.study;
        let all = motion(fits, model).swap_remove(tap);
        let sign = study.taps[tap].sign;
        let step = study.records.first().map_or(1e-3, |record| record.step);
        let mut z = vec![0.0; own.states.len()];
        let every = all.len().div_ceil(SAMPLES).max(1);
        let (mut points, mut values) = (Vec::new(), Vec::new());
        for (k, point) in all.iter().enumerate() {
            if point.time < step {
                z.fill(0.0);
            }
            let found = own.value(point.variables(), &z, p);
            own.advance(point.variables(), &mut z, p, step);
            if k % every == 0 {
                points.push(*point);
                values.push(if own.port.replaces() { point.value - found } else { sign * found });
            }
        }
        let known = values.iter().all(|value| value.is_finite()) && values.iter().any(|value| *value != 0.0);
        let alone = own.formula.contains(SIGN_CHANGE);
        known.then_some(Target { study, tap, points, values, alone, beside: &[] })
    }

    /// The fewest effects whose fit in simulation does as well as the law; `c`: its candidate, `known`: its parameters.
    fn fitted(&self, fits: &Fits, reference: &Model, c: usize, known: usize) -> Option<Model> {
        let study = self.study;
        let mut start = reference.fit.parameters.clone();
        study.candidates[c].entries.clone().for_each(|index| start[index] = 0.0);
        let price = |parameters: usize| PRICE_PER_COMPLEXITY * (parameters as f64 - known as f64);
        for sets in self.sets() {
            let mut best: Option<Model> = None;
            for set in sets {
                if stop::asked() {
                    return None;
                }
                let mut p = start.clone();
                for part in &set {
                    let entries = study.candidates[part.candidate].entries.clone();
                    entries.zip(&part.p).for_each(|(index, value)| p[index] = *value);
                }
                let own = || set.iter().map(|part| part.candidate);
                let parameters: usize = own().map(|c| study.candidates[c].entries.len()).sum();
                let added: Vec<usize> = self.beside.iter().copied().chain(own()).collect();
                let Some(model) = fits.fit_from(added, &p, &reference.fit.locals) else { continue };
                let ratio = model.error / reference.error;
                let as_good = ratio <= MAX_ERROR_OVER_LAW || ratio.ln() + price(parameters) <= 0.0;
                let better = best.as_ref().is_none_or(|own| model.error < own.error);
                if as_good && better && physical(study, &model) {
                    best = Some(model);
                }
            }
            if best.is_some() {
                return best;
            }
        }
        None
    }

    /// Sets of effects that reproduce the law, by their number, nearest first.
    fn sets(&self) -> Vec<Vec<Vec<Part>>> {
        let parts = self.parts();
        let mut beam: Vec<Vec<Part>> = vec![Vec::new()];
        let mut found = Vec::new();
        for _ in 0..MAX_EFFECTS {
            let mut next: Vec<(f64, Vec<Part>)> = Vec::new();
            let mut known = BTreeSet::new();
            for base in &beam {
                for part in &parts {
                    if base.iter().any(|own| own.candidate == part.candidate) {
                        continue;
                    }
                    let mut set = [&base[..], std::slice::from_ref(part)].concat();
                    set.sort_by_key(|own| own.candidate);
                    let key = |part: &Part| (part.candidate, part.p.iter().map(|p| p.to_bits()).collect());
                    if known.insert(set.iter().map(key).collect::<Vec<(usize, Vec<u64>)>>())
                        && let Some((difference, set)) = self.solved(&set)
                    {
                        next.push((difference, set));
                    }
                }
            }
            ascending(&mut next, |own| own.0);
            let mut kept: Vec<(f64, Vec<Part>)> = Vec::new();
            let same = |a: &[Part], b: &[Part]| a.iter().zip(b).all(|(a, b)| a.candidate == b.candidate);
            for (_, set) in next.iter().filter(|(_, set)| self.complete(set)) {
                if kept.len() < 2 * FITTED && !kept.iter().any(|(_, own)| same(own, set)) {
                    kept.push(self.improved(set.clone()));
                }
            }
            ascending(&mut kept, |own| own.0);
            let least = kept.first().map_or(0.0, |own| own.0);
            kept.retain(|own| own.0 <= MAX_DIFFERENCE && own.0 <= MAX_OVER_LEAST * least);
            found.push(kept.into_iter().take(FITTED).map(|own| own.1).collect());
            beam = next.into_iter().take(BEAM).map(|own| self.opened(own.1)).collect();
        }
        found
    }

    /// Whether a set holds what its effects need.
    fn complete(&self, set: &[Part]) -> bool {
        let needs = |part: &Part| self.study.candidates[part.candidate].needs;
        let is_there = |c: usize| self.beside.contains(&c) || set.iter().any(|own| own.candidate == c);
        self.alone || set.iter().filter_map(needs).all(is_there)
    }

    /// Effects at the port, with every shape to start from.
    fn parts(&self) -> Vec<Part> {
        let own = self.study.candidates.iter().enumerate();
        let here = own.filter(|(c, own)| {
            let Action::Block { law, tap } = own.action else { return false };
            let with_memory = matches!(law, Law::Memory(_) | Law::Presliding);
            let made = matches!(law, Law::Own(_) | Law::Surface(_) | Law::Shape(_));
            tap == self.tap && !own.probe && !with_memory && !made && !self.beside.contains(c)
        });
        let starts = here.flat_map(|(candidate, own)| own.starts.iter().map(move |p| (candidate, p)));
        let linear = starts.filter(|(_, p)| p.contains(&0.0));
        linear.map(|(candidate, p)| Part { candidate, p: p.clone() }).collect()
    }

    /// Zeros in place of the values that a linear fit finds.
    fn opened(&self, set: Vec<Part>) -> Vec<Part> {
        let open = |part: Part| {
            let start = &self.study.candidates[part.candidate].starts[0];
            let p = part.p.iter().zip(start).map(|(value, start)| if *start == 0.0 { 0.0 } else { *value });
            Part { p: p.collect(), ..part }
        };
        set.into_iter().map(open).collect()
    }

    /// Change by an effect: it is taken off the value that passes, `[n]`;
    /// `vt`: velocity over which friction changes its sign.
    fn column(&self, law: Law, p: &[f64], vt: f64) -> Vec<f64> {
        let tap = &self.study.taps[self.tap];
        let sign = if law == Law::Bias { 1.0 } else { tap.sign };
        let one = |at: &Point| {
            if law.changes_command() {
                return at.value - law.command(p, at, at.value);
            }
            let from_sign_change = at.velocity - tap.v0;
            let at = if law == Law::Stribeck { Point { velocity: from_sign_change, ..*at } } else { *at };
            sign * law.force(p, &at, (from_sign_change / vt).tanh(), 0.0, 0.0)
        };
        self.points.iter().map(one).collect()
    }

    /// The linear values of a set that come nearest to the law, and the difference in rms over that of the law; none
    /// where they lie outside of their bounds.
    fn solved(&self, set: &[Part]) -> Option<(f64, Vec<Part>)> {
        let study = self.study;
        let law = |part: &Part| match study.candidates[part.candidate].action {
            Action::Block { law, .. } => law,
            _ => Law::Offset,
        };
        let fitted = set.iter().find(|part| law(part) == Law::Coulomb && part.p.len() == 2);
        let vt = fitted.map_or(study.taps[self.tap].vt, |part| part.p[1]);
        let mut places = Vec::new();
        let mut columns = Vec::new();
        for (i, part) in set.iter().enumerate() {
            let open = (0..part.p.len()).filter(|&k| part.p[k] == 0.0);
            for k in open {
                let mut p = part.p.clone();
                p[k] = 1.0;
                columns.push(DVector::from_vec(self.column(law(part), &p, vt)));
                places.push((i, k));
            }
        }
        let target = DVector::from_column_slice(&self.values);
        let sizes: Vec<f64> = columns.iter().map(DVector::norm).collect();
        if sizes.iter().any(|size| !(size.is_finite() && *size > 0.0)) {
            return None;
        }
        let n = columns.len();
        let matrix = DMatrix::from_fn(n, n, |a, b| {
            columns[a].dot(&columns[b]) / (sizes[a] * sizes[b]) + if a == b { 1e-9 } else { 0.0 }
        });
        let right = DVector::from_fn(n, |a, _| columns[a].dot(&target) / sizes[a]);
        let solved = Cholesky::new(matrix)?.solve(&right);
        let mut found = set.to_vec();
        let mut left = target.clone();
        for ((a, column), (i, k)) in columns.iter().enumerate().zip(places) {
            let value = solved[a] / sizes[a];
            let index = study.candidates[set[i].candidate].entries.start + k;
            let (low, high) = study.entries[index].free.bounds;
            let held = value.clamp(low, high);
            if (value - held).abs() > MAX_OUTSIDE_OF_BOUNDS * value.abs() {
                return None;
            }
            found[i].p[k] = held;
            left.axpy(-held, column, 1.0);
        }
        Some((left.norm() / target.norm(), found))
    }

    /// A set with shapes moved toward the law.
    fn improved(&self, set: Vec<Part>) -> (f64, Vec<Part>) {
        let mut open = self.opened(set.clone());
        let mut best = self.solved(&open).unwrap_or((f64::INFINITY, set));
        let mut part = 0.4;
        for _ in 0..HALVINGS {
            for i in 0..open.len() {
                for k in (0..open[i].p.len()).filter(|&k| open[i].p[k] != 0.0).collect::<Vec<_>>() {
                    for factor in [1.0 + part, 1.0 / (1.0 + part)] {
                        let mut moved = open.clone();
                        moved[i].p[k] *= factor;
                        if let Some(found) = self.solved(&moved).filter(|own| own.0 < best.0) {
                            (best, open) = (found, moved);
                        }
                    }
                }
            }
            part *= 0.5;
        }
        best
    }
}
