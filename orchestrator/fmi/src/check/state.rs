//! Saved states: what runs on from a saved, restored or serialized state must be the same bit by bit.

use std::sync::Arc;

use super::Findings;
use super::probe::{Probe, Value, difference};
use crate::{Error, Fmu, InterfaceKind};

/// Steps before the state is saved, and after.
const STEPS: usize = 5;

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    let Some(interface) = fmu.interface(kind) else { return };
    if !interface.can_get_and_set_fmu_state {
        return;
    }
    let serialize = interface.can_serialize_fmu_state && !interface.can_be_instantiated_only_once_per_process;
    if let Err(error) = round_trip(fmu, kind, serialize, findings) {
        findings.error("state", format!("interface {kind}"), error.to_string());
    }
}

fn round_trip(
    fmu: &Arc<Fmu>,
    kind: InterfaceKind,
    serialize: bool,
    findings: &mut Findings,
) -> Result<(), Error> {
    let place = format!("interface {kind}");
    let mut probe = Probe::new(fmu, kind)?;
    probe.initialize()?;
    probe.advance(STEPS)?;
    let mut slot = None;
    probe.instance().get_state(&mut slot)?;
    let Some(state) = &slot else {
        findings.error("state", place, "fmi2GetFMUstate returned fmi2OK and no state");
        return Ok(());
    };
    let clock = probe.clock();
    let run = |probe: &mut Probe| -> Result<Vec<Value>, Error> {
        probe.advance(STEPS)?;
        probe.values()
    };
    let first = run(&mut probe)?;
    probe.instance().set_state(state)?;
    probe.set_clock(clock)?;
    if let Some(what) = difference(&fmu.description, &first, &run(&mut probe)?) {
        findings.error(
            "state",
            &place,
            format!("after a run and its repetition from the saved state {what}"),
        );
    }
    if serialize {
        let bytes = probe.instance().serialize_state(state)?;
        let mut other = Probe::new(fmu, kind)?;
        other.initialize()?;
        let copy = other.instance().deserialize_state(&bytes)?;
        other.instance().set_state(&copy)?;
        other.instance().free_state(copy)?;
        other.set_clock(clock)?;
        if let Some(what) = difference(&fmu.description, &first, &run(&mut other)?) {
            findings.error(
                "state-serialized",
                place,
                format!("from the serialized state in another instance {what}"),
            );
        }
    }
    Ok(())
}
