//! The block of an effect of one's own: of its formula, or an FMU and what takes its output off.

use super::blocks::{self, Sources};
use super::network::{Block, Network, Part, end};
use crate::answer::Effect;
use crate::vocabulary::Own;
use crate::vocabulary::fmu_law::FmuLaw;
use crate::vocabulary::own::Law;
use airloop_cosim::system::ssp::Endpoint;
use airloop_fmi::derive::Value;

/// Name of what is added to that of the component of an FMU for the block that takes its output off.
const TAKES_OFF: &str = "_acts";

/// Puts an effect of one's own in front of `to`, as [`Network::insert`] does; `effect` and `name` as in [`block`].
pub fn insert(
    network: &mut Network,
    to: &Endpoint,
    own: &Own,
    (effect, name): (&Effect, String),
    (sign, sources): (f64, &Sources),
) {
    match &own.law {
        Law::Formula { .. } => network.insert(to, block(own, (effect, name), sign, sources), false),
        Law::Fmu(law) => insert_fmu(network, to, (own, law), (effect, name), (sign, sources)),
    }
}

/// The FMU beside the way, and a block on it that takes its output off, or gives it on.
fn insert_fmu(
    network: &mut Network,
    to: &Endpoint,
    (own, law): (&Own, &FmuLaw),
    (effect, name): (&Effect, String),
    (sign, sources): (f64, &Sources),
) {
    let parameters = own.parameters.iter().map(|p| (p.name.clone(), blocks::value(effect, &p.name)));
    network.add_copy(&name, law.path(), parameters.collect());
    let formula = if sign < 0.0 && !own.port.replaces() { "-x" } else { "x" };
    let start = vec![
        ("formula".to_owned(), Value::String(formula.into())),
        ("replaces".to_owned(), Value::Boolean(own.port.replaces())),
    ];
    let description = format!("What the declared model lacks: {} = {}", own.kind, own.formula);
    let part = Part { name: format!("{name}{TAKES_OFF}"), template: "expression-effect", description, start };
    let (acts, input) = (part.name.clone(), "f_in");
    let further = vec![("x", None, end(&name, &law.output))];
    network.insert(to, Block { part, way: (input, "f_out", None), further }, false);
    for (place, input_of_fmu) in &law.inputs {
        let source = match place {
            0 => sources.x.clone().map(|source| (source, None)),
            1 => sources.v.clone().map(|source| (source, None)),
            _ => network.source_of(&end(&acts, input)),
        };
        let Some((source, conversion)) = source else { continue };
        network.connect(source, end(&name, input_of_fmu), None, 1.0);
        network.convert_last(conversion);
    }
}

/// The block of an effect that is a formula, with the name of its component and the values that its parameters have
/// in the answer.
pub fn block(own: &Own, (effect, name): (&Effect, String), sign: f64, sources: &Sources) -> Block {
    let names = |list: Vec<&str>| Value::String(list.join(" "));
    // What is taken off is added where a larger value makes the velocity or the level fall.
    let added = sign < 0.0 && !own.port.replaces();
    let formula = if added { format!("-({})", own.formula) } else { own.formula.clone() };
    let mut start = vec![
        ("formula".to_owned(), Value::String(formula)),
        ("replaces".to_owned(), Value::Boolean(own.port.replaces())),
        ("states".to_owned(), names(own.states.iter().map(|(name, _)| name.as_str()).collect())),
        ("parameters".to_owned(), names(own.parameters.iter().map(|p| p.name.as_str()).collect())),
    ];
    for (i, (_, rate)) in own.states.iter().enumerate() {
        start.push((format!("rate[{}]", i + 1), Value::String(rate.clone())));
    }
    for (i, parameter) in own.parameters.iter().enumerate() {
        start.push((format!("p[{}]", i + 1), Value::Real(blocks::value(effect, &parameter.name))));
    }
    let known = [(0, "x", &sources.x), (1, "v", &sources.v)];
    let further = known.into_iter().filter(|(i, ..)| own.uses(*i));
    let further = further.filter_map(|(_, name, source)| Some((name, None, source.clone()?))).collect();
    let description = format!("What the declared model lacks: {} = {}", own.kind, own.formula);
    let part = Part { name, template: "expression-effect", description, start };
    Block { part, way: ("f_in", "f_out", None), further }
}
