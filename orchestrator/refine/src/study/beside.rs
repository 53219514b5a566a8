//! Candidates added to a fitted model: their predicted gain by the linear step, and fits with the derivatives around
//! it.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::fits::{Fits, MIN_RECORDS_FOR_WHOLE, Model};
use super::law::Law;
use super::model::Action;
use super::simulate::{Piece, View};
use crate::engine::fit::{Fit, Free};
use crate::engine::near::{Near, fit_near};
use crate::engine::normal::{Columns, Joint, columns, dot};
use crate::engine::{parallel, stop};

/// Records on which candidates are compared where there are many.
pub(super) const SCREENED_RECORDS: usize = 4;
/// Starts of a candidate from which on they are many.
const MIN_STARTS_FOR_SCREENING: usize = 8;
/// Short windows in a window.
const SHORT_WINDOWS_PER_WINDOW: f64 = 8.0;

/// Residuals of some records around a model with their derivatives.
pub struct Around {
    /// Spans of records.
    pub(super) pieces: Vec<Piece>,
    /// Local parameters there, `[pieces][locals]`.
    pub(super) locals: Vec<Vec<f64>>,
    /// `[pieces]`, each \[parameters of the model + locals\]\[samples of all outputs\].
    pub(super) columns: Vec<Columns>,
}

fn added_to(base: &Model, c: usize) -> Vec<usize> {
    base.added.iter().copied().chain([c]).collect()
}

impl Fits<'_> {
    /// Residuals and derivatives of some estimation records around a model, for what is compared beside it.
    ///
    /// None where the simulation starts anew in every window: the derivatives cost as much as the fits there.
    pub fn around(&self, base: &Model) -> Option<Around> {
        if self.study.windows.is_some() {
            return None;
        }
        let every = if self.pieces.len() >= MIN_RECORDS_FOR_WHOLE {
            self.pieces.len().div_ceil(SCREENED_RECORDS)
        } else {
            1
        };
        Some(self.around_some(base, every))
    }

    pub(super) fn around_some(&self, base: &Model, every: usize) -> Around {
        let pieces: Vec<Piece> = self.pieces.iter().step_by(every).cloned().collect();
        let locals: Vec<Vec<f64>> = base.fit.locals.iter().step_by(every).cloned().collect();
        let columns = self.columns_of(base, &pieces, &locals);
        Around { pieces, locals, columns }
    }

    /// Candidate `c` on top of `base`: best start by the linear step, then the fit of everything.
    pub fn add(&self, base: &Model, c: usize) -> Option<Model> {
        let p = self.promise(base, c)?;
        self.fit_from(added_to(base, c), &p, &base.fit.locals)
    }

    /// Candidate `c` on top of `base`, from the start `p`, on some records with the derivatives around `base`, only
    /// those of the candidate anew: its gain beyond the linear step. The error is that of `base` times the ratio on
    /// these records, and may be too large where the candidate moves the motion far away.
    ///
    /// Without derivatives around `base` the fit of everything.
    pub fn add_near(&self, base: &Model, around: Option<&Around>, (c, p): (usize, &[f64])) -> Option<Model> {
        let added = added_to(base, c);
        let free = self.free(&added);
        let ng = base.fit.free.len();
        // Presliding changes what every other parameter does.
        if self.changes_others(c) {
            return self.add(base, c);
        }
        let Some(around) = around.filter(|_| free.get(..ng) == Some(&base.fit.free[..])) else {
            return self.fit_from(added, p, &base.fit.locals);
        };
        let view = self.view(&added, &around.pieces);
        let records: Vec<usize> = (0..around.pieces.len()).collect();
        let locals: Vec<&[f64]> = around.locals.iter().map(Vec::as_slice).collect();
        let mut found = columns(&view, &records, p, &free[ng..], &locals, false, None);
        for (own, around) in found.iter_mut().zip(&around.columns) {
            let (shared, local) = around.columns.split_at(ng);
            own.columns.splice(0..0, shared.iter().cloned());
            own.columns.extend(local.iter().cloned());
        }
        let Near { fit, .. } = fit_near(&view, &records, p, &free, &around.locals, found);
        let before: f64 = around.columns.iter().map(|own| dot(&own.residuals, &own.residuals)).sum();
        let error = base.error * (fit.chi2 / before).sqrt();
        let fit = Fit { locals: base.fit.locals.clone(), ..fit };
        error.is_finite().then_some(Model::new(added, fit, error))
    }

    /// Predicted sum of squares of the linear step from the best start of each candidate, as a share of that of `base`,
    /// and the parameters after it; none where no step can be made.
    pub fn promises(
        &self,
        base: &Model,
        around: Option<&Around>,
        list: &[usize],
    ) -> Vec<Option<(f64, Vec<f64>)>> {
        let starts = |c: usize| self.study.candidates[c].starts.len();
        let many = |c: usize| self.study.windows.is_some() && starts(c) > MIN_STARTS_FOR_SCREENING;
        let screened = |starts: usize| {
            let (pieces, locals) = self.screened(&base.fit, starts);
            let columns = self.columns_of(base, &pieces, &locals);
            Around { pieces, locals, columns }
        };
        let short = around.is_none().then(|| screened(1));
        let Some(few) = around.or(short.as_ref()) else { return Vec::new() };
        let rare = list.iter().any(|&c| many(c)).then(|| screened(MIN_STARTS_FOR_SCREENING + 1));
        parallel::map(list.len(), |i| {
            if stop::asked() {
                return None;
            }
            let own = if many(list[i]) { rare.as_ref().unwrap_or(few) } else { few };
            let before: f64 = own.columns.iter().map(|own| dot(&own.residuals, &own.residuals)).sum();
            let (chi2, mut p) = self.best_start(base, list[i], own)?;
            if self.starts_at_zero(list[i]) {
                p.clone_from(&base.fit.parameters);
            }
            Some((chi2 / before, p))
        })
    }

    /// Residuals on some pieces with derivatives by the free parameters of `base`.
    fn columns_of(&self, base: &Model, pieces: &[Piece], locals: &[Vec<f64>]) -> Vec<Columns> {
        let view = self.view(&base.added, pieces);
        let records: Vec<usize> = (0..pieces.len()).collect();
        let locals: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
        columns(&view, &records, &base.fit.parameters, &base.fit.free, &locals, true, None)
    }

    /// Residuals and derivatives of all estimation records around a model, for [`Fits::promised`].
    pub fn around_all(&self, base: &Model) -> Around {
        self.around_some(base, 1)
    }

    /// Predicted error of the linear step over the entries of some candidates added to `base`.
    pub fn promised(&self, base: &Model, around: &Around, own: &[usize]) -> Option<f64> {
        let added: Vec<usize> = base.added.iter().chain(own).copied().collect();
        let view = self.view(&added, &around.pieces);
        let entries = own.iter().flat_map(|&c| self.study.candidates[c].entries.clone());
        let open: Vec<Free> = entries.map(|index| self.study.entries[index].free).collect();
        let start = base.fit.parameters.clone();
        let (chi2, _) = linear_step(&view, &around.columns, (&base.fit, &around.locals), &open, start)?;
        Some(self.rms(chi2))
    }

    /// Start of a candidate added to `base` with the smallest predicted sum of squares, after the linear step.
    fn promise(&self, base: &Model, c: usize) -> Option<Vec<f64>> {
        let own = &self.study.candidates[c];
        if self.starts_at_zero(c) {
            return Some(base.fit.parameters.clone());
        }
        let (pieces, locals) = if self.changes_others(c) {
            (self.pieces.clone(), base.fit.locals.clone())
        } else {
            self.screened(&base.fit, own.starts.len())
        };
        let columns = self.columns_of(base, &pieces, &locals);
        Some(self.best_start(base, c, &Around { pieces, locals, columns })?.1)
    }

    /// Whether the linear step finds every parameter of a candidate from zero.
    fn starts_at_zero(&self, c: usize) -> bool {
        matches!(&self.study.candidates[c].starts[..], [only] if only.iter().all(|value| *value == 0.0))
    }

    /// Whether a candidate starts from rest in every window, and changes what a change of the Coulomb level does.
    fn changes_others(&self, c: usize) -> bool {
        matches!(self.study.candidates[c].action, Action::Block { law: Law::Presliding, .. })
    }

    /// The start of a candidate with the smallest sum of squares predicted by the linear step on some pieces, and that
    /// sum.
    fn best_start(&self, base: &Model, c: usize, around: &Around) -> Option<(f64, Vec<f64>)> {
        let Around { pieces, locals: own_locals, columns: shared } = around;
        let own = &self.study.candidates[c];
        let changed = self.changes_others(c);
        let added = added_to(base, c);
        let records: Vec<usize> = (0..pieces.len()).collect();
        let locals: Vec<&[f64]> = own_locals.iter().map(Vec::as_slice).collect();
        let view = self.view(&added, pieces);
        let promises: Vec<Option<(f64, Vec<f64>)>> = parallel::map(own.starts.len(), |s| {
            if stop::asked() {
                return None;
            }
            let mut p = base.fit.parameters.clone();
            let start = &own.starts[s];
            own.entries.clone().zip(start).for_each(|(index, value)| p[index] = *value);
            let open: Vec<Free> = own
                .entries
                .clone()
                .zip(start)
                .filter(|(_, value)| **value == 0.0)
                .map(|(index, _)| self.study.entries[index].free)
                .collect();
            let fresh: Option<Vec<Columns>> =
                changed.then(|| columns(&view, &records, &p, &base.fit.free, &locals, true, None));
            linear_step(&view, fresh.as_deref().unwrap_or(shared), (&base.fit, own_locals), &open, p)
        });
        promises.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Pieces on which starts are compared: all estimation records; where the study has windows, short ones, in which
    /// the motion stays so near the measured one that the linear step holds. Every third of them where there are many
    /// starts.
    fn screened(&self, fit: &Fit, starts: usize) -> (Vec<Piece>, Vec<Vec<f64>>) {
        let Some(window) = self.study.windows else {
            return (self.pieces.clone(), fit.locals.clone());
        };
        let every = if starts > MIN_STARTS_FOR_SCREENING { 3 } else { 1 };
        let mut found = Vec::new();
        for piece in &self.pieces {
            let length =
                (window / SHORT_WINDOWS_PER_WINDOW / self.study.records[piece.record].step).round() as usize;
            let length = length.max(8);
            let begins = piece.range.clone().step_by(every * length);
            found.extend(begins.map(|begin| Piece {
                record: piece.record,
                range: begin..(begin + length).min(piece.range.end),
            }));
        }
        let none = vec![Vec::new(); found.len()];
        (found, none)
    }
}

/// The linear least-squares step from `p` over `open`, the parameters of `fit` and the local ones: promised sum of
/// squares and parameters after it.
pub(super) fn linear_step(
    view: &View,
    shared: &[Columns],
    (fit, locals): (&Fit, &[Vec<f64>]),
    open: &[Free],
    mut p: Vec<f64>,
) -> Option<(f64, Vec<f64>)> {
    let (m, known) = (open.len(), fit.free.len());
    let records: Vec<usize> = (0..shared.len()).collect();
    let locals: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
    let joint = Joint::new(&columns(view, &records, &p, open, &locals, false, None), shared, known);
    let (matrix, right, chi2, size) = (&joint.matrix, &joint.right, joint.chi2, joint.right.len());
    let scale: Vec<f64> = (0..size).map(|a| f64::sqrt(matrix[(a, a)]).max(1e-150)).collect();
    let scaled = DMatrix::from_fn(size, size, |a, b| {
        matrix[(a, b)] / (scale[a] * scale[b]) + if a == b { 1e-9 } else { 0.0 }
    });
    let solved = Cholesky::new(scaled)?.solve(&DVector::from_fn(size, |a, _| right[a] / scale[a]));
    let step = DVector::from_fn(size, |a, _| solved[a] / scale[a]);
    let gain = joint.gain(&step);
    for (a, f) in open.iter().enumerate() {
        p[f.index] = (p[f.index] + step[a]).clamp(f.bounds.0, f.bounds.1);
        // The predicted gain of a strength at its bound would be out of reach.
        if step[a] < 0.0 && f.bounds.0 == 0.0 {
            return Some((chi2, p));
        }
    }
    for (a, f) in fit.free.iter().enumerate() {
        p[f.index] = (p[f.index] + step[m + a]).clamp(f.bounds.0, f.bounds.1);
    }
    chi2.is_finite().then_some((chi2 - gain, p))
}
