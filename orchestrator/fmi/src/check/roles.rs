//! Causality, variability, initial and start: which combinations the standard allows, and aliases.

use std::collections::HashMap;

use super::{Findings, element};
use crate::description::{
    Causality, Initial, ModelDescription, Variability, Variable, VariableKind, allowed_initials,
};
use crate::xml::Element;

pub(super) fn check(description: &ModelDescription, findings: &mut Findings) {
    for variable in &description.variables {
        check_combination(variable, findings);
        check_start(variable, findings);
    }
    let independent = description.variables.iter().filter(|v| v.causality == Causality::Independent);
    for (count, variable) in independent.enumerate() {
        if count > 0 {
            let message = "there is more than one variable of causality independent";
            findings.error("independent", element(variable), message);
        }
        if !matches!(variable.kind, VariableKind::Real(_)) {
            findings.error("independent", element(variable), "the independent variable must be Real");
        }
    }
    check_alias_units(description, findings);
}

/// The schema of FMI 2.0 makes a variable without `variability` continuous, also where its type cannot be.
pub(super) fn check_default_variability(root: &Element, findings: &mut Findings) {
    let variables = root.child("ModelVariables").into_iter().flat_map(|list| list.children("ScalarVariable"));
    for variable in variables.filter(|variable| variable.attribute("variability").is_none()) {
        let Some(kind) = variable.children.iter().find(|kind| kind.name != "Annotations") else { continue };
        if kind.name != "Real" {
            let place = format!(
                "variable {} (line {})",
                variable.attribute("name").unwrap_or_default(),
                variable.line
            );
            let message = format!(
                "it has no variability, which makes it continuous (FMI 2.0.4 section 2.2.7), and that is for Real, not {}",
                kind.name
            );
            findings.error("causality-variability", place, message);
        }
    }
}

fn check_combination(variable: &Variable, findings: &mut Findings) {
    let (causality, variability) = (variable.causality, variable.variability);
    let described = || format!("{causality:?} with variability {variability:?}").to_lowercase();
    match (allowed_initials(causality, variability), variable.declared_initial) {
        (None, _) => {
            let message = format!("causality {} is not allowed", described());
            findings.error("causality-variability", element(variable), message);
        }
        (Some([]), Some(initial)) => {
            let message = format!("initial={initial:?} where causality {} must not have it", described());
            findings.error("initial", element(variable), message.to_lowercase());
        }
        (Some(allowed), Some(initial)) if !allowed.contains(&initial) => {
            let message = format!("initial={initial:?} where causality {} allows {allowed:?}", described());
            findings.error("initial", element(variable), message.to_lowercase());
        }
        _ => {}
    }
    if variability == Variability::Continuous && !matches!(variable.kind, VariableKind::Real(_)) {
        let message = format!("variability continuous is for Real, not {}", variable.kind.name());
        findings.error("causality-variability", element(variable), message);
    }
}

fn check_start(variable: &Variable, findings: &mut Findings) {
    let needed = variable.variability == Variability::Constant
        || matches!(variable.causality, Causality::Input | Causality::Parameter)
        || matches!(variable.initial, Some(Initial::Exact | Initial::Approx));
    let forbidden =
        variable.causality == Causality::Independent || variable.initial == Some(Initial::Calculated);
    if needed && !variable.kind.has_start() {
        findings.error(
            "start-missing",
            element(variable),
            "it needs a start value (input, parameter, constant, or initial exact or approx)",
        );
    }
    if forbidden && variable.kind.has_start() {
        let message = "it must not have a start value (independent variable, or initial calculated)";
        findings.error("start-forbidden", element(variable), message);
    }
}

/// Aliases hold one value, so they must have one unit.
fn check_alias_units(description: &ModelDescription, findings: &mut Findings) {
    let mut first: HashMap<u32, &Variable> = HashMap::new();
    for variable in &description.variables {
        let VariableKind::Real(real) = &variable.kind else { continue };
        let other = *first.entry(variable.value_reference).or_insert(variable);
        let VariableKind::Real(other_real) = &other.kind else { continue };
        if real.unit != other_real.unit {
            let message = format!("it is an alias of {} but has another unit", other.name);
            findings.error("alias", element(variable), message);
        }
    }
}
