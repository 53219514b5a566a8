//! fmi2GetDirectionalDerivative against central differences.

use std::collections::HashSet;
use std::sync::Arc;

use super::perturbation::{POINTS, Perturbation, Slope};
use super::{Findings, Severity};
use crate::{Error, Fmu, InterfaceKind};

/// Relative tolerance: central differences are good to about 1e-10, second derivatives of rough functions take
/// several digits of that.
const RELATIVE_TOLERANCE: f64 = 1e-5;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    if !fmu.interface(kind).is_some_and(|interface| interface.provides_directional_derivative) {
        return;
    }
    if let Err(error) = compare(fmu, kind, findings) {
        findings.error("directional-derivative", format!("interface {kind}"), error.to_string());
    }
}

fn compare(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) -> Result<(), Error> {
    let Some(mut function) = Perturbation::new(fmu, kind)? else { return Ok(()) };
    let name = |variable: usize| fmu.description.variables[variable].name.as_str();
    let mut found = HashSet::new();
    for number in 0..POINTS {
        function.go_to(number);
        let mut mixed_seed = Vec::with_capacity(function.knowns.len());
        let mut sum = vec![0.0; function.unknowns.len()];
        for index in 0..function.knowns.len() {
            let mut seed = vec![0.0; function.knowns.len()];
            seed[index] = 1.0;
            let column = function.directional(&seed)?;
            let seed = 1.5 + index as f64;
            mixed_seed.push(seed);
            sum.iter_mut().zip(&column).for_each(|(sum, entry)| *sum += seed * entry);
            let Some(slope) = function.slope(index)? else { continue };
            let known = &function.knowns[index];
            for (row, unknown) in function.unknowns.iter().enumerate() {
                let (exact, central) = (column[row], slope.central[row]);
                let rounding = 1e-8 * (slope.values[row].abs() + unknown.scale) / known.scale;
                let tolerance = RELATIVE_TOLERANCE * exact.abs().max(central.abs()) + rounding;
                if known.is_single
                    || unknown.is_single
                    || !is_smooth(&slope, row, rounding)
                    || (exact - central).abs() <= tolerance
                {
                    continue;
                }
                let place =
                    format!("interface {kind}, {} by {}", name(unknown.variable), name(known.variable));
                let message =
                    format!("fmi2GetDirectionalDerivative gives {exact}, a central difference {central}");
                // A state that is an output: some FMUs leave out what is 1 by definition.
                let by_itself = unknown.reference == known.reference && exact == 0.0;
                let severity = if by_itself { Severity::Warning } else { Severity::Error };
                if found.insert((unknown.variable, known.variable)) {
                    findings.add(severity, "directional-derivative", place, message);
                }
            }
        }
        let mixed = function.directional(&mixed_seed)?;
        let linear = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * (a.abs() + b.abs()) + 1e-12;
        if !mixed.iter().zip(&sum).all(linear) {
            let message = "the answer for several seeds at once is not the sum of the answers for each";
            findings.error("directional-derivative", format!("interface {kind}"), message);
            return Ok(());
        }
    }
    Ok(())
}

/// At a kink there is no derivative to compare with.
fn is_smooth(slope: &Slope, row: usize, rounding: f64) -> bool {
    let (forward, backward) = (slope.forward[row], slope.backward[row]);
    (forward - backward).abs() <= 0.1 * forward.abs().max(backward.abs()) + rounding
}
