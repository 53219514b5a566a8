//! Fitted parameters as the physical quantities of the vocabulary.

use super::parameters::*;
use crate::engine::candidate::Candidate;

/// A physical parameter: name, unit, value.
pub type Quantity = (String, String, f64);

/// The parameters of a candidate in the terms of the vocabulary.
pub fn quantities(candidate: &Candidate, p: &[f64]) -> Vec<Quantity> {
    let q = |name: &str, unit: &str, value: f64| (name.to_owned(), unit.to_owned(), value);
    match candidate.id {
        "cart.spring" => {
            let stiffness = p[SPRING];
            let rest = if stiffness > 0.0 { p[SPRING_FORCE] / stiffness } else { 0.0 };
            vec![q("stiffness", "N/m", stiffness), q("rest", "m", rest)]
        }
        "cart.cogging" => {
            let (sin, cos) = (p[COG_SIN], p[COG_COS]);
            vec![
                q("amp", "N", sin.hypot(cos)),
                q("period", "m", p[COG_PERIOD]),
                q("phase", "rad", cos.atan2(sin)),
            ]
        }
        _ => candidate
            .free
            .iter()
            .map(|free| {
                let definition = &TABLE[free.index];
                let mut name = definition.name.rsplit('.').next().unwrap_or(definition.name);
                if candidate.signal.is_some() {
                    // `sensor.delay.x`: the effect names the parameter.
                    name = match candidate.id {
                        "sensor.offset" => "value",
                        "sensor.delay" => "delay",
                        _ => "gain",
                    };
                }
                q(name, definition.unit, p[free.index])
            })
            .collect(),
    }
}
