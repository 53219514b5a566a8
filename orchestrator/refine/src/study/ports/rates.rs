//! Ports at rates of states: what an FMU lacks may act where it has no input. A pendulum whose joint nobody drives has
//! friction, the lower of two tanks runs over.
//!
//! A block there adds to the derivative of the state, so that a force is seen as the acceleration that it gives. Not at
//! the rate of a position, which is its velocity whatever else happens, nor where an input already moves the state as
//! its own, nor at states without unit that nobody measures: those of a black box mean nothing.

use super::{Kind, Port, fed_by, is_current, is_speed};
use crate::study::names::{self, state_of_rate};
use crate::study::plant::Plant;
use crate::study::plant::response::Sense;
use airloop_cosim::system::SystemGraph;

/// Ports at rates of states that no port of `known` moves as its own, and at those that `stated` names; `integrals`:
/// for each state the one whose rate it is, `measured`: signals that are seen.
pub(super) fn find(
    graph: &SystemGraph,
    (plant, sense, integrals): (&Plant, &Sense, &[Option<usize>]),
    (known, measured): (&[Port], &[&str]),
    stated: &[&str],
) -> Vec<Port> {
    let mut found = Vec::new();
    for component in &graph.components {
        let name = |variable: usize| names::name_of(graph, component, variable);
        for unknown in &component.fmu.description.derivatives {
            let own = state_of_rate(component, unknown.variable);
            let Some(state) = own.and_then(|state| plant.state(&name(state))) else { continue };
            let rate = name(unknown.variable);
            let shown = &sense.names[state];
            let signals = known.iter().flat_map(|port| [&port.velocity, &port.position]).flatten();
            let moved = signals.into_iter().any(|own| own == shown);
            let is_position = integrals.contains(&Some(state));
            let rests = sense.points.iter().all(|(_, rates)| rates[state] == 0.0);
            let has_meaning = names::unit_of(graph, shown).is_some() || measured.contains(&shown.as_str());
            if stated.contains(&rate.as_str()) || !(moved || is_position || rests) && has_meaning {
                found.push(port(graph, sense, integrals, state, rate));
            }
        }
    }
    found
}

/// The port at the rate of a state.
fn port(graph: &SystemGraph, sense: &Sense, integrals: &[Option<usize>], state: usize, name: String) -> Port {
    let signal = |state: usize| sense.names[state].clone();
    let own = signal(state);
    let moves = integrals[state].is_some() || is_speed(graph, &own);
    let kind = match () {
        () if moves => Kind::Mechanical,
        () if is_current(graph, &own) => Kind::Electrical,
        () => Kind::Flow,
    };
    let fills = kind == Kind::Flow;
    Port {
        unit: names::unit_of(graph, &name),
        name,
        kind,
        velocity: (!fills).then(|| own.clone()),
        position: if fills { Some(own) } else { integrals[state].map(signal) },
        sign: 1.0,
        against: None,
        drains_into: fed_by(sense, state, integrals).filter(|_| fills).map(signal),
        like: None,
        free: true,
        fills,
        slope: 1.0,
    }
}
