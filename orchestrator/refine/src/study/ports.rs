//! Ports of a system that its graph and its equations show: inputs where something may be missing, and the velocity and
//! position, or flow and level, that belong to them; and rates of states that no input moves (`rates`).
//!
//! The kind of an input follows from its unit. Its states are seen from the right-hand side: the velocity along a force
//! is the state whose rate the force changes, the position is the state whose rate that velocity is. Of several forces
//! and velocities those belong together whose product of influences is largest: the inverse of a mass matrix is
//! positive definite, so that the force of a joint moves its own joint more than it moves others. A statement of the
//! study overrides the detection.

use airloop_series::compound_unit;
use airloop_series::units::{Exponents, Unit, lookup};

mod hints;
mod rates;

pub use hints::hints;

use super::Problem;
use super::declaration::{Attachment, File};
use super::names;
use super::plant::Plant;
use super::plant::response::Sense;
use crate::vocabulary::own::PortKind;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{DataType, Source, unit_of};
use airloop_fmi::Causality;

/// Kind of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A force or torque: it acts along a velocity.
    Mechanical,
    /// A voltage that drives a current, which stands for the velocity.
    Electrical,
    /// A quantity that a state integrates without being the velocity of another one: flow into a level, heat, or a
    /// value without unit.
    Flow,
    /// Anything else.
    Signal,
}

/// A port.
#[derive(Debug, Clone, PartialEq)]
pub struct Port {
    /// Input of the system or of a component, or rate of a state.
    pub name: String,
    /// Kind, by its unit and its states.
    pub kind: Kind,
    /// Its unit.
    pub unit: Option<String>,
    /// Signal: velocity along a force.
    pub velocity: Option<String>,
    /// Signal: position along a force, or level that a flow changes.
    pub position: Option<String>,
    /// -1 where a larger value makes the velocity or the level fall.
    pub sign: f64,
    /// Velocity of another body that a force moves the other way: it acts between the two.
    pub against: Option<String>,
    /// Signal: level that the level of a flow drains into, as the upper of two tanks into the lower.
    pub drains_into: Option<String>,
    /// Port that acts on the same states in the same way.
    pub like: Option<String>,
    /// Nothing is connected to it.
    pub free: bool,
    /// It moves one state alone, which is not the rate of another: a pump fills a level.
    pub fills: bool,
    /// Derivative of the rate of the state that it moves by its value; 0 where it is not known.
    pub slope: f64,
}

/// Effects looked for at a port. Ports that act alike share them, so that nothing is looked for twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duty {
    /// Kind of the port.
    pub kind: Kind,
    /// See [`Port::sign`].
    pub sign: f64,
    /// Whether effects that depend on velocity and position are looked for here: at a port that nothing drives, if
    /// there is one.
    pub forces: bool,
    /// Whether a constant and a drift are looked for here: at a port that a command drives, if there is one.
    pub constants: bool,
    /// See [`Port::fills`].
    pub fills: bool,
    /// See [`Port::slope`].
    pub slope: f64,
    /// Whether it is a signal that one component gives another, and changes of that signal are looked for here: dead
    /// bands, gains, lags.
    pub passes: bool,
}

/// Influence of a port on a state below this share of its largest one is rounding.
const MAX_ROUNDED_INFLUENCE: f64 = 1e-9;
/// The same for outputs of slaves, which are seen a step later: a position has moved by then, too.
const MAX_LATE_INFLUENCE: f64 = 0.05;
/// Largest relative difference between the rate of a position and its velocity: that of exact rates, and that of
/// difference quotients over the outputs of slaves.
const MAX_DIFFERENCE_OF_RATES: [f64; 2] = [1e-9, 0.03];
/// Ports whose assignment to velocities is tried in every order; more take the velocity that each moves most.
const MAX_ASSIGNED_PORTS: usize = 6;

fn base(graph: &SystemGraph, component: usize, variable: usize) -> Option<Unit> {
    let description = &graph.components[component].fmu.description;
    let name = unit_of(&description.variables[variable])?;
    let own = description.units.iter().find(|unit| unit.name == name).and_then(|unit| unit.base);
    own.or_else(|| lookup(name))
}

/// Kind of a port by its unit: a force, a torque, a flow (of volume, mass, amount or heat), or else a signal.
pub(crate) fn kind(unit: &str) -> PortKind {
    match compound_unit::parse(unit) {
        Some(own) if is_mechanical(&own) => [PortKind::Force, PortKind::Torque][own.exponents.m as usize - 1],
        Some(own) if is_flow(&own) => PortKind::Flow,
        _ => PortKind::Signal,
    }
}

fn is_mechanical(unit: &Unit) -> bool {
    let Exponents { kg, m, s, A, K, mol, cd, .. } = unit.exponents;
    (kg, s) == (1, -2) && (m == 1 || m == 2) && (A, K, mol, cd) == (0, 0, 0, 0)
}

fn is_voltage(unit: &Unit) -> bool {
    let Exponents { kg, m, s, A, K, mol, cd, .. } = unit.exponents;
    (kg, m, s, A, K, mol, cd) == (1, 2, -3, -1, 0, 0, 0)
}

fn is_current(graph: &SystemGraph, name: &str) -> bool {
    let exponents = |unit: &Unit| {
        let Exponents { kg, m, s, A, K, mol, cd, .. } = unit.exponents;
        (kg, m, s, A, K, mol, cd)
    };
    let unit = names::unit_of(graph, name).and_then(|unit| compound_unit::parse(&unit));
    unit.is_some_and(|unit| exponents(&unit) == (0, 0, 0, 1, 0, 0, 0))
}

fn is_flow(unit: &Unit) -> bool {
    let Exponents { kg, m, s, A, K, mol, cd, .. } = unit.exponents;
    let matter = [(1, 0, -1, 0), (0, 3, -1, 0), (0, 0, -1, 1)].contains(&(kg, m, s, mol));
    (A, K, cd) == (0, 0, 0) && (matter || (kg, m, s, mol) == (1, 2, -3, 0))
}

/// Inputs of the system, then inputs of components that other components drive or nothing drives: name, component,
/// variable.
fn inputs(graph: &SystemGraph) -> Vec<(String, usize, usize)> {
    let real = |component: usize, variable: usize| {
        DataType::of(&graph.components[component].fmu.description.variables[variable]) == DataType::Real
    };
    let mut found = Vec::new();
    for (index, input) in graph.inputs.iter().enumerate() {
        let fed = graph.connections.iter().find(|c| c.source == Source::Input(index));
        let own = fed.map(|c| (c.component, c.variable));
        found.extend(own.filter(|&(c, v)| real(c, v)).map(|(c, v)| (input.name.clone(), c, v)));
    }
    for (index, component) in graph.components.iter().enumerate() {
        for (variable, declared) in component.fmu.description.variables.iter().enumerate() {
            let driven = graph.connections.iter().find(|c| (c.component, c.variable) == (index, variable));
            let outside = driven.is_some_and(|c| matches!(c.source, Source::Input(_)));
            if declared.causality == Causality::Input && real(index, variable) && !outside {
                let name = names::name_of(graph, component, variable);
                found.push((name, index, variable));
            }
        }
    }
    found
}

/// The ports of a system whose signals `measured` are seen, with those at the rates of states that are named in
/// `stated` or that no input moves.
///
/// # Errors
/// An FMU that fails.
pub fn find(graph: &SystemGraph, measured: &[&str], stated: &[&str]) -> Result<Vec<Port>, Problem> {
    let inputs = inputs(graph);
    let names: Vec<String> = inputs.iter().map(|(name, ..)| name.clone()).collect();
    let mut plant = Plant::new(graph, &names, &[], &[])?;
    let sense = plant.sense(measured)?;
    let (states, count) = (&sense.names, sense.names.len());
    let units: Vec<Option<Unit>> = inputs.iter().map(|&(_, c, v)| base(graph, c, v)).collect();
    let rates: Vec<Option<usize>> = (0..count).map(|state| integral(&sense, state)).collect();
    let free = |port: usize| {
        let own = (inputs[port].1, inputs[port].2);
        let outside = |source: &Source| matches!(source, Source::Input(_));
        !graph.connections.iter().any(|c| (c.component, c.variable) == own && !outside(&c.source))
    };
    let velocity_like = |port: usize, state: usize| {
        let shares_unit = match units[port] {
            Some(unit) if is_mechanical(&unit) => true,
            None => rates[state].is_some(),
            // A voltage on an oscillator acts as a force; a velocity that is fed to friction is none.
            Some(unit) => rates[state].is_some() && free(port) && !is_rate(&unit),
        };
        shares_unit && (rates[state].is_some() || is_speed(graph, &states[state]))
    };
    let moved: Vec<Vec<usize>> = (0..inputs.len())
        .map(|port| (0..count).filter(|&state| influence(&sense, port, state) > 0.0).collect())
        .collect();
    let mechanical: Vec<usize> =
        (0..inputs.len()).filter(|&port| moved[port].iter().any(|&s| velocity_like(port, s))).collect();
    type Alike = fn(&Sense, usize, usize) -> bool;
    let first = |port: usize, alike: Alike, may: &dyn Fn(usize) -> bool| {
        (0..port).find(|&other| may(other) && !moved[port].is_empty() && alike(&sense, port, other))
    };
    // A signal that moves the same states as a force is none, wherever it is declared.
    let acts_as_force = |other: usize| mechanical.contains(&other);
    let moves: Vec<_> = (0..inputs.len()).map(|port| first(port, moves_alike, &acts_as_force)).collect();
    let like: Vec<_> = (0..inputs.len()).map(|port| first(port, is_alike, &|_| true)).collect();
    let own: Vec<usize> = mechanical.iter().copied().filter(|&port| moves[port].is_none()).collect();
    let choices: Vec<Vec<(usize, f64)>> = own
        .iter()
        .map(|&port| {
            let fitting = moved[port].iter().filter(|&&state| velocity_like(port, state));
            fitting.map(|&state| (state, influence(&sense, port, state))).collect()
        })
        .collect();
    let velocities = assigned(&choices);
    let found = inputs.iter().enumerate().map(|(port, (name, component, variable))| {
        let first = moves[port].unwrap_or(port);
        // A velocity that is fed to friction moves the same states as its force, and is none.
        let carries = units[port].is_none_or(|unit| is_mechanical(&unit) || free(port) && !is_rate(&unit));
        let velocity = own.iter().position(|&p| p == first).and_then(|index| velocities[index]);
        let velocity = velocity.filter(|_| carries);
        let variables = &graph.components[*component].fmu.description.variables;
        let unit = unit_of(&variables[*variable]).map(str::to_owned);
        let signal = |state: usize| states[state].clone();
        let like = like[port].map(|other| inputs[other].0.clone());
        let (kind, velocity, position, state) = match velocity {
            Some(state) => (Kind::Mechanical, Some(signal(state)), rates[state].map(signal), Some(state)),
            None => {
                let most = moved[port]
                    .iter()
                    .copied()
                    .max_by(|&a, &b| influence(&sense, port, a).total_cmp(&influence(&sense, port, b)));
                let current = most.filter(|&state| {
                    units[port].is_some_and(|unit| is_voltage(&unit)) && is_current(graph, &states[state])
                });
                let fills = |unit: &Unit| most.is_some_and(|state| is_rate_of(graph, &states[state], unit));
                let flows = most.is_some() && units[port].is_none_or(|unit| is_flow(&unit) || fills(&unit));
                match current {
                    Some(state) => (Kind::Electrical, Some(signal(state)), None, current),
                    None if flows => (Kind::Flow, None, most.map(signal), most),
                    None => (Kind::Signal, None, most.map(signal), most),
                }
            }
        };
        let is_force = units[port].is_some_and(|unit| is_mechanical(&unit) && unit.exponents.m == 1);
        let against = state.filter(|_| velocity.is_some() && is_force).and_then(|own| {
            let unit = |state: usize| names::unit_of(graph, &states[state]);
            let mut others = moved[port].iter().copied();
            let opposite = |state: usize| sense.influence[port][state] * sense.influence[port][own] < 0.0;
            others.find(|&other| velocity_like(port, other) && unit(other) == unit(own) && opposite(other))
        });
        let sign = state.map_or(1.0, |state| if sense.influence[port][state] < 0.0 { -1.0 } else { 1.0 });
        let fills = kind != Kind::Electrical
            && moved[port].len() == 1
            && moved[port].iter().all(|&state| rates[state].is_none());
        let below = state.filter(|_| fills).and_then(|state| fed_by(&sense, state, &rates)).map(signal);
        Port {
            name: name.clone(),
            kind,
            unit,
            velocity,
            position,
            sign,
            against: against.map(signal),
            drains_into: below,
            like,
            free: free(port),
            fills,
            slope: state.and_then(|state| sense.slopes[port].get(state)).copied().unwrap_or(0.0),
        }
    });
    let mut found: Vec<Port> = found.collect();
    found.extend(rates::find(graph, (&plant, &sense, &rates), (&found, measured), stated));
    Ok(found)
}

/// Influence of a port on the rate of a state, 0 where it is rounding.
fn influence(sense: &Sense, port: usize, state: usize) -> f64 {
    let own = &sense.influence[port];
    let largest = own.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let value = own[state].abs();
    let least = if sense.exact[state] { MAX_ROUNDED_INFLUENCE } else { MAX_LATE_INFLUENCE };
    if value > least * largest { value } else { 0.0 }
}

/// State that a level feeds: of those whose rate rises with it, the one whose rate rises most. `rates`: for each state
/// the one whose rate it is.
fn fed_by(sense: &Sense, level: usize, rates: &[Option<usize>]) -> Option<usize> {
    let own = sense.coupling.get(level)?;
    let others = (0..own.len()).filter(|&state| state != level && own[state] > 0.0 && rates[state].is_none());
    others.max_by(|&a, &b| own[a].total_cmp(&own[b]))
}

/// State whose rate is this state, wherever the system is.
fn integral(sense: &Sense, velocity: usize) -> Option<usize> {
    let largest = MAX_DIFFERENCE_OF_RATES[usize::from(!sense.exact[velocity])];
    let known = || sense.points.iter().filter(|(x, _)| !x[velocity].is_nan());
    let moves = known().any(|(x, _)| x[velocity] != 0.0);
    let same = |state: &usize| {
        *state != velocity
            && sense.exact[*state] == sense.exact[velocity]
            && known()
                .all(|(x, dx)| (dx[*state] - x[velocity]).abs() <= largest * x[velocity].abs().max(1e-12))
    };
    (0..sense.exact.len()).filter(|_| moves).find(same)
}

/// Whether the unit of a signal is that of a velocity.
fn is_speed(graph: &SystemGraph, name: &str) -> bool {
    names::unit_of(graph, name).and_then(|unit| lookup(&unit)).is_some_and(|unit| is_rate(&unit))
}

/// Whether a unit is that of a velocity.
fn is_rate(unit: &Unit) -> bool {
    let Exponents { kg, m, s, .. } = unit.exponents;
    (kg, s) == (0, -1) && (m == 1 || m == 0 && unit.exponents.rad != 0)
}

/// Whether a unit is that of a state per second: that of an addition to a level measured in volts of its sensor.
fn is_rate_of(graph: &SystemGraph, state: &str, unit: &Unit) -> bool {
    let own = names::unit_of(graph, state).and_then(|own| compound_unit::parse(&format!("{own}/s")));
    own.is_some_and(|own| own.exponents == unit.exponents) && !is_rate(unit)
}

/// Factor from the influence of one port on the states to that of another, if there is one.
fn ratio(sense: &Sense, a: usize, b: usize) -> Option<f64> {
    let (x, y) = (&sense.influence[a], &sense.influence[b]);
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let (own, both) = (dot(x, x), dot(x, y));
    let size = (own * dot(y, y)).sqrt();
    (size > 0.0 && both.abs() > (1.0 - 1e-9) * size).then(|| both / own)
}

/// Whether two ports move the same states in the same proportion.
fn moves_alike(sense: &Sense, a: usize, b: usize) -> bool {
    ratio(sense, a, b).is_some()
}

/// Whether two ports move the same states and change what is measured in the same proportion: a force in front of a
/// load cell is another one than a force behind it.
fn is_alike(sense: &Sense, a: usize, b: usize) -> bool {
    ratio(sense, a, b).is_some_and(|ratio| {
        let near = |(u, v): (&f64, &f64)| (v - ratio * u).abs() <= 1e-6 * v.abs().max((ratio * u).abs());
        sense.shown[a].iter().zip(&sense.shown[b]).all(near)
    })
}

/// One state for each port, so that the product of the influences is largest; ports without a choice stay without.
fn assigned(choices: &[Vec<(usize, f64)>]) -> Vec<Option<usize>> {
    let most = |own: &Vec<(usize, f64)>| own.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|own| own.0);
    if choices.len() > MAX_ASSIGNED_PORTS {
        return choices.iter().map(most).collect();
    }
    let mut best = (f64::NEG_INFINITY, Vec::new());
    try_all(choices, &mut Vec::new(), 0.0, &mut best);
    if best.1.is_empty() {
        choices.iter().map(most).collect()
    } else {
        best.1.into_iter().map(Some).collect()
    }
}

fn try_all(choices: &[Vec<(usize, f64)>], taken: &mut Vec<usize>, sum: f64, best: &mut (f64, Vec<usize>)) {
    let Some(own) = choices.get(taken.len()) else {
        if sum > best.0 {
            *best = (sum, taken.clone());
        }
        return;
    };
    for &(state, influence) in own {
        if !taken.contains(&state) {
            taken.push(state);
            try_all(choices, taken, sum + influence.ln(), best);
            taken.pop();
        }
    }
}

/// The attachments of a study: those that it states, completed where they name no channel, or one for each port of the
/// system where it states none.
///
/// # Errors
/// An FMU that fails.
pub fn attachments(file: &File, graph: &SystemGraph) -> Result<Vec<Attachment>, Problem> {
    let stated = &file.declaration.attachment;
    let complete = !stated.is_empty() && stated.iter().all(|own| !own.get_ref().channels.is_empty());
    if complete {
        return Ok(stated.iter().map(|own| own.get_ref().clone()).collect());
    }
    let measured: Vec<&str> = file.declaration.outputs.keys().map(String::as_str).collect();
    let named: Vec<&str> = stated.iter().map(|own| own.get_ref().input.as_str()).collect();
    let ports = find(graph, &measured, &named)?;
    let fed = |port: &Port| file.declaration.inputs.contains_key(&port.name);
    if stated.is_empty() {
        let own = ports.iter().map(|port| (port, duty(&ports, port, &fed)));
        let own = own.filter(|(port, duty)| duty.forces || duty.constants || duty.passes || fed(port));
        return Ok(own.map(|(port, duty)| filled(&Attachment::at(&port.name), port, duty)).collect());
    }
    let one = |own: &Attachment| {
        let port = ports.iter().find(|port| port.name == own.input).filter(|_| own.channels.is_empty());
        let all = |port: &Port| Duty {
            kind: port.kind,
            sign: port.sign,
            forces: true,
            constants: true,
            fills: port.fills,
            slope: port.slope,
            passes: passes(port),
        };
        port.map_or_else(|| own.clone(), |port| filled(own, port, all(port)))
    };
    Ok(stated.iter().map(|own| one(own.get_ref())).collect())
}

/// Effects looked for at a port among those that act alike.
fn duty(ports: &[Port], port: &Port, fed: &dyn Fn(&Port) -> bool) -> Duty {
    let first = port.like.as_ref().unwrap_or(&port.name);
    let alike = || ports.iter().filter(|other| other.name == *first || other.like.as_ref() == Some(first));
    let quiet = |other: &&Port| other.free && !fed(other);
    let forces = alike().find(quiet).or_else(|| alike().next()).is_none_or(|own| own.name == port.name);
    let constants =
        alike().find(|own| fed(own)).or_else(|| alike().next()).is_none_or(|own| own.name == port.name);
    // What a signal that acts as a command lacks, that command lacks; a force beside it that nothing drives has none.
    let first = alike().find(|own| passes(own)).is_some_and(|own| own.name == port.name);
    let passes = first && !alike().any(fed);
    Duty { kind: port.kind, sign: port.sign, forces, constants, fills: port.fills, slope: port.slope, passes }
}

/// Whether a port gets a plain signal from another component, by its unit: no force, torque or flow.
fn passes(port: &Port) -> bool {
    let unit = port.unit.as_deref().unwrap_or("1");
    !port.free && port.kind != Kind::Mechanical && kind(unit) == PortKind::Signal
}

/// The stated attachment, completed by the states that the system shows.
fn filled(stated: &Attachment, port: &Port, duty: Duty) -> Attachment {
    let own = stated.clone();
    Attachment {
        velocity: own.velocity.clone().or_else(|| port.velocity.clone()),
        against: port.against.clone().filter(|_| own.velocity.is_none()),
        position: own.position.clone().or_else(|| port.position.clone()),
        drains_into: port.drains_into.clone(),
        port: Some(duty),
        ..own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_of_a_joint_belongs_to_its_own_joint() {
        // Inverse mass matrix of an arm: the second torque moves the first joint, too.
        let choices = [vec![(2, 0.9), (3, 1.6)], vec![(2, 1.6), (3, 5.0)]];
        assert_eq!(assigned(&choices), [Some(2), Some(3)]);
        // The other way round, and a port without a velocity of its own.
        assert_eq!(assigned(&[vec![(1, 2.0)], vec![(1, 1.0)]]), [Some(1), Some(1)]);
    }

    #[test]
    fn forces_and_torques_are_mechanical_whatever_their_prefix() {
        for (name, expected) in [("N", true), ("kN", true), ("mN.m", true), ("V", false), ("l/min", false)] {
            assert_eq!(is_mechanical(&lookup(name).unwrap()), expected, "{name}");
        }
        for (name, expected) in [("l/min", true), ("kg/s", true), ("W", true), ("V", false), ("N", false)] {
            assert_eq!(is_flow(&lookup(name).unwrap()), expected, "{name}");
        }
    }
}
