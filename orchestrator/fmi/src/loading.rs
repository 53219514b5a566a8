//! Loading and unloading of a library: both run code of the FMU, which may crash, end the program, change what belongs
//! to the whole of it, or leave threads behind.

use std::path::Path;

use super::last_words::{self, Label};
use super::library::Binding;
use super::surroundings::Surroundings;

/// A library that is being loaded: what ends the program as long as this lives is said to happen there.
pub(super) struct Loading<'a> {
    label: Label,
    surroundings: Option<Surroundings<'a>>,
    threads: usize,
}

impl<'a> Loading<'a> {
    /// Begins, for the FMU that messages call `path`.
    pub(super) fn begin(path: &'a Path) -> Box<Self> {
        let (label, surroundings) = (Label::of_library(path), Some(Surroundings::of(path)));
        // In a box, since the note of the call points to the label.
        let loading = Box::new(Loading { label, surroundings, threads: threads() });
        last_words::enter(&loading.label, "the loading of its library");
        loading
    }

    /// The loaded code.
    pub(super) fn end(&self, binding: Binding) -> Code {
        Code { label: self.label.clone(), binding: Some(binding), threads: self.threads }
    }
}

impl Drop for Loading<'_> {
    fn drop(&mut self) {
        last_words::leave();
        if let Some(surroundings) = self.surroundings.take() {
            surroundings.set_back();
        }
    }
}

/// Code of a library in this process.
pub(super) struct Code {
    label: Label,
    binding: Option<Binding>,
    /// Threads of the process before it was loaded.
    threads: usize,
}

impl Drop for Code {
    fn drop(&mut self) {
        let binding = self.binding.take();
        if threads() > self.threads {
            // One of them may be in this code, which therefore stays.
            std::mem::forget(binding);
            return;
        }
        last_words::enter(&self.label, "the unloading of its library");
        drop(binding);
        last_words::leave();
    }
}

/// Threads of this process; 0 where the system does not say.
pub(crate) fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").map_or(0, Iterator::count)
}
