//! Values during a run against the bounds and items that the description gives.

use std::sync::Arc;

use super::probe::{Advance, Probe, Value};
use super::{Findings, Severity, element};
use crate::description::VariableKind;
use crate::{Error, Fmu, InterfaceKind};

/// Steps of the run.
const STEPS: usize = 20;

/// A bound may be passed by rounding, over its size.
const ROUNDING: f64 = 1e-9;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    // Whatever ends a run is a finding of the life-cycle.
    let _ = run(fmu, kind, findings);
}

fn run(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) -> Result<(), Error> {
    let mut probe = Probe::new(fmu, kind)?;
    let mut reported = vec![false; fmu.description.variables.len()];
    let mut outcome = probe.initialize()?;
    for _ in 0..STEPS {
        if outcome != Advance::Done {
            break;
        }
        let values = probe.values()?;
        for (position, (variable, value)) in fmu.description.variables.iter().zip(&values).enumerate() {
            if reported[position] {
                continue;
            }
            if let Some((severity, message)) = outside(fmu, &variable.kind, value) {
                reported[position] = true;
                findings.add(severity, "range", element(variable), format!("{kind}: {message}"));
            }
        }
        outcome = probe.advance(1)?;
    }
    Ok(())
}

fn outside(fmu: &Fmu, kind: &VariableKind, value: &Value) -> Option<(Severity, String)> {
    let (min, max) = match kind {
        VariableKind::Real(real) => (real.min, real.max),
        VariableKind::Integer { min, max, .. } | VariableKind::Enumeration { min, max, .. } => {
            (min.map(|min| min as f64), max.map(|max| max as f64))
        }
        VariableKind::Boolean { .. } | VariableKind::String { .. } => return None,
    };
    let number = match value {
        Value::Real(bits) => f64::from_bits(*bits),
        Value::Integer(value) => *value as f64,
        Value::Boolean(_) | Value::String(_) => return None,
    };
    if let (VariableKind::Enumeration { declared_type, .. }, Value::Integer(value)) = (kind, value) {
        let items = fmu.description.types.iter().find(|declared| declared.name == *declared_type)?;
        if !items.items.iter().any(|(_, item)| item == value) {
            let message = format!("its value {value} is not an item of the enumeration {declared_type}");
            return Some((Severity::Error, message));
        }
    }
    let below = min.filter(|min| number < min - ROUNDING * min.abs());
    let above = max.filter(|max| number > max + ROUNDING * max.abs());
    let bound = below.map(|min| format!("below min={min}")).or(above.map(|max| format!("above max={max}")))?;
    Some((Severity::Warning, format!("its value {number} is {bound}")))
}
