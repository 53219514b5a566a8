//! Candidates of a study: the effects of the vocabulary that can act at its attachments, on its commands and sensors.

use std::ops::Range;

use super::command::Command;
use super::declaration::Attachment;
use super::law::{KNOTS, Law, Variable};
use super::model::{Action, Entry, Sensor, Study, Target};
use super::simulate::Survey;
use crate::engine::fit::Free;

/// A candidate.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Id of the vocabulary, or name of an effect of one's own.
    pub id: String,
    /// Channel.
    pub channel: &'static str,
    /// Measured signal of a sensor effect.
    pub signal: Option<String>,
    /// What it does.
    pub action: Action,
    /// Its entries of the parameter vector.
    pub entries: Range<usize>,
    /// Points to start from: values of its entries. Zeros are found by the linear step.
    pub starts: Vec<Vec<f64>>,
    /// How much it assumes: memoryless and linear 0, with a shape or a memory more.
    pub complexity: usize,
    /// A free form that shows on what depends what is left; never part of an answer.
    pub probe: bool,
    /// It changes the Coulomb level of its attachment: without one in the declared model it needs this other one.
    pub needs: Option<usize>,
}

impl Candidate {
    /// Unique name.
    pub fn name(&self) -> String {
        self.signal.as_ref().map_or_else(|| self.id.clone(), |signal| format!("{}({signal})", self.id))
    }
}

/// An effect of a channel: id, law, names with units, which of its parameters must not be negative.
struct Kind {
    id: &'static str,
    law: Law,
    parameters: &'static [(&'static str, &'static str)],
    positive: &'static [usize],
}

const fn kind(
    id: &'static str,
    law: Law,
    parameters: &'static [(&'static str, &'static str)],
    positive: &'static [usize],
) -> Kind {
    Kind { id, law, parameters, positive }
}

const PISTON: [Kind; 7] = [
    kind("pf.viscous", Law::Viscous, &[("coef", "N s/m")], &[0]),
    kind("pf.coulomb", Law::Coulomb, &[("force", "N")], &[0]),
    kind("pf.stribeck", Law::Stribeck, &[("force", "N"), ("vs", "m/s")], &[0, 1]),
    kind("pf.presliding", Law::Presliding, &[("disp", "m")], &[0]),
    kind("pf.pressure", Law::Pressure, &[("coef", "1")], &[0]),
    kind("pf.offset", Law::Offset, &[("value", "N")], &[]),
    kind("pf.asymmetry", Law::Asymmetry, &[("force", "N"), ("coef", "N s/m")], &[]),
];

const CART_FRICTION: [Kind; 7] = [
    kind("cf.viscous", Law::Viscous, &[("coef", "N s/m")], &[0]),
    kind("cf.coulomb", Law::Coulomb, &[("force", "N")], &[0]),
    kind("cf.stribeck", Law::Stribeck, &[("force", "N"), ("vs", "m/s")], &[0, 1]),
    kind("cf.presliding", Law::Presliding, &[("disp", "m")], &[0]),
    kind("cf.offset", Law::Offset, &[("value", "N")], &[]),
    kind("cf.asymmetry", Law::Asymmetry, &[("force", "N"), ("coef", "N s/m")], &[]),
    kind("cf.poscoulomb", Law::PositionCoulomb, &[("slope", "N/m")], &[]),
];

const CART: [Kind; 3] = [
    kind("cart.spring", Law::Spring, &[("stiffness", "N/m"), ("rest", "m")], &[0]),
    kind("cart.endstop", Law::EndStop, &[("stiffness", "N/m"), ("damping", "N s/m"), ("pos", "m")], &[0, 1]),
    kind("cart.cogging", Law::Cogging, &[("amp", "N"), ("phase", "rad"), ("period", "m")], &[2]),
];

const POLE: [Kind; 3] = [
    kind("pole.viscous", Law::Viscous, &[("coef", "N m s/rad")], &[0]),
    kind("pole.coulomb", Law::Coulomb, &[("torque", "N m")], &[0]),
    kind("pole.quaddrag", Law::Drag, &[("coef", "N m s^2/rad^2")], &[0]),
];

const ACTUATOR: [Kind; 6] = [
    kind("act.area", Law::Area, &[("coef", "m2")], &[]),
    kind("act.gain", Law::Gain, &[("gain", "1")], &[]),
    kind("act.deadband", Law::DeadBand, &[("width", "N")], &[0]),
    kind("act.saturation", Law::Saturation, &[("limit", "N")], &[0]),
    kind("act.posgain", Law::PositionGain, &[("slope", "1/m")], &[]),
    kind("act.droop", Law::Droop, &[("depth", "1"), ("tau", "s")], &[1]),
];

/// An effect on a command, with a memory: id, kind, names with units.
type Memory = (&'static str, Command, &'static [(&'static str, &'static str)]);

const COMMANDS: [Memory; 3] = [
    ("act.delay", Command::Delay, &[("delay", "s")]),
    ("act.hysteresis", Command::Hysteresis, &[("width", "N")]),
    ("act.mode", Command::Mode, &[("freq", "Hz"), ("zeta", "1")]),
];

/// Channels of the vocabulary that attachments may name.
pub const CHANNELS: [&str; 5] = ["actuator", "piston_friction", "cart_friction", "cart", "pole"];

fn kinds(channel: &str) -> (&'static str, &'static [Kind]) {
    match channel {
        "piston_friction" => ("piston_friction", &PISTON),
        "cart_friction" => ("cart_friction", &CART_FRICTION),
        "cart" => ("cart", &CART),
        "pole" => ("pole", &POLE),
        _ => ("actuator", &ACTUATOR),
    }
}

/// Ids of the vocabulary that an attachment with these channels can have.
pub fn ids(channels: &[String]) -> Vec<&'static str> {
    let commands = channels.iter().any(|c| c == "actuator").then_some(COMMANDS.map(|c| c.0));
    let blocks = channels.iter().flat_map(|channel| kinds(channel).1.iter().map(|kind| kind.id));
    blocks.chain(commands.into_iter().flatten()).collect()
}

/// Points to start from, zeros where the linear step finds the value; none: the records do not excite it.
fn starts(law: Law, ranges: &[(f64, f64); 5]) -> Result<Vec<Vec<f64>>, &'static str> {
    let [velocity, position, pressure_force, pressure, value] = *ranges;
    let width = |range: (f64, f64)| range.1 - range.0;
    let size = |range: (f64, f64)| range.0.abs().max(range.1.abs());
    let (v, x) = (size(velocity), width(position));
    let needs_motion = "nothing moves in the estimation records, or no velocity is known at the attachment";
    let needs_position =
        "the position does not change in the estimation records, or none is known at the attachment";
    match law {
        Law::Viscous | Law::Coulomb | Law::Drag | Law::Asymmetry | Law::Stribeck | Law::Presliding
            if v <= 0.0 =>
        {
            return Err(needs_motion);
        }
        Law::PositionCoulomb | Law::Cogging if v <= 0.0 || x <= 0.0 => return Err(needs_position),
        Law::Spring | Law::EndStop | Law::PositionGain if x <= 0.0 => return Err(needs_position),
        Law::Pressure if v <= 0.0 || width(pressure_force) <= 0.1 * size(pressure_force) => {
            return Err("the pressure force hardly changes, or none is known at the attachment");
        }
        Law::Area if width(pressure) <= 0.1 * size(pressure) => {
            return Err("the pressure hardly changes, or none is known at the attachment");
        }
        Law::Gain | Law::DeadBand | Law::Saturation | Law::Droop if width(value) <= 0.0 => {
            return Err("the command does not change");
        }
        _ => {}
    }
    Ok(match law {
        Law::Stribeck => [0.02, 0.06, 0.2].map(|part| vec![0.0, part * v]).into(),
        Law::Presliding => {
            let travel = if x > 0.0 { x } else { v };
            [1e-4, 1e-3, 5e-3, 2e-2].map(|part| vec![part * travel]).into()
        }
        Law::Droop => [0.3, 1.0, 3.0].map(|tau| vec![0.0, tau]).into(),
        Law::DeadBand => [0.02, 0.1].map(|part| vec![part * size(value)]).into(),
        Law::Saturation => [0.95, 0.8, 0.6].map(|part| vec![part * size(value)]).into(),
        Law::EndStop => {
            let inside = [0.5, 0.7, 0.82, 0.9, 0.96];
            inside.map(|part| vec![0.0, 0.0, position.0 + part * x]).into()
        }
        Law::Cogging => {
            // Neighbours differ by a third of a turn over the travel.
            let mut grid = Vec::new();
            let mut period = x;
            while period > x / 25.0 {
                grid.push(vec![0.0, 0.0, period]);
                period = 1.0 / (1.0 / period + 0.35 / x);
            }
            grid
        }
        law => vec![vec![0.0; law.parameters()]],
    })
}

/// What the declared model has already with a free coefficient: the candidate would change nothing.
fn declared_twin(attachment: &Attachment, law: Law, free: &dyn Fn(&Option<String>) -> bool) -> bool {
    match law {
        Law::Viscous => free(&attachment.viscous),
        Law::Coulomb => free(&attachment.coulomb),
        Law::Offset => free(&attachment.bias),
        _ => false,
    }
}

/// Adds the candidates of a study after its declared model was simulated.
pub fn fill(
    study: &mut Study,
    attachments: &[Attachment],
    survey: &Survey,
    fed: &dyn Fn(&str) -> Option<usize>,
) {
    let empty = [(0.0, 0.0); 5];
    for (tap, attachment) in attachments.iter().enumerate() {
        let ranges = survey.ranges.get(tap).copied().unwrap_or(empty);
        let wanted = |id: &str| attachment.effects.as_ref().is_none_or(|list| list.iter().any(|e| e == id));
        for channel in &attachment.channels {
            let (channel, list) = kinds(channel);
            for kind in list.iter().filter(|kind| wanted(kind.id)) {
                let names: Vec<String> =
                    study.entries[..study.declared].iter().map(|entry| entry.name.clone()).collect();
                let free = |name: &Option<String>| name.as_ref().is_some_and(|name| names.contains(name));
                if declared_twin(attachment, kind.law, &free) {
                    continue;
                }
                // Behind a command only its own effects, before a force only those with a force law.
                let command = fed(&attachment.input).is_some() && channel == "actuator";
                if kind.law.changes_command() && !command {
                    continue;
                }
                match starts(kind.law, &ranges) {
                    Err(why) => study.not_testable.push((kind.id.into(), why.into())),
                    Ok(starts) => push(study, kind, channel, tap, starts),
                }
            }
            if channel == "actuator"
                && let Some(input) = fed(&attachment.input)
            {
                for (id, command, parameters) in COMMANDS.iter().filter(|entry| wanted(entry.0)) {
                    memory(study, id, *command, parameters, input, ranges[4]);
                }
            }
        }
    }
    let pairs: Vec<(usize, Option<usize>)> =
        (0..study.candidates.len()).map(|c| (c, coulomb_beside(study, c))).collect();
    for (candidate, needs) in pairs {
        study.candidates[candidate].needs = needs;
    }
    sensors(study);
    // Without candidates there is nothing to search, and nothing to explain.
    if !study.candidates.is_empty() {
        for (tap, attachment) in attachments.iter().enumerate() {
            probes(study, tap, attachment, fed(&attachment.input).is_some());
        }
    }
}

/// The Coulomb candidate that laws need which change a Coulomb level, where the declared model has none: a friction peak
/// without friction at higher speed is no friction.
fn coulomb_beside(study: &Study, candidate: usize) -> Option<usize> {
    let Action::Block { law, tap } = study.candidates[candidate].action else { return None };
    let changes = [Law::Presliding, Law::Stribeck, Law::PositionCoulomb, Law::Asymmetry].contains(&law);
    if !changes || study.taps[tap].coulomb.is_some() {
        return None;
    }
    study.candidates.iter().position(|c| c.action == Action::Block { law: Law::Coulomb, tap })
}

fn entries(
    study: &mut Study,
    id: &str,
    parameters: &[(&str, &str)],
    bounds: impl Fn(usize) -> (f64, f64),
) -> Range<usize> {
    let first = study.entries.len();
    for (k, (name, unit)) in parameters.iter().enumerate() {
        let free = Free { index: first + k, bounds: bounds(k), step: 1e-6, prior: None };
        let (name, unit) = (format!("{id} {name}"), (*unit).to_owned());
        study.entries.push(Entry { name, unit, target: Target::Effect, start: 0.0, free });
    }
    first..study.entries.len()
}

fn push(study: &mut Study, kind: &Kind, channel: &'static str, tap: usize, starts: Vec<Vec<f64>>) {
    let largest = |k: usize| starts.iter().map(|start| start[k]).fold(0.0, f64::max);
    let bounds = |k: usize| {
        let shape = largest(k);
        match (kind.positive.contains(&k), shape > 0.0) {
            // A shape stays within what the records can show.
            (true, true) => (1e-3 * starts.iter().map(|s| s[k]).fold(f64::INFINITY, f64::min), 20.0 * shape),
            (true, false) => (0.0, f64::INFINITY),
            (false, _) => (f64::NEG_INFINITY, f64::INFINITY),
        }
    };
    let range = entries(study, kind.id, kind.parameters, bounds);
    let memory = usize::from(kind.law == Law::Presliding);
    study.candidates.push(Candidate {
        id: kind.id.to_owned(),
        channel,
        signal: None,
        action: Action::Block { law: kind.law, tap },
        entries: range,
        complexity: kind.parameters.len() - 1 + 2 * memory,
        starts,
        probe: false,
        needs: None,
    });
}

/// Free forms over the variables of an attachment, each at the channel where such a force would belong.
fn probes(study: &mut Study, tap: usize, attachment: &Attachment, command: bool) {
    let channel = |order: &[&str]| {
        let own = order.iter().find(|channel| attachment.channels.iter().any(|c| c == *channel));
        CHANNELS.into_iter().find(|channel| Some(channel) == own)
    };
    let friction = ["piston_friction", "cart_friction", "pole", "cart", "actuator"];
    let place = ["cart", "pole", "piston_friction", "cart_friction", "actuator"];
    let drive = ["actuator", "piston_friction", "pole", "cart_friction", "cart"];
    let known = study.taps[tap].signals;
    let variables = [
        (Variable::Velocity, known[0].is_some(), friction),
        (Variable::Position, known[1].is_some(), place),
        (Variable::PressureForce, known[2].is_some(), drive),
        (Variable::Value, command, drive),
        (Variable::Time, true, place),
    ];
    for (variable, there, order) in variables {
        let (low, high) = study.range(tap, variable);
        let Some(channel) = channel(&order).filter(|_| there && low < high) else { continue };
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let names = [("height", "1"); KNOTS];
        let range = entries(study, "free form", &names, |_| all);
        study.candidates.push(Candidate {
            id: "free form".to_owned(),
            channel,
            signal: None,
            action: Action::Block { law: Law::Shape(variable), tap },
            entries: range,
            starts: vec![vec![0.0; KNOTS]],
            complexity: KNOTS,
            probe: true,
            needs: None,
        });
    }
}

fn memory(
    study: &mut Study,
    id: &'static str,
    command: Command,
    parameters: &[(&str, &str)],
    input: usize,
    range: (f64, f64),
) {
    let size = range.0.abs().max(range.1.abs());
    if range.1 <= range.0 || range.1.is_nan() {
        study.not_testable.push((id.into(), "the command does not change".into()));
        return;
    }
    let step = study.records.first().map_or(1e-3, |record| record.step);
    let (starts, bounds): (Vec<Vec<f64>>, _) = match command {
        Command::Delay => ([1.0, 4.0, 10.0].map(|k| vec![k * step]).into(), [(0.0, 200.0 * step); 2]),
        Command::Hysteresis => ([0.01, 0.05].map(|part| vec![part * size]).into(), [(0.0, size); 2]),
        Command::Mode => {
            let grid = [(0.06, 0.7), (0.025, 0.7), (0.01, 0.7), (0.025, 0.2), (0.01, 0.2), (0.005, 0.3)];
            (grid.map(|(f, z)| vec![f / step, z]).into(), [(1e-4 / step, 0.4 / step), (0.01, 3.0)])
        }
    };
    let range = entries(study, id, parameters, |k| bounds[k]);
    study.candidates.push(Candidate {
        id: id.to_owned(),
        channel: "actuator",
        signal: None,
        action: Action::Command { kind: command, input },
        entries: range,
        complexity: 1 + command.parameters(),
        starts,
        probe: false,
        needs: None,
    });
}

fn sensors(study: &mut Study) {
    // Where initial states are measured or fitted and no input drives them, and where outputs follow inputs at once, a
    // wrong sensor cannot be told from other initial states and parameters.
    let driven = study.records.iter().any(|record| record.inputs.iter().any(Option::is_some));
    let states = study.records.iter().any(|record| !record.states.is_empty());
    if !driven || !states || study.windows.is_some() {
        study.not_testable.push((
            "sensor".into(),
            "without a measured input that drives the states over whole segments, a wrong sensor cannot be told from other parameters and initial states".into(),
        ));
        return;
    }
    let step = study.records.first().map_or(1e-3, |record| record.step);
    let all = (f64::NEG_INFINITY, f64::INFINITY);
    for output in 0..study.outputs.len() {
        let (name, unit) = (study.outputs[output].name.clone(), study.outputs[output].unit.clone());
        let kinds = [
            ("sensor.offset", Sensor::Offset, ("value", unit.as_str()), vec![vec![0.0]], all),
            ("sensor.gain", Sensor::Gain, ("gain", "1"), vec![vec![0.0]], all),
            (
                "sensor.delay",
                Sensor::Delay,
                ("delay", "s"),
                vec![vec![step], vec![6.0 * step]],
                (0.0, 100.0 * step),
            ),
        ];
        for (id, kind, parameter, starts, bounds) in kinds {
            if kind == Sensor::Offset && study.outputs[output].offset.is_some() {
                continue;
            }
            let entries = entries(study, id, &[parameter], |_| bounds);
            let action = Action::Sensor { kind, output };
            let signal = Some(name.clone());
            let own = Candidate {
                id: id.to_owned(),
                channel: "sensor",
                signal,
                action,
                entries,
                starts,
                complexity: 1,
                probe: false,
                needs: None,
            };
            study.candidates.push(own);
        }
    }
}
