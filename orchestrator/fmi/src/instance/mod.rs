//! Instances of both interfaces. Here: the life-cycle of an instance and its end; values, saved states and the
//! meaning of a status have their own files.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::{CString, c_void};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use fmi::fmi2::binding::{fmi2CallbackFunctions, fmi2Type_fmi2CoSimulation, fmi2Type_fmi2ModelExchange};

use super::error::{Error, LostError};
use super::fmi3::{self, Component};
use super::functions::{CommonFunctions, ModelFunctions, SlaveFunctions};
use super::isolate;
use super::last_words::{self, Label};
use super::library::{Library, Origin};
use super::log::{LogBuffer, LogMessage, airloop_fmi2_logger};
use super::open::{Fmu, InterfaceKind};
use super::surroundings::{Surroundings, keep_rounding, keep_rounding_often};
use super::trace;
use state::States;
use status::{ERROR, SHOWN_MESSAGES, named};

pub use state::StateHandle;
pub(super) use status::{DISCARD, WARNING};

mod state;
mod status;
mod values;

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// Allocation and release of memory for FMUs.
type Memory = (unsafe extern "C" fn(usize, usize) -> *mut c_void, unsafe extern "C" fn(*mut c_void));

/// The functions that FMUs get for their memory.
pub(super) fn memory() -> Memory {
    (calloc, free)
}

/// Phase in the life of an instance, as far as dropping it depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Before the end of initialization, or after fmi2Terminate or fmi2Error: only to be freed.
    Passive,
    /// Initialized: to be terminated, then freed.
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
    label: Label,
    /// Whether calls are written down for another process.
    is_traced: bool,
    kind: InterfaceKind,
    phase: Phase,
    time: Option<f64>,
    /// Calls until the register of the processor is read again.
    calls: u8,
    states: States,
    /// Booleans and integers of 32 bits of one call.
    scratch: Vec<i32>,
    log: Box<LogBuffer>,
    // The FMU may keep the pointer to the callbacks, and the code must outlive the component.
    callbacks: Option<Box<fmi2CallbackFunctions>>,
    library: Arc<Library>,
    fmu: Arc<Fmu>,
}

// SAFETY: FMI 2.0 ties an instance to no thread; calls on it must not overlap, which `&mut self` on every call sees to,
// and the log buffer has its own lock. The instance is not Sync.
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

    /// Same as [`Self::new`] with any guid, to see whether the FMU refuses a wrong one.
    pub(super) fn with_guid(
        fmu: &Arc<Fmu>,
        kind: InterfaceKind,
        name: &str,
        logging: bool,
        guid: &str,
    ) -> Result<Self, Error> {
        let library = fmu.library(kind)?;
        let missing =
            |function| Error::MissingFunction { path: fmu.shown.clone(), function, interface: kind.name() };
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
        let only_once = interface.can_be_instantiated_only_once_per_process;
        if only_once && library.occupied.swap(true, Ordering::AcqRel) {
            return Err(Error::OnlyOnce { component: name.to_owned(), path: fmu.shown.clone() });
        }

        let mut log = Box::<LogBuffer>::default();
        let callbacks = Box::new(fmi2CallbackFunctions {
            logger: Some(airloop_fmi2_logger),
            allocateMemory: Some(calloc),
            freeMemory: Some(free),
            stepFinished: None,
            componentEnvironment: (&raw mut *log).cast(),
        });
        let label = Label::new(name, fmu);
        let surroundings = Surroundings::of(&fmu.shown);
        let component = match &library.origin {
            Origin::Two(functions) => {
                let resources = string(&fmu.resources_uri(), "the path of the resources")?;
                trace::enter("fmi2Instantiate");
                last_words::enter(&label, "fmi2Instantiate");
                // SAFETY: the strings live during the call, callbacks and log buffer until the component is freed.
                unsafe {
                    (functions.instantiate)(
                        c_name.as_ptr(),
                        fmi_type,
                        c_guid.as_ptr(),
                        resources.as_ptr(),
                        &raw const *callbacks,
                        0,
                        logging.into(),
                    )
                }
            }
            Origin::Three(functions) => {
                trace::enter("fmi3Instantiate");
                last_words::enter(&label, "fmi3Instantiate");
                let names = (&c_name, &c_guid);
                Component::instantiate(fmu, **functions, kind, names, logging, &raw const *log)
            }
            Origin::Worker(channel) => {
                isolate::instantiate(channel, fmu, (&c_name, &c_guid), kind, logging, &raw const *log)
            }
        };
        last_words::leave();
        surroundings.set_back();
        if let Some(death) = library.remote().and_then(|channel| channel.death()) {
            return Err(Error::Lost(Box::new(LostError::new(name, fmu, None, death))));
        }
        if component.is_null() {
            library.occupied.store(false, Ordering::Release);
            let is_resized =
                !fmu.sizes.is_empty() && log.tail(1).iter().any(|last| last.category == "importer");
            let hint = if is_resized {
                "; it exists until a structural parameter is set: see the last messages"
            } else if interface.needs_execution_tool {
                "; it declares needsExecutionTool: install the tool that made it, or export it without that need"
            } else {
                "; a guid of the library that differs from the one of modelDescription.xml is the usual reason: \
                 build and package them together"
            };
            return Err(Error::Instantiate {
                function: if fmu.description.is_fmi3() { "fmi3Instantiate" } else { "fmi2Instantiate" },
                component: name.to_owned(),
                path: fmu.shown.clone(),
                guid: guid.to_owned(),
                hint,
                log: named(fmu, log.tail(SHOWN_MESSAGES)),
            });
        }
        Ok(Instance {
            component,
            functions: library.common,
            slave,
            model,
            name: name.to_owned(),
            label,
            is_traced: trace::is_on(),
            kind,
            phase: Phase::Passive,
            time: None,
            calls: 0,
            states: States::new(),
            scratch: Vec::new(),
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

    /// Interface of the instance.
    pub fn kind(&self) -> InterfaceKind {
        self.kind
    }

    /// Messages since the last call of this function, oldest first; at most the last 256 are kept.
    pub fn log(&self) -> Vec<LogMessage> {
        named(&self.fmu, self.log.drain())
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

    /// Begins initialization.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn enter_initialization_mode(&mut self) -> Result<(), Error> {
        let fmu = Arc::clone(&self.fmu);
        let surroundings = Surroundings::of(&fmu.shown);
        let done = self.simple("fmi2EnterInitializationMode", self.functions.enter_initialization_mode);
        surroundings.set_back();
        done
    }

    /// Ends initialization.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn exit_initialization_mode(&mut self) -> Result<(), Error> {
        let fmu = Arc::clone(&self.fmu);
        let surroundings = Surroundings::of(&fmu.shown);
        let done = self.simple("fmi2ExitInitializationMode", self.functions.exit_initialization_mode);
        surroundings.set_back();
        done?;
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

    /// Whether the component is one of FMI 3.0 in this process.
    pub(super) fn is_fmi3(&self) -> bool {
        matches!(self.library.origin, Origin::Three(_))
    }

    pub(super) fn component(&self) -> *mut c_void {
        self.component
    }

    pub(super) fn set_known_time(&mut self, time: f64) {
        self.time = Some(time);
    }

    /// Sets back what the library changed for the whole process, after a call of which a simulation makes many.
    #[inline(always)]
    pub(super) fn keep_rounding(&mut self) {
        keep_rounding_often(&mut self.calls, &self.fmu.shown);
    }

    #[inline(always)]
    pub(super) fn slave_functions(&self, function: &'static str) -> Result<&SlaveFunctions, Error> {
        self.alive(function)?;
        self.slave.as_ref().ok_or_else(|| self.missing(function))
    }

    #[inline(always)]
    pub(super) fn model_functions(&self, function: &'static str) -> Result<&ModelFunctions, Error> {
        self.alive(function)?;
        self.model.as_ref().ok_or_else(|| self.missing(function))
    }

    // Part of every call, and called from other crates: to be inlined there, too.
    #[inline(always)]
    fn alive(&self, function: &'static str) -> Result<(), Error> {
        match self.phase {
            Phase::Abandoned(cause) => Err(self.dead(function, cause)),
            _ => {
                self.enter(function);
                Ok(())
            }
        }
    }

    /// Notes that `function` is called next.
    #[inline(always)]
    fn enter(&self, function: &'static str) {
        if self.is_traced {
            self.trace(function);
        }
        last_words::enter(&self.label, function);
    }

    #[cold]
    #[inline(never)]
    fn trace(&self, function: &'static str) {
        trace::enter(self.c_name(function));
    }

    #[cold]
    #[inline(never)]
    fn dead(&self, function: &'static str, cause: &'static str) -> Error {
        let (function, cause) = (self.c_name(function), self.c_name(cause));
        Error::Dead { component: self.name.clone(), function, cause }
    }

    /// Name of a function in the FMI version of the FMU, given that of 2.0.
    pub(super) fn c_name(&self, function: &'static str) -> &'static str {
        if self.fmu.description.is_fmi3() { fmi3::names::of(function) } else { function }
    }

    fn simple(
        &mut self,
        function: &'static str,
        call: unsafe extern "C" fn(*mut c_void) -> u32,
    ) -> Result<(), Error> {
        self.alive(function)?;
        // SAFETY: the component is alive and belongs to this library.
        let status = unsafe { call(self.component) };
        keep_rounding(&self.fmu.shown);
        self.check(function, status)
    }
}

impl Instance {
    /// Leaves the component as it is: no call may follow.
    fn abandon(&mut self) {
        if self.library.remote().is_some() {
            isolate::forget(self.component);
            return;
        }
        // The FMU may still compute or log in the background: its code and what it was given stay.
        std::mem::forget(Arc::clone(&self.library));
        Box::leak(std::mem::take(&mut self.log));
        if let Some(callbacks) = self.callbacks.take() {
            Box::leak(callbacks);
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // The note of a call that was refused before it was made must not outlive the label.
        last_words::leave();
        if let Phase::Abandoned(_) = self.phase {
            self.abandon();
            return;
        }
        if self.phase == Phase::Active {
            self.enter("fmi2Terminate");
            // SAFETY: the component is alive and initialized. A refusal changes nothing about what follows.
            let status = unsafe { (self.functions.terminate)(self.component) };
            last_words::leave();
            if status > ERROR {
                self.abandon();
                return;
            }
        }
        if let Some(free_state) = self.functions.free_state {
            self.enter("fmi2FreeFMUstate");
            for mut state in self.states.drain() {
                // SAFETY: the component is alive; each state was made by it and is freed once.
                unsafe { free_state(self.component, &raw mut state) };
            }
        }
        self.enter("fmi2FreeInstance");
        // SAFETY: the component is alive and not used after this.
        unsafe { (self.functions.free_instance)(self.component) };
        last_words::leave();
        self.library.occupied.store(false, Ordering::Release);
    }
}
