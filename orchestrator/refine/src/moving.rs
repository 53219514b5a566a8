//! Choice of the actuator model of a search: the declared one, or a pneumatic cylinder from first principles in its
//! place.
//!
//! An actuator that was identified with its rod fixed does not know that a moving piston changes the pressures in the
//! chambers. That is no effect of the vocabulary, and it is larger than most of them, so it has to be out of the way
//! before anything else can be found.

use super::answer::{Answer, Verdict};
use super::engine::System;
use super::engine::fit::Free;
use super::engine::search::{Model, Search};
use super::engine::select::MARGIN;
use super::rig::parameters::{CYLINDER, D_ACT_DECAY, D_ACT_GAIN, D_ACT_TURN};

/// Share of the normalized power that the declared actuator leaves in the pressure force below which the cylinder takes
/// its place.
const MAX_ERROR_RATIO: f64 = 0.25;
/// Note of the report where the cylinder takes the place of the declared actuator.
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
    (left(&found)? < MAX_ERROR_RATIO * left(declared)?).then_some(found)
}

/// Corrections that the cylinder knows: those of the declared actuator mean nothing to it.
pub fn without_actuator(corrections: &[Free]) -> Vec<Free> {
    corrections
        .iter()
        .filter(|f| ![D_ACT_GAIN, D_ACT_DECAY, D_ACT_TURN].contains(&f.index))
        .copied()
        .collect()
}

/// Says in the answer that the cylinder took the place of the declared actuator. That alone is no effect: without one
/// the verdict is that the actuator is not explained by any.
pub fn tell(answer: &mut Answer) {
    if answer.verdict == Verdict::Nothing {
        answer.verdict = Verdict::Unexplained;
    }
    answer.cylinder = true;
    answer.unexplained = Some(("actuator".into(), vec!["x".into(), "xdot".into()]));
    answer.notes.push(NOTE.into());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Actuator;
    use crate::engine::goodness::Null;
    use crate::engine::search::Rules;
    use crate::rig::parameters::{GAIN, POLE_COULOMB, neutral};
    use crate::rig::testing::rig;

    const ALL: [(&str, f64); 4] = [("F_hat", 0.3), ("F_p", 0.3), ("x", 3e-4), ("theta", 3e-4)];

    /// Whether records with the effects of `values` call for the cylinder; the declared actuator is what a fixed rod
    /// shows of it.
    fn chosen(values: &[(usize, f64)], noises: &[(&str, f64)]) -> bool {
        let actuator = Actuator {
            sample_time: 1e-3,
            A1: [[-1.0136, 0.027052], [-0.032284, -0.95853]],
            B0: [0.225645, -0.162456],
            B1: [-0.213883, 0.168954],
        };
        let rig = rig(actuator, 1200, noises, values);
        let locals = vec![vec![0.0, 0.0]; 2];
        let null = Null::simulate(&rig, &[0, 1], &neutral(), &locals, 40, 1);
        let search = Search {
            system: &rig,
            candidates: &[],
            records: vec![0, 1],
            screened: vec![0, 1],
            null,
            rules: Rules::default(),
        };
        let declared = search.fit(&[], &[], &neutral(), &locals, 5);
        with_cylinder(&search, &declared).is_some()
    }

    #[test]
    fn the_cylinder_takes_the_place_of_an_actuator_that_moving_records_contradict() {
        assert!(chosen(&[(CYLINDER, 1.0)], &ALL));
        assert!(chosen(&[(CYLINDER, 1.0), (POLE_COULOMB, 3e-3)], &ALL));
    }

    #[test]
    fn effects_of_a_declared_actuator_call_for_no_cylinder() {
        assert!(!chosen(&[], &ALL));
        assert!(!chosen(&[(POLE_COULOMB, 3e-3)], &ALL));
        assert!(!chosen(&[(GAIN, 0.3)], &ALL));
    }

    #[test]
    fn nothing_is_said_of_the_actuator_without_a_pressure_sensor() {
        assert!(!chosen(&[(CYLINDER, 1.0)], &ALL[2..]));
    }
}
