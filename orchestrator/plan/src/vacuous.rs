//! Conditions on outputs that no motion moves: the force of a foot that is in the air, the impulse of an impact that
//! does not happen. They say that phases, modes and resets do not belong together, and are refused before a search.

use super::Error;
use super::file::{Place, Source};
use super::guess::Rough;
use super::prepare::Prepared;
use super::task::{Limit, Signal};
use airloop_ocp::transcription::{Dynamics, Point};

/// Parts of a phase at which outputs are differentiated.
const PARTS_OF_PHASE: [f64; 4] = [0.1, 0.4, 0.7, 0.95];
/// Distances from the guess, in nominal magnitudes: a saturated actuator or a dead band is flat in places only.
const DISTANCES_FROM_GUESS: [f64; 5] = [0.0, 1.0, -1.0, 10.0, -10.0];

/// Looks at the conditions at the ends of phases, and at the bounds of resets, along a guess.
///
/// # Errors
/// [`Error::File`] names phase and condition.
pub fn check(prepared: &mut Prepared, rough: &Rough) -> Result<(), Error> {
    let Prepared { setup, dynamics, resets, cycle } = prepared;
    let total: f64 = rough.durations.iter().sum();
    let mut begin = 0.0;
    for (number, (phase, dynamics)) in setup.task.phases.iter().zip(dynamics).enumerate() {
        let duration = rough.durations[number];
        let parts = PARTS_OF_PHASE.map(|part| (begin + part * duration) / total);
        begin += duration;
        let stated = &setup.statement.phases[number];
        let source = &setup.statement.source;
        let ends = [(&stated.initial, "initial"), (&stated.terminal, "final")];
        for ((conditions, end), limits) in ends.into_iter().zip(&phase.ends) {
            for limit in limits {
                let place = conditions.iter().find_map(|(name, _)| {
                    let (index, _) = setup.catalog.find(&name.text)?;
                    (setup.task.signals.of(index) == limit.terms.first().map(|term| term.0))
                        .then_some(name.place)
                });
                let remedy = "check the `parameters` of the phase, and to which phase the condition belongs";
                let told =
                    Told { source, place: place.unwrap_or(stated.place), end, remedy, phase: &phase.name };
                told.judge(limit, unmoved(dynamics.as_mut(), limit, rough, &parts))?;
            }
        }
        let jump = match number.checked_sub(1) {
            Some(before) => resets[before].as_mut(),
            None => cycle.as_mut().and_then(|cycle| cycle.jump.as_mut()),
        };
        if let (Some(jump), Some(reset)) = (jump, &stated.reset) {
            for (bound, limit) in reset.limits().zip(jump.stated()) {
                let remedy = "check the `parameters` of the reset";
                let told = Told { source, place: bound.place, end: "reset", remedy, phase: &phase.name };
                told.judge(&limit, unmoved(jump.dynamics(), &limit, rough, &parts))?;
            }
        }
    }
    Ok(())
}

/// The value of a limit on outputs alone that has no derivative anywhere; none where it has one, or cannot be
/// evaluated.
fn unmoved(dynamics: &mut dyn Dynamics, limit: &Limit, rough: &Rough, parts: &[f64]) -> Option<f64> {
    let size = dynamics.size();
    let (mut values, mut jacobian) = (vec![0.0; size.values()], vec![0.0; size.values() * size.arguments()]);
    let nominals = dynamics.nominals();
    let mut found = None;
    for (part, side) in parts.iter().flat_map(|part| DISTANCES_FROM_GUESS.map(|side| (*part, side))) {
        let (mut states, mut inputs) = (rough.states(part), rough.inputs(part));
        inputs.truncate(size.inputs);
        let all = states.iter_mut().chain(&mut inputs).zip(&nominals);
        all.enumerate().for_each(|(i, (value, nominal))| *value += side * nominal * (1.0 + i as f64).sin());
        let point = Point { time: 0.0, states: &states, inputs: &inputs };
        match dynamics.jacobian(point, &mut values, &mut jacobian) {
            Ok(()) => {}
            // What is refused away from the guess shows nothing.
            Err(_) if side != 0.0 => continue,
            Err(_) => return None,
        }
        let mut value = 0.0;
        for &(signal, factor) in &limit.terms {
            let Signal::Output(output) = signal else { return None };
            let row = size.states + output;
            if jacobian[row * size.arguments()..][..size.arguments()].iter().any(|slope| *slope != 0.0) {
                return None;
            }
            value += factor * values[row];
        }
        if found.is_some_and(|found| found != value) {
            return None;
        }
        found = Some(value);
    }
    found
}

/// Place of a condition, and the message about it.
struct Told<'a> {
    source: &'a Source,
    place: Place,
    phase: &'a str,
    end: &'a str,
    remedy: &'a str,
}

impl Told<'_> {
    fn judge(&self, limit: &Limit, value: Option<f64>) -> Result<(), Error> {
        let Some(value) = value else { return Ok(()) };
        let (lower, upper) = limit.limits;
        let unit = limit.unit.as_deref().map_or(String::new(), |unit| format!(" {unit}"));
        let so =
            if (lower..=upper).contains(&value) { "the condition is empty" } else { "it cannot be kept" };
        let Told { phase, end, remedy, .. } = self;
        let problem = format!(
            "phase `{phase}`, {end} `{}`: it is {value}{unit} whatever the motion, so {so}; {remedy}",
            limit.name
        );
        Err(self.source.error_at(self.place, problem))
    }
}
