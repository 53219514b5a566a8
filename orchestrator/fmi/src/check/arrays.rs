//! Arrays of FMI 3.0: as many start values as elements, lengths that are known, and bytes that fit (definition of
//! model variables, section 2.4.7).

use std::collections::HashMap;

use super::{Findings, Severity};
use crate::xml::Element;

/// Judges the variables of a description.
pub(super) fn check(root: &Element, findings: &mut Findings) {
    let Some(list) = root.child("ModelVariables") else { return };
    let number = |element: &Element, name: &str| element.attribute(name)?.trim().parse::<u64>().ok();
    let lengths: HashMap<u64, u64> = list
        .children
        .iter()
        .filter_map(|own| Some((number(own, "valueReference")?, number(own, "start")?)))
        .collect();
    for element in &list.children {
        let place = || format!("{} {}", element.name, element.attribute("name").unwrap_or_default());
        let own = number(element, "valueReference");
        let dimensions = || element.children("Dimension");
        if own.is_some() && dimensions().any(|one| number(one, "valueReference") == own) {
            findings.error("dimension", place(), "its Dimension refers to itself: the length is not known");
            continue;
        }
        let length = |one: &Element| match number(one, "start") {
            Some(length) => Some(length),
            None => lengths.get(&number(one, "valueReference")?).copied(),
        };
        let elements = dimensions().try_fold(1_u64, |product, one| product.checked_mul(length(one)?));
        let starts = match element.children("Start").count() {
            0 => element.attribute("start").map_or(0, |text| text.split_whitespace().count()),
            count => count,
        } as u64;
        // One value stands for all elements.
        if let Some(elements) = elements.filter(|elements| starts > 1 && *elements != starts) {
            let message =
                format!("{starts} start values for {elements} elements; give as many, or one for all");
            // Values for the elements that a longer array would have do no harm.
            let spare = starts > elements && dimensions().any(|one| number(one, "valueReference").is_some());
            let severity = if spare { Severity::Note } else { Severity::Error };
            findings.add(severity, "start-count", place(), message);
        }
        let Some(most) = number(element, "maxSize").filter(|_| element.name == "Binary") else { continue };
        let sizes = element.children("Start").filter_map(|start| start.attribute("value"));
        if let Some(bytes) = sizes.map(|value| value.len() as u64 / 2).find(|bytes| *bytes > most) {
            let message = format!("a start value has {bytes} bytes, more than maxSize=\"{most}\"");
            findings.error("max-size", place(), message);
        }
    }
}
