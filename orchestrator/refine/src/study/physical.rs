//! Models refused for lack of physical sense: friction that drives, and shapes that lie outside the range of the
//! records.

use super::fits::Model;
use super::law::{Law, Variable};
use super::model::{Action, Study};

/// Share of the samples from which on what pushes back is no end stop but a spring.
const MAX_CONTACT_SHARE: f64 = 0.4;

/// Share of the larger one by which limits of two directions differ; below it they are one limit.
const MIN_ASYMMETRY: f64 = 0.02;

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
            let (pos, upper) = (p[first + 2], law == Law::EndStop);
            let half = if upper { low + 0.5 * travel..=high } else { low..=low + 0.5 * travel };
            half.contains(&pos) && contact(study, tap, pos, upper) <= MAX_CONTACT_SHARE
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
        Law::Stribeck => p[first + 1] <= 0.5 * fastest.abs().max(slowest.abs()),
        Law::Presliding => travel <= 0.0 || p[first] <= 0.25 * travel,
        _ => true,
    }
}

/// Share of the samples in which the declared model lies behind a stop.
fn contact(study: &Study, tap: usize, pos: f64, upper: bool) -> f64 {
    let Some(positions) = study.positions.get(tap).filter(|own| !own.is_empty()) else { return 0.0 };
    let below = positions.partition_point(|&x| x < pos);
    let behind = if upper { positions.len() - below } else { below };
    behind as f64 / positions.len() as f64
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
