//! FMUs in processes of their own: what a third-party library does to its process is not done to ours.
//!
//! One worker process holds the library of one FMU with all its instances. The functions of such a library
//! (`proxy`) have the signatures of FMI and pass each call on through shared memory (`area`, `calls`), so that
//! instances and masters know nothing of it. A worker that crashes, exits, or does not answer in time is an
//! [`Error::Lost`](crate::Error::Lost), which names function, signal or exit code, and what was printed.
//!
//! Setters are deferred and sent with the next call of their instance, and where a step was followed by the same
//! reading before, its values come with the answer of the step: a communication step is then one turn of the worker.

#![allow(unsafe_code, reason = "memory shared with another process, and functions with the signatures of C")]

mod area;
mod calls;
mod channel;
mod mark;
mod patience;
mod process;
mod proxy;
#[cfg_attr(target_os = "linux", path = "linux.rs")]
#[cfg_attr(not(target_os = "linux"), path = "elsewhere.rs")]
mod system;
mod worker;

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Duration;

pub(crate) use calls::LOST;
pub(crate) use channel::{Channel, Death};
pub use process::{Process, cause};
pub(crate) use proxy::{forget, functions, instantiate, refused_setter};
pub use worker::serve;

/// FMUs that run in processes of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// All of them.
    All,
    /// Those whose `generationTool` is not airloop.
    ThirdParty,
}

/// How workers are made and what they may take.
#[derive(Debug, Clone)]
pub struct Isolation {
    /// FMUs that get a worker.
    pub which: Which,
    /// Program that calls [`serve`], and its arguments.
    pub program: PathBuf,
    /// See `program`.
    pub arguments: Vec<OsString>,
    /// Longest duration of one call.
    pub call_limit: Duration,
    /// Address space of a worker \[bytes\].
    pub memory_limit: u64,
}

static CHOICE: RwLock<Option<Arc<Isolation>>> = RwLock::new(None);
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static NOTES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Loads libraries from now on as this says, in the whole process.
pub fn choose(isolation: Option<Isolation>) {
    *CHOICE.write().unwrap_or_else(PoisonError::into_inner) = isolation.map(Arc::new);
}

/// The choice for an FMU made by `tool`.
pub(crate) fn choice(tool: &str) -> Option<Arc<Isolation>> {
    let choice = CHOICE.read().unwrap_or_else(PoisonError::into_inner).clone()?;
    let wanted = choice.which == Which::All || !tool.starts_with("airloop");
    wanted.then_some(choice)
}

/// Whether the library of an FMU made by `tool` (its `generationTool`) gets a worker.
pub fn applies_to(tool: &str) -> bool {
    choice(tool).is_some()
}

/// Ends calls that are in progress in workers soon, as the user asked for the end: from a handler of signals, say.
pub fn interrupt() {
    INTERRUPTED.store(true, Ordering::Relaxed);
}

fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Takes the notes on workers that failed after their results were taken, and on changes that libraries made to this
/// process, one sentence each; they are forgotten here.
pub fn take_notes() -> Vec<String> {
    std::mem::take(&mut NOTES.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Adds a sentence, unless it was said already.
pub(crate) fn note(text: String) {
    let mut notes = NOTES.lock().unwrap_or_else(PoisonError::into_inner);
    if !notes.contains(&text) {
        notes.push(text);
    }
}
