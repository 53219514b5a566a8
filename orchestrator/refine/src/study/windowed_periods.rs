//! Periods of a force that repeats along the way, from fits over windows of the records that grow: starts of the
//! candidate over whole records.
//!
//! Once the declared model is half a period away from the measured motion, the force that it would feel has nothing to
//! do with the one that acted, and no step from there leads anywhere. In short windows that begin as measured the
//! motion stays near the measured one: every period is compared there by the linear step, the best ones are fitted with
//! the first states of all windows, then over longer windows, in the end over whole records.

use super::beside::linear_step;
use super::fits::{Fits, Model};
use super::law::Law;
use super::model::{Action, Study};
use super::simulate::View;
use crate::engine::fit::{Fit, fit};
use crate::engine::normal::{Columns, columns};
use crate::engine::{parallel, stop};
use crate::law::windows::{WINDOWS, Windows};
use crate::order::ascending;

/// Windows of the longest record in which the best of the short ones are fitted again.
const LONG_WINDOWS: usize = 5;
/// Periods that are fitted over short windows, and over long ones.
const FITTED: usize = 4;
const FITTED_LONG: usize = 2;
/// Steps of a fit.
const ROUNDS: usize = 8;
/// Share of the sum of squares that a force has to take away over windows to be fitted over longer ones, and over whole
/// records for other starts to be left out.
const MIN_SHARE_OF_WINDOWS: f64 = 0.2;
const MIN_SHARE_OF_RECORDS: f64 = 0.5;

/// Gives candidates for periodic forces the starts that windows lead to, where these can begin as measured.
pub fn propose(study: &mut Study, scale: &[f64], declared: &Model) {
    let is_periodic = |c: &usize| {
        let own = &study.candidates[*c];
        let periodic = matches!(own.action, Action::Block { law: Law::Cogging | Law::PeriodicCoulomb, .. });
        periodic && own.needs.is_none()
    };
    let periodic: Vec<usize> = (0..study.candidates.len()).filter(is_periodic).collect();
    // Windows of the study begin as measured, too.
    if periodic.is_empty() || study.windows.is_some() || stop::asked() {
        return;
    }
    let found: Vec<Option<Start>> = {
        let fits = Fits::new(study, scale.to_vec()).quickened(declared);
        let windows = |count: usize| Windows::new(&fits, declared, count);
        let Some((short, long)) = windows(WINDOWS).zip(windows(LONG_WINDOWS)) else { return };
        let own = Windowed { fits: &fits, declared, windows: [short, long] };
        periodic.iter().map(|&c| own.start(c)).collect()
    };
    for (c, start) in periodic.into_iter().zip(found) {
        let Some(start) = start else { continue };
        let own = &mut study.candidates[c].starts;
        if start.share >= MIN_SHARE_OF_RECORDS {
            own.clear();
        }
        own.push(start.values);
    }
}

/// A start of a candidate.
struct Start {
    values: Vec<f64>,
    /// Share of the declared model's sum of squares over whole records that it takes away there.
    share: f64,
}

/// The records in windows: short ones, long ones.
struct Windowed<'a> {
    fits: &'a Fits<'a>,
    declared: &'a Model,
    windows: [Windows; 2],
}

impl Windowed<'_> {
    /// The start of a candidate; none where no period takes enough away over windows.
    fn start(&self, c: usize) -> Option<Start> {
        let (fits, declared) = (self.fits, self.declared);
        let [short, long] = &self.windows;
        let (without, starts) = self.compared(c, short)?;
        let fitted = self.fitted(c, short, starts, without);
        let best: Vec<Vec<f64>> = fitted.into_iter().take(FITTED_LONG).map(|own| own.parameters).collect();
        if best.is_empty() {
            return None;
        }
        let (without, _) = left(&long.view_along(fits, &[]), &declared.fit, long)?;
        let best = self.fitted(c, long, best, without).into_iter().next()?;
        let records: Vec<usize> = (0..fits.pieces.len()).collect();
        let (view, free) = (fits.view(&[c], &fits.pieces), fits.free(&[c]));
        let whole = fit(&view, &records, &best.parameters, &free, &declared.fit.locals, ROUNDS);
        let share = 1.0 - whole.chi2 / declared.fit.chi2;
        let better = if share > 0.0 { whole } else { best };
        let values = better.parameters[fits.study.candidates[c].entries.clone()].to_vec();
        Some(Start { values, share })
    }

    /// Sum of squares of the declared model over windows, and parameters after the linear step from each start of a
    /// candidate, best promise first.
    fn compared(&self, c: usize, windows: &Windows) -> Option<(f64, Vec<Vec<f64>>)> {
        let (fits, declared) = (self.fits, &self.declared.fit);
        let own = &fits.study.candidates[c];
        let (without, around) = left(&windows.view_along(fits, &[]), declared, windows)?;
        let view = windows.view_along(fits, &[c]);
        let promise = |s: usize| {
            if stop::asked() {
                return None;
            }
            let mut p = declared.parameters.clone();
            own.entries.clone().zip(&own.starts[s]).for_each(|(index, value)| p[index] = *value);
            let open = own.entries.clone().zip(&own.starts[s]).filter(|(_, value)| **value == 0.0);
            let open: Vec<_> = open.map(|(index, _)| fits.study.entries[index].free).collect();
            linear_step(&view, &around, (declared, &windows.begins), &open, p)
        };
        let promises = parallel::map(own.starts.len(), promise);
        let mut found: Vec<(f64, Vec<f64>)> = promises.into_iter().flatten().collect();
        ascending(&mut found, |own| own.0);
        Some((without, found.into_iter().take(FITTED).map(|own| own.1).collect()))
    }

    /// Fits over windows from some starts, best first, of those that take enough of what is left `without` the force.
    fn fitted(&self, c: usize, windows: &Windows, starts: Vec<Vec<f64>>, without: f64) -> Vec<Fit> {
        let view = windows.view_along(self.fits, &[c]);
        let free = self.fits.free(&[c]);
        let records: Vec<usize> = (0..windows.pieces.len()).collect();
        let one = |p: Vec<f64>| fit(&view, &records, &p, &free, &windows.begins, ROUNDS);
        let mut found: Vec<Fit> = starts.into_iter().map(one).collect();
        found.retain(|own| own.chi2 < (1.0 - MIN_SHARE_OF_WINDOWS) * without);
        ascending(&mut found, |own| own.chi2);
        found
    }
}

/// Sum of squares that the declared model leaves over windows once their first states are fitted by a linear step, and
/// the derivatives there.
fn left(view: &View, declared: &Fit, windows: &Windows) -> Option<(f64, Vec<Columns>)> {
    let begins: Vec<&[f64]> = windows.begins.iter().map(Vec::as_slice).collect();
    let records: Vec<usize> = (0..begins.len()).collect();
    let around = columns(view, &records, &declared.parameters, &declared.free, &begins, true, None);
    let p = declared.parameters.clone();
    let (chi2, _) = linear_step(view, &around, (declared, &windows.begins), &[], p)?;
    Some((chi2, around))
}
