//! Instantiation, initialization, stepping and reset of one interface.

use std::sync::Arc;

use super::probe::{Advance, Probe, Value, difference};
use super::{Findings, element, settings};
use crate::description::{Initial, Variability};
use crate::{Error, Fmu, Instance, InterfaceKind};

/// Steps of a trial run.
const STEPS: usize = 20;

/// Whether the interface works well enough to look closer.
pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) -> bool {
    let place = format!("interface {kind}");
    match Instance::with_guid(fmu, kind, "check", false, "not the guid of this FMU") {
        Ok(_) => findings.error("guid", &place, "fmi2Instantiate accepts a wrong guid, which must give NULL"),
        Err(Error::Instantiate { log, .. }) if log.is_empty() => {
            findings.note("guid", &place, "a wrong guid is refused without a message to the log");
        }
        Err(Error::Instantiate { .. }) => {}
        Err(error) => {
            findings.error("library", &place, error.to_string());
            return false;
        }
    }
    match run(fmu, kind, findings) {
        Ok(works) => works,
        Err(error) => {
            findings.error("life-cycle", place, error.to_string());
            false
        }
    }
}

fn run(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) -> Result<bool, Error> {
    let place = format!("interface {kind}");
    let description = &fmu.description;
    let mut probe = Probe::new(fmu, kind)?;
    probe.begin()?;
    let values = probe.values()?;
    check_starts(fmu, kind, &values, findings);
    if probe.finish()? == Advance::EndlessEvents {
        findings.error(
            "event-iteration",
            place,
            "fmi2NewDiscreteStates does not come to rest after initialization",
        );
        return Ok(false);
    }
    let initial = probe.values()?;
    check_finite(fmu, kind, &initial, findings);

    let alone = fmu.interface(kind).is_some_and(|i| i.can_be_instantiated_only_once_per_process);
    let mut neighbor = if alone { None } else { Some(Probe::new(fmu, kind)?) };
    if let Some(neighbor) = &mut neighbor {
        neighbor.initialize()?;
    }
    let (outcome, path) = walk(&mut probe)?;
    if outcome == Advance::EndlessEvents {
        findings.error("event-iteration", place, "fmi2NewDiscreteStates does not come to rest");
        return Ok(false);
    }
    for (rule, message) in probe.take_event_faults() {
        findings.error(rule, &place, message);
    }
    let stepped = probe.values()?;
    check_finite(fmu, kind, &stepped, findings);
    if let Some(neighbor) = &mut neighbor
        && let Some(what) = difference(description, &initial, &neighbor.values()?)
    {
        let message = format!("stepping one instance changes another: {what}");
        findings.error("instances", &place, message);
    }

    probe.instance().reset()?;
    probe.initialize()?;
    let again = probe.values()?;
    if let Some(what) = difference(description, &initial, &again) {
        findings.error("reset", &place, format!("after fmi2Reset and initialization {what}"));
    } else {
        let (outcome_again, path_again) = walk(&mut probe)?;
        let mut pairs = path.iter().zip(&path_again).enumerate();
        let first =
            pairs.find_map(|(step, (before, after))| Some((step, difference(description, before, after)?)));
        if let Some((step, what)) = first {
            let message = format!("after step {} before and after fmi2Reset {what}", step + 1);
            findings.error("reset", &place, message);
        } else if outcome_again != outcome {
            findings.error("reset", &place, "a run after fmi2Reset ends differently");
        }
    }
    probe.instance().terminate()?;
    Ok(true)
}

/// The trial run: its end, and all values after each step.
fn walk(probe: &mut Probe) -> Result<(Advance, Vec<Vec<Value>>), Error> {
    let mut path = Vec::with_capacity(STEPS);
    for _ in 0..STEPS {
        let outcome = probe.advance(1)?;
        if outcome != Advance::Done {
            return Ok((outcome, path));
        }
        path.push(probe.values()?);
    }
    Ok((Advance::Done, path))
}

/// Constants, parameters and other exact variables have their start value in initialization mode.
fn check_starts(fmu: &Fmu, kind: InterfaceKind, values: &[Value], findings: &mut Findings) {
    for (variable, value) in fmu.description.variables.iter().zip(values) {
        let exact = variable.initial == Some(Initial::Exact) || variable.variability == Variability::Constant;
        if let Some(start) = settings::start(variable).filter(|start| exact && !start.equals(value)) {
            let message =
                format!("{kind}: its value in initialization mode is {value}, its start value {start}");
            findings.error("start-value", element(variable), message);
        }
    }
}

fn check_finite(fmu: &Fmu, kind: InterfaceKind, values: &[Value], findings: &mut Findings) {
    for (variable, value) in fmu.description.variables.iter().zip(values) {
        if let Value::Real(bits) = value
            && !f64::from_bits(*bits).is_finite()
        {
            findings.error("non-finite", element(variable), format!("{kind}: its value is {value}"));
        }
    }
}
