//! Models refused for lack of physical sense: friction that drives, and shapes that lie outside the range of the
//! records.

use super::fits::{Fits, Model};
use super::law::{Law, Variable};
use super::model::{Action, Study};
use super::ports::Kind;
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

/// Least force of an end stop's stiffness over the whole travel, over that of its damping at the largest speed.
const MIN_PUSH: f64 = 0.01;
/// Share of the largest velocity over which Coulomb friction may change its sign.
const MAX_SIGN_CHANGE: f64 = 0.2;

/// Share of the travel that a period may take, and of the largest velocity that a friction peak may.
const MAX_SHARE_OF_RANGE: f64 = 0.5;

/// Share of the duration of the longest record over which a value may fall and not be lower from the beginning on.
const MIN_SHARE_OF_DURATION: f64 = 0.02;

/// Share of the travel that lies below the level of an overflow at least: one at the lowest level is a leak.
const MIN_SHARE_BELOW_LEVEL: f64 = 0.02;

/// Share of the travel over which friction may give way before it slides.
const MAX_PRESLIDING: f64 = 0.25;

/// Share of the Coulomb level by which friction that depends on the position may be negative.
const MAX_NEGATIVE_FRICTION: f64 = 0.05;

/// Whether a model may stand while it grows: those before the candidate added last are exchanged in the end.
pub fn fitting(study: &Study, model: &Model) -> bool {
    drives(study, model).is_none() && model.added.last().is_none_or(|&c| hidden(study, model, c).is_none())
}

/// Whether a model may be an answer.
pub fn physical(study: &Study, model: &Model) -> bool {
    contradiction(study, model).is_none()
}

/// Why a model may be no answer, if it may not: the candidate, and what speaks against it.
pub fn contradiction(study: &Study, model: &Model) -> Option<(usize, String)> {
    let shape = || model.added.iter().find_map(|&c| Some((c, hidden(study, model, c)?)));
    drives(study, model).or_else(shape)
}

/// Why the shape of a candidate does not show in the records, if it does not. Far from where the records were, a spring
/// is a constant force, so is an end stop, a long wave is a spring, a wide friction peak is Coulomb friction.
fn hidden(study: &Study, model: &Model, c: usize) -> Option<String> {
    let (p, own) = (&model.fit.parameters, &study.candidates[c]);
    let Action::Block { law, tap } = own.action else {
        let beyond = own.id == "sensor.gain" && p[own.entries.start].abs() > MAX_SENSOR_GAIN;
        return beyond.then(|| "a sensor is not off by half of what it shows".into());
    };
    let p = &p[own.entries.clone()];
    let [_, per_second, unit] = &study.taps[tap].units;
    let (low, high) = study.range(tap, Variable::Position);
    let travel = high - low;
    let (slowest, fastest) = study.range(tap, Variable::Velocity);
    let speed = fastest.abs().max(slowest.abs());
    let value = study.range(tap, Variable::Value);
    let against = |shown: bool, what: String| (!shown).then_some(what);
    let pulls = || against(p[0] > 0.0, "it would push away from where it rests".into());
    let positions = || format!("the positions of the records, {} to {} {unit}", short(low), short(high));
    match law {
        Law::Spring => {
            let rest = -p[1] / p[0];
            let near = (low - travel..=high + travel).contains(&rest);
            pulls().or_else(|| {
                against(near, format!("it would rest at {} {unit}, far from {}", short(rest), positions()))
            })
        }
        Law::EndStop | Law::LowerStop => against(
            reached(study, model, tap, Stop { at: p[2], upper: law == Law::EndStop }),
            format!("at {} {unit} it would not end the motion: {}", short(p[2]), positions()),
        )
        .or_else(|| against(p[0] * travel > MIN_PUSH * p[1] * speed, "it would not push back".into())),
        Law::Limits => {
            let (below, above) = (p[0], p[1]);
            let apart = (below + above).abs() > MIN_ASYMMETRY * below.abs().max(above.abs());
            against(below < above, "its lower limit lies above the upper one".into())
                .or_else(|| against(apart, "its two limits are one".into()))
        }
        Law::Choked => against(p[0] > 0.0, "flow would run backward".into()).or_else(|| {
            against(p[1] <= high, format!("no record comes to {} {unit}, where it begins", short(p[1])))
        }),
        Law::CubicSpring => pulls().or_else(|| {
            let within = (low..=high).contains(&p[1]);
            against(within, format!("it would rest at {} {unit}, outside of {}", short(p[1]), positions()))
        }),
        // One above all levels does nothing, so its gain tells; the scale of a level that no sensor shows is open.
        Law::Overflow | Law::CaughtOverflow => against(p[0] > 0.0, "it would flow in".into()).or_else(|| {
            let above = |(low, high): (f64, f64)| p[1] >= low + MIN_SHARE_BELOW_LEVEL * (high - low);
            let within = above((low, high)) || above(range_of(&positions_with(study, model, tap)));
            against(within, format!("at {} {unit} it lies below {}", short(p[1]), positions()))
        }),
        Law::Coulomb | Law::Load if p.len() == 2 => against(
            p[1] <= MAX_SIGN_CHANGE * speed,
            format!(
                "its sign would change over {} of {} {per_second}: that is {}",
                short(p[1]),
                short(speed),
                match study.taps[tap].attachment.port.map(|duty| duty.kind) {
                    Some(Kind::Electrical) => "a resistance",
                    _ => "viscous friction",
                }
            ),
        ),
        // One below -1 is a wrong sign, no gain.
        Law::Gain => against(p[0] > -1.0, "it would turn the sign of what passes".into()),
        // Beside an offset of the list the two compete, and a tie shows that these records cannot tell them apart.
        Law::DeadBand => {
            let (low, high) = study.recorded(tap).unwrap_or(value);
            let entered = low <= p[0] && -p[0] <= high;
            against(entered || has_offset(study, tap), "no value lies in it: that is an offset".into())
        }
        Law::Droop => {
            let duration = study.range(tap, Variable::Time).1;
            let slow = p[1] >= MIN_SHARE_OF_DURATION * duration;
            against(
                slow,
                format!("it would fall over {} s of {} s: that is a gain", short(p[1]), short(duration)),
            )
        }
        Law::Cogging | Law::PeriodicCoulomb => against(
            p[2] <= MAX_SHARE_OF_RANGE * travel,
            format!(
                "its period of {} {unit} is more than half of the travel of {} {unit}",
                short(p[2]),
                short(travel)
            ),
        ),
        // An offset larger than any value that passed is another model of what it passes into.
        Law::Bias => {
            let (low, high) = value;
            let within = high <= low || p[0].abs() <= high.max(-low);
            against(within, "it is larger than all values that passed".into())
        }
        // Coarser steps of a force look like a friction that holds.
        Law::Quantization => {
            let (low, high) = value;
            let fine = high <= low || MIN_STEPS_OF_A_RANGE * p[0] <= high - low;
            against(fine, "its steps are more than a tenth of the range of the values".into())
        }
        Law::Stribeck => against(
            p[1] <= MAX_SHARE_OF_RANGE * speed,
            format!("a peak over {} of {} {per_second} is Coulomb friction", short(p[1]), short(speed)),
        ),
        Law::Presliding => against(
            travel <= 0.0 || p[0] <= MAX_PRESLIDING * travel,
            format!("it would give way over {} of {} {unit}: that is a spring", short(p[0]), short(travel)),
        ),
        Law::Own(index) => {
            let effect = &study.own[index];
            let takes = !effect.dissipative || takes_energy(study, effect, tap, p);
            against(takes, "it would give energy over the records, and is declared to take some".into())
        }
        _ => None,
    }
}

/// Whether the vocabulary has an offset at an attachment.
fn has_offset(study: &Study, tap: usize) -> bool {
    let is_offset = |law: Law| matches!(law, Law::Bias | Law::Offset);
    let here = |own: &Action| matches!(*own, Action::Block { law, tap: at } if at == tap && is_offset(law));
    study.candidates.iter().any(|own| here(&own.action))
}

/// A number with four decimals, or in powers of ten where these say little or too much.
fn short(value: f64) -> String {
    let plain = value == 0.0 || (1e-3..1e5).contains(&value.abs());
    if plain { format!("{value:.4}") } else { format!("{value:.3e}") }
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
        let (low, high) = range_of(positions);
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
    stop.ends(&positions_with(study, model, tap))
}

/// Positions at a tap with a model: where no sensor shows them, not those of the declared one.
fn positions_with(study: &Study, model: &Model, tap: usize) -> Vec<f64> {
    let traces = Fits::new(study, vec![1.0; study.outputs.len()]).trace(&model.added, &model.fit);
    let points = traces.iter().filter_map(|(_, taps)| taps.get(tap)).flatten();
    points.map(|point| point.position).collect()
}

/// Least and largest of some values.
fn range_of(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)))
}

/// Which friction of a fitted model would drive somewhere in the range of the records, if any, and where.
fn drives(study: &Study, model: &Model) -> Option<(usize, String)> {
    let p = &model.fit.parameters;
    (0..study.taps.len()).find_map(|tap| {
        let strength = |law: Law| {
            let here = |c: &&usize| study.candidates[**c].action == Action::Block { law, tap };
            let &c = model.added.iter().find(here)?;
            Some((p[study.candidates[c].entries.start], c))
        };
        let declared = study.taps[tap].coulomb.map_or(0.0, |level| level.of(p));
        let coulomb = declared + strength(Law::Coulomb).map_or(0.0, |own| own.0);
        // One direction may have less friction, not none; without Coulomb friction a force for one direction is a bias.
        if let Some((forwards, c)) = strength(Law::Asymmetry)
            && coulomb + forwards < 0.0
        {
            return Some((c, "friction would drive in one direction".into()));
        }
        if let Some((_, c)) = strength(Law::PeriodicCoulomb) {
            let own = study.candidates[c].entries.start;
            let least = coulomb - p[own].hypot(p[own + 1]);
            if least < -MAX_NEGATIVE_FRICTION * coulomb.abs() {
                return Some((c, "friction would drive where it is least".into()));
            }
        }
        let (slope, c) = strength(Law::PositionCoulomb)?;
        let [_, (low, high), ..] = study.ranges.get(tap)?;
        let least = -MAX_NEGATIVE_FRICTION * coulomb.abs();
        let at = [low, high].into_iter().find(|x| coulomb + slope * **x < least)?;
        Some((c, format!("friction would drive at {} {}", short(*at), study.taps[tap].units[2])))
    })
}
