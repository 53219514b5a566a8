//! Life cycle of an instance in a worker.

use std::ffi::CStr;

use fmi::fmi2::binding::*;

use super::Component;
use super::remote::{Remote, remote};
use crate::arrays::list;
use crate::isolate::calls::*;

pub(super) unsafe extern "C" fn free_instance(component: Component) {
    // SAFETY: our importer frees a component once.
    let mut remote = unsafe { Box::from_raw(component.cast::<Remote>()) };
    remote.deferred.bytes.clear();
    remote.functions.clear();
    remote.simple(FREE_INSTANCE);
}

simple! {
    enter_initialization_mode: ENTER_INITIALIZATION,
}

pub(super) unsafe extern "C" fn exit_initialization_mode(component: Component) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    let status = remote.simple(EXIT_INITIALIZATION);
    remote.running = status <= 1;
    status
}

pub(super) unsafe extern "C" fn terminate(component: Component) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.running = false;
    remote.simple(TERMINATE)
}

pub(super) unsafe extern "C" fn reset(component: Component) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.running = false;
    remote.simple(RESET)
}

pub(super) unsafe extern "C" fn setup_experiment(
    component: Component,
    has_tolerance: fmi2Boolean,
    tolerance: fmi2Real,
    start: fmi2Real,
    has_stop: fmi2Boolean,
    stop: fmi2Real,
) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    let calls = remote.begin(SETUP_EXPERIMENT);
    calls.number(u64::from(has_tolerance != 0));
    calls.real(tolerance);
    calls.real(start);
    calls.number(u64::from(has_stop != 0));
    calls.real(stop);
    remote.send().0
}

pub(super) unsafe extern "C" fn set_debug_logging(
    component: Component,
    on: fmi2Boolean,
    count: usize,
    categories: *const fmi2String,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and an array of this length.
    let (remote, categories) = unsafe { (remote(component), list(categories, count)) };
    let calls = remote.begin(SET_DEBUG_LOGGING);
    calls.number(u64::from(on != 0));
    calls.number(count as u64);
    for &category in categories {
        // SAFETY: strings of our importer.
        calls.block(unsafe { CStr::from_ptr(category) }.to_bytes());
    }
    remote.send().0
}
