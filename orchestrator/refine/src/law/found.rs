//! Result of the search for a law, and the sentences of the report about it.

use std::sync::Arc;

use crate::answer::{Effect, Parameter};
use crate::vocabulary::Own;

/// A law that was found at a port.
#[derive(Debug, Clone)]
pub struct Law {
    /// Input where it acts.
    pub port: String,
    /// Channel; empty where none is declared.
    pub channel: String,
    /// Where it acts: `channel@port`, `@port`, or a channel alone.
    pub place: String,
    /// Variables in the words of the vocabulary.
    pub variables: Vec<String>,
    /// The law as an effect, with its formula and parameters.
    pub effect: Effect,
    /// Curve through the free form: place, height, half the width of its 95 % band; empty for two variables.
    pub curve: Vec<[f64; 3]>,
    /// Whether the formula is named, or the curve itself is the answer.
    pub named: bool,
    /// Share of the free form's gain on held-out parts that the formula takes.
    pub of_free_form: f64,
    /// Share of the error on validation records.
    pub share: f64,
    /// Formulas that do as well: text, share of the free form's gain.
    pub rivals: Vec<(String, f64)>,
    /// Least and largest value of each variable in the estimation records, with its unit.
    pub covered: Vec<(String, f64, f64, String)>,
    /// Mean power that the law takes out of the motion, over its mean magnitude: 1 takes energy always, 0 stores it.
    pub dissipation: Option<f64>,
    /// The law as TOML.
    pub toml: String,
}

/// Sentences on a law.
pub fn told(law: &Law) -> Vec<String> {
    let mut found = Vec::new();
    let range = |(name, low, high, unit): &(String, f64, f64, String)| {
        format!("{name} from {low:.4} to {high:.4} {unit}")
    };
    let covered: Vec<String> = law.covered.iter().map(range).collect();
    if !covered.is_empty() {
        found.push(format!(
        "The law at {} is known where the estimation records have been: {}; beyond it is an extrapolation (a curve goes on straight).",
        law.port,
        covered.join(", ")
    ));
    }
    if let Some(part) = law.dissipation {
        found.push(if part > 0.5 {
            format!("It takes energy out of the motion: mean power over mean magnitude of power {part:.2}.")
        } else if part < -0.5 {
            format!("It drives the motion: mean power over mean magnitude of power {part:.2}.")
        } else {
            format!("It stores energy and gives it back, for the most part: mean power over mean magnitude of power {part:.2}.")
        });
    }
    for (text, share) in &law.rivals {
        found
            .push(format!("Another formula does as well: {text} ({:.1} % of the free form).", 100.0 * share));
    }
    found
}

/// Parameters of a law with their intervals: `values`, and half of the width for each.
pub(super) fn parameters<'a>(
    own: &'a Own,
    values: impl Iterator<Item = (f64, f64)> + 'a,
) -> impl Iterator<Item = Parameter> + 'a {
    own.parameters.iter().zip(values).map(|(p, (value, half))| Parameter {
        name: p.name.clone(),
        unit: p.unit.clone(),
        value,
        interval: (value - half, value + half),
    })
}

/// A law as an effect of the answer.
pub(super) fn as_effect(own: &Arc<Own>, channel: &str, share: f64, parameters: Vec<Parameter>) -> Effect {
    Effect {
        id: own.kind.clone(),
        channel: channel.to_owned(),
        selected: true,
        share: Some(share),
        parameters,
        reason: "it takes what a free form takes".into(),
        own: Some(Arc::clone(own)),
        ..Effect::default()
    }
}

/// Mean of powers over their mean magnitude; none where nothing moves.
pub(super) fn dissipation(powers: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, size) = powers.fold((0.0, 0.0), |(sum, size), power| (sum + power, size + power.abs()));
    (size > 0.0 && f64::is_finite(sum)).then_some(sum / size)
}
