//! A free form at a port of a study, fitted in simulation: windows first, whole records from their beginning on.

use super::finder::Finder;
use super::study::{extended, push};
use super::surface::Surface;
use super::surrogate::Approach;
use crate::engine::fit::Free;
use crate::engine::normal::columns;
use crate::study::fits::{Fits, Model};
use crate::study::law::{Law as Block, Variable};
use crate::study::model::{Action, Entry, Study, Target};
use crate::study::simulate::Piece;

/// Parts of the records, from their beginning, that a free form is brought to before the whole.
pub(super) const GROWING_SHARES: [f64; 5] = [0.03, 0.07, 0.15, 0.3, 0.6];
/// Part of the records, from their beginning, on which variables are compared.
const SCREENED_SHARE_OF_RECORDS: f64 = 0.35;
/// Ratio of the error of a free form to that predicted by its quadratic form, up to which it is at its optimum.
const MAX_ERROR_OVER_QUADRATIC: f64 = 1.5;
/// Steps of the free form toward its optimum.
const ROUNDS: usize = 3;

/// One free form, fitted.
#[derive(Clone)]
pub(super) struct FreeForm {
    pub(super) tap: usize,
    pub(super) surface: Surface,
    pub(super) candidate: usize,
    pub(super) at: Approach,
    /// Rms of the residuals of whole records.
    pub(super) error: f64,
    /// Local parameters of whole records.
    pub(super) locals: Vec<Vec<f64>>,
}

impl Finder<'_> {
    /// Records of the windows that are held out together for a form over some variables.
    fn groups(&self, variables: &[Variable]) -> Option<Vec<usize>> {
        // A law in time is the same in every record: only another record can tell whether it is one.
        let time = variables.contains(&Variable::Time);
        let of = |(i, piece): (usize, &Piece)| if time { piece.record } else { i };
        self.windows.as_ref().map(|own| own.pieces.iter().enumerate().map(of).collect())
    }

    /// A free form beside the declared model, around zero heights.
    pub(super) fn form(
        &self,
        study: &mut Study,
        declared: &Model,
        tap: usize,
        surface: Surface,
    ) -> Option<FreeForm> {
        let count = surface.heights();
        study.surfaces.push(surface.clone());
        let index = study.surfaces.len() - 1;
        let first = study.entries.len();
        let entries = (0..count).map(|k| {
            let free = Free {
                index: first + k,
                bounds: (f64::NEG_INFINITY, f64::INFINITY),
                step: 1e-6,
                prior: None,
            };
            let name = format!("free form height {}", k + 1);
            Entry { name, unit: "1".into(), target: Target::Effect, start: 0.0, free }
        });
        let action = Action::Block { law: Block::Surface(index), tap };
        let candidate = push(study, action, entries.collect(), "", "free form".to_owned());
        let base = extended(declared, study);
        let fits = self.fits(study);
        let step = fits.probe_step(&base, candidate)?;
        study.entries[first..first + count].iter_mut().for_each(|entry| entry.free.step = step);
        let fits = self.fits(study);
        let own: Vec<Free> = study.entries[first..first + count].iter().map(|entry| entry.free).collect();
        let (view, locals) = match &self.windows {
            Some(windows) => (windows.view(&fits, &self.acting(candidate)), windows.begins.clone()),
            None => (
                fits.view(&self.acting(candidate), &beginnings(&fits.pieces, SCREENED_SHARE_OF_RECORDS)),
                base.fit.locals.clone(),
            ),
        };
        let free = [&own[..], &self.shared(study)[..]];
        let groups = self.groups(&surface.variables);
        // Heights of zero change nothing, whatever they are over.
        let unmoved = self.unmoved.get_or_init(|| {
            let records: Vec<usize> = (0..locals.len()).collect();
            let starts: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
            columns(&view, &records, &base.fit.parameters, free[1], &starts, true, None)
        });
        let p = &base.fit.parameters;
        let at = Approach::begin(&view, &surface, p, free, &locals, groups, Some(unmoved))?;
        Some(FreeForm { tap, surface, candidate, at, error: declared.error, locals: base.fit.locals })
    }

    /// The free form at its optimum.
    pub(super) fn toward(&self, study: &Study, form: FreeForm) -> Option<FreeForm> {
        let Some(windows) = &self.windows else { return self.whole(study, form) };
        let fits = self.fits(study);
        let own = study.candidates[form.candidate].entries.clone();
        let heights: Vec<Free> = own.map(|index| study.entries[index].free).collect();
        let free = [&heights[..], &self.shared(study)[..]];
        let at = form.at.toward(
            &windows.view(&fits, &self.acting(form.candidate)),
            &form.surface,
            free,
            2 * ROUNDS,
        )?;
        Some(FreeForm { at, ..form })
    }

    /// The free form at its optimum for whole records.
    pub(super) fn whole(&self, study: &Study, form: FreeForm) -> Option<FreeForm> {
        let fits = self.fits(study);
        let own = study.candidates[form.candidate].entries.clone();
        let heights: Vec<Free> = own.map(|index| study.entries[index].free).collect();
        let shared = self.shared(study);
        let free = [&heights[..], &shared[..]];
        let whole = fits.view(&self.acting(form.candidate), &fits.pieces);
        let base =
            Approach::begin(&whole, &form.surface, &form.at.parameters, free, &form.locals, None, None)?;
        let without = base.smooth.without;
        let (p, locals) = (base.parameters.clone(), base.locals.clone());
        let direct = base.toward(&whole, &form.surface, free, ROUNDS);
        let consistent = |at: &Approach| {
            at.chi2 < MAX_ERROR_OVER_QUADRATIC * at.smooth.held_out && at.smooth.held_out < without
        };
        let mut at = match direct {
            Some(at) if consistent(&at) => at,
            // What leaves the declared model leaves it far behind at the end of a record: the beginning is understood
            // first.
            direct => {
                let grown = self.grown(&fits, &form, free, (p, locals));
                match (direct, grown) {
                    (Some(a), Some(b)) if a.chi2 < b.chi2 => a,
                    (a, b) => b.or(a)?,
                }
            }
        };
        at.smooth.without = without;
        let count: usize =
            fits.pieces.iter().map(|piece| piece.range.len()).sum::<usize>() * study.outputs.len();
        let error = (at.chi2 / count.max(1) as f64).sqrt();
        let locals = at.locals.clone();
        Some(FreeForm { at, error, locals, ..form })
    }

    /// The free form over growing parts of the records.
    fn grown(
        &self,
        fits: &Fits,
        form: &FreeForm,
        free: [&[Free]; 2],
        (mut p, mut locals): (Vec<f64>, Vec<Vec<f64>>),
    ) -> Option<Approach> {
        for part in GROWING_SHARES {
            let view = fits.view(&self.acting(form.candidate), &beginnings(&fits.pieces, part));
            let at = Approach::begin(&view, &form.surface, &p, free, &locals, None, None)?;
            let at = at.toward(&view, &form.surface, free, ROUNDS)?;
            (p, locals) = (at.parameters, at.locals);
        }
        let whole = fits.view(&self.acting(form.candidate), &fits.pieces);
        let at = Approach::begin(&whole, &form.surface, &p, free, &locals, None, None)?;
        at.toward(&whole, &form.surface, free, 2 * ROUNDS)
    }
}

/// Pieces of which only this part of the beginning counts.
fn beginnings(pieces: &[Piece], part: f64) -> Vec<Piece> {
    let short = |piece: &Piece| {
        let n = ((piece.range.len() as f64 * part) as usize).max(16).min(piece.range.len());
        Piece { record: piece.record, range: piece.range.start..piece.range.start + n }
    };
    pieces.iter().map(short).collect()
}
