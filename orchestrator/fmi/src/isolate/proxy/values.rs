//! Values of an instance in a worker.

use std::ffi::{CStr, CString};

use fmi::fmi2::binding::*;

use super::Component;
use super::remote::remote;
use crate::arrays::{list, list_mut};
use crate::isolate::calls::*;

pub(super) unsafe extern "C" fn get_real(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list_mut(values, count)) };
    let known = remote.reading == references;
    if remote.ready && known {
        values.copy_from_slice(&remote.values);
        return 0;
    }
    if remote.after_step {
        remote.habit = if known { remote.habit + 1 } else { 0 };
        if !known {
            remote.reading.clear();
            remote.reading.extend_from_slice(references);
        }
    }
    remote.get(GET_REAL, references, bytes_of_mut(values))
}

pub(super) unsafe extern "C" fn get_integer(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *mut i64,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list_mut(values, count)) };
    remote.get(GET_INTEGER, references, bytes_of_mut(values))
}

pub(super) unsafe extern "C" fn get_boolean(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2Boolean,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list_mut(values, count)) };
    remote.get(GET_BOOLEAN, references, bytes_of_mut(values))
}

pub(super) unsafe extern "C" fn get_string(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2String,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list_mut(values, count)) };
    remote.begin(GET_STRING).block(bytes_of(references));
    let (status, payload) = remote.send();
    let mut parts = Parts { bytes: &payload };
    remote.texts.clear();
    for value in values.iter_mut().filter(|_| status <= 1) {
        remote.texts.push(CString::new(parts.block().unwrap_or_default()).unwrap_or_default());
        *value = remote.texts.last().map_or(std::ptr::null(), |text| text.as_ptr());
    }
    status
}

pub(super) unsafe extern "C" fn set_real(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list(values, count)) };
    let calls = remote.begin_setter(SET_REAL);
    calls.block(bytes_of(references));
    calls.block(bytes_of(values));
    remote.end_setter()
}

pub(super) unsafe extern "C" fn set_integer(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *const i64,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list(values, count)) };
    let calls = remote.begin_setter(SET_INTEGER);
    calls.block(bytes_of(references));
    calls.block(bytes_of(values));
    remote.end_setter()
}

pub(super) unsafe extern "C" fn set_boolean(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2Boolean,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list(values, count)) };
    let calls = remote.begin_setter(SET_BOOLEAN);
    calls.block(bytes_of(references));
    calls.block(bytes_of(values));
    remote.end_setter()
}

pub(super) unsafe extern "C" fn set_string(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2String,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list(values, count)) };
    let calls = remote.begin_setter(SET_STRING);
    calls.block(bytes_of(references));
    for &value in values {
        // SAFETY: strings of our importer.
        calls.block(unsafe { CStr::from_ptr(value) }.to_bytes());
    }
    remote.end_setter()
}

pub(super) unsafe extern "C" fn directional_derivative(
    component: Component,
    unknown: *const fmi2ValueReference,
    unknown_count: usize,
    known: *const fmi2ValueReference,
    known_count: usize,
    seed: *const fmi2Real,
    change: *mut fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of these lengths.
    let (remote, unknown, known, seed, change) = unsafe {
        (
            remote(component),
            list(unknown, unknown_count),
            list(known, known_count),
            list(seed, known_count),
            list_mut(change, unknown_count),
        )
    };
    let calls = remote.begin(DIRECTIONAL_DERIVATIVE);
    calls.block(bytes_of(unknown));
    calls.block(bytes_of(known));
    calls.block(bytes_of(seed));
    remote.receive(bytes_of_mut(change))
}
