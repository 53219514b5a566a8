//! Saved states of an instance in a worker: here they are numbers.

use fmi::fmi2::binding::*;

use super::Component;
use super::remote::{Remote, remote};
use crate::arrays::{list, list_mut};
use crate::isolate::calls::*;

/// Sends what was begun, whose answer is a pointer in the worker.
///
/// # Safety
/// `state` may be written to.
unsafe fn receive_state(remote: &mut Remote, state: *mut fmi2FMUstate) -> fmi2Status {
    let (status, payload) = remote.send();
    if let Some(pointer) = (Parts { bytes: &payload }).number() {
        // SAFETY: as the caller promises.
        unsafe { *state = pointer as fmi2FMUstate };
    }
    status
}

pub(super) unsafe extern "C" fn get_state(component: Component, state: *mut fmi2FMUstate) -> fmi2Status {
    // SAFETY: our importer passes a live component and a pointer to a local.
    unsafe {
        let remote = remote(component);
        remote.begin(GET_STATE).number(*state as u64);
        receive_state(remote, state)
    }
}

pub(super) unsafe extern "C" fn set_state(component: Component, state: fmi2FMUstate) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin(SET_STATE).number(state as u64);
    remote.send().0
}

pub(super) unsafe extern "C" fn free_state(component: Component, state: *mut fmi2FMUstate) -> fmi2Status {
    // SAFETY: our importer passes a live component and a pointer to a local.
    let (remote, pointer) = unsafe { (remote(component), *state) };
    remote.begin(FREE_STATE).number(pointer as u64);
    remote.send().0
}

pub(super) unsafe extern "C" fn serialized_state_size(
    component: Component,
    state: fmi2FMUstate,
    size: *mut usize,
) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin(STATE_SIZE).number(state as u64);
    let (status, payload) = remote.send();
    let found = (Parts { bytes: &payload }).number().and_then(|size| usize::try_from(size).ok());
    // SAFETY: the pointer is to a local of our importer.
    unsafe { *size = found.unwrap_or(0) };
    status
}

pub(super) unsafe extern "C" fn serialize_state(
    component: Component,
    state: fmi2FMUstate,
    bytes: *mut fmi2Byte,
    size: usize,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and an array of this length.
    let (remote, bytes) = unsafe { (remote(component), list_mut(bytes.cast::<u8>(), size)) };
    let calls = remote.begin(SERIALIZE);
    calls.number(state as u64);
    calls.number(size as u64);
    remote.receive(bytes)
}

pub(super) unsafe extern "C" fn deserialize_state(
    component: Component,
    bytes: *const fmi2Byte,
    size: usize,
    state: *mut fmi2FMUstate,
) -> fmi2Status {
    // SAFETY: our importer passes a live component, an array of this length, and a pointer to a local.
    unsafe {
        let remote = remote(component);
        remote.begin(DESERIALIZE).block(list(bytes.cast::<u8>(), size));
        receive_state(remote, state)
    }
}
