//! The worker: makes the calls that come through the shared memory, in the library of one FMU.

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use fmi::fmi2::binding::{
    fmi2CallbackFunctions, fmi2EventInfo, fmi2Type_fmi2CoSimulation, fmi2Type_fmi2ModelExchange,
};

use super::area::{Area, tell, wait};
use super::calls::*;
use super::patience::Patience;
use super::system::SHARED;
use crate::fmi3::Component;
use crate::instance::memory;
use crate::library::{Library, Origin};
use crate::log::{LogBuffer, LogMessage, airloop_fmi2_logger};
use crate::open::{Fmu, InterfaceKind};

/// Status of a call that the library does not have, as far as the library is concerned.
const WARNING: u32 = 1;

/// Serves the process that started this one, until that ends or wants it: the whole work of a worker. Whatever the
/// library does, this process alone bears it.
///
/// # Errors
/// The shared memory is not there: this was not started as a worker.
pub fn serve() -> std::io::Result<()> {
    crate::last_words::end_copies();
    let mut area = Area::of_owner(SHARED)?;
    // Messages are written there also after the memory has grown, so that this mapping stays.
    let log = std::mem::ManuallyDrop::new(area.again()?);
    let place = log.log_place();
    let mirror = move |message: &LogMessage| {
        let mut bytes = Calls::default();
        bytes.number(message.status.into());
        for part in [&message.instance, &message.category, &message.text] {
            bytes.block(part.as_bytes());
        }
        place.add(&bytes.bytes);
    };
    let mut worker = Worker {
        library: None,
        fmu: None,
        instances: Vec::new(),
        log: Box::new(LogBuffer::mirrored(mirror)),
    };
    let (mut patience, mut none) = (Patience::new(), Patience::none());
    let (mut done, mut request, mut answer) = (0, Vec::new(), Calls::default());
    loop {
        let header = area.header();
        while header.request.load(Ordering::Acquire) == done {
            let patience = match header.looks.load(Ordering::Relaxed) {
                0 => &mut none,
                _ => &mut patience,
            };
            wait(&header.request, &header.worker_sleeps, done, patience, None);
        }
        done = header.request.load(Ordering::Acquire);
        let length = header.length.load(Ordering::Relaxed) as usize;
        if length == 0 {
            return Ok(());
        }
        area.follow()?;
        request.resize(length, 0);
        area.get(0, &mut request);
        answer.bytes.clear();
        let (status, index) = worker.calls(&request, &area, &mut answer);
        let head = [u64::from(status), index, answer.bytes.len() as u64];
        let needed = length + 24 + answer.bytes.len();
        if needed > area.capacity() {
            let more = [u64::from(MORE_ROOM), index, 8, needed as u64];
            area.put(length, bytes_of(&more));
        } else {
            area.put(length, bytes_of(&head));
            area.put(length + 24, &answer.bytes);
        }
        let header = area.header();
        tell(&header.answer, &header.owner_sleeps, done);
    }
}

/// An instance in the worker.
struct Held {
    component: *mut c_void,
    // The FMU may keep the pointer.
    _callbacks: Box<fmi2CallbackFunctions>,
}

struct Worker {
    // Dropped in this order: no instance outlives its library, and the log outlives both.
    instances: Vec<Option<Held>>,
    library: Option<Arc<Library>>,
    fmu: Option<Arc<Fmu>>,
    log: Box<LogBuffer>,
}

impl Worker {
    /// Makes calls until one fails; status and number of the last one.
    fn calls(&mut self, request: &[u8], area: &Area, answer: &mut Calls) -> (u32, u64) {
        let mut parts = Parts { bytes: request };
        let mut index = 0;
        loop {
            let (Some(function), Some(instance)) = (parts.number(), parts.number()) else {
                return (REFUSED, index);
            };
            let function = u32::try_from(function).unwrap_or(u32::MAX);
            area.header().function.store(function, Ordering::Release);
            let status = self.call(function, instance, &mut parts, answer).unwrap_or(REFUSED);
            crate::last_words::end_if_copy();
            area.header().function.store(0, Ordering::Release);
            if status > WARNING || parts.bytes.is_empty() {
                return (status, index);
            }
            index += 1;
        }
    }

    fn call(&mut self, function: u32, instance: u64, parts: &mut Parts, out: &mut Calls) -> Option<u32> {
        match function {
            LOAD => return self.load(parts, out),
            INSTANTIATE => return self.instantiate(parts, out),
            _ => {}
        }
        let library = self.library.as_ref()?;
        let (common, slave, model) = (&library.common, library.slave.as_ref(), library.model.as_ref());
        let place = self.instances.get_mut(usize::try_from(instance).ok()?)?;
        let c = place.as_ref()?.component;
        // SAFETY: the component was made by this library and is alive; each array has the length passed with it, and
        // all others are locals.
        unsafe {
            Some(match function {
                FREE_INSTANCE => {
                    (common.free_instance)(c);
                    *place = None;
                    0
                }
                SETUP_EXPERIMENT => {
                    let (has_tolerance, tolerance) = (parts.number()?, parts.real()?);
                    let (start, has_stop, stop) = (parts.real()?, parts.number()?, parts.real()?);
                    (common.setup_experiment)(
                        c,
                        has_tolerance as i32,
                        tolerance,
                        start,
                        has_stop as i32,
                        stop,
                    )
                }
                ENTER_INITIALIZATION => (common.enter_initialization_mode)(c),
                EXIT_INITIALIZATION => (common.exit_initialization_mode)(c),
                TERMINATE => (common.terminate)(c),
                RESET => (common.reset)(c),
                GET_REAL => {
                    let references = values_of::<u32>(parts.block()?);
                    let mut values = vec![0.0_f64; references.len()];
                    let status =
                        (common.get_real)(c, references.as_ptr(), references.len(), values.as_mut_ptr());
                    out.block(bytes_of(&values));
                    status
                }
                GET_INTEGER => {
                    let references = values_of::<u32>(parts.block()?);
                    let mut values = vec![0_i64; references.len()];
                    let status = common.get_integer.call(c, &references, &mut values, &mut Vec::new());
                    out.block(bytes_of(&values));
                    status
                }
                GET_BOOLEAN => {
                    let references = values_of::<u32>(parts.block()?);
                    let mut values = vec![0_i32; references.len()];
                    let status =
                        (common.get_boolean)(c, references.as_ptr(), references.len(), values.as_mut_ptr());
                    out.block(bytes_of(&values));
                    status
                }
                GET_STRING => {
                    let references = values_of::<u32>(parts.block()?);
                    let mut values: Vec<*const c_char> = vec![std::ptr::null(); references.len()];
                    let status =
                        (common.get_string)(c, references.as_ptr(), references.len(), values.as_mut_ptr());
                    for value in values.iter().filter(|_| status <= WARNING) {
                        out.block(if value.is_null() { b"" } else { CStr::from_ptr(*value).to_bytes() });
                    }
                    status
                }
                SET_REAL => {
                    let references = values_of::<u32>(parts.block()?);
                    let values = same_length::<f64>(parts, references.len())?;
                    (common.set_real)(c, references.as_ptr(), references.len(), values.as_ptr())
                }
                SET_INTEGER => {
                    let references = values_of::<u32>(parts.block()?);
                    let values = same_length::<i64>(parts, references.len())?;
                    common.set_integer.call(c, &references, &values, &mut Vec::new())
                }
                SET_BOOLEAN => {
                    let references = values_of::<u32>(parts.block()?);
                    let values = same_length::<i32>(parts, references.len())?;
                    (common.set_boolean)(c, references.as_ptr(), references.len(), values.as_ptr())
                }
                SET_STRING => {
                    let references = values_of::<u32>(parts.block()?);
                    let texts = texts(parts, references.len())?;
                    let pointers: Vec<_> = texts.iter().map(|text| text.as_ptr()).collect();
                    (common.set_string)(c, references.as_ptr(), references.len(), pointers.as_ptr())
                }
                SET_DEBUG_LOGGING => {
                    let on = parts.number()? as i32;
                    let count = usize::try_from(parts.number()?).ok()?;
                    let texts = texts(parts, count)?;
                    let pointers: Vec<_> = texts.iter().map(|text| text.as_ptr()).collect();
                    common.set_debug_logging?(c, on, pointers.len(), pointers.as_ptr())
                }
                GET_STATE => {
                    let mut state = parts.number()? as *mut c_void;
                    let status = common.get_state?(c, &raw mut state);
                    out.number(state as u64);
                    status
                }
                SET_STATE => common.set_state?(c, parts.number()? as *mut c_void),
                FREE_STATE => {
                    let mut state = parts.number()? as *mut c_void;
                    common.free_state?(c, &raw mut state)
                }
                STATE_SIZE => {
                    let mut size = 0;
                    let state = parts.number()? as *mut c_void;
                    let status = common.serialized_state_size?(c, state, &raw mut size);
                    out.number(size as u64);
                    status
                }
                SERIALIZE => {
                    let (state, size) = (parts.number()? as *mut c_void, parts.number()?);
                    let mut bytes = vec![0_u8; usize::try_from(size).ok()?];
                    let status = common.serialize_state?(c, state, bytes.as_mut_ptr().cast(), bytes.len());
                    out.block(&bytes);
                    status
                }
                DESERIALIZE => {
                    let bytes = parts.block()?;
                    let mut state = std::ptr::null_mut();
                    let status =
                        common.deserialize_state?(c, bytes.as_ptr().cast(), bytes.len(), &raw mut state);
                    out.number(state as u64);
                    status
                }
                DIRECTIONAL_DERIVATIVE => {
                    let unknown = values_of::<u32>(parts.block()?);
                    let known = values_of::<u32>(parts.block()?);
                    let seed = same_length::<f64>(parts, known.len())?;
                    let mut change = vec![0.0; unknown.len()];
                    let status = common.directional_derivative?(
                        c,
                        unknown.as_ptr(),
                        unknown.len(),
                        known.as_ptr(),
                        known.len(),
                        seed.as_ptr(),
                        change.as_mut_ptr(),
                    );
                    out.block(bytes_of(&change));
                    status
                }
                DO_STEP => {
                    let (t, h, keep) = (parts.real()?, parts.real()?, parts.number()?);
                    (slave.ok()?.do_step)(c, t, h, keep as i32)
                }
                SET_INPUT_DERIVATIVES => {
                    let references = values_of::<u32>(parts.block()?);
                    let order = same_length::<i32>(parts, references.len())?;
                    let values = same_length::<f64>(parts, references.len())?;
                    let (n, set) = (references.len(), slave.ok()?.set_real_input_derivatives?);
                    set(c, references.as_ptr(), n, order.as_ptr(), values.as_ptr())
                }
                GET_OUTPUT_DERIVATIVES => {
                    let references = values_of::<u32>(parts.block()?);
                    let order = same_length::<i32>(parts, references.len())?;
                    let mut values = vec![0.0_f64; references.len()];
                    let (n, get) = (references.len(), slave.ok()?.get_real_output_derivatives?);
                    let status = get(c, references.as_ptr(), n, order.as_ptr(), values.as_mut_ptr());
                    out.block(bytes_of(&values));
                    status
                }
                GET_REAL_STATUS => {
                    let mut value = 0.0;
                    let status = slave.ok()?.get_real_status?(c, parts.number()? as u32, &raw mut value);
                    out.real(value);
                    status
                }
                GET_BOOLEAN_STATUS => {
                    let mut value = 0;
                    let status = slave.ok()?.get_boolean_status?(c, parts.number()? as u32, &raw mut value);
                    out.number(u64::from(value != 0));
                    status
                }
                ENTER_EVENT_MODE => (model.ok()?.enter_event_mode)(c),
                NEW_DISCRETE_STATES => {
                    let mut info = fmi2EventInfo::default();
                    let status = (model.ok()?.new_discrete_states)(c, &raw mut info);
                    for flag in [
                        info.newDiscreteStatesNeeded,
                        info.terminateSimulation,
                        info.nominalsOfContinuousStatesChanged,
                        info.valuesOfContinuousStatesChanged,
                        info.nextEventTimeDefined,
                    ] {
                        out.number(u64::from(flag != 0));
                    }
                    out.real(info.nextEventTime);
                    status
                }
                ENTER_CONTINUOUS_TIME => (model.ok()?.enter_continuous_time_mode)(c),
                COMPLETED_STEP => {
                    let (mut event, mut end) = (0, 0);
                    let keep = parts.number()? as i32;
                    let status =
                        (model.ok()?.completed_integrator_step)(c, keep, &raw mut event, &raw mut end);
                    out.number(u64::from(event != 0));
                    out.number(u64::from(end != 0));
                    status
                }
                SET_TIME => (model.ok()?.set_time)(c, parts.real()?),
                SET_STATES => {
                    let states = values_of::<f64>(parts.block()?);
                    (model.ok()?.set_continuous_states)(c, states.as_ptr(), states.len())
                }
                GET_STATES | GET_DERIVATIVES | GET_INDICATORS | NOMINALS => {
                    let model = model.ok()?;
                    let mut values = vec![0.0_f64; usize::try_from(parts.number()?).ok()?];
                    let get = match function {
                        GET_STATES => model.get_continuous_states,
                        GET_DERIVATIVES => model.get_derivatives,
                        GET_INDICATORS => model.get_event_indicators,
                        _ => model.get_nominals,
                    };
                    let status = get(c, values.as_mut_ptr(), values.len());
                    out.block(bytes_of(&values));
                    status
                }
                _ => return None,
            })
        }
    }

    /// Loads the library; answers which optional functions there are, or what is wrong.
    fn load(&mut self, parts: &mut Parts, out: &mut Calls) -> Option<u32> {
        let [shown, folder] = [text(parts)?, text(parts)?];
        let kind = kind(parts)?;
        let opened = Fmu::open_shown(Path::new(&folder), Path::new(&shown));
        match opened.and_then(|fmu| fmu.library(kind).map(|library| (fmu, library))) {
            Ok((fmu, library)) => {
                out.number(super::proxy::offered(&library));
                (self.fmu, self.library) = (Some(fmu), Some(library));
                Some(0)
            }
            Err(error) => {
                out.block(error.to_string().as_bytes());
                Some(3)
            }
        }
    }

    fn instantiate(&mut self, parts: &mut Parts, out: &mut Calls) -> Option<u32> {
        let texts = texts(parts, 2)?;
        let (kind, logging) = (kind(parts)?, parts.number()? != 0);
        let count = parts.number()?;
        let size = |_| Some((text(parts)?, parts.number()?.cast_signed()));
        let sizes: Vec<(String, i64)> = (0..count).map(size).collect::<Option<_>>()?;
        let fmu = self.fmu.as_ref()?;
        let resized = if sizes.is_empty() { Ok(Arc::clone(fmu)) } else { fmu.resized(&sizes) };
        let fmu = resized.ok()?;
        let (allocate, release) = memory();
        let callbacks = Box::new(fmi2CallbackFunctions {
            logger: Some(airloop_fmi2_logger),
            allocateMemory: Some(allocate),
            freeMemory: Some(release),
            stepFinished: None,
            componentEnvironment: (&raw mut *self.log).cast(),
        });
        let fmi_type = match kind {
            InterfaceKind::CoSimulation => fmi2Type_fmi2CoSimulation,
            InterfaceKind::ModelExchange => fmi2Type_fmi2ModelExchange,
        };
        let component = match &self.library.as_ref()?.origin {
            Origin::Two(first) => {
                let resources = CString::new(fmu.resources_uri()).ok()?;
                // SAFETY: the strings live during the call, callbacks and log buffer until the component is freed.
                unsafe {
                    (first.instantiate)(
                        texts[0].as_ptr(),
                        fmi_type,
                        texts[1].as_ptr(),
                        resources.as_ptr(),
                        &raw const *callbacks,
                        0,
                        logging.into(),
                    )
                }
            }
            Origin::Three(functions) => {
                let names = (&texts[0], &texts[1]);
                Component::instantiate(&fmu, **functions, kind, names, logging, &raw const *self.log)
            }
            Origin::Worker(_) => return None,
        };
        if component.is_null() {
            return Some(3);
        }
        let held = Some(Held { component, _callbacks: callbacks });
        let free = self.instances.iter().position(Option::is_none).unwrap_or(self.instances.len());
        if free == self.instances.len() {
            self.instances.push(held);
        } else {
            self.instances[free] = held;
        }
        out.number(free as u64);
        Some(0)
    }
}

fn same_length<T: Plain + Default>(parts: &mut Parts, length: usize) -> Option<Vec<T>> {
    let values = values_of::<T>(parts.block()?);
    (values.len() == length).then_some(values)
}

fn kind(parts: &mut Parts) -> Option<InterfaceKind> {
    let co_simulation = parts.number()? != 0;
    Some(if co_simulation { InterfaceKind::CoSimulation } else { InterfaceKind::ModelExchange })
}

fn text(parts: &mut Parts) -> Option<String> {
    String::from_utf8(parts.block()?.to_vec()).ok()
}

fn texts(parts: &mut Parts, count: usize) -> Option<Vec<CString>> {
    (0..count).map(|_| CString::new(parts.block()?).ok()).collect()
}
