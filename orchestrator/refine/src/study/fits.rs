//! Fits of a study in simulation: the declared model alone and with candidates, and their error on spans held out.

use std::ops::Range;
use std::sync::Arc;

use super::beside::Around;
use super::declaration::{Initial, InitialWord, Role};
use super::integration;
use super::law::{Law, Point};
use super::model::{Action, Study};
use super::physical::physical;
use super::remembered::Remembered;
use super::simulate::{Piece, View};
use crate::engine::System;
use crate::engine::fit::{Fit, Free, fit};
use crate::engine::near::fit_near;
use crate::engine::normal::Columns;
use crate::engine::{parallel, stop};

/// Records from which on whole records are held out; with fewer, spans of every record are, so that what is held out
/// lies within the conditions of the fit.
pub(super) const MIN_RECORDS_FOR_WHOLE: usize = 6;
/// Steps of fits that begin at the fit to all records.
const STEPS_FROM_FIT_TO_ALL: usize = 5;
/// Share of the error by which steps of second order may differ.
const MAX_ERROR_OF_SECOND_ORDER: f64 = 1e-3;
/// Spans of a record otherwise.
const SPANS_PER_RECORD: usize = 4;
/// Step of a parameter from which the search for its difference step begins.
const FIRST_STEP: f64 = 1e-3;
/// Difference steps by which the other entries of an effect of one's own are moved for one that matters beside them.
const STEPS_TO_WORK: f64 = 300.0;

/// The declared model with some candidates, fitted.
#[derive(Debug, Clone)]
pub struct Model {
    /// Candidates, by index, in the order they were added.
    pub added: Vec<usize>,
    /// Fit to all estimation records.
    pub fit: Fit,
    /// Rms of the whitened residuals of that fit.
    pub error: f64,
    /// Rms of the whitened residuals on what was held out; NaN where it was not asked for.
    pub held_out: f64,
    /// For each part that was held out: rms on it, and the parameters fitted without it.
    pub parts: Vec<(f64, Vec<f64>)>,
}

impl Model {
    /// A fit with its error, not yet tried on what is held out.
    pub fn new(added: Vec<usize>, fit: Fit, error: f64) -> Model {
        Model { added, fit, error, held_out: f64::NAN, parts: Vec::new() }
    }
}

/// Estimation records, what is held out of them, and the scale of residuals.
#[derive(Debug)]
pub struct Fits<'a> {
    /// Study.
    pub study: &'a Study,
    /// Divisors of residuals by output.
    pub scale: Vec<f64>,
    /// Estimation records.
    pub pieces: Vec<Piece>,
    /// Pairs of fitted and held-out pieces.
    pub folds: Vec<(Vec<Piece>, Vec<Piece>)>,
    /// Simulations with steps of second order.
    pub quick: bool,
    /// Corrections of the declared model that are fitted along.
    pub corrections: Vec<Free>,
    /// Simulations that were run before.
    pub remembered: Arc<Remembered>,
}

/// Pieces of all records of a role.
pub fn pieces(study: &Study, role: Role) -> Vec<Piece> {
    let of_role = study.records.iter().enumerate().filter(|(_, record)| record.role == role);
    of_role.map(|(record, own)| Piece { record, range: 0..own.n }).collect()
}

/// Begin of windows that start from a well known state: at the beginning of a file a derivative is far worse known than
/// elsewhere, and one window would hide the information of the others.
fn settled(study: &Study, piece: &Piece) -> usize {
    let record = &study.records[piece.record];
    let length = study.window(record.step).unwrap_or(0);
    let derived = study.sensors.signals[1].iter().flatten().any(|signal| signal.derivative_of.is_some());
    let begin = piece.range.start;
    if record.ends[0] && derived && record.n >= 4 * length { begin + length } else { begin }
}

/// A span that begins where outputs were measured, not in a gap: there its initial states have nothing to begin from.
fn begin(study: &Study, record: usize, span: Range<usize>) -> Range<usize> {
    let measured = &study.records[record].measured;
    let is_measured = |k: &usize| measured.iter().flatten().all(|own| own[*k]);
    let first = span.clone().find(is_measured).filter(|_| study.windows.is_none());
    first.unwrap_or(span.start)..span.end
}

fn folds(study: &Study, pieces: &[Piece]) -> Vec<(Vec<Piece>, Vec<Piece>)> {
    if pieces.len() >= MIN_RECORDS_FOR_WHOLE {
        let groups = pieces.len().min(SPANS_PER_RECORD + 1);
        let of = |group: usize, inside: bool| {
            let own = pieces.iter().enumerate().filter(|(i, _)| (i % groups == group) == inside);
            own.map(|(_, piece)| piece.clone()).collect::<Vec<_>>()
        };
        return (0..groups).map(|group| (of(group, false), of(group, true))).collect();
    }
    let spans: Vec<Vec<Piece>> = pieces
        .iter()
        .map(|piece| {
            let record = &study.records[piece.record];
            let unit = study.window(record.step).unwrap_or(1);
            let units = piece.range.len() / unit;
            let edge = |k: usize| piece.range.start + unit * (k * units / SPANS_PER_RECORD);
            (0..SPANS_PER_RECORD)
                .map(|k| Piece {
                    record: piece.record,
                    range: begin(study, piece.record, edge(k)..edge(k + 1)),
                })
                .collect()
        })
        .collect();
    let fold = |k: usize| {
        let inside = spans.iter().map(|own| own[k].clone()).filter(|piece| piece.range.len() > 8).collect();
        let outside = spans.iter().flat_map(|own| own.iter().enumerate().filter(|(i, _)| *i != k));
        let outside = outside.map(|(_, piece)| piece.clone()).filter(|piece| piece.range.len() > 8).collect();
        (outside, inside)
    };
    (0..SPANS_PER_RECORD).map(fold).collect()
}

/// Local parameters of a model on other pieces of the estimation records than those it was fitted to.
pub fn locals_of(fits: &Fits, pieces: &[Piece], model: &Model) -> Vec<Vec<f64>> {
    if pieces == fits.pieces {
        return model.fit.locals.clone();
    }
    fits.grow(&model.added, pieces, &model.fit.parameters, &[], &[1.0], 8).locals
}

fn rms(chi2: f64, count: usize) -> f64 {
    (chi2 / count.max(1) as f64).sqrt()
}

impl<'a> Fits<'a> {
    /// For residuals divided by `scale`.
    pub fn new(study: &'a Study, scale: Vec<f64>) -> Fits<'a> {
        let mut pieces = pieces(study, Role::Estimation);
        pieces.iter_mut().for_each(|piece| piece.range.start = settled(study, piece));
        let folds = folds(study, &pieces);
        let (corrections, remembered) = (Vec::new(), Arc::default());
        Fits { study, scale, pieces, folds, quick: false, corrections, remembered }
    }

    /// With steps of second order where they change the error of a model by next to nothing.
    pub fn quickened(mut self, model: &Model) -> Fits<'a> {
        let error = |quick: bool| {
            let view = View { quick, ..self.view(&model.added, &self.pieces) };
            let own = |r: usize| view.residuals(r, &model.fit.parameters, &model.fit.locals[r]);
            parallel::map(self.pieces.len(), own).concat()
        };
        let (slow, quick) = (error(false), error(true));
        let square = |a: &f64, b: &f64| (a - b).powi(2);
        let apart = slow.iter().zip(&quick).map(|(a, b)| square(a, b)).sum::<f64>();
        let whole = slow.iter().map(|a| a * a).sum::<f64>();
        self.quick = apart.is_finite() && apart < MAX_ERROR_OF_SECOND_ORDER.powi(2) * whole;
        self.quick = self.quick && integration::is_stable(&self, model);
        self
    }

    /// The engine's view of pieces with the blocks of `added`.
    pub fn view(&self, added: &[usize], pieces: &[Piece]) -> View<'a> {
        let (active, pieces) = (added.to_vec(), pieces.to_vec());
        let (scale, quick) = (self.scale.clone(), self.quick);
        let substeps = self.study.substeps;
        View {
            study: self.study,
            active,
            pieces,
            scale,
            quick,
            substeps,
            corrected: true,
            white: true,
            begins: Vec::new(),
            held: Vec::new(),
            remembered: Arc::clone(&self.remembered),
        }
    }

    /// Step \[s\] and what the attachments show with these candidates, `[records][taps][n]`.
    pub fn trace(&self, added: &[usize], fit: &Fit) -> Vec<(f64, Vec<Vec<Point>>)> {
        let view = self.view(added, &self.pieces);
        let one = |(r, piece): (usize, &Piece)| {
            let step = self.study.records[piece.record].step;
            (step, view.trace(r, &fit.parameters, &fit.locals[r]))
        };
        self.pieces.iter().enumerate().map(one).collect()
    }

    /// Root mean square of residuals with the sum of squares `chi2` over all estimation records.
    pub fn rms(&self, chi2: f64) -> f64 {
        rms(chi2, self.count(&self.pieces))
    }

    pub(super) fn count(&self, pieces: &[Piece]) -> usize {
        pieces.iter().map(|piece| piece.range.len()).sum::<usize>() * self.study.outputs.len()
    }

    /// Whether a simulation runs long enough from fitted states for a direct fit to get lost.
    fn long(&self) -> bool {
        let fitted =
            |piece: &Piece| self.study.records[piece.record].initial == Initial::Word(InitialWord::Fit);
        self.study.windows.is_none() && self.pieces.iter().any(fitted)
    }

    /// Initial states as measured.
    pub fn locals(view: &View) -> Vec<Vec<f64>> {
        (0..view.records()).map(|r| view.locals(r).into_iter().map(|(start, _)| start).collect()).collect()
    }

    /// Fits `free` on a growing part of each piece: each fit starts within reach of the next.
    pub fn grow(
        &self,
        added: &[usize],
        pieces: &[Piece],
        p: &[f64],
        free: &[Free],
        parts: &[f64],
        rounds: usize,
    ) -> Fit {
        let mut p = p.to_vec();
        let mut locals = Self::locals(&self.view(added, pieces));
        for (i, part) in parts.iter().enumerate() {
            if stop::asked() {
                break;
            }
            let short = |piece: &Piece| {
                let n = ((piece.range.len() as f64 * part) as usize).max(16).min(piece.range.len());
                Piece { record: piece.record, range: piece.range.start..piece.range.start + n }
            };
            let short: Vec<Piece> = pieces.iter().map(short).collect();
            let view = self.view(added, &short);
            let records: Vec<usize> = (0..short.len()).collect();
            let rounds = if i + 1 == parts.len() { rounds } else { rounds.min(8) };
            let found = fit(&view, &records, &p, free, &locals, rounds);
            if i + 1 == parts.len() {
                return found;
            }
            (p, locals) = (found.parameters, found.locals);
        }
        let view = self.view(added, pieces);
        fit(&view, &(0..pieces.len()).collect::<Vec<_>>(), &p, free, &locals, rounds)
    }

    /// Free parameters of the declared model and of candidates.
    pub fn free(&self, added: &[usize]) -> Vec<Free> {
        let own = added.iter().flat_map(|&c| self.study.candidates[c].entries.clone());
        self.study
            .declared_free()
            .into_iter()
            .chain(self.corrections.iter().copied())
            .chain(own.map(|index| self.study.entries[index].free))
            .collect()
    }

    /// The declared model, fitted from the values of the declaration.
    pub fn declared(&self) -> Model {
        let parts: &[f64] = if self.long() { &[0.03, 0.06, 0.12, 0.25, 0.5, 1.0] } else { &[1.0] };
        let found = self.grow(&[], &self.pieces, &self.study.start(), &self.free(&[]), parts, 20);
        let error = rms(found.chi2, self.count(&self.pieces));
        Model::new(Vec::new(), found, error)
    }

    /// Error with some candidates beside `base`, fitted for some rounds.
    pub fn fitted(&self, base: &Model, own: &[usize]) -> Option<f64> {
        let added: Vec<usize> = base.added.iter().chain(own).copied().collect();
        let records: Vec<usize> = (0..self.pieces.len()).collect();
        let view = self.view(&added, &self.pieces);
        let free = self.free(&added);
        let found =
            fit(&view, &records, &base.fit.parameters, &free, &base.fit.locals, STEPS_FROM_FIT_TO_ALL);
        Some(rms(found.chi2, self.count(&self.pieces))).filter(|error| error.is_finite())
    }

    /// Difference step of all heights of a free form.
    pub fn probe_step(&self, base: &Model, c: usize) -> Option<f64> {
        let entries = self.study.candidates[c].entries.clone();
        self.scaled_step(base, &[c], |p, step| p[entries.clone()].fill(step))
    }

    /// Fits everything from a start.
    pub fn fit_from(&self, added: Vec<usize>, p: &[f64], locals: &[Vec<f64>]) -> Option<Model> {
        let records: Vec<usize> = (0..self.pieces.len()).collect();
        let view = self.view(&added, &self.pieces);
        let found = fit(&view, &records, p, &self.free(&added), locals, 12);
        let error = rms(found.chi2, self.count(&self.pieces));
        error.is_finite().then_some(Model::new(added, found, error))
    }

    /// A model as it is, with the covariance that a search which had to end did not wait for.
    pub fn with_covariance(&self, model: &Model) -> Model {
        let records: Vec<usize> = (0..self.pieces.len()).collect();
        let view = self.view(&model.added, &self.pieces);
        let own = &model.fit;
        stop::finish(|| {
            if stop::asked() {
                return model.clone();
            }
            let fit = fit(&view, &records, &own.parameters, &own.free, &own.locals, 0);
            if stop::asked() { model.clone() } else { Model { fit, ..model.clone() } }
        })
    }

    /// The fit of a model with initial states as the study declares them.
    pub fn as_declared(&self, model: &Model) -> Fit {
        let pieces = pieces(self.study, Role::Estimation);
        if pieces == self.pieces && pieces.iter().all(|p| self.study.records[p.record].smoothed.is_empty()) {
            return model.fit.clone();
        }
        let records: Vec<usize> = (0..pieces.len()).collect();
        let view = View { corrected: false, ..self.view(&model.added, &pieces) };
        let (p, free, locals) = (&model.fit.parameters, self.free(&model.added), &model.fit.locals);
        let own = Model { fit: fit(&view, &records, p, &free, locals, 6), ..model.clone() };
        // An effect may lose its shape where smoothing spoils the states that simulations start from.
        if physical(self.study, &own) || !physical(self.study, model) {
            return own.fit;
        }
        fit(&view, &records, p, &free, locals, 0)
    }

    /// The same model fitted until nothing moves: long free motions have narrow valleys.
    pub fn polish(&self, model: &Model) -> Option<Model> {
        let mut found = model.clone();
        for _ in 0..4 {
            let again = self.fit_from(found.added.clone(), &found.fit.parameters, &found.fit.locals)?;
            let settled = again.error > (1.0 - 1e-4) * found.error;
            if again.error <= found.error {
                found = Model { held_out: found.held_out, parts: found.parts, ..again };
            }
            if settled {
                break;
            }
        }
        Some(found)
    }

    /// Error on what is held out: everything fitted without it, then only its initial states on it.
    pub fn hold_out(&self, model: &mut Model) {
        if !model.held_out.is_nan() {
            return;
        }
        let free = self.free(&model.added);
        let parts: &[f64] = if self.long() { &[0.3, 1.0] } else { &[1.0] };
        // Folds of whole records, and spans that are simulated from the beginning of a record, lie near the fit to all.
        let from_start = |piece: &Piece| self.study.from_start(&self.study.records[piece.record]);
        let near = self.pieces.len() >= MIN_RECORDS_FOR_WHOLE || self.pieces.iter().all(from_start);
        let around = near.then(|| self.around_some(model, 1));
        model.parts = parallel::map(self.folds.len(), |f| {
            let (outside, inside) = &self.folds[f];
            if let Some(found) = around.as_ref().and_then(|around| self.fold_near(model, around, f)) {
                return found;
            }
            let found =
                self.grow(&model.added, outside, &model.fit.parameters, &free, parts, STEPS_FROM_FIT_TO_ALL);
            let test = self.grow(&model.added, inside, &found.parameters, &[], parts, 8);
            (rms(test.chi2, self.count(inside)), found.parameters)
        });
        // The geometric mean: every fold counts by its own relative change.
        let logarithms: f64 = model.parts.iter().map(|(error, _)| error.max(1e-12).ln()).sum();
        model.held_out = (logarithms / model.parts.len().max(1) as f64).exp();
    }

    /// Error on a fold and the parameters without it, from the derivatives around the fit to all; none where these do
    /// not hold.
    fn fold_near(&self, model: &Model, around: &Around, fold: usize) -> Option<(f64, Vec<f64>)> {
        let (outside, inside) = &self.folds[fold];
        let ng = model.fit.free.len();
        let part = |pieces: &[Piece], first: usize, p: &[f64], free: &[Free]| {
            let holds = |own: &Piece| {
                let (span, record) = (&own.range, own.record);
                let within = |all: &Piece| {
                    all.record == record && all.range.start <= span.start && span.end <= all.range.end
                };
                self.pieces.iter().position(within)
            };
            let places: Vec<usize> = pieces.iter().map(holds).collect::<Option<_>>()?;
            let columns = places.iter().zip(pieces).map(|(&r, own)| {
                let whole = &self.pieces[r].range;
                let of_span = |column: &Vec<f64>| -> Vec<f64> {
                    let outputs = column.chunks_exact(whole.len());
                    outputs
                        .flat_map(|all| &all[own.range.start - whole.start..own.range.end - whole.start])
                        .copied()
                        .collect()
                };
                Columns {
                    residuals: Vec::new(),
                    columns: around.columns[r].columns[first..].iter().map(of_span).collect(),
                }
            });
            let locals: Vec<Vec<f64>> = places.iter().map(|&r| model.fit.locals[r].clone()).collect();
            let view = self.view(&model.added, pieces);
            let records: Vec<usize> = (0..pieces.len()).collect();
            let found = fit_near(&view, &records, p, free, &locals, columns.collect());
            found.settled.then_some(found.fit)
        };
        let found = part(outside, 0, &model.fit.parameters, &model.fit.free)?;
        let test = part(inside, ng, &found.parameters, &[])?;
        Some((rms(test.chi2, self.count(inside)), found.parameters))
    }

    /// Difference steps of all entries of a candidate that move the residuals by a thousandth; none where nothing moves
    /// them. An entry of an effect of one's own may matter only where others of it are not zero.
    pub fn steps(&self, base: &Model, c: usize) -> Vec<Option<f64>> {
        let own = &self.study.candidates[c];
        let found: Vec<Option<f64>> =
            own.entries.clone().map(|index| self.step(base, c, index, &[])).collect();
        let is_own = matches!(own.action, Action::Block { law: Law::Own(_), .. });
        if !is_own || found.iter().all(Option::is_some) {
            return found;
        }
        let at_work = own.entries.clone().zip(&found);
        let at_work: Vec<(usize, f64)> =
            at_work.filter_map(|(index, step)| Some((index, STEPS_TO_WORK * (*step)?))).collect();
        let again =
            |(index, step): (usize, &Option<f64>)| step.or_else(|| self.step(base, c, index, &at_work));
        own.entries.clone().zip(&found).map(again).collect()
    }

    /// Difference step of an entry of a candidate that moves the residuals by a thousandth; none if nothing moves them.
    /// `moved`: changes of other entries from their starts.
    pub fn step(&self, base: &Model, c: usize, index: usize, moved: &[(usize, f64)]) -> Option<f64> {
        let own = &self.study.candidates[c];
        let mut added = base.added.clone();
        added.extend(own.needs.filter(|needs| !added.contains(needs)));
        added.push(c);
        let mut p = base.fit.parameters.clone();
        // The friction beside it, too: a sign that changes over no velocity has no value.
        for &other in &added[base.added.len()..] {
            let own = &self.study.candidates[other];
            let start = &own.starts[own.starts.len() / 2];
            own.entries.clone().zip(start).for_each(|(index, value)| p[index] = *value);
        }
        moved.iter().for_each(|(index, change)| p[*index] += change);
        if p[index] != 0.0 {
            return Some(1e-3 * p[index].abs());
        }
        self.scaled_step(base, &added[base.added.len()..], |q, step| {
            q.copy_from_slice(&p);
            q[index] = step;
        })
    }

    /// Step of a change that moves the residuals by a thousandth; none if nothing moves them.
    fn scaled_step(&self, base: &Model, own: &[usize], change: impl Fn(&mut [f64], f64)) -> Option<f64> {
        let added: Vec<usize> = base.added.iter().chain(own).copied().collect();
        // Nothing is fitted any more, and no candidate is ruled out by a step that nobody looked for.
        if stop::asked() {
            return Some(FIRST_STEP);
        }
        // The first record shows most candidates; what it does not touch, another may.
        let first = self.step_over(&added, base, &self.pieces[..1], &change);
        first.or_else(|| self.step_over(&added, base, &self.pieces, &change))
    }

    /// The same over some pieces.
    fn step_over(
        &self,
        added: &[usize],
        base: &Model,
        pieces: &[Piece],
        change: &impl Fn(&mut [f64], f64),
    ) -> Option<f64> {
        let view = self.view(added, pieces);
        let residuals = |p: &[f64]| -> Vec<f64> {
            (0..pieces.len()).flat_map(|r| view.residuals(r, p, &base.fit.locals[r])).collect()
        };
        let mut p = base.fit.parameters.clone();
        change(&mut p, 0.0);
        let before = residuals(&p);
        let mut step = FIRST_STEP;
        for _ in 0..12 {
            change(&mut p, step);
            let moved = residuals(&p);
            let square = moved.iter().zip(&before).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            let size = rms(square, before.len()) / 1e-3;
            if (0.2..5.0).contains(&size) {
                return Some(step);
            }
            step *= if size.is_finite() { (1.0 / size).clamp(1e-5, 1e5) } else { 1e-3 };
            if !(1e-30..1e30).contains(&step) {
                return None;
            }
        }
        None
    }
}
