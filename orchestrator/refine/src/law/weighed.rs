//! A free form beside declared parameters that are off. In units of what a large missing law leaves, residuals weigh
//! next to nothing against tolerances: parameters stay as declared, and what they are off passes for a second variable.

use super::finder::Finder;
use super::free_form::FreeForm;
use super::study::corrections;
use crate::engine::fit::Free;
use crate::study::fits::Model;
use crate::study::model::Study;

/// Ratio of the excess over noise that a form leaves beside corrections whose tolerances weigh as they do in noise, to
/// that beside those of the model, below which all are fitted along with the law.
const MAX_EXCESS_BESIDE_CORRECTIONS: f64 = 0.5;

impl Finder<'_> {
    /// The form over the variable of `own` beside corrections in the weight that their tolerances have in noise, if it
    /// leaves much less than `own`; they stay in the search then.
    pub(super) fn beside_corrections(
        &mut self,
        study: &mut Study,
        declared: &Model,
        own: &FreeForm,
    ) -> Option<FreeForm> {
        let weight = self.noise_of_sample(study).sqrt().recip();
        let weighed = |own: Free| Free { prior: own.prior.map(|prior| prior * weight), ..own };
        let all: Vec<Free> = corrections(study, self.max_tolerances).into_iter().map(weighed).collect();
        if all.is_empty() || !weight.is_finite() {
            return None;
        }
        let before = (std::mem::replace(&mut self.corrections, all), std::mem::take(&mut self.unmoved));
        let noise = self.noise;
        let found = self.fine(study, declared, (own.tap, own.surface.variables[0]));
        let most = MAX_EXCESS_BESIDE_CORRECTIONS * own.excess(noise);
        let Some(mut found) = found.filter(|form| form.excess(noise) < most) else {
            (self.corrections, self.unmoved) = before;
            return None;
        };
        // What a law takes away is counted from the model as it was.
        found.at.smooth.without = own.at.smooth.without;
        Some(found)
    }
}
