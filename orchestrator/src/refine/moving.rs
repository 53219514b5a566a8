//! Which actuator a search stands on: the declared one, or a pneumatic cylinder from first principles in its place.
//!
//! An actuator that was identified with its rod fixed does not know that a moving piston changes the pressures in the
//! chambers. That is no effect of the vocabulary, and it is larger than most of them, so it has to be out of the way
//! before anything else can be found.

use super::answer::{Answer, Verdict};
use super::engine::System;
use super::engine::fit::Free;
use super::engine::search::{Model, Search};
use super::engine::select::MARGIN;
use super::rig::parameters::{CYLINDER, D_ACT_GAIN, D_ACT_RATE};

/// Share of the normalised power that the declared actuator leaves in the pressure force below which the cylinder takes its
/// place.
const BETTER: f64 = 0.25;
/// What a report says where it does.
const NOTE: &str = "The actuator does not follow its declared model. Identified with the rod fixed, that cannot know that a moving piston changes the pressures in the chambers. A pneumatic cylinder from first principles takes its place, as declared in [model.cylinder] or with the values of the FMU pneumatic-cylinder.";

/// The declared model with the cylinder in place of its actuator, where the pressure force contradicts the actuator and
/// the cylinder is clearly better.
///
/// The motion is not asked: a missing effect of the mechanics spoils it with either actuator.
pub fn with_cylinder<S: System + ?Sized>(search: &Search<S>, declared: &Model) -> Option<Model> {
    let left = |model: &Model| model.left.iter().find(|(signal, _)| signal == "F_hat").map(|(_, left)| *left);
    if left(declared)? < search.null.quantile + MARGIN {
        return None;
    }
    let mut p = declared.fit.parameters.clone();
    p[CYLINDER] = 1.0;
    let found = search.fit(&[], &[], &p, &declared.fit.locals, 5);
    (left(&found)? < BETTER * left(declared)?).then_some(found)
}

/// Corrections that the cylinder knows: those of the declared actuator mean nothing to it.
pub fn without_actuator(corrections: &[Free]) -> Vec<Free> {
    corrections.iter().filter(|f| ![D_ACT_GAIN, D_ACT_RATE].contains(&f.index)).copied().collect()
}

/// Says in the answer that the cylinder took the place of the declared actuator. That alone is no effect: without one the
/// verdict is that the actuator is not explained by any.
pub fn tell(answer: &mut Answer) {
    if answer.verdict == Verdict::Nothing {
        answer.verdict = Verdict::Unexplained;
    }
    answer.cylinder = true;
    answer.unexplained = Some(("actuator".into(), vec!["x".into(), "xdot".into()]));
    answer.notes.push(NOTE.into());
}
