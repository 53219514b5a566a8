//! Values change only when their variability allows, reading changes nothing, and many values read at once are those
//! read one by one.

use std::sync::Arc;

use super::probe::{Advance, Probe, Value, difference};
use super::{Findings, element};
use crate::description::{Variability, Variable, VariableKind};
use crate::{Error, Fmu, InterfaceKind};

/// Steps of the run.
const STEPS: usize = 10;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    if let Err(error) = run(fmu, kind, findings) {
        findings.error("variability", format!("interface {kind}"), error.to_string());
    }
}

fn run(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) -> Result<(), Error> {
    let mut probe = Probe::new(fmu, kind)?;
    if probe.initialize()? != Advance::Done {
        return Ok(());
    }
    let first = probe.values()?;
    let mut reported = vec![false; first.len()];
    let mut before = first;
    for _ in 0..STEPS {
        let events = probe.events();
        if probe.advance(1)? != Advance::Done {
            break;
        }
        let after = probe.values()?;
        let was_event = kind == InterfaceKind::CoSimulation || probe.events() != events;
        for (position, variable) in fmu.description.variables.iter().enumerate() {
            let (old, new) = (&before[position], &after[position]);
            if old == new || reported[position] || may_change(variable, was_event) {
                continue;
            }
            reported[position] = true;
            let variability = format!("{:?}", variable.variability).to_lowercase();
            let between = if was_event { "" } else { " between events" };
            let message =
                format!("{kind}: of variability {variability}, it changes from {old} to {new}{between}");
            findings.error("variability", element(variable), message);
        }
        before = after;
    }
    reading(&mut probe, fmu, kind, findings)
}

fn may_change(variable: &Variable, at_event: bool) -> bool {
    match variable.variability {
        Variability::Constant | Variability::Fixed | Variability::Tunable => false,
        Variability::Discrete => at_event,
        Variability::Continuous => true,
    }
}

/// Values read again, and all Reals and Integers in one call, last first.
fn reading(probe: &mut Probe, fmu: &Fmu, kind: InterfaceKind, findings: &mut Findings) -> Result<(), Error> {
    let place = format!("interface {kind}");
    let one_by_one = probe.values()?;
    if let Some(what) = difference(&fmu.description, &one_by_one, &probe.values()?) {
        findings.error("reading", &place, format!("read twice in a row, {what}"));
        return Ok(());
    }
    let mut together = one_by_one.clone();
    let of = |wanted: fn(&VariableKind) -> bool| -> (Vec<usize>, Vec<u32>) {
        let variables = fmu.description.variables.iter().enumerate().rev();
        let wanted = variables.filter(|(_, variable)| wanted(&variable.kind));
        wanted.map(|(position, variable)| (position, variable.value_reference)).unzip()
    };
    let (positions, references) = of(|kind| matches!(kind, VariableKind::Real(_)));
    let mut reals = vec![0.0; references.len()];
    probe.instance().get_real(&references, &mut reals)?;
    positions.iter().zip(reals).for_each(|(&at, value)| together[at] = Value::Real(value.to_bits()));
    let (positions, references) =
        of(|kind| matches!(kind, VariableKind::Integer { .. } | VariableKind::Enumeration { .. }));
    let mut integers = vec![0; references.len()];
    probe.instance().get_integer(&references, &mut integers)?;
    positions.iter().zip(integers).for_each(|(&at, value)| together[at] = Value::Integer(value));
    let (positions, references) = of(|kind| matches!(kind, VariableKind::Boolean { .. }));
    let mut booleans = vec![false; references.len()];
    probe.instance().get_boolean(&references, &mut booleans)?;
    positions.iter().zip(booleans).for_each(|(&at, value)| together[at] = Value::Boolean(value));
    if let Some(what) = difference(&fmu.description, &one_by_one, &together) {
        findings.error("reading", place, format!("read alone and in one call with others, {what}"));
    }
    Ok(())
}
