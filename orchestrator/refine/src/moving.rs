//! Choice of the actuator model of a search: the declared one, or a pneumatic cylinder from first principles in its
//! place.
//!
//! An actuator that was identified with its rod fixed does not know that a moving piston changes the pressures in the
//! chambers. That is no effect of the vocabulary, and it is larger than most of them, so it has to be out of the way
//! before anything else can be found.

use super::answer::{Answer, Verdict};
use super::engine::System;
use super::engine::candidate::Candidate;
use super::engine::fit::{Fit, Free, fit};
use super::engine::goodness::Null;
use super::engine::search::{Model, Rules, Search};
use super::engine::select::{MARGIN, attempt};
use super::rig::coupled::Coupled;
use super::rig::parameters::CYLINDER;

/// Power beyond the noise that an actuator leaves in the pressure force, over that of the noise, up to which it is as
/// declared: on rigs that are off everywhere by their tolerances it leaves 0.2, and an end stop makes the measured
/// motion uncertain by as much; a cylinder leaves 18 and more to an actuator that was identified with its rod fixed.
const MAX_EXCESS: f64 = 0.5;
/// The same over that which the declared actuator leaves with its best effect, below which a cylinder with fitted
/// dimensions takes its place.
const MAX_EXCESS_RATIO: f64 = 0.25;
/// Rounds of a fit of the dimensions.
const ROUNDS: usize = 12;
/// Effects of an actuator that are fitted for comparison.
const FITTED: usize = 3;
/// Draws of the null, which only ranks.
const DRAWS: usize = 40;
/// Note of the report where the cylinder takes the place of the declared actuator.
const NOTE: &str = "The actuator does not follow its declared model. Identified with the rod fixed, that cannot know that a moving piston changes the pressures in the chambers. A pneumatic cylinder from first principles takes its place, as declared in [model.cylinder]; dimensions that are not stated there are fitted from the values of the FMU pneumatic-cylinder on, and are among the corrections.";

/// A cylinder in place of the declared actuator.
pub struct Replacement {
    /// The declared model with the cylinder.
    pub model: Model,
    /// Its dimensions as fitted to the pressure force, where they are not as declared.
    pub dimensions: Option<Fit>,
}

/// The declared model with the cylinder in place of its actuator, where the pressure force contradicts the actuator and
/// the cylinder is clearly better than any single effect of the actuator.
///
/// The motion is not asked: a missing effect of the mechanics spoils it with either actuator. `dimensions`: those of
/// the cylinder that may be off.
pub fn with_cylinder<S: System + ?Sized>(
    coupled: &Coupled,
    search: &Search<S>,
    declared: &Model,
    dimensions: &[Free],
) -> Option<Replacement> {
    let left = declared.left.iter().find(|(signal, _)| signal == "F_hat").map(|(_, left)| *left)?;
    if left < search.null.quantile + MARGIN {
        return None;
    }
    let (system, records) = (coupled.pressure_force(), search.records.clone());
    let locals = vec![Vec::new(); records.len()];
    let mut p = declared.fit.parameters.clone();
    let own: Vec<Candidate> = search.candidates.iter().filter(|c| c.channel == "actuator").cloned().collect();
    let null = Null::simulate(&system, &records, &p, &locals, DRAWS, 1);
    let (screened, rules) = (search.screened.clone(), Rules::default());
    let actuator = Search { system: &system, candidates: &own, records, screened, null, rules };
    let price = actuator.penalty();
    let samples = price.exp();
    let excess = |fit: &Fit| (fit.chi2 / samples - 1.0).max(0.0);
    let alone = |p: &[f64]| actuator.fit(&[], &[], p, &locals, 1);
    let with_effect = |alone: Model| {
        let limit = actuator.null.quantile + MARGIN;
        let singles = attempt(&actuator, &alone, &actuator.screen(&alone), FITTED, limit);
        singles.into_iter().chain([alone]).min_by(|a, b| a.fit.chi2.total_cmp(&b.fit.chi2))
    };
    let stated = alone(&p);
    if excess(&stated.fit) < MAX_EXCESS {
        return None;
    }
    let stated = with_effect(stated)?;
    if excess(&stated.fit) < MAX_EXCESS {
        return None;
    }
    p[CYLINDER] = 1.0;
    let as_declared = |p: &[f64]| {
        let model = search.fit(&[], &[], p, &declared.fit.locals, 5);
        Some(Replacement { model, dimensions: None })
    };
    let cylinder = alone(&p);
    if excess(&cylinder.fit) < MAX_EXCESS {
        return as_declared(&p);
    }
    // An effect in front of a cylinder that is as declared would also move its dimensions.
    let near = excess(&cylinder.fit) < excess(&stated.fit);
    let single = if near { with_effect(cylinder) } else { None };
    if single.as_ref().is_some_and(|single| excess(&single.fit) < MAX_EXCESS) {
        return as_declared(&p);
    }
    let dimensions = fit(&system, &actuator.records, &p, dimensions, &locals, ROUNDS);
    let criterion = |fit: &Fit, parameters: usize| fit.chi2 + price * parameters as f64;
    let fitted = criterion(&dimensions, dimensions.free.len());
    if single.is_some_and(|single| criterion(&single.fit, single.size(&own)) < fitted) {
        return as_declared(&p);
    }
    if excess(&dimensions) > MAX_EXCESS_RATIO * excess(&stated.fit) {
        return None;
    }
    let model = search.fit(&[], &[], &dimensions.parameters, &declared.fit.locals, 5);
    Some(Replacement { model, dimensions: Some(dimensions) })
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
    use std::collections::BTreeMap;

    use super::*;
    use crate::case::{Actuator, Kind};
    use crate::rig::catalog::{Scope, candidates};
    use crate::rig::corrections::{Correction, corrections};
    use crate::rig::parameters::{D_CYL_AT, D_CYL_BORE, D_CYL_STROKE, D_CYL_VT, GAIN, POLE_COULOMB, neutral};
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
        let signals = noises.iter().map(|(name, _)| *name).collect();
        let (kind, positions) = (Kind::Cartpole, (-0.05, 0.05));
        let scope = Scope { declared: &rig.declared, kind, signals, command: 40.0, positions };
        let candidates = candidates(&scope);
        let corrections = corrections(&scope, &BTreeMap::new());
        let free: Vec<Free> =
            corrections.iter().filter(|own| own.of_cylinder()).map(Correction::exact).collect();
        let null = Null::simulate(&rig, &[0, 1], &neutral(), &locals, 40, 1);
        let search = Search {
            system: &rig,
            candidates: &candidates,
            records: vec![0, 1],
            screened: vec![0, 1],
            null,
            rules: Rules::default(),
        };
        let declared = search.fit(&[], &[], &neutral(), &locals, 5);
        with_cylinder(&rig, &search, &declared, &free).is_some()
    }

    #[test]
    fn the_cylinder_takes_the_place_of_an_actuator_that_moving_records_contradict() {
        assert!(chosen(&[(CYLINDER, 1.0)], &ALL));
        assert!(chosen(&[(CYLINDER, 1.0), (POLE_COULOMB, 3e-3)], &ALL));
    }

    #[test]
    fn a_cylinder_of_other_dimensions_takes_its_place_as_well() {
        let other = [(D_CYL_BORE, 0.2), (D_CYL_STROKE, -0.15), (D_CYL_VT, 0.2), (D_CYL_AT, -0.2)];
        assert!(chosen(&[&[(CYLINDER, 1.0), (POLE_COULOMB, 3e-3)][..], &other].concat(), &ALL));
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
