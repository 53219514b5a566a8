//! Models refused for lack of physical sense: friction that drives, and shapes that lie outside the range of the
//! records.

use super::fits::{Fits, Model};
use super::law::{Law, Variable};
use super::model::{Action, Study};
use crate::vocabulary::Own;

/// Share of the samples from which on what pushes back is no end stop but a spring.
const MAX_CONTACT_SHARE: f64 = 0.4;

/// Share of the larger one by which limits of two directions differ; below it they are one limit.
const MIN_ASYMMETRY: f64 = 0.02;

/// Share of the energy that passes an effect which it may give back in the end and still be said to take some.
const MAX_RETURNED_ENERGY: f64 = 1e-3;

/// Fewest steps of the range of a value that comes in steps.
const MIN_STEPS_OF_A_RANGE: f64 = 10.0;

/// Largest gain error of a sensor.
const MAX_SENSOR_GAIN: f64 = 0.5;

/// Whether a model may stand while it grows: those before the candidate added last are exchanged in the end.
pub fn fitting(study: &Study, model: &Model) -> bool {
    passive(study, model) && model.added.last().is_none_or(|&c| shown(study, model, c))
}

/// Whether a model may be an answer.
pub fn physical(study: &Study, model: &Model) -> bool {
    passive(study, model) && model.added.iter().all(|&c| shown(study, model, c))
}

/// Whether the shape of a candidate shows in the records. Far from where the records were, a spring is a constant
/// force, so is an end stop, a long wave is a spring, a wide friction peak is Coulomb friction.
fn shown(study: &Study, model: &Model, c: usize) -> bool {
    let (p, own) = (&model.fit.parameters, &study.candidates[c]);
    let Action::Block { law, tap } = own.action else {
        return own.id != "sensor.gain" || p[own.entries.start].abs() <= MAX_SENSOR_GAIN;
    };
    let (low, high) = study.range(tap, Variable::Position);
    let (travel, first) = (high - low, own.entries.start);
    let (slowest, fastest) = study.range(tap, Variable::Velocity);
    match law {
        Law::Spring => {
            let rest = -p[first + 1] / p[first];
            p[first] > 0.0 && (low - travel..=high + travel).contains(&rest)
        }
        Law::EndStop | Law::LowerStop => {
            reached(study, model, tap, Stop { at: p[first + 2], upper: law == Law::EndStop })
        }
        Law::Limits => {
            let (below, above) = (p[first], p[first + 1]);
            below < above && (below + above).abs() > MIN_ASYMMETRY * below.abs().max(above.abs())
        }
        Law::Choked => p[first] > 0.0 && p[first + 1] <= high,
        Law::CubicSpring => p[first] > 0.0 && (low..=high).contains(&p[first + 1]),
        // One above all levels does nothing, so its gain tells; the scale of a level that no sensor shows is open.
        Law::Overflow => p[first] > 0.0 && p[first + 1] >= low,
        Law::Coulomb if own.entries.len() == 2 => p[first + 1] <= 0.2 * fastest.abs().max(slowest.abs()),
        // One below -1 is a wrong sign, no gain.
        Law::Gain => p[first] > -1.0,
        Law::Cogging => p[first + 2] <= 0.5 * travel,
        // An offset larger than any value that passed is another model of what it passes into.
        Law::Bias => {
            let (low, high) = study.range(tap, Variable::Value);
            high <= low || p[first].abs() <= high.max(-low)
        }
        // Coarser steps of a force look like a friction that holds.
        Law::Quantization => {
            let (low, high) = study.range(tap, Variable::Value);
            high <= low || MIN_STEPS_OF_A_RANGE * p[first] <= high - low
        }
        Law::Stribeck => p[first + 1] <= 0.5 * fastest.abs().max(slowest.abs()),
        Law::Presliding => travel <= 0.0 || p[first] <= 0.25 * travel,
        Law::Own(index) => {
            let effect = &study.own[index];
            !effect.dissipative || takes_energy(study, effect, tap, &p[own.entries.clone()])
        }
        _ => true,
    }
}

/// Whether an effect takes energy over all records, on the motion of the declared model.
fn takes_energy(study: &Study, effect: &Own, tap: usize, p: &[f64]) -> bool {
    let mut z = vec![0.0; effect.states.len()];
    let (mut taken, mut moved) = (0.0, 0.0);
    for (step, taps) in &study.motion {
        z.fill(0.0);
        for point in taps.get(tap).into_iter().flatten() {
            let power = effect.value(point.variables(), &z, p) * point.velocity * step;
            (taken, moved) = (taken + power, moved + power.abs());
            effect.advance(point.variables(), &mut z, p, *step);
        }
    }
    taken >= -MAX_RETURNED_ENERGY * moved
}

/// An end stop.
#[derive(Debug, Clone, Copy)]
struct Stop {
    at: f64,
    /// Whether it holds back what moves up.
    upper: bool,
}

impl Stop {
    /// Whether it lies in its half of the travel and most positions are before it.
    fn ends(self, positions: &[f64]) -> bool {
        let beyond = |x: f64| if self.upper { x >= self.at } else { x <= self.at };
        let low = positions.iter().copied().fold(f64::INFINITY, f64::min);
        let high = positions.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let middle = 0.5 * (low + high);
        let half = if self.upper { middle..=high } else { low..=middle };
        let behind = positions.iter().filter(|&&x| beyond(x)).count();
        half.contains(&self.at) && behind as f64 <= MAX_CONTACT_SHARE * positions.len() as f64
    }
}

/// Whether a stop ends the motion: that of the declared model, which nothing holds back there, or that with the stop.
fn reached(study: &Study, model: &Model, tap: usize, stop: Stop) -> bool {
    if study.positions.get(tap).is_some_and(|own| stop.ends(own)) {
        return true;
    }
    let traces = Fits::new(study, vec![1.0; study.outputs.len()]).trace(&model.added, &model.fit);
    let points = traces.iter().filter_map(|(_, taps)| taps.get(tap)).flatten();
    stop.ends(&points.map(|point| point.position).collect::<Vec<f64>>())
}

/// Whether a fitted model takes energy out where friction should, over the whole range of the records.
fn passive(study: &Study, model: &Model) -> bool {
    let p = &model.fit.parameters;
    (0..study.taps.len()).all(|tap| {
        let strength = |law: Law| {
            let own = model.added.iter().map(|&c| &study.candidates[c]);
            let found = own.filter(|c| c.action == Action::Block { law, tap }).map(|c| c.entries.start);
            found.map(|index| (p[index], index)).next()
        };
        let declared = study.taps[tap].coulomb.map_or(0.0, |level| level.of(p));
        let coulomb = declared + strength(Law::Coulomb).map_or(0.0, |s| s.0);
        let asymmetry = strength(Law::Asymmetry);
        let forwards = asymmetry.map_or(0.0, |(force, _)| force);
        // One direction may have less friction, not none; without Coulomb friction a force for one direction is a bias.
        if asymmetry.is_some() && coulomb + forwards < 0.0 {
            return false;
        }
        match strength(Law::PositionCoulomb) {
            None => true,
            Some((slope, _)) => study.ranges.get(tap).is_none_or(|range| {
                [range[1].0, range[1].1].iter().all(|x| coulomb + slope * x >= -0.05 * coulomb.abs())
            }),
        }
    })
}
