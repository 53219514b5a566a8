//! The block of an effect that is written as a formula.

use super::blocks::{self, Sources};
use super::network::{Block, Part};
use crate::answer::Effect;
use crate::vocabulary::Own;
use airloop_fmi::derive::Value;

/// The block of an effect of one's own, with the name of its component and the values that its parameters have in the
/// answer.
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
    let used = |i: usize| own.expression.uses(i) || own.rates.iter().any(|rate| rate.uses(i));
    let known = [(0, "x", &sources.x), (1, "v", &sources.v)];
    let further = known.into_iter().filter(|(i, ..)| used(*i));
    let further = further.filter_map(|(_, name, source)| Some((name, None, source.clone()?))).collect();
    let description = format!("What the declared model lacks: {} = {}", own.kind, own.formula);
    let part = Part { name, template: "expression-effect", description, start };
    Block { part, way: ("f_in", "f_out", None), further }
}
