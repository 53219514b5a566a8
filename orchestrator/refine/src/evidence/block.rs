//! Curves of the effects of a study: each block over the variable that its law depends on, with the names of the
//! system.

use std::f64::consts::TAU;

use super::curve::{Curve, sampled};
use crate::answer::{Answer, Effect, Wiring};
use crate::study::law::{Law, Point, Variable};
use crate::study::model::{Action, Study, Tap};
use crate::study::ports::Kind;
use crate::vocabulary::Own;

/// Ordinate of the curve of a block.
enum Shown {
    /// Friction that is taken off the port, over a velocity.
    Friction,
    /// Part that is taken off the port.
    Taken,
    /// Part that is added to the port.
    Added,
    /// Level of the friction.
    Level,
    /// Friction after a reversal, over the way from there.
    Reversal,
    /// Value behind the port over that before it.
    Passed,
    /// Factor of the port.
    Factor,
}

/// Curves of the selected effects that are a function of one variable, over what the records `[records][taps][n]` moved
/// through.
pub fn of(study: &Study, answer: &Answer, records: &[Vec<Vec<Point>>]) -> Vec<Curve> {
    answer
        .effects
        .iter()
        .filter(|effect| effect.selected)
        .filter_map(|own| one(study, own, records))
        .collect()
}

fn one(study: &Study, effect: &Effect, records: &[Vec<Vec<Point>>]) -> Option<Curve> {
    let candidate = study.candidates.iter().find(|own| own.is(effect))?;
    let Action::Block { law, tap: index } = candidate.action else { return None };
    let (tap, wiring) = (&study.taps[index], effect.wiring.as_ref()?);
    let own = match law {
        Law::Own(index) => study.own.get(index).map(AsRef::as_ref),
        _ => None,
    };
    let (variable, shown) = axes(law, own)?;
    let values = records.iter().filter_map(|taps| taps.get(index)).flatten().map(|point| point.of(variable));
    let range = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let range = (range.0 < range.1).then_some(range)?;
    let names: Vec<&str> = effect.parameters.iter().map(|own| own.name.as_str()).collect();
    let at = |x: f64, p: &dyn Fn(&str) -> f64| {
        let p: Vec<f64> = names.iter().map(|name| p(name)).collect();
        value((law, own), wiring, &shown, x, &p)
    };
    Some(sampled(effect, abscissa(tap, variable), ordinate(tap, &shown), &at, range))
}

/// The variable that a law depends on, and what is shown over it; none where it is a constant, has a memory, or depends
/// on several.
fn axes(law: Law, own: Option<&Own>) -> Option<(Variable, Shown)> {
    use Variable::{Position, PressureForce, Time, Value, Velocity};
    Some(match law {
        Law::Viscous | Law::Coulomb | Law::Stribeck | Law::Asymmetry | Law::Drag => {
            (Velocity, Shown::Friction)
        }
        Law::Pressure => (PressureForce, Shown::Level),
        Law::PositionCoulomb | Law::PeriodicCoulomb => (Position, Shown::Level),
        Law::Load => (Value, Shown::Level),
        Law::Presliding => (Position, Shown::Reversal),
        Law::Spring | Law::EndStop | Law::LowerStop | Law::Cogging | Law::CubicSpring => {
            (Position, Shown::Added)
        }
        Law::Leakage | Law::Outlet | Law::Overflow | Law::CaughtOverflow | Law::Choked => {
            (Position, Shown::Taken)
        }
        Law::Drift => (Time, Shown::Added),
        Law::Gain | Law::DeadBand | Law::Saturation | Law::Limits => (Value, Shown::Passed),
        Law::PositionGain => (Position, Shown::Factor),
        Law::Droop => (Time, Shown::Factor),
        Law::Own(_) => {
            let own = own?;
            // In the order of `Point::variables`.
            let used: Vec<Variable> = [Position, Velocity, Value, Time]
                .into_iter()
                .enumerate()
                .filter_map(|(k, variable)| own.uses(k).then_some(variable))
                .collect();
            let shown = if own.port.replaces() { Shown::Passed } else { Shown::Taken };
            match used[..] {
                [variable] if own.states.is_empty() => (variable, shown),
                _ => return None,
            }
        }
        Law::Offset | Law::Area | Law::Bias | Law::Quantization => return None,
        Law::Memory(_) | Law::Shape(_) | Law::Surface(_) | Law::Caught(_) => return None,
    })
}

/// Value of the ordinate at `x` with parameters in the terms of the vocabulary. The sign of a port, by which its value
/// acts, is part of what is taken off or added there; friction is drawn along the motion.
fn value((law, own): (Law, Option<&Own>), wiring: &Wiring, shown: &Shown, x: f64, p: &[f64]) -> f64 {
    let formula = || own.map_or(0.0, |own| own.value([x; 4], &[], p));
    let taken = || match law {
        Law::Own(_) => formula(),
        Law::Spring => p[0] * (x - p[1]),
        Law::Cogging => wave(p, x),
        // At rest.
        _ => law.force(p, &Point { position: x, time: x, ..Point::default() }, 0.0, 0.0, 0.0),
    };
    match (law, shown) {
        (Law::Own(_), Shown::Passed) => formula(),
        (_, Shown::Friction) => {
            let peak = if law == Law::Stribeck { wiring.v0 } else { 0.0 };
            let at = Point { velocity: x - peak, ..Point::default() };
            law.force(p, &at, ((x - wiring.v0) / wiring.vt).tanh(), 0.0, 0.0)
        }
        (_, Shown::Taken) => wiring.sign * taken(),
        (_, Shown::Added) => -wiring.sign * taken(),
        (Law::PeriodicCoulomb, Shown::Level) => wave(p, x),
        (Law::Pressure | Law::Load, Shown::Level) => p[0] * x.abs(),
        (_, Shown::Level) => p[0] * x,
        // The first slip from rest.
        (_, Shown::Reversal) => wiring.level * (1.0 - (-x.abs() / p[0].max(1e-9)).exp()),
        (_, Shown::Passed) => law.command(p, &Point::default(), x),
        (_, Shown::Factor) => law.command(p, &Point { position: x, time: x, ..Point::default() }, 1.0),
    }
}

/// Amplitude, phase and period of the vocabulary as a wave.
fn wave(p: &[f64], x: f64) -> f64 {
    p[0] * (TAU * x / p[2] + p[1]).sin()
}

/// Name and unit of a variable.
fn abscissa(tap: &Tap, variable: Variable) -> (String, String) {
    let [value, velocity, position] = &tap.units;
    match variable {
        Variable::Velocity => (tap.words[0].clone(), velocity.clone()),
        Variable::Position => (tap.words[1].clone(), position.clone()),
        Variable::PressureForce => {
            (tap.attachment.pressure_force.clone().unwrap_or_else(|| "F".into()), "N".into())
        }
        Variable::Value => (tap.name.clone(), value.clone()),
        Variable::Time => ("time".into(), "s".into()),
    }
}

/// Whether a port is a voltage that drives a current.
fn is_electrical(tap: &Tap) -> bool {
    tap.attachment.port.is_some_and(|duty| duty.kind == Kind::Electrical)
}

/// Name and unit of the ordinate.
fn ordinate(tap: &Tap, shown: &Shown) -> (String, String) {
    let (name, unit) = (&tap.name, &tap.units[0]);
    match shown {
        Shown::Friction if is_electrical(tap) => (format!("voltage lost at {name}"), unit.clone()),
        Shown::Friction => (format!("friction at {name}"), unit.clone()),
        Shown::Taken => (format!("taken off {name}"), unit.clone()),
        Shown::Added => (format!("added to {name}"), unit.clone()),
        Shown::Level => (format!("Coulomb level at {name}"), unit.clone()),
        Shown::Reversal => (format!("friction at {name} after a reversal"), unit.clone()),
        Shown::Passed => (format!("{name} behind the effect"), unit.clone()),
        Shown::Factor => (format!("factor of {name}"), "1".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_what_the_block_of_the_law_does() {
        let by = |sign: f64, law: Law, x: f64, p: &[f64]| {
            let wiring = Wiring { vt: 0.01, v0: 0.2, level: 3.0, sign, ..Wiring::default() };
            let (_, shown) = axes(law, None).unwrap();
            value((law, None), &wiring, &shown, x, p)
        };
        let at = |law: Law, x: f64, p: &[f64]| by(1.0, law, x, p);
        // A spring of 20 N/m at rest at 0.1 m pulls back.
        assert!((at(Law::Spring, 0.3, &[20.0, 0.1]) + 4.0).abs() < 1e-12);
        // At a port whose larger value makes the velocity fall, that is a larger value.
        assert!((by(-1.0, Law::Spring, 0.3, &[20.0, 0.1]) - 4.0).abs() < 1e-12);
        assert!((by(-1.0, Law::Coulomb, 0.5, &[2.0]) - 2.0).abs() < 1e-12);
        // Far from the velocity of the sign change friction is its level.
        assert!((at(Law::Coulomb, 0.5, &[2.0]) - 2.0).abs() < 1e-12);
        assert_eq!(at(Law::Coulomb, 0.2, &[2.0]), 0.0);
        assert!((at(Law::EndStop, 0.3, &[100.0, 5.0, 0.2]) + 10.0).abs() < 1e-12);
        assert_eq!(at(Law::DeadBand, 2.0, &[0.5]), 1.5);
        assert_eq!(at(Law::PositionGain, 0.5, &[0.4]), 1.2);
        assert!((at(Law::Presliding, 1.0, &[1e-3]) - 3.0).abs() < 1e-12);
        assert!(axes(Law::Offset, None).is_none());
    }
}
