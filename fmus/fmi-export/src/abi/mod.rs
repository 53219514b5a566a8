//! The C boundary: raw pointers become slices, panics become `fmi2Fatal`. The only unsafe code of the FMUs.
//!
//! Every function here is generic over the model and is called by the exported function of the same name that
//! [`crate::export_fmu`] writes. What an importer must promise (valid handles, arrays of the stated length, one
//! thread per instance at a time) is FMI 2.0, sections 2.1.3 to 2.1.9, 3.2 and 4.2.
#![allow(unsafe_code, clippy::missing_safety_doc, missing_docs, clippy::too_many_arguments)]

use crate::ctypes::{
    Bool, CString as CText, CallbackFunctions, CallbackLogger, Component, ComponentEnvironment, LogMessage,
    Status, ValueReference,
};
use crate::definition::Definition;
use crate::instance::Instance;
use crate::logger::{Callback, Category, Logger};
use crate::model::{Model, Refusal};
use crate::resources;
use crate::start_values::{FILE, StartValues};
use crate::state_machine::{Function, Mode, allowed_states, is_allowed};
use crate::values::Interface;

mod co_simulation;
pub mod fmi3;
mod fmu_state;
mod model_exchange;

pub use co_simulation::*;
pub use fmu_state::*;
pub use model_exchange::*;

use std::cell::{Cell, RefCell};
use std::ffi::{CStr, CString, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Once, OnceLock};

/// Passes one message to the importer; `message` has its percent signs doubled.
pub(crate) fn call_logger(
    callback: CallbackLogger,
    environment: ComponentEnvironment,
    instance: &CStr,
    status: Status,
    category: &CStr,
    message: &CStr,
) {
    // SAFETY: the importer promises a printf-like logger that lives as long as the instance (section 2.1.5);
    // every pointer is a null-terminated text that outlives the call, and the format has no arguments.
    unsafe { callback(environment, instance.as_ptr(), status, category.as_ptr(), message.as_ptr()) }
}

/// Passes one message to an importer of FMI 3.0.
pub(crate) fn call_log_message(
    callback: LogMessage,
    environment: ComponentEnvironment,
    status: Status,
    category: &CStr,
    message: &CStr,
) {
    // SAFETY: the importer promises a callback that lives as long as the instance (FMI 3.0 section 2.3.1); every
    // pointer is a null-terminated text that outlives the call.
    unsafe { callback(environment, status, category.as_ptr(), message.as_ptr()) }
}

thread_local! {
    static CATCHING: Cell<bool> = const { Cell::new(false) };
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Runs `body`; a panic becomes its message, and nothing is printed.
fn catch<T>(body: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if CATCHING.get() {
                PANIC.with_borrow_mut(|text| *text = info.to_string());
            } else {
                previous(info);
            }
        }));
    });
    let outer = CATCHING.replace(true);
    let result = catch_unwind(AssertUnwindSafe(body));
    CATCHING.set(outer);
    result.map_err(|_| PANIC.take())
}

/// Text behind a C string; `None` for a null pointer or bytes that are not UTF-8.
fn text<'a>(pointer: CText) -> Option<&'a str> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: the importer promises a null-terminated text that is valid during the call (section 2.1.2).
    unsafe { CStr::from_ptr(pointer) }.to_str().ok()
}

/// `n` values to read; an empty slice needs no address.
fn input<'a, T>(pointer: *const T, n: usize) -> Option<&'a [T]> {
    match (n, pointer.is_null()) {
        (0, _) => Some(&[]),
        (_, true) => None,
        // SAFETY: the importer promises `n` readable values (section 2.1.7).
        (_, false) => Some(unsafe { std::slice::from_raw_parts(pointer, n) }),
    }
}

/// `n` values to write; an empty slice needs no address.
fn output<'a, T>(pointer: *mut T, n: usize) -> Option<&'a mut [T]> {
    match (n, pointer.is_null()) {
        (0, _) => Some(&mut []),
        (_, true) => None,
        // SAFETY: the importer promises `n` writable values that nothing else uses during the call (section
        // 2.1.7); numbers have no invalid bit pattern.
        (_, false) => Some(unsafe { std::slice::from_raw_parts_mut(pointer, n) }),
    }
}

/// The instance behind a component.
fn instance<'a, M: Model>(component: Component) -> Option<&'a mut Instance<M>> {
    // SAFETY: a component that is not null came from `instantiate` of the same library and was not freed, and
    // is used by one thread at a time (section 2.1.6).
    unsafe { component.cast::<Instance<M>>().as_mut() }
}

/// One call on an instance: the call rules first, then `body` with panics caught.
fn call<M: Model>(
    component: Component,
    function: Function,
    body: impl FnOnce(&mut Instance<M>) -> Status,
) -> Status {
    let Some(instance) = instance::<M>(component) else { return Status::Error };
    let mode = instance.state.mode;
    if !is_allowed(function, instance.interface(), mode) {
        if mode == Mode::Fatal {
            return Status::Fatal;
        }
        let message = format!(
            "{}: not allowed in state \"{}\"; allowed in: {}",
            function.name(),
            mode.name(),
            allowed_states(function, instance.interface())
        );
        instance.logger.log(Category::Error, &message);
        instance.state.mode = Mode::Error;
        return Status::Error;
    }
    match catch(|| body(instance)) {
        Ok(Status::Error) => {
            instance.state.mode = Mode::Error;
            Status::Error
        }
        Ok(status) => status,
        Err(panic) => {
            instance.state.mode = Mode::Fatal;
            instance.logger.log(Category::Fatal, &format!("{}: the model failed: {panic}", function.name()));
            Status::Fatal
        }
    }
}

/// Error for an array argument that is a null pointer although values are expected.
fn null<M: Model>(instance: &Instance<M>, function: Function) -> Status {
    instance.error(function.name(), "an array argument is a null pointer")
}

pub fn types_platform() -> CText {
    c"default".as_ptr()
}

pub fn version() -> CText {
    c"2.0".as_ptr()
}

pub unsafe fn instantiate<M: Model>(
    definition: &'static OnceLock<Definition<M>>,
    name: CText,
    kind: c_int,
    guid: CText,
    resource_location: CText,
    functions: *const CallbackFunctions,
    logging_on: Bool,
) -> Component {
    // SAFETY: null or a structure of callbacks that is valid during the call (section 2.1.5).
    let functions = unsafe { functions.as_ref() };
    let environment = functions.map_or(std::ptr::null_mut(), |f| f.component_environment);
    let callback = functions.and_then(|f| f.logger).map_or(Callback::Nobody, Callback::Two);
    let interface = match kind {
        0 => Ok(Interface::ModelExchange),
        1 => Ok(Interface::CoSimulation),
        other => Err(format!("{other} is neither fmi2ModelExchange nor fmi2CoSimulation")),
    };
    make(definition, (callback, environment), interface, (name, guid, resource_location), logging_on != 0)
}

/// Makes an instance for an importer of any version; `texts` are instance name, GUID and place of the resources.
fn make<M: Model>(
    definition: &'static OnceLock<Definition<M>>,
    (callback, environment): (Callback, ComponentEnvironment),
    interface: Result<Interface, String>,
    (name, guid, resource_location): (CText, CText, CText),
    logging_on: bool,
) -> Component {
    let name = text(name).filter(|n| !n.is_empty()).unwrap_or(M::IDENTITY.model_name);
    let logger = Logger::new(callback, environment, name, logging_on);
    let refuse = |logger: &Logger, message: &str| {
        logger.log(Category::Error, &format!("fmi2Instantiate: {message}"));
        std::ptr::null_mut()
    };
    let definition = match catch(|| definition.get_or_init(Definition::new)) {
        Ok(definition) => definition,
        Err(panic) => return refuse(&logger, &format!("the model's variable table is wrong: {panic}")),
    };
    let interface = match interface {
        Ok(interface) => interface,
        Err(message) => return refuse(&logger, &message),
    };
    let folder = text(resource_location).and_then(resources::folder);
    let derived = match catch(|| StartValues::read(folder.as_deref())) {
        Ok(Ok(derived)) => derived,
        Ok(Err(message)) | Err(message) => return refuse(&logger, &message),
    };
    if let Err(message) = check_guid(text(guid).unwrap_or("(none)"), &definition.guid, derived.as_ref()) {
        return refuse(&logger, &message);
    }
    let (again, callback_logger) = (Logger::new(callback, environment, name, logging_on), logger);
    match catch(|| Instance::<M>::new(definition, derived, interface, callback_logger, folder)) {
        Ok(Ok(instance)) => Box::into_raw(Box::new(instance)).cast(),
        Ok(Err(Refusal::Discard(message) | Refusal::Error(message))) => refuse(&again, &message),
        Err(panic) => refuse(&again, &format!("the model failed: {panic}")),
    }
}

/// The GUID that the importer read must be that of the library, or of the FMU derived from it.
fn check_guid(guid: &str, library: &str, derived: Option<&StartValues>) -> Result<(), String> {
    match derived {
        Some(derived) if derived.base != library => Err(format!(
            "resources/{FILE} was made for the library {}, this one is {library}: derive the FMU again",
            derived.base
        )),
        Some(derived) if derived.guid != guid => Err(format!(
            "the GUID {guid} is not that of resources/{FILE}, {}: it does not belong to modelDescription.xml",
            derived.guid
        )),
        None if guid != library => Err(format!(
            "the GUID {guid} is not that of this FMU, {library}: library and modelDescription.xml do not belong \
             together, or fmuResourceLocation does not lead to resources/{FILE} of a derived FMU"
        )),
        _ => Ok(()),
    }
}

pub unsafe fn free_instance<M: Model>(component: Component) {
    let Some(i) = instance::<M>(component) else { return };
    if !is_allowed(Function::fmi2FreeInstance, i.interface(), i.state.mode) {
        return; // after fmi2Fatal the instance may be damaged beyond a safe drop
    }
    // SAFETY: the component came from `instantiate`, which boxed it; after this call the importer no longer uses
    // it (section 2.1.5).
    let boxed = unsafe { Box::from_raw(component.cast::<Instance<M>>()) };
    let _ = catch(|| drop(boxed));
}

pub unsafe fn set_debug_logging<M: Model>(
    c: Component,
    on: Bool,
    n: usize,
    categories: *const CText,
) -> Status {
    call::<M>(c, Function::fmi2SetDebugLogging, |i| {
        let Some(categories) = input(categories, n) else { return null(i, Function::fmi2SetDebugLogging) };
        let names: Vec<String> =
            categories.iter().map(|c| text(*c).unwrap_or("(null pointer)").to_owned()).collect();
        match i.logger.set(on != 0, &names) {
            Ok(()) => Status::OK,
            Err(name) => {
                let text = format!(
                    "fmi2SetDebugLogging: no log category is named `{name}`; known: {}",
                    known_categories()
                );
                i.logger.log(Category::Warning, &text);
                Status::Warning
            }
        }
    })
}

fn known_categories() -> String {
    crate::logger::CATEGORIES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}

pub unsafe fn setup_experiment<M: Model>(
    c: Component,
    tolerance_defined: Bool,
    tolerance: f64,
    start: f64,
    stop_defined: Bool,
    stop: f64,
) -> Status {
    call::<M>(c, Function::fmi2SetupExperiment, |i| {
        i.setup_experiment(
            (tolerance_defined != 0).then_some(tolerance),
            start,
            (stop_defined != 0).then_some(stop),
        )
    })
}

/// Functions that take the component only.
macro_rules! plain {
    ($($name:ident, $function:ident, $method:ident;)*) => {
        $(pub unsafe fn $name<M: Model>(c: Component) -> Status {
            call::<M>(c, Function::$function, Instance::$method)
        })*
    };
}
plain! {
    enter_initialization_mode, fmi2EnterInitializationMode, enter_initialization_mode;
    exit_initialization_mode, fmi2ExitInitializationMode, exit_initialization_mode;
    terminate, fmi2Terminate, terminate;
    reset, fmi2Reset, reset;
    enter_event_mode, fmi2EnterEventMode, enter_event_mode;
    enter_continuous_time_mode, fmi2EnterContinuousTimeMode, enter_continuous_time_mode;
}

/// Get and set functions of the number types.
macro_rules! get_and_set {
    ($($get:ident, $get_function:ident, $set:ident, $set_function:ident, $type:ty;)*) => {
        $(pub unsafe fn $get<M: Model>(
            c: Component,
            references: *const ValueReference,
            n: usize,
            values: *mut $type,
        ) -> Status {
            call::<M>(c, Function::$get_function, |i| match (input(references, n), output(values, n)) {
                (Some(references), Some(values)) => i.$get(references, values),
                _ => null(i, Function::$get_function),
            })
        }

        pub unsafe fn $set<M: Model>(
            c: Component,
            references: *const ValueReference,
            n: usize,
            values: *const $type,
        ) -> Status {
            call::<M>(c, Function::$set_function, |i| match (input(references, n), input(values, n)) {
                (Some(references), Some(values)) => i.$set(references, values),
                _ => null(i, Function::$set_function),
            })
        })*
    };
}
get_and_set! {
    get_real, fmi2GetReal, set_real, fmi2SetReal, f64;
    get_integer, fmi2GetInteger, set_integer, fmi2SetInteger, i32;
    get_boolean, fmi2GetBoolean, set_boolean, fmi2SetBoolean, Bool;
}

pub unsafe fn get_string<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    values: *mut CText,
) -> Status {
    call::<M>(c, Function::fmi2GetString, |i| match (input(references, n), output(values, n)) {
        (Some(references), Some(values)) => {
            i.get_string(references, |at, text: &CString| values[at] = text.as_ptr())
        }
        _ => null(i, Function::fmi2GetString),
    })
}

pub unsafe fn set_string<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    values: *const CText,
) -> Status {
    call::<M>(c, Function::fmi2SetString, |i| match (input(references, n), input(values, n)) {
        (Some(references), Some(values)) => {
            let texts: Vec<Option<&str>> = values.iter().map(|v| text(*v)).collect();
            i.set_string(references, &texts)
        }
        _ => null(i, Function::fmi2SetString),
    })
}

pub unsafe fn get_directional_derivative<M: Model>(
    c: Component,
    unknown: *const ValueReference,
    n_unknown: usize,
    known: *const ValueReference,
    n_known: usize,
    seed: *const f64,
    out: *mut f64,
) -> Status {
    const F: Function = Function::fmi2GetDirectionalDerivative;
    call::<M>(c, F, |i| {
        let (unknown, out) = (input(unknown, n_unknown), output(out, n_unknown));
        let (known, seed) = (input(known, n_known), input(seed, n_known));
        match (unknown, known, seed, out) {
            (Some(unknown), Some(known), Some(seed), Some(out)) => {
                i.directional_derivative(unknown, known, seed, out)
            }
            _ => null(i, F),
        }
    })
}
