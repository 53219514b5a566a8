//! Which of the candidates tried in a step is accepted, and why the others are not.

use std::cell::OnceCell;

use super::forward_selection::Run;
use super::normal::residuals;
use super::question::{Step, Tried};
use crate::share::percent_below;

/// Ties by which a candidate at a bound of its parameters may leave less than one with fewer parameters that stands in
/// its place.
const TIES_AT_BOUND: f64 = 2.0;

/// Share of `min_share_alone` that is asked of an effect which takes nearly all that the corrections leave.
const SHARE_ALONE_OF_REST: f64 = 0.25;

impl Run<'_> {
    /// Why a candidate is no effect that matters, if it is none.
    pub(super) fn objection(&self, tried: &Tried) -> Option<String> {
        let (q, own) = (self.question, &self.question.candidates[tried.candidate]);
        let s = &q.settings;
        if tried.gain < s.min_gain {
            return Some(format!(
                "its gain of {:.0} is within what the residual that is left gives by chance",
                tried.gain.max(0.0)
            ));
        }
        // An effect that takes most of the error by itself, with a significantly smaller sum, stands even where several
        // corrections together could do nearly the same.
        let share = self.share(tried);
        let told = share >= s.tie_share || q.same(tried.candidate).is_some();
        let dominant = tried.alone >= s.min_share_of_correction;
        if share < s.min_held_out_share && !(dominant && told) {
            let whole =
                if self.whole_error < self.declared_error { "spread of the records" } else { "error" };
            let [share, least] = percent_below(share, s.min_held_out_share);
            return Some(format!(
                "it takes away {share} of the {whole} on held-out records beyond the corrections, less than {least}"
            ));
        }
        // What corrections leave is its own where it takes nearly all of that and lives on none of them.
        let is_rest = self.share_of_rest(tried) >= s.min_share_of_rest;
        let least = if is_rest { SHARE_ALONE_OF_REST * s.min_share_alone } else { s.min_share_alone };
        if tried.alone < least {
            let [alone, least] = percent_below(tried.alone, least);
            return Some(format!(
                "without corrections of declared parameters it takes away {alone} of the error, less than {least}"
            ));
        }
        if let Some(same) = q.same(tried.candidate) {
            let relative = tried.model.fit.parameters[own.free[0].index] / same.declared;
            let tolerance = same.free.prior.unwrap_or(0.0);
            let within = relative.abs() < s.max_tolerances * tolerance;
            if within && (tried.alone < s.min_share_of_correction || q.is_change(tried.candidate)) {
                return Some("it is within the tolerance of a declared parameter".into());
            }
        }
        (q.sense)(own, &tried.model)
    }

    /// Share of the error on held-out records that a candidate takes away beyond the corrections.
    fn share(&self, tried: &Tried) -> f64 {
        tried.held_out * self.declared_error / self.whole_error
    }

    /// Share of the error on held-out records that a candidate takes away of what the model before it leaves.
    fn share_of_rest(&self, tried: &Tried) -> f64 {
        let gained = tried.held_out * self.declared_error;
        gained / (tried.error + gained)
    }

    /// Whether a candidate stands for what it takes away alone while another effect takes more beside the corrections.
    fn is_outdone(&self, own: &Tried, tried: &[Tried]) -> bool {
        let (q, s) = (self.question, &self.question.settings);
        let outdoes = |other: &Tried| {
            other.error < own.error - s.tie_share * self.whole_error
                && !other.alone.is_nan()
                && !q.is_change(other.candidate)
                && (q.sense)(&q.candidates[other.candidate], &other.model).is_none()
        };
        self.share(own) < s.min_held_out_share && tried.iter().any(outdoes)
    }

    /// Whether a parameter of a candidate is at its upper bound.
    fn is_at_bound(&self, tried: &Tried) -> bool {
        let own = &self.question.candidates[tried.candidate].free;
        own.iter().any(|f| tried.model.fit.parameters[f.index] >= f.bounds.1)
    }

    /// The best of the candidates without objection: of those that leave about the least error the likeliest, or one
    /// with fewer parameters that takes as much away without corrections. Effects come before other values of declared
    /// parameters.
    pub(super) fn accepted<'t>(&self, tried: &'t [Tried]) -> Option<&'t Tried> {
        let (q, tie) = (self.question, self.question.settings.tie_share);
        let size = |t: &Tried| q.candidates[t.candidate].free.len();
        // Whether a form has sense may take a simulation: asked once.
        let sound: Vec<&Tried> =
            tried.iter().filter(|t| t.rejected.is_none() && !self.is_outdone(t, tried)).collect();
        let least = sound.iter().map(|t| t.error).fold(f64::INFINITY, f64::min);
        let tied = || sound.iter().copied().filter(|t| t.error <= least + tie * self.whole_error);
        let only_changes = tied().all(|t| q.is_change(t.candidate));
        let near = || tied().filter(|t| only_changes || !q.is_change(t.candidate));
        let likelier = |a: &&Tried, b: &&Tried| a.model.fit.chi2.total_cmp(&b.model.fit.chi2);
        let likeliest = near().min_by(likelier)?;
        // One that wants more of a parameter than it may have imitates another: a mode damped without end a delay.
        if self.is_at_bound(likeliest) {
            let about_as_good = |t: &&Tried| {
                size(t) < size(likeliest)
                    && !q.is_change(t.candidate)
                    && t.error <= likeliest.error + TIES_AT_BOUND * tie * self.whole_error
            };
            let imitated = sound.iter().copied().filter(about_as_good);
            if let Some(imitated) = imitated.min_by(likelier) {
                return Some(imitated);
            }
        }
        let simpler = |t: &&Tried| size(t) < size(likeliest) && t.alone >= likeliest.alone - tie;
        let simplest = near().filter(simpler).min_by(|a, b| size(a).cmp(&size(b)).then(likelier(a, b)));
        simplest.or(Some(likeliest))
    }

    /// Candidates of a step that do as well as the accepted one with as many parameters, or predict nearly the same: a
    /// small difference beside what no model explains tells nothing, however significant it is.
    pub(super) fn equals(&self, step: &Step, accepted: &Tried) -> Vec<Tried> {
        let q = self.question;
        let left = |own: &Tried| {
            let fit = &own.model.fit;
            residuals(q.system, &q.records, &fit.parameters, &fit.locals)
        };
        let of_accepted = OnceCell::new();
        let alike = |t: &Tried| {
            let of_accepted = of_accepted.get_or_init(|| left(accepted));
            let (mut apart, mut whole) = (0.0, 0.0);
            for (own, other) in left(t).iter().zip(of_accepted) {
                apart += own.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                whole += other.iter().map(|value| value * value).sum::<f64>();
            }
            apart <= q.settings.tie_of_predictions.powi(2) * whole
        };
        let size = |t: &Tried| q.candidates[t.candidate].free.len();
        let same = |t: &&Tried| {
            let nested = q.candidates[t.candidate].adds_to(&q.candidates[accepted.candidate]);
            t.candidate != accepted.candidate
                && !nested
                && t.rejected.is_none()
                && (!q.is_change(t.candidate) || q.is_change(accepted.candidate))
                && size(t) >= size(accepted)
                && (t.error - accepted.error) < q.settings.tie_share * self.whole_error
                && (t.model.fit.chi2 - accepted.model.fit.chi2 < q.settings.tie || alike(t))
        };
        step.tried.iter().filter(same).cloned().collect()
    }
}
