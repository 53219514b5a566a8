//! Functions with the signatures of FMI that pass each call on to a worker.
//!
//! The component that they take is a [`Remote`]. Setters and steps of a running instance are handled as the parent
//! module says; all else is one turn of the worker.

use std::cell::{Cell, RefCell};
use std::ffi::{CStr, CString, c_char, c_void};
use std::sync::Arc;

use fmi::fmi2::binding::*;

use super::calls::*;
use super::channel::{Answer, Channel};
use crate::functions::{CommonFunctions, FirstFunctions, ModelFunctions, SlaveFunctions};
use crate::library::Library;
use crate::log::LogBuffer;

/// Setters that are kept back at most \[bytes\].
const MOST_KEPT: usize = 1 << 16;
/// A step is followed by the same reading this often before its values are asked for with the step.
const HABIT: u32 = 2;

thread_local! {
    static OPENING: RefCell<Option<Arc<Channel>>> = const { RefCell::new(None) };
    static KEPT_BACK: Cell<Option<(&'static str, u32)>> = const { Cell::new(None) };
}

/// Runs `work`, in which [`instantiate`] makes instances in this worker.
pub(crate) fn with_channel<T>(channel: &Arc<Channel>, work: impl FnOnce() -> T) -> T {
    OPENING.set(Some(Arc::clone(channel)));
    let made = work();
    OPENING.set(None);
    made
}

/// The setter that failed when it was sent with the call that failed last in this thread, with its status.
pub(crate) fn kept_back() -> Option<(&'static str, u32)> {
    KEPT_BACK.take()
}

/// Frees what this process holds of an instance that must not be called any more.
pub(crate) fn forget(component: *mut c_void) {
    // SAFETY: made by `instantiate` below, and not used after this.
    drop(unsafe { Box::from_raw(component.cast::<Remote>()) });
}

/// An instance in a worker.
struct Remote {
    channel: Arc<Channel>,
    instance: u64,
    /// Where messages go.
    log: *mut c_void,
    /// Setters that are kept back, and which they are.
    kept: Calls,
    functions: Vec<u32>,
    calls: Calls,
    /// Initialized: setters may be kept back.
    running: bool,
    after_step: bool,
    /// Reading that followed the last step, and how many steps it followed.
    reading: Vec<u32>,
    habit: u32,
    /// Values of that reading after the last step, if nothing came between.
    values: Vec<f64>,
    ready: bool,
    texts: Vec<CString>,
}

impl Remote {
    /// Begins a call that is sent at once.
    fn begin(&mut self, function: u32) -> &mut Calls {
        self.ready = false;
        self.after_step = function == DO_STEP;
        self.calls.bytes.clear();
        self.calls.bytes.extend_from_slice(&self.kept.bytes);
        self.kept.bytes.clear();
        self.calls.begin(function, self.instance);
        &mut self.calls
    }

    /// Begins a setter, which is kept back if it may be.
    fn begin_setter(&mut self, function: u32) -> &mut Calls {
        self.ready = false;
        self.after_step = false;
        self.kept.begin(function, self.instance);
        self.functions.push(function);
        &mut self.kept
    }

    /// Ends a setter: its status, as far as it is known.
    fn end_setter(&mut self) -> u32 {
        if self.running && self.kept.bytes.len() < MOST_KEPT {
            return 0;
        }
        self.calls.bytes.clear();
        self.calls.bytes.append(&mut self.kept.bytes);
        // The last setter is the call itself.
        self.functions.pop();
        self.send().0
    }

    /// Sends what was begun; its status and what it gave.
    fn send(&mut self) -> (u32, Vec<u8>) {
        self.send_with(0)
    }

    /// Same, where the last `more` calls come after the one whose status counts.
    fn send_with(&mut self, more: u64) -> (u32, Vec<u8>) {
        let kept = self.functions.len() as u64;
        let answer = self.channel.call(&self.calls);
        let Some(Answer { status, index, payload, log }) = answer else {
            self.functions.clear();
            return (LOST, Vec::new());
        };
        if !self.log.is_null() {
            // SAFETY: the environment that `instantiate` was given: a log buffer that outlives the component.
            let buffer = unsafe { &*self.log.cast::<LogBuffer>() };
            log.into_iter().for_each(|message| buffer.push(message));
        }
        let status = if index < kept {
            let function = self.functions[usize::try_from(index).unwrap_or(0)];
            KEPT_BACK.set(Some((name(function), status)));
            // The call itself was not made. Whatever the setter said, this instance cannot go on as if it had.
            status.max(3)
        } else if index > kept && status > 1 && more > 0 {
            // A later reading failed: it is asked for again, and answers for itself.
            self.habit = 0;
            0
        } else {
            status
        };
        self.functions.clear();
        (status, payload)
    }

    fn get(&mut self, function: u32, references: &[u32], values: &mut [u8]) -> u32 {
        self.begin(function).block(bytes_of(references));
        self.receive(values)
    }

    /// Sends what was begun, whose answer is a block of values.
    fn receive(&mut self, values: &mut [u8]) -> u32 {
        let (status, payload) = self.send();
        match (Parts { bytes: &payload }).block() {
            Some(block) if block.len() == values.len() => values.copy_from_slice(block),
            _ if status <= 1 => return REFUSED,
            _ => {}
        }
        status
    }

    fn simple(&mut self, function: u32) -> u32 {
        self.begin(function);
        self.send().0
    }
}

/// The instance behind a component.
///
/// # Safety
/// `component` was made by [`instantiate`] and not freed, and nobody else uses it now.
unsafe fn remote<'a>(component: *mut c_void) -> &'a mut Remote {
    // SAFETY: as the caller promises.
    unsafe { &mut *component.cast::<Remote>() }
}

/// An array of C.
///
/// # Safety
/// `values` has `count` elements.
unsafe fn list<'a, T>(values: *const T, count: usize) -> &'a [T] {
    // SAFETY: as the caller promises; an empty array may be anywhere.
    if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(values, count) } }
}

/// Same as [`list`], to write to.
///
/// # Safety
/// `values` has `count` elements.
unsafe fn list_mut<'a, T>(values: *mut T, count: usize) -> &'a mut [T] {
    // SAFETY: as the caller promises; an empty array may be anywhere.
    if count == 0 { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(values, count) } }
}

/// Bits of the optional functions of a library, of its interfaces, and of nothing else.
pub(super) fn offered(library: &Library) -> u64 {
    let common = &library.common;
    let slave = library.slave.as_ref().ok();
    let bits = [
        library.slave.is_ok(),
        library.model.is_ok(),
        common.set_debug_logging.is_some(),
        common.get_state.is_some(),
        common.set_state.is_some(),
        common.free_state.is_some(),
        common.serialized_state_size.is_some(),
        common.serialize_state.is_some(),
        common.deserialize_state.is_some(),
        common.directional_derivative.is_some(),
        slave.is_some_and(|slave| slave.set_real_input_derivatives.is_some()),
        slave.is_some_and(|slave| slave.get_real_output_derivatives.is_some()),
        slave.is_some_and(|slave| slave.get_real_status.is_some()),
        slave.is_some_and(|slave| slave.get_boolean_status.is_some()),
    ];
    bits.iter().enumerate().map(|(index, &there)| u64::from(there) << index).sum()
}

/// Tables of functions of one library: those before there is an instance, common ones, and those of each interface.
pub(crate) type Tables = (
    FirstFunctions,
    CommonFunctions,
    Result<SlaveFunctions, &'static str>,
    Result<ModelFunctions, &'static str>,
);

/// Loads a library in a worker; `None` if the worker is lost. The error is the message of the worker.
pub(crate) fn functions(channel: &Channel, texts: [&str; 3]) -> Option<Result<Tables, String>> {
    let mut calls = Calls::default();
    calls.begin(LOAD, 0);
    texts.iter().for_each(|text| calls.block(text.as_bytes()));
    let answer = channel.call(&calls)?;
    let mut parts = Parts { bytes: &answer.payload };
    if answer.status != 0 {
        let message = parts.block().map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        return Some(Err(message.unwrap_or_else(|| "the worker cannot load it".into())));
    }
    let bits = parts.number().unwrap_or_default();
    let has = |index: u32| bits >> index & 1 == 1;
    let first = FirstFunctions { get_types_platform, get_version, instantiate };
    let common = CommonFunctions {
        free_instance,
        setup_experiment,
        enter_initialization_mode,
        exit_initialization_mode,
        terminate,
        reset,
        get_real,
        get_integer,
        get_boolean,
        get_string,
        set_real,
        set_integer,
        set_boolean,
        set_string,
        set_debug_logging: has(2).then_some(set_debug_logging),
        get_state: has(3).then_some(get_state),
        set_state: has(4).then_some(set_state),
        free_state: has(5).then_some(free_state),
        serialized_state_size: has(6).then_some(serialized_state_size),
        serialize_state: has(7).then_some(serialize_state),
        deserialize_state: has(8).then_some(deserialize_state),
        directional_derivative: has(9).then_some(directional_derivative),
    };
    let slave = SlaveFunctions {
        do_step,
        set_real_input_derivatives: has(10).then_some(set_real_input_derivatives),
        get_real_output_derivatives: has(11).then_some(get_real_output_derivatives),
        get_real_status: has(12).then_some(get_real_status),
        get_boolean_status: has(13).then_some(get_boolean_status),
    };
    let model = ModelFunctions {
        enter_event_mode,
        new_discrete_states,
        enter_continuous_time_mode,
        completed_integrator_step,
        set_time,
        set_continuous_states,
        get_continuous_states,
        get_derivatives,
        get_event_indicators,
        get_nominals,
    };
    let slave = has(0).then_some(slave).ok_or("fmi2DoStep");
    let model = has(1).then_some(model).ok_or("fmi2GetDerivatives");
    Some(Ok((first, common, slave, model)))
}

type Component = *mut c_void;

extern "C" fn get_types_platform() -> *const c_char {
    c"default".as_ptr()
}

extern "C" fn get_version() -> *const c_char {
    c"2.0".as_ptr()
}

unsafe extern "C" fn instantiate(
    name: fmi2String,
    fmi_type: fmi2Type,
    guid: fmi2String,
    resources: fmi2String,
    callbacks: *const fmi2CallbackFunctions,
    visible: fmi2Boolean,
    logging: fmi2Boolean,
) -> Component {
    let Some(channel) = OPENING.with_borrow(Clone::clone) else { return std::ptr::null_mut() };
    // SAFETY: our importer passes callbacks that live as long as the component.
    let log = unsafe { (*callbacks).componentEnvironment };
    let mut remote = Box::new(Remote {
        channel,
        instance: 0,
        log,
        kept: Calls::default(),
        functions: Vec::new(),
        calls: Calls::default(),
        running: false,
        after_step: false,
        reading: Vec::new(),
        habit: 0,
        values: Vec::new(),
        ready: false,
        texts: Vec::new(),
    });
    let calls = remote.begin(INSTANTIATE);
    for text in [name, guid, resources] {
        // SAFETY: strings of our importer.
        calls.block(unsafe { CStr::from_ptr(text) }.to_bytes());
    }
    for number in [fmi_type, visible as u32, logging as u32] {
        calls.number(number.into());
    }
    let (status, payload) = remote.send();
    match (Parts { bytes: &payload }).number() {
        Some(instance) if status == 0 => {
            remote.instance = instance;
            Box::into_raw(remote).cast()
        }
        _ => std::ptr::null_mut(),
    }
}

unsafe extern "C" fn free_instance(component: Component) {
    // SAFETY: our importer frees a component once.
    let mut remote = unsafe { Box::from_raw(component.cast::<Remote>()) };
    remote.kept.bytes.clear();
    remote.functions.clear();
    remote.simple(FREE_INSTANCE);
}

macro_rules! simple {
    ($($function:ident: $number:ident,)*) => {
        $(unsafe extern "C" fn $function(component: Component) -> fmi2Status {
            // SAFETY: our importer passes a live component.
            unsafe { remote(component) }.simple($number)
        })*
    };
}

simple! {
    enter_initialization_mode: ENTER_INITIALIZATION,
    enter_event_mode: ENTER_EVENT_MODE,
    enter_continuous_time_mode: ENTER_CONTINUOUS_TIME,
}

unsafe extern "C" fn exit_initialization_mode(component: Component) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    let status = remote.simple(EXIT_INITIALIZATION);
    remote.running = status <= 1;
    status
}

unsafe extern "C" fn terminate(component: Component) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.running = false;
    remote.simple(TERMINATE)
}

unsafe extern "C" fn reset(component: Component) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.running = false;
    remote.simple(RESET)
}

unsafe extern "C" fn setup_experiment(
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

unsafe extern "C" fn get_real(
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

unsafe extern "C" fn get_integer(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *mut fmi2Integer,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list_mut(values, count)) };
    remote.get(GET_INTEGER, references, bytes_of_mut(values))
}

unsafe extern "C" fn get_boolean(
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

unsafe extern "C" fn get_string(
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

unsafe extern "C" fn set_real(
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

unsafe extern "C" fn set_integer(
    component: Component,
    references: *const fmi2ValueReference,
    count: usize,
    values: *const fmi2Integer,
) -> fmi2Status {
    // SAFETY: our importer passes a live component and arrays of this length.
    let (remote, references, values) =
        unsafe { (remote(component), list(references, count), list(values, count)) };
    let calls = remote.begin_setter(SET_INTEGER);
    calls.block(bytes_of(references));
    calls.block(bytes_of(values));
    remote.end_setter()
}

unsafe extern "C" fn set_boolean(
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

unsafe extern "C" fn set_string(
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

unsafe extern "C" fn set_debug_logging(
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

unsafe extern "C" fn get_state(component: Component, state: *mut fmi2FMUstate) -> fmi2Status {
    // SAFETY: our importer passes a live component and a pointer to a local.
    unsafe {
        let remote = remote(component);
        remote.begin(GET_STATE).number(*state as u64);
        receive_state(remote, state)
    }
}

unsafe extern "C" fn set_state(component: Component, state: fmi2FMUstate) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin(SET_STATE).number(state as u64);
    remote.send().0
}

unsafe extern "C" fn free_state(component: Component, state: *mut fmi2FMUstate) -> fmi2Status {
    // SAFETY: our importer passes a live component and a pointer to a local.
    let (remote, pointer) = unsafe { (remote(component), *state) };
    remote.begin(FREE_STATE).number(pointer as u64);
    remote.send().0
}

unsafe extern "C" fn serialized_state_size(
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

unsafe extern "C" fn serialize_state(
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

unsafe extern "C" fn deserialize_state(
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

unsafe extern "C" fn directional_derivative(
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

unsafe extern "C" fn do_step(
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

unsafe extern "C" fn set_real_input_derivatives(
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

unsafe extern "C" fn get_real_output_derivatives(
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

unsafe extern "C" fn get_real_status(
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

unsafe extern "C" fn get_boolean_status(
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

unsafe extern "C" fn new_discrete_states(component: Component, info: *mut fmi2EventInfo) -> fmi2Status {
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

unsafe extern "C" fn completed_integrator_step(
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

unsafe extern "C" fn set_time(component: Component, time: fmi2Real) -> fmi2Status {
    // SAFETY: our importer passes a live component.
    let remote = unsafe { remote(component) };
    remote.begin_setter(SET_TIME).real(time);
    remote.end_setter()
}

unsafe extern "C" fn set_continuous_states(
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
        $(unsafe extern "C" fn $function(
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
