//! Candidates of a study: the effects of the vocabulary that can act at its attachments, on its commands and sensors.

use std::ops::Range;

use airloop_series::compound_unit;

use super::blocks::Survey;
use super::command::Command;
use super::declaration::Attachment;
use super::initial_guesses::initial_guesses;
use super::kinds::{
    CAUGHT_OVERFLOW, COMMAND, COMMANDS, ELECTRICAL, FLOW, Kind, MECHANICAL, Memory, PORT_COMMANDS, kinds,
    unit,
};
use super::law::{KNOTS, Law, Variable};
use super::model::{Action, Entry, Level, Sensor, Study, Target};
use super::ports;
use super::sensors;
use super::stiffness;
use crate::answer::Effect;
use crate::engine::fit::Free;
use crate::vocabulary::PortKind;

/// A candidate.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Id of the vocabulary, its kind where no channel is declared, or name of an effect of one's own.
    pub id: String,
    /// Channel; empty where none is declared.
    pub channel: &'static str,
    /// Input where it acts, or output that a sensor shows.
    pub port: String,
    /// Whether another candidate has the same id: names then say the port.
    pub twin: bool,
    /// Measured signal of a sensor effect.
    pub signal: Option<String>,
    /// Place and kind of the change.
    pub action: Action,
    /// Its entries of the parameter vector.
    pub entries: Range<usize>,
    /// Points to start from: values of its entries. Zeros are found by the linear step.
    pub starts: Vec<Vec<f64>>,
    /// How much it assumes: memoryless and linear 0, with a shape or a memory more.
    pub complexity: usize,
    /// A free form that shows on what the residual depends; never part of an answer.
    pub probe: bool,
    /// Attachment of the level that gets a part of what is taken off here.
    pub into: Option<usize>,
    /// It changes the Coulomb level of its attachment: without one in the declared model it needs this other one.
    pub needs: Option<usize>,
}

impl Candidate {
    /// Id in an answer: that of the vocabulary, or `kind@port`.
    pub fn full_id(&self) -> String {
        if self.channel.is_empty() { format!("{}@{}", self.id, self.port) } else { self.id.to_owned() }
    }

    /// Unique name.
    pub fn name(&self) -> String {
        match &self.signal {
            Some(signal) => format!("{}({signal})", self.id),
            None if self.twin => format!("{}@{}", self.id, self.port),
            None => self.full_id(),
        }
    }

    /// Whether it is the resolution of a sensor, which is asked for when all else is known.
    pub fn is_resolution(&self) -> bool {
        matches!(self.action, Action::Sensor { kind: Sensor::Quantization, .. })
    }

    /// Whether it means nothing without the candidate `other`: presliding softens a level, it has none of its own.
    pub fn acts_only_on(&self, other: usize) -> bool {
        self.needs == Some(other) && matches!(self.action, Action::Block { law: Law::Presliding, .. })
    }

    /// Whether it may be missing alone though no attachment shows the Coulomb level that it comes with: the FMU may
    /// hold that level.
    pub fn may_stand_alone(&self) -> bool {
        self.needs.is_some() && matches!(self.action, Action::Block { law: Law::Stribeck, .. })
    }

    /// Whether searches look for it.
    pub fn is_searched(&self) -> bool {
        !self.probe && !self.is_resolution()
    }

    /// Whether it is a free form over one variable, as every study has them; others are of a search for a law.
    pub fn is_shape(&self) -> bool {
        matches!(self.action, Action::Block { law: Law::Shape(_), .. })
    }

    /// Where it acts: `channel@port`.
    pub fn place(&self) -> String {
        format!("{}@{}", self.channel, self.port)
    }

    /// Whether an effect of an answer is this one.
    pub fn is(&self, effect: &Effect) -> bool {
        self.full_id() == effect.id
            && self.signal == effect.signal
            && effect.port.as_ref() == Some(&self.port)
    }
}

/// Where an effect with a memory acts.
#[derive(Debug, Clone, Copy)]
enum Entrance {
    /// On a command of the records: input of the system.
    Input(usize),
    /// On a signal inside of the system: attachment, and the largest rate there.
    Tap(usize, f64),
}

/// Share of the largest speed at a port over which friction changes its sign, where nothing is stated.
const SIGN_CHANGE: f64 = 0.01;
/// Whether the declared model has the law already with a free coefficient: the candidate would change nothing.
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
        let command = fed(&attachment.input);
        if attachment.channels.is_empty() {
            if attachment.vt.is_none() {
                let fastest = ranges[0].0.abs().max(ranges[0].1.abs());
                study.taps[tap].vt = if fastest > 0.0 { SIGN_CHANGE * fastest } else { 1e-3 };
            }
            let duty = attachment.port;
            let mechanical = duty.is_some_and(|duty| duty.kind == ports::Kind::Mechanical);
            let list = match duty.map(|duty| duty.kind) {
                Some(ports::Kind::Mechanical) => &MECHANICAL[..],
                Some(ports::Kind::Electrical) => &ELECTRICAL[..],
                _ => &FLOW[..],
            };
            let attachment_units = study.taps[tap].units.clone();
            let constant = |law: Law| matches!(law, Law::Bias | Law::Drift);
            let sums = duty.is_some_and(|duty| duty.kind != ports::Kind::Signal);
            let drains = next_level(study, attachment).is_some();
            if attachment.effects.is_some() && wanted(attachment, CAUGHT_OVERFLOW) && !drains {
                let why = "no attachment is at a flow into the level that the one of its port drains into";
                study.not_testable.push((format!("{CAUGHT_OVERFLOW}@{}", attachment.input), why.into()));
            }
            let here = |kind: &&Kind| {
                // A command that fills a level may run over it, whatever its unit.
                let overflows = matches!(kind.law, Law::Overflow | Law::CaughtOverflow);
                let sums = sums || overflows && duty.is_some_and(|duty| duty.fills);
                if kind.law == Law::CaughtOverflow && !drains {
                    return false;
                }
                if kind.law == Law::Choked && !is_pressure(&attachment_units[2]) {
                    return false;
                }
                duty.is_none_or(|duty| if constant(kind.law) { duty.constants } else { duty.forces && sums })
            };
            // A command stands in the records, a signal between components is that of the simulation.
            let passes = command.is_none() && duty.is_some_and(|duty| duty.passes);
            let entrance = match command {
                Some(input) => Some(Entrance::Input(input)),
                None => passes.then(|| Entrance::Tap(tap, survey.fastest.get(tap).copied().unwrap_or(0.0))),
            };
            // A gain may vary along the way of a force, not with any state that a signal moves.
            let varies = |kind: &&Kind| mechanical || kind.law != Law::PositionGain;
            let changes = COMMAND.iter().filter(|_| entrance.is_some()).filter(varies);
            let blocks: Vec<&Kind> = list.iter().filter(here).chain(changes).collect();
            blocks_at(study, tap, attachment, "", &blocks, &ranges);
            memories_at(study, tap, attachment, (entrance, "", &ranges), PORT_COMMANDS.iter());
            continue;
        }
        for channel in &attachment.channels {
            let (channel, list) = kinds(channel);
            // Behind a command only its own effects, before a force only those with a force law.
            let fitting =
                |kind: &&Kind| !kind.law.changes_command() || command.is_some() && channel == "actuator";
            let blocks: Vec<&Kind> = list.iter().filter(fitting).collect();
            blocks_at(study, tap, attachment, channel, &blocks, &ranges);
            let memories = COMMANDS.iter().filter(|_| channel == "actuator");
            let entrance = command.map(Entrance::Input);
            memories_at(study, tap, attachment, (entrance, channel, &ranges), memories);
        }
    }
    study.positions.clone_from(&survey.positions);
    let pairs: Vec<(usize, Option<usize>)> =
        (0..study.candidates.len()).map(|c| (c, coulomb_beside(study, c))).collect();
    for (candidate, needs) in pairs {
        study.candidates[candidate].needs = needs;
    }
    sensors::fill(study);
    let all: Vec<(String, Option<String>)> =
        study.candidates.iter().map(|own| (own.id.clone(), own.signal.clone())).collect();
    for own in &mut study.candidates {
        own.twin = all.iter().filter(|(id, signal)| (id, signal) == (&own.id, &own.signal)).count() > 1;
    }
    plain_names(&mut study.not_testable, &all);
    // Without candidates there is nothing to search, and nothing to explain.
    if !study.candidates.is_empty() {
        for (tap, attachment) in attachments.iter().enumerate() {
            probes(study, tap, attachment, fed(&attachment.input).is_some());
        }
    }
}

/// Whether a unit is one of pressure.
fn is_pressure(unit: &str) -> bool {
    let known = |text: &str| compound_unit::parse(text).map(|own| own.exponents);
    known(unit).is_some() && known(unit) == known("Pa")
}

/// Whether an effect is looked for at an attachment; the list may name it as reports do, with its port.
fn wanted(attachment: &Attachment, id: &str) -> bool {
    let is = |own: &String| own == id || *own == format!("{id}@{}", attachment.input);
    attachment.effects.as_ref().is_none_or(|list| list.iter().any(is))
}

/// Whether a law takes a flow out of a level.
fn is_of_level(law: Law) -> bool {
    matches!(law, Law::Leakage | Law::Outlet | Law::Overflow | Law::CaughtOverflow | Law::Choked)
}

/// Attachment at which a flow into the level acts that the level at another one drains into.
fn next_level(study: &Study, attachment: &Attachment) -> Option<usize> {
    let level = attachment.drains_into.as_ref()?;
    study.taps.iter().position(|tap| {
        let own = &tap.attachment;
        own.position.as_ref() == Some(level) && own.port.is_some_and(|duty| duty.fills && duty.forces)
    })
}

fn blocks_at(
    study: &mut Study,
    tap: usize,
    attachment: &Attachment,
    channel: &'static str,
    list: &[&Kind],
    ranges: &[(f64, f64); 5],
) {
    let names: Vec<String> = study.entries[..study.declared].iter().map(|entry| entry.name.clone()).collect();
    let free = |name: &Option<String>| name.as_ref().is_some_and(|name| names.contains(name));
    let duration = study.range(tap, Variable::Time).1;
    let asked_of_all = channel.is_empty() && attachment.effects.is_none();
    for kind in list.iter().filter(|kind| wanted(attachment, kind.id)) {
        if declared_twin(attachment, kind.law, &free) {
            continue;
        }
        match initial_guesses(kind.law, kind.parameters.len(), (ranges, duration)) {
            // Nobody asks for an overflow of what is no flow, nor for friction under a load where none passes.
            Err(_) if is_of_level(kind.law) && ports::kind(&study.taps[tap].units[0]) != PortKind::Flow => {}
            Err(_) if kind.law == Law::Load && ranges[4] == (0.0, 0.0) => {}
            // Nor for a share of a pressure where none is named.
            Err(_) if kind.law == Law::Pressure && asked_of_all && attachment.pressure_force.is_none() => {}
            Err(_) if kind.law == Law::Area && asked_of_all && attachment.pressure.is_none() => {}
            Err(why) => study.not_testable.push((format!("{}@{}", kind.id, attachment.input), why.into())),
            Ok(starts) => push(study, kind, channel, tap, starts),
        }
    }
}

fn memories_at<'a>(
    study: &mut Study,
    tap: usize,
    attachment: &Attachment,
    (entrance, channel, ranges): (Option<Entrance>, &'static str, &[(f64, f64); 5]),
    list: impl Iterator<Item = &'a Memory>,
) {
    let Some(entrance) = entrance else { return };
    let units = study.taps[tap].units.clone();
    for (id, command, parameters) in list.filter(|own| wanted(attachment, own.0)) {
        let parameters: Vec<(&str, String)> =
            parameters.iter().map(|(name, template)| (*name, unit(template, &units))).collect();
        memory(study, (id, channel), *command, &parameters, entrance, ranges[4]);
    }
}

/// Takes the port from names that need none: no other attachment has this id.
fn plain_names(found: &mut [(String, String)], candidates: &[(String, Option<String>)]) {
    let ids: Vec<String> =
        found.iter().map(|(name, _)| name.split('@').next().unwrap_or(name).to_owned()).collect();
    for ((name, _), id) in found.iter_mut().zip(&ids) {
        let others = ids.iter().filter(|own| *own == id).count()
            + candidates.iter().filter(|own| own.0 == id.as_str()).count();
        if others == 1 {
            name.clone_from(id);
        }
    }
}

/// The Coulomb candidate that laws are searched with which change a Coulomb level, where the declared model has none:
/// most friction that has one of these shapes has a level, too. One that turns out to be zero is left out again.
fn coulomb_beside(study: &Study, candidate: usize) -> Option<usize> {
    let Action::Block { law, tap } = study.candidates[candidate].action else { return None };
    let changes = matches!(
        law,
        Law::Presliding | Law::Stribeck | Law::PositionCoulomb | Law::PeriodicCoulomb | Law::Asymmetry
    );
    if !changes || study.taps[tap].coulomb.is_some() {
        return None;
    }
    study.candidates.iter().position(|c| c.action == Action::Block { law: Law::Coulomb, tap })
}

pub(super) fn entries(
    study: &mut Study,
    id: &str,
    parameters: &[(&str, String)],
    bounds: impl Fn(usize) -> (f64, f64),
) -> Range<usize> {
    let first = study.entries.len();
    for (k, (name, unit)) in parameters.iter().enumerate() {
        let free = Free { index: first + k, bounds: bounds(k), step: 1e-6, prior: None };
        let (name, unit) = (format!("{id} {name}"), unit.clone());
        study.entries.push(Entry { name, unit, target: Target::Effect, start: 0.0, free });
    }
    first..study.entries.len()
}

fn push(study: &mut Study, kind: &Kind, channel: &'static str, tap: usize, starts: Vec<Vec<f64>>) {
    let smallest = |k: usize| starts.iter().map(|start| start[k]).fold(f64::INFINITY, f64::min);
    let widest = |k: usize| starts.iter().map(|start| start[k]).fold(0.0, f64::max);
    // Friction of the declared model may be less than declared, as long as what is left of it takes energy.
    let declared = match (kind.law, study.taps[tap].coulomb) {
        (Law::Viscous, _) => study.taps[tap].viscous,
        (Law::Coulomb, Some(Level::Value(level))) => level,
        _ => 0.0,
    };
    let largest = match kind.law {
        Law::Overflow | Law::CaughtOverflow => stiffness::largest_coefficient(study, tap),
        _ => f64::INFINITY,
    };
    let bounds = |k: usize| {
        let shape = widest(k);
        match (kind.positive.contains(&k), shape > 0.0) {
            (true, _) if k == 0 && largest.is_finite() => (0.0, largest),
            // Slower than this a sign changes within a step, faster than this it is no sign.
            (true, true) if matches!(kind.law, Law::Coulomb | Law::Load) => (0.2 * smallest(k), 5.0 * shape),
            (true, true) if kind.law == Law::Quantization => (0.5 * smallest(k), 2.0 * shape),
            // A shape stays within what the records can show.
            (true, true) => (1e-3 * smallest(k), 20.0 * shape),
            (true, false) => (-declared.max(0.0), f64::INFINITY),
            (false, _) => (f64::NEG_INFINITY, f64::INFINITY),
        }
    };
    let units = study.taps[tap].units.clone();
    let parameters: Vec<(&str, String)> =
        kind.parameters.iter().map(|(name, template)| (*name, unit(template, &units))).collect();
    let range = entries(study, kind.id, &parameters, bounds);
    let memory = usize::from(kind.law == Law::Presliding);
    study.candidates.push(Candidate {
        id: kind.id.to_owned(),
        channel,
        port: study.taps[tap].name.clone(),
        twin: false,
        signal: None,
        action: Action::Block { law: kind.law, tap },
        entries: range,
        complexity: kind.parameters.len() - 1 + 2 * memory,
        starts,
        probe: false,
        into: (kind.law == Law::CaughtOverflow)
            .then(|| next_level(study, &study.taps[tap].attachment))
            .flatten(),
        needs: None,
    });
}

/// Free forms over the variables of an attachment, each at the channel where such a force would belong. Channel of a
/// free form over a variable at an attachment; empty where none is declared, none where no declared channel fits.
pub fn channel_of(attachment: &Attachment, variable: Variable) -> Option<&'static str> {
    if attachment.channels.is_empty() {
        return Some("");
    }
    let order = match variable {
        Variable::Velocity => ["piston_friction", "cart_friction", "pole", "cart", "actuator"],
        Variable::Position | Variable::Time => {
            ["cart", "pole", "piston_friction", "cart_friction", "actuator"]
        }
        _ => ["actuator", "piston_friction", "pole", "cart_friction", "cart"],
    };
    order.into_iter().find(|own| attachment.channels.iter().any(|channel| channel == own))
}

fn probes(study: &mut Study, tap: usize, attachment: &Attachment, command: bool) {
    let known = study.taps[tap].signals;
    let variables = [
        (Variable::Velocity, known[0].is_some()),
        (Variable::Position, known[1].is_some()),
        (Variable::PressureForce, known[2].is_some()),
        (Variable::Value, command),
        (Variable::Time, true),
    ];
    for (variable, there) in variables {
        let (low, high) = study.range(tap, variable);
        let channel = channel_of(attachment, variable);
        let Some(channel) = channel.filter(|_| there && low < high) else { continue };
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let names: Vec<(&str, String)> = vec![("height", "1".into()); KNOTS];
        let range = entries(study, "free form", &names, |_| all);
        study.candidates.push(Candidate {
            id: "free form".to_owned(),
            channel,
            port: study.taps[tap].name.clone(),
            twin: false,
            signal: None,
            action: Action::Block { law: Law::Shape(variable), tap },
            entries: range,
            starts: vec![vec![0.0; KNOTS]],
            complexity: KNOTS,
            probe: true,
            into: None,
            needs: None,
        });
    }
}

fn memory(
    study: &mut Study,
    (id, channel): (&'static str, &'static str),
    command: Command,
    parameters: &[(&str, String)],
    entrance: Entrance,
    range: (f64, f64),
) {
    let size = range.0.abs().max(range.1.abs());
    let port = match entrance {
        Entrance::Input(input) => study.graph.inputs[input].name.clone(),
        Entrance::Tap(tap, _) => study.taps[tap].name.clone(),
    };
    if range.1 <= range.0 || range.1.is_nan() {
        study.not_testable.push((format!("{id}@{port}"), "the value does not change".into()));
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
        Command::Lag => ([3.0, 15.0, 60.0].map(|k| vec![k * step]).into(), [(0.3 * step, 2000.0 * step); 2]),
        Command::Fill => {
            let grid = [(0.5, 2.5), (2.5, 0.5), (3.0, 8.0), (8.0, 3.0), (20.0, 60.0), (60.0, 20.0)];
            (grid.map(|(up, down)| vec![up * step, down * step]).into(), [(0.3 * step, 2000.0 * step); 2])
        }
        Command::RateLimit => {
            let fastest = match entrance {
                Entrance::Input(input) => fastest_command(study, input),
                Entrance::Tap(_, fastest) => fastest,
            };
            let start = [0.9, 0.5, 0.2].map(|part| vec![part * fastest]);
            (start.into(), [(1e-3 * fastest, 10.0 * fastest); 2])
        }
    };
    let range = entries(study, id, parameters, |k| bounds[k]);
    study.candidates.push(Candidate {
        id: id.to_owned(),
        channel,
        port,
        twin: false,
        signal: None,
        action: match entrance {
            Entrance::Input(input) => Action::Command { kind: command, input },
            Entrance::Tap(tap, _) => Action::Block { law: Law::Memory(command), tap },
        },
        entries: range,
        complexity: 1 + command.parameters(),
        starts,
        probe: false,
        into: None,
        needs: None,
    });
}

/// Largest rate of a command in the estimation records, over some samples: a step has none of its own.
fn fastest_command(study: &Study, input: usize) -> f64 {
    let own = study.records.iter().filter_map(|record| Some((record.inputs[input].as_ref()?, record.step)));
    own.map(|(values, step)| fastest(values, step)).fold(0.0, f64::max)
}

/// Largest rate of values, `[n]` at `step` \[s\], over some samples.
pub(super) fn fastest(values: &[f64], step: f64) -> f64 {
    const SPAN: usize = 10;
    let rates = values.windows(SPAN + 1).map(|part| (part[SPAN] - part[0]).abs() / (SPAN as f64 * step));
    rates.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_parameters_follow_those_of_the_port() {
        let of = |template: &str, units: [&str; 3]| unit(template, &units.map(str::to_owned));
        let axis = ["N", "m/s", "m"];
        assert_eq!(["E/V", "E/X", "E/V2", "1/X"].map(|t| of(t, axis)), ["N s/m", "N/m", "N s^2/m^2", "1/m"]);
        let joint = ["N.m", "rad/s", "rad"];
        assert_eq!(["E", "E/V", "E/V2"].map(|t| of(t, joint)), ["N m", "N m s/rad", "N m s^2/rad^2"]);
        assert_eq!(of("E/X", ["m3/s", "1", "m"]), "m3/s/m");
        assert_eq!(of("E/V", ["V", "A", "1"]), "V/A");
        assert_eq!(of("E/V", ["1", "1", "1"]), "1");
    }
}
