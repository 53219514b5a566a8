//! What both interfaces share: life-cycle, get and set, saved states, directional derivatives, log.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::{CStr, CString, c_void};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use fmi::fmi2::binding::{
    fmi2CallbackFunctions, fmi2Type_fmi2CoSimulation, fmi2Type_fmi2ModelExchange, fmi2ValueReference,
};

use super::description::VariableKind;
use super::error::{CallError, Error, Status};
use super::functions::{CommonFunctions, ModelFunctions, SlaveFunctions};
use super::library::Library;
use super::log::{LogBuffer, LogMessage, airloop_fmi2_logger};
use super::open::{Fmu, InterfaceKind};
use super::state::{StateHandle, States};

pub(super) const WARNING: u32 = 1;
pub(super) const DISCARD: u32 = 2;

/// An error shows this many of the last messages.
const SHOWN_MESSAGES: usize = 5;

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// Where an instance is in its life, as far as dropping it depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Before the end of initialisation, or after fmi2Terminate or fmi2Error: only to be freed.
    Passive,
    /// Initialised: to be terminated, then freed.
    Active,
    /// After fmi2Fatal or fmi2Pending of this function: not to be touched again.
    Abandoned(&'static str),
}

/// An instance of an FMU: the part that [`Slave`](super::Slave) and [`Model`](super::Model) share.
///
/// A call takes the value references of the model description and slices of the same length. A status other than OK
/// or Warning becomes an [`Error::Call`] that names instance, function, variables, time, and the FMU's last messages.
/// After fmi2Fatal no further call reaches the FMU.
pub struct Instance {
    component: *mut c_void,
    functions: CommonFunctions,
    slave: Option<SlaveFunctions>,
    model: Option<ModelFunctions>,
    name: String,
    kind: InterfaceKind,
    phase: Phase,
    time: Option<f64>,
    states: States,
    booleans: Vec<i32>,
    log: Box<LogBuffer>,
    // The FMU may keep the pointer to the callbacks, and the code must outlive the component.
    callbacks: Option<Box<fmi2CallbackFunctions>>,
    library: Arc<Library>,
    fmu: Arc<Fmu>,
}

// SAFETY: FMI 2.0.5 section 2.1.1 lets any thread call an instance as long as calls do not overlap; `&mut self` on
// every call sees to that, and the log buffer has its own lock. The instance is not Sync.
unsafe impl Send for Instance {}

impl fmt::Debug for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Instance").field("name", &self.name).field("fmu", &self.fmu).finish_non_exhaustive()
    }
}

impl Instance {
    pub(super) fn new(fmu: &Arc<Fmu>, kind: InterfaceKind, name: &str, logging: bool) -> Result<Self, Error> {
        Self::with_guid(fmu, kind, name, logging, &fmu.description.guid)
    }

    /// As [`Self::new`] with any guid, to see whether the FMU refuses a wrong one.
    pub(super) fn with_guid(
        fmu: &Arc<Fmu>,
        kind: InterfaceKind,
        name: &str,
        logging: bool,
        guid: &str,
    ) -> Result<Self, Error> {
        let library = fmu.library(kind)?;
        let missing =
            |function| Error::MissingFunction { path: fmu.path.clone(), function, interface: kind.name() };
        let (slave, model, fmi_type) = match kind {
            InterfaceKind::CoSimulation => {
                (Some(library.slave.map_err(missing)?), None, fmi2Type_fmi2CoSimulation)
            }
            InterfaceKind::ModelExchange => {
                (None, Some(library.model.map_err(missing)?), fmi2Type_fmi2ModelExchange)
            }
        };
        let interface =
            fmu.interface(kind).expect("the library of an interface exists only if the interface does");
        let string = |text: &str, what: &str| {
            CString::new(text)
                .map_err(|_| Error::NulCharacter { component: name.to_owned(), what: what.to_owned() })
        };
        let (c_name, c_guid) = (string(name, "the instance name")?, string(guid, "the guid")?);
        let resources = string(&fmu.resources_uri(), "the path of the resources")?;
        let only_once = interface.can_be_instantiated_only_once_per_process;
        if only_once && library.occupied.swap(true, Ordering::AcqRel) {
            return Err(Error::OnlyOnce { component: name.to_owned(), path: fmu.path.clone() });
        }

        let mut log = Box::<LogBuffer>::default();
        let callbacks = Box::new(fmi2CallbackFunctions {
            logger: Some(airloop_fmi2_logger),
            allocateMemory: Some(calloc),
            freeMemory: Some(free),
            stepFinished: None,
            componentEnvironment: (&raw mut *log).cast(),
        });
        // SAFETY: the strings live during the call, callbacks and log buffer until the component is freed.
        let component = unsafe {
            (library.common.instantiate)(
                c_name.as_ptr(),
                fmi_type,
                c_guid.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                0,
                logging.into(),
            )
        };
        if component.is_null() {
            library.occupied.store(false, Ordering::Release);
            let hint = if interface.needs_execution_tool {
                "; it declares needsExecutionTool: install the tool that made it, or export it without that need"
            } else {
                "; a guid of the library that differs from the one of modelDescription.xml is the usual reason: \
                 build and package them together"
            };
            return Err(Error::Instantiate {
                component: name.to_owned(),
                path: fmu.path.clone(),
                guid: guid.to_owned(),
                hint,
                log: log.tail(SHOWN_MESSAGES),
            });
        }
        Ok(Instance {
            component,
            functions: library.common,
            slave,
            model,
            name: name.to_owned(),
            kind,
            phase: Phase::Passive,
            time: None,
            states: States::new(),
            booleans: Vec::new(),
            log,
            callbacks: Some(callbacks),
            library,
            fmu: Arc::clone(fmu),
        })
    }

    /// Instance name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The FMU.
    pub fn fmu(&self) -> &Arc<Fmu> {
        &self.fmu
    }

    /// Which interface the instance has.
    pub fn kind(&self) -> InterfaceKind {
        self.kind
    }

    /// Messages since the last call of this function, oldest first; at most the last 256 are kept.
    pub fn log(&self) -> Vec<LogMessage> {
        self.log.drain()
    }

    /// Turns debug messages on or off; no categories means all.
    ///
    /// # Errors
    /// A category with a NUL character, the function is missing, or the FMU refuses.
    pub fn set_debug_logging(&mut self, on: bool, categories: &[&str]) -> Result<(), Error> {
        let function = "fmi2SetDebugLogging";
        self.alive(function)?;
        let call = self.functions.set_debug_logging.ok_or_else(|| self.missing(function))?;
        let strings = self.c_strings(categories)?;
        let pointers: Vec<_> = strings.iter().map(|string| string.as_ptr()).collect();
        // SAFETY: the component is alive; the array has the length passed and the strings live during the call.
        let status = unsafe { call(self.component, on.into(), pointers.len(), pointers.as_ptr()) };
        self.check(function, status)
    }

    /// States tolerance (relative), start and stop time \[s\] of the experiment.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn setup_experiment(
        &mut self,
        tolerance: Option<f64>,
        start: f64,
        stop: Option<f64>,
    ) -> Result<(), Error> {
        let function = "fmi2SetupExperiment";
        self.alive(function)?;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe {
            (self.functions.setup_experiment)(
                self.component,
                tolerance.is_some().into(),
                tolerance.unwrap_or(0.0),
                start,
                stop.is_some().into(),
                stop.unwrap_or(0.0),
            )
        };
        self.time = Some(start);
        self.check(function, status)
    }

    /// Begins initialisation.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_initialization_mode(&mut self) -> Result<(), Error> {
        self.simple("fmi2EnterInitializationMode", self.functions.enter_initialization_mode)
    }

    /// Ends initialisation.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn exit_initialization_mode(&mut self) -> Result<(), Error> {
        self.simple("fmi2ExitInitializationMode", self.functions.exit_initialization_mode)?;
        self.phase = Phase::Active;
        Ok(())
    }

    /// Ends the run; values can still be read.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn terminate(&mut self) -> Result<(), Error> {
        self.simple("fmi2Terminate", self.functions.terminate)?;
        self.phase = Phase::Passive;
        Ok(())
    }

    /// Back to the state after instantiation, also after fmi2Error.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn reset(&mut self) -> Result<(), Error> {
        self.simple("fmi2Reset", self.functions.reset)?;
        self.phase = Phase::Passive;
        self.time = None;
        Ok(())
    }

    /// Reads reals.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    #[inline(always)]
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        let function = "fmi2GetReal";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_real)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_mut_ptr(),
            )
        };
        self.check_reals(function, status, references, None)
    }

    /// Sets reals.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    #[inline(always)]
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), Error> {
        let function = "fmi2SetReal";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.set_real)(self.component, references.as_ptr(), references.len(), values.as_ptr())
        };
        self.check_reals(function, status, references, Some(values))
    }

    /// Reads integers and enumerations.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), Error> {
        let function = "fmi2GetInteger";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_integer)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_mut_ptr(),
            )
        };
        self.check_values(function, status, Base::Integer, references, |_| None)
    }

    /// Sets integers and enumerations.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), Error> {
        let function = "fmi2SetInteger";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.set_integer)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_ptr(),
            )
        };
        self.check_values(function, status, Base::Integer, references, |index| {
            Some(values[index].to_string())
        })
    }

    /// Reads truth values.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn get_boolean(&mut self, references: &[u32], values: &mut [bool]) -> Result<(), Error> {
        let function = "fmi2GetBoolean";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        self.booleans.clear();
        self.booleans.resize(values.len(), 0);
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_boolean)(
                self.component,
                references.as_ptr(),
                references.len(),
                self.booleans.as_mut_ptr(),
            )
        };
        self.check_values(function, status, Base::Boolean, references, |_| None)?;
        values.iter_mut().zip(&self.booleans).for_each(|(value, &raw)| *value = raw != 0);
        Ok(())
    }

    /// Sets truth values.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> Result<(), Error> {
        let function = "fmi2SetBoolean";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        self.booleans.clear();
        self.booleans.extend(values.iter().map(|&value| i32::from(value)));
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.set_boolean)(
                self.component,
                references.as_ptr(),
                references.len(),
                self.booleans.as_ptr(),
            )
        };
        self.check_values(function, status, Base::Boolean, references, |index| {
            Some(values[index].to_string())
        })
    }

    /// Reads texts; bytes that are no UTF-8 are replaced.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_string(&mut self, references: &[u32]) -> Result<Vec<String>, Error> {
        let function = "fmi2GetString";
        self.alive(function)?;
        let mut pointers = vec![std::ptr::null(); references.len()];
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_string)(
                self.component,
                references.as_ptr(),
                references.len(),
                pointers.as_mut_ptr(),
            )
        };
        self.check_values(function, status, Base::String, references, |_| None)?;
        let text = |pointer: *const std::ffi::c_char| {
            if pointer.is_null() {
                return String::new();
            }
            // SAFETY: not null; the string is valid until the next call on the instance (FMI 2.0.5 section 2.1.7).
            unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
        };
        Ok(pointers.into_iter().map(text).collect())
    }

    /// Sets texts.
    ///
    /// # Errors
    /// Different lengths, a NUL character in a text, or the FMU refuses.
    pub fn set_string(&mut self, references: &[u32], values: &[&str]) -> Result<(), Error> {
        let function = "fmi2SetString";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        let strings = self.c_strings(values)?;
        let pointers: Vec<_> = strings.iter().map(|string| string.as_ptr()).collect();
        // SAFETY: the component is alive; both arrays have the length passed and the strings live during the call.
        let status = unsafe {
            (self.functions.set_string)(
                self.component,
                references.as_ptr(),
                references.len(),
                pointers.as_ptr(),
            )
        };
        self.check_values(function, status, Base::String, references, |i| Some(format!("\"{}\"", values[i])))
    }

    /// Saves the state into `slot`, using again the memory of the state that is there.
    ///
    /// # Errors
    /// The handle in `slot` belongs to another instance, the function is missing, or the FMU refuses.
    pub fn get_state(&mut self, slot: &mut Option<StateHandle>) -> Result<(), Error> {
        let function = "fmi2GetFMUstate";
        self.alive(function)?;
        let call = self.functions.get_state.ok_or_else(|| self.missing(function))?;
        let mut state = match slot {
            Some(handle) => self.states.pointer(handle).ok_or_else(|| self.foreign(function))?,
            None => std::ptr::null_mut(),
        };
        // SAFETY: the component is alive; the state is NULL or one that this instance made and did not free.
        let status = unsafe { call(self.component, &raw mut state) };
        match slot {
            Some(handle) => self.states.update(handle, state),
            None if !state.is_null() => *slot = Some(self.states.insert(state)),
            None => {}
        }
        self.check(function, status)
    }

    /// Restores a saved state. The time of the instance follows from the next step.
    ///
    /// # Errors
    /// The handle belongs to another instance, the function is missing, or the FMU refuses.
    pub fn set_state(&mut self, handle: &StateHandle) -> Result<(), Error> {
        let function = "fmi2SetFMUstate";
        self.alive(function)?;
        let call = self.functions.set_state.ok_or_else(|| self.missing(function))?;
        let state = self.states.pointer(handle).ok_or_else(|| self.foreign(function))?;
        // SAFETY: the component is alive; the state is one that this instance made and did not free.
        let status = unsafe { call(self.component, state) };
        self.check(function, status)
    }

    /// Frees a saved state.
    ///
    /// # Errors
    /// The handle belongs to another instance, the function is missing, or the FMU refuses.
    pub fn free_state(&mut self, handle: StateHandle) -> Result<(), Error> {
        let function = "fmi2FreeFMUstate";
        self.alive(function)?;
        let call = self.functions.free_state.ok_or_else(|| self.missing(function))?;
        let mut state = self.states.remove(handle).ok_or_else(|| self.foreign(function))?;
        // SAFETY: the component is alive; the state is one that this instance made, and its handle is consumed.
        let status = unsafe { call(self.component, &raw mut state) };
        self.check(function, status)
    }

    /// A saved state as bytes, for another instance or process of the same FMU.
    ///
    /// # Errors
    /// The handle belongs to another instance, a function is missing, or the FMU refuses.
    pub fn serialize_state(&mut self, handle: &StateHandle) -> Result<Vec<u8>, Error> {
        let function = "fmi2SerializeFMUstate";
        self.alive(function)?;
        let size_of = self.functions.serialized_state_size.ok_or_else(|| self.missing(function))?;
        let call = self.functions.serialize_state.ok_or_else(|| self.missing(function))?;
        let state = self.states.pointer(handle).ok_or_else(|| self.foreign(function))?;
        let mut size = 0;
        // SAFETY: the component is alive; the state is one that this instance made; the pointer is to a local.
        let status = unsafe { size_of(self.component, state, &raw mut size) };
        self.check("fmi2SerializedFMUstateSize", status)?;
        let mut bytes = vec![0_u8; size];
        // SAFETY: as above; the array has the length passed.
        let status = unsafe { call(self.component, state, bytes.as_mut_ptr().cast(), size) };
        self.check(function, status)?;
        Ok(bytes)
    }

    /// A state from the bytes of [`Self::serialize_state`].
    ///
    /// # Errors
    /// The function is missing, or the FMU refuses the bytes.
    pub fn deserialize_state(&mut self, bytes: &[u8]) -> Result<StateHandle, Error> {
        let function = "fmi2DeSerializeFMUstate";
        self.alive(function)?;
        let call = self.functions.deserialize_state.ok_or_else(|| self.missing(function))?;
        let mut state = std::ptr::null_mut();
        // SAFETY: the component is alive; the array has the length passed; the pointer is to a local.
        let status = unsafe { call(self.component, bytes.as_ptr().cast(), bytes.len(), &raw mut state) };
        self.check(function, status)?;
        Ok(self.states.insert(state))
    }

    /// `out = J seed`, where `J[i][j]` is the derivative of `unknown[i]` by `known[j]`.
    ///
    /// | name | shape | meaning |
    /// |---|---|---|
    /// | `unknown` | \[m\] | value references of outputs or derivatives |
    /// | `known` | \[n\] | value references of inputs or states |
    /// | `seed` | \[n\] | change of the knowns |
    /// | `out` | \[m\] | change of the unknowns |
    ///
    /// # Errors
    /// Wrong lengths, the function is missing, or the FMU refuses.
    pub fn directional_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<(), Error> {
        let function = "fmi2GetDirectionalDerivative";
        self.alive(function)?;
        self.same_length(function, seed.len(), known.len())?;
        self.same_length(function, out.len(), unknown.len())?;
        let call = self.functions.directional_derivative.ok_or_else(|| self.missing(function))?;
        // SAFETY: the component is alive; each pair of arrays has the length passed.
        let status = unsafe {
            call(
                self.component,
                unknown.as_ptr(),
                unknown.len(),
                known.as_ptr(),
                known.len(),
                seed.as_ptr(),
                out.as_mut_ptr(),
            )
        };
        self.check_reals(function, status, unknown, None)
    }
}

/// Which variables share one space of value references.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Base {
    Real,
    Integer,
    Boolean,
    String,
}

impl Base {
    pub(super) fn of(kind: &VariableKind) -> Base {
        match kind {
            VariableKind::Real(_) => Base::Real,
            VariableKind::Integer { .. } | VariableKind::Enumeration { .. } => Base::Integer,
            VariableKind::Boolean { .. } => Base::Boolean,
            VariableKind::String { .. } => Base::String,
        }
    }
}

impl Instance {
    pub(super) fn component(&self) -> *mut c_void {
        self.component
    }

    pub(super) fn set_known_time(&mut self, time: f64) {
        self.time = Some(time);
    }

    #[inline]
    pub(super) fn slave_functions(&self, function: &'static str) -> Result<SlaveFunctions, Error> {
        self.alive(function)?;
        self.slave.ok_or_else(|| self.missing(function))
    }

    #[inline]
    pub(super) fn model_functions(&self, function: &'static str) -> Result<ModelFunctions, Error> {
        self.alive(function)?;
        self.model.ok_or_else(|| self.missing(function))
    }

    #[cold]
    pub(super) fn missing(&self, function: &'static str) -> Error {
        Error::MissingFunction { path: self.fmu.path.clone(), function, interface: self.kind.name() }
    }

    #[cold]
    fn foreign(&self, function: &'static str) -> Error {
        Error::ForeignState { component: self.name.clone(), function }
    }

    #[inline]
    fn alive(&self, function: &'static str) -> Result<(), Error> {
        match self.phase {
            Phase::Abandoned(cause) => Err(self.dead(function, cause)),
            _ => Ok(()),
        }
    }

    #[cold]
    #[inline(never)]
    fn dead(&self, function: &'static str, cause: &'static str) -> Error {
        Error::Dead { component: self.name.clone(), function, cause }
    }

    #[inline]
    pub(super) fn same_length(
        &self,
        function: &'static str,
        given: usize,
        expected: usize,
    ) -> Result<(), Error> {
        if given == expected { Ok(()) } else { Err(self.wrong_length(function, given, expected)) }
    }

    #[cold]
    #[inline(never)]
    fn wrong_length(&self, function: &'static str, given: usize, expected: usize) -> Error {
        Error::Length { component: self.name.clone(), function, given, expected }
    }

    fn c_strings(&self, texts: &[&str]) -> Result<Vec<CString>, Error> {
        let convert = |text: &&str| {
            CString::new(*text).map_err(|_| Error::NulCharacter {
                component: self.name.clone(),
                what: format!("the text {text:?}"),
            })
        };
        texts.iter().map(convert).collect()
    }

    fn simple(
        &mut self,
        function: &'static str,
        call: unsafe extern "C" fn(*mut c_void) -> u32,
    ) -> Result<(), Error> {
        self.alive(function)?;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe { call(self.component) };
        self.check(function, status)
    }

    #[inline]
    pub(super) fn check(&mut self, function: &'static str, status: u32) -> Result<(), Error> {
        if status <= WARNING { Ok(()) } else { Err(self.failure(function, status, None, Vec::new())) }
    }

    #[inline]
    pub(super) fn check_reals(
        &mut self,
        function: &'static str,
        status: u32,
        references: &[fmi2ValueReference],
        values: Option<&[f64]>,
    ) -> Result<(), Error> {
        if status <= WARNING { Ok(()) } else { self.reals_refused(function, status, references, values) }
    }

    #[cold]
    #[inline(never)]
    fn reals_refused(
        &mut self,
        function: &'static str,
        status: u32,
        references: &[fmi2ValueReference],
        values: Option<&[f64]>,
    ) -> Result<(), Error> {
        self.check_values(function, status, Base::Real, references, |index| {
            values.map(|values| values[index].to_string())
        })
    }

    #[inline]
    fn check_values(
        &mut self,
        function: &'static str,
        status: u32,
        base: Base,
        references: &[u32],
        value: impl Fn(usize) -> Option<String>,
    ) -> Result<(), Error> {
        if status <= WARNING {
            return Ok(());
        }
        let variables = references
            .iter()
            .enumerate()
            .map(|(i, &reference)| (self.variable_name(base, reference), value(i)));
        let variables = variables.collect();
        Err(self.failure(function, status, None, variables))
    }

    #[cold]
    fn variable_name(&self, base: Base, reference: u32) -> String {
        let variables = &self.fmu.description.variables;
        variables
            .iter()
            .find(|variable| variable.value_reference == reference && Base::of(&variable.kind) == base)
            .map_or_else(|| format!("value reference {reference}"), |variable| variable.name.clone())
    }

    #[cold]
    pub(super) fn step_failure(&mut self, status: u32, step: f64) -> Error {
        self.failure("fmi2DoStep", status, Some(step), Vec::new())
    }

    #[cold]
    fn failure(
        &mut self,
        function: &'static str,
        status: u32,
        step: Option<f64>,
        variables: Vec<(String, Option<String>)>,
    ) -> Error {
        let status = match status {
            DISCARD => Status::Discard,
            3 => Status::Error,
            4 => Status::Fatal,
            5 => Status::Pending,
            other => Status::Unknown(other),
        };
        match status {
            Status::Discard => {}
            // After fmi2Error only fmi2Reset and fmi2FreeInstance may follow.
            Status::Error => self.phase = Phase::Passive,
            Status::Fatal | Status::Pending | Status::Unknown(_) => self.phase = Phase::Abandoned(function),
        }
        Error::Call(Box::new(CallError {
            component: self.name.clone(),
            function,
            status,
            time: self.time,
            step,
            variables,
            log: self.log.tail(SHOWN_MESSAGES),
        }))
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Phase::Abandoned(_) = self.phase {
            // The FMU may still compute or log in the background: its code and what it was given stay.
            std::mem::forget(Arc::clone(&self.library));
            Box::leak(std::mem::take(&mut self.log));
            if let Some(callbacks) = self.callbacks.take() {
                Box::leak(callbacks);
            }
            return;
        }
        if self.phase == Phase::Active {
            // SAFETY: the component is alive and initialised. A refusal changes nothing about what follows.
            let status = unsafe { (self.functions.terminate)(self.component) };
            if status > 3 {
                return;
            }
        }
        if let Some(free_state) = self.functions.free_state {
            for mut state in self.states.drain() {
                // SAFETY: the component is alive; each state was made by it and is freed once.
                unsafe { free_state(self.component, &raw mut state) };
            }
        }
        // SAFETY: the component is alive and not used after this.
        unsafe { (self.functions.free_instance)(self.component) };
        self.library.occupied.store(false, Ordering::Release);
    }
}
