//! Declared dependencies against observed ones.

use std::sync::Arc;

use super::Findings;
use super::perturbation::{POINTS, Perturbation};
use crate::description::DependencyKind;
use crate::{Error, Fmu, InterfaceKind};

/// Changes of a known over its size: a small one, and one that leaves dead bands and saturation.
const CHANGES: [f64; 4] = [1e-3, -1e-3, 0.5, -0.5];

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    if let Err(error) = compare(fmu, kind, findings) {
        findings.error("dependencies", format!("interface {kind}"), error.to_string());
    }
}

fn compare(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) -> Result<(), Error> {
    let Some(mut function) = Perturbation::new(fmu, kind)? else { return Ok(()) };
    let name = |variable: usize| fmu.description.variables[variable].name.as_str();
    let (rows, columns) = (function.unknowns.len(), function.knowns.len());
    let mut changes = vec![vec![false; columns]; rows];
    let mut slopes: Vec<Vec<Vec<f64>>> = vec![vec![Vec::new(); columns]; rows];
    for number in 0..POINTS {
        function.go_to(number);
        let here = function.evaluate(0, 0.0)?;
        for column in 0..columns {
            for change in CHANGES {
                let scale = function.knowns[column].scale;
                // A value may lie outside of what the FMU accepts; that says nothing about dependencies.
                let Ok(there) = function.evaluate(column, change * scale) else { continue };
                (0..rows).for_each(|row| changes[row][column] |= here[row].to_bits() != there[row].to_bits());
            }
            if let Ok(Some(slope)) = function.slope(column) {
                (0..rows).for_each(|row| slopes[row][column].push(slope.central[row]));
            }
        }
    }
    for (row, unknown) in function.unknowns.iter().enumerate() {
        let Some(declared) = &unknown.dependencies else { continue };
        let mut unobserved = Vec::new();
        for (column, known) in function.knowns.iter().enumerate() {
            let place =
                || format!("interface {kind}, {} by {}", name(unknown.variable), name(known.variable));
            match declared.iter().find(|dependency| dependency.variable == known.variable) {
                None if changes[row][column] && unknown.reference == known.reference => {
                    let message = "a state that is an output depends on itself, which ModelStructure does not say; \
                                   FMI 2.0.4 section 2.2.8 leaves open whether it has to";
                    findings.note("dependency-on-itself", place(), message);
                }
                None if changes[row][column] => {
                    let message =
                        "the value depends on it, but the dependencies of ModelStructure do not say so";
                    findings.error("dependency-undeclared", place(), message);
                }
                Some(_) if !changes[row][column] => unobserved.push(name(known.variable)),
                Some(dependency) if is_linear(dependency.kind) && !known.is_single && !unknown.is_single => {
                    let rounding = 1e-8 * unknown.scale / known.scale;
                    if let Some((a, b)) = unlike(&slopes[row][column], rounding) {
                        let kind = format!("{:?}", dependency.kind).to_lowercase();
                        let message =
                            format!("dependenciesKind {kind}, but the slope is {a} here and {b} there");
                        findings.error("dependency-kind", place(), message);
                    }
                }
                _ => {}
            }
        }
        if !unobserved.is_empty() {
            let place = format!("interface {kind}, {}", name(unknown.variable));
            let message = format!(
                "declared dependencies without effect near the start values: {}",
                unobserved.join(", ")
            );
            findings.note("dependency-unobserved", place, message);
        }
    }
    Ok(())
}

/// Kinds whose slope may not change between events.
fn is_linear(kind: DependencyKind) -> bool {
    kind != DependencyKind::Dependent
}

/// Two slopes that differ by more than their error.
fn unlike(slopes: &[f64], rounding: f64) -> Option<(f64, f64)> {
    let (&first, rest) = slopes.split_first()?;
    let other =
        rest.iter().find(|&&other| (other - first).abs() > 1e-5 * first.abs().max(other.abs()) + rounding);
    other.map(|&other| (first, other))
}
