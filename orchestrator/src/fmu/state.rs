//! Saved FMU states: which pointers an instance owns, so that none is leaked, freed twice or given to a stranger.

use std::ffi::c_void;
use std::sync::atomic::{AtomicU64, Ordering};

/// A saved state of one instance. The instance owns the memory and frees what is left when it is dropped; give the
/// handle back with [`Instance::free_state`](super::Instance::free_state) to free it earlier.
#[derive(Debug, PartialEq, Eq)]
pub struct StateHandle {
    owner: u64,
    slot: usize,
}

/// The states that an instance holds.
#[derive(Debug)]
pub(super) struct States {
    owner: u64,
    slots: Vec<*mut c_void>,
    free: Vec<usize>,
}

impl States {
    pub(super) fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        States { owner: NEXT.fetch_add(1, Ordering::Relaxed), slots: Vec::new(), free: Vec::new() }
    }

    /// A handle for a state that the FMU has just made.
    pub(super) fn insert(&mut self, state: *mut c_void) -> StateHandle {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.slots.push(std::ptr::null_mut());
            self.slots.len() - 1
        });
        self.slots[slot] = state;
        StateHandle { owner: self.owner, slot }
    }

    /// The pointer behind a handle, if the handle is of this instance.
    pub(super) fn pointer(&self, handle: &StateHandle) -> Option<*mut c_void> {
        if handle.owner == self.owner { self.slots.get(handle.slot).copied() } else { None }
    }

    /// Stores where the state behind a handle of this instance lies now.
    pub(super) fn update(&mut self, handle: &StateHandle, state: *mut c_void) {
        self.slots[handle.slot] = state;
    }

    /// Takes the handle back and yields its pointer for fmi2FreeFMUstate.
    pub(super) fn remove(&mut self, handle: StateHandle) -> Option<*mut c_void> {
        let pointer = self.pointer(&handle)?;
        self.update(&handle, std::ptr::null_mut());
        self.free.push(handle.slot);
        Some(pointer)
    }

    /// All pointers that are still to be freed.
    pub(super) fn drain(&mut self) -> impl Iterator<Item = *mut c_void> + '_ {
        self.slots.drain(..).filter(|pointer| !pointer.is_null())
    }
}
