//! Free forms at a port over signals from elsewhere: attachments that show them, and when such a form takes the place
//! of one over the motion at the port itself.

use super::extent::Extent;
use super::finder::Finder;
use super::free_form::FreeForm;
use super::surface::Surface;
use crate::study::fits::Model;
use crate::study::law::{Point, Variable};
use crate::study::model::{Study, Tap};

/// Ratio of the excess over noise of a form over signals from elsewhere to that of the best form over the motion at the
/// port itself, below which the former takes its place.
const MAX_EXCESS_OVER_OWN: f64 = 0.5;

impl Finder<'_> {
    /// The form that `search` finds, if it leaves much less than `own`; else the study stays as it is.
    pub(super) fn instead_of(
        &mut self,
        own: &FreeForm,
        study: &mut Study,
        search: impl FnOnce(&mut Self, &mut Study) -> Option<FreeForm>,
    ) -> Option<FreeForm> {
        let before = Extent::of(study);
        let noise = self.noise;
        let found =
            search(self, study).filter(|form| form.excess(noise) < MAX_EXCESS_OVER_OWN * own.excess(noise));
        if found.is_none() {
            before.restore(study);
            self.trace.truncate(study.taps.len());
        }
        found
    }

    /// A free form at an attachment over variables that move there, with so many knots of each.
    pub(super) fn over(
        &self,
        study: &mut Study,
        declared: &Model,
        tap: usize,
        variables: &[Variable],
        counts: &[usize],
    ) -> Option<FreeForm> {
        let knots: Option<Vec<Vec<f64>>> =
            variables.iter().zip(counts).map(|(own, count)| self.knots(study, tap, *own, *count)).collect();
        self.form(study, declared, tap, Surface::new(variables.into(), knots?))
    }

    /// Adds an attachment with the signals that it shows in the estimation records, `[n]`; its place.
    pub(super) fn attach(&mut self, study: &mut Study, tap: Tap, points: Vec<Point>) -> usize {
        self.trace.push(points);
        study.taps.push(tap);
        study.forget_instances();
        study.taps.len() - 1
    }
}

/// The form with the least held-out error.
pub(super) fn least(forms: Vec<FreeForm>) -> Option<FreeForm> {
    forms.into_iter().min_by(|a, b| a.at.smooth.held_out.total_cmp(&b.at.smooth.held_out))
}
