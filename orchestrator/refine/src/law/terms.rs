//! Effects of the list that are terms of a law: a law that adds something to an effect confirms it.

use super::found::Law;
use crate::answer::{Effect, Parameter};
use crate::share::percent;
use crate::vocabulary::Own;
use crate::vocabulary::builtin::Builtin;

/// Relative difference of the first parameter of an effect from that of a term up to which they are the same.
const MAX_DIFFERENCE_OF_SAME: f64 = 0.25;

/// Whether a law at the port of an effect has the effect as one of its terms, about as strong.
pub(super) fn holds(law: &Law, effect: &Effect) -> bool {
    let port = effect.port.as_deref().unwrap_or_default();
    let own = law.effect.own.as_ref().filter(|_| port == law.port);
    let formula = effect.own.as_deref().cloned().or_else(|| Builtin::formula(effect.kind()));
    let Some((own, formula)) = own.zip(formula) else { return false };
    // A signal is replaced, so that the terms stand within the difference from it.
    if own.port.replaces() || formula.port.replaces() || !formula.states.is_empty() {
        return false;
    }
    let wanted = shape(&formula.formula, &formula);
    let same = terms(&own.formula).into_iter().find(|term| shape(term, own) == wanted);
    let strength = |term: &str| {
        let of_law = law.effect.parameters.iter().find(|p| words(term).contains(&p.name.as_str()))?;
        Some((of_law.value, effect.parameters.first()?.value))
    };
    same.and_then(strength).is_some_and(|(a, b)| (a - b).abs() <= MAX_DIFFERENCE_OF_SAME * b.abs())
}

/// Sentence on a law beside the effect that it holds.
pub(super) fn told(law: &Law, effect: &Effect) -> String {
    let formula = law.effect.own.as_ref().map_or("", |own| &own.formula);
    let value = |p: &Parameter| format!("{} {:.4e} {}", p.name, p.value, p.unit);
    let values: Vec<String> = law.effect.parameters.iter().map(value).collect();
    format!(
        "`{}` is a term of a law at {} that takes away {} of the error on validation records: {formula}, with {}.",
        effect.id,
        law.port,
        percent(law.share),
        values.join(", ")
    )
}

/// Terms of a sum.
fn terms(formula: &str) -> Vec<&str> {
    let (mut found, mut depth, mut from) = (Vec::new(), 0, 0);
    for (k, c) in formula.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            '+' if depth == 0 => {
                found.push(formula[from..k].trim());
                from = k + 1;
            }
            _ => {}
        }
    }
    found.push(formula[from..].trim());
    found
}

/// Names and numbers of a formula, in order.
fn words(text: &str) -> Vec<&str> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    text.split(|c| !is_word(c)).filter(|word| !word.is_empty()).collect()
}

/// A formula without spaces and names of parameters. The place where a spring rests is a constant force, and a period
/// is a frequency.
fn shape(text: &str, own: &Own) -> String {
    let is_parameter = |word: &str| own.parameters.iter().any(|p| p.name == word);
    let mut found = String::new();
    let mut word = String::new();
    for c in text.chars().chain([' ']) {
        if c.is_alphanumeric() || c == '_' || c == '.' {
            word.push(c);
            continue;
        }
        found += if is_parameter(&word) { "#" } else { &word };
        word.clear();
        if c != ' ' {
            found.push(c);
        }
    }
    found.replace("2*pi*x/#", "#*x").replace("#*(x-#)", "#*x")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    /// A law of a joint with these parameters.
    fn law(formula: &str, parameters: &[(&str, &str, f64)]) -> Law {
        let table: String =
            parameters.iter().map(|(n, u, v)| format!("{n} = {{ unit = {u:?}, start = {v:?} }}\n")).collect();
        let text = format!(
            "kind = \"law\"\nport = \"torque\"\nformula = {formula:?}\nwords = \"law\"\n[parameters]\n{table}"
        );
        let own = Own::read(&text).unwrap();
        let value = |(name, unit, value): &(&str, &str, f64)| Parameter {
            name: (*name).into(),
            unit: (*unit).into(),
            value: *value,
            interval: (*value, *value),
        };
        let parameters = parameters.iter().map(value).collect();
        Law {
            port: "tau".into(),
            channel: String::new(),
            place: "@tau".into(),
            variables: Vec::new(),
            effect: Effect { own: Some(Arc::new(own)), parameters, ..Effect::default() },
            curve: Vec::new(),
            named: true,
            of_free_form: 1.0,
            share: 0.99,
            rivals: Vec::new(),
            covered: Vec::new(),
            dissipation: None,
            toml: String::new(),
        }
    }

    fn effect(id: &str, value: f64) -> Effect {
        let first = Parameter { name: "p".into(), unit: "1".into(), value, interval: (value, value) };
        Effect { id: id.into(), port: Some("tau".into()), parameters: vec![first], ..Effect::default() }
    }

    #[test]
    fn an_effect_is_a_term_of_a_law_where_shape_and_strength_agree() {
        let bump = law(
            "a1*v + a2*exp(-((x - m2)/w2)^2)",
            &[("a1", "N.m.s/rad", 5e-4), ("a2", "N.m", 0.05), ("m2", "rad", 1.0), ("w2", "rad", 2.0)],
        );
        assert!(holds(&bump, &effect("viscous@tau", 4.5e-4)));
        for (id, value) in
            [("viscous@tau", 9e-4), ("viscous@tau", -5e-4), ("quaddrag@tau", 5e-4), ("coulomb@tau", 0.05)]
        {
            assert!(!holds(&bump, &effect(id, value)), "{id} {value}");
        }
        assert!(!holds(&bump, &Effect { port: Some("other".into()), ..effect("viscous@tau", 5e-4) }));
    }

    #[test]
    fn frictions_springs_and_cogging_are_known_by_their_shape() {
        let own = law(
            "a1*x + a2*tanh(v/s2) + a3*sin(q3*x + p3) + a4*abs(v)*v",
            &[
                ("a1", "N.m/rad", 2.0),
                ("a2", "N.m", 0.1),
                ("s2", "rad/s", 0.1),
                ("a3", "N.m", 0.3),
                ("q3", "1", 4.0),
                ("p3", "rad", 0.0),
                ("a4", "N.m.s2/rad2", 0.7),
            ],
        );
        for (id, value) in [("spring", 2.1), ("cf.coulomb", 0.1), ("cogging@tau", 0.3), ("quaddrag", 0.7)] {
            assert!(holds(&own, &effect(id, value)), "{id}");
        }
        assert!(!holds(&own, &effect("viscous", 2.0)));
    }
}
