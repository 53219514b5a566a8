//! A mark in the environment of a confined process, by which all that it started is found, also what has left its
//! group (`setsid`).
//!
//! A process that cleans its environment and leaves the group is not found.

use std::ffi::{OsStr, OsString};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};

use super::system;

/// Variable of the environment. Its value ends in a number for each process that confines another, from the outermost
/// one on: `PID.NUMBER/PID.NUMBER/`.
const VARIABLE: &str = "AIRLOOP_CONFINED";
/// Rounds of looking for processes: while one round runs, they may start others.
const ROUNDS: usize = 100;

/// The mark of one confined process.
pub(super) struct Mark(OsString);

impl Mark {
    /// Gives the process that `command` starts a mark of its own.
    pub(super) fn set(command: &mut Command) -> Mark {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let mut value = std::env::var_os(VARIABLE).unwrap_or_default();
        value.push(format!("{}.{}/", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed)));
        command.env(VARIABLE, &value);
        Mark(value)
    }

    /// Ends all processes that carry the mark.
    pub(super) fn end_all(&self) {
        let mut entry = OsString::from(VARIABLE);
        entry.push("=");
        entry.push(&self.0);
        for _ in 0..ROUNDS {
            if system::end_those_with(OsStr::as_encoded_bytes(&entry)) == 0 {
                return;
            }
        }
    }
}
