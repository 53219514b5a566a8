//! Life cycle, steps and events: the call sequence of FMI 2.0 in terms of 3.0.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::c_void;

use fmi::fmi2::binding::{
    fmi2EventInfo, fmi2StatusKind_fmi2LastSuccessfulTime, fmi2StatusKind_fmi2Terminated,
};

use super::{Component, DISCARD, OK, Text, WARNING, component};
use crate::description::layout::Resize;
use crate::trace;

/// An FMU that returns early this often in one step does not get on.
const MAX_PARTS: usize = 10_000;

/// A pointer to a flag that the FMU writes; it is read as a number, whatever was written.
macro_rules! flag {
    ($flag:ident) => {
        (&raw mut $flag).cast::<bool>()
    };
}

impl Component {
    /// Sets the structural parameters that the description was read with, all at once.
    pub(super) fn resize(&mut self) -> u32 {
        if self.layout.resizes.is_empty() {
            return OK;
        }
        let resizes = std::mem::take(&mut self.layout.resizes);
        let status = self.configure(|component| {
            let set = |resize: &Resize| {
                let whole = &component.layout.wholes[resize.whole];
                let (base, reference) = (whole.base, whole.reference);
                let status = component.set_whole(resize.whole, base, &[resize.value as u64]);
                if status > WARNING {
                    let what = format!("valueReference {reference} = {}", resize.value);
                    component.say(status, format!("the FMU refuses the structural parameter with {what}"));
                }
                status
            };
            resizes.iter().map(set).find(|status| *status > WARNING).unwrap_or(OK)
        });
        self.layout.resizes = resizes;
        status
    }

    /// Does something in configuration mode.
    pub(super) fn configure(&mut self, work: impl FnOnce(&mut Component) -> u32) -> u32 {
        let functions = &self.functions.common;
        let Some(enter) = functions.enter_configuration_mode else {
            return self.lacks("fmi3EnterConfigurationMode");
        };
        let Some(exit) = functions.exit_configuration_mode else {
            return self.lacks("fmi3ExitConfigurationMode");
        };
        trace::enter("fmi3EnterConfigurationMode");
        // SAFETY: the instance is alive and belongs to this library.
        let status = unsafe { enter(self.instance) };
        if status > WARNING {
            return status;
        }
        let worked = work(self);
        if worked > WARNING {
            return worked;
        }
        trace::enter("fmi3ExitConfigurationMode");
        // SAFETY: as above.
        let status = unsafe { exit(self.instance) };
        worked.max(status)
    }
}

pub(super) unsafe extern "C" fn free_instance(handle: *mut c_void) {
    // SAFETY: the handle comes from `Box::into_raw` in `Component::instantiate` and is freed once.
    let component = unsafe { Box::from_raw(handle.cast::<Component>()) };
    // SAFETY: the instance is alive and not used after this.
    unsafe { (component.functions.common.free_instance)(component.instance) };
}

pub(super) unsafe extern "C" fn setup_experiment(
    handle: *mut c_void,
    tolerance_defined: i32,
    tolerance: f64,
    start: f64,
    stop_defined: i32,
    stop: f64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    let tolerance = (tolerance_defined != 0).then_some(tolerance);
    component.experiment = (tolerance, start, (stop_defined != 0).then_some(stop));
    OK
}

pub(super) unsafe extern "C" fn enter_initialization_mode(handle: *mut c_void) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    let (tolerance, start, stop) = component.experiment;
    component.is_configurable = false;
    trace::enter("fmi3EnterInitializationMode");
    // SAFETY: the instance is alive and belongs to this library.
    unsafe {
        (component.functions.common.enter_initialization_mode)(
            component.instance,
            tolerance.is_some(),
            tolerance.unwrap_or(0.0),
            start,
            stop.is_some(),
            stop.unwrap_or(0.0),
        )
    }
}

pub(super) unsafe extern "C" fn exit_initialization_mode(handle: *mut c_void) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    // SAFETY: the instance is alive and belongs to this library.
    unsafe { (component.functions.common.exit_initialization_mode)(component.instance) }
}

pub(super) unsafe extern "C" fn terminate(handle: *mut c_void) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    // SAFETY: the instance is alive and belongs to this library.
    unsafe { (component.functions.common.terminate)(component.instance) }
}

pub(super) unsafe extern "C" fn reset(handle: *mut c_void) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    // SAFETY: the instance is alive and belongs to this library.
    let status = unsafe { (component.functions.common.reset)(component.instance) };
    if status > WARNING {
        return status;
    }
    component.forget();
    component.is_configurable = true;
    component.last_step = (0.0, false);
    component.resize().max(status)
}

pub(super) unsafe extern "C" fn set_debug_logging(
    handle: *mut c_void,
    on: i32,
    count: usize,
    categories: *const Text,
) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    match component.functions.common.set_debug_logging {
        // SAFETY: the instance is alive; the array has the length passed and the strings live during the call.
        Some(call) => unsafe { call(component.instance, on != 0, count, categories) },
        None => component.lacks("fmi3SetDebugLogging"),
    }
}

/// A whole communication step, in parts where the FMU returns early.
pub(super) unsafe extern "C" fn do_step(handle: *mut c_void, t: f64, h: f64, no_set_state_prior: i32) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    let Some(slave) = component.functions.slave else { return component.lacks("fmi3DoStep") };
    let (mut from, mut step, mut worst) = (t, h, OK);
    for _ in 0..MAX_PARTS {
        let (mut event, mut end, mut early, mut last) = (0_u8, 0_u8, 0_u8, from);
        // SAFETY: the instance is alive and belongs to this library; the pointers are to locals.
        let status = unsafe {
            (slave.do_step)(
                component.instance,
                from,
                step,
                no_set_state_prior != 0,
                flag!(event),
                flag!(end),
                flag!(early),
                &raw mut last,
            )
        };
        worst = worst.max(status);
        let is_good = status <= WARNING;
        component.last_step = (if is_good && early == 0 && end == 0 { t + h } else { last }, end != 0);
        if !is_good {
            return status;
        }
        if end != 0 {
            // FMI 2.0 has no other way to say this.
            return DISCARD;
        }
        if early == 0 || last >= t + h {
            return worst;
        }
        if last <= from {
            break;
        }
        (from, step) = (last, t + h - last);
    }
    component.say(DISCARD, format!("the step from {t} s returns early again and again and does not get on"))
}

pub(super) unsafe extern "C" fn get_real_status(handle: *mut c_void, kind: u32, value: *mut f64) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    if kind != fmi2StatusKind_fmi2LastSuccessfulTime {
        return DISCARD;
    }
    // SAFETY: the caller passes a pointer to a number of its own.
    unsafe { value.write(component.last_step.0) };
    OK
}

pub(super) unsafe extern "C" fn get_boolean_status(handle: *mut c_void, kind: u32, value: *mut i32) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    if kind != fmi2StatusKind_fmi2Terminated {
        return DISCARD;
    }
    // SAFETY: the caller passes a pointer to a number of its own.
    unsafe { value.write(component.last_step.1.into()) };
    OK
}

pub(super) unsafe extern "C" fn new_discrete_states(handle: *mut c_void, info: *mut fmi2EventInfo) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    let Some(model) = component.functions.model else {
        return component.lacks("fmi3UpdateDiscreteStates");
    };
    let (mut needed, mut end, mut nominals, mut values, mut timed) = (0_u8, 0_u8, 0_u8, 0_u8, 0_u8);
    let mut time = 0.0;
    // SAFETY: the instance is alive and belongs to this library; the pointers are to locals.
    let status = unsafe {
        (model.update_discrete_states)(
            component.instance,
            flag!(needed),
            flag!(end),
            flag!(nominals),
            flag!(values),
            flag!(timed),
            &raw mut time,
        )
    };
    let answer = fmi2EventInfo {
        newDiscreteStatesNeeded: needed.into(),
        terminateSimulation: end.into(),
        nominalsOfContinuousStatesChanged: nominals.into(),
        valuesOfContinuousStatesChanged: values.into(),
        nextEventTimeDefined: timed.into(),
        nextEventTime: time,
    };
    // SAFETY: the caller passes a pointer to a structure of its own.
    unsafe { info.write(answer) };
    status
}

pub(super) unsafe extern "C" fn completed_integrator_step(
    handle: *mut c_void,
    no_set_state_prior: i32,
    enter_event_mode: *mut i32,
    terminate: *mut i32,
) -> u32 {
    // SAFETY: the call tables pass handles of live components only.
    let component = unsafe { component(handle) };
    let Some(model) = component.functions.model else {
        return component.lacks("fmi3CompletedIntegratorStep");
    };
    let (mut event, mut end) = (0_u8, 0_u8);
    // SAFETY: the instance is alive and belongs to this library; the pointers are to locals and of the caller.
    unsafe {
        let status = (model.completed_integrator_step)(
            component.instance,
            no_set_state_prior != 0,
            flag!(event),
            flag!(end),
        );
        enter_event_mode.write(event.into());
        terminate.write(end.into());
        status
    }
}

/// Calls of Model Exchange that only pass arguments on.
macro_rules! passed_on {
    ($($(#[$doc:meta])* $name:ident($($argument:ident: $type:ty),*);)*) => {
        $($(#[$doc])*
        pub(super) unsafe extern "C" fn $name(handle: *mut c_void $(, $argument: $type)*) -> u32 {
            // SAFETY: the call tables pass handles of live components only.
            let component = unsafe { component(handle) };
            let Some(model) = component.functions.model else {
                return component.lacks("a function of Model Exchange");
            };
            // SAFETY: the instance is alive and belongs to this library; the arrays have the lengths passed.
            unsafe { (model.$name)(component.instance $(, $argument)*) }
        })*
    };
}

passed_on! {
    enter_event_mode();
    enter_continuous_time_mode();
    set_time(time: f64);
    set_continuous_states(states: *const f64, count: usize);
    get_continuous_states(states: *mut f64, count: usize);
    get_derivatives(derivatives: *mut f64, count: usize);
    get_event_indicators(indicators: *mut f64, count: usize);
    get_nominals(nominals: *mut f64, count: usize);
}
