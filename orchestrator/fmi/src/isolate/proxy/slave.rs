//! Co-Simulation of an instance in a worker.

use fmi::fmi2::binding::*;

use super::Component;
use super::remote::remote;
use crate::arrays::{list, list_mut};
use crate::isolate::calls::*;

/// A step is followed by the same reading this often before its values are asked for with the step.
const HABIT: u32 = 2;

pub(super) unsafe extern "C" fn do_step(
    component: Component,
    t: fmi2Real,
    h: fmi2Real,
    no_set_state_prior: fmi2Boolean,
) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    let calls = remote.begin(DO_STEP);
    calls.real(t);
    calls.real(h);
    calls.number(u64::from(no_set_state_prior != 0));
    if remote.habit < HABIT {
        return remote.send().0;
    }
    remote.calls.begin(GET_REAL, remote.instance);
    let reading = std::mem::take(&mut remote.reading);
    remote.calls.block(bytes_of(&reading));
    remote.reading = reading;
    let (status, payload) = remote.send_with(1);
    remote.values.resize(remote.reading.len(), 0.0);
    let block = (Parts { bytes: &payload }).block();
    let length = size_of::<f64>() * remote.values.len();
    if let Some(block) = block.filter(|block| block.len() == length && remote.habit > 0) {
        bytes_of_mut(&mut remote.values).copy_from_slice(block);
        remote.ready = status <= 1;
    }
    status
}

pub(super) unsafe extern "C" fn set_real_input_derivatives(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    order: *const fmi2Integer,
    values: *const fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, order, values) =
        unsafe { (remote(component), list(references, count), list(order, count), list(values, count)) };
    let calls = remote.begin_setter(SET_INPUT_DERIVATIVES);
    calls.block(bytes_of(references));
    calls.block(bytes_of(order));
    calls.block(bytes_of(values));
    remote.end_setter()
}

pub(super) unsafe extern "C" fn get_real_output_derivatives(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    order: *const fmi2Integer,
    values: *mut fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, order, values) =
        unsafe { (remote(component), list(references, count), list(order, count), list_mut(values, count)) };
    let calls = remote.begin(GET_OUTPUT_DERIVATIVES);
    calls.block(bytes_of(references));
    calls.block(bytes_of(order));
    remote.receive(bytes_of_mut(values))
}

pub(super) unsafe extern "C" fn get_real_status(
    component: Component,
    kind: fmi2StatusKind,
    value: *mut fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin(GET_REAL_STATUS).number(kind.into());
    let (status, payload) = remote.send();
    // SAFETY: the pointer is to a local of our importer.
    unsafe { *value = (Parts { bytes: &payload }).real().unwrap_or(f64::NAN) };
    status
}

pub(super) unsafe extern "C" fn get_boolean_status(
    component: Component,
    kind: fmi2StatusKind,
    value: *mut fmi2Boolean,
) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin(GET_BOOLEAN_STATUS).number(kind.into());
    let (status, payload) = remote.send();
    let found = (Parts { bytes: &payload }).number().unwrap_or(0);
    // SAFETY: the pointer is to a local of our importer.
    unsafe { *value = fmi2Boolean::from(found != 0) };
    status
}
