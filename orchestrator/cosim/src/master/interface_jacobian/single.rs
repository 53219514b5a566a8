//! A component outside all cycles: it steps once its sources have stepped.
//!
//! A sampled component takes each of its samples in a step of its own, so that what it feeds sees every value.

use super::signal::{SAME_TIME, line_of};
use super::unit::{Feed, Outputs, Unit};
use crate::master::Values;
use crate::master::exchange::Node;
use crate::master::stop::{Stop, get_outputs};

/// Steps `unit` from `t` to `t + h` \[s\]; `start` is the time of its first sample, `cuts` a workspace.
pub(super) fn step(
    unit: &mut Unit,
    node: &mut Node,
    outputs: &mut Outputs,
    values: &mut Values,
    (start, t, h): (f64, f64, f64),
    cuts: &mut Vec<f64>,
) -> Result<(), Stop> {
    node.set_non_reals(values)?;
    lay_out(unit, outputs, (start, t, h), cuts);
    for k in unit.outputs.clone() {
        outputs.signals[k].clear();
    }
    for piece in 0..cuts.len() - 1 {
        let (begin, end) = (cuts[piece], cuts[piece + 1]);
        let length = (end - begin) * h;
        let jumped = set_trajectory(unit, outputs, values, (begin, end), length);
        let places = unit.outputs.clone();
        unit.advance(node, t + begin * h, length, false)?;
        for (before, k) in unit.before.iter_mut().zip(places.clone()) {
            *before = [outputs.y[k], outputs.rate[k]];
        }
        unit.read(node, &mut outputs.y[places.clone()], &mut outputs.rate[places.clone()])?;
        for ((k, &discrete), &[y0, rate0]) in places.zip(&unit.discrete).zip(&unit.before) {
            let (y, rate) = (outputs.y[k], outputs.rate[k]);
            let signal = &mut outputs.signals[k];
            if discrete {
                signal.hold(begin, end, y);
                continue;
            }
            if unit.is_static && jumped {
                signal.line(begin, end, y - if unit.rates { rate * length } else { 0.0 }, y);
            } else if unit.rates && !unit.is_static {
                signal.hermite((begin, end), [y0, rate0], [y, rate], length);
            } else {
                signal.line(begin, end, y0, y);
                if !unit.rates {
                    outputs.rate[k] = (y - y0) / length;
                }
            }
        }
    }
    get_outputs(node, unit.number, values)
}

/// Times at which the unit has to stop: its own samples, and for a static unit the jumps of its inputs.
fn lay_out(unit: &Unit, outputs: &Outputs, (start, t, h): (f64, f64, f64), cuts: &mut Vec<f64>) {
    cuts.clear();
    cuts.push(0.0);
    if let Some(sample) = unit.sample {
        let slack = 1e-6;
        let mut k = ((t - start) / sample + slack).floor() + 1.0;
        while start + k * sample < t + h - slack * sample.min(h) && cuts.len() + 1 < cuts.capacity() {
            cuts.push((start + k * sample - t) / h);
            k += 1.0;
        }
    } else if unit.is_static && !unit.fixed_step {
        for input in &unit.inputs {
            let Feed::Signal(output) = input.feed else { continue };
            for at in outputs.signals[output].breaks() {
                if cuts.len() + 1 < cuts.capacity() && cuts.iter().all(|cut| (cut - at).abs() > SAME_TIME) {
                    cuts.push(at);
                }
            }
        }
        cuts.sort_unstable_by(f64::total_cmp);
    }
    cuts.push(1.0);
}

/// Puts the inputs of the piece into the unit; true if one of them jumps where the piece begins.
fn set_trajectory(
    unit: &mut Unit,
    outputs: &Outputs,
    values: &Values,
    (begin, end): (f64, f64),
    length: f64,
) -> bool {
    let mut jumped = false;
    for (k, input) in unit.inputs.iter().enumerate() {
        let at = |r, right| input.conversion.apply(input.feed.at(outputs, values, r, right));
        let [from, rise] = if unit.is_static || unit.sample.is_some() {
            let (from, to) = (at(begin, true), at(end, false));
            [from, to - from]
        } else {
            let [from, rise] = line_of(input.feed.moments(outputs, values, begin, end));
            [input.conversion.apply(from), input.conversion.factor * rise]
        };
        jumped |= (from - unit.u[k]).abs() > SAME_TIME * (from.abs() + unit.u[k].abs());
        (unit.value[k], unit.slope[k]) = match (unit.ramps, unit.is_static, unit.sample) {
            (true, ..) => (from, rise / length),
            (false, true, _) => (from + rise, 0.0),
            (false, false, Some(_)) => (from, 0.0),
            (false, false, None) => (from + rise / 2.0, 0.0),
        };
    }
    jumped
}
