//! `TypeDefinitions`, and attributes of variables that only some may have.

use std::collections::HashSet;

use super::{Findings, element};
use crate::description::{Causality, ModelDescription, RealAttributes, Variability, Variable, VariableKind};

pub(super) fn check(description: &ModelDescription, findings: &mut Findings) {
    for declared in &description.types {
        let place = || format!("SimpleType {}", declared.name);
        let mut seen = (HashSet::new(), HashSet::new());
        for (name, value) in &declared.items {
            if !seen.0.insert(name) || !seen.1.insert(value) {
                let message = format!("its item {name}={value} has the name or the value of another item");
                findings.error("duplicate-definition", place(), message);
            }
        }
        match &declared.kind {
            VariableKind::Real(real) => judge_real(description, real, &place(), findings),
            VariableKind::Integer { min, max, .. } => {
                if let (Some(min), Some(max)) = (min, max)
                    && min > max
                {
                    findings.error("min-max", place(), format!("min={min} is larger than max={max}"));
                }
            }
            _ => {}
        }
    }
    if description.is_fmi3() && !description.variables.iter().any(|v| v.causality == Causality::Independent) {
        let message = "there is no variable of causality independent, which FMI 3.0 asks for";
        findings.error("independent", "ModelVariables", message);
    }
    let states: HashSet<usize> = description.variables.iter().filter_map(derivative).collect();
    for (position, variable) in description.variables.iter().enumerate() {
        judge_state_attributes(description, variable, states.contains(&position), findings);
        if variable.can_handle_multiple_set.is_some() && variable.causality != Causality::Input {
            let message = "canHandleMultipleSetPerTimeInstant is for inputs only";
            findings.error("multiple-set", element(variable), message);
        }
    }
}

fn derivative(variable: &Variable) -> Option<usize> {
    match &variable.kind {
        VariableKind::Real(real) => real.derivative,
        _ => None,
    }
}

fn judge_real(description: &ModelDescription, real: &RealAttributes, place: &str, findings: &mut Findings) {
    if let (Some(min), Some(max)) = (real.min, real.max)
        && min > max
    {
        findings.error("min-max", place, format!("min={min} is larger than max={max}"));
    }
    if let Some(nominal) = real.nominal.filter(|nominal| *nominal <= 0.0) {
        findings.error("nominal", place, format!("nominal={nominal} where a positive number is needed"));
    }
    if let Some(unit) = &real.unit
        && !description.units.iter().any(|known| known.name == *unit)
    {
        findings.error("unit-undeclared", place, format!("unit=\"{unit}\" is not among the UnitDefinitions"));
    }
}

/// `reinit` is for states, `derivative` for continuous variables.
fn judge_state_attributes(
    description: &ModelDescription,
    variable: &Variable,
    is_state: bool,
    findings: &mut Findings,
) {
    let VariableKind::Real(real) = &variable.kind else { return };
    if real.reinit && !is_state {
        let message = "reinit=\"true\", but it is no continuous state: no variable is its derivative";
        findings.error("reinit", element(variable), message);
    }
    let Some(state) = real.derivative.map(|state| &description.variables[state]) else { return };
    if variable.variability != Variability::Continuous {
        let message = format!(
            "it is the derivative of {} and of variability {}; a derivative is continuous",
            state.name,
            format!("{:?}", variable.variability).to_lowercase()
        );
        findings.error("derivative-variability", element(variable), message);
    }
    if matches!(variable.causality, Causality::Parameter | Causality::Input | Causality::Independent) {
        let message =
            format!("it is the derivative of {}, which the FMU computes; it cannot be set", state.name);
        findings.error("derivative-variability", element(variable), message);
    }
    judge_unit(description, variable, state, findings);
}

/// The unit of a derivative is that of the state per second.
fn judge_unit(
    description: &ModelDescription,
    variable: &Variable,
    state: &Variable,
    findings: &mut Findings,
) {
    let unit = |variable: &Variable| match &variable.kind {
        VariableKind::Real(real) => {
            let name = real.unit.as_ref()?;
            description.units.iter().find(|unit| unit.name == *name)?.base
        }
        _ => None,
    };
    let (Some(rate), Some(of)) = (unit(variable), unit(state)) else { return };
    let mut expected = of.exponents;
    expected.s -= 1;
    if rate.exponents != expected {
        let message = format!(
            "its unit has the base units {}, the derivative of {} needs {expected}",
            rate.exponents, state.name
        );
        findings.warning("unit-base", element(variable), message);
    }
}
