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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::case::{Actuator, CartPole, Declared, Friction};
    use crate::refine::engine::goodness::Null;
    use crate::refine::engine::noise::Noise;
    use crate::refine::rig::coupled::{Coupled, Trial};
    use crate::refine::rig::cylinder::{Chambers, Cylinder};
    use crate::refine::rig::parameters::{GAIN, POLE_COULOMB, neutral};
    use crate::refine::rig::record::Measured;

    /// Records of a rig with the effects of `values`; its declared actuator is what a fixed rod shows of the cylinder.
    fn rig(values: &[(usize, f64)], signals: &[&str]) -> Coupled {
        let declared = Declared {
            piston_friction: Some(Friction { c1: 1.5, c2: 40.0, c4: 50.0, ..Friction::default() }),
            cart_friction: Some(Friction { c1: 6.0, c2: 60.0, ..Friction::default() }),
            cart_pole: Some(CartPole { m_c: 0.4, m_p: 0.1, l: 0.2, g: 9.81, ..CartPole::default() }),
            ..Declared::default()
        };
        let actuator = Actuator {
            sample_time: 1e-3,
            A1: [[-1.0136, 0.027052], [-0.032284, -0.95853]],
            B0: [0.225645, -0.162456],
            B1: [-0.213883, 0.168954],
        };
        let n = 1200;
        let trial = |r: usize| {
            let w = 0.008 + 0.003 * r as f64;
            let u = (0..n).map(|k| 30.0 * (w * k as f64).sin() + 10.0 * (2.7 * w * k as f64).sin()).collect();
            let measured = signals.iter().map(|&name| {
                let noise = if name.starts_with('F') { 0.3 } else { 3e-4 };
                Measured::new(name, vec![0.0; n], noise)
            });
            Trial { u, measured: measured.collect(), estimation: true, fixed: false }
        };
        let cylinder = Chambers::new(&Cylinder::default());
        let mut rig = Coupled { declared, actuator, cylinder, trials: (0..2).map(trial).collect() };
        let mut p = neutral();
        values.iter().for_each(|&(index, value)| p[index] = value);
        for r in 0..2 {
            let shown = rig.predict(r, &p, &[0.0, 0.0]);
            let mut noise = Noise::new(11, r as u64);
            for (m, own) in rig.trials[r].measured.iter_mut().zip(shown.chunks(n)) {
                let values = own.iter().map(|value| value + m.noise * noise.normal()).collect();
                *m = Measured::new(&m.name, values, m.noise);
            }
        }
        rig
    }

    fn chosen(values: &[(usize, f64)], signals: &[&str]) -> bool {
        let rig = rig(values, signals);
        let locals = vec![vec![0.0, 0.0]; 2];
        let null = Null::simulate(&rig, &[0, 1], &neutral(), &locals, 40, 1);
        let search =
            Search { system: &rig, candidates: &[], records: vec![0, 1], screened: vec![0, 1], null };
        let declared = search.fit(&[], &[], &neutral(), &locals, 5);
        with_cylinder(&search, &declared).is_some()
    }

    const ALL: [&str; 4] = ["F_hat", "F_p", "x", "theta"];

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
        assert!(!chosen(&[(CYLINDER, 1.0)], &["x", "theta"]));
    }
}
