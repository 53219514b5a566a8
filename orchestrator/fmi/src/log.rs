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
        write!(f, "] {}", printable(&self.text))
    }
}

/// Replaces references to variables such as `#r12#` by what `name` gives for base type and value reference, and `##`
/// by `#` (FMI 2.0.5 section 2.1.5).
pub(super) fn resolve(text: &str, name: impl Fn(char, u32) -> Option<String>) -> String {
    let mut resolved = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('#') {
        resolved.push_str(before);
        let Some((reference, next)) = after.split_once('#') else {
            resolved.push('#');
            rest = after;
            continue;
        };
        let mut characters = reference.chars();
        let variable = characters.next().and_then(|base| name(base, characters.as_str().parse().ok()?));
        match variable {
            _ if reference.is_empty() => resolved.push('#'),
            Some(variable) => resolved.push_str(&variable),
            None => {
                // No reference: the second # may begin one.
                resolved.push('#');
                rest = after;
                continue;
            }
        }
        rest = next;
    }
    resolved + rest
}

/// Text without control characters, which a terminal would obey.
pub(crate) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() && c != '\n' { '\u{fffd}' } else { c }).collect()
}

/// Told every message as it comes.
type Mirror = Box<dyn Fn(&LogMessage) + Send + Sync>;

/// The messages of one instance. The FMU may log from any thread.
#[derive(Default)]
pub(super) struct LogBuffer(Mutex<VecDeque<LogMessage>>, Option<Mirror>);

impl LogBuffer {
    /// A buffer that also passes all messages on.
    pub(super) fn mirrored(mirror: impl Fn(&LogMessage) + Send + Sync + 'static) -> LogBuffer {
        LogBuffer(Mutex::default(), Some(Box::new(mirror)))
    }

    /// Adds a message; the oldest goes where there is no place.
    pub(super) fn push(&self, message: LogMessage) {
        let mut messages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == CAPACITY {
            messages.pop_front();
        }
        if let Some(mirror) = &self.1 {
            mirror(&message);
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

/// A C string as text; NULL is empty, bytes that are not UTF-8 are replaced.
pub(super) fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: not null; the FMU passes NUL-terminated strings that live during the call (FMI 2.0.5 section 2.1.5).
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::resolve;

    #[test]
    fn references_in_messages_become_names() {
        let name = |base, reference| (base == 'r' && reference == 12).then(|| "v_min".to_owned());
        let cases = [
            ("#r12# < 0", "v_min < 0"),
            ("a ## b", "a # b"),
            ("#i12# and #r12#", "#i12# and v_min"),
            ("item # 1", "item # 1"),
            ("#r99#", "#r99#"),
            ("#", "#"),
            ("plain", "plain"),
        ];
        for (text, expected) in cases {
            assert_eq!(resolve(text, name), expected, "{text}");
        }
    }
}
