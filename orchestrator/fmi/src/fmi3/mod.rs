//! FMI 3.0 behind the call tables of FMI 2.0: instances, masters and the checker above see one interface.
//!
//! A [`Component`] stands between: it holds the instance of the FMU, and translates value references of ours (one per
//! scalar) into those of the FMU (one per variable, arrays as a whole) and the call sequence of 2.0 into that of 3.0.
//!
//! The FMU handles its events inside of a communication step (`eventModeUsed` and `earlyReturnAllowed` are false, which
//! every FMU has to support), so that a step means what it means in FMI 2.0. An FMU that returns early all the same is
//! stepped on to the end of the step. Intermediate updates are answered and change nothing.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::{CString, c_char, c_void};
use std::sync::Arc;

use fmi::fmi3::binding::{fmi3InstanceEnvironment, fmi3Status, fmi3String};

use crate::description::layout::Layout;
use crate::library::ThreeFunctions;
use crate::log::{LogBuffer, LogMessage, text};
use crate::open::{Fmu, InterfaceKind};
use scalars::{Known, Scratch};

mod binary;
pub(crate) mod functions;
mod life_cycle;
pub(crate) mod names;
mod scalars;
mod sensitivities;
mod states;
pub(crate) mod tables;
mod typed;
mod values;

const OK: fmi3Status = 0;
const WARNING: fmi3Status = 1;
const DISCARD: fmi3Status = 2;
const ERROR: fmi3Status = 3;

/// An instance of an FMI 3.0 library as the call tables of 2.0 see it.
pub(crate) struct Component {
    instance: *mut c_void,
    functions: ThreeFunctions,
    layout: Layout,
    /// Relative tolerance, start and stop time \[s\] until initialization begins.
    experiment: (Option<f64>, f64, Option<f64>),
    /// Time that the last step reached \[s\], and whether the FMU wants to end.
    last_step: (f64, bool),
    /// Before initialization, where structural parameters can be set.
    is_configurable: bool,
    /// Values of arrays that were set, by variable.
    known: Vec<Known>,
    scratch: Scratch,
    texts: Vec<CString>,
    log: *const LogBuffer,
}

impl Component {
    /// Makes an instance; NULL if the FMU refuses. `log` has to outlive the component.
    pub(crate) fn instantiate(
        fmu: &Arc<Fmu>,
        functions: ThreeFunctions,
        kind: InterfaceKind,
        (name, token): (&CString, &CString),
        logging: bool,
        log: *const LogBuffer,
    ) -> *mut c_void {
        // FMI 3.0 wants a path that ends with a separator (section 2.3.1).
        let resources = CString::new(format!("{}/", fmu.resources().display())).unwrap_or_default();
        let environment: fmi3InstanceEnvironment = log.cast_mut().cast();
        let instance = match (kind, functions.slave, functions.model) {
            (InterfaceKind::CoSimulation, Some(slave), _) => {
                // SAFETY: the strings live during the call, the log buffer until the instance is freed.
                unsafe {
                    (slave.instantiate)(
                        name.as_ptr(),
                        token.as_ptr(),
                        resources.as_ptr(),
                        false,
                        logging,
                        false,
                        false,
                        std::ptr::null(),
                        0,
                        environment,
                        Some(log_message),
                        Some(intermediate_update),
                    )
                }
            }
            (InterfaceKind::ModelExchange, _, Some(model)) => {
                // SAFETY: as above.
                unsafe {
                    (model.instantiate)(
                        name.as_ptr(),
                        token.as_ptr(),
                        resources.as_ptr(),
                        false,
                        logging,
                        environment,
                        Some(log_message),
                    )
                }
            }
            _ => std::ptr::null_mut(),
        };
        let Some(layout) = fmu.description.layout.clone().filter(|_| !instance.is_null()) else {
            return std::ptr::null_mut();
        };
        let mut component = Component {
            instance,
            functions,
            known: vec![Known::default(); layout.wholes.len()],
            layout,
            experiment: (None, 0.0, None),
            last_step: (0.0, false),
            is_configurable: true,
            scratch: Scratch::default(),
            texts: Vec::new(),
            log,
        };
        if component.resize() > WARNING {
            // SAFETY: the instance is alive and not used after this.
            unsafe { (functions.common.free_instance)(instance) };
            return std::ptr::null_mut();
        }
        Box::into_raw(Box::new(component)).cast()
    }

    /// Writes a message of ours where those of the FMU are.
    fn say(&self, status: fmi3Status, message: String) -> fmi3Status {
        // SAFETY: the buffer outlives the component, and is shared, never borrowed mutably.
        let log = unsafe { &*self.log };
        log.push(LogMessage {
            instance: String::new(),
            status,
            category: "importer".to_owned(),
            text: message,
        });
        status
    }

    /// A function that the library should have does not exist.
    fn lacks(&self, function: &str) -> fmi3Status {
        self.say(ERROR, format!("the library does not export {function}"))
    }
}

/// Stores a message of the FMU in the buffer of the instance.
unsafe extern "C" fn log_message(
    environment: fmi3InstanceEnvironment,
    status: fmi3Status,
    category: fmi3String,
    message: fmi3String,
) {
    if environment.is_null() {
        return;
    }
    // SAFETY: the environment is the `LogBuffer` that was passed at instantiation; it outlives the instance and is
    // shared, never borrowed mutably.
    let buffer = unsafe { &*environment.cast::<LogBuffer>() };
    let (category, text) = (text(category), text(message));
    buffer.push(LogMessage { instance: String::new(), status, category, text });
}

/// Answers an intermediate update: nothing is set, nothing is read, the step goes on.
unsafe extern "C" fn intermediate_update(
    _environment: fmi3InstanceEnvironment,
    time: f64,
    _set_requested: bool,
    _get_allowed: bool,
    _step_finished: bool,
    _can_return_early: bool,
    early_return_requested: *mut bool,
    early_return_time: *mut f64,
) {
    if !early_return_requested.is_null() {
        // SAFETY: not null; the FMU passes a pointer to a Boolean of its own (FMI 3.0 section 4.2.2).
        unsafe { early_return_requested.write(false) };
    }
    if !early_return_time.is_null() {
        // SAFETY: as above, to a Float64.
        unsafe { early_return_time.write(time) };
    }
}

/// The component behind the handle that the call tables pass.
///
/// # Safety
/// `handle` comes from [`Component::instantiate`], is not freed, and nobody else uses it during the call.
unsafe fn component<'a>(handle: *mut c_void) -> &'a mut Component {
    // SAFETY: promised by the caller; `Instance` has exclusive access during every call.
    unsafe { &mut *handle.cast::<Component>() }
}

/// Numbers of continuous states and event indicators as the library gives them; `None` where it does not.
///
/// # Safety
/// As for [`component`].
pub(crate) unsafe fn counts(handle: *mut c_void) -> [Option<usize>; 2] {
    // SAFETY: promised by the caller.
    let component = unsafe { component(handle) };
    let Some(model) = component.functions.model else { return [None; 2] };
    [model.count_states, model.count_event_indicators].map(|count| {
        let mut number = 0;
        // SAFETY: the instance is alive; the pointer is to a local.
        let status = unsafe { count?(component.instance, &raw mut number) };
        (status <= WARNING).then_some(number)
    })
}

/// A C string of the importer as the FMU takes it.
type Text = *const c_char;
