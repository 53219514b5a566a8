//! Log messages of an instance: a bounded buffer that the C logger shim writes to.

#![allow(unsafe_code, reason = "the FMU calls the logger through C")]

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::fmt;
use std::sync::{Mutex, PoisonError};

/// An instance keeps this many messages; older ones are dropped.
const CAPACITY: usize = 256;

/// One message of an FMU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogMessage {
    /// Instance name as the FMU gave it.
    pub instance: String,
    /// Status as in the standard: 0 OK, 1 Warning, 2 Discard, 3 Error, 4 Fatal, 5 Pending.
    pub status: u32,
    /// Category as in the model description.
    pub category: String,
    /// Text.
    pub text: String,
}

impl fmt::Display for LogMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let status = match self.status {
            0 => "OK",
            1 => "Warning",
            2 => "Discard",
            3 => "Error",
            4 => "Fatal",
            5 => "Pending",
            _ => "unknown status",
        };
        write!(f, "[{status}")?;
        if !self.category.is_empty() {
            write!(f, ", {}", self.category)?;
        }
        write!(f, "] {}", self.text)
    }
}

/// The messages of one instance. The FMU may log from any thread.
#[derive(Debug, Default)]
pub(super) struct LogBuffer(Mutex<VecDeque<LogMessage>>);

impl LogBuffer {
    fn push(&self, message: LogMessage) {
        let mut messages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == CAPACITY {
            messages.pop_front();
        }
        messages.push_back(message);
    }

    /// All messages, which leave the buffer.
    pub(super) fn drain(&self) -> Vec<LogMessage> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).drain(..).collect()
    }

    /// The last `count` messages, which stay in the buffer.
    pub(super) fn tail(&self, count: usize) -> Vec<LogMessage> {
        let messages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        messages.iter().skip(messages.len().saturating_sub(count)).cloned().collect()
    }
}

unsafe extern "C" {
    /// The variadic `fmi2CallbackLogger`, in `logger.c`: formats the message and calls [`airloop_fmu_log`].
    pub(super) fn airloop_fmi2_logger(
        environment: *mut c_void,
        instance: *const c_char,
        status: u32,
        category: *const c_char,
        message: *const c_char,
        ...
    );
}

/// Stores a formatted message in the buffer of the instance.
#[unsafe(no_mangle)]
extern "C" fn airloop_fmu_log(
    environment: *mut c_void,
    instance: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    if environment.is_null() {
        return;
    }
    // SAFETY: `environment` is the componentEnvironment passed to fmi2Instantiate, a `LogBuffer` in a box that the
    // instance frees only after fmi2FreeInstance; it is shared, never borrowed mutably.
    let buffer = unsafe { &*environment.cast::<LogBuffer>() };
    let message = LogMessage {
        instance: text(instance),
        status: u32::try_from(status).unwrap_or(u32::MAX),
        category: text(category),
        text: text(message),
    };
    buffer.push(message);
}

/// A C string as text; NULL is empty, bytes that are no UTF-8 are replaced.
fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: not null; the FMU passes NUL-terminated strings that live during the call (FMI 2.0.5 section 2.1.5).
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}
