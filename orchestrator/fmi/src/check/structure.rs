//! `ModelStructure`: complete, in order, consistent with `derivative` and `initial`, dependencies on knowns only.

use std::collections::HashSet;

use super::{Findings, Severity, element};
use crate::description::{
    Causality, Initial, ModelDescription, Unknown, Variability, Variable, VariableKind,
};

pub(super) fn check(description: &ModelDescription, findings: &mut Findings) {
    check_outputs(description, findings);
    check_derivatives(description, findings);
    check_initial_unknowns(description, findings);
    check_knowns(description, findings);
    if description.model_exchange.is_some() && !description.states_number_of_event_indicators {
        findings.error(
            "event-indicators",
            "fmiModelDescription",
            "numberOfEventIndicators is missing, which Model Exchange needs; write 0 if there are none",
        );
    }
}

/// Positions in a list, with a finding for each that occurs twice.
fn positions(
    description: &ModelDescription,
    list: &str,
    unknowns: &[Unknown],
    findings: &mut Findings,
) -> HashSet<usize> {
    let mut seen = HashSet::new();
    for unknown in unknowns {
        if !seen.insert(unknown.variable) {
            let message = format!("it is listed twice in ModelStructure/{list}");
            findings.error("structure-duplicate", element(&description.variables[unknown.variable]), message);
        }
    }
    seen
}

fn check_outputs(description: &ModelDescription, findings: &mut Findings) {
    let listed = positions(description, "Outputs", &description.outputs, findings);
    for (position, variable) in description.variables.iter().enumerate() {
        match (variable.causality == Causality::Output, listed.contains(&position)) {
            (true, false) => {
                findings.error(
                    "structure-outputs",
                    element(variable),
                    "this output is missing in ModelStructure/Outputs",
                );
            }
            (false, true) => {
                findings.error(
                    "structure-outputs",
                    element(variable),
                    "ModelStructure/Outputs lists it, but it is not an output",
                );
            }
            _ => {}
        }
    }
    if let Some(pair) = description.outputs.windows(2).find(|pair| pair[1].variable < pair[0].variable) {
        let message = "ModelStructure/Outputs lists it out of the order of the variables";
        findings.warning("structure-order", element(&description.variables[pair[1].variable]), message);
    }
}

fn derivative_of(variable: &Variable) -> Option<usize> {
    match &variable.kind {
        VariableKind::Real(real) => real.derivative,
        _ => None,
    }
}

fn check_derivatives(description: &ModelDescription, findings: &mut Findings) {
    let listed = positions(description, "Derivatives", &description.derivatives, findings);
    for (position, variable) in description.variables.iter().enumerate() {
        let derivative = derivative_of(variable);
        if listed.contains(&position) && derivative.is_none() {
            let message = "ModelStructure/Derivatives lists it, but it has no attribute derivative";
            findings.error("structure-derivatives", element(variable), message);
        }
        let Some(state) = derivative else { continue };
        // A state of Co-Simulation may stay hidden; Model Exchange must list every derivative.
        if !listed.contains(&position) && description.model_exchange.is_some() {
            let message = "it has the attribute derivative but is missing in ModelStructure/Derivatives";
            findings.error("structure-derivatives", element(variable), message);
        }
        let state_variable = &description.variables[state];
        let is_state = state != position
            && matches!(state_variable.kind, VariableKind::Real(_))
            && state_variable.variability == Variability::Continuous
            && matches!(state_variable.causality, Causality::Output | Causality::Local);
        if !is_state {
            let message = format!(
                "derivative=\"{}\" points at {}, which is not a state (a continuous Real of causality local or output)",
                state + 1,
                state_variable.name
            );
            findings.error("derivative-of-non-state", element(variable), message);
        }
    }
    let mut states = HashSet::new();
    for unknown in &description.derivatives {
        if let Some(state) = derivative_of(&description.variables[unknown.variable])
            && !states.insert(state)
        {
            let message = "another listed variable is the derivative of the same state";
            findings.error(
                "structure-derivatives",
                element(&description.variables[unknown.variable]),
                message,
            );
        }
    }
}

fn check_initial_unknowns(description: &ModelDescription, findings: &mut Findings) {
    let listed = positions(description, "InitialUnknowns", &description.initial_unknowns, findings);
    let states: HashSet<usize> = description.continuous_states().collect();
    let derivatives: HashSet<usize> =
        description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let same =
        |a: &Variable, b: &Variable| a.value_reference == b.value_reference && a.kind.name() == b.kind.name();
    for (position, variable) in description.variables.iter().enumerate() {
        let computed = matches!(variable.initial, Some(Initial::Approx | Initial::Calculated));
        let role = variable.causality == Causality::Output
            || variable.causality == Causality::CalculatedParameter
            || states.contains(&position)
            || derivatives.contains(&position);
        let alias = || listed.iter().any(|&other| same(&description.variables[other], variable));
        if computed && role && !listed.contains(&position) && !alias() {
            let message = "it is computed at initialization (output, calculatedParameter, state or derivative with \
                           initial approx or calculated) but is missing in ModelStructure/InitialUnknowns";
            findings.error("structure-initial-unknowns", element(variable), message);
        }
        if listed.contains(&position) && !(computed && role) {
            let message = "ModelStructure/InitialUnknowns lists it, but it is not computed at initialization";
            findings.error("structure-initial-unknowns", element(variable), message);
        }
    }
}

/// FMI 2.0.4 section 2.2.8: unknowns depend on inputs, states and the independent variable; at initialization also on
/// variables with exact start values. Parameters are not knowns of outputs and derivatives.
fn check_knowns(description: &ModelDescription, findings: &mut Findings) {
    let states: HashSet<usize> = description.continuous_states().collect();
    let lists = [
        ("Outputs", &description.outputs, false),
        ("Derivatives", &description.derivatives, false),
        ("InitialUnknowns", &description.initial_unknowns, true),
    ];
    for (list, unknowns, initial) in lists {
        for unknown in unknowns {
            let place =
                || format!("ModelStructure/{list}, {}", element(&description.variables[unknown.variable]));
            let mut seen = HashSet::new();
            for dependency in unknown.dependencies.iter().flatten() {
                let known = &description.variables[dependency.variable];
                let allowed = matches!(known.causality, Causality::Input | Causality::Independent)
                    || states.contains(&dependency.variable)
                    || (initial && known.initial == Some(Initial::Exact));
                if !allowed {
                    // A parameter is constant in this list; naming it misleads nobody about states and inputs.
                    let harmless = known.causality == Causality::Parameter;
                    let severity = if harmless { Severity::Warning } else { Severity::Error };
                    let more = if initial { ", variables with initial=\"exact\"" } else { "" };
                    let message = format!(
                        "it depends on {}, which is not a known of this list (FMI 2.0.4 section 2.2.8: inputs, states, the independent variable{more})",
                        known.name
                    );
                    findings.add(severity, "structure-knowns", place(), message);
                }
                if !seen.insert(dependency.variable) {
                    let message = format!("it names the dependency {} twice", known.name);
                    findings.error("structure-duplicate", place(), message);
                }
            }
        }
    }
}
