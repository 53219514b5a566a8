//! Saved FMU states: which pointers an instance owns, so that none is leaked, freed twice or given to a stranger.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::c_void;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Error, Instance};

/// A serialized state that is longer is refused: such a number is a fault of the library, and no memory is to be had
/// for it.
const MAX_STATE_BYTES: usize = 1 << 30;

/// A saved state of one instance. The instance owns the memory and frees what is left when it is dropped; give the
/// handle back with [`Instance::free_state`](Instance::free_state) to free it earlier.
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

impl Instance {
    /// Saves the state into `slot`, using again the memory of the state that is there.
    ///
    /// # Errors
    /// The handle in `slot` belongs to another instance, the function is missing, or the FMU refuses.
    pub fn get_state(&mut self, slot: &mut Option<StateHandle>) -> Result<(), Error> {
        let function = "fmi2GetFMUstate";
        self.alive(function)?;
        let call = self.functions.get_state.ok_or_else(|| self.missing(function))?;
        let mut state = match slot {
            Some(handle) => self.states.pointer(handle).ok_or_else(|| self.not_own_state(function))?,
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
        let state = self.states.pointer(handle).ok_or_else(|| self.not_own_state(function))?;
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
        let mut state = self.states.remove(handle).ok_or_else(|| self.not_own_state(function))?;
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
        let state = self.states.pointer(handle).ok_or_else(|| self.not_own_state(function))?;
        let mut size = 0;
        // SAFETY: the component is alive; the state is one that this instance made; the pointer is to a local.
        let status = unsafe { size_of(self.component, state, &raw mut size) };
        self.check("fmi2SerializedFMUstateSize", status)?;
        let mut bytes = Vec::new();
        if size > MAX_STATE_BYTES || bytes.try_reserve_exact(size).is_err() {
            return Err(Error::StateSize {
                component: self.name.clone(),
                function: self.c_name("fmi2SerializedFMUstateSize"),
                size,
            });
        }
        bytes.resize(size, 0_u8);
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

    #[cold]
    fn not_own_state(&self, function: &'static str) -> Error {
        Error::StateOfAnotherInstance { component: self.name.clone(), function }
    }
}
