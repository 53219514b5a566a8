//! Model Exchange of an instance in a worker.

use fmi::fmi2::binding::*;

use super::Component;
use super::remote::remote;
use crate::arrays::{list, list_mut};
use crate::isolate::calls::*;

simple! {
    enter_event_mode: ENTER_EVENT_MODE,
    enter_continuous_time_mode: ENTER_CONTINUOUS_TIME,
}

pub(super) unsafe extern "C" fn new_discrete_states(
    component: Component,
    info: *mut fmi2EventInfo,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and a pointer to a local.
    let (remote, info) = unsafe { (remote(component), &mut *info) };
    remote.begin(NEW_DISCRETE_STATES);
    let (status, payload) = remote.send();
    let mut parts = Parts { bytes: &payload };
    for flag in [
        &mut info.newDiscreteStatesNeeded,
        &mut info.terminateSimulation,
        &mut info.nominalsOfContinuousStatesChanged,
        &mut info.valuesOfContinuousStatesChanged,
        &mut info.nextEventTimeDefined,
    ] {
        *flag = fmi2Boolean::from(parts.number().unwrap_or(0) != 0);
    }
    info.nextEventTime = parts.real().unwrap_or(0.0);
    status
}

pub(super) unsafe extern "C" fn completed_integrator_step(
    component: Component,
    no_set_state_prior: fmi2Boolean,
    event: *mut fmi2Boolean,
    end: *mut fmi2Boolean,
) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin(COMPLETED_STEP).number(u64::from(no_set_state_prior != 0));
    let (status, payload) = remote.send();
    let mut parts = Parts { bytes: &payload };
    let mut flag = || fmi2Boolean::from(parts.number().unwrap_or(0) != 0);
    // SAFETY: the pointers are to locals of our importer.
    unsafe { (*event, *end) = (flag(), flag()) };
    status
}

pub(super) unsafe extern "C" fn set_time(component: Component, time: fmi2Real) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin_setter(SET_TIME).real(time);
    remote.end_setter()
}

pub(super) unsafe extern "C" fn set_continuous_states(
    component: Component,
    states: *const fmi2Real,
    count: usize,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and an array of this length.
    let (remote, states) = unsafe { (remote(component), list(states, count)) };
    remote.begin_setter(SET_STATES).block(bytes_of(states));
    remote.end_setter()
}

macro_rules! read {
    ($($function:ident: $number:ident,)*) => {
        $(pub(super) unsafe extern "C" fn $function(
            component: Component,
            values: *mut fmi2Real,
            count: usize,
        ) -> fmi2Status {
            // SAFETY: our importer passes a live component and an array of this length.
            let (remote, values) = unsafe { (remote(component), list_mut(values, count)) };
            remote.begin($number).number(count as u64);
            remote.receive(bytes_of_mut(values))
        })*
    };
}

read! {
    get_continuous_states: GET_STATES,
    get_derivatives: GET_DERIVATIVES,
    get_event_indicators: GET_INDICATORS,
    get_nominals: NOMINALS,
}
