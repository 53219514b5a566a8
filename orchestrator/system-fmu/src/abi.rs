//! The C interface: raw pointers become slices and texts, panics and refusals become statuses with a message.
//!
//! An importer promises valid handles, arrays of the stated length and one thread per instance at a time (FMI 2.0,
//! sections 2.1.3 to 2.1.9, 3.2 and 4.2); each `unsafe` below rests on that.
#![allow(unsafe_code, non_snake_case, clippy::missing_safety_doc, clippy::too_many_arguments)]

use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use airloop_cosim::master::embedded::Value;
use airloop_cosim::system::graph::DataType;
use fmi_export::Interface;
use fmi_export::ctypes::{
    Bool, CString as CText, CallbackFunctions, CallbackLogger, Component, ComponentEnvironment, EventInfo,
    FmuState, Status, ValueReference, status_kind,
};
use fmi_export::state_machine::{Function, Mode, allowed_states, is_allowed};

use crate::instance::{Instance, Refused, Step};
use crate::state::Saved;

/// The instance behind a component, with what the importer gave it.
struct Handle {
    instance: Instance,
    logger: Logger,
    /// Texts handed out; valid until the next call.
    texts: Vec<CString>,
}

/// The importer's logger.
struct Logger {
    callback: Option<CallbackLogger>,
    environment: ComponentEnvironment,
    name: CString,
}

impl Logger {
    fn error(&self, message: &str) {
        let Some(callback) = self.callback else { return };
        // Percent signs would be read as a format; a NUL cannot occur in our texts but in names of others.
        let message = message.replace('%', "%%").replace('\0', " ");
        let message = CString::new(message).unwrap_or_default();
        // SAFETY: a printf-like logger that lives as long as the instance (section 2.1.5); all texts are
        // null-terminated and outlive the call, and the format has no arguments.
        unsafe {
            callback(
                self.environment,
                self.name.as_ptr(),
                Status::Error,
                c"logStatusError".as_ptr(),
                message.as_ptr(),
            );
        }
    }
}

/// Text behind a C string; `None` for a null pointer or bytes that are not UTF-8.
fn text<'a>(pointer: CText) -> Option<&'a str> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: a null-terminated text that is valid during the call (section 2.1.2).
    unsafe { CStr::from_ptr(pointer) }.to_str().ok()
}

/// `n` values to read; an empty slice needs no address.
fn input<'a, T>(pointer: *const T, n: usize) -> Result<&'a [T], Refused> {
    match (n, pointer.is_null()) {
        (0, _) => Ok(&[]),
        (_, true) => Err("an array argument is a null pointer".into()),
        // SAFETY: `n` readable values (section 2.1.7).
        (_, false) => Ok(unsafe { std::slice::from_raw_parts(pointer, n) }),
    }
}

/// `n` values to write; an empty slice needs no address.
fn output<'a, T>(pointer: *mut T, n: usize) -> Result<&'a mut [T], Refused> {
    match (n, pointer.is_null()) {
        (0, _) => Ok(&mut []),
        (_, true) => Err("an array argument is a null pointer".into()),
        // SAFETY: `n` writable values that nothing else uses during the call (section 2.1.7).
        (_, false) => Ok(unsafe { std::slice::from_raw_parts_mut(pointer, n) }),
    }
}

/// One value to write.
fn place<'a, T>(pointer: *mut T) -> Result<&'a mut T, Refused> {
    // SAFETY: null or a place that can be written and that nothing else uses during the call.
    unsafe { pointer.as_mut() }.ok_or_else(|| "an argument is a null pointer".to_owned())
}

fn handle<'a>(component: Component) -> Option<&'a mut Handle> {
    // SAFETY: null, or from `fmi2Instantiate` of this library and not freed, used by one thread at a time.
    unsafe { component.cast::<Handle>().as_mut() }
}

/// One call on an instance: the call rules first, then `body`, whose refusal is an error and whose panic is fatal.
fn call(
    c: Component,
    function: Function,
    body: impl FnOnce(&mut Handle) -> Result<Status, Refused>,
) -> Status {
    let Some(handle) = handle(c) else { return Status::Error };
    let (interface, mode) = (handle.instance.interface, handle.instance.mode);
    if !is_allowed(function, interface, mode) {
        if mode == Mode::Fatal {
            return Status::Fatal;
        }
        handle.logger.error(&format!(
            "{}: not allowed in state \"{}\"; allowed in: {}",
            function.name(),
            mode.name(),
            allowed_states(function, interface)
        ));
        handle.instance.mode = Mode::Error;
        return Status::Error;
    }
    match catch_unwind(AssertUnwindSafe(|| body(handle))) {
        Ok(Ok(status)) => status,
        Ok(Err(message)) => {
            handle.logger.error(&format!("{}: {message}", function.name()));
            handle.instance.mode = Mode::Error;
            Status::Error
        }
        Err(_) => {
            handle.instance.mode = Mode::Fatal;
            handle.logger.error(&format!("{}: the system failed", function.name()));
            Status::Fatal
        }
    }
}

/// Folder behind `fmuResourceLocation`, a `file:` URI or a path.
fn folder(uri: &str) -> PathBuf {
    let path = uri.strip_prefix("file:").map_or(uri, |rest| match rest.strip_prefix("//") {
        Some(rest) => rest.strip_prefix("localhost").unwrap_or(rest),
        None => rest,
    });
    let mut bytes = Vec::with_capacity(path.len());
    let mut rest = path.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let code = tail.get(..2).filter(|_| first == b'%' && uri.starts_with("file:"));
        let code = code.and_then(|hex| std::str::from_utf8(hex).ok());
        match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    PathBuf::from(String::from_utf8_lossy(&bytes).into_owned())
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> CText {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> CText {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: CText,
    kind: c_int,
    guid: CText,
    resource_location: CText,
    functions: *const CallbackFunctions,
    _visible: Bool,
    _logging_on: Bool,
) -> Component {
    // SAFETY: null or a structure of callbacks that is valid during the call (section 2.1.5).
    let functions = unsafe { functions.as_ref() };
    let (callback, environment) =
        functions.map_or((None, std::ptr::null_mut()), |f| (f.logger, f.component_environment));
    let name = CString::new(text(name).unwrap_or("system")).unwrap_or_default();
    let logger = Logger { callback, environment, name };
    let interface = match kind {
        0 => Interface::ModelExchange,
        1 => Interface::CoSimulation,
        other => {
            logger.error(&format!("fmi2Instantiate: {other} is no fmi2Type"));
            return std::ptr::null_mut();
        }
    };
    let Some(resources) = text(resource_location) else {
        logger.error("fmi2Instantiate: fmuResourceLocation is missing; the system is in the resources");
        return std::ptr::null_mut();
    };
    let guid = text(guid).unwrap_or("(none)");
    match catch_unwind(AssertUnwindSafe(|| Instance::open(&folder(resources), guid, interface))) {
        Ok(Ok(instance)) => Box::into_raw(Box::new(Handle { instance, logger, texts: Vec::new() })).cast(),
        Ok(Err(message)) => {
            logger.error(&format!("fmi2Instantiate: {message}"));
            std::ptr::null_mut()
        }
        Err(_) => {
            logger.error("fmi2Instantiate: the system failed");
            std::ptr::null_mut()
        }
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(c: Component) {
    let Some(handle) = handle(c) else { return };
    if handle.instance.mode == Mode::Fatal {
        return; // it may be damaged beyond a safe drop
    }
    // SAFETY: the component came from `fmi2Instantiate`, which boxed it, and is not used after this call.
    let boxed = unsafe { Box::from_raw(c.cast::<Handle>()) };
    // A panic ends here; there is nobody left to tell.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(boxed)));
}

/// Exported functions with the call rules of the function of the same name.
macro_rules! functions {
    ($($name:ident($handle:ident $(, $argument:ident: $type:ty)*) $body:block)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name(c: Component $(, $argument: $type)*) -> Status {
                call(c, Function::$name, |$handle: &mut Handle| $body)
            }
        )*
    };
}

/// Sets the mode; never refused.
fn to(handle: &mut Handle, mode: Mode) -> Result<Status, Refused> {
    handle.instance.mode = mode;
    Ok(Status::OK)
}

functions! {
    fmi2SetDebugLogging(_h, _on: Bool, _n: usize, _categories: *const CText) { Ok(Status::OK) }
    fmi2SetupExperiment(h, tolerance_defined: Bool, tolerance: f64, start: f64, stop_defined: Bool, stop: f64) {
        let tolerance = (tolerance_defined != 0).then_some(tolerance);
        h.instance.setup(tolerance, start, (stop_defined != 0).then_some(stop)).map(|()| Status::OK)
    }
    fmi2EnterInitializationMode(h) { to(h, Mode::InitializationMode) }
    fmi2ExitInitializationMode(h) { h.instance.exit_initialization().map(|()| Status::OK) }
    fmi2Terminate(h) { to(h, Mode::Terminated) }
    fmi2Reset(h) {
        h.instance.reset();
        Ok(Status::OK)
    }
    fmi2GetReal(h, references: *const ValueReference, n: usize, values: *mut f64) {
        for (&reference, place) in input(references, n)?.iter().zip(output(values, n)?) {
            if let Value::Real(value) = h.instance.get(reference, DataType::Real)? {
                *place = value;
            }
        }
        Ok(Status::OK)
    }
    fmi2GetInteger(h, references: *const ValueReference, n: usize, values: *mut c_int) {
        for (&reference, place) in input(references, n)?.iter().zip(output(values, n)?) {
            if let Value::Integer(value) = h.instance.get(reference, DataType::Integer)? {
                *place = c_int::try_from(value)
                    .map_err(|_| format!("#i{reference}# is {value}, and an Integer of FMI 2.0 has 32 bits"))?;
            }
        }
        Ok(Status::OK)
    }
    fmi2GetBoolean(h, references: *const ValueReference, n: usize, values: *mut Bool) {
        for (&reference, place) in input(references, n)?.iter().zip(output(values, n)?) {
            if let Value::Boolean(value) = h.instance.get(reference, DataType::Boolean)? {
                *place = value.into();
            }
        }
        Ok(Status::OK)
    }
    fmi2GetString(h, references: *const ValueReference, n: usize, values: *mut CText) {
        h.texts.clear();
        for (&reference, place) in input(references, n)?.iter().zip(output(values, n)?) {
            if let Value::String(value) = h.instance.get(reference, DataType::String)? {
                let text = CString::new(value.replace('\0', " ")).unwrap_or_default();
                // The text stays where it is when the list grows.
                *place = text.as_ptr();
                h.texts.push(text);
            }
        }
        Ok(Status::OK)
    }
    fmi2SetReal(h, references: *const ValueReference, n: usize, values: *const f64) {
        for (&reference, &value) in input(references, n)?.iter().zip(input(values, n)?) {
            h.instance.set(reference, Value::Real(value))?;
        }
        Ok(Status::OK)
    }
    fmi2SetInteger(h, references: *const ValueReference, n: usize, values: *const c_int) {
        for (&reference, &value) in input(references, n)?.iter().zip(input(values, n)?) {
            h.instance.set(reference, Value::Integer(value.into()))?;
        }
        Ok(Status::OK)
    }
    fmi2SetBoolean(h, references: *const ValueReference, n: usize, values: *const Bool) {
        for (&reference, &value) in input(references, n)?.iter().zip(input(values, n)?) {
            h.instance.set(reference, Value::Boolean(value != 0))?;
        }
        Ok(Status::OK)
    }
    fmi2SetString(h, references: *const ValueReference, n: usize, values: *const CText) {
        for (&reference, &value) in input(references, n)?.iter().zip(input(values, n)?) {
            let value = text(value).ok_or("a text is a null pointer or not UTF-8")?;
            h.instance.set(reference, Value::String(value.to_owned()))?;
        }
        Ok(Status::OK)
    }
    fmi2GetFMUstate(h, state: *mut FmuState) {
        let state = place(state)?;
        let saved = h.instance.save()?;
        // SAFETY: null, or a state of this instance that was not freed (section 2.1.8).
        match unsafe { state.cast::<Saved>().as_mut() } {
            Some(old) => *old = saved,
            None => *state = Box::into_raw(Box::new(saved)).cast(),
        }
        Ok(Status::OK)
    }
    fmi2SetFMUstate(h, state: FmuState) {
        // SAFETY: as in `fmi2GetFMUstate`.
        let saved = unsafe { state.cast::<Saved>().as_ref() }.ok_or("the state is a null pointer")?;
        h.instance.restore(saved).map(|()| Status::OK)
    }
    fmi2FreeFMUstate(_h, state: *mut FmuState) {
        let state = place(state)?;
        if !state.is_null() {
            // SAFETY: a state of this instance that was not freed.
            drop(unsafe { Box::from_raw(state.cast::<Saved>()) });
            *state = std::ptr::null_mut();
        }
        Ok(Status::OK)
    }
    fmi2SerializedFMUstateSize(_h, state: FmuState, size: *mut usize) {
        *place(size)? = bytes(state)?.len();
        Ok(Status::OK)
    }
    fmi2SerializeFMUstate(_h, state: FmuState, to: *mut c_char, size: usize) {
        let bytes = bytes(state)?;
        if bytes.len() > size {
            return Err(format!("{size} bytes are too few, the state takes {}", bytes.len()));
        }
        output(to.cast::<u8>(), bytes.len())?.copy_from_slice(&bytes);
        Ok(Status::OK)
    }
    fmi2DeSerializeFMUstate(_h, from: *const c_char, size: usize, state: *mut FmuState) {
        let saved: Saved =
            serde_json::from_slice(input(from.cast::<u8>(), size)?).map_err(|error| error.to_string())?;
        let state = place(state)?;
        // SAFETY: as in `fmi2GetFMUstate`.
        match unsafe { state.cast::<Saved>().as_mut() } {
            Some(old) => *old = saved,
            None => *state = Box::into_raw(Box::new(saved)).cast(),
        }
        Ok(Status::OK)
    }
    fmi2GetDirectionalDerivative(
        h, unknown: *const ValueReference, n_unknown: usize, known: *const ValueReference, n_known: usize,
        seed: *const f64, values: *mut f64
    ) {
        let (unknown, known) = (input(unknown, n_unknown)?, input(known, n_known)?);
        let found = h.instance.directional(unknown, known, input(seed, n_known)?)?;
        output(values, n_unknown)?.copy_from_slice(&found);
        Ok(Status::OK)
    }
    fmi2EnterEventMode(h) { to(h, Mode::EventMode) }
    fmi2EnterContinuousTimeMode(h) { to(h, Mode::ContinuousTimeMode) }
    fmi2NewDiscreteStates(h, info: *mut EventInfo) {
        let report = h.instance.new_discrete_states()?;
        *place(info)? = EventInfo {
            new_discrete_states_needed: 0,
            terminate_simulation: report.terminated.is_some().into(),
            nominals_of_continuous_states_changed: 0,
            values_of_continuous_states_changed: report.states_changed.into(),
            next_event_time_defined: report.next_event.is_some().into(),
            next_event_time: report.next_event.unwrap_or(0.0),
        };
        Ok(Status::OK)
    }
    fmi2CompletedIntegratorStep(
        h, _no_set_state_prior: Bool, enter_event_mode: *mut Bool, terminate_simulation: *mut Bool
    ) {
        let (event, end) = h.instance.models()?.0.completed().map_err(|error| error.to_string())?;
        *place(enter_event_mode)? = event.into();
        *place(terminate_simulation)? = end.is_some().into();
        Ok(Status::OK)
    }
    fmi2SetTime(h, time: f64) {
        if !time.is_finite() {
            return Err(format!("the time {time} is not finite"));
        }
        h.instance.time = time;
        h.instance.models()?.0.set_time(time);
        Ok(Status::OK)
    }
    fmi2SetContinuousStates(h, x: *const f64, n: usize) {
        let models = h.instance.models()?.0;
        check_length(n, models.state_count())?;
        models.set_states(input(x, n)?);
        Ok(Status::OK)
    }
    fmi2GetContinuousStates(h, x: *mut f64, n: usize) {
        let models = h.instance.models()?.0;
        check_length(n, models.state_count())?;
        output(x, n)?.copy_from_slice(models.states());
        Ok(Status::OK)
    }
    fmi2GetDerivatives(h, dx: *mut f64, n: usize) {
        let models = h.instance.models()?.0;
        check_length(n, models.state_count())?;
        output(dx, n)?.copy_from_slice(models.derivatives().map_err(|error| error.to_string())?);
        Ok(Status::OK)
    }
    fmi2GetEventIndicators(h, z: *mut f64, n: usize) {
        let models = h.instance.models()?.0;
        check_length(n, models.indicator_count())?;
        models.indicators(output(z, n)?).map_err(|error| error.to_string())?;
        Ok(Status::OK)
    }
    fmi2GetNominalsOfContinuousStates(h, nominals: *mut f64, n: usize) {
        check_length(n, h.instance.table().states.len())?;
        let nominals = output(nominals, n)?;
        if h.instance.mode == Mode::Instantiated {
            let table = h.instance.table();
            for (place, &state) in nominals.iter_mut().zip(&table.states) {
                *place = table.variables[state].nominal.unwrap_or(1.0);
            }
            return Ok(Status::OK);
        }
        h.instance.models()?.0.nominals(nominals).map_err(|error| error.to_string())?;
        Ok(Status::OK)
    }
    fmi2DoStep(h, time: f64, step: f64, _no_set_state_prior: Bool) {
        match h.instance.do_step(time, step)? {
            Step::Done => Ok(Status::OK),
            Step::Ended => {
                h.instance.mode = Mode::StepFailed;
                Ok(Status::Discard)
            }
        }
    }
    fmi2SetRealInputDerivatives(
        _h, _references: *const ValueReference, _n: usize, _orders: *const c_int, _values: *const f64
    ) {
        Err("inputs are held over a step (canInterpolateInputs is false)".into())
    }
    fmi2GetRealOutputDerivatives(
        _h, _references: *const ValueReference, _n: usize, _orders: *const c_int, _values: *mut f64
    ) {
        Err("there are no output derivatives (maxOutputDerivativeOrder is 0)".into())
    }
    fmi2CancelStep(_h) { Err("steps are synchronous".into()) }
    fmi2GetStatus(h, kind: c_int, value: *mut Status) {
        if kind != status_kind::DO_STEP_STATUS {
            return Ok(Status::Discard);
        }
        *place(value)? = if h.instance.mode == Mode::StepFailed { Status::Discard } else { Status::OK };
        Ok(Status::OK)
    }
    fmi2GetRealStatus(h, kind: c_int, value: *mut f64) {
        if kind != status_kind::LAST_SUCCESSFUL_TIME {
            return Ok(Status::Discard);
        }
        *place(value)? = h.instance.time;
        Ok(Status::OK)
    }
    fmi2GetIntegerStatus(_h, _kind: c_int, _value: *mut c_int) { Ok(Status::Discard) }
    fmi2GetBooleanStatus(h, kind: c_int, value: *mut Bool) {
        if kind != status_kind::TERMINATED {
            return Ok(Status::Discard);
        }
        *place(value)? = h.instance.terminated.into();
        Ok(Status::OK)
    }
    fmi2GetStringStatus(_h, _kind: c_int, _value: *mut CText) { Ok(Status::Discard) }
}

fn check_length(given: usize, expected: usize) -> Result<(), Refused> {
    if given == expected { Ok(()) } else { Err(format!("{given} values where there are {expected}")) }
}

/// A state as bytes.
fn bytes(state: FmuState) -> Result<Vec<u8>, Refused> {
    // SAFETY: null, or a state of this library that was not freed.
    let saved = unsafe { state.cast::<Saved>().as_ref() }.ok_or("the state is a null pointer")?;
    serde_json::to_vec(saved).map_err(|error| error.to_string())
}
