//! Candidates of a study that are effects of one's own: at every attachment, or sensor, whose unit fits.

use std::sync::Arc;

use airloop_series::compound_unit;

use super::own::{self, Own, PortKind, VARIABLES};
use super::units;
use crate::engine::fit::Free;
use crate::study::catalog::Candidate;
use crate::study::declaration::Attachment;
use crate::study::kinds::CHANNELS;
use crate::study::law::{Law, Point};
use crate::study::model::{Action, Entry, Sensor, Study, Target};
use crate::study::names;
use crate::study::read::Record;
use crate::study::sensors;

/// Size from which on a state has run away.
const MAX_STATE: f64 = 1e12;
/// Ranges that parameters without bounds may take, in sizes of their start.
const MAX_CHANGE: f64 = 1e3;

/// Adds candidates for effects of one's own; `trace`: what the attachments show with the declared model,
/// `[records][taps][n]`.
///
/// Reports in [`Study::not_testable`] the effects that cannot be attached, have no value on the data or run away there.
pub fn fill(
    study: &mut Study,
    attachments: &[Attachment],
    effects: &[Arc<Own>],
    trace: &[(f64, Vec<Vec<Point>>)],
) {
    if effects.iter().any(|own| own.dissipative) {
        study.motion = trace.to_vec();
    }
    for own in effects {
        if own.port == PortKind::Sensor {
            at_sensors(study, own);
            continue;
        }
        let mut reasons = Vec::new();
        let mut places = 0;
        for (tap, attachment) in attachments.iter().enumerate() {
            let data =
                || trace.iter().map(|(step, taps)| (*step, taps.get(tap).map_or(&[][..], Vec::as_slice)));
            match fits(study, attachment, own).and_then(|()| on_data(own, data())) {
                Ok(starts) => {
                    at_port(study, attachment, tap, own, starts);
                    places += 1;
                }
                Err(why) => reasons.push(format!("at {}: {why}", attachment.input)),
            }
        }
        if places == 0 {
            let why =
                if reasons.is_empty() { "the study has no attachment".into() } else { reasons.join("; ") };
            study.not_testable.push((own.kind.clone(), why));
        } else {
            let told = reasons.iter().filter(|why| !why.contains("the port is in"));
            study.not_testable.extend(told.map(|why| (own.kind.clone(), why.clone())));
        }
    }
}

/// Whether the variables of an effect are known at an attachment, in units that fit.
fn fits(study: &Study, attachment: &Attachment, own: &Own) -> Result<(), String> {
    let signals = [attachment.position.as_ref(), attachment.velocity.as_ref(), Some(&attachment.input)];
    // The port first: where that is another one, nothing else matters.
    for (i, (signal, wanted)) in signals.into_iter().zip(&own.units).enumerate().rev() {
        if i != 2 && !own.uses(i) {
            continue;
        }
        let name = VARIABLES[i];
        let Some(signal) = signal else {
            let key = ["position", "velocity"][i];
            return Err(format!("the formula needs {name}; name its signal with `{key}`"));
        };
        let Some(unit) = names::unit_of(&study.graph, signal) else { continue };
        let what = if i == 2 { "the port".to_owned() } else { format!("{name} ({signal})") };
        same_unit(&what, &unit, wanted)?;
    }
    Ok(())
}

/// Whether a signal has the unit that an effect takes; `what` names it.
fn same_unit(what: &str, unit: &str, wanted: &str) -> Result<(), String> {
    let Some(known) = compound_unit::parse(unit) else {
        return Err(format!("unit `{unit}` of {what} is not known"));
    };
    if !units::dimension(&known).same(&units::coherent(wanted)?) {
        return Err(format!("{what} is in {unit}, the effect takes {wanted}"));
    }
    if (known.factor - 1.0).abs() > 1e-12 {
        return Err(format!("{what} is in {unit}; formulas are in SI units, {wanted}"));
    }
    Ok(())
}

/// Adds candidates for an effect at every sensor that it fits, or says why there is none.
fn at_sensors(study: &mut Study, own: &Arc<Own>) {
    let mut reasons = Vec::new();
    for output in 0..study.outputs.len() {
        let (name, unit) = (study.outputs[output].name.clone(), study.outputs[output].unit.clone());
        let points = |record: &Record| -> Vec<Point> {
            let one = |(k, &value): (usize, &f64)| Point {
                value,
                time: k as f64 * record.step,
                ..Point::default()
            };
            record.outputs[output].iter().enumerate().map(one).collect()
        };
        let trace: Vec<(f64, Vec<Point>)> =
            study.records.iter().map(|record| (record.step, points(record))).collect();
        let told = if sensors::told(study, output) { Ok(()) } else { Err(sensors::NOT_TOLD.to_owned()) };
        let found = same_unit("it", &unit, &own.units[2])
            .and(told)
            .and_then(|()| on_data(own, trace.iter().map(|(step, points)| (*step, &points[..]))));
        match found {
            Ok(starts) => {
                let place =
                    Place { channel: "sensor", port: study.outputs[output].port.clone(), signal: Some(name) };
                let action = |index| Action::Sensor { kind: Sensor::Own(index), output };
                push(study, place, action, own, starts);
            }
            Err(why) => reasons.push(format!("at {name}: {why}")),
        }
    }
    if reasons.len() == study.outputs.len() {
        study.not_testable.push((own.kind.clone(), reasons.join("; ")));
    }
}

/// Starts at which the effect has a value everywhere on the data and its states stay finite.
fn on_data<'t>(
    own: &Own,
    data: impl Iterator<Item = (f64, &'t [Point])> + Clone,
) -> Result<Vec<Vec<f64>>, String> {
    let mut problem = None;
    let mut good = Vec::new();
    for start in own.starts() {
        // Zero stands for what the linear step finds.
        let p: Vec<f64> = start
            .iter()
            .zip(&own.parameters)
            .map(|(value, own)| if own.linear { 1.0 } else { *value })
            .collect();
        match data.clone().find_map(|(step, points)| fault(own, &p, step, points)) {
            None => good.push(start),
            Some(one) => problem = Some(one),
        }
    }
    if good.is_empty() { Err(problem.unwrap_or_default()) } else { Ok(good) }
}

/// Where an effect has no value, or a state runs away.
fn fault(own: &Own, p: &[f64], step: f64, points: &[Point]) -> Option<String> {
    let mut z = vec![0.0; own.states.len()];
    for point in points {
        let at = [point.position, point.velocity, point.value, point.time];
        if !own.value(at, &z, p).is_finite() {
            if let own::Law::Fmu(law) = &own.law
                && let Some(problem) = law.problem()
            {
                return Some(problem);
            }
            let values = own.values(at, &z, p);
            let told =
                own.names().into_iter().zip(values).map(|(name, value)| format!("{name} = {value:.4}"));
            return Some(format!(
                "`{}` has no value at {}",
                own.formula,
                told.collect::<Vec<_>>().join(", ")
            ));
        }
        own.advance(at, &mut z, p, step);
        if let Some(i) = z.iter().position(|z| z.is_nan() || z.abs() >= MAX_STATE) {
            let (name, rate) = &own.states[i];
            return Some(format!(
                "state {name} with the rate `{rate}` runs away {:.4} s after the beginning of a record",
                point.time
            ));
        }
    }
    None
}

/// Adds the candidate of an attachment.
fn at_port(study: &mut Study, attachment: &Attachment, tap: usize, own: &Arc<Own>, starts: Vec<Vec<f64>>) {
    let channel =
        CHANNELS.into_iter().find(|channel| attachment.channels.first().is_some_and(|c| c == channel));
    let place = Place { channel: channel.unwrap_or(""), port: study.taps[tap].name.clone(), signal: None };
    push(study, place, |index| Action::Block { law: Law::Own(index), tap }, own, starts);
}

/// Where an effect acts, in the words of an answer.
struct Place {
    channel: &'static str,
    port: String,
    signal: Option<String>,
}

/// Adds one candidate; `action` of the place that the effect has in the study.
fn push(
    study: &mut Study,
    place: Place,
    action: impl Fn(usize) -> Action,
    own: &Arc<Own>,
    starts: Vec<Vec<f64>>,
) {
    let index = study.own.iter().position(|known| known == own).unwrap_or_else(|| {
        study.own.push(Arc::clone(own));
        study.own.len() - 1
    });
    let first = study.entries.len();
    for (k, parameter) in own.parameters.iter().enumerate() {
        let sizes = starts.iter().map(|start| start[k].abs());
        let (least, most) = sizes.fold((f64::INFINITY, 0.0), |(a, b), v| (f64::min(a, v), f64::max(b, v)));
        let (mut low, mut high) = parameter.bounds;
        // A shape that starts on one side of zero stays there.
        if !parameter.linear && least > 0.0 && starts.iter().all(|start| start[k] > 0.0) {
            (low, high) = (low.max(least / MAX_CHANGE), high.min(most * MAX_CHANGE));
        }
        let free = Free { index: first + k, bounds: (low, high), step: 1e-6, prior: None };
        let name = format!("{} {}", own.kind, parameter.name);
        study.entries.push(Entry {
            name,
            unit: parameter.unit.clone(),
            target: Target::Effect,
            start: 0.0,
            free,
        });
    }
    let entries = first..study.entries.len();
    study.candidates.push(Candidate {
        id: own.kind.clone(),
        channel: place.channel,
        port: place.port,
        twin: false,
        signal: place.signal,
        action: action(index),
        entries,
        starts,
        complexity: own.parameters.len().saturating_sub(1) + 2 * own.states.len(),
        probe: false,
        into: None,
        needs: None,
    });
}
