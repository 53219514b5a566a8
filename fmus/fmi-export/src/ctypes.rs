//! C types of FMI 2.0, spelled as in `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`; those of FMI 3.0 that differ are
//! Rust's own, and a Boolean of 3.0 is a byte.
//!
//! Written by hand, so that an FMU library needs neither libclang nor a C compiler.

use std::ffi::{c_char, c_int, c_uint, c_void};

/// `fmi2Component`
pub type Component = *mut c_void;
/// `fmi2ComponentEnvironment`
pub type ComponentEnvironment = *mut c_void;
/// `fmi2FMUstate`
pub type FmuState = *mut c_void;
/// `fmi2ValueReference`
pub type ValueReference = c_uint;
/// `fmi2Boolean`: 0 or 1
pub type Bool = c_int;
/// `fmi2String`
pub type CString = *const c_char;

/// `fmi2Status`
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)]
pub enum Status {
    OK = 0,
    Warning = 1,
    Discard = 2,
    Error = 3,
    Fatal = 4,
    Pending = 5,
}

/// `fmi2StatusKind` values of `fmi2GetStatus` and its relatives.
pub mod status_kind {
    use super::c_int;
    /// `fmi2DoStepStatus`
    pub const DO_STEP_STATUS: c_int = 0;
    /// `fmi2PendingStatus`
    pub const PENDING_STATUS: c_int = 1;
    /// `fmi2LastSuccessfulTime`
    pub const LAST_SUCCESSFUL_TIME: c_int = 2;
    /// `fmi2Terminated`
    pub const TERMINATED: c_int = 3;
}

/// `fmi2CallbackLogger`; variadic in C.
pub type CallbackLogger = unsafe extern "C" fn(ComponentEnvironment, CString, Status, CString, CString, ...);
/// `fmi3LogMessageCallback`
pub type LogMessage = unsafe extern "C" fn(ComponentEnvironment, Status, CString, CString);
/// `fmi2CallbackAllocateMemory`; not used.
pub type CallbackAllocateMemory = unsafe extern "C" fn(usize, usize) -> *mut c_void;
/// `fmi2CallbackFreeMemory`; not used.
pub type CallbackFreeMemory = unsafe extern "C" fn(*mut c_void);
/// `fmi2StepFinished`; not used, steps are synchronous.
pub type StepFinished = unsafe extern "C" fn(ComponentEnvironment, Status);

/// `fmi2CallbackFunctions`
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub struct CallbackFunctions {
    pub logger: Option<CallbackLogger>,
    pub allocate_memory: Option<CallbackAllocateMemory>,
    pub free_memory: Option<CallbackFreeMemory>,
    pub step_finished: Option<StepFinished>,
    pub component_environment: ComponentEnvironment,
}

/// `fmi2EventInfo`
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)]
pub struct EventInfo {
    pub new_discrete_states_needed: Bool,
    pub terminate_simulation: Bool,
    pub nominals_of_continuous_states_changed: Bool,
    pub values_of_continuous_states_changed: Bool,
    pub next_event_time_defined: Bool,
    pub next_event_time: f64,
}
