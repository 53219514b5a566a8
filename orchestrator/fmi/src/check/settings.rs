//! Values that are set are kept, and by this instance alone: parameters, inputs and starts of states before
//! initialization, inputs and tunable parameters during a run, all of them gone after a reset.

use std::sync::Arc;

use super::probe::{Advance, Probe, Value, difference};
use super::{Findings, element};
use crate::description::{Causality, Initial, Variability, Variable, VariableKind};
use crate::{Error, Fmu, InterfaceKind};

/// Steps of a run with changed values.
const STEPS: usize = 10;

/// Change of a number over its size: enough to be seen, too little to leave what a model is made for.
const CHANGE: f64 = 0.0625;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    let changes = changes(fmu);
    if changes.is_empty() {
        return;
    }
    // Some models fail with an odd text or mode, which says nothing against them.
    let numbers: Vec<_> =
        changes.iter().filter(|(_, value)| matches!(value, Value::Real(_))).cloned().collect();
    let mut first = Findings::default();
    match run(fmu, kind, &changes, &mut first) {
        Ok(()) => findings.0.append(&mut first.0),
        Err(_) if numbers.len() < changes.len() => {
            if let Err(error) = run(fmu, kind, &numbers, findings) {
                refused(kind, &error, findings);
            }
        }
        Err(error) => refused(kind, &error, findings),
    }
}

fn refused(kind: InterfaceKind, error: &Error, findings: &mut Findings) {
    let message = format!("a run with slightly changed parameters, inputs and states failed: {error}");
    findings.warning("settings", format!("interface {kind}"), message);
}

/// Positions of the variables that may be set before initialization, with another value than their start value.
fn changes(fmu: &Fmu) -> Vec<(usize, Value)> {
    let description = &fmu.description;
    let states: Vec<usize> = description.continuous_states().collect();
    let settable = |position: usize, variable: &Variable| {
        let is_start = states.contains(&position) && variable.initial == Some(Initial::Exact);
        let held = matches!(variable.causality, Causality::Parameter | Causality::Input);
        (held || is_start)
            && variable.variability != Variability::Constant
            && !description.is_structural(position)
    };
    let variables = description.variables.iter().enumerate();
    let settable = variables.filter(|&(position, variable)| settable(position, variable));
    settable
        .filter_map(|(position, variable)| {
            let single = description.is_single(position);
            another(fmu, variable, single).map(|value| (position, value))
        })
        .collect()
}

/// A value of the variable near its start value and within its bounds.
pub(super) fn another(fmu: &Fmu, variable: &Variable, single: bool) -> Option<Value> {
    Some(match &variable.kind {
        VariableKind::Real(real) => {
            let start = real.start?;
            let size = if start != 0.0 { start.abs() } else { real.nominal.unwrap_or(1.0).abs() };
            let within = |value: &f64| {
                *value != start
                    && real.min.is_none_or(|min| *value >= min)
                    && real.max.is_none_or(|max| *value <= max)
            };
            let rounded = |value: f64| if single { f64::from(value as f32) } else { value };
            let bounds = [real.min, real.max].into_iter().flatten().map(|bound| (bound + start) / 2.0);
            let near = [start + CHANGE * size, start - CHANGE * size].into_iter().chain(bounds);
            Value::Real(near.map(rounded).find(within)?.to_bits())
        }
        VariableKind::Integer { start, min, max, .. } => {
            let start = (*start)?;
            let (low, high) = fmu.description.integer_range(variable);
            let (low, high) = (min.unwrap_or(low), max.unwrap_or(high));
            let within = |value: &i64| (low..=high).contains(value);
            let near = [start.checked_add(1), start.checked_sub(1)];
            Value::Integer(near.into_iter().flatten().find(within)?)
        }
        VariableKind::Enumeration { declared_type, start, min, max } => {
            let start = (*start)?;
            let items = fmu.description.types.iter().find(|declared| declared.name == *declared_type)?;
            let within =
                |value: &i64| min.is_none_or(|min| *value >= min) && max.is_none_or(|max| *value <= max);
            let mut values = items.items.iter().map(|(_, value)| *value);
            Value::Integer(values.find(|value| *value != start && within(value))?)
        }
        VariableKind::Boolean { start } => Value::Boolean(!(*start)?),
        VariableKind::String { start } => {
            let more = if fmu.description.is_binary(variable) { "78" } else { "x" };
            Value::String(format!("{}{more}", start.as_ref()?))
        }
    })
}

fn run(
    fmu: &Arc<Fmu>,
    kind: InterfaceKind,
    changes: &[(usize, Value)],
    findings: &mut Findings,
) -> Result<(), Error> {
    let place = format!("interface {kind}");
    let variables = &fmu.description.variables;
    let alone = fmu.interface(kind).is_some_and(|i| i.can_be_instantiated_only_once_per_process);
    let mut neighbor = if alone { None } else { Some(Probe::new(fmu, kind)?) };
    let mut probe = Probe::new(fmu, kind)?;
    probe.begin()?;
    let starts = probe.values()?;
    probe.instance().reset()?;
    set_all(&mut probe, fmu, changes)?;
    probe.begin()?;
    let mut is_ignored = vec![false; changes.len()];
    for (ignored, (position, value)) in is_ignored.iter_mut().zip(changes) {
        let variable = &variables[*position];
        let kept = probe.value(variable)?;
        *ignored = !kept.equals(value);
        if *ignored {
            let message =
                format!("{kind}: set to {value} before initialization, it is {kept} in initialization mode");
            findings.error("set-ignored", element(variable), message);
        }
    }
    if let Some(neighbor) = &mut neighbor {
        neighbor.begin()?;
        if let Some(what) = difference(&fmu.description, &starts, &neighbor.values()?) {
            let message = format!("setting variables of one instance changes another: {what}");
            findings.error("instances", &place, message);
        }
    }
    if probe.finish()? != Advance::Done || probe.advance(STEPS)? != Advance::Done {
        return Ok(());
    }
    judge_held(&mut probe, fmu, kind, changes, &is_ignored, findings)?;
    // To the start values and back again, so that a reset has something to undo.
    for to_start in [true, false] {
        if !during_run(&mut probe, fmu, kind, changes, &is_ignored, to_start, findings)? {
            return Ok(());
        }
    }

    probe.instance().reset()?;
    probe.begin()?;
    let again = probe.values()?;
    if let Some(what) = difference(&fmu.description, &starts, &again) {
        let message = format!(
            "a value that was set outlives fmi2Reset, or is lost by it: {what}, where the first is the start"
        );
        findings.error("reset", &place, message);
        return Ok(());
    }
    if let Some(neighbor) = &mut neighbor {
        let (ended, reset_ended) = (neighbor.finish()?, probe.finish()?);
        if ended == Advance::Done && reset_ended == Advance::Done {
            neighbor.advance(STEPS)?;
            probe.advance(STEPS)?;
            if let Some(what) = difference(&fmu.description, &neighbor.values()?, &probe.values()?) {
                let message = format!(
                    "after values were set and fmi2Reset, a run differs from that of a new instance: {what}"
                );
                findings.error("reset", &place, message);
            }
        }
    }
    Ok(())
}

/// Sets all changes with one call for each type, the last first.
fn set_all(probe: &mut Probe, fmu: &Fmu, changes: &[(usize, Value)]) -> Result<(), Error> {
    let reference = |position: &usize| fmu.description.variables[*position].value_reference;
    let reversed = || changes.iter().rev();
    let (mut reals, mut integers, mut others) =
        ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()), Vec::new());
    for (position, value) in reversed() {
        match value {
            Value::Real(bits) => {
                reals.0.push(reference(position));
                reals.1.push(f64::from_bits(*bits));
            }
            Value::Integer(value) => {
                integers.0.push(reference(position));
                integers.1.push(*value);
            }
            Value::Boolean(_) | Value::String(_) => others.push((position, value)),
        }
    }
    if !reals.0.is_empty() {
        probe.instance().set_real(&reals.0, &reals.1)?;
    }
    if !integers.0.is_empty() {
        probe.instance().set_integer(&integers.0, &integers.1)?;
    }
    others
        .into_iter()
        .try_for_each(|(position, value)| probe.set(&fmu.description.variables[*position], value))
}

fn is_held(variable: &Variable) -> bool {
    matches!(variable.causality, Causality::Parameter | Causality::Input)
}

/// Parameters and inputs are the importer's: the FMU does not change them.
fn judge_held(
    probe: &mut Probe,
    fmu: &Fmu,
    kind: InterfaceKind,
    changes: &[(usize, Value)],
    is_ignored: &[bool],
    findings: &mut Findings,
) -> Result<(), Error> {
    for ((position, value), ignored) in changes.iter().zip(is_ignored) {
        let variable = &fmu.description.variables[*position];
        let kept = probe.value(variable)?;
        if is_held(variable) && !ignored && !kept.equals(value) {
            let message = format!(
                "{kind}: set to {value}, it is {kept} after some steps; only the importer may change it"
            );
            findings.error("set-ignored", element(variable), message);
        }
    }
    Ok(())
}

/// Inputs and tunable parameters take their start values, or the changed ones, in event mode and before the next step;
/// yields whether the run can go on.
fn during_run(
    probe: &mut Probe,
    fmu: &Fmu,
    kind: InterfaceKind,
    changes: &[(usize, Value)],
    is_ignored: &[bool],
    to_start: bool,
    findings: &mut Findings,
) -> Result<bool, Error> {
    let may_change = |variable: &Variable| {
        variable.causality == Causality::Input
            || (variable.causality == Causality::Parameter && variable.variability == Variability::Tunable)
    };
    let mut back = Vec::new();
    for ((position, value), ignored) in changes.iter().zip(is_ignored) {
        let variable = &fmu.description.variables[*position];
        let start = start(variable).filter(|start| may_change(variable) && !ignored && start != value);
        if let Some(start) = start {
            back.push((variable, if to_start { start } else { value.clone() }));
        }
    }
    if back.is_empty() {
        return Ok(true);
    }
    if let Some(model) = probe.model() {
        model.enter_event_mode()?;
    }
    back.iter().try_for_each(|(variable, value)| probe.set(variable, value))?;
    if probe.handle_events()? != Advance::Done || probe.advance(1)? != Advance::Done {
        return Ok(false);
    }
    for (variable, value) in &back {
        let kept = probe.value(variable)?;
        if !kept.equals(value) && !is_single_of(&kept, value) {
            let message = format!("{kind}: set to {value} during the run, it is {kept} one step later");
            findings.error("set-ignored", element(variable), message);
            return Ok(false);
        }
    }
    Ok(true)
}

/// Equal but for the digits that single precision has not.
fn is_single_of(kept: &Value, value: &Value) -> bool {
    matches!((kept.real(), value.real()), (Some(kept), Some(value)) if kept == f64::from(value as f32))
}

/// The start value.
pub(super) fn start(variable: &Variable) -> Option<Value> {
    match &variable.kind {
        VariableKind::Real(real) => real.start.map(|start| Value::Real(start.to_bits())),
        VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => {
            start.map(Value::Integer)
        }
        VariableKind::Boolean { start } => start.map(Value::Boolean),
        VariableKind::String { start } => start.clone().map(Value::String),
    }
}
